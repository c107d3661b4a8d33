"""The link of commands that talk to a vehicle: its options, and the vehicle that they name."""

from __future__ import annotations

import argparse
import os
import re
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import few, input_error
from msggen.base.location import Location
from msggen.cli.options import Group, add_shared
from msggen.cli.packages import import_package, topics_of
from msggen.cli.sources import settings_of
from msggen.cli.values import KEY, local_path, non_empty, positive
from msggen.generate.cache import package_from, package_of
from msggen.live.links.link_types import DEFAULT, usages
from msggen.sources.embedded import EMBEDDED
from msggen.sources.sources import find_sources

if TYPE_CHECKING:
    from msggen.live import LinkError, Vehicle
    from msggen.live.link import Route

PATIENCE = 30.0
"""How long to wait for a vehicle, in s: PX4's client takes up to 14 s to notice that a program has ended."""

_NOTICE = 3.0
"""How long to wait in s before saying so: PX4's client asks for an agent on this computer every 2 s."""
_LOADING = 1.0
"""The time in s after which no further release is loaded."""
_IN_NAMESPACE = re.compile("(?!rt/fmu/)(?:rt/|/)?([^/]+(?:/.+)?)/fmu/(?:in|out)/")


class Connection(NamedTuple):
    """A connected vehicle, and the generated package with its messages.

    `link` is the address. `label` names the package for people: its release, or the value of --types.
    `knows_namespace` is False in a session of an earlier program that left no record of it.
    """

    vehicle: Vehicle
    package: ModuleType
    link: str
    label: str
    knows_namespace: bool = True


def add_link(parser: argparse.ArgumentParser, *, has_types: bool = True) -> None:
    """Add the options that name a link, the vehicle on it, and the types of its messages if it has them."""
    group = parser.add_argument_group("link")
    add_address(group)
    if has_types:
        source = group.add_mutually_exclusive_group()
        source.add_argument(
            "--types",
            metavar="NAME|DIR",
            type=local_path,
            help="generated package with the vehicle's messages (default: the setting `types`, or the embedded release "
            "that the vehicle has)",
        )
        add_shared(source, "--px4")
    group.add_argument("--key", metavar="N", type=KEY, help="key of the vehicle, its UXRCE_DDS_KEY")
    group.add_argument("--namespace", metavar="NAME", type=non_empty, help="namespace of the vehicle")
    add_allowed(group)
    group.add_argument(
        "--direct", action="store_true", help="own the link in this process; no other program can use it meanwhile"
    )
    group.add_argument(
        "--wait", metavar="SECONDS", type=positive, help=f"wait this long for a vehicle (default: {PATIENCE:g})"
    )


def add_address(group: Group) -> None:
    """Add the option that names a link."""
    text = f"{usages()} (default: the setting `link`, or {DEFAULT})"
    group.add_argument("--link", metavar="URL", type=non_empty, help=text)


def add_allowed(group: Group) -> None:
    """Add the option that names who may connect."""
    text = "address of a vehicle that may connect, if the link is open to a network; repeatable"
    group.add_argument("--allow", metavar="ADDRESS", type=non_empty, action="append", default=[], help=text)


@contextmanager
def connection(options: argparse.Namespace) -> Iterator[Connection]:
    """Connect to the vehicle that the options of `add_link` name, and close the link at the end.

    Says on stderr that it waits, if nothing connects for a while. Raises InputError if the link cannot be opened, or
    nothing connects.

    A session that an earlier program began is continued. If that left no record of the session, its topics must be
    those of the given types, or else of the newest release, and its namespace is not known (docs/vehicle.md). If the
    user names a topic in a namespace, that selects the vehicle then, as --namespace does.
    """
    from msggen.live import LinkError, Vehicle
    from msggen.live.vehicle.selection import is_unnamed

    link = link_of(options)
    given = given_package(options)
    package = given or _newest()
    told: list[str] = []
    selection = {name: getattr(options, name) for name in ("namespace", "key", "allow", "direct")}
    try:
        with ExitStack() as stack:

            def opened(types: ModuleType) -> Vehicle:
                vehicle = stack.enter_context(Vehicle(link, types, **selection))
                if vehicle.url != link and vehicle.url not in told:
                    told.append(vehicle.url)
                    print(f"listening on {vehicle.url}", file=sys.stderr, flush=True)
                _wait(vehicle, vehicle.url, options.wait or PATIENCE)
                return vehicle

            known = package
            vehicle = opened(known)
            named = _named_namespace(options)
            if is_unnamed(vehicle.remote) and not vehicle.remote.namespace and named and not options.namespace:
                vehicle.close()
                selection["namespace"] = named
                vehicle = opened(known)
            release = vehicle.firmware.release
            label = options.types or options.px4 or package.__name__
            if given is None and release:
                package, label = package_of(release), release
            if package is not known:
                first, vehicle = vehicle, opened(package)  # on the link that is open
                first.close()
            remote = vehicle.remote
            knows_namespace = bool(remote.namespace) or not is_unnamed(remote)
            yield Connection(vehicle, package, vehicle.url, label, knows_namespace)
    except LinkError as error:
        raise input_error(link, "L102", f"{error}{owner_of(link, error)}", 0) from None


