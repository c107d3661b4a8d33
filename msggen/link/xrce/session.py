"""One client of an agent: its streams, entities, samples and requests. docs/xrce.md."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from msggen.link.age import NEVER
from msggen.link.link import Connected, Disconnected, LinkError, Lost, Opened, Remote, Replied, Route, Sample, Service
from msggen.link.xrce import entities, wire
from msggen.link.xrce.entities import RefusedError
from msggen.link.xrce.inventory import Inventory, Reading
from msggen.link.xrce.limits import (
    ABSENCE,
    HEARTBEAT_PERIOD,
    IDLE,
    LOSSES,
    QUESTION_PERIOD,
    QUESTIONS,
    REPETITIONS,
    REPLIES,
    REPLY_TICKS,
    VEHICLE,
    Limits,
)
from msggen.link.xrce.outbox import Address, Outbox, host
from msggen.link.xrce.record import Journal, Record
from msggen.link.xrce.streams import (
    INPUT_WINDOW,
    NEAR,
    OUTPUT_WINDOW,
    BestEffortInput,
    Fragments,
    ReliableInput,
    ReliableOutput,
    distance,
)
from msggen.link.xrce.wire import BEST_EFFORT, RELIABLE, Submessage, WireError

_WRITE = struct.Struct("<BBH2x2s")  # the header of a WRITE_DATA, request id and object id
_ANY: Final = 1 << 62
_BEFORE_ALL: Final = 0xFFFF  # a number that is older than the one of each of the first 32767 messages
_QUESTION: Final = wire.Heartbeat(0, _BEFORE_ALL).pack()
"""Asks a client for the number of the reliable message that it expects, and changes nothing at it."""
_PING: Final = b"\x00\x0a"  # the request id of each ping of PX4's client
_MOST_MISSING: Final = 0x8000  # of messages that are not counted yet: as many as a jump can be


class Session:
    """One client, agent side. The agent decides when it begins, sleeps and ends.

    It is one class, because each message can change streams, entities and the life of the session together.
    """

    def __init__(  # noqa: PLR0913, PLR0917 - the agent makes it
        self,
        create: wire.CreateClient,
        address: Address,
        outbox: Outbox,
        limits: Limits,
        named: Callable[[Session], None],
        clock: Callable[[], int],
    ) -> None:
        """Begin the session that a CREATE_CLIENT asks for.

        `named` is called when the client has told its namespace. `clock` tells whether a message has expired.
        """
        self.create = create
        self.address = address
        self.host = host(address)
        self.session_id = create.session_id
        self.remote: Remote | None = None
        """The vehicle, while it is reported as connected."""
        self.ended: str | None = None
        """The reason why the session has ended."""
        self.heard = True
        """Whether a message that is no sample has arrived since the agent has looked last."""
        self.is_writing = False
        """Whether the client has sent a sample or made an entity since then."""
        self.heard_at = 0.0
        self.written_at = 0.0
        self.begun_at = 0.0
        self.follower: Session | None = None
        """A session with this key and namespace that began later, until it is known whether it replaces this one."""
        self.pinged = False
        """Whether the client has sent a ping outside of a session, as it does before it begins one."""
        self.continued = False
        """Whether an earlier program began the session."""
        self.is_new = True
        """Whether no message of the client has arrived yet in this session."""
        self.timestamps = 0
        """How often the client has asked for the time."""
        self.inventory = Inventory(limits.entities, limits.text)
        self.writers = self.inventory.writers
        self.hashes: Mapping[str, int] = {}
        """The `message_hash` of the vehicle's definitions by ROS type, as far as they are known."""
        self.samples: Mapping[str, tuple[bytes, int]] = {}
        """The last samples of topics that the vehicle publishes rarely, each with the time of its arrival, by route."""
        self.journal = Journal(limits.record)
        self.recorded = self.settled = 0
        """The version of the journal of the last record, and at the last look."""
        self._next_create = 0  # the number of the reliable message in which a continued session may go on to create
        self.fast_id = -1
        """The session id, if a WRITE_DATA of stream 1 can be taken without a look at streams: the session is awake."""
        self._guid = bytes(16)
        self.key = wire.key_bytes(create.key) if create.session_id < 0x80 else b""
        self._outbox = outbox
        self._limits = limits
        self._named = named
        self._clock = clock
        self._stream = wire.NO_STREAM  # of the message that is being taken, and its time
        self._time = 0
        self._replies = _ANY  # how many more it may have
        self._reset()

    def _reset(self) -> None:
        """Begin all streams."""
        self.best_effort = BestEffortInput(near=NEAR)
        self._missing = 0  # messages of that stream, not counted yet
        self.input = ReliableInput()
        self._output = ReliableOutput()
        self._waiting: list[tuple[bytes, int]] | None = None  # for the number of the next reliable message, while it
        # is not known; each with the time at which it expires
        self._questions = 0  # how often it was asked for
        self._asked_at: float | None = None
        self._next = 0  # the number of the next best-effort message
        self._beat_at: float | None = None
        self._request = 0  # the number of the last request, and the ticks in which its reply is still asked for
        self._reply_ticks = 0
        self._fragments = Fragments(self._limits.fragments)

    # Life

    def look(self, now: float) -> bool:
        """Take note of the time if a message has arrived since the last call. Return whether one has."""
        is_heard = self.is_heard
        if is_heard:
            self.heard_at = now
        if self.is_writing:
            self.written_at = now
        self.heard = self.is_writing = False
        return is_heard

    @property
    def is_heard(self) -> bool:
        """Whether a message has arrived since the agent has looked last."""
        return self.heard or self.is_writing

    @property
    def is_vehicle(self) -> bool:
        """Whether the client has the entities of a vehicle."""
        return len(self.inventory) >= VEHICLE

    @property
    def is_unheard(self) -> bool:
        """Whether this is the session of a record whose client was not heard yet."""
        return self.continued and self.is_new

    def is_busy(self, now: float) -> bool:
        """Whether the client does what a vehicle does all the time: it sends samples, or is about to."""
        return self.is_writing or now - self.written_at < IDLE

    def connect(self, number: int, name: str, guid: bytes) -> None:
        """Report the client as connected, with the routes it has. `name` is its address as text."""
        self.remote = Remote(number, name, self.create.key, self.inventory.namespace or "", self.continued)
        self._guid = guid + (number & 0xFFFFFF).to_bytes(3, "big") + b"\x03"
        self._outbox.events.append(Connected(self.remote))
        self._outbox.events += [Opened(self.remote, route) for route in self.inventory.routes()]
        self._open_fast_path()

    def disconnect(self, reason: str) -> None:
        """Report the client as disconnected. It keeps its state, and may connect again."""
        if self.remote is not None:
            self._outbox.events.append(Disconnected(self.remote, reason))
        self.remote = None
        self.fast_id = -1
        self.best_effort.last = None
        self._missing = 0

    # Sessions that an earlier program began: docs/xrce.md, 10

    def resume(self, record: Record) -> None:
        """Continue the session of a record. Raises WireError and RefusedError if its entities are not valid."""
        for part in record.parts:
            for submessage in wire.submessages(part):
                if submessage.id == wire.CREATE:
                    self.inventory.create(wire.Create.unpack(submessage.payload, submessage.flags))
                else:
                    self.inventory.read(wire.ReadData.unpack(submessage.payload))
                self.journal.add(submessage)
        if self.inventory.namespace is None:
            raise WireError("record without a participant")
        self.hashes = record.hashes
        names = {each.name for each in self.inventory.routes() if isinstance(each, Route) and each.direction == "out"}
        self.samples = {name: sample for name, sample in record.samples.items() if name in names}
        self.recorded = self.settled = self.journal.version
        self._next_create = record.next
        self._continue()
        self._send(wire.NO_STREAM, wire.Info(_PING, known=True).pack())
        self._ask_numbers()

    def record(self) -> Record | None:
        """Return what another program needs to continue the session, or None if that is not known."""
        parts = self.journal.parts
        if parts is None or self.inventory.namespace is None:
            return None
        create, following = self.create, self.input.expected or 0
        told = self.hashes, self.samples
        return Record(self.address, create.key, self.session_id, create.mtu, following, parts, *told)

    def _continue(self) -> None:
        self.continued = True
        self.best_effort = BestEffortInput(None, NEAR)
        self.input = ReliableInput(None)
        self._waiting = []

    def _ask_numbers(self) -> None:
        """Ask for the number of the next reliable message, in messages that go once around the best-effort numbers.

        The client takes a best-effort message only if its number is newer than the last one, which is not known here.
        Whatever it is, the number after the last one of these is newer, even if one or two of them are lost.
        """
        self._questions += 1
        for number in range(0, 0x10000, 0x2000):
            self._next = number
            self._send(BEST_EFFORT, _QUESTION)

    def _ask_again(self, now: float) -> None:
        """Ask for the numbers again if the answers are due: questions or answers may be lost.

        An address that sends nothing may be a forged one, so it is not asked again.
        """
        if self._asked_at is None:
            self._asked_at = now
        elif now - self._asked_at >= QUESTION_PERIOD and self._questions < QUESTIONS and self.heard_at > self._asked_at:
            self._asked_at = now
            self._ask_numbers()

    def _learn_number(self, number: int) -> None:
        """Take the number of the next reliable message from an ACKNACK, and send what has waited for it."""
        if self._waiting is None and not (self.continued and self._output.is_fresh):
            return
        if self._waiting is None and distance(self._output.next, number) < 0:
            return
        self._output = ReliableOutput(number)
        waiting, self._waiting = self._waiting or [], None
        for submessage, until in waiting:
            if self._clock() <= until:
                self._send(RELIABLE, submessage, until)
            else:
                self._outbox.expired += 1

    def _see_number(self, number: int) -> None:
        """Take the first number of the reliable stream from the client that is seen in a continued session.

        If the client goes on to create entities, it must be the one after those that are known.
        """
        repeated = distance(number, self._next_create)
        if self.input.expected is not None or not self.continued:
            return
        if 0 <= repeated < INPUT_WINDOW:
            self.input = ReliableInput(self._next_create)
        else:
            self._next_create = -1

    def tick(self, now: float) -> None:
        """Ask for acknowledgements that are due, and for a reply that may be lost."""
        self._ask_for_reply()
        if self._waiting is not None:
            self._ask_again(now)
        beat = self._output.heartbeat()
        if beat is None:
            self._beat_at = None
        elif self._beat_at is None:
            self._beat_at = now + HEARTBEAT_PERIOD
        elif now >= self._beat_at and now - self.heard_at < ABSENCE:
            self._beat_at = now + HEARTBEAT_PERIOD
            self._send(wire.NO_STREAM, wire.Heartbeat(*beat).pack())

    def _ask_for_reply(self) -> None:
        """Report the next reliable message as missing: PX4's client repeats it if it was sent (docs/xrce.md, 6)."""
        state = self.input.acknack()
        if self._reply_ticks and state is not None:
            self._reply_ticks -= 1
            self._send(wire.NO_STREAM, wire.AckNack(state[0], state[1] | 1).pack())

    # To the client

    def publish(self, object_id: int, payload: bytes, until: int) -> None:
        """Send a sample: `Agent.publish`."""
        reader, reading = self._find(object_id, entities.READER)
        if reading is None:
            raise LinkError(f"the vehicle does not read object {object_id}; routes() has those of direction 'in'")
        self._send_data(reading.stream, reading.request_id + reader, self._cut(payload), until)

    def call(self, object_id: int, request: int, payload: bytes, until: int) -> None:
        """Send a request: `Agent.call`."""
        replier, reading = self._find(object_id, entities.REPLIER)
        if reading is None:
            raise LinkError(f"the vehicle has no service with object {object_id}; routes() has its services")
        data = wire.Identity(self._guid, request).pack() + self._cut(payload)
        self._send_data(reading.stream, reading.request_id + replier, data, until)
        self._request, self._reply_ticks = request, REPLY_TICKS

    def _find(self, number: int, kind: int) -> tuple[bytes, Reading | None]:
        if not 0 <= number <= entities.LARGEST_NUMBER:
            return b"", None
        object_id = entities.object_id(number, kind)
        return object_id, self.inventory.readings.get(object_id)

    def _cut(self, payload: bytes) -> bytes:
        """Return a payload without its encapsulation."""
        if payload[:2] != wire.ENCAPSULATION[:2]:
            raise LinkError("the payload is not little-endian CDR with an encapsulation; use encode() of a message")
        longest = min(self.create.mtu, self._limits.message)
        room = longest - 12 - len(self.key)  # headers of message and submessage, request id and object id
        if len(payload) - 4 > room:
            raise LinkError(f"the payload has {len(payload) - 4} bytes, and the vehicle takes up to {room}")
        return payload[4:]

    def _send_data(self, stream: int, ids: bytes, data: bytes, until: int) -> None:
        """Send DATA. `ids` are request id and object id."""
        if stream == RELIABLE and (self._output.is_full or len(self._waiting or ()) >= OUTPUT_WINDOW):
            raise LinkError("the vehicle does not acknowledge what it gets; wait for replies before further requests")
        submessage = wire.SUBMESSAGE.pack(wire.DATA, wire.LITTLE_ENDIAN, len(data) + 4) + ids + data
        self._send(stream, submessage, until)

    def _send(self, stream: int, submessage: bytes, until: int = NEVER) -> None:
        """Send a submessage in a message of its own. One of the reliable stream is sent again until it expires."""
        sequence = 0
        if stream == BEST_EFFORT:
            sequence = self._next
            self._next = (sequence + 1) & 0xFFFF
        elif stream == RELIABLE:
            if self._waiting is not None and len(self._waiting) < OUTPUT_WINDOW:
                self._waiting.append((submessage, until))
                return
            if self._waiting is not None or self._output.is_full:
                self._outbox.refuse("too many messages without acknowledgement")
                return
            sequence = self._output.send(submessage, until)
        self._post(stream, sequence, submessage, until)

    def _post(self, stream: int, sequence: int, submessage: bytes, until: int) -> None:
        if not self._replies:  # the client asks again for what is lost of a reliable stream
            self._outbox.refuse("too many requests in a message")
            return
        self._replies -= 1
        message = wire.HEADER.pack(self.session_id, stream, sequence) + self.key + submessage
        self._outbox.send(message, self.address, until)

    # From the client

    def receive(self, header: wire.Header, body: bytes, time: int) -> None:
        """Take a message of this session. `header` has been compared with the session's id and key."""
        self.heard = True
        self.is_new = False
        self._time = time
        self._replies = REPLIES
        self._receive(header, body)
        self._replies = _ANY

    def _receive(self, header: wire.Header, body: bytes) -> None:
        if header.stream == RELIABLE:
            self._see_number(header.sequence)
            self._take(self.input.receive(header.sequence, body))
            self._acknowledge()
        elif header.stream == wire.NO_STREAM:
            self._submessages(body, wire.NO_STREAM)
        elif header.stream == BEST_EFFORT:
            if not self._advance(header.sequence, body):
                return
            self._submessages(body, BEST_EFFORT)
        else:
            self._outbox.refuse("unknown stream")
            return
        self._outbox.received += 1

    def _advance(self, sequence: int, body: bytes) -> bool:
        """Take the number of a message of the best-effort stream. Return whether the message is to be taken, too."""
        try:
            deque(wire.submessages(body), maxlen=0)  # the number of a damaged message counts for nothing
        except WireError as error:
            self._outbox.refuse(str(error))
            return False
        missing = self.best_effort.accept(sequence)
        if missing is None:
            self._outbox.late += 1
            return False
        self.miss(missing)
        self._open_fast_path()
        return True

    def samples_in(self, data: bytes, time: int) -> list[Sample]:
        """Return the samples in a message of the best-effort stream, or none if it has anything else in it."""
        remote, writers, at, end = self.remote, self.writers, 4, len(data)
        found: list[Sample] = []
        while end - at >= _WRITE.size:
            kind, flags, length, object_id = _WRITE.unpack_from(data, at)
            route, stop = writers.get(object_id), at + 4 + length
            if route is None or kind != wire.WRITE_DATA or flags != wire.LITTLE_ENDIAN or length < 4 or stop > end:
                return []
            found.append(Sample(remote, route, wire.ENCAPSULATION + data[at + 8 : stop], time))  # type: ignore[arg-type]
            at = stop + (-stop & 3)
        return found if end - at < 4 else []

    def miss(self, count: int) -> None:
        """Take note of messages that are missing before one of the best-effort stream. Report up to LOSSES of all."""
        if self.remote is None:
            return
        waiting = min(self._missing + count, _MOST_MISSING)
        counted = min(waiting, LOSSES)
        self._missing = waiting - counted
        if counted:
            self._outbox.lost += counted
            self._outbox.events.append(Lost(self.remote, counted))
        if self._missing:
            self.fast_id = -1  # the next messages come to `_advance`

    def _open_fast_path(self) -> None:
        if self.remote is not None and not self.key and self.best_effort.last is not None and not self._missing:
            self.fast_id = self.session_id

    def _take(self, messages: list[bytes]) -> None:
        for message in messages:
            self._submessages(message, RELIABLE)

    def _acknowledge(self) -> None:
        state = self.input.acknack()
        if state is not None:
            self._send(wire.NO_STREAM, wire.AckNack(*state).pack())

    def _submessages(self, body: bytes, stream: int) -> None:
        try:
            for submessage in wire.submessages(body):
                self._stream = stream
                if submessage.id == wire.FRAGMENT:
                    self._fragment(submessage)
                else:
                    if stream == RELIABLE and self._fragments.is_begun:
                        self._fragments.clear()
                        self._outbox.refuse("fragments without an end")
                    self._submessage(submessage)
                if self.ended is not None:
                    return
        except WireError as error:
            self._outbox.refuse(str(error))

    def _fragment(self, submessage: Submessage) -> None:
        if self._stream != RELIABLE:
            raise WireError("fragment outside of a reliable stream")
        whole = self._fragments.add(submessage.payload, last=bool(submessage.flags & wire.LAST_FRAGMENT))
        for joined in wire.submessages(whole or b""):
            self._submessage(joined)

    def _submessage(self, submessage: Submessage) -> None:
        handler = self._handlers.get(submessage.id)
        if handler is None:
            raise WireError("submessage that an agent does not take")
        handler(self, submessage)

    def _write(self, submessage: Submessage) -> None:
        sample = wire.Sample.unpack(submessage.payload, submessage.flags)
        route = self.writers.get(sample.object_id)
        service = self.inventory.services.get(sample.object_id)
        if self.continued and service is None and route is None:
            self.ended = "its topics are not those of the record of its session, so it has to connect again"
            return
        if self.remote is None or (route is None and service is None):
            raise WireError("data of an unknown entity")
        if route is not None:
            self.is_writing = True
            payload = wire.ENCAPSULATION + sample.data
            self._outbox.events.append(Sample(self.remote, route, payload, self._time))
        elif service is not None:
            identity = wire.Identity.unpack(sample.data)
            if identity.writer != self._guid:
                raise WireError("reply to a request of another program")
            if identity.number == self._request:
                self._reply_ticks = 0
            payload = wire.ENCAPSULATION + sample.data[24:]
            self._outbox.events.append(Replied(self.remote, service, identity.number, payload))

    def _create(self, submessage: Submessage) -> None:
        create = wire.Create.unpack(submessage.payload, submessage.flags)
        if self.continued and self._next_create < 0:
            self.ended = "the vehicle had not created all of its topics, so it has to connect again"
            return
        status = self._try(lambda: self._open(self.inventory.create(create)))
        if status == wire.OK:
            self.journal.add(submessage)
        self.is_writing |= status == wire.OK
        self._send(self._stream, wire.Status(create.request_id, create.object_id, status).pack())
        if self.remote is None and self.inventory.namespace is not None:
            self._named(self)

    def _read(self, submessage: Submessage) -> None:
        read = wire.ReadData.unpack(submessage.payload)
        status = self._try(lambda: self._open(self.inventory.read(read)))
        if status == wire.OK:
            self.journal.add(submessage)
        else:
            self._send(self._stream, wire.Status(read.request_id, read.object_id, status).pack())

    def _delete(self, submessage: Submessage) -> None:
        delete = wire.Delete.unpack(submessage.payload)
        status = wire.OK
        if delete.object_id == wire.CLIENT_ID:
            self.ended = "the vehicle has ended the session"
        else:
            status = self._try(lambda: self.inventory.delete(delete.object_id))
            self.journal.give_up()
        self._send(self._stream, wire.Status(delete.request_id, delete.object_id, status).pack())

    def _try(self, action: Callable[[], None]) -> int:
        """Return the status of an action, and count it if it is refused."""
        try:
            action()
        except WireError as error:
            self._outbox.refuse(str(error))
            return wire.ERR_INVALID_DATA
        except RefusedError as error:
            self._outbox.refuse(str(error))
            return error.status
        return wire.OK

    def _open(self, route: Route | Service | None) -> None:
        if route is not None and self.remote is not None:
            self._outbox.events.append(Opened(self.remote, route))

    def _get_info(self, submessage: Submessage) -> None:
        self._send(wire.NO_STREAM, wire.answer_info(submessage.payload, known=True))

    def _acknack(self, submessage: Submessage) -> None:
        state = wire.AckNack.unpack(submessage.payload)
        if state.stream != RELIABLE:
            raise WireError("unknown stream")
        self._learn_number(state.first)
        self._outbox.expired += self._output.expire(self._clock(), _QUESTION)
        for sequence, body in self._output.acknack(state.first, state.missing)[:REPETITIONS]:
            self._post(RELIABLE, sequence, body, self._output.until(sequence))

    def _heartbeat(self, submessage: Submessage) -> None:
        beat = wire.Heartbeat.unpack(submessage.payload)
        if beat.stream != RELIABLE:
            raise WireError("unknown stream")
        self._see_number(beat.first)
        self._take(self.input.heartbeat(beat.first, beat.last))
        self._acknowledge()

    def _timestamp(self, submessage: Submessage) -> None:
        self.timestamps += 1
        self._send(wire.NO_STREAM, wire.answer_timestamp(submessage.payload, self._time))

    def _restart(self, submessage: Submessage) -> None:  # noqa: ARG002
        self._reset()

    _handlers: ClassVar[dict[int, Callable[[Session, Submessage], None]]] = {
        wire.CREATE: _create,
        wire.GET_INFO: _get_info,
        wire.DELETE: _delete,
        wire.WRITE_DATA: _write,
        wire.READ_DATA: _read,
        wire.ACKNACK: _acknack,
        wire.HEARTBEAT: _heartbeat,
        wire.RESET: _restart,
        wire.TIMESTAMP: _timestamp,
    }
