"""A simulated vehicle without input or output: a client, a world, and the messages between them.

    vehicle.advance(now)
    for data, connection in vehicle.take_outgoing():
        ...
    vehicle.receive(data, now)

Times are in us since boot. The same options and the same calls give the same datagrams.
"""

from __future__ import annotations

import random
import re
from collections import Counter, deque
from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, Literal, NamedTuple, TypeAlias

from msggen.live.messages.object_ids import object_ids_of
from msggen.live.sim.commander.states import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from msggen.live.sim.line import Line, Misbehaviour
from msggen.live.sim.parameters import PARAMETERS
from msggen.live.sim.programs import Programs, rules_of
from msggen.live.sim.publishing import FlightLog, Publication, Schedule, publication_of
from msggen.live.sim.values import Clocks, Scene
from msggen.live.sim.world import Home, World
from msggen.live.xrce import client as xrce
from msggen.live.xrce.client_entities import Reader, Server, Settings, Sync, Writer
from msggen.live.xrce.client_events import Connected, Received, Requested
from msggen.live.xrce.wire import ENCAPSULATION, HEADER, TIMESTAMP_REPLY

_QUEUE = 8
"""The number of answers that wait: ORB_QUEUE_LENGTH of VehicleCommandAck."""

_RESULTS = {
    ACCEPTED: "accepted",
    TEMPORARILY_REJECTED: "temporarily rejected",
    DENIED: "denied",
    UNSUPPORTED: "unsupported",
}

_POLL = 1_000
"""The time in us of a loop of PX4's client: samples that become due in it share a datagram."""

_SERVICE_NUMBER = 2048
_EVENTS = 256


Board: TypeAlias = Literal["most", "sitl"]
"""The board that the firmware is built for: most boards, or px4_sitl, which has all messages of the release."""


class Options(NamedTuple):
    """The options of a simulated vehicle."""

    key: int = 1
    """The key of the client and the system id of the vehicle: UXRCE_DDS_KEY and MAV_SYS_ID, from 1 to 255."""
    namespace: str = ""
    rate: float | None = None
    """The rate in Hz at which all topics are published, None for the rate of each."""
    sync: Sync = "px4"
    seed: int = 0
    """Of the noise of sensors and of what goes wrong."""
    misbehaviour: Misbehaviour = Misbehaviour()
    home: Home = Home()
    board: Board = "most"
    """Decides the object ids of topics out, if the release has messages that only some boards have."""
    parameters: Mapping[str, float] = MappingProxyType({})
    """Parameters of PX4 that differ from their defaults, which `PARAMETERS` lists."""


class Change(NamedTuple):
    """Something that happened, for people to read."""

    time: int
    text: str


class _Input(NamedTuple):
    """A topic that the vehicle reads."""

    topic: str
    """Its name in uORB."""
    message: Any
    handler: Callable[[Any, int], None] | None
    """Takes a message and its time in us since boot."""


