"""The link of commands that talk to a vehicle: its options, and the vehicle that they name."""

from __future__ import annotations

import argparse
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from msggen.base.diagnostics import InputError, few, input_error
from msggen.base.location import Location
from msggen.cli.chosen_types import Chosen, Types, is_given, known_types, release_types, types_for
from msggen.cli.options import Group, WrongArgumentError, add_flag, add_repeatable, add_shared, add_value
from msggen.cli.source_options import settings_of
from msggen.cli.values import KEY, Deferred, local_path, non_empty, positive
from msggen.link.link_types import DEFAULT, ROUTER_PORT, usages
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from msggen.link.address import Address
    from msggen.link.link import LinkError
    from msggen.messages.lookup import Named
    from msggen.vehicle.vehicle import Vehicle

Check: TypeAlias = Callable[[ModuleType], object]
"""Checks names in the arguments of a command with a generated package."""

PATIENCE = 30.0
"""How long to wait for a vehicle, in s: PX4's client takes up to 14 s to notice that a program has ended."""

_LOOPBACK: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - to send to, not to listen
"""Where to send to a link that listens on all addresses."""
_NOTICE = 3.0
"""How long to wait in s before saying so: PX4's client asks for an agent on this computer every 2 s."""
_AT_ONCE = 0.5
"""How long to wait in s before the names in the arguments are checked with the types of a vehicle that is not there."""
_CALLS = re.compile(r"[;:] [^;:]*\b(?:wait_connected|routes|encode)\(.*")
"""The end of an error that names what programs call."""
_KEYWORDS = re.compile(r"\b(allow|key|namespace)=(?=[, ])")
_CHOICE = "Say which one is meant: --key {key}, or --namespace"
_TYPES_CURE = "name the vehicle's firmware, --px4 PX4-Autopilot, or its package, --types"


class Connection(NamedTuple):
    """A connected vehicle, and the generated package with its messages.

    `link` is the address. `label` names the package for people: its release, or the value of --types.
    `chosen` are all types that the vehicle's definitions are looked for in.
    """

    vehicle: Vehicle
    package: ModuleType
    link: str
    label: str
    chosen: Chosen = Chosen(())

    @property
    def has_one_package(self) -> bool:
        """Whether no other types may have the vehicle's definition of a topic."""
        return len(self.chosen.types) < 2  # noqa: PLR2004

    def fitting(self, topic: Named) -> Named:
        """Return a topic with the vehicle's definition, if the vehicle has told it and one of the types has it."""
        return self.chosen.fitting(self.vehicle, topic)


def add_link(parser: argparse.ArgumentParser, *, has_types: bool = True) -> None:
    """Add the options that name a link, the vehicle on it, and the types of its messages if it has them."""
    group = parser.add_argument_group("link")
    add_address(group)
    if has_types:
        add_types(group)
    add_value(group, "--key", "N", KEY, "key of the vehicle, its UXRCE_DDS_KEY")
    add_value(group, "--namespace", "NAME", non_empty, "namespace of the vehicle")
    add_allowed(group)
    add_flag(group, "--direct", "own the link in this process; no other program can use it meanwhile")
    add_value(group, "--wait", "SECONDS", positive, f"wait this long for a vehicle (default: {PATIENCE:g})")


def add_types(group: Group) -> None:
    """Add the options that name the types of messages."""
    source = group.add_mutually_exclusive_group()
    text = (
        "generated package with the vehicle's messages (default: the setting `types`, the firmware of the "
        "settings or in the current folder if the vehicle has it, or else the vehicle's embedded release)"
    )
    add_value(source, "--types", "NAME|DIR", local_path, text)
    add_shared(source, "--px4")


def add_address(group: Group) -> None:
    """Add the option that names a link."""
    text = f"{usages()} (default: the setting `link`, or {DEFAULT})"
    add_value(group, "--link", "URL", non_empty, text)


@Deferred
def router(text: str) -> str:
    """Return the address of a link at the router with a locator of Zenoh, and perhaps a configuration."""
    found = re.fullmatch("tcp/(.+)", text)
    if not found:
        raise argparse.ArgumentTypeError(f"expected a locator such as tcp/127.0.0.1:{ROUTER_PORT}, found {text!r}")
    return f"zenoh://{found[1]}"


def add_allowed(group: Group) -> None:
    """Add the option that names who may connect."""
    text = "address of a vehicle that may connect, if the link is open to a network"
    add_repeatable(group, "--allow", "ADDRESS", non_empty, text)


