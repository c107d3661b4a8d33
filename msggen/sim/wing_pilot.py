"""What the modes of a simulated fixed-wing aircraft fly: PX4's own modes, and the setpoints of programs.

Times are in us, places in m in NED, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from msggen.messages.nav_states import DESCEND, EXTERNAL, HOLD, LAND, OFFBOARD, RETURN, TAKEOFF, TERMINATION
from msggen.messages.setpoints import FIXED_WING as FIXED_WING_KIND
from msggen.sim.attitude import Vector, added, angles_of
from msggen.sim.autopilot import HEIGHT, POSITION, Pilot
from msggen.sim.commander.setpoint_types import Controls
from msggen.sim.flight import NAN, Push, Target
from msggen.sim.setpoints import PUSHES, Setpoints
from msggen.sim.wings import CLIMB, MAX_CLIMB, MAX_LATERAL, MAX_SINK, SINK, Wing, Wings

_FRESH = 40_000
"""The time for which a setpoint of a program replaces that of PX4's own mode: it is the last writer."""
_AHEAD = 2.0
"""How far ahead in s the guidance looks that leads to a circle."""
_SLOPE = 1.5
"""The sink rate of a landing in m/s."""
_MAX_PITCH, _TAKEOFF_PITCH = math.radians(30.0), math.radians(10.0)
"""The limits of pitch, FW_P_LIM_MIN and FW_P_LIM_MAX, and the least of a takeoff, FW_TKO_PITCH_MIN."""
_BLIND_ROLL, _BLIND_TIME, _BLIND_SINK = math.radians(15.0), 30_000_000, 0.5
"""Without a position: the roll angle of a circle, FW_GPSF_R, how long it keeps the height, FW_GPSF_LT, and the sink
rate in m/s after that, which PX4 has as a number."""
_RATE_TIME = 0.4
"""The time in s for which a rate is flown ahead: that in which angles follow."""
_PARTS = tuple(name for name in Wing._fields if name not in {"roll", "takes_off"})
"""The parts of a setpoint that programs write."""
_NEAR = 1.0
"""The distance in m from the centre of a circle below which it has no bearing."""