def owner_of(link: str, error: LinkError) -> str:
    """Return who has the port or the device of a link that could not be opened, as far as that can be known."""
    from msggen.doctor.observe import is_taken
    from msggen.doctor.sockets import owners_of
    from msggen.live.links.address import parse_address

    owners = owners_of(parse_address(link)) if is_taken(error) else ()
    return f"; {few(list(map(str, owners)))} has it" if owners else ""


def _named_namespace(options: argparse.Namespace) -> str:
    """Return the namespace of the first topic that the user names in one, or ""."""
    topics = [getattr(options, "topic", None) or "", *getattr(options, "topics", ())]
    found = filter(None, map(_IN_NAMESPACE.match, topics))
    return next((each[1] for each in found), "")


def link_of(options: argparse.Namespace) -> str:
    """Return the address of the link that the options or the settings name, or the default one.

    Raises InputError if the address is wrong.
    """
    from msggen.live.link import LinkError
    from msggen.live.links.address import parse_address

    settings = settings_of(options)
    link = str(options.link or settings.link or DEFAULT)
    try:
        return str(parse_address(link))
    except LinkError as error:
        place = Location("--link", 0) if options.link else settings.place("link")
        raise input_error(place.path, "L101", str(error), place.line, place.column) from None


def expected_package(options: argparse.Namespace) -> ModuleType:
    """Return the package that `connection` begins with: the given one, or that of the newest release.

    Raises InputError.
    """
    return given_package(options) or _newest()


def routes_to_continue(options: argparse.Namespace) -> tuple[Route, ...]:
    """Return the routes with which a process that has no types continues a session without a record.

    They are those of the package that the options or the settings name, or else of the embedded releases, the newest
    first, as many as are loaded in a second: a vehicle waits for an answer for 3 s, and a package that is not built yet
    takes about a second. Raises InputError.
    """
    from msggen.live.links.known import joined
    from msggen.live.messages.packages import known_routes

    given = given_package(options)
    if given is not None:
        return joined(known_routes((given,)))
    packages, end = [_newest()], time.monotonic() + _LOADING
    for release in EMBEDDED[1:]:
        if time.monotonic() > end:
            break
        packages.append(package_of(release))
    return joined(known_routes(tuple(packages)))


def _newest() -> ModuleType:
    return package_of(EMBEDDED[0])


def given_package(options: argparse.Namespace) -> ModuleType | None:
    """Return the package that the options or the settings name, or None. Raises InputError if it cannot be used."""
    settings = settings_of(options)
    px4, types = getattr(options, "px4", None), getattr(options, "types", None)
    named = px4 or types or settings.types
    if named is None:
        return None
    if px4:
        found = package_from(find_sources(px4))
    else:
        found = import_package(named, "" if types else os.path.dirname(settings.origin))
    if not getattr(topics_of(found), "ENDPOINTS", ()):
        raise input_error(named, "L103", "no topics of the bridge: no dds_topics.yaml", 0)
    return found


def _wait(vehicle: Vehicle, link: str, patience: float) -> None:
    """Wait for the vehicle. Raises LinkError."""

    def tell() -> None:
        print(f"waiting for a vehicle on {link}", file=sys.stderr, flush=True)

    timer = threading.Timer(_NOTICE, tell)
    timer.daemon = True
    if patience > _NOTICE:
        timer.start()
    try:
        vehicle.wait_connected(patience)
    finally:
        timer.cancel()
