"""The client side of a session, as PX4's client behaves: docs/xrce.md.

No input, output, clock or thread. Times are in us since the start of the client, which is the clock that it tells its
agent. A transport gives datagrams and times, and takes datagrams and events:

    client.advance(now)
    for data, connection in client.take_outgoing():
        sockets[connection].send(data)
    client.receive(sock.recv(4096), now)

PX4's client is one loop, which waits at many places. Here this loop is a generator, which yields the time until which
it waits, and continues at that time or after a datagram.
"""

from __future__ import annotations

import struct
from collections import Counter, deque
from collections.abc import Callable, Generator, Sequence
from typing import Final, Literal, NamedTuple, TypeAlias
from xml.sax.saxutils import escape

from msggen.live.xrce import wire
from msggen.live.xrce.entities import (
    BY_XML,
    PARTICIPANT,
    PUBLISHER,
    QOS_KEEP_LAST,
    QOS_TRANSIENT_LOCAL,
    READER,
    REPLIER,
    SUBSCRIBER,
    TOPIC,
    WRITER,
    Endpoint,
    Group,
    Participant,
    Replier,
    Topic,
    object_id,
    object_kind,
    object_number,
)
from msggen.live.xrce.offset import OffsetFilter

Sync: TypeAlias = Literal["px4", "short", "off"]
"""The time synchronisation: as PX4's, which takes 5 s at the start; with 20 exchanges; or none."""

_Steps: TypeAlias = "Generator[int, None, None]"
_Outcome: TypeAlias = "Generator[int, None, bool]"

_SECOND: Final = 1_000_000
_SESSION: Final = wire.PX4_SESSION
_WINDOW: Final = 4
"""Reliable messages that wait for acknowledgement, and that wait for an earlier one."""
_QUEUE: Final = 16
"""Reliable messages that wait for room in the window."""
_HEARTBEAT: Final = 100_000
_FRAGMENT: Final = wire.MTU - 8
"""The length of a fragment, after the headers of message and submessage."""

_FIRST_REQUEST: Final = 10
_PING_ID: Final = b"\x00\x0a"
_DELETE_ID: Final = b"\x00\x02"
_PARTICIPANT_ID: Final = object_id(1, PARTICIPANT)
_ATTEMPTS: Final = 10
"""How often CREATE_CLIENT is sent, and how many TIMESTAMPs in a row may stay without an answer."""
_EXCHANGES: Final = {"px4": 500, "short": 20, "off": 0}
_SYNC_PAUSE: Final = {"px4": 10_000, "short": 100, "off": 0}
_SYNC_WAIT: Final = 10_000
_PINGS: Final = 3
"""The pings without an answer after which the next one ends the session."""
_SILENCE: Final = 3 * _SECOND
"""The time without a sample from the vehicle after which it ends the session: UXRCE_DDS_TX_TO."""

_WRITE = struct.Struct("<BBHBBH")


class Reader(NamedTuple):
    """A topic that the client reads."""

    number: int
    """The number of the entity: 12 bits."""
    name: str
    """The name in DDS: `rt/fmu/in/vehicle_command`."""
    type: str
    depth: int


class Writer(NamedTuple):
    """A topic that the client writes."""

    number: int
    name: str
    type: str


class Server(NamedTuple):
    """A service of the client."""

    number: int
    name: str
    request_type: str
    reply_type: str
    request_topic: str
    reply_topic: str


class Settings(NamedTuple):
    """The settings of a client. Namespaces are part of the names of topics already."""

    readers: Sequence[Reader]
    writers: Sequence[Writer]
    servers: Sequence[Server] = ()
    key: int = 1
    """The parameter UXRCE_DDS_KEY."""
    namespace: str = ""
    """Becomes part of the name of the participant."""
    sync: Sync = "px4"
    localhost: bool = False
    """The parameter UXRCE_DDS_PTCFG: ask the agent to use the loopback interface only."""


class Connected(NamedTuple):
    """The entities are created, and samples flow."""


class Disconnected(NamedTuple):
    """The session has ended. The client starts again, on a new connection."""

    reason: str


