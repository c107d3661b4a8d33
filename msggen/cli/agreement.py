"""Which types have the definitions of a vehicle: those of the current folder, or those of the vehicle's release."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import few
from msggen.cli.chosen_types import Types, release_types
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.messages.lookup import Named
    from msggen.messages.packages import Endpoint, Message
    from msggen.vehicle.vehicle import Vehicle


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
    from msggen.messages.names import version_of

    info = endpoint.message.__msg__
    return info.message_version == version_of(route.name) and known in (None, info.message_hash)


def _warn(label: str, messages: Sequence[str], release: str) -> None:
    text = f"the vehicle has other definitions than {label}, of {few(messages)}: those of PX4 {release} are used"
    print(f"warning: {text}; name the vehicle's firmware with --px4", file=sys.stderr, flush=True)