class SimulatedVehicle:
    """A vehicle that publishes and accepts the endpoints of a generated package."""

    def __init__(
        self,
        package: ModuleType,
        options: Options = Options(),  # noqa: B008 - it is immutable
        log: FlightLog | None = None,
    ) -> None:
        self.options = options
        self._log = log
        self.sent: Counter[str] = Counter()
        """The number of samples published, by the name of the topic in ROS 2."""
        self.received: Counter[str] = Counter()
        """The number of samples received, by the name of the topic in ROS 2."""
        self.refused: Counter[str] = Counter()
        """Samples that could not be decoded, by topic, and datagrams that were refused, by reason."""
        self.changes: deque[Change] = deque(maxlen=_EVENTS)
        """What happened and was not yet taken."""
        self._package = package
        self._topics = import_module(f"{package.__name__}.topics")
        self._services = getattr(package, "srv", None)
        self._uorb = self._topics.UORB
        self.world = world_of(package, options)
        self._programs = Programs(self.world, self._answer)
        self._now = 0
        self._noise = random.Random(f"noise {options.seed} {options.key}")  # noqa: S311 - not for secrets
        self._clocks = Clocks()
        wrong = options.misbehaviour
        self._to_agent = Line(wrong, f"out {options.seed} {options.key}")
        self._from_agent = Line(wrong._replace(garbage=0.0), f"in {options.seed} {options.key}")
        self._outgoing: list[tuple[bytes, int]] = []
        self._read_topics()
        self._schedule = Schedule((), 0)
        self._answers: deque[tuple[Publication, Any]] = deque(maxlen=_QUEUE)
        self._settings = self._client_settings()
        self._client = xrce.Client(self._settings)
        self._loop_time = -_POLL
        self._start: int | None = None
        self._client_start = 0
        self._shown = (False, self.world.mode, False)

    # What the transport calls

    @property
    def is_connected(self) -> bool:
        """Whether samples flow."""
        return self._client.is_connected

    @property
    def is_closed(self) -> bool:
        """Whether the session has ended after `close`."""
        return self._client.is_closed

    @property
    def offset(self) -> int:
        """The agent's clock minus the vehicle's in us, which is added to timestamps."""
        return self._client.offset

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        due = self._schedule.next_time
        if due is None or not self._client.is_ready:
            return self._client.next_time
        return min(max(due, self._loop_time + _POLL), self._client.next_time)

    def advance(self, now: int) -> None:
        """Move the vehicle and publish what is due. The intervals of misbehaviour count from the first call."""
        self._now = now
        if self._start is None:
            self._start = self._client_start = now
        self._restart_if_due()
        if not self._client.is_ready:
            self._client.advance(now)
            self._handle()
        self.world.advance(now)
        self._publish_due()
        self._client.advance(now)  # what it asks for leaves after the samples
        self._handle()
        self._report()

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram of the newest connection, or the message of a frame. Never raises."""
        self._now = now
        if self._is_silent() or (
            self.options.misbehaviour.no_time_reply and data[HEADER.size : HEADER.size + 1] == bytes((TIMESTAMP_REPLY,))
        ):
            return
        for arrived, _ in self._from_agent.carry([(data, 0)]):
            self._client.receive(arrived, now)
        self._handle()

    def refuse(self) -> None:
        """Tell that a datagram was refused, as on a host where no agent listens."""
        self._client.refuse()

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its connection: `Client.take_outgoing`."""
        if self._is_silent():
            self._client.take_outgoing()
            return []
        return self._to_agent.carry(self._client.take_outgoing())

    def close(self, now: int) -> None:
        """End the session."""
        self._client.close(now)

    # Endpoints

    def _read_topics(self) -> None:
        namespace = f"/{self.options.namespace}" if self.options.namespace else ""
        versions = self.options.misbehaviour.versions or {}
        self._received_names: dict[int, str] = {}
        self._publications: list[Publication] = []
        self._by_topic: dict[str, Publication] = {}
        self._inputs: dict[int, _Input] = {}
        self._readers, self._writers = [], []
        handlers: Mapping[str, Callable[[Any, int], None]] = {
            **self._programs.handlers,
            "message_format_request": self._answer_format_request,
            "vehicle_command": self._take_vehicle_command,
            "vehicle_command_mode_executor": self._take_vehicle_command,
        }
        numbers = object_ids_of(self._package)[0 if self.options.board == "most" else -1].numbers
        for endpoint, number in zip(self._topics.ENDPOINTS, numbers, strict=True):
            name = namespace + _versioned(endpoint.ros_name, versions.get(endpoint.message_name))
            dds_type = endpoint.dds_type
            if endpoint.direction == "in":
                self._received_names[number] = name
                self._readers.append(Reader(number, f"rt{name}", dds_type, endpoint.qos.reader.depth))
                handler = handlers.get(endpoint.uorb_topic)
                if handler or self._log is not None:
                    self._inputs[number] = _Input(endpoint.uorb_topic, endpoint.message, handler)
            else:
                self._writers.append(Writer(number, f"rt{name}", dds_type))
                publication = publication_of(endpoint, name=name, number=number, rate=self.options.rate)
                self._publications.append(publication)
                self._by_topic[endpoint.uorb_topic] = publication

    def _client_settings(self) -> Settings:
        options = self.options
        namespace = f"/{options.namespace}" if options.namespace else ""
        servers = []
        if self._services is not None:
            service = self._services.VehicleCommand
            topics = (f"rq{namespace}/fmu/vehicle_commandRequest", f"rr{namespace}/fmu/vehicle_commandReply")
            types = (service.Request.__msg__.dds_type, service.Response.__msg__.dds_type)
            servers.append(Server(_SERVICE_NUMBER, "vehicle_command", *types, *topics))
        return Settings(
            self._readers, self._writers, servers, key=options.key, namespace=options.namespace, sync=options.sync
        )

    # Publishing

    def _publish_due(self) -> None:
        if not self._client.is_ready:
            return
        self._loop_time = self._now
        self._publish_answers()
        scene = Scene(self.world, self._noise, self._clocks)
        for publication in self._schedule.take(self._now):
            self._publish(publication, publication.filler.make(scene, self._now))

    def _publish(self, publication: Publication, message: Any) -> None:
        """Send a message, with its times in the agent's clock (docs/time.md)."""
        if self._log is not None:
            self._log.add(publication.topic, message)
        offset = self._client.offset + round(self.options.misbehaviour.clock_off * 1e6)
        message.timestamp = max(0, message.timestamp + offset)
        if publication.filler.is_sampled:
            message.timestamp_sample = max(0, message.timestamp_sample + offset)
        if self._client.write(publication.number, message.encode()[4:]):
            self.sent[publication.name] += 1

    def _answer(self, topic: str, /, **values: Any) -> None:
        """Publish a message on a topic, if the release has it. It waits while the client waits, as in uORB's queue."""
        publication = self._by_topic.get(topic)
        if publication:
            self._answers.append((publication, publication.filler.filled(values, self._now)))
            self._publish_answers()

    def _publish_answers(self) -> None:
        while self._answers and self._client.is_ready:
            self._publish(*self._answers.popleft())

    # What arrives

    def _handle(self) -> None:
        for event in self._client.take_events():
            if isinstance(event, Received):
                self._take_sample(event)
            elif isinstance(event, Requested):
                self._take_request(event)
            elif isinstance(event, Connected):
                self._tell("connected")
                self._answers.clear()
                self._schedule = Schedule(self._publications, self._now)
            else:
                self._tell(f"disconnected: {event.reason}")
        self._clocks = _clocks_of(self._client)
        self.refused.update(self._client.refused)
        self._client.refused.clear()

    def _take_sample(self, event: Received) -> None:
        name = self._received_names[event.number]
        self.received[name] += 1
        found = self._inputs.get(event.number)
        if found is None:
            return
        try:
            message = found.message.decode(ENCAPSULATION + event.data)
        except ValueError:  # DecodeError of the generated package
            self.refused[f"{name}: not a {found.message.__name__}"] += 1
            return
        if found.handler is not None:
            found.handler(message, self._local(message.timestamp))
        if self._log is not None:
            message.timestamp = self._local(message.timestamp)
            self._log.add(found.topic, message)

    def _local(self, timestamp: int) -> int:
        """Return the time of a message in the vehicle's clock. 0 and times to come count as now, as in PX4."""
        return min(timestamp - self._client.offset, self._now) if timestamp else self._now

    def _take_vehicle_command(self, message: Any, _: int) -> None:
        self._carry_out(message)

    def _take_request(self, event: Requested) -> None:
        assert self._services is not None  # noqa: S101 - for the type checker: without services there are no requests
        service = self._services.VehicleCommand
        try:
            request = service.Request.decode(ENCAPSULATION + event.data).request
        except ValueError:
            self.refused["vehicle_command: not a VehicleCommand_Request"] += 1
            return
        self.received["vehicle_command (service)"] += 1
        values = self._carry_out(request)
        if values:
            response = service.Response()
            for name, value in {**values, "timestamp": self._now + self._client.offset}.items():
                setattr(response.reply, name, value)
            self._client.reply(event.number, event.identity, response.encode()[4:])

    def _carry_out(self, command: Any) -> dict[str, int]:
        """Carry out a command and publish its acknowledgement. Return its values, none for that of another vehicle."""
        if command.target_system not in (0, self.world.system_id):
            return {}
        self.world.advance(self._now)
        numbers = [getattr(command, f"param{number}") for number in range(1, 8)]
        result = self.world.command(command.command, numbers, command.source_component)
        reason = f": {self.world.reason}" if self.world.reason else ""
        self._tell(f"{_command_name(command)} {_RESULTS[result]}{reason}")
        values = {
            "command": command.command,
            "result": result,
            "target_system": command.source_system,
            "target_component": command.source_component,
        }
        self._answer("vehicle_command_ack", **values)
        return values

    def _answer_format_request(self, request: Any, _time: int) -> None:
        """Tell the hash of a topic's message. PX4 looks up what follows the last `/`, without a version suffix."""
        latest = type(request).LATEST_PROTOCOL_VERSION
        path = bytes(request.topic_name).partition(b"\0")[0].decode(errors="replace")
        _, slash, name = path.rpartition("/")
        found = bool(slash) and name in self._uorb and request.protocol_version == latest
        message_hash = 0
        if found:
            topic = self._uorb[name]
            message_hash = topic.message.__msg__.message_hash
            if topic.message_name in self.options.misbehaviour.wrong_hashes:
                message_hash ^= 1
        self._answer(
            "message_format_response",
            protocol_version=latest,
            topic_name=bytes(request.topic_name),
            success=found,
            message_hash=message_hash,
        )

    # Changes and misbehaviour

    def _report(self) -> None:
        """Publish and tell what the world has done by itself."""
        world = self.world
        self._programs.ask()
        state = (world.is_armed, world.mode, world.commander.failsafe.is_active)
        if state != self._shown:
            self._tell(world.state(was_armed=self._shown[0]))
            self._shown = state

    def _tell(self, text: str) -> None:
        self.changes.append(Change(self._now, text))
        if self._log is not None:
            self._log.text(self._now, text)

    def _is_silent(self) -> bool:
        after = self.options.misbehaviour.silent_after
        return after is not None and self._start is not None and self._now - self._start >= after * 1e6

    def _restart_if_due(self) -> None:
        every = self.options.misbehaviour.restart_every
        if every is not None and self._now - self._client_start >= every * 1e6 and not self.is_closed:
            connections = self._client.connections
            self._client = xrce.Client(self._settings)
            self._client.connections = connections + 1
            self._client_start = self._now
            self._tell("the client restarts")


