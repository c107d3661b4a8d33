"""All clients of one transport, agent side: docs/xrce.md.

No input, output, clock or thread: a transport gives datagrams and times, and takes datagrams and events. A transport
that calls an agent from several threads holds a lock of its own. It takes datagrams and events after each call.

    agent.receive(data, address, time.time_ns())
    for data, address in agent.take_outgoing():
        sock.sendto(data, address)
    deliver(agent.take_events(), listener)
"""

from __future__ import annotations

import itertools
import os
import struct
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from msggen.link.age import NEVER
from msggen.link.age import now as now_ns
from msggen.link.link import Client, Event, LinkError, Route, Sample, Service, Warned
from msggen.link.xrce import wire
from msggen.link.xrce.entities import RefusedError
from msggen.link.xrce.limits import Limits
from msggen.link.xrce.outbox import Address, Datagram, Outbox, host
from msggen.link.xrce.places import find_least
from msggen.link.xrce.record import Record
from msggen.link.xrce.session import Session
from msggen.link.xrce.streams import NEAR
from msggen.link.xrce.wire import BEST_EFFORT, ENCAPSULATION, WRITE_DATA, WireError

DEFAULTS: Final = Limits()

_unpack_write = struct.Struct("<BBHBBH2x2s").unpack_from  # headers, request id and object id of a WRITE_DATA
_MOST_MISSING = NEAR - 1
_LONGEST_STEP = 1.0  # seconds: a longer step is a process that slept, or a clock that jumped
_REPEATED = 0.5  # seconds in which a second CREATE_CLIENT is the first one, doubled on its way
_REPLACED = 0.5  # seconds of silence after which a client that began later is the same one, restarted
_WARNINGS = 20  # of a kind in a minute: a hostile sender can provoke any number of some kinds
_MINUTE = 60.0
_SETTLED = 2.5  # seconds in which each client has begun a session: PX4's asks every 1 s, or 2 s if it was refused
_LISTEN = 1.2  # seconds in which each client of PX4 is heard that has a session: it pings every 1.01 s
_REMEMBERED = 10.0  # seconds in which a client whose session has ended here may still send in it
_OF_SESSIONS = frozenset({wire.GET_INFO, wire.TIMESTAMP, wire.WRITE_DATA, wire.CREATE})
"""What PX4's client sends in a session without being asked."""