class Received(NamedTuple):
    """A sample for a reader. `data` is CDR without encapsulation, with up to 3 bytes of padding."""

    number: int
    data: bytes


class Requested(NamedTuple):
    """A request to a service. The reply has the same 24 bytes of identity."""

    number: int
    identity: bytes
    data: bytes


class Exchange(NamedTuple):
    """An exchange of times with the agent, in us."""

    agent: int
    """The agent's time."""
    observed: int
    """The agent's clock minus the client's, as this exchange tells it."""
    round_trip: int


Event: TypeAlias = Connected | Disconnected | Received | Requested


class Client:
    """A client. It begins to look for its agent at the first call of `advance`."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.is_connected = False
        """Whether all entities exist and samples flow."""
        self.is_closed = False
        """Whether the client has ended after `close`."""
        self.exchange = Exchange(0, 0, 0)
        """The last exchange of times."""
        self.refused: Counter[str] = Counter()
        """Datagrams that were refused, by reason."""
        self.connections = 0
        self.clock = OffsetFilter(_EXCHANGES[settings.sync])
        self._now = 0
        self._until = 0
        self._outgoing: list[tuple[bytes, int]] = []
        self._events: list[Event] = []
        self._readers = {object_id(each.number, READER) for each in settings.readers}
        self._servers = {object_id(each.number, REPLIER) for each in settings.servers}
        self._is_waiting = False
        self._steps = self._live()
        self._reset()

    def _reset(self) -> None:
        """Forget a session."""
        self._is_in_session = False
        self._info: wire.Info | None = None
        self._agent: wire.StatusAgent | None = None
        self._reply: wire.TimestampReply | None = None
        self._statuses: dict[bytes, int] = {}
        self._last_request = _FIRST_REQUEST - 1
        self._best_effort_out = 0
        self._best_effort_in = -1
        self._reliable_out = 0
        self._unacknowledged: dict[int, bytes] = {}
        self._queue: deque[bytes] = deque(maxlen=_QUEUE)
        self._buffered: list[bytes] = []
        self._heartbeat_time: int | None = None
        self._expected = 0
        self._waiting: dict[int, bytes] = {}
        self._last_write = self._now
        self._written = self._read = 0

    # What the transport calls

    @property
    def is_ready(self) -> bool:
        """Whether `write` sends. PX4's client sends nothing while it waits for a ping or a time."""
        return self.is_connected and not self._is_waiting

    @property
    def offset(self) -> int:
        """The agent's clock minus the client's in us, 0 if it is not known."""
        return self.clock.offset

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        if self._heartbeat_time is None:
            return self._until
        return min(self._until, self._heartbeat_time)

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its connection.

        A new number means a new socket: the earlier ones are closed after their datagrams were sent.
        """
        taken, self._outgoing = self._outgoing, []
        return taken

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self._events = self._events, []
        return taken

    def advance(self, now: int) -> None:
        """Do what is due."""
        self._now = max(now, self._now)
        if self._heartbeat_time is not None and self._now >= self._heartbeat_time:
            self._send_heartbeat()
        if self._now >= self._until:
            self._continue()

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram, or the message of a frame. Never raises."""
        self._now = max(now, self._now)
        try:
            self._take(data)
        except wire.WireError as error:
            self.refused[str(error)] += 1
        self._continue()

    def write(self, number: int, data: bytes) -> bool:
        """Send a sample, CDR without encapsulation. Return whether the client is ready."""
        if not self.is_ready:
            return False
        head = _WRITE.pack(_SESSION, wire.BEST_EFFORT, self._best_effort_out, wire.WRITE_DATA, 1, len(data) + 4)
        self._best_effort_out = self._best_effort_out + 1 & 0xFFFF
        identity = self._next_request() + object_id(number, WRITER)
        self._outgoing.append((b"".join((head, identity, data, bytes(-len(data) & 3))), self.connections))
        self._last_write = self._now
        self._written += len(data)
        return True

    def reply(self, number: int, identity: bytes, data: bytes) -> None:
        """Answer a request to a service, CDR without encapsulation."""
        if self.is_connected:
            sample = wire.Sample(self._next_request(), object_id(number, REPLIER), identity + data)
            self._buffered.append(sample.pack(wire.WRITE_DATA))
            self._flush()

    def close(self, now: int) -> None:
        """End the session. The client is closed when the agent has answered, or after 1 s."""
        self._now = max(now, self._now)
        if self.is_closed:
            return
        self.is_connected = False
        self._steps = self._end()
        self._continue()

    # The loop of PX4's client

    def _continue(self) -> None:
        self._until = next(self._steps)

    def _live(self) -> _Steps:
        while True:
            yield from self._find_agent()
            reason = "the agent did not create a session"
            if (yield from self._open_session()):
                self._is_in_session = True
                reason = yield from self._set_up()
                if not reason:
                    reason = yield from self._serve()
                self._send(wire.NO_STREAM, 0, wire.Delete(_DELETE_ID).pack())
            self.is_connected = False
            self._events.append(Disconnected(reason))
            self._reset()
            self.connections += 1

    def _end(self) -> _Steps:
        if self._is_in_session:
            self._statuses.pop(_DELETE_ID, None)
            self._send(wire.NO_STREAM, 0, wire.Delete(_DELETE_ID).pack())
            yield from self._wait(lambda: _DELETE_ID in self._statuses, _SECOND)
        self._reset()
        self.is_closed = True
        while True:
            yield self._now + 3600 * _SECOND

    def _wait(self, is_done: Callable[[], bool], time: int) -> _Outcome:
        """Wait until something is done. Return False if it is not in time."""
        end = self._now + time
        self._is_waiting = True
        while not is_done():
            if self._now >= end:
                self._is_waiting = False
                return False
            yield end
        self._is_waiting = False
        return True

    def _find_agent(self) -> _Steps:
        while True:
            self._info = None
            self._send(wire.NO_STREAM, 0, wire.GetInfo(_PING_ID).pack(), wire.NO_SESSION)
            yield from self._wait(lambda: self._info is not None, _SECOND)
            if self._info is not None and self._info.available:
                return
            yield from self._wait(lambda: False, _SECOND if self._info else 0)

    def _open_session(self) -> _Outcome:
        create = wire.CreateClient(self.settings.key)
        for _ in range(_ATTEMPTS):
            self._send(wire.NO_STREAM, 0, create.pack(), wire.NO_SESSION)
            if (yield from self._wait(lambda: self._agent is not None, _SECOND)):
                return self._agent is not None and self._agent.status == wire.OK
        return False

    def _set_up(self) -> Generator[int, None, str]:
        """Synchronise the clocks and create all entities. Return why that failed, or ""."""
        if not (yield from self._create((_PARTICIPANT_ID, self._participant()))):
            return "the agent refused the participant"
        if not (yield from self._synchronise()):
            return "the agent did not answer TIMESTAMP"
        for reader in self.settings.readers:
            if (yield from self._create(*_reader_entities(reader))):
                identity = object_id(reader.number, READER)
                self._buffered.append(wire.ReadData(self._next_request(), identity).pack())
        for writer in self.settings.writers:
            if not (yield from self._create(*_writer_entities(writer))):
                return f"the agent refused the writer of {writer.name}"
        for server in self.settings.servers:
            identity = object_id(server.number, REPLIER)
            replier = Replier(*server[1:], parent=_PARTICIPANT_ID)
            if (yield from self._create((identity, replier.pack()))):
                self._buffered.append(wire.ReadData(self._next_request(), identity, wire.RELIABLE).pack())
        self._flush()
        return ""

    def _participant(self) -> bytes:
        name = f"{self.settings.namespace}/px4_micro_xrce_dds"
        return _localhost_participant(name) if self.settings.localhost else Participant(name).pack()

    def _create(self, *entities: tuple[bytes, bytes]) -> _Outcome:
        """Create entities, each an object id and a representation. Return whether the agent made all of them in 1 s."""
        self._statuses.clear()
        requests = []
        for identity, representation in entities:
            requests.append(self._next_request())
            self._buffered.append(wire.Create(requests[-1], identity, representation).pack())
        self._flush()
        wanted = frozenset(requests)
        yield from self._wait(lambda: wanted <= self._statuses.keys(), _SECOND)
        return all(self._statuses.get(request) == wire.OK for request in requests)

    def _serve(self) -> Generator[int, None, str]:
        """Keep the session alive. Return why it ended."""
        self._last_write = self._now
        self._written = self._read = 0
        self.is_connected = True
        self._events.append(Connected())
        sync_time = ping_time = self._now + _SECOND
        missed, is_answered = 0, True
        while True:
            if self._now - self._last_write >= _SILENCE:
                return f"no sample was sent for {_SILENCE // _SECOND} s"
            if self.clock.window and self._now >= sync_time:
                is_done = yield from self._exchange(_SYNC_WAIT)
                sync_time = self._now + (_SECOND if is_done and self.clock.is_converged else 1)
            if self._now >= ping_time:
                if self._written and self._read:
                    missed, is_answered = 0, True
                else:
                    missed, is_answered = 0 if is_answered else missed + 1, False
                    is_answered = yield from self._ping()
                    if missed >= _PINGS:
                        return "the agent does not know this session, or does not answer"
                self._written = self._read = 0
                ping_time = max(ping_time + _SECOND, self._now + 1)
            next_time = min(ping_time, self._last_write + _SILENCE)
            yield min(next_time, sync_time) if self.clock.window else next_time

    def _ping(self) -> _Outcome:
        """Return whether the agent answers within 1 s, and knows this session."""
        self._info = None
        self._send(wire.NO_STREAM, 0, wire.GetInfo(_PING_ID).pack())
        yield from self._wait(lambda: self._info is not None, _SECOND)
        return self._info is not None and self._info.known

    def _synchronise(self) -> _Outcome:
        """Estimate the offset. Return False if the agent does not answer."""
        missed = 0
        while not self.clock.is_converged:
            if (yield from self._exchange(_SECOND)):
                missed = 0
            else:
                missed += 1
                if missed > _ATTEMPTS:
                    return False
            if not self.clock.is_converged:
                yield from self._wait(lambda: False, _SYNC_PAUSE[self.settings.sync])
        return True

    def _exchange(self, time: int) -> _Outcome:
        """Ask for the agent's time, and return whether it answers in time."""
        self._reply = None
        self._send(wire.NO_STREAM, 0, wire.Timestamp(self._now * 1000).pack())
        yield from self._wait(lambda: self._reply is not None, time)
        reply = self._reply
        if reply is None:
            return False
        sent, agent = reply.originated // 1000, reply.transmitted // 1000
        if 0 <= sent <= self._now:
            self.clock.add(sent, agent, self._now)
            self.exchange = Exchange(agent, agent - (sent + self._now) // 2, self._now - sent)
        return True

    # Sending

    def _next_request(self) -> bytes:
        self._last_request = self._last_request + 1 if self._last_request < 0xFFFF else _FIRST_REQUEST
        return self._last_request.to_bytes(2, "big")

    def _send(self, stream: int, sequence: int, body: bytes, session: int = _SESSION) -> None:
        message = wire.pack_message(session, stream, sequence, body)
        self._outgoing.append((message, self.connections))

    def _flush(self) -> None:
        """Send the submessages that were collected, in as few messages as possible."""
        body = b""
        for part in self._buffered:
            padded = part + bytes(-len(part) & 3)
            if body and len(body) + len(padded) > wire.MTU - 4:
                self._queue.append(body)
                body = b""
            if len(padded) > wire.MTU - 4:
                self._queue.extend(_fragments(padded))
            else:
                body += padded
        if body:
            self._queue.append(body)
        self._buffered.clear()
        self._send_reliable()

    def _send_reliable(self) -> None:
        """Send what waits, as far as the window allows."""
        while self._queue and len(self._unacknowledged) < _WINDOW:
            message = wire.pack_message(_SESSION, wire.RELIABLE, self._reliable_out, self._queue.popleft())
            self._unacknowledged[self._reliable_out] = message
            self._reliable_out = self._reliable_out + 1 & 0xFFFF
            self._outgoing.append((message, self.connections))
            self._heartbeat_time = self._now + _HEARTBEAT

    def _send_heartbeat(self) -> None:
        kept = list(self._unacknowledged)
        self._heartbeat_time = self._now + _HEARTBEAT if kept else None
        if kept:
            self._send(wire.NO_STREAM, 0, wire.Heartbeat(kept[0], kept[-1]).pack())

    def _acknowledge(self, last: int | None = None) -> None:
        """Tell the agent which reliable messages have arrived. `last` is the newest one that it has sent."""
        ahead = [sequence - self._expected & 0xFFFF for sequence in self._waiting]
        if last is not None:
            ahead.append(last - self._expected & 0xFFFF)
        newest = max((number for number in ahead if number < _WINDOW), default=-1)
        missing = sum(
            1 << number for number in range(newest + 1) if (self._expected + number & 0xFFFF) not in self._waiting
        )
        self._send(wire.NO_STREAM, 0, wire.AckNack(self._expected, missing).pack())

    # Receiving

    def _take(self, data: bytes) -> None:
        header = wire.parse_header(data)
        if header.session_id not in (_SESSION, wire.NO_SESSION):
            raise wire.WireError("message of another session")
        if header.stream == wire.NO_STREAM:
            self._take_body(data[4:])
        elif not self._is_in_session:
            raise wire.WireError("message outside of a session")
        elif header.stream == wire.BEST_EFFORT:
            if 0 < (header.sequence - self._best_effort_in & 0xFFFF) < 0x8000:
                self._best_effort_in = header.sequence
                self._take_body(data[4:])
        elif header.stream == wire.RELIABLE:
            self._take_reliable(header.sequence, data[4:])
        else:
            raise wire.WireError("unknown stream")

    def _take_reliable(self, sequence: int, body: bytes) -> None:
        if (sequence - self._expected & 0xFFFF) < _WINDOW:
            self._waiting[sequence] = body
        try:
            while self._expected in self._waiting:
                body = self._waiting.pop(self._expected)
                self._expected = self._expected + 1 & 0xFFFF
                self._take_body(body)
        finally:
            self._acknowledge()

    def _take_body(self, body: bytes) -> None:
        for submessage in wire.submessages(body):
            take = _TAKE.get(submessage.id)
            if take is None:
                raise wire.WireError("submessage that no agent sends")
            take(self, submessage)

    def _take_info(self, submessage: wire.Submessage) -> None:
        self._info = wire.Info.unpack(submessage.payload)

    def _take_status_agent(self, submessage: wire.Submessage) -> None:
        self._agent = wire.StatusAgent.unpack(submessage.payload)

    def _take_status(self, submessage: wire.Submessage) -> None:
        status = wire.Status.unpack(submessage.payload)
        if len(self._statuses) < _QUEUE:
            self._statuses[status.request_id] = status.status

    def _take_timestamp_reply(self, submessage: wire.Submessage) -> None:
        self._reply = wire.TimestampReply.unpack(submessage.payload)

    def _take_data(self, submessage: wire.Submessage) -> None:
        sample = wire.Sample.unpack(submessage.payload, submessage.flags)
        number = object_number(sample.object_id)
        self._read += len(sample.data)
        if sample.object_id in self._readers:
            self._events.append(Received(number, sample.data))
        elif sample.object_id in self._servers and object_kind(sample.object_id) == REPLIER:
            wire.Identity.unpack(sample.data)
            self._events.append(Requested(number, sample.data[:24], sample.data[24:]))

    def _take_acknack(self, submessage: wire.Submessage) -> None:
        acknowledged = wire.AckNack.unpack(submessage.payload)
        kept = self._unacknowledged
        if acknowledged.stream != wire.RELIABLE or not kept:
            return
        oldest = next(iter(kept))
        if (acknowledged.first - oldest & 0xFFFF) > len(kept):
            return  # late, or of messages that were never sent
        for sequence in [each for each in kept if 0 < (acknowledged.first - each & 0xFFFF) < 0x8000]:
            del kept[sequence]
        for number in range(16):
            again = kept.get(acknowledged.first + number & 0xFFFF) if acknowledged.missing >> number & 1 else None
            if again:
                self._outgoing.append((again, self.connections))
        self._heartbeat_time = self._now + _HEARTBEAT if kept else None
        self._send_reliable()

    def _take_heartbeat(self, submessage: wire.Submessage) -> None:
        heartbeat = wire.Heartbeat.unpack(submessage.payload)
        if heartbeat.stream != wire.RELIABLE or not self._is_in_session:
            return
        if 0 < (heartbeat.first - self._expected & 0xFFFF) < 0x8000:  # the agent no longer has what is missing
            self._expected = heartbeat.first
            self._waiting = {key: body for key, body in self._waiting.items() if self._is_ahead(key)}
        self._acknowledge(heartbeat.last)

    def _is_ahead(self, sequence: int) -> bool:
        return (sequence - self._expected & 0xFFFF) < _WINDOW


_TAKE: Final = {
    wire.INFO: Client._take_info,  # noqa: SLF001 - a table of the methods above
    wire.STATUS_AGENT: Client._take_status_agent,  # noqa: SLF001
    wire.STATUS: Client._take_status,  # noqa: SLF001
    wire.TIMESTAMP_REPLY: Client._take_timestamp_reply,  # noqa: SLF001
    wire.DATA: Client._take_data,  # noqa: SLF001
    wire.ACKNACK: Client._take_acknack,  # noqa: SLF001
    wire.HEARTBEAT: Client._take_heartbeat,  # noqa: SLF001
}


def _reader_entities(reader: Reader) -> list[tuple[bytes, bytes]]:
    topic, subscriber, identity = (object_id(reader.number, kind) for kind in (TOPIC, SUBSCRIBER, READER))
    return [
        (topic, Topic(reader.name, reader.type, _PARTICIPANT_ID).pack()),
        (subscriber, Group(SUBSCRIBER, _PARTICIPANT_ID).pack()),
        (identity, Endpoint(READER, topic, subscriber, QOS_KEEP_LAST, reader.depth).pack()),
    ]


def _writer_entities(writer: Writer) -> list[tuple[bytes, bytes]]:
    topic, publisher, identity = (object_id(writer.number, kind) for kind in (TOPIC, PUBLISHER, WRITER))
    return [
        (topic, Topic(writer.name, writer.type, _PARTICIPANT_ID).pack()),
        (publisher, Group(PUBLISHER, _PARTICIPANT_ID).pack()),
        (identity, Endpoint(WRITER, topic, publisher, QOS_KEEP_LAST | QOS_TRANSIENT_LOCAL).pack()),
    ]


def _localhost_participant(name: str) -> bytes:
    """Return the representation of a participant that is restricted to the loopback interface."""
    transport = "<transport_id>udp_localhost</transport_id>"
    only = "<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>"
    xml = (
        f"<dds><profiles><transport_descriptors><transport_descriptor>{transport}<type>UDPv4</type>{only}"
        "</transport_descriptor></transport_descriptors></profiles>"
        f"<participant><rtps><name>{escape(name)}</name><useBuiltinTransports>false</useBuiltinTransports>"
        f"<userTransports>{transport}</userTransports></rtps></participant></dds>"
    )
    text = bytes((PARTICIPANT, BY_XML, 0, 0)) + wire.pack_string(xml)
    return text + bytes(len(text) & 1) + bytes(2)


def _fragments(submessage: bytes) -> list[bytes]:
    """Return the FRAGMENTs of a submessage that is too long for a message. Its padding is part of the last one."""
    parts = [submessage[at : at + _FRAGMENT] for at in range(0, len(submessage), _FRAGMENT)]
    flags = [wire.LITTLE_ENDIAN] * (len(parts) - 1) + [wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT]
    return [wire.pack_submessage(wire.FRAGMENT, part, flag) for part, flag in zip(parts, flags, strict=True)]
