"""A simulated vehicle without input or output: a client, a world, and the messages between them.

    vehicle.advance(now)
    for data, connection in vehicle.take_outgoing():
        ...
    vehicle.receive(data, now)

Times are in us since boot. The same options and the same calls give the same datagrams.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

from msggen.link.xrce import client as xrce
from msggen.link.xrce.client_events import Connected, Received, Requested
from msggen.link.xrce.wire import ENCAPSULATION, HEADER, TIMESTAMP_REPLY
from msggen.sim import faults
from msggen.sim.airframes import airframe_of
from msggen.sim.disturbances import Disturbances, noise_with
from msggen.sim.endpoints import endpoints_of
from msggen.sim.line import Line
from msggen.sim.options import Options
from msggen.sim.parameters import check_settable
from msggen.sim.programs import Programs, rules_of
from msggen.sim.publishing import Answer, Answers, Changes, FlightLog, Publication, Schedule, localize
from msggen.sim.values import Clocks, Scene
from msggen.sim.world import World
from msggen.sim.zenoh import zenoh_endpoints_of

_POLL = 1_000
"""The time in us of a loop of PX4's client: samples that become due in it share a datagram."""
_EVENTS = 256


class Change(NamedTuple):
    """Something that happened, for people to read."""

    time: int
    text: str


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
        self._endpoints = (zenoh_endpoints_of if options.is_on_zenoh else endpoints_of)(package, options)
        self._by_topic = {each.topic: each for each in self._endpoints.publications}
        self._now = 0
        self._noise = noise_with(options.disturbances, options.seed, options.key)
        self._clocks = Clocks()
        self._exchange: object = None
        """The exchange of times that they are from."""
        wrong = options.misbehaviour
        self._clock_off = round(wrong.clock_off * 1e6)
        self._to_agent = Line(wrong, f"out {options.seed} {options.key}")
        self._from_agent = Line(wrong._replace(garbage=0.0), f"in {options.seed} {options.key}")
        self._schedule = Schedule((), 0)
        self._answers = Answers()
        self._client = self._endpoints.new_client()
        self._loop_time = -_POLL
        self._start: int | None = None
        self._client_start = 0
        self._is_cut = False
        self._faults: deque[faults.Fault] = deque()
        self._timed = faults.TimedFaults(options.faults)
        self.world = world_of(package, options)
        self._enter_world()

    def _enter_world(self) -> None:
        """Connect the messages with the world."""
        self._programs = Programs(self.world, self._answer, self._tell, self._hashes())
        self._shown = (False, self.world.mode, False)
        self._changes = Changes()

    def _hashes(self) -> dict[str, int]:
        """Return the hash of the message of each topic, by its name in uORB."""
        topics = import_module(f"{self._package.__name__}.topics").UORB
        wrong = self.options.misbehaviour.wrong_hashes
        return {
            name: topic.message.__msg__.message_hash ^ (topic.message_name in wrong) for name, topic in topics.items()
        }

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
        if self._faults:
            return self._now
        found = self._client.next_time
        loop, fault = self._programs.next_time, self._timed.next_time
        if self._client.is_ready:
            found = min(found, max(self._schedule.next_time, self._loop_time + _POLL))
        if loop is not None:
            found = min(found, loop)
        if fault is not None and self._start is not None:
            found = min(found, self._start + fault)
        return found

    def advance(self, now: int) -> None:
        """Move the vehicle and publish what is due. The intervals of misbehaviour count from the first call."""
        self._now = now
        if self._start is None:
            self._start = self._client_start = now
        self._restart_if_due()
        self._fail()
        if not self._client.is_ready:
            self._client.advance(now)
            self._handle()
        self._programs.advance(now)
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

    # Publishing

    def _publish_due(self) -> None:
        if not self._client.is_ready:
            return
        self._loop_time = self._now
        self._publish_answers()
        scene = Scene(self.world, self._noise, self._clocks)
        for publication, message in self._schedule.messages(scene, self._now):
            self._publish(publication, message)

    def _publish(self, publication: Publication, message: Any) -> None:
        """Send a message, with its times in the agent's clock (docs/frames.md)."""
        if self._log is not None:
            self._log.add(publication.topic, message)
        offset = self._client.offset + self._clock_off
        message.timestamp = max(0, message.timestamp + offset)
        if publication.filler.is_sampled:
            message.timestamp_sample = max(0, message.timestamp_sample + offset)
        if self._client.write(publication.number, message.encode()[4:]):
            self.sent[publication.name] += 1

    def _answer(self, topic: str, /, **values: Any) -> None:
        """Publish a message on a topic, if the release has it. It waits while the client waits."""
        publication = self._by_topic.get(topic)
        if publication:
            self._answers.add(Answer(publication, values, self._now))
            self._publish_answers()

    def _publish_answers(self) -> None:
        if self._client.is_ready:
            for publication, values, time in self._answers.take():
                self._publish(publication, publication.filler.filled(values, time))

    # What arrives

    def _handle(self) -> None:
        for event in self._client.take_events():
            if isinstance(event, Received):
                self._take_sample(event)
            elif isinstance(event, Requested):
                self._take_request(event)
            elif isinstance(event, Connected):
                self._tell("connected")
                self._answers.repeat()
                self._schedule = Schedule(self._endpoints.publications, self._now)
            else:
                self._tell(f"disconnected: {event.reason}")
        if self._client.exchange is not self._exchange:
            self._exchange, self._clocks = self._client.exchange, _clocks_of(self._client, self._clock_off)
        if self._client.refused:
            self.refused.update(self._client.refused)
            self._client.refused.clear()

    def _take_sample(self, event: Received) -> None:
        topic, name, message_class = self._endpoints.inputs[event.number]
        self.received[name] += 1
        handler = self._programs.handlers.get(topic)
        if handler is None and self._log is None:
            return
        try:
            message = message_class.decode(ENCAPSULATION + event.data)
        except ValueError:  # DecodeError of the generated package
            self.refused[f"{name}: not a {message_class.__name__}"] += 1
            return
        self.world.advance(self._now)
        if self.options.is_on_zenoh:  # PX4 has no other time of what arrives
            message.timestamp = self._now
        else:
            localize(message, self._now, self._client.offset)
        if handler is not None:
            handler(message, message.timestamp)
        if self._log is not None:
            self._log.add(topic, message)

    def _take_request(self, event: Requested) -> None:
        service = self._package.srv.VehicleCommand
        try:
            request = service.Request.decode(ENCAPSULATION + event.data).request
        except ValueError:
            self.refused["vehicle_command: not a VehicleCommand_Request"] += 1
            return
        self.received["vehicle_command (service)"] += 1
        self.world.advance(self._now)
        values = self._programs.carry_out(request)
        if values:
            response = service.Response()
            for name, value in {**values, "timestamp": self._now + self._client.offset}.items():
                setattr(response.reply, name, value)
            self._client.reply(event.number, event.identity, response.encode()[4:])

    # Changes and misbehaviour

    def _report(self) -> None:
        """Publish and tell what the world has done by itself."""
        world = self.world
        self._programs.ask()
        state = (world.is_armed, world.mode, world.commander.failsafe.is_active)
        if state != self._shown:
            self._tell(world.state(was_armed=self._shown[0]))
            self._shown = state
        self._schedule.hasten(self._changes.take(world), self._now)

    def _tell(self, text: str) -> None:
        self.changes.append(Change(self._now, text))
        if self._log is not None:
            self._log.text(self._now, text)

    def _is_silent(self) -> bool:
        after = self.options.misbehaviour.silent_after
        is_over = after is not None and self._start is not None and self._now - self._start >= after * 1e6
        return self._is_cut or is_over

    def _restart_if_due(self) -> None:
        every = self.options.misbehaviour.restart_every
        if every is not None and self._now - self._client_start >= every * 1e6 and not self.is_closed:
            self._restart_client()
            self._tell("the client restarts")

    def _restart_client(self) -> None:
        """Begin a new session from a new port, without a word to the agent."""
        connections = self._client.connections
        self._client = self._endpoints.new_client()
        self._client.connections = connections + 1
        self._client_start = self._now

    def fault(self, text: str) -> None:
        """Let something happen at the next `advance`, such as `no-position`. Any thread can call it.

        The page on simulated vehicles lists the faults. Raises ValueError for another one.
        """
        self._faults.append(faults.read_fault(text))

    def _fail(self) -> None:
        """Let happen what is due."""
        self._faults.extend(self._timed.take(self._now - (self._start or 0)))
        while self._faults:
            text, change = self._faults.popleft()
            self._tell(change(self.world) if change else self._change_client(text))

    def _change_client(self, text: str) -> str:
        if text == faults.RESTART:
            self._restart()
            return "PX4 restarts"
        if text == faults.RESTART_CLIENT:
            self._restart_client()
            return "the client restarts"
        self._is_cut = text == faults.NO_LINK
        return "the link is cut" if self._is_cut else "the link is there again"

    def _restart(self) -> None:
        """Stand at home again, and forget all but the slots of modes. The clock goes on."""
        self.world = restarted(self.world, self._package, self.options)
        self._answers = Answers()
        self._enter_world()
        self._restart_client()