class Agent:
    """All clients of one transport.

    It is one class, because each datagram can begin, wake, replace or end any session.
    """

    def __init__(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        now: float,
        *,
        allow: Callable[[Address], bool] = lambda _: True,
        keys: Container[int] | None = None,
        records: Iterable[Record] = (),
        limits: Limits = DEFAULTS,
        clock: Callable[[], int] = now_ns,
    ) -> None:
        """Make an agent.

        `now` is the time of a monotonic clock, in seconds.

        `allow` tells whether an address may talk to this agent. Other senders get no answer. `keys` are the keys of
        clients that may begin a session, None for all of them.

        `records` are those of sessions that an earlier program began, and has not ended: they are continued. A client
        in any other session has to connect anew (docs/xrce.md, 10).

        `clock` is asked before a message is sent that may have expired.
        """
        self._allow = allow
        self._keys = keys
        self._limits = limits
        self._time = clock
        self.outbox = Outbox(limits.outgoing)
        """Events, datagrams and counters."""
        self._sessions: dict[Address, Session] = {}  # the one whose last message, without samples, is oldest first
        self._connected: dict[int, Session] = {}
        self._numbers = itertools.count(1)
        self._guid = os.urandom(12)
        self._last_tick = now
        self._clock = 0.0  # the sum of steps, so that jumps of `now` do no harm
        self._warned: dict[str, tuple[float, set[str]]] = {}  # by kind, the texts since a time
        self._dropped: dict[Address, None] = {}  # those whose record is of no use any more
        self._ended: dict[Address, float] = {}  # those whose session has ended here or was refused, and when
        self.resume(records)

    def receive(self, data: bytes, address: Address, time: int) -> None:
        """Take a datagram, or the message of a frame. Never raises.

        `time` is the time of its arrival in ns, of the clock that the vehicle is told: `time.time_ns`.
        """
        session = self._sessions.get(address)
        if session is not None and len(data) >= 12:
            session_id, stream, sequence, kind, flags, length, object_id = _unpack_write(data)
            if kind == WRITE_DATA and stream == BEST_EFFORT and session_id == session.fast_id and flags == 1:
                route = session.writers.get(object_id)
                best_effort = session.best_effort
                missing = (sequence - best_effort.last - 1) & 0xFFFF
                if route is not None and missing < _MOST_MISSING and 4 <= length <= len(data) - 8:
                    outbox = self.outbox
                    if len(data) - 8 < length + 4:  # one submessage
                        if missing:
                            session.miss(missing)
                        payload = ENCAPSULATION + data[12 : 8 + length]
                        outbox.events.append(Sample(session.remote, route, payload, time))  # type: ignore[arg-type]
                    elif samples := session.samples_in(data, time):
                        if missing:
                            session.miss(missing)
                        outbox.events += samples
                    else:
                        self._receive(data, address, session, time)
                        return
                    best_effort.last = sequence
                    session.is_writing = True
                    outbox.received += 1
                    return
        self._receive(data, address, session, time)

    def tick(self, now: float) -> None:
        """Do what time demands: ask for missing acknowledgements, report silent clients. To be called every 0.1 s.

        `now` is the time of a monotonic clock, in seconds.
        """
        self._clock += min(max(now - self._last_tick, 0.0), _LONGEST_STEP)
        self._last_tick = now
        for session in list(self._sessions.values()):
            if session.look(self._clock) and session.follower is not None:
                self._warn_of_two(session, session.follower)
                session.follower = None
            silence = self._clock - session.heard_at
            if silence > (self._limits.patience if session.is_unheard else self._limits.memory):
                self._forget(session, "the vehicle is silent")
            elif session.remote is None and session.inventory.namespace is not None:
                continue  # it sleeps
            elif silence > self._limits.silence:
                self._disconnect(session, f"the vehicle has sent nothing for {self._limits.silence:g} s")
            elif not self._replace_silent(session):
                session.tick(self._clock)
        self._ended = {address: at for address, at in self._ended.items() if self._clock - at < _REMEMBERED}

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        outbox = self.outbox
        events, outbox.events = outbox.events, []
        return events

    def take_outgoing(self) -> list[tuple[bytes, Address]]:
        """Return the datagrams to send, with their destinations, since the last call."""
        return [each[:2] for each in self.take_datagrams()]

    def take_datagrams(self) -> list[Datagram]:
        """Return the same as `take_outgoing`, with the times until which they may be sent."""
        outbox = self.outbox
        outgoing, outbox.outgoing = outbox.outgoing, []
        return outgoing

    def resume(self, records: Iterable[Record]) -> None:
        """Continue the sessions of records. Each is reported when its client is heard."""
        for record in records:
            self._resume(record)

    def take_records(self) -> list[tuple[Address, Record | None]]:
        """Return the sessions that have changed since the last call: what to write down of each, None if nothing.

        To be called after `tick`. What a client creates in one go makes one record.
        """
        records: list[tuple[Address, Record | None]] = [(address, None) for address in self._dropped]
        self._dropped.clear()
        for session in self._sessions.values():
            version = session.journal.version
            if version == session.settled != session.recorded:
                session.recorded = version
                records.append((session.address, session.record()))
            session.settled = version
        return records

    def heard(self) -> list[Address]:
        """Return the clients that are connected."""
        return [session.address for session in self._connected.values()]

    def hashes(self, number: int) -> Mapping[str, int]:
        """Return the hashes of definitions that are known of vehicle `Remote.number`, none if it is not connected."""
        session = self._connected.get(number)
        return session.hashes if session else {}

    def remember(self, number: int, hashes: Mapping[str, int]) -> None:
        """Write down the hashes of definitions of vehicle `Remote.number`, if it is connected."""
        session = self._connected.get(number)
        if session is not None and hashes != session.hashes:
            session.hashes = MappingProxyType(dict(hashes))
            session.journal.version += 1

    def samples(self, number: int) -> Mapping[str, tuple[bytes, int]]:
        """Return the samples that are kept of vehicle `Remote.number`, by route, none if it is not connected."""
        session = self._connected.get(number)
        return session.samples if session else {}

    def keep(self, number: int, samples: Mapping[str, tuple[bytes, int]]) -> None:
        """Write down samples of vehicle `Remote.number`, by route: the newest ones, as far as a record takes them."""
        session, left = self._connected.get(number), self._limits.record
        kept: dict[str, tuple[bytes, int]] = {}
        for name, sample in sorted(samples.items(), key=lambda each: each[1][1], reverse=True):
            left -= len(name) + len(sample[0])
            if left >= 0:
                kept[name] = sample
        if session is not None and kept != session.samples:
            session.samples = MappingProxyType(kept)
            session.journal.version += 1

    def publish(self, number: int, object_id: int, payload: bytes, until: int = NEVER) -> None:
        """Send a sample to vehicle `Remote.number`, to its route of direction `in` with this `Route.object_id`.

        `payload` is CDR with its encapsulation, which is little-endian. If the client reads the route reliably, the
        sample is kept until it is acknowledged, but not sent after the time `until` of `clock`.
        Raises LinkError if the vehicle is not connected, has no such route, or if the payload does not fit.
        """
        self._find(number).publish(object_id, payload, until)

    def call(self, number: int, object_id: int, request: int, payload: bytes, until: int = NEVER) -> None:
        """Send a request to vehicle `Remote.number`, to its service with this `Service.object_id`.

        The answer is a Replied with the same number `request`, which is unique for this vehicle, from 1 to 2**63 - 1.
        `payload` and `until` as for `publish`.
        Raises LinkError if the vehicle is not connected, has no such service, or leaves too many requests without
        acknowledgement, or if the payload does not fit.
        """
        self._find(number).call(object_id, request, payload, until)

    def routes(self, number: int) -> Sequence[Route | Service]:
        """Return the routes and services of a vehicle, none if it is not connected."""
        session = self._connected.get(number)
        return session.inventory.routes() if session else ()

    def clients(self) -> list[Client]:
        """Return all clients that have begun a session, also those that are silent by now."""
        return [
            Client(
                address=_name(session.address),
                key=session.create.key,
                number=session.remote.number if session.remote else 0,
                age=self._clock - session.begun_at,
                silence=0.0 if session.is_heard else self._clock - session.heard_at,
                timestamps=session.timestamps,
            )
            for session in self._sessions.values()
        ]

    def is_settled(self) -> bool:
        """Whether every client that sends has had the time to begin a session, and none is about to connect."""
        return self._clock >= _SETTLED and not any(map(self._is_connecting, self._sessions.values()))

    def _is_connecting(self, session: Session) -> bool:
        is_named = session.remote is not None or session.inventory.namespace is not None
        return not is_named and (session.is_heard or self._clock - session.heard_at < _LISTEN)

    def close(self, reason: str = "the link was closed") -> None:
        """Forget all clients and report them as disconnected. The protocol has no message for it.

        Their records stay, for the next program.
        """
        dropped = self._dropped.copy()
        for session in list(self._sessions.values()):
            self._forget(session, reason)
        self._dropped = dropped

    def _find(self, number: int) -> Session:
        session = self._connected.get(number)
        if session is None:
            raise LinkError(f"vehicle {number} is not connected any more; wait for it with wait_connected()")
        return session

    def _receive(self, data: bytes, address: Address, session: Session | None, time: int) -> None:
        """Take any message."""
        outbox = self.outbox
        if session is None and not self._allow(address):
            outbox.refuse("address that is not allowed")
            self._warn("address", f"refused {host(address)}: only allowed addresses may connect; add it to allow=")
            return
        try:
            self._dispatch(data, address, session, time)
        except WireError as error:
            outbox.refuse(str(error))

    def _dispatch(self, data: bytes, address: Address, session: Session | None, time: int) -> None:
        if len(data) > self._limits.message:
            raise WireError("message beyond the limit")
        header = wire.parse_header(data)
        body = data[4 + len(header.key) :]
        if header.session_id in (wire.NO_SESSION, wire.NO_SESSION_WITH_KEY):
            self._without_session(header, body, address, session)
        elif session is None:
            self._stranger(header, body, address)
        elif header.session_id != session.session_id or header.key != session.key:
            raise WireError("wrong session id or key")
        else:
            self._in_session(session, header, body, time)

    def _in_session(self, session: Session, header: wire.Header, body: bytes, time: int) -> None:
        is_asleep = session.remote is None and session.inventory.namespace is not None
        if is_asleep and _first(body).id != wire.DELETE:
            self._wake(session)
        self._sessions[session.address] = self._sessions.pop(session.address)  # the last one was heard last
        session.receive(header, body, time)
        if session.ended is not None:
            self._forget(session, session.ended)

    def _without_session(self, header: wire.Header, body: bytes, address: Address, session: Session | None) -> None:
        """Take a ping or a CREATE_CLIENT."""
        submessage = _first(body)
        if submessage.id == wire.GET_INFO:
            if session is not None and session.is_unheard:
                self._forget(session, "the vehicle has ended the session")
                session = None
            elif session is not None:
                session.pinged = True
            self._send(header, wire.answer_info(submessage.payload, known=session is not None), address)
        elif submessage.id == wire.CREATE_CLIENT:
            self._create_client(header, wire.CreateClient.unpack(submessage.payload), address, session)
        else:
            raise WireError("submessage that needs a session")
        self.outbox.received += 1

    def _stranger(self, header: wire.Header, body: bytes, address: Address) -> None:
        """Take a message of a session that this agent has not begun: its client has to connect anew."""
        submessage = _first(body)
        if submessage.id in _OF_SESSIONS and header.session_id > wire.NO_SESSION and address not in self._ended:
            text = f"{_name(address)} has a session with an earlier program, of which there is no record"
            self._warn("session", f"{text}: it connects anew, which takes about 10 s")
        if submessage.id == wire.GET_INFO:
            self._send(header, wire.answer_info(submessage.payload, known=False), address)
        elif submessage.id == wire.DELETE and submessage.payload[2:4] == wire.CLIENT_ID:
            self._note_end(address)
            self._send(header, wire.Status(submessage.payload[:2], wire.CLIENT_ID).pack(), address)
        else:
            raise WireError("message of an unknown session")
        self.outbox.received += 1

    def _note_end(self, address: Address) -> None:
        """Take note of a session that has ended here, or was refused: what its client still sends in it is not told."""
        self._ended.pop(address, None)
        if len(self._ended) >= self._limits.clients:
            del self._ended[next(iter(self._ended))]
        self._ended[address] = self._clock

    def _resume(self, record: Record) -> None:
        is_allowed = self._allow(record.address) and (self._keys is None or record.key in self._keys)
        if not is_allowed or record.address in self._sessions or len(self._sessions) >= self._limits.clients:
            return
        session = self._begin(wire.CreateClient(record.key, record.session_id, record.mtu), record.address)
        try:
            session.resume(record)
        except (WireError, RefusedError):
            del self._sessions[record.address]
            self._dropped[record.address] = None

    def _end_resumed(self, key: int, address: Address) -> None:
        """Forget the sessions of records whose client begins another one, at another port."""
        for session in list(self._sessions.values()):
            is_same = session.create.key == key and session.host == host(address)
            if is_same and session.is_unheard:
                self._forget(session, "the vehicle has begun another session")

    def _create_client(
        self, header: wire.Header, create: wire.CreateClient, address: Address, session: Session | None
    ) -> None:
        status = wire.OK
        if self._keys is not None and create.key not in self._keys:
            text = f"refused {host(address)}: key {create.key} is not allowed; add it to the keys in allow="
            self._warn("key", text)
            self._note_end(address)
            raise WireError("key that is not allowed")
        if create.session_id in (wire.NO_SESSION, wire.NO_SESSION_WITH_KEY):
            raise WireError("wrong session id or key")
        if session is None or not self._is_doubled(session, create):
            if session is not None:
                self._forget(session, "the vehicle has begun another session")
            self._end_resumed(create.key, address)
            if self._has_room(address):
                self._begin(create, address)
            else:
                status = wire.ERR_RESOURCES
                self._note_end(address)
                self.outbox.refuse("too many clients")
                self._warn(
                    "room",
                    f"refused {host(address)}: {self._limits.clients} vehicles are connected, the most for a port",
                )
        key = wire.key_bytes(create.key) if create.session_id < 0x80 else b""
        self._send(header._replace(session_id=create.session_id, key=key), wire.StatusAgent(status).pack(), address)

    def _is_doubled(self, session: Session, create: wire.CreateClient) -> bool:
        """Whether a CREATE_CLIENT is the one that began the session, doubled on its way."""
        is_soon = self._clock - session.begun_at < _REPEATED
        return create == session.create and is_soon and not session.pinged and not session.continued

    def _has_room(self, address: Address) -> bool:
        """Whether a session can begin at an address. Forget another one if that is needed."""
        if len(self._sessions) < self._limits.clients:
            return True
        found = find_least(self._sessions.values(), host(address), self._clock)
        if found is None:
            return False
        self._forget(found, "another client needs its place")
        return True

    def _begin(self, create: wire.CreateClient, address: Address) -> Session:
        session = Session(create, address, self.outbox, self._limits, self._named, self._time)
        session.heard_at = session.written_at = session.begun_at = self._clock
        self._sessions[address] = session
        return session

    def _named(self, session: Session) -> None:
        """Take a client that has told its namespace: the same client may have had a session at another address.

        Such a session is silent. If it is not silent yet, `tick` finds out.
        """
        for other in self._twins(session):
            other.look(self._clock)
            other.follower = session
            self._replace_silent(other)
        self._connect(session)

    def _twins(self, session: Session) -> list[Session]:
        """Return the other clients with the key and the namespace of a client that are connected."""
        name = session.create.key, session.inventory.namespace
        return [
            other
            for other in self._connected.values()
            if (other.create.key, other.inventory.namespace) == name and other is not session and name[0]
        ]

    def _replace_silent(self, session: Session) -> bool:
        """Disconnect a client if it is silent since another one began that has its key. Return whether it was."""
        follower = session.follower
        if follower is None or self._clock - session.heard_at < _REPLACED:
            return False
        self._disconnect(session, f"the vehicle has begun another session, at {_name(follower.address)}")
        self._drop(session)
        return True

    def _wake(self, session: Session) -> None:
        """Continue a session that was silent, or that another one seemed to replace."""
        for other in self._twins(session):
            self._warn_of_two(session, other)
        self._connect(session)

    def _warn_of_two(self, one: Session, other: Session) -> None:
        addresses = " and ".join(sorted((_name(one.address), _name(other.address))))
        text = f"two vehicles have the key {one.create.key}, {addresses}"
        self._warn("two", f"{text}: set the parameter UXRCE_DDS_KEY of one to another number")

    def _connect(self, session: Session) -> None:
        number = next(self._numbers)
        self._connected[number] = session
        session.connect(number, _name(session.address), self._guid)

    def _disconnect(self, session: Session, reason: str) -> None:
        if session.remote is not None:
            del self._connected[session.remote.number]
            for other in self._twins(session):
                if other.follower is session:
                    other.follower = None
        session.follower = None
        session.disconnect(reason)

    def _forget(self, session: Session, reason: str) -> None:
        self._disconnect(session, reason)
        del self._sessions[session.address]
        self._note_end(session.address)
        self._drop(session)

    def _drop(self, session: Session) -> None:
        """Have the record of a session removed, if there is one."""
        if session.recorded:
            session.recorded = session.settled = session.journal.version
            self._dropped[session.address] = None

    def _send(self, header: wire.Header, submessage: bytes, address: Address) -> None:
        """Send a submessage outside of streams, with the session id and key of a header."""
        self.outbox.send(wire.HEADER.pack(header.session_id, 0, 0) + header.key + submessage, address)

    def _warn(self, kind: str, text: str) -> None:
        """Tell the user, each text once, as long as there are few texts of its kind."""
        since, told = self._warned.setdefault(kind, (self._clock, set()))
        if len(told) >= _WARNINGS and self._clock - since > _MINUTE:
            since, told = self._warned[kind] = self._clock, set()
        if text not in told and len(told) < _WARNINGS:
            told.add(text)
            self.outbox.events.append(Warned(text))


def _first(body: bytes) -> wire.Submessage:
    for submessage in wire.submessages(body):
        return submessage
    raise WireError("message without a submessage")


def _name(address: Address) -> str:
    """Return an address as text: `127.0.0.1:40123`, `[::1]:40123`, or the path of a device."""
    if isinstance(address, str):
        return address
    name = host(address)
    return f"[{name}]:{address[1]}" if ":" in name else f"{name}:{address[1]}"
