"""The types for a vehicle: those that the options name, of the current folder, or of the vehicle's release."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import InputError, few, input_error
from msggen.cli.packages import import_package, topics_of
from msggen.cli.printing import print_notices
from msggen.cli.source_options import is_named, settings_of, sources_of
from msggen.generate.cache import package_from, package_of
from msggen.sources.bridged import with_borrowed_bridge
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import Sources, find_sources
from msggen.sources.settings import Settings

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.messages.lookup import Named
    from msggen.messages.packages import Endpoint, Message
    from msggen.vehicle.vehicle import Vehicle


class Types(NamedTuple):
    """A generated package with the messages of a vehicle, and its name for people."""

    package: ModuleType
    label: str


def is_given(options: argparse.Namespace) -> bool:
    """Whether the options name types."""
    return bool(options.px4 or options.types)


def given_types(options: argparse.Namespace) -> Types | None:
    """Return the types that the options name, or None. Raises InputError if they cannot be used."""
    if options.px4:
        sources = _named_sources(options.px4)
        return _with_topics(Types(package_from(sources), sources.label if sources.is_installed else options.px4))
    return _with_topics(Types(import_package(options.types), options.types)) if options.types else None


def _named_sources(px4: str) -> Sources:
    """Return the firmware that an option names, with the topics of its release if it is px4_msgs. Raises InputError.

    Prints a note on the folder of an installed package.
    """
    sources = find_sources(px4)
    if sources.is_installed:
        print_notices(sources.notices)
    return with_borrowed_bridge(sources)


def folder_types(options: argparse.Namespace, *, is_needed: bool = False) -> Types | None:
    """Return the types of the current folder: its setting `types`, or else the firmware that `build` reads there.

    Returns None if it names none, and with a warning if a tree in it cannot be read, unless `is_needed`. Raises
    InputError if the types of the settings cannot be used.
    """
    settings = settings_of(options)
    if settings.types:
        package = import_package(settings.types, os.path.dirname(settings.origin))
        return _with_topics(Types(package, settings.types))
    found = folder_firmware(options, is_needed=bool(is_needed or settings.px4 or settings.msg_dir))
    if found is None or _has_topics(found.package):
        return found
    if is_needed:
        text = "has no topics of the bridge, because it has no dds_topics.yaml: name one with the setting topics"
        print(f"warning: {found.label} {text}", file=sys.stderr)
    return None


def folder_firmware(options: argparse.Namespace, *, is_needed: bool = False) -> Types | None:
    """Return the types of the firmware that `build` reads in the current folder, or None.

    Returns None with a warning if a tree cannot be read, unless `is_needed`, which raises InputError.
    """
    try:
        sources = folder_sources(settings_of(options))
        return None if sources is None else Types(package_from(with_borrowed_bridge(sources)), sources.label)
    except InputError as error:
        if is_needed:
            raise
        print(f"warning: the current folder is not used: {error.diagnostics[0]}", file=sys.stderr)
        return None


def folder_sources(settings: Settings) -> Sources | None:
    """Return the firmware that `build` reads in the current folder, or None if it is an embedded release by default.

    Raises InputError.
    """
    none = dict.fromkeys(("px4", "msg_dir", "topics", "release", "board"))
    options = argparse.Namespace(**none, strict=False)
    return sources_of(options, settings, packages=False) if is_named(options, settings) else None


def known_types(options: argparse.Namespace) -> Types | None:
    """Return the types that the options or else the current folder name, or None. Raises InputError.

    They are read once for the options.
    """
    if "known_types" not in options:
        options.known_types = given_types(options) or folder_types(options)
    found: Types | None = options.known_types
    return found


def expected_types(options: argparse.Namespace) -> Types:
    """Return the types of a vehicle before it has connected: the known ones, or those of the newest release.

    Raises InputError.
    """
    return known_types(options) or release_types(EMBEDDED[0])


def release_types(release: str) -> Types:
    """Return the types of an embedded release."""
    return Types(package_of(release), release)


def _with_topics(types: Types) -> Types:
    """Return types that have topics. Raises InputError for others."""
    if not _has_topics(types.package):
        raise input_error(types.label, "L103", "no topics of the bridge: no dds_topics.yaml", 0)
    return types


def _has_topics(package: ModuleType) -> bool:
    return bool(getattr(topics_of(package), "ENDPOINTS", ()))


class Chosen(NamedTuple):
    """The types for a vehicle, those with more of its definitions first."""

    types: tuple[Types, ...]
    told: frozenset[str] = frozenset()
    """The messages of which a warning says that the current folder has other definitions."""

    def fitting(self, vehicle: Vehicle, topic: Named) -> Named:
        """Return a topic with the vehicle's definition, as far as it has told it, from the first types that have it.

        Prints a warning if these are those of the vehicle's release instead of those of the current folder.
        """
        route = topic.route
        if route is None:
            return topic
        known, name = vehicle.firmware.hashes.get(route.ros_type), route.ros_type.rpartition("/")[2]
        for types in self.types:
            for endpoint in _versions(types.package, route):
                if _fits(endpoint, route, known):
                    is_instead = types is not self.types[0] and topic.endpoint is not None
                    if is_instead and types.label in EMBEDDED and name not in self.told:
                        _warn(self.types[0].label, [name], types.label)
                    return topic._replace(endpoint=endpoint)
        return topic


def types_for(vehicle: Vehicle, known: Types | None) -> Chosen:
    """Return the types of a vehicle that is connected: those of its release, and `known` of the current folder.

    A warning says which messages of `known` differ from the vehicle's. It may tell further definitions later.
    """
    firmware = vehicle.firmware
    if not firmware.release:
        return Chosen((known or release_types(EMBEDDED[0]),))
    if known is None:
        return Chosen((release_types(firmware.release),))
    wrong = differing(known.package, vehicle)
    if not wrong and firmware.is_complete:
        return Chosen((known,))
    own = release_types(firmware.release)
    if not wrong:
        return Chosen((known, own))
    _warn(known.label, wrong, firmware.release)
    is_nearer = len(differing(own.package, vehicle)) < len(wrong)
    return Chosen((own, known) if is_nearer else (known, own), frozenset(wrong))


def differing(package: ModuleType, vehicle: Vehicle) -> list[str]:
    """Return the messages of a package that are not those of a vehicle, as far as it has told them, by name."""
    from msggen.messages.names import without_namespace

    hashes, namespace = vehicle.firmware.hashes, vehicle.remote.namespace
    named = {endpoint.ros_name: endpoint for endpoint in package.topics.ENDPOINTS}  # faster than a search by name
    found = set()
    for route in vehicle.routes:
        known, same = hashes.get(route.ros_type), named.get(without_namespace(route.name, namespace))
        if same is not None and _fits(same, route, known):
            continue
        versions = [*_versions(package, route)]
        if versions and not any(_fits(endpoint, route, known) for endpoint in versions):
            found.add(route.ros_type.rpartition("/")[2])
    return sorted(found)


def _versions(package: ModuleType, route: Route) -> Iterator[Endpoint[Message]]:
    try:
        yield from reversed(package.topics.versions_of(route.name))
    except KeyError:
        return


def _fits(endpoint: Endpoint[Message], route: Route, known: int | None) -> bool:
    """Whether an endpoint has the definition of a route, whose hash is `known` if the vehicle has told it."""
    from msggen.messages.packages import has_definition

    return has_definition(endpoint.message, route, known)


def _warn(label: str, messages: Sequence[str], release: str) -> None:
    text = f"the vehicle has other definitions than {label}, of {few(messages)}: those of PX4 {release} are used"
    print(f"warning: {text}; name the vehicle's firmware with --px4", file=sys.stderr, flush=True)
