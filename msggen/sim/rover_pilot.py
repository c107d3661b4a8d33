"""What the modes of a simulated rover drive: PX4's own modes, and the setpoints of programs.

Times are in us, places in m in NED, angles in rad.
"""

from __future__ import annotations

import math
from typing import Any

from msggen.messages.nav_states import DESCEND, EXTERNAL, HOLD, LAND, OFFBOARD, RETURN, TAKEOFF, TERMINATION
from msggen.messages.setpoints import ROVER as ROVER_KINDS
from msggen.messages.setpoints import ROVER_THROTTLE
from msggen.sim.attitude import Vector, added
from msggen.sim.autopilot import Pilot
from msggen.sim.commander.setpoint_types import ALL, Controls
from msggen.sim.flight import NAN, Flight, wrapped
from msggen.sim.parameters import PARAMETERS
from msggen.sim.setpoints import Setpoints
from msggen.sim.wheels import Drive

_SPEED, _BRAKING = PARAMETERS["RO_SPEED_LIM"], PARAMETERS["RO_DECEL_LIM"]
_TURNING = PARAMETERS["RD_TRANS_DRV_TRN"]
"""The heading error above which a differential rover turns on the spot."""
_CLEARING = frozenset({"position", "velocity", "attitude", "rates", "allocation"})
"""The controls whose change clears the setpoints that are stored."""
_LEFT_ALONE = frozenset({TAKEOFF, LAND, DESCEND})
"""The modes of PX4 that a rover does not have: it drives on with what was set."""
_STOP = Drive(speed=0.0)
_NEAR = 0.5
"""The distance in m within which a place is reached: NAV_ACC_RAD of a rover."""


class RoverPilot(Pilot):
    """Drives the mode of the commander. As in PX4, setpoints are used until the controls change."""

    def __init__(self, flight: Flight, setpoints: Setpoints, *, turns_in_place: bool) -> None:
        super().__init__(flight, setpoints)
        self._turns_in_place = turns_in_place
        self._controls: Controls = frozenset()
        self._place: Vector | None = None
        """The place to drive to."""
        self._way = _SPEED, 0.0
        """The speeds on the way to it, and there."""
        self._drive = Drive()
        self._held: Vector = (0.0, 0.0, 0.0)
        self._next: Vector | None = None
        """Where the next Hold is to be."""
        topics = dict.fromkeys(topic for kind in (*ROVER_KINDS, *ROVER_THROTTLE) for topic in kind.topics)
        takers = (
            self._take_position,
            lambda each, _: self._write(speed=each.speed_body_x),
            lambda each, _: self._write(yaw=each.yaw_setpoint),
            lambda each, _: self._write(yaw_rate=each.yaw_rate_setpoint),
            lambda each, _: self._write(steering=each.normalized_steering_setpoint),
            lambda each, _: self._write(throttle=each.throttle_body_x),
        )
        self.handlers = dict(zip(topics, takers, strict=True))

    def _take_position(self, message: Any, _: int) -> None:
        north, east = message.position_ned
        if math.isfinite(north) and math.isfinite(east):
            self._place = north, east, NAN
            cruise, arrival = message.cruising_speed, message.arrival_speed
            self._way = cruise if math.isfinite(cruise) else _SPEED, arrival if math.isfinite(arrival) else 0.0

    def _write(self, **values: float) -> None:
        found = {name: value if math.isfinite(value) else NAN for name, value in values.items()}
        self._drive = self._drive._replace(**found)

    # Modes

    def climb_to(self, _down: float) -> None:
        """Do nothing: a rover does not take off."""

    def hold_at(self, position: Vector, _yaw: float, _speed: float) -> None:
        """Drive to a place in the next Hold."""
        if all(map(math.isfinite, position[:2])):
            self._next = position
            self._mode = -1

    def shift(self, move: Vector) -> None:
        """Move the place that is held with the estimate of the position."""
        self._held = added(self._held, move)

    def enter(self, mode: int, time: int) -> None:
        """Begin a mode, if it is not the present one."""
        if mode != self._mode:
            self._mode, self._since = mode, time
            self._held = (mode == HOLD and self._next) or self._flight.position
            if mode == HOLD:
                self._next = None

    def is_done(self, *, is_landed: bool) -> bool:
        """Whether a landing or a return has reached its end."""
        return is_landed and self._mode in {LAND, RETURN}

    @property
    def is_home(self) -> bool:
        """Whether a return has arrived."""
        return self._mode == RETURN and self._distance(self._flight.home) < _NEAR

    def rest(self) -> None:
        """Stop the motors, and forget the setpoints."""
        self._drive, self._place = Drive(), None

    def target(self, time: int, controls: Controls) -> Drive | None:
        """Return the setpoint at a time. `controls` are those of the mode of a program. None: the motors are off."""
        mode = self._mode
        if mode == TERMINATION:
            return None
        if mode in _LEFT_ALONE:
            return self._stored()
        wanted = controls & _CLEARING if mode in EXTERNAL else ALL & _CLEARING
        if wanted != self._controls:
            self._controls = wanted
            self.rest()
        if mode in EXTERNAL:
            return self._stored() if controls else self._by_actuators()
        if not self._flight.has_position:
            return _STOP
        if mode == OFFBOARD:
            found = self._setpoints.offboard(time)
            return _STOP if found is None else self._led(found.position, found.velocity)
        return self._to(self._flight.home if mode == RETURN else self._held, _SPEED, 0.0)

    def _stored(self) -> Drive:
        """Return what programs have set. A position sets speed and yaw."""
        if "position" not in self._controls or self._place is None:
            return self._drive
        return self._to(self._place, *self._way)

    def _by_actuators(self) -> Drive:
        """Return what a motor and a servo do, or the two motors of a rover that turns on the spot: right and left."""
        found = self._setpoints.actuators(self._since)
        if found is None:
            return Drive()
        motors, servos = found
        if self._turns_in_place:
            return Drive(throttle=(motors[0] + motors[1]) / 2, steering=(motors[1] - motors[0]) / 2)
        return Drive(throttle=motors[0], steering=servos[0] if servos else NAN)

    def _led(self, position: Vector, velocity: Vector) -> Drive:
        if not any(map(math.isnan, position[:2])):
            return self._to(position, _SPEED, 0.0)
        north, east = velocity[:2]
        return Drive(speed=math.hypot(north, east), yaw=math.atan2(east, north))

    def _distance(self, place: Vector) -> float:
        return math.dist(place[:2], self._flight.position[:2])

    def _to(self, place: Vector, cruise: float, arrival: float) -> Drive:
        """Return the setpoint that leads to a place, and stops there."""
        x, y, _ = self._flight.position
        left = self._distance(place)
        if left < _NEAR:
            return Drive(speed=arrival, yaw_rate=0.0)
        bearing = math.atan2(place[1] - y, place[0] - x)
        speed = math.copysign(min(abs(cruise), math.sqrt(arrival * arrival + _BRAKING * left)), cruise)
        if self._turns_in_place and abs(wrapped(bearing - self._flight.yaw)) > _TURNING:
            speed = 0.0
        return Drive(speed=speed, yaw=bearing)
