"""One client of an agent: its streams, entities, samples and requests. docs/xrce.md."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import ClassVar, Final, NamedTuple

from msggen.live.link import LinkError, Remote, Route, Service
from msggen.live.xrce import entities, wire
from msggen.live.xrce.events import Address, Connected, Disconnected, Lost, Opened, Outbox, Replied, Sample
from msggen.live.xrce.streams import BestEffortInput, Fragments, ReliableInput, ReliableOutput
from msggen.live.xrce.wire import BEST_EFFORT, RELIABLE, Submessage, WireError

HEARTBEAT_PERIOD: Final = 0.1
"""Seconds without acknowledgement after which a HEARTBEAT asks for it."""

_NAME = re.compile(r"[A-Za-z0-9_/:~]+")
_PARTICIPANT = re.compile(r"/*([A-Za-z0-9_/]*?)/*px4_micro_xrce_dds")
_PARENTS = {
    entities.TOPIC: entities.PARTICIPANT,
    entities.PUBLISHER: entities.PARTICIPANT,
    entities.SUBSCRIBER: entities.PARTICIPANT,
    entities.REPLIER: entities.PARTICIPANT,
    entities.WRITER: entities.PUBLISHER,
    entities.READER: entities.SUBSCRIBER,
}


class Limits(NamedTuple):
    """Bounds of an agent."""

    clients: int = 64
    """Sessions, with those that are silent."""
    message: int = 4096
    """Bytes of a message from a client. PX4's client sends up to 508."""
    fragments: int = 65536
    """Bytes of a client's joined fragments."""
    entities: int = 1024
    """Entities of a client. PX4's client has about 200."""
    text: int = 255
    """Characters of a topic's or a type's name."""
    outgoing: int = 4096
    """Datagrams that wait for `take_outgoing`."""
    silence: float = 5.0
    """Seconds after which a silent client is reported as disconnected. PX4's client sends every second."""
    memory: float = 60.0
    """Seconds after which a silent client is forgotten. Until then it continues its session if it sends again."""


class Reading(NamedTuple):
    """A READ_DATA: where samples or requests go."""

    route: Route | Service
    request_id: bytes
    stream: int