def world_of(package: ModuleType, options: Options) -> World:
    """Return the world of a vehicle, with the rules of the release of a generated package.

    Raises ValueError for a parameter that cannot be set, and for what is no vehicle, part or disturbance.
    """
    parts, airframe = options.equipment, airframe_of(options.vehicle)
    topics = import_module(f"{package.__name__}.topics")
    has_versions = any(re.search(r"_v\d+$", each.ros_name) for each in topics.ENDPOINTS)
    rules = rules_of(topics.UORB, has_versions=has_versions, is_sitl=options.board == "sitl")
    for name in options.parameters:
        check_settable(name, rules)
    found = World(
        options.home,
        options.key,
        has_position=not options.misbehaviour.no_position,
        rules=rules,
        parameters=options.followed,
        airframe=airframe,
    )
    found.parts = parts
    found.disturbances = Disturbances(options.disturbances, options.seed, options.key)
    return found


def restarted(before: World, package: ModuleType, options: Options) -> World:
    """Return the world of a vehicle that restarts at home. Only its clock and the slots of modes stay."""
    found = world_of(package, options)
    for name in ("time", "battery", "has_gps", "has_position", "has_sticks", "has_ground_station"):
        setattr(found, name, getattr(before, name))
    found.is_compass_disturbed = before.is_compass_disturbed
    found.has_position &= found.has_gps and found.external.uses_gps
    found.flight.has_origin &= found.has_position
    found.commander.components = before.commander.components
    found.commander.components.restart()
    return found


def _clocks_of(client: xrce.Client, clock_off: int) -> Clocks:
    """Return the last exchange of times, within the ranges of TimesyncStatus whatever the agent's clock is.

    `clock_off` is the error in us of the estimate by which times are converted.
    """
    agent, observed, round_trip = client.exchange
    return Clocks(max(0, agent), -observed, -client.offset - clock_off, min(round_trip, 0xFFFFFFFF))
