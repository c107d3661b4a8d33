"""The owner of a link: passes what happens on it to programs, and what they publish and call to the vehicles.

The thread of the link tells the owner what happens, and sends samples to programs. If many arrive, they are gathered
for some time, which costs less, and the thread of the sockets sends them.
"""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from logging import getLogger
from typing import NamedTuple

from msggen.link.address import Address
from msggen.link.age import is_over
from msggen.link.aside import Aside
from msggen.link.link import Link, LinkError, Listener, Remote, Route, Service, StaleError
from msggen.vehicle.entries import Entries
from msggen.vehicle.entry import Entry
from msggen.vehicle.owned.places import found_at
from msggen.vehicle.owned.records import CALL, HEADER, SAMPLE, KnownVehicle, event_of, record_of
from msggen.vehicle.owner.calls import Call, CallQueue
from msggen.vehicle.owner.program import Program

LOGGER = getLogger("msggen.live")

_MANY = 4000
"""The samples in a second from which on they are gathered."""
_WINDOW_NS = 100_000_000
_WARNINGS = 100
"""The most different warnings for a program, and of the link."""
_ASKED = 100
"""The most questions for last samples that wait for their answers."""
_LATELY = 15.0
"""The time in s after a warning in which a program that joins is told, too, while no vehicle is connected."""


class Sent(NamedTuple):
    """What a program has published to a route: how many samples, and when the last one, in ns; how many came late."""

    samples: int = 0
    time: int = 0
    dropped: int = 0


class Row:
    """A route: which programs follow it, and which ones publish to it."""

    __slots__ = ("count", "index", "programs", "publishers")

    def __init__(self, index: int) -> None:
        self.index = index
        self.programs: tuple[Program, ...] = ()
        self.publishers: dict[Program, Sent] = {}
        self.count = 0

    def miss(self, program: Program) -> None:
        """Count a sample of a program that came too late."""
        sent = self.publishers.get(program, _NONE)
        self.publishers[program] = sent._replace(time=sent.time or clock.time_ns(), dropped=sent.dropped + 1)


_NONE = Sent()


class Carried:
    """A vehicle, as its programs share it: its routes, and the calls to it."""

    def __init__(self, remote: Remote, calls: CallQueue) -> None:
        self.known = KnownVehicle.of(remote)
        self.rows: dict[str, Row] = {}
        self.calls = calls
        self.lost = 0