class Session:
    """One client, agent side. The agent decides when it begins, sleeps and ends."""

    def __init__(
        self,
        create: wire.CreateClient,
        address: Address,
        outbox: Outbox,
        limits: Limits,
        named: Callable[[Session], None],
    ) -> None:
        """Begin the session that a CREATE_CLIENT asks for. `named` is called when the client has told its namespace."""
        self.create = create
        self.address = address
        self.session_id = create.session_id
        self.namespace: str | None = None
        self.remote: Remote | None = None
        """The vehicle, while it is reported as connected."""
        self.ended: str | None = None
        """The reason why the session has ended."""
        self.heard = True
        """Whether a message has arrived since the agent has looked last."""
        self.heard_at = 0.0
        self.begun_at = 0.0
        self.replaced_at: float | None = None
        """The time at which another session with this key and namespace began, until this one sends again."""
        self.pinged = False
        """Whether the client has sent a ping outside of a session, as it does before it begins one."""
        self.adopted = False
        self.writers: dict[bytes, Route] = {}
        self.fast_id = -1
        """The session id, if a WRITE_DATA of stream 1 can be taken without a look at streams: the session is awake."""
        self._guid = bytes(16)
        self.key = wire.key_bytes(create.key) if create.session_id < 0x80 else b""
        self._outbox = outbox
        self._limits = limits
        self._named = named
        self._entities: dict[bytes, entities.Entity] = {}
        self._readers: dict[bytes, Route] = {}
        self._services: dict[bytes, Service] = {}
        self._readings: dict[bytes, Reading] = {}
        self._stream = wire.NO_STREAM  # of the message that is being taken, and its time
        self._time = 0
        self._reset()

    @property
    def is_new(self) -> bool:
        """Whether the client has not sent anything after its CREATE_CLIENT."""
        return not self._entities and self.input.expected == 0 and self.best_effort.last == 0xFFFF

    def _reset(self) -> None:
        """Begin all streams."""
        self.best_effort = BestEffortInput()
        self.input = ReliableInput()
        self._output = ReliableOutput()
        self._next = 0  # the number of the next best-effort message
        self._beat_at: float | None = None
        self._fragments = Fragments(self._limits.fragments)

    # Life

    def connect(self, number: int, name: str, guid: bytes) -> None:
        """Report the client as connected, with the routes it has. `name` is its address as text."""
        self.remote = Remote(number, name, self.create.key, self.namespace or "", self.adopted)
        self._guid = guid + (number & 0xFFFFFF).to_bytes(3, "big") + b"\x03"
        self._outbox.events.append(Connected(self.remote))
        self._outbox.events += [Opened(self.remote, route) for route in self.routes()]
        self._open_fast_path()

    def disconnect(self, reason: str) -> None:
        """Report the client as disconnected. It keeps its state, and may connect again."""
        if self.remote is not None:
            self._outbox.events.append(Disconnected(self.remote, reason))
        self.remote = None
        self.fast_id = -1
        self.best_effort.last = None

    def adopt(self, known: Iterable[Route]) -> None:
        """Take over a session that an earlier program began: docs/xrce.md, "Take-over"."""
        self.adopted = True
        self.namespace = ""
        self.best_effort = BestEffortInput(None)
        self.input = ReliableInput(None)
        for route in known:
            if route.direction == "out":
                self.writers[entities.object_id(route.object_id, entities.WRITER)] = route
            else:
                object_id = entities.object_id(route.object_id, entities.READER)
                self._readings[object_id] = Reading(route, wire.NO_REQUEST, BEST_EFFORT)
        for number in (*range(0, 0x10000, 0x2000), 0):
            self._next = number
            self._send_data(BEST_EFFORT, bytes(4), b"")

    def tick(self, now: float) -> None:
        """Ask for acknowledgements that are due."""
        beat = self._output.heartbeat()
        if beat is None:
            self._beat_at = None
        elif self._beat_at is None:
            self._beat_at = now + HEARTBEAT_PERIOD
        elif now >= self._beat_at:
            self._beat_at = now + HEARTBEAT_PERIOD
            self._send(wire.NO_STREAM, wire.Heartbeat(*beat).pack())

    def routes(self) -> list[Route | Service]:
        """Return what the client publishes, and what it has asked for."""
        return [*self.writers.values(), *(reading.route for reading in self._readings.values())]

    # To the client

    def publish(self, object_id: int, payload: bytes) -> None:
        """Send a sample: `Agent.publish`."""
        reader = entities.object_id(object_id, entities.READER)
        reading = self._readings.get(reader)
        if reading is None:
            raise LinkError(f"the vehicle does not read object {object_id}; routes() has those of direction 'in'")
        self._send_data(reading.stream, reading.request_id + reader, self._cut(payload))

    def call(self, object_id: int, request: int, payload: bytes) -> None:
        """Send a request: `Agent.call`."""
        if self.adopted:
            raise LinkError(
                "services cannot be called in a session that an earlier program began; "
                "restart uxrce_dds_client on the vehicle"
            )
        replier = entities.object_id(object_id, entities.REPLIER)
        reading = self._readings.get(replier)
        if reading is None:
            raise LinkError(f"the vehicle has no service with object {object_id}; routes() has its services")
        if self._output.is_full:
            raise LinkError("the vehicle does not acknowledge requests; wait for replies before further requests")
        data = wire.Identity(self._guid, request).pack() + self._cut(payload)
        self._send_data(reading.stream, reading.request_id + replier, data)

    def _cut(self, payload: bytes) -> bytes:
        """Return a payload without its encapsulation."""
        if payload[:2] != wire.ENCAPSULATION[:2]:
            raise LinkError("the payload is not little-endian CDR with an encapsulation; use encode() of a message")
        room = self.create.mtu - 12 - len(self.key)  # headers of message and submessage, request id and object id
        if len(payload) - 4 > room:
            raise LinkError(f"the payload has {len(payload) - 4} bytes, and the vehicle takes up to {room}")
        return payload[4:]

    def _send_data(self, stream: int, ids: bytes, data: bytes) -> None:
        """Send DATA. `ids` are request id and object id."""
        self._send(stream, wire.SUBMESSAGE.pack(wire.DATA, wire.LITTLE_ENDIAN, len(data) + 4) + ids + data)

    def _send(self, stream: int, submessage: bytes) -> None:
        """Send a submessage in a message of its own."""
        sequence = 0
        if stream == BEST_EFFORT:
            sequence = self._next
            self._next = (sequence + 1) & 0xFFFF
        elif stream == RELIABLE:
            if self._output.is_full:
                self._outbox.refuse("too many messages without acknowledgement")
                return
            sequence = self._output.send(submessage)
        self._post(stream, sequence, submessage)

    def _post(self, stream: int, sequence: int, submessage: bytes) -> None:
        message = wire.HEADER.pack(self.session_id, stream, sequence) + self.key + submessage
        self._outbox.send(message, self.address)

    # From the client

    def receive(self, header: wire.Header, body: bytes, time: int) -> None:
        """Take a message of this session. `header` has been compared with the session's id and key."""
        self.heard = True
        self._time = time
        if header.stream == RELIABLE:
            self._take(self.input.receive(header.sequence, body))
            self._acknowledge()
        elif header.stream == wire.NO_STREAM:
            self._submessages(body, wire.NO_STREAM)
        elif header.stream == BEST_EFFORT:
            missing = self.best_effort.accept(header.sequence)
            if missing is None:
                self._outbox.late += 1
                return
            self.miss(missing)
            self._open_fast_path()
            self._submessages(body, BEST_EFFORT)
        else:
            self._outbox.refuse("unknown stream")
            return
        self._outbox.received += 1

    def miss(self, count: int) -> None:
        """Report missing messages of the best-effort stream."""
        if count and self.remote is not None:
            self._outbox.lost += count
            self._outbox.events.append(Lost(self.remote, count))

    def _open_fast_path(self) -> None:
        if self.remote is not None and not self.key and self.best_effort.last is not None:
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
        service = self._services.get(sample.object_id)
        if self.remote is None or (route is None and service is None):
            raise WireError("data of an unknown entity")
        if route is not None:
            payload = wire.ENCAPSULATION + sample.data
            self._outbox.events.append(Sample(self.remote, route, payload, self._time))
        elif service is not None:
            identity = wire.Identity.unpack(sample.data)
            if identity.writer != self._guid:
                raise WireError("reply to a request of another program")
            payload = wire.ENCAPSULATION + sample.data[24:]
            self._outbox.events.append(Replied(self.remote, service, identity.number, payload))

    def _create(self, submessage: Submessage) -> None:
        create = wire.Create.unpack(submessage.payload, submessage.flags)
        if self.adopted:
            self.ended = "the session that was to be continued had not been complete; the vehicle connects again"
            return
        try:
            status = self._make(create, entities.parse(create))
        except WireError as error:
            self._outbox.refuse(str(error))
            status = wire.ERR_INVALID_DATA
        except entities.UnsupportedError as error:
            self._outbox.refuse(str(error))
            status = wire.ERR_DDS_ERROR
        self._send(self._stream, wire.Status(create.request_id, create.object_id, status).pack())

    def _make(self, create: wire.Create, entity: entities.Entity) -> int:
        """Make an entity; return the status."""
        object_id = create.object_id
        if (old := self._entities.get(object_id)) is not None and not create.flags & wire.REPLACE:
            return wire.OK_MATCHED if create.flags & wire.REUSE and entity == old else wire.ERR_ALREADY_EXISTS
        if old is None and len(self._entities) >= self._limits.entities:
            self._outbox.refuse("too many entities")
            return wire.ERR_RESOURCES
        if isinstance(entity, entities.Participant):
            self._entities[object_id] = entity
            self._name(entity)
            return wire.OK
        if not self._has(entity.parent, _PARENTS[entities.object_kind(object_id)]):
            self._outbox.refuse("entity of an unknown parent")
            return wire.ERR_UNKNOWN_REFERENCE
        if isinstance(entity, entities.Topic):
            self._check_names(entity.name, entity.type)
        elif isinstance(entity, entities.Replier):
            self._check_names(*entity[:5])
            self._services[object_id] = _service(object_id, entity)
        elif isinstance(entity, entities.Endpoint):
            return self._make_endpoint(object_id, entity)
        self._entities[object_id] = entity
        return wire.OK

    def _make_endpoint(self, object_id: bytes, entity: entities.Endpoint) -> int:
        names = entity.topic
        if isinstance(names, bytes):
            topic = self._entities.get(names)
            if not isinstance(topic, entities.Topic):
                self._outbox.refuse("endpoint of an unknown topic")
                return wire.ERR_UNKNOWN_REFERENCE
            names = topic.name, topic.type
        self._check_names(*names)
        number, is_writer = entities.object_number(object_id), entity.kind == entities.WRITER
        route = Route(_ros_name(names[0]), _ros_type(names[1]), "out" if is_writer else "in", number)
        self._entities[object_id] = entity
        if not is_writer:
            self._readings.pop(object_id, None)  # until the client asks for its samples
            self._readers[object_id] = route
        elif self.writers.get(object_id) != route:
            self.writers[object_id] = route
            self._open(route)
        return wire.OK

    def _has(self, object_id: bytes, kind: int) -> bool:
        return object_id in self._entities and entities.object_kind(object_id) == kind

    def _check_names(self, *names: str) -> None:
        for name in names:
            if len(name) > self._limits.text or not _NAME.fullmatch(name):
                raise WireError("name with unexpected characters, or too long")

    def _name(self, participant: entities.Participant) -> None:
        """Take the namespace of the client's first participant."""
        if self.namespace is None:
            found = _PARTICIPANT.fullmatch(participant.name[: self._limits.text])
            self.namespace = found[1] if found else ""
            self._named(self)

    def _open(self, route: Route | Service) -> None:
        if self.remote is not None:
            self._outbox.events.append(Opened(self.remote, route))

    def _read(self, submessage: Submessage) -> None:
        read = wire.ReadData.unpack(submessage.payload)
        route = self._readers.get(read.object_id) or self._services.get(read.object_id)
        if route is None or read.stream not in (BEST_EFFORT, RELIABLE):
            self._outbox.refuse("READ_DATA of an unknown entity, or for an unknown stream")
            status = wire.ERR_INVALID_DATA if route else wire.ERR_UNKNOWN_REFERENCE
            self._send(self._stream, wire.Status(read.request_id, read.object_id, status).pack())
            return
        is_new = read.object_id not in self._readings
        self._readings[read.object_id] = Reading(route, read.request_id, read.stream)
        if is_new:
            self._open(route)

    def _delete(self, submessage: Submessage) -> None:
        delete = wire.Delete.unpack(submessage.payload)
        status = wire.OK
        if delete.object_id == wire.CLIENT_ID:
            self.ended = "the vehicle has ended the session"
        elif not self._remove(delete.object_id):
            status = wire.ERR_UNKNOWN_REFERENCE
        self._send(self._stream, wire.Status(delete.request_id, delete.object_id, status).pack())

    def _remove(self, object_id: bytes) -> bool:
        """Remove an entity, and those that are part of it."""
        if self._entities.pop(object_id, None) is None:
            return False
        for table in (self.writers, self._readers, self._services, self._readings):
            table.pop(object_id, None)
        for child in [child for child, entity in self._entities.items() if _parent(entity) == object_id]:
            self._remove(child)
        return True

    def _get_info(self, submessage: Submessage) -> None:
        self._send(wire.NO_STREAM, wire.answer_info(submessage.payload, known=True))

    def _acknack(self, submessage: Submessage) -> None:
        state = wire.AckNack.unpack(submessage.payload)
        if state.stream != RELIABLE:
            raise WireError("unknown stream")
        for sequence, body in self._output.acknack(state.first, state.missing):
            self._post(RELIABLE, sequence, body)

    def _heartbeat(self, submessage: Submessage) -> None:
        beat = wire.Heartbeat.unpack(submessage.payload)
        if beat.stream != RELIABLE:
            raise WireError("unknown stream")
        self._take(self.input.heartbeat(beat.first, beat.last))
        self._acknowledge()

    def _timestamp(self, submessage: Submessage) -> None:
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


def _parent(entity: entities.Entity) -> bytes | None:
    return None if isinstance(entity, entities.Participant) else entity.parent


def _service(object_id: bytes, replier: entities.Replier) -> Service:
    """Return a service with its names in ROS 2: `rq/fmu/vehicle_commandRequest` is `/fmu/vehicle_command`."""
    name = _ros_name(replier.request_topic).removesuffix("Request")
    types = _ros_type(replier.request_type), _ros_type(replier.reply_type)
    return Service(name, *types, entities.object_number(object_id))


def _ros_name(topic: str) -> str:
    """Return a topic's name in ROS 2: `rt/fmu/out/vehicle_status` is `/fmu/out/vehicle_status`."""
    return topic[2:] if topic.startswith(("rt/", "rq/")) else topic


def _ros_type(dds_type: str) -> str:
    """Return a type's name in ROS 2: `px4_msgs::msg::dds_::VehicleStatus_` is `px4_msgs/msg/VehicleStatus`."""
    if "::dds_::" in dds_type:
        dds_type = dds_type.replace("::dds_::", "::").removesuffix("_")
    return dds_type.replace("::", "/")
