"""`msggen link`: the processes that own links for the programs of a user."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted, few, input_error
from msggen.cli.link import add_address, add_allowed, add_types, link_errors, link_of, router
from msggen.cli.options import Run, add_flag, add_shared, add_value, new_command, new_group
from msggen.cli.table import RED, YELLOW, Column, objects_of, print_table
from msggen.cli.values import non_empty
from msggen.link.link_types import LINK_TYPES, usages
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.vehicle.owned.joining import Wanted
    from msggen.vehicle.owned.owners import Running
    from msggen.vehicle.owned.places import Place
    from msggen.vehicle.owner.owner import Owner

_UNSENT = "not sent, because they came late"
_SHARED = tuple(scheme for scheme, link_type in LINK_TYPES.items() if link_type.is_shared)


@new_command(
    "serve",
    "own a link until Ctrl-C, and tell who uses it",
    "Own a link for all programs of the user until Ctrl-C or `msggen link stop`, and tell which "
    "vehicles connect, which programs join, and in a terminal how many samples arrive.",
)
def _add_serve(parser: argparse.ArgumentParser) -> Run:
    add_value(parser, "url", "URL", non_empty, "address of the link, instead of --link", nargs="?")
    add_address(parser)
    add_allowed(parser)
    text = (
        "also carry the vehicles to Zenoh, for programs on other computers and ROS 2: this is the address of a "
        "router, which this process is itself if the port is free; ?config=FILE after it names a configuration"
    )
    add_value(parser, "--zenoh", "tcp/HOST:PORT", router, text)
    add_types(parser)
    add_flag(parser, "--background", "return when programs can join")
    return _serve


@new_command(
    "list",
    "list the processes that own a link",
    "List the processes that own a link, with their vehicles, and the programs that use them.",
)
def _add_list(parser: argparse.ArgumentParser) -> Run:
    add_shared(parser, "--json")
    return _list


@new_command(
    "stop",
    "stop the process that owns a link",
    "Stop the process that owns a link. Programs that use the link start another one, which continues "
    "the session of the vehicle.",
)
def _add_stop(parser: argparse.ArgumentParser) -> Run:
    add_value(parser, "link", "URL", non_empty, "address of the link (default: the only one)", nargs="?")
    return _stop


add_to = new_group(
    "link",
    "own a link for other programs, list the processes that do, and stop one",
    "One process can open a link. The first program that needs it starts a process that owns it for "
    "all programs of the user, and that ends by itself when none uses it for a while.",
    (_add_serve, _add_list, _add_stop),
)


def _wanted(options: argparse.Namespace, named: str = "--link", *, is_networked: bool = False) -> tuple[Place, Wanted]:
    """Return the place and the link that the options name. With a network, it may be DDS, too. Raises InputError."""
    from msggen.link.address import parse_address
    from msggen.vehicle.owned.joining import Wanted
    from msggen.vehicle.owned.places import CAN_SHARE, place_of

    link = link_of(options, named)
    address = parse_address(link)
    is_meant = address.link_type.is_shared or (is_networked and address.link_type.has_domain)
    if not (CAN_SHARE and is_meant):
        text = f"'{link}' cannot be owned for others: expected {usages(_SHARED)}, on Linux or macOS"
        raise input_error(link, "L101", text, 0)
    if address.has_free_port:
        text = f"'{link}' names no port by which other programs would find the link: expected {usages(_SHARED)}"
        raise input_error(link, "L101", text, 0)
    with link_errors(link, has_owner=False):
        return place_of(address), Wanted(address, tuple(options.allow))


def _serve(options: argparse.Namespace) -> None:
    from msggen.vehicle.owned.joining import start_owner

    if options.url and options.link:
        options.parser.error("argument --link: the address of the link is given already: leave out one of them")
    options.link = options.url or options.link
    place, wanted = _wanted(options, is_networked=bool(options.zenoh))
    types = _types_of_network(options, wanted)
    with link_errors(str(wanted.address)):
        if not options.background:
            _own(place, wanted, options.zenoh, types)
            return
        if options.zenoh:
            from msggen.cli.commands.networked import PROCESS, setup_of

            start_owner(place, wanted, stays=True, module=PROCESS, further=setup_of(options.zenoh, types))
        else:
            start_owner(place, wanted, stays=True)
        print(f"{wanted.address} is open; its log is {place.log}")


def _types_of_network(options: argparse.Namespace, wanted: Wanted) -> ModuleType | None:
    """Return the types that the options or else the current folder name, if there is a network. Raises InputError."""
    from msggen.cli.chosen_types import is_given, known_types
    from msggen.link.address import parse_address

    if not options.zenoh:
        if is_given(options):
            options.parser.error("--types and --px4 are for --zenoh: without it, messages are not looked at")
        return None
    with link_errors(_locator(options.zenoh), has_owner=False):
        parse_address(options.zenoh)  # before anything is opened
    if wanted.address.link_type.has_router:
        text = "its vehicles are on Zenoh already: connect the routers with a configuration of Zenoh, connect/endpoints"
        options.parser.error(f"argument --zenoh: {text}")
    found = known_types(options)
    return found.package if found is not None else None


def _locator(link: str) -> str:
    """Return the locator of Zenoh that the user has named, of the link at it."""
    return link.replace("zenoh://", "tcp/", 1)


def _own(place: Place, wanted: Wanted, zenoh: str | None, types: ModuleType | None) -> None:
    """Own a link in this process, and print what happens."""
    from msggen.cli.commands.serving import printed_events
    from msggen.vehicle.owned.joining import alone
    from msggen.vehicle.owner.owner import LOGGER
    from msggen.vehicle.owner.process import never, serve

    with printed_events(LOGGER) as events, ExitStack() as joining, ExitStack() as starting:

        def ready(owner: Owner) -> None:
            if zenoh:
                from msggen.cli.commands.networked import networked

                with link_errors(_locator(zenoh), has_owner=False):
                    joining.enter_context(networked(zenoh, place, types))
            starting.close()
            events.follow(owner)

        starting.enter_context(alone(place))  # a program that starts now waits, and joins this process
        serve(place, wanted.address, wanted.allow, idle=never, ready=ready)


def _list(options: argparse.Namespace) -> None:
    found = _running()
    if options.json:
        print(dump(objects_of(_COLUMNS, found)))
        return
    if not found:
        print("no process owns a link")
    print_table(_COLUMNS, found, _programs)


def _programs(running: Running) -> list[str]:
    """Return a line for each program that uses a link."""
    shown = []
    for program in running.state.get("programs", ()):
        unread = f", {counted(program['unread'], 'sample')} not read in time" if program["unread"] else ""
        unsent = f", {counted(program['unsent'], 'message')} {_UNSENT}" if program["unsent"] else ""
        shown.append(f"  {program['name']} (pid {program['pid']}), for {_age(program['age'])}{unread}{unsent}")
    return shown


def _running() -> list[Running]:
    """Return the processes that own a link. Raises InputError."""
    from msggen.vehicle.owned.owners import running

    with link_errors("msggen link", has_owner=False):
        return running()


def _stop(options: argparse.Namespace) -> None:
    from msggen.vehicle.owned.owners import stop

    place = _place_to_stop(options)
    address = next((each.state.get("address", "") for each in _running() if each.place == place), "")
    with link_errors(place.name, has_owner=False):
        stop(place)
        print(f"{address or place.name} is closed")


def _place_to_stop(options: argparse.Namespace) -> Place:
    found = _running()
    if options.link:
        options.allow = []
        place, wanted = _wanted(options, "URL", is_networked=True)
        if any(each.place == place for each in found):
            return place
        raise input_error(str(wanted.address), "L102", f"no process owns it{_others(found)}", 0)
    if len(found) == 1:
        return found[0].place
    raise input_error(
        "msggen link stop",
        "L102",
        f"expected the address of a link{_others(found)}" if found else "no link is owned",
        0,
    )


def _others(found: list[Running]) -> str:
    """Return which links are owned, for an error."""
    owned = few([str(each.state.get("address", each.place.name)) for each in found])
    return f": {owned} {'are' if len(found) > 1 else 'is'} owned" if found else ", and no other link is owned"


def _age(seconds: float) -> str:
    """Return a time for people: `12 s`, `3 min`, `2 h`."""
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def _of(key: str, otherwise: object = None) -> Callable[[Running], Any]:
    return lambda running: running.state.get(key, otherwise)


def _vehicles(running: Running) -> list[str]:
    return [
        " ".join(filter(None, (each["address"], each["namespace"], each["release"])))
        for each in running.state.get("vehicles", ())
    ]


def _lost(running: Running) -> int:
    return sum(each["lost"] for each in running.state.get("vehicles", ()))


_COLUMNS: tuple[Column[Running], ...] = (
    Column("link", "link", lambda running: running.state.get("address", running.place.name)),
    Column("pid", "pid", _of("pid"), align=">"),
    Column("age", "age", _of("age"), _age, ">"),
    Column("vehicles", "vehicles", _vehicles, lambda vehicles: few(vehicles) if vehicles else "none"),
    Column("programs", "", _of("programs", [])),
    Column("", "programs", lambda running: len(running.state.get("programs", ())), align=">"),
    Column("samples_per_second", "samples/s", _of("rate"), lambda rate: f"{rate:.0f}", ">"),
    Column("lost", "lost", _lost, align=">", style=lambda lost: YELLOW if lost else 0),
    Column("socket", "", lambda running: running.place.socket),
    Column("log", "log", lambda running: running.place.log),
    Column("problem", "problem", lambda running: running.problem, style=lambda _: RED),
)
