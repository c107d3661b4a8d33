"""What programs ask the owner of a link for."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from typing import Any

from msggen.base.foreign import escaped
from msggen.base.version import __version__
from msggen.link.address import Address, parse_address
from msggen.link.link import Kept, Publisher
from msggen.vehicle.owned.records import (
    CALL,
    EVENT,
    LAST,
    PROTOCOL,
    SAMPLE,
    UNTIL,
    Record,
    RecordError,
    event_in,
    event_of,
    record_of,
)
from msggen.vehicle.owner.calls import Call
from msggen.vehicle.owner.owner import LOGGER, Carried, Owner
from msggen.vehicle.owner.program import Program
from msggen.vehicle.selection import order

_NAME = 100
"""The characters of the longest name of a program."""


class EndOfOwner(Exception):  # noqa: N818 - no error
    """The owner is to end, for this reason."""


def obey(owner: Owner, program: Program, record: Record) -> None:
    """Do what a record of a program asks for.

    Raises EndOfOwner, and any other exception if it is no record that a program sends.
    """
    kind, number, index, when, body = record
    with owner.lock:
        if kind == EVENT:
            name, values = event_in(body)
            _REQUESTS[name](owner, program, *values)
            return
        if not program.has_joined:
            raise RecordError("a record before hello")
        vehicle = owner.vehicles.get(number)
        if vehicle is not None:
            _ON_VEHICLE[kind](owner, program, vehicle, index, when, body)
        elif kind == SAMPLE:
            program.taken = when
            owner.unsent += 1  # it is told that the vehicle is gone: the message was not late
        elif kind == CALL:
            owner.send(program, event_of("unsent", number, when, "the vehicle has just disconnected"))


def _publish(  # noqa: PLR0913, PLR0917 - called as the others of _ON_VEHICLE
    owner: Owner, program: Program, vehicle: Carried, index: int, when: int, body: bytes
) -> None:
    program.taken = when
    owner.publish(program, vehicle, index, body, when)


def _call(_owner: Owner, program: Program, vehicle: Carried, index: int, when: int, body: bytes) -> None:
    if index >= len(vehicle.known.services):
        raise RecordError("a call of an unknown service")
    (until,) = UNTIL.unpack_from(body)
    vehicle.calls.add(Call(program, when, index, body[UNTIL.size :], until))


def _last(owner: Owner, program: Program, vehicle: Carried, index: int, _when: int, _body: bytes) -> None:
    remote, route = vehicle.known.remote, vehicle.known.routes[index]
    entry = owner.entries.get(remote.number)

    def tell(last: Kept | None) -> None:
        payload, time = last or (b"", 0)
        owner.send(program, record_of(LAST, payload, remote.number, index, time))

    def ask() -> None:
        found = owner.link.last(remote, route)
        with owner.lock:
            tell(found and (found.payload, found.time))

    if owner.link.has_last(remote):
        owner.aside.do(ask)
    else:
        tell(entry.last.get(route.name) if entry is not None else None)


_ON_VEHICLE: Mapping[int, Callable[..., None]] = {SAMPLE: _publish, CALL: _call, LAST: _last}


def _hello(owner: Owner, program: Program, hello: Mapping[str, Any]) -> None:
    program.name = escaped(str(hello["name"])[:_NAME])
    if program.pid < 0:
        program.pid = int(hello["pid"])
    if (hello["version"], hello["protocol"]) != (__version__, PROTOCOL):
        _part(owner, program, escaped(str(hello["version"])[:_NAME]), is_program=hello.get("is_program") is not False)
        return
    problem = _problem_of(owner, hello)
    if problem:
        owner.send(program, event_of("refused", problem))
        return
    if hello["is_program"]:
        program.has_joined = True
        LOGGER.info("%s (pid %d) has joined", program.name, program.pid)
    program.put(event_of("welcome", str(owner.address), os.getpid()))
    if program.has_joined:
        program.tell_taken(time.monotonic())
    for text in owner.missed() if program.has_joined else ():
        program.put(event_of("warned", text))
    found = sorted(owner.vehicles.items(), key=lambda each: order(each[1].known.remote))
    for number, vehicle in found if program.has_joined else ():
        _introduce(owner, program, number, vehicle)
    program.flush()


def _introduce(owner: Owner, program: Program, number: int, vehicle: Carried) -> None:
    """Tell a program of a vehicle that is connected already."""
    program.put(event_of("connected", list(vehicle.known.remote)))
    for route in (*vehicle.known.routes, *vehicle.known.services):
        program.put(event_of("opened", number, type(route).__name__, list(route)))
    entry = owner.entries.get(number)
    if entry is not None:
        owner.tell_definitions(entry, None, program)


def _part(owner: Owner, program: Program, version: str, *, is_program: bool) -> None:
    """Refuse a program with another version of msggen, or make room for its own owner if nobody else is here.

    Who only asks for the state, such as `link list`, ends nothing.
    """
    others = [each for each in owner.programs if each is not program and each.has_joined]
    if not others and is_program:
        program.put(event_of("leaving"))
        raise EndOfOwner(f"{program.name} (pid {program.pid}) is msggen {version}, and starts an owner of its own")
    text = f"msggen {__version__} owns the link, this is msggen {version}"
    if others:
        users = ", ".join(f"{each.name} (pid {each.pid})" for each in others)
        text = f"{text}, and {users} use it: end them, or `msggen link stop {owner.address}`"
    owner.send(program, event_of("refused", text))


def _problem_of(owner: Owner, hello: Mapping[str, Any]) -> str:
    """Return why a program cannot use this link, or ""."""
    stop = f"`msggen link stop {owner.address}` first"
    allow = tuple(hello["allow"])
    if allow and set(allow) != set(owner.allow):
        own = ", ".join(map(str, owner.allow)) or "everybody"
        return f"the link is open to {own}, not to {', '.join(map(str, allow))}: leave that out, or {stop}"
    if not hello["address"]:
        return ""
    asked = parse_address(str(hello["address"]))
    if _covers(owner, asked, str(hello["place"])):
        return ""
    return f"the link is open as {owner.address}, not as {asked}: use that address, or {stop}"


def _covers(owner: Owner, asked: Address, found: str) -> bool:
    """Whether the link of an owner hears all that one at another address would hear.

    `found` is what the program has found at that address: the owner looks nothing up, which can take long.
    """
    if owner.address._replace(host=asked.host, path=asked.path) != asked:
        return False  # another port, agent or rate
    return owner.found in {found, "0.0.0.0"}  # noqa: S104 - a comparison


def _follow(owner: Owner, program: Program, number: int, index: int, is_followed: object) -> None:
    vehicle = owner.vehicles.get(number)
    if vehicle is not None and program.has_joined:
        owner.follow(vehicle, vehicle.known.routes[index].name, program, is_followed=bool(is_followed))


def _cancel(owner: Owner, program: Program, number: int, call: int) -> None:
    vehicle = owner.vehicles.get(number)
    if vehicle is not None:
        vehicle.calls.cancel(program, call)


def _ask(owner: Owner, program: Program, question: int, what: str) -> None:
    answer = _ANSWERS.get(what)
    owner.send(program, event_of("answer", question, answer and answer(owner, program)))


def _stop(_owner: Owner, program: Program) -> None:
    raise EndOfOwner(f"stopped by pid {program.pid}")


# What a program can ask


def _statistics(owner: Owner, program: Program) -> list[int]:
    found = owner.link.statistics()
    return list(found._replace(unread=program.dropped, unsent=found.unsent + owner.unsent))


def _state(owner: Owner, _program: Program) -> dict[str, object]:
    """Return what `msggen link list` shows."""
    programs = [
        {
            "name": each.name,
            "pid": each.pid,
            "age": time.monotonic() - each.since,
            "unread": each.dropped,
            "unsent": each.unsent,
        }
        for each in owner.programs
        if each.has_joined
    ]
    return {
        "address": str(owner.address),
        "version": __version__,
        "pid": os.getpid(),
        "age": time.time() - owner.begun,
        "vehicles": [_vehicle(owner, number, vehicle) for number, vehicle in owner.vehicles.items()],
        "programs": programs,
        "rate": owner.rate,
    }


def _vehicle(owner: Owner, number: int, vehicle: Carried) -> dict[str, object]:
    entry = owner.entries.get(number)
    return {
        **vehicle.known.remote._asdict(),
        "release": entry.firmware().release if entry is not None else "",
        "lost": vehicle.lost,
        "samples": sum(row.count for row in vehicle.rows.values()),
    }


def _publishers(owner: Owner, _program: Program) -> dict[int, list[Publisher]]:
    """Return what each program has published to each vehicle."""
    return {
        number: [
            Publisher(name, program.name, program.pid, *sent)
            for name, row in vehicle.rows.items()
            for program, sent in row.publishers.items()
        ]
        for number, vehicle in owner.vehicles.items()
    }


_REQUESTS: Mapping[str, Callable[..., None]] = {
    "hello": _hello,
    "follow": _follow,
    "cancel": _cancel,
    "ask": _ask,
    "stop": _stop,
}
_ANSWERS: Mapping[str, Callable[[Owner, Program], object]] = {
    "statistics": _statistics,
    "state": _state,
    "clients": lambda owner, _: [list(each) for each in owner.link.clients()],
    "settled": lambda owner, _: owner.link.is_settled(),
    "refusals": lambda owner, _: dict(owner.link.refusals()),
    "publishers": _publishers,
    "warnings": lambda owner, _: list(owner.warnings),
}