@contextmanager
def connection(
    options: argparse.Namespace, check: Check | None = None, *, needs_types: bool = True, acts: bool = False
) -> Iterator[Connection]:
    """Connect to the vehicle that the options of `add_link` name, and close the link at the end.

    Types that the options name are used in any case. Those of the current folder are used for the topics of which they
    have the vehicle's definition, and those of the vehicle's release for others, with a warning.

    `check` gets the package of a vehicle that has not connected yet, and raises WrongArgumentError or InputError for
    names that it does not have. If no types are known, any embedded release may have them, or with `needs_types` False
    the vehicle alone. Says on stderr that it waits, if nothing connects for a while. Raises InputError if the link
    cannot be opened, or nothing connects.

    With `acts`, the command changes what the vehicle does: it waits until all vehicles on the link have connected, and
    several are an error unless the options say which one is meant.
    """
    from msggen.vehicle.alone import wait_alone
    from msggen.vehicle.vehicle import Vehicle

    link, known = link_of(options), known_types(options)
    absent = _check_of_absent(options, check, known, needs_types=needs_types)
    told: list[str] = []
    selection = {name: getattr(options, name) for name in ("namespace", "key", "allow", "direct")}
    with link_errors(link), ExitStack() as stack:

        def opened(*types: Types) -> Vehicle:
            vehicle = stack.enter_context(Vehicle(link, [each.package for each in types], **selection))
            if vehicle.url != link and vehicle.url not in told:
                told.append(vehicle.url)
                print(f"listening on {vehicle.url}", file=sys.stderr, flush=True)
            _wait(vehicle, vehicle.url, options.wait or PATIENCE, absent)
            return vehicle

        first: tuple[Types, ...] = (known or release_types(EMBEDDED[0]),)
        vehicle = opened(*first)
        chosen = Chosen((known,)) if known and is_given(options) else types_for(vehicle, known)
        if chosen.types != first:
            before, vehicle = vehicle, opened(*chosen.types)  # on the link that is open
            before.close()
        if acts:
            wait_alone(vehicle, _CHOICE)
        package, label = chosen.types[0]
        yield Connection(vehicle, package, vehicle.url, label, chosen)


def _check_of_absent(
    options: argparse.Namespace, check: Check | None, known: Types | None, *, needs_types: bool
) -> Callable[[], object] | None:
    """Return what to check if no vehicle is there. For types that the options name, this is checked at once.

    Raises what `check` raises.
    """
    if check is None or (known is None and not needs_types):
        return None
    if known is None:
        return partial(_check_releases, check)
    if is_given(options):
        check(known.package)
        return None
    return partial(check, known.package)


def _check_releases(check: Check) -> None:
    """Raise the error of `check` for the newest release, if no release has the names."""
    from msggen.generate.cache import package_of

    errors: list[InputError | WrongArgumentError] = []
    for release in EMBEDDED:
        try:
            check(package_of(release))
        except (InputError, WrongArgumentError) as error:
            errors.append(error)
        else:
            return
    raise errors[0]


@contextmanager
def link_errors(place: str, *, has_owner: bool = True) -> Iterator[None]:
    """Raise InputError for an error of a link. `place` is its address; with `has_owner`, tell who has the port."""
    from msggen.link.link import LinkError

    try:
        yield
    except LinkError as error:
        text = for_people(error) + (owner_of(place, error) if has_owner else "")
        raise input_error(place, "L102", text, 0) from None


def for_people(error: LinkError) -> str:
    """Return the text of an error with options of the command line instead of what programs call in Python."""
    from msggen.link.link import FormatError

    if isinstance(error, FormatError):
        return f"{str(error).rpartition(': ')[0]}: {_TYPES_CURE}"
    return _KEYWORDS.sub(r"--\1", _CALLS.sub("", str(error)))


def owner_of(link: str, error: LinkError) -> str:
    """Return who has the port or the device of a link that could not be opened, as far as that can be known."""
    from msggen.doctor.sockets import owners_of
    from msggen.doctor.watching import is_taken
    from msggen.link.address import parse_address

    owners = owners_of(parse_address(link)) if is_taken(error) else ()
    return f"; {few(list(map(str, owners)))} has it" if owners else ""


def link_of(options: argparse.Namespace, named: str = "--link") -> str:
    """Return the address of the link that the options or the settings name, or the default one.

    `named` is the argument that names it. Raises InputError if the address is wrong.
    """
    if options.link:
        return str(_parsed(options.link, Location(named, 0)))
    settings = settings_of(options)
    return str(_parsed(settings.link, settings.place("link"))) if settings.link else DEFAULT


def agent_of(options: argparse.Namespace, named: str | None) -> str:
    """Return the address that clients connect to: the one that is named, or that of the link of the settings.

    Where that is no port of this computer, it is the default one: the other end of a serial line has another name.
    Raises InputError if the setting is wrong.
    """
    settings = settings_of(options)
    if named or not settings.link:
        return named or DEFAULT
    link = _parsed(settings.link, settings.place("link"))
    if link.link_type.has_router:  # which the vehicle and the programs look for
        return str(link)
    if not link.link_type.has_port or link.has_free_port:
        return DEFAULT
    return str(_parsed(DEFAULT, Location("", 0))._replace(host=_LOOPBACK.get(link.host, link.host), port=link.port))


def _parsed(link: str, place: Location) -> Address:
    """Return the parts of the address of a link. Raises InputError."""
    from msggen.link.address import parse_address
    from msggen.link.link import LinkError

    try:
        return parse_address(link)
    except LinkError as error:
        raise input_error(place.path, "L101", str(error), place.line, place.column) from None


def _wait(vehicle: Vehicle, link: str, patience: float, check: Callable[[], object] | None) -> None:
    """Wait for the vehicle. Raises LinkError, and what `check` raises if no vehicle is there."""

    def tell() -> None:
        print(f"waiting for a vehicle on {link}", file=sys.stderr, flush=True)

    if check is not None and not is_there(vehicle, min(_AT_ONCE, patience)):
        check()
    timer = threading.Timer(_NOTICE, tell)
    timer.daemon = True
    if patience > _NOTICE:
        timer.start()
    try:
        vehicle.wait_connected(patience)
    finally:
        timer.cancel()


def is_there(vehicle: Vehicle, seconds: float) -> bool:
    """Whether a vehicle connects within a time. Raises LinkError if the link has failed."""
    from msggen.link.link import LinkTimeoutError

    try:
        vehicle.wait_connected(seconds)
    except LinkTimeoutError:
        return False
    return True
