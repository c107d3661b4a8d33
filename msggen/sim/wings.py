"""The motion of a simulated fixed-wing aircraft: PX4's control laws for course, altitude and airspeed.

It is a point mass that flies coordinated turns: the roll angle gives the turn, the airspeed does not fall below a
minimum, and the air moves with the wind. Gains and limits have the defaults of the parameters in msggen.sim.parameters.
Angles are in rad, clockwise from north; lengths in m, speeds in m/s, accelerations in m/s^2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from math import isnan
from typing import NamedTuple

from msggen.sim.attitude import Quaternion, Vector, product, to_body
from msggen.sim.flight import GRAVITY, NAN, ZERO, Flight, Push, Target, wrapped
from msggen.sim.parameters import PARAMETERS

_COURSE_GAIN = 4 * math.pi * PARAMETERS["NPFG_DAMPING"] / PARAMETERS["NPFG_PERIOD"]
_MAX_ROLL = math.radians(PARAMETERS["FW_R_LIM"])
MAX_LATERAL = math.tan(_MAX_ROLL) * GRAVITY
"""The lateral acceleration at the largest roll angle."""
_ROLL_RATE = math.radians(PARAMETERS["FW_PN_R_SLEW_MAX"])
_ROLL_LAG = 0.4
"""The time in s in which the roll angle follows its setpoint: FW_R_TC."""
_ALTITUDE_TIME, _AIRSPEED_TIME = PARAMETERS["FW_T_ALT_TC"], PARAMETERS["FW_T_TAS_TC"]
CLIMB, SINK = PARAMETERS["FW_T_CLMB_R_SP"], PARAMETERS["FW_T_SINK_R_SP"]
MAX_CLIMB, MAX_SINK = PARAMETERS["FW_T_CLMB_MAX"], PARAMETERS["FW_T_SINK_MAX"]
_CLIMB_LAG = 1.0
"""The time in s in which the height rate follows its setpoint."""
_AIRSPEED_SLEW = 1.0
"""How fast the airspeed setpoint changes, in m/s^2."""
_ANGLE_OF_ATTACK = math.radians(3.0)
_RUNWAY, _BRAKES = 5.0, 2.0
"""The acceleration on the runway, as captured from PX4's simulator, and the deceleration of a rollout."""
_ROTATION = 4.2
"""How much faster than FW_AIRSPD_MIN the aircraft is in m/s when it leaves the runway, as captured."""
_PITCH_TIME = 0.5
"""The time in s in which the pitch angle follows a setpoint of attitude."""
_TRIM_THROTTLE = 0.6
"""The throttle of level flight: FW_THR_TRIM."""
_LOWEST = 1e-3
_BY_WINGS = 0.3
"""The share of the thrust in hover that forward flight takes."""
_DRIFT_TIME = 2.0
"""The time in s in which what gusts add to the wind fades, and the sideslip at the end of a transition."""
_QUARTER = math.pi / 2
_ON_ITS_BACK = math.radians(-175.0)


class Wing(NamedTuple):
    """A setpoint of a fixed-wing aircraft. NaN stands for what is not controlled, as in PX4's setpoints."""

    course: float = NAN
    """Over ground."""
    direction: float = NAN
    """The direction of the velocity through the air. It replaces the course."""
    lateral: float = NAN
    """A lateral acceleration to the right, which is added."""
    down: float = NAN
    """The down position in NED."""
    height_rate: float = NAN
    """Upwards. It replaces `down`."""
    airspeed: float = NAN
    roll: float = NAN
    """Replaces all that turns the aircraft."""
    pitch: float = NAN
    """Replaces `down` and `height_rate`."""
    throttle: float = NAN
    """From 0 to 1. It replaces `airspeed`."""
    max_lateral: float = MAX_LATERAL
    climb: float = CLIMB
    sink: float = SINK
    """The limits of the height rate towards an altitude."""
    pitch_min: float = -math.inf
    pitch_max: float = math.inf
    throttle_max: float = 1.0
    """Limits of what the height and its rate ask for. A pitch or throttle that is set has none."""
    takes_off: bool = False
    """Whether the aircraft accelerates on the ground. Otherwise, it brakes there."""