def world_of(package: ModuleType, options: Options) -> World:
    """Return the world of a vehicle, with the rules of the release of a generated package."""
    topics = import_module(f"{package.__name__}.topics")
    has_versions = any(re.search(r"_v\d+$", each.ros_name) for each in topics.ENDPOINTS)
    return World(
        options.home,
        options.key,
        has_position=not options.misbehaviour.no_position,
        rules=rules_of(topics.UORB, has_versions=has_versions, is_sitl=options.board == "sitl"),
        parameters={**PARAMETERS, **options.parameters},
    )


def _clocks_of(client: xrce.Client) -> Clocks:
    """Return the last exchange of times, within the ranges of TimesyncStatus whatever the agent's clock is."""
    agent, observed, round_trip = client.exchange
    return Clocks(max(0, agent), -observed, -client.offset, min(round_trip, 0xFFFFFFFF))


def _command_name(command: Any) -> str:
    """Return the name of a VehicleCommand's command, such as DO_SET_MODE, or its number."""
    found = (name for name, value in vars(type(command)).items() if value == command.command)
    return next(
        (name.removeprefix("VEHICLE_CMD_") for name in found if name.startswith("VEHICLE_CMD_")),
        f"command {command.command}",
    )


def _versioned(name: str, version: int | None) -> str:
    """Return the name of a topic with another version suffix. Version 0 has none."""
    if version is None:
        return name
    return re.sub(r"_v\d+$", "", name) + (f"_v{version}" if version else "")