class WingPilot(Pilot):
    """Flies the mode of the commander. As in PX4, the last setpoint is flown for ever, whoever has written it."""

    def __init__(self, flight: Wings, setpoints: Setpoints, parameters: Mapping[str, float]) -> None:
        super().__init__(flight, setpoints)
        self._parameters = parameters
        self._wing = Wing()
        self._written = dict.fromkeys(_PARTS, -_FRESH)
        """When a program has written each part of the setpoint."""
        self._circle: Vector = (0.0, 0.0, 0.0)
        self._heading = 0.0
        self._goal = 0.0
        self._place: Vector | None = None
        self._takeoff_height = NAN
        lateral, longitudinal, turns, climbs = FIXED_WING_KIND.topics
        self.handlers = {
            lateral: self._take_lateral,
            longitudinal: self._take_longitudinal,
            turns: self._take_lateral_limits,
            climbs: self._take_longitudinal_limits,
        }

    @property
    def height(self) -> float:
        """The down position of the circle that a Hold or a Return flies."""
        return self._circle[2]

    # Setpoints of programs

    def _take_lateral(self, message: Any, time: int) -> None:
        direction, lateral = message.airspeed_direction, message.lateral_acceleration
        self._write(time, course=message.course, direction=direction, lateral=lateral)

    def _take_longitudinal(self, message: Any, time: int) -> None:
        self._write(
            time,
            down=self._flight.origin.altitude - message.altitude,
            height_rate=message.height_rate,
            airspeed=message.equivalent_airspeed,
            pitch=message.pitch_direct,
            throttle=message.throttle_direct,
        )

    def _take_lateral_limits(self, message: Any, time: int) -> None:
        self._write(time, max_lateral=_within(message.lateral_accel_max, MAX_LATERAL, MAX_LATERAL))

    def _take_longitudinal_limits(self, message: Any, time: int) -> None:
        climb, sink = message.climb_rate_target, message.sink_rate_target
        limits = {
            "climb": _within(climb, CLIMB, MAX_CLIMB),
            "sink": _within(sink, SINK, MAX_SINK),
            "pitch_min": max(-_MAX_PITCH, _or(message.pitch_min, -math.inf)),
            "pitch_max": min(_MAX_PITCH, _or(message.pitch_max, math.inf)),
            "throttle_max": _within(message.throttle_max, 1.0, 1.0),
        }
        self._write(time, **limits)

    def _write(self, time: int, **values: float) -> None:
        found = {name: value if math.isfinite(value) else NAN for name, value in values.items()}
        self._wing = self._wing._replace(**found, takes_off=False)
        self._written.update(dict.fromkeys(found, time))

    # Modes

    def climb_to(self, down: float) -> None:
        """Set the height of the next takeoff, NaN for that of MIS_TAKEOFF_ALT."""
        self._takeoff_height = down
        if self._mode == TAKEOFF:
            self._mode = -1

    def hold_at(self, position: Vector, _yaw: float, _speed: float) -> None:
        """Set where the next Hold circles. NaN: where the aircraft is."""
        self._place = position
        if self._mode == HOLD:
            self._mode = -1

    def shift(self, move: Vector) -> None:
        """Move the circle with the estimate of the position."""
        self._circle = added(self._circle, move)
        self._goal += move[2]

    def enter(self, mode: int, time: int) -> None:
        """Begin a mode, if it is not the present one."""
        if mode == self._mode:
            return
        x, y, z = self._flight.position
        goal = self._goal if self._mode == TAKEOFF and self.is_done(is_landed=False) else z
        self._mode, self._since = mode, time
        self._heading = self._flight.yaw
        self._circle = x, y, goal
        if mode == HOLD and self._place is not None:
            self._circle = tuple(  # type: ignore[assignment]
                new if math.isfinite(new) else old for new, old in zip(self._place, (x, y, z), strict=True)
            )
        elif mode == TAKEOFF:
            self._goal = _or(self._takeoff_height, z - self._parameters["MIS_TAKEOFF_ALT"])
            self._takeoff_height = NAN
        elif mode == RETURN:
            home = self._flight.home
            self._circle = home[0], home[1], min(z, home[2] - self._parameters["RTL_RETURN_ALT"])
        self._place = None

    def is_done(self, *, is_landed: bool) -> bool:
        """Whether a takeoff or a landing has reached its end. A return ends in a circle."""
        if self._mode == TAKEOFF:
            return not is_landed and self._flight.position[2] <= self._goal
        return is_landed and self._mode == LAND

    def target(self, time: int, controls: Controls) -> Wing | None:
        """Return the setpoint at a time. `controls` are those of the mode of a program. None: the motor is off."""
        mode = self._mode
        if mode == TERMINATION:
            return None
        if mode in EXTERNAL:
            return self._program(controls)
        if mode == DESCEND or not self._flight.has_position:
            return self._blind(time, mode)
        own = self._own(mode, time)
        kept = {name: getattr(self._wing, name) for name, last in self._written.items() if time - last < _FRESH}
        self._wing = own._replace(**kept)
        return self._wing

    def _blind(self, time: int, mode: int) -> Wing:
        """Circle, and descend after some time, without a position. A pilot's modes fly on, level."""
        if mode in HEIGHT:
            return Wing(roll=0.0, down=self._circle[2])
        if time < self._since + _BLIND_TIME:
            return Wing(roll=_BLIND_ROLL, down=self._circle[2])
        return Wing(roll=_BLIND_ROLL, height_rate=-_BLIND_SINK)

    def _program(self, controls: Controls) -> Wing:
        """Return the setpoint of the mode of a program, which is the last one of PX4's own mode at its beginning."""
        if not POSITION.isdisjoint(controls):
            return self._wing
        if not controls.isdisjoint(PUSHES):
            return self._posed(self._setpoints.push(controls, self._since))
        found = self._setpoints.actuators(self._since)
        return self._posed(None if found is None else Push(0.0, forward=max(0.0, found[0][0])))

    def _posed(self, push: Push | None) -> Wing:
        """Return a setpoint of attitude or rates. Without one, the last stays."""
        if push is None:
            return self._wing
        roll, pitch, _ = angles_of(push.attitude, 0.0) if push.attitude else (0.0, 0.0, 0.0)
        if push.attitude is None:  # the rates, for the time that the roll angle takes to follow
            roll = self._flight.roll + push.rates[0] * _RATE_TIME
            pitch = self._flight.pitch + push.rates[1] * _RATE_TIME
        return Wing(roll=roll, pitch=pitch, throttle=push.forward)

    def _own(self, mode: int, time: int) -> Wing:
        """Return the setpoint of a mode of PX4."""
        if mode == TAKEOFF:
            return Wing(course=self._heading, height_rate=MAX_CLIMB, pitch_min=_TAKEOFF_PITCH, takes_off=True)
        if mode == LAND:
            return Wing(course=self._heading, height_rate=-_SLOPE, throttle=0.0, throttle_max=0.0)
        if mode in {HOLD, RETURN}:
            return self._around(self._circle)
        found = self._setpoints.offboard(time) if mode == OFFBOARD else None
        if found is None:
            return Wing(course=self._heading, down=self._circle[2])
        return self._led(found)

    def _led(self, target: Target) -> Wing:
        """Return what a TrajectorySetpoint asks for: a circle around a place, or a velocity."""
        if not any(map(math.isnan, target.position)):
            return self._around(target.position)
        north, east, down = target.velocity
        return Wing(course=math.atan2(east, north), height_rate=-down, airspeed=math.hypot(north, east))

    def _around(self, place: Vector) -> Wing:
        """Return the setpoint that leads to a circle around a place, clockwise."""
        flight, radius = self._flight, self._parameters["NAV_LOITER_RAD"]
        x, y = flight.position[0] - place[0], flight.position[1] - place[1]
        distance, speed = math.hypot(x, y), max(1.0, math.hypot(*flight.velocity[:2]))
        bearing = math.atan2(y, x) if distance > _NEAR else flight.yaw
        off = math.atan((distance - radius) / (_AHEAD * speed))
        turn = speed * speed / radius * math.cos(off) ** 2
        return Wing(course=bearing + math.pi / 2 + off, lateral=turn, down=place[2])


def _within(value: float, default: float, most: float) -> float:
    """Return a limit of a program, which can only be tighter than PX4's."""
    return max(0.0, min(most, value)) if math.isfinite(value) else default


def _or(value: float, default: float) -> float:
    return value if math.isfinite(value) else default