class Owner(Listener):
    """The listener of a link that programs share. They have hubs of their own."""

    def __init__(self, link: Link, address: Address, allow: Sequence[str | int], wake: Callable[[], None]) -> None:
        """Make an owner. `wake` lets the thread of the sockets look around."""
        self.link = link
        self.failure = ""
        """The error that has ended the link."""
        self.address, self.allow = address, tuple(allow)
        self.found = found_at(address)
        """The device or the IP address of the link."""
        self.begun = clock.time()
        self.lock = threading.RLock()
        """Guards the programs and the vehicles. Taken before the lock of the link."""
        self.entries = Entries(link, self.lock, self.evaluate)
        self.programs: dict[Program, None] = {}
        self.vehicles: dict[int, Carried] = {}
        self.warnings: dict[str, float] = {}
        """What the programs were warned of, for those that join later, and when, of the monotonic clock."""
        self.is_gathering = False
        """Whether so many samples arrive that the thread of the sockets sends them."""
        self._wake = wake
        self.rate = 0.0
        """The samples in a second that have arrived from the vehicles."""
        self._samples, self._rated_at = 0, clock.monotonic()
        self._count = self._since = 0
        self.unsent = 0
        """The messages of programs to vehicles that were gone."""

    @cached_property
    def aside(self) -> Aside:
        """A thread that asks the link for last samples that do not cross to this process."""
        return Aside("msggen-last", _ASKED, lambda _: None)

    # --- What happens on the link, in its thread

    def connected(self, remote: Remote) -> None:
        """Tell the programs of a vehicle."""
        with self.lock:
            calls = CallQueue(
                lambda number, call: self._send_call(remote, number, call),
                lambda call, problem: self._refuse_call(remote, call, problem),
            )
            self.vehicles[remote.number] = Carried(remote, calls)
            self._tell("connected", list(remote))
        LOGGER.info("%s connected", remote.address)
        self.entries.connected(remote)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Tell the programs of a route or a service."""
        with self.lock:
            vehicle = self.vehicles[remote.number]
            vehicle.known.add(route)
            if isinstance(route, Route):
                vehicle.rows.setdefault(route.name, Row(vehicle.known.indexes[route.name]))
            self._tell("opened", remote.number, type(route).__name__, list(route))
        self.entries.opened(remote, route)

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Tell the programs that a vehicle is gone."""
        with self.lock:
            self.vehicles.pop(remote.number, None)
            self.entries.pop(remote.number, None)
            self._tell("disconnected", remote.number, reason)
        LOGGER.info("%s disconnected: %s", remote.address, reason)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Give a sample to the programs that follow its route."""
        vehicle = self.vehicles.get(remote.number)
        row = vehicle.rows.get(route.name) if vehicle is not None else None
        if row is not None:
            row.count += 1
            self._samples += 1
            if row.programs:
                self.give(row, remote.number, payload, time)
        self.entries.sample(remote, route, payload, time)

    def give(self, row: Row, number: int, payload: bytes, time: int) -> None:
        """Send a sample to the programs that follow its route."""
        record = HEADER.pack(SAMPLE, number, row.index, time, len(payload)) + payload
        self._count += 1
        if not 0 <= time - self._since < _WINDOW_NS:
            self.is_gathering = self._count * 1_000_000_000 > _MANY * abs(time - self._since)
            self._count, self._since = 0, time
        with self.lock:
            for program in row.programs:
                program.put(record)
                if not (self.is_gathering or program.is_blocked):
                    program.flush()
                    if program.is_blocked or program.is_gone:
                        self._wake()
        if self.is_gathering:
            self._wake()

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:  # noqa: ARG002
        """Give a reply to the program that has called."""
        with self.lock:
            vehicle = self.vehicles.get(remote.number)
            call = vehicle.calls.replied(number) if vehicle is not None else None
            if call is not None:
                self.send(call.program, record_of(CALL, payload, remote.number, call.service, call.number))

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        """Take what the link knows of the definitions, so that this process need not ask for them."""
        self.entries.identified(remote, hashes, is_complete=is_complete)

    def lost(self, remote: Remote, missing: int) -> None:
        """Tell the programs of samples that did not arrive."""
        with self.lock:
            vehicle = self.vehicles.get(remote.number)
            if vehicle is not None:
                vehicle.lost += missing
            self._tell("lost", remote.number, missing)

    def warned(self, text: str) -> None:
        """Tell the programs, and the log."""
        LOGGER.warning("%s", text)
        with self.lock:
            if text in self.warnings or len(self.warnings) < _WARNINGS:
                self.warnings[text] = clock.monotonic()
            self._tell("warned", text)

    def missed(self) -> list[str]:
        """Return what a program that joins has missed, and may explain why it waits: nothing if a vehicle is there."""
        since = clock.monotonic() - _LATELY
        return [] if self.vehicles else [text for text, at in self.warnings.items() if at > since]

    def failed(self, reason: str) -> None:
        """Tell the programs that the link has ended, and end."""
        LOGGER.error("%s", reason)
        with self.lock:
            self._tell("failed", reason)
        self.failure = reason
        self._wake()

    def evaluate(self, entry: Entry, ros_type: str | None) -> None:
        """Tell the programs which definitions a vehicle has: they need not ask it themselves."""
        with self.lock:
            self.tell_definitions(entry, ros_type)
        if ros_type is None and entry.check.is_complete:
            LOGGER.info("%s has %s", entry.remote.address, entry.firmware())

    def tell_definitions(self, entry: Entry, ros_type: str | None, program: Program | None = None) -> None:
        """Tell a program, or all of them, the hash of a type, or all of them. The caller holds the lock."""
        hashes = entry.check.hashes
        told = dict(hashes) if ros_type is None else {ros_type: hashes[ros_type]} if ros_type in hashes else {}
        values = ("identified", entry.remote.number, told, entry.check.is_complete)
        if program is None:
            self._tell(*values)
        else:
            program.put(event_of(*values))

    def follow(self, vehicle: Carried, name: str, program: Program, *, is_followed: bool) -> None:
        """Begin or end to give a program the samples of a route. The caller holds the lock."""
        row = vehicle.rows[name]
        before = row.programs
        others = tuple(each for each in before if each is not program)
        row.programs = (*others, program) if is_followed else others
        if bool(row.programs) != bool(before):
            route = vehicle.known.routes[row.index]
            self.link.follow(vehicle.known.remote, route, is_followed=bool(row.programs))

    def _tell(self, name: str, *values: object) -> None:
        """Tell all programs that have joined. The caller holds the lock."""
        record = event_of(name, *values)
        for program in self.programs:
            if program.has_joined:
                self.send(program, record)

    def publish(self, program: Program, vehicle: Carried, index: int, payload: bytes, until: int) -> None:
        """Send a sample of a program to a vehicle and to those who follow its route. The caller holds the lock.

        The link drops one that has waited for too long, and counts it.
        """
        route = vehicle.known.routes[index]
        row = vehicle.rows[route.name]
        try:
            self.link.publish(vehicle.known.remote, route, payload, until or -1)  # 0 means 0.5 s from now
        except StaleError as error:
            program.unsent += 1
            row.miss(program)
            if not is_over(until):  # the line is too slow
                self._warn(program, str(error))
            return
        except LinkError as error:
            self._warn(program, str(error))
            return
        now = clock.time_ns()
        entry = self.entries.get(vehicle.known.remote.number)
        if entry is not None:
            entry.last[route.name] = payload, now
        row.count += 1
        sent = row.publishers.get(program, _NONE)
        row.publishers[program] = Sent(sent.samples + 1, now, sent.dropped)
        if row.programs:
            self.give(row, vehicle.known.remote.number, payload, now)

    def _warn(self, program: Program, text: str) -> None:
        if text not in program.warnings and len(program.warnings) < _WARNINGS:
            program.warnings.add(text)
            self.send(program, event_of("warned", text))

    def _send_call(self, remote: Remote, number: int, call: Call) -> None:
        service = self.vehicles[remote.number].known.services[call.service]
        self.link.call(remote, service, number, call.payload, call.until)

    def _refuse_call(self, remote: Remote, call: Call, problem: str) -> None:
        self.send(call.program, event_of("unsent", remote.number, call.number, problem))

    def look(self) -> None:
        """Measure the rate of samples, end calls without a reply, and tell programs what was taken of them.

        The caller holds the lock.
        """
        now = clock.monotonic()
        for program in self.programs:
            if program.has_joined:
                program.tell_taken(now)
        if now - self._rated_at >= 1.0:
            self.rate = self._samples / (now - self._rated_at)
            self._samples, self._rated_at = 0, now
        for vehicle in self.vehicles.values():
            vehicle.calls.look()

    def remove(self, program: Program) -> None:
        """Forget a program. The caller holds the lock."""
        self.programs.pop(program, None)
        program.close()
        for vehicle in self.vehicles.values():
            vehicle.calls.cancel(program)
            for name, row in vehicle.rows.items():
                self.follow(vehicle, name, program, is_followed=False)
                row.publishers.pop(program, None)
        if program.has_joined:
            LOGGER.info("%s (pid %d) has left", program.name, program.pid)

    def send(self, program: Program, record: bytes) -> None:
        """Send a record to a program. The caller holds the lock."""
        program.put(record)
        if not program.is_blocked:
            program.flush()
        if program.is_blocked or program.is_gone:
            self._wake()
