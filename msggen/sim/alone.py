"""A flight without a program and without a link, as fast as it can be computed: `msggen sim --log`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

from msggen.messages.commands import ARM_DISARM, LAND, RETURN, SET_MODE, TAKEOFF, VTOL_TRANSITION
from msggen.messages.nav_states import HOLD, OFFBOARD
from msggen.messages.setpoints import OFFBOARD_CONTROL_MODE, TRAJECTORY
from msggen.messages.vehicle_types import ROVER
from msggen.sim.attitude import Vector
from msggen.sim.disturbances import noise_with
from msggen.sim.faults import TimedFaults
from msggen.sim.flight import NAN
from msggen.sim.options import Options
from msggen.sim.publishing import Changes, FlightLog, Publication, Schedule, publication_of
from msggen.sim.values import Clocks, Filler, Scene
from msggen.sim.vehicle import world_of
from msggen.sim.wings import Wings
from msggen.sim.world import STEP

BOOT = 1_000_000
"""The time since boot in us at which the flight begins."""

_HEIGHT = 10.0
_SQUARE = ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0))
"""North and east in m."""
_NEAR = 0.5
_CIRCLE = 40.0
"""The time in s for which wings circle."""
_REST = 1_000_000
"""The time in us for which the flight goes on after the vehicle has disarmed."""
_HEARTBEAT, _SETPOINT = 100_000, 50_000
"""The intervals in us of OffboardControlMode and TrajectorySetpoint."""
INSIDE = {"vehicle_local_position_setpoint": 100_000, "actuator_motors": 20_000}
"""Topics that PX4 logs and does not bridge to DDS, with their intervals in us."""
_INPUTS = (OFFBOARD_CONTROL_MODE, TRAJECTORY.topic, "vehicle_command")


class LoneFlight:
    """A vehicle that takes off, flies a square in Offboard mode, and lands. With wings, it flies a circle in Hold.

    `utc` is the time in us since 1970.
    """

    def __init__(self, package: ModuleType, options: Options, utc: int) -> None:
        self.world = world_of(package, options)
        self.time = self.world.time = BOOT
        self._utc = utc
        self._noise = noise_with(options.disturbances, options.seed, options.key)
        topics = import_module(f"{package.__name__}.topics")
        endpoints = [each for each in topics.ENDPOINTS if each.direction == "out"]
        publications = [publication_of(each, rate=options.rate, parts=options.equipment) for each in endpoints]
        fillers = {name: Filler(topics.UORB[name].message) for name in (*INSIDE, *_INPUTS) if name in topics.UORB}
        publications += [
            Publication(name, "", 0, interval, fillers[name]) for name, interval in INSIDE.items() if name in fillers
        ]
        self._inputs = {name: fillers[name] for name in _INPUTS if name in fillers}
        self.topics: Mapping[str, Any] = {each.topic: each.filler.message for each in publications} | {
            name: filler.message for name, filler in self._inputs.items()
        }
        """The classes of the messages of all topics, by their names in uORB."""
        self._changes = Changes()
        self._schedule = Schedule(publications, BOOT)
        self._goal: tuple[float, float] | None = None
        self._sent: dict[str, int] = {}
        self._faults = TimedFaults(options.faults)

    def run(self, log: FlightLog, until: int) -> None:
        """Fly up to a time in us, or until the vehicle has landed again."""
        script = self._script(log)
        is_reached = next(script)
        before, end = (self.world.is_armed, self.world.mode), until
        while self.time < end:
            self._advance(log)
            after = self.world.is_armed, self.world.mode
            if after != before:
                log.text(self.time, self.world.state(was_armed=before[0]))
                if before[1] == OFFBOARD:
                    self._goal, is_reached = None, _never  # as a program that sees that another mode flies
                if before[0] and not after[0]:
                    end = min(until, self.time + _REST)
                before = after
            if is_reached():
                following = next(script, None)
                if following is None:
                    return
                is_reached = following

    def _script(self, log: FlightLog) -> Iterator[Callable[[], bool]]:
        """Do what a pilot and a program do, and yield what to wait for before the next step."""
        world, airframe = self.world, self.world.airframe
        yield self._after(2.0)
        if airframe.vehicle_type != ROVER:
            height = max(_HEIGHT, airframe.parameters.get("MIS_TAKEOFF_ALT", 0.0))
            self._command(log, TAKEOFF, param7=world.home.altitude + height)
            yield self._after(0.5)
        self._command(log, ARM_DISARM, param1=1.0)
        if not world.is_armed:  # refused, as without a position: the next time the vehicle would not arm either
            yield self._after(5.0)
            return
        yield lambda: world.mode == HOLD
        yield self._after(3.0)
        yield from self._circle(log) if isinstance(world.flight, Wings) else self._square(log)
        self._command(log, RETURN if airframe.is_vtol else LAND)
        self._goal = None
        yield _never

    def _square(self, log: FlightLog) -> Iterator[Callable[[], bool]]:
        self._goal = _SQUARE[0]
        yield self._after(1.5)
        self._command(log, SET_MODE, param1=1.0, param2=6.0)
        for corner in _SQUARE:
            self._goal = corner
            yield self._is_near
            yield self._after(1.0)

    def _circle(self, log: FlightLog) -> Iterator[Callable[[], bool]]:
        if self.world.airframe.is_vtol:
            self._command(log, VTOL_TRANSITION, param1=4.0)
        yield self._after(_CIRCLE)

    def _after(self, seconds: float) -> Callable[[], bool]:
        end = self.time + round(seconds * 1e6)
        return lambda: self.time >= end

    def _is_near(self) -> bool:
        return self._goal is not None and math.dist(self.world.flight.position, self._place(*self._goal)) < _NEAR

    def _place(self, north: float, east: float) -> Vector:
        """Return a place at the height that the vehicle flies at."""
        return north, east, self.world.flight.ground if self.world.airframe.vehicle_type == ROVER else -_HEIGHT

    def _advance(self, log: FlightLog) -> None:
        self.time += STEP
        self.world.advance(self.time)
        for fault in self._faults.take(self.time - BOOT):
            if fault.change:
                log.text(self.time, fault.change(self.world))
        if self._goal is not None:
            self._send_setpoints(log, *self._goal)
        self._schedule.hasten(self._changes.take(self.world), self.time)
        scene = Scene(self.world, self._noise, Clocks(remote=self._utc + self.time - BOOT))
        for publication, message in self._schedule.messages(scene, self.time):
            log.add(publication.topic, message)

    def _send_setpoints(self, log: FlightLog, north: float, east: float) -> None:
        free = (NAN, NAN, NAN)
        setpoint = {
            "position": self._place(north, east),
            "velocity": free,
            "acceleration": free,
            "jerk": free,
            "yaw": 0.0,
            "yawspeed": NAN,
        }
        for topic, interval, values in (
            (OFFBOARD_CONTROL_MODE, _HEARTBEAT, {"position": True}),
            (TRAJECTORY.topic, _SETPOINT, setpoint),
        ):
            if self.time - self._sent.get(topic, -interval) >= interval and topic in self._inputs:
                self._sent[topic] = self.time
                message = self._inputs[topic].message(timestamp=self.time, **values)
                self.world.setpoints.handlers[topic](message, self.time)
                log.add(topic, message)

    def _command(self, log: FlightLog, number: int, **parameters: float) -> None:
        values = [parameters.get(f"param{place}", NAN) for place in range(1, 8)]
        result = self.world.command(number, values)
        if self.world.reason:
            log.text(self.time, f"command {number} refused: {self.world.reason}")
        filler = self._inputs.get("vehicle_command")
        if filler:
            log.add("vehicle_command", filler.message(timestamp=self.time, command=number, **parameters))
        answer = self.topics.get("vehicle_command_ack")
        if answer:
            log.add("vehicle_command_ack", answer(timestamp=self.time, command=number, result=result))


def _never() -> bool:
    """Return False: the vehicle disarms by itself, which ends the flight."""
    return False
