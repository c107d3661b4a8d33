"""The link of another process, which owns it: over a Unix socket, with the records of `records.py`."""

from __future__ import annotations

import itertools
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from msggen.link.age import NEVER, expiry
from msggen.link.link import (
    NOTHING,
    Client,
    LinkError,
    Listener,
    Publisher,
    Remote,
    Route,
    Sample,
    Service,
    Statistics,
)
from msggen.link.threaded import ThreadedLink
from msggen.vehicle.owned.greeting import connected, greeted
from msggen.vehicle.owned.outgoing import Outgoing
from msggen.vehicle.owned.records import (
    CALL,
    EVENT,
    LAST,
    SAMPLE,
    UNTIL,
    KnownVehicle,
    Record,
    RecordError,
    RecordReader,
    event_in,
    event_of,
    record_of,
)
from msggen.vehicle.owned.told import checked_answer, checked_event

_CHUNK = 1 << 18
_ANSWER_S = 1.0
"""The longest wait in s for an answer of the owner."""


class UnixLink(ThreadedLink):
    """A link that another process owns, at the path of its socket."""

    is_shared = True

    def __init__(self, path: str, name: str = "") -> None:
        """Make a link. `name` is that of the program for people, by default that of its file or its command."""
        super().__init__()
        self.path, self._name = path, name
        self._offset = 0
        """The number of the last vehicle of the owners before this one."""
        self._statistics = NOTHING
        self._socket: socket.socket | None = None
        self._outgoing = Outgoing()
        self._vehicles: dict[int, KnownVehicle] = {}
        self._last_number = 0
        self._answers: tuple[tuple[tuple[object, ...], SimpleQueue[Any]], ...] = ()
        """Those who wait for an answer, by its key. Several can wait for the same one."""
        self._lock = threading.Lock()
        """Held while they change."""
        self._questions = itertools.count(1)
        self._asked: dict[int, str] = {}
        """What was asked, by the numbers of the questions that wait for an answer."""

    def connect(self) -> socket.socket:
        """Return a connected socket whose owner has greeted this program. Raises LinkError."""
        try:
            own = connected(self.path)
        except OSError as error:
            text = f"no process owns the link at '{self.path}' ({error.strerror})"
            raise LinkError(f"{text}: start `msggen link serve`, or `ssh -L`") from error
        return greeted(own, "", name=self._name)

    def reopened(self, reason: str) -> socket.socket:
        """Return another one, after the owner has ended. Raises LinkError if there is none."""
        raise LinkError(f"{reason}: start it again")

    # --- Link

    def open(self, listener: Listener) -> None:  # noqa: ARG002
        """Join the owner. Raises LinkError."""
        self._socket = self.connect()
        self._outgoing.begin(self._socket)

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Send a sample, or drop it if the owner does not read. From any thread. Raises LinkError."""
        number, vehicle = self._find(remote)
        outgoing = self._outgoing
        until = outgoing.clock.of(until or expiry())
        record = record_of(SAMPLE, payload, number, vehicle.indexes[route.name], until)
        outgoing.offer(record, until)

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:
        """Send a request, which waits at the owner for those of other programs. From any thread. Raises LinkError."""
        own, vehicle = self._find(remote)
        body = UNTIL.pack(self._outgoing.clock.of(until)) + payload
        self._outgoing.send(record_of(CALL, body, own, vehicle.services.index(service), number))

    def problem(self) -> str:
        """Return why what is published does not get through, "" if it does."""
        return self._outgoing.problem()

    def late(self) -> int:
        """Return how many messages of this program were dropped, because they had waited for too long."""
        return self._outgoing.dropped

    def cancel(self, remote: Remote, number: int) -> None:
        """Forget a call."""
        with suppress(LinkError):
            own, _ = self._find(remote)
            self._outgoing.send(event_of("cancel", own, number))

    def follow(self, remote: Remote, route: Route, *, is_followed: bool) -> None:
        """Begin or end to take the samples of a route."""
        with suppress(LinkError, KeyError):
            number, vehicle = self._find(remote)
            self._outgoing.send(event_of("follow", number, vehicle.indexes[route.name], is_followed))

    def last(self, remote: Remote, route: Route) -> Sample | None:
        """Return the last sample of a route, or None."""
        try:
            number, vehicle = self._find(remote)
            index = vehicle.indexes[route.name]
            found = self._answer((LAST, number, index), record_of(LAST, b"", number, index))
        except (LinkError, KeyError):
            return None
        return Sample(remote, route, *found) if found is not None and found[0] else None

    def ask(self, what: str) -> Any:
        """Return the answer of the owner to a question: its `state`, `clients` and so on. None if there is none."""
        question = next(self._questions)
        with suppress(LinkError):
            if self._closing:
                return None
            self._asked[question] = what
            try:
                return self._answer((EVENT, question), event_of("ask", question, what))
            finally:
                self._asked.pop(question, None)
        return None

    def clients(self) -> list[Client]:
        """Return all clients that have begun a session at the owner, also those that are silent by now."""
        found = [Client(*each) for each in self.ask("clients") or ()]
        return [each._replace(number=each.number + self._offset) if each.number else each for each in found]

    def is_settled(self) -> bool:
        """Whether all clients that send to the owner have connected, as far as it is known."""
        return self.ask("settled") is not False

    def refusals(self) -> dict[str, int]:
        """Return how many datagrams the owner has refused, by reason."""
        return dict(self.ask("refusals") or {})

    def publishers(self, remote: Remote) -> list[Publisher]:
        """Return the running programs that have published to a vehicle. From any thread."""
        found = self.ask("publishers") or {}
        return [Publisher(*each) for each in found.get(str(remote.number - self._offset), ())]

    def warnings(self) -> list[str]:
        """Return what the owner has warned of, also before this program has joined."""
        return list(self.ask("warnings") or ())

    def address(self) -> str:
        """Return the address at which the owner listens, "" if it does not answer."""
        return str((self.ask("state") or {}).get("address", ""))

    def statistics(self) -> Statistics:
        """Return the counters of the owner, or the last known ones if it does not answer."""
        found = self.ask("statistics")
        if found is not None:
            self._statistics = Statistics(*found)
        return self._statistics

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle, or none if it is not connected."""
        found = self._vehicles.get(remote.number)
        return (*found.routes, *found.services) if found else ()

    def wake(self) -> None:
        """Let the thread look around."""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)

    def release(self) -> None:
        """Leave. The owner and the vehicles go on."""
        if self._socket is not None:
            self._socket.close()

    # --- The thread

    def serve(self, listener: Listener) -> None:
        """Take what the owner tells, and what the next one does."""
        while not self._closing:
            reason = self._receive(listener) or "the process that owns the link has ended"
            if self._closing:
                return
            self.leave(reason, listener)
            self._socket = self.reopened(reason)
            self._outgoing.begin(self._socket)

    def _receive(self, listener: Listener) -> str:
        """Deliver records until the owner ends. Return why, or "". Raises LinkError for what is no record."""
        reader, own = RecordReader(), self._socket
        assert own is not None  # noqa: S101 - `start` has set it
        deliver, vehicles, offset = self._deliver, self._vehicles, self._offset
        with own:
            while True:
                try:
                    chunk = own.recv(_CHUNK)
                except OSError:
                    return ""
                if not chunk:
                    return ""
                try:
                    for record in reader.add(chunk):
                        kind, number, index, when, body = record
                        if kind == SAMPLE and when >= 0:  # the frequent one
                            vehicle = vehicles.get(offset + number)
                            if vehicle is not None:
                                listener.sample(vehicle.remote, vehicle.routes[index], body, when)
                        else:
                            deliver(listener, record)
                except (RecordError, LookupError, TypeError, ValueError) as error:
                    # not again: its next program would get the same
                    raise LinkError(f"the process that owns the link has sent what is no record: {error}") from None

    def _deliver(self, listener: Listener, record: Record) -> None:
        kind, number, index, when, body = record
        vehicle = self._vehicles.get(self._offset + number)
        if kind == EVENT:
            name, values = event_in(body)
            _EVENTS[name](self, listener, *checked_event(name, values))
        elif when < 0:
            raise RecordError("a time before 1970")
        elif kind == LAST:
            self._hand((LAST, number, index), (body, when))
        elif vehicle is not None:
            listener.replied(vehicle.remote, vehicle.services[index], when, body)

    def _connected(self, listener: Listener, values: list[Any]) -> None:
        number, *others = values
        self._last_number = max(self._last_number, self._offset + number)
        remote = Remote(self._offset + number, *others)
        found = self._vehicles.get(remote.number)
        self._vehicles[remote.number] = found._replace(remote=remote) if found else KnownVehicle.of(remote)
        listener.connected(remote)

    def _opened(self, listener: Listener, number: int, kind: str, values: list[Any]) -> None:
        vehicle = self._vehicles[self._offset + number]
        route = (Service if kind == "Service" else Route)(*values)
        vehicle.add(route)
        listener.opened(vehicle.remote, route)

    def _disconnected(self, listener: Listener, number: int, reason: str) -> None:
        vehicle = self._vehicles.pop(self._offset + number, None)
        if vehicle is not None:
            listener.disconnected(vehicle.remote, reason)

    def _lost(self, listener: Listener, number: int, missing: int) -> None:
        listener.lost(self._vehicles[self._offset + number].remote, missing)

    def _identified(self, listener: Listener, number: int, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        vehicle = self._vehicles.get(self._offset + number)
        if vehicle is not None:
            listener.identified(vehicle.remote, hashes, is_complete)

    def _warned(self, listener: Listener, text: str) -> None:
        listener.warned(text)

    def _failed(self, _listener: Listener, reason: str) -> None:
        raise LinkError(reason)

    def _unsent(self, listener: Listener, number: int, call: int, problem: str) -> None:
        vehicle = self._vehicles.get(self._offset + number)
        if vehicle is not None:
            listener.refused(vehicle.remote, call, problem)

    def _taken(self, _listener: Listener, until: int, dropped: int, theirs: int, clock: str) -> None:
        self._outgoing.clock.hear(theirs, clock)
        self._outgoing.taken(until, dropped)

    def _answered(self, _listener: Listener, question: int, value: object) -> None:
        what = self._asked.get(question)
        if what is not None:
            self._hand((EVENT, question), checked_answer(what, value))

    def leave(self, reason: str, listener: Listener) -> None:
        """Tell the listener that all vehicles are gone with the owner."""
        for number, vehicle in tuple(self._vehicles.items()):
            del self._vehicles[number]
            listener.disconnected(vehicle.remote, reason)
        for _, answers in self._answers:
            answers.put(None)
        self._offset = self._last_number

    # --- Records to the owner

    def _answer(self, key: tuple[object, ...], record: bytes) -> Any:
        """Return what the owner answers to a record. Raises LinkError, and None if there is no answer."""
        if threading.current_thread() is self._thread:  # which would take the answer
            return None
        answers = SimpleQueue[Any]()
        with self._lock:
            self._answers = (*self._answers, (key, answers))
        try:
            self._outgoing.send(record)
            return answers.get(timeout=_ANSWER_S)
        except Empty:
            return None
        finally:
            with self._lock:
                self._answers = tuple(each for each in self._answers if each[1] is not answers)

    def _hand(self, key: tuple[object, ...], value: object) -> None:
        for asked, answers in self._answers:
            if asked == key:
                answers.put(value)

    def _find(self, remote: Remote) -> tuple[int, KnownVehicle]:
        found = self._vehicles.get(remote.number)
        if found is None:
            raise LinkError(f"the vehicle at {remote.address} is no longer connected: wait until it is connected again")
        return remote.number - self._offset, found


_EVENTS: Mapping[str, Callable[..., None]] = {
    "connected": UnixLink._connected,  # noqa: SLF001 - a table of the methods above
    "opened": UnixLink._opened,  # noqa: SLF001
    "disconnected": UnixLink._disconnected,  # noqa: SLF001
    "lost": UnixLink._lost,  # noqa: SLF001
    "identified": UnixLink._identified,  # noqa: SLF001
    "warned": UnixLink._warned,  # noqa: SLF001
    "failed": UnixLink._failed,  # noqa: SLF001
    "unsent": UnixLink._unsent,  # noqa: SLF001
    "taken": UnixLink._taken,  # noqa: SLF001
    "answer": UnixLink._answered,  # noqa: SLF001
}