class Wings(Flight):
    """The state of motion of a fixed-wing aircraft, or of a VTOL, which also takes the setpoints of a multicopter."""

    def __init__(self, parameters: Mapping[str, float], *, is_tailsitter: bool = False) -> None:
        super().__init__()
        self.is_tailsitter = is_tailsitter
        """Whether the attitude in forward flight is a quarter turn from that of a hovering vehicle."""
        self.least, self.trim, self.most = (parameters[f"FW_AIRSPD_{name}"] for name in ("MIN", "TRIM", "MAX"))
        self.least_over_ground = parameters["FW_GND_SPD_MIN"]
        self.wind = -parameters["SIH_WIND_N"], -parameters["SIH_WIND_E"]
        """Where the air moves to, north and east."""
        self.push = 0.0
        """The acceleration along the heading in the transitions of a VTOL, by its pusher and by drag."""
        self.is_flying_by_wings = False
        """Whether the last setpoint was a `Wing`."""
        self.nose = self.nose_rate = 0.0
        """How far a tailsitter leans forward, up to a quarter turn, and how fast."""
        self.is_overturned = False
        """Whether the vehicle lies on its back, and stays there."""
        self._lift: Vector = ZERO
        """The part of the acceleration that is not by `push`."""
        self.has_flown = False
        """Whether the aircraft has flown by its wings, which shows it the wind."""
        self._speed = 0.0
        self._setpoint = self.trim
        self._drift = (0.0, 0.0)
        """What gusts add to the wind."""

    @property
    def airspeed(self) -> float:
        """The speed through the air, along the heading."""
        if self.is_flying_by_wings:
            return self._speed
        north, east = self.velocity[0] - self.wind[0], self.velocity[1] - self.wind[1]
        return max(0.0, north * math.cos(self.yaw) + east * math.sin(self.yaw))

    @property
    def quaternion(self) -> Quaternion:
        """The rotation from body axes to NED: w, x, y, z."""
        found, half = super().quaternion, self.nose / 2
        return product(found, (math.cos(half), 0.0, -math.sin(half), 0.0)) if half else found

    @property
    def specific_force(self) -> Vector:
        """What an accelerometer measures, in body axes."""
        x, y, z = self.acceleration
        return to_body(self.quaternion, (x, y, z - GRAVITY))

    @property
    def thrust(self) -> float:
        """The acceleration that the motors would give a hovering vehicle: wings need less of it."""
        return _BY_WINGS * GRAVITY if self.is_flying_by_wings else super().thrust

    def step(self, seconds: float, target: Target | Push | Wing | None, climb: float = math.inf) -> None:
        """Move on by a short time. Without a setpoint the motors are off."""
        if self.is_overturned:
            self.roll, self.velocity, self.acceleration, self.rates = _ON_ITS_BACK, ZERO, ZERO, ZERO
            return
        self.nose = max(0.0, min(_QUARTER, self.nose + self.nose_rate * seconds))
        if isinstance(target, Wing):
            if not self.is_flying_by_wings:
                self._begin()
            self._fly(seconds, target)
            self._lift = self.acceleration
            return
        self.is_flying_by_wings = False
        self.acceleration = self._lift
        super().step(seconds, target, climb)
        self._lift = self.acceleration
        if self.push and not self.is_on_ground:
            self._push_forward(seconds)

    def _push_forward(self, seconds: float) -> None:
        x, y = self.push * math.cos(self.yaw), self.push * math.sin(self.yaw)
        (north, east, down), (a, b, c) = self.velocity, self.acceleration
        self.velocity, self.acceleration = (north + x * seconds, east + y * seconds, down), (a + x, b + y, c)

    def _begin(self) -> None:
        self._speed, self.is_flying_by_wings = self.airspeed, True
        self._setpoint, self._thrust = self._speed, None
        self._slip()

    def _slip(self) -> None:
        """Let what the velocity has besides airspeed and wind fade."""
        north, east, _ = self.velocity
        x, y = self._speed * math.cos(self.yaw), self._speed * math.sin(self.yaw)
        self._drift = north - x - self.wind[0], east - y - self.wind[1]

    def _fly(self, seconds: float, target: Wing) -> None:
        if self.is_on_ground and not self._roll_out(seconds, target):
            return
        self.has_flown = True
        self._gust(seconds)
        before = self.velocity
        self._accelerate(seconds, target)
        rate = self._turn_by_roll(seconds, target)
        down = self._climb(seconds, target)
        air_north, air_east = self._air
        level = math.sqrt(max(_LOWEST, self._speed * self._speed - down * down))
        north, east = level * math.cos(self.yaw) + air_north, level * math.sin(self.yaw) + air_east
        self.velocity = north, east, down
        self.acceleration = (north - before[0]) / seconds, (east - before[1]) / seconds, (down - before[2]) / seconds
        x, y, z = self.position
        self.position = x + north * seconds, y + east * seconds, z + down * seconds
        self._pose(seconds, down, rate)
        if self.position[2] >= self.ground and down >= 0.0:
            self._touch_down()

    @property
    def _air(self) -> tuple[float, float]:
        return self.wind[0] + self._drift[0], self.wind[1] + self._drift[1]

    def _gust(self, seconds: float) -> None:
        """Let gusts move the air. What they add fades."""
        if self.gust != (0.0, 0.0) or self._drift != (0.0, 0.0):
            fade = 1.0 - seconds / _DRIFT_TIME
            north, east = self._drift
            self._drift = north * fade + self.gust[0] * seconds, east * fade + self.gust[1] * seconds

    # On the ground

    def _roll_out(self, seconds: float, target: Wing) -> bool:
        """Move along the runway. Return whether the aircraft leaves it."""
        along = self.wind[0] * math.cos(self.yaw) + self.wind[1] * math.sin(self.yaw)
        speed = max(0.0, self._speed + along + (_RUNWAY if target.takes_off else -_BRAKES) * seconds)
        self._speed = speed - along
        if target.takes_off and self._speed >= self.least + _ROTATION:
            self.is_on_ground = False
            self._setpoint = self._speed
            self._slip()
            return True
        if not speed:
            self._rest(seconds)
            return False
        self._rests = 0
        self.roll = self.pitch = 0.0
        north, east = speed * math.cos(self.yaw), speed * math.sin(self.yaw)
        self.acceleration = (north - self.velocity[0]) / seconds, (east - self.velocity[1]) / seconds, 0.0
        self.velocity, self.rates = (north, east, 0.0), ZERO
        x, y, _ = self.position
        self.position = x + north * seconds, y + east * seconds, self.ground
        return False

    def _touch_down(self) -> None:
        self.is_on_ground = True
        self.position = (*self.position[:2], self.ground)
        self.velocity, self.acceleration = (*self.velocity[:2], 0.0), ZERO
        self.roll = self.pitch = 0.0

    # In the air

    def _accelerate(self, seconds: float, target: Wing) -> None:
        """Follow the airspeed. A turn needs more of it, and a limit of the throttle gives less."""
        least = min(self.most, self.least / math.sqrt(max(0.1, math.cos(self.roll))))
        if not isnan(target.throttle):
            wanted = self.least + (self.most - self.least) * target.throttle
        else:
            wanted = self.trim if isnan(target.airspeed) or target.airspeed <= 0 else target.airspeed
            wanted = max(wanted, self._least_on(target))
        change = _AIRSPEED_SLEW * seconds
        self._setpoint += max(-change, min(change, max(least, min(self.most, wanted)) - self._setpoint))
        self._speed += (self._setpoint - self._speed) * min(1.0, seconds / _AIRSPEED_TIME)

    def _least_on(self, target: Wing) -> float:
        """Return the airspeed with which the aircraft is not too slow over ground along its course."""
        if isnan(target.course) or not isnan(target.direction):
            return 0.0
        if self.wind == (0.0, 0.0):
            return self.least_over_ground
        (north, east), sine, cosine = self.wind, math.sin(target.course), math.cos(target.course)
        missing = self.least_over_ground - north * cosine - east * sine
        return math.hypot(missing, east * cosine - north * sine) if missing > 0.0 else 0.0

    def _turn_by_roll(self, seconds: float, target: Wing) -> float:
        """Roll and turn. Return the rate of the heading."""
        wanted = target.roll if not isnan(target.roll) else math.atan(self._lateral(target) / GRAVITY)
        step = (wanted - self.roll) * min(1.0, seconds / _ROLL_LAG)
        most = _ROLL_RATE * seconds
        self.roll += max(-most, min(most, step))
        rate = GRAVITY * math.tan(max(-_MAX_ROLL, min(_MAX_ROLL, self.roll))) / max(self._speed, 1.0)
        self.yaw += rate * seconds
        return rate

    def _lateral(self, target: Wing) -> float:
        """Return the lateral acceleration for a course, a direction, or a lateral acceleration."""
        direction = target.direction
        if isnan(direction) and not isnan(target.course):
            direction = self._heading_for(target.course)
        found = 0.0
        if not isnan(direction):
            error = wrapped(direction - self.yaw)
            sine = math.sin(error) if abs(error) < math.pi / 2 else math.copysign(1.0, error)
            found = _COURSE_GAIN * self._speed * sine
        if not isnan(target.lateral):
            found += target.lateral
        most = min(MAX_LATERAL, target.max_lateral)
        return max(-most, min(most, found))

    def _heading_for(self, course: float) -> float:
        """Return the heading that leads over ground along a course, as far as the wind allows it."""
        north, east = self._air
        across = east * math.cos(course) - north * math.sin(course)
        return course - math.asin(max(-1.0, min(1.0, across / max(self._speed, 1.0))))

    def _climb(self, seconds: float, target: Wing) -> float:
        """Return the velocity down."""
        down = self.velocity[2]
        if not isnan(target.pitch):
            wanted = self._speed * math.sin(target.pitch - _ANGLE_OF_ATTACK)
            wanted, lag = max(-MAX_SINK, min(MAX_CLIMB, wanted)), _PITCH_TIME
        elif not isnan(target.height_rate):
            wanted = max(-MAX_SINK, min(MAX_CLIMB, target.height_rate))
            lag = _PITCH_TIME if target.takes_off else _CLIMB_LAG
        elif not isnan(target.down):
            rate = (self.position[2] - target.down) / _ALTITUDE_TIME
            wanted, lag = max(-min(MAX_SINK, target.sink), min(MAX_CLIMB, target.climb, rate)), _CLIMB_LAG
        else:
            wanted, lag = 0.0, _CLIMB_LAG
        if isnan(target.pitch):
            wanted = self._limited(wanted, target)
        if target.throttle == 0.0:
            wanted = min(wanted, -SINK)
        return down + (-wanted - down) * min(1.0, seconds / lag)

    def _limited(self, climb: float, target: Wing) -> float:
        """Return a height rate within the limits of pitch and throttle. At trim throttle, the flight is level."""
        least = (
            -math.inf if target.pitch_min < -_QUARTER else self._speed * math.sin(target.pitch_min - _ANGLE_OF_ATTACK)
        )
        most = math.inf if target.pitch_max > _QUARTER else self._speed * math.sin(target.pitch_max - _ANGLE_OF_ATTACK)
        spare = target.throttle_max - _TRIM_THROTTLE
        power = MAX_CLIMB * spare / (1.0 - _TRIM_THROTTLE) if spare > 0.0 else SINK * spare / _TRIM_THROTTLE
        return min(power, most, max(least, climb))

    def _pose(self, seconds: float, down: float, rate: float) -> None:
        """Take the pitch angle of the climb, and the angular velocity of all."""
        climb = math.asin(max(-1.0, min(1.0, -down / max(self._speed, 1.0))))
        pitch = climb + _ANGLE_OF_ATTACK * min(1.0, self.trim / max(self._speed, 1.0))
        before, self.pitch = self.pitch, self.pitch + (pitch - self.pitch) * min(1.0, seconds / _PITCH_TIME)
        pitch_rate = (self.pitch - before) / seconds
        sin_roll, cos_roll, cos_pitch = math.sin(self.roll), math.cos(self.roll), math.cos(self.pitch)
        self.rates = (
            -rate * math.sin(self.pitch),
            pitch_rate * cos_roll + rate * cos_pitch * sin_roll,
            rate * cos_pitch * cos_roll - pitch_rate * sin_roll,
        )
