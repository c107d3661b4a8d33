"""The motion of a simulated multicopter: a point mass whose attitude follows from its acceleration.

Setpoints of attitude and rates turn the vehicle instead, and the acceleration follows from its attitude and thrust.

Vectors are in NED, in m, m/s and m/s^2, with the origin on the ground below the start. Gains and limits have the
defaults of PX4's parameters, which msggen.sim.parameters lists.
"""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

from msggen.sim.attitude import (
    Quaternion,
    Vector,
    angles_of,
    down_axis,
    quaternion_of,
    rates_to,
    to_body,
    turned,
)
from msggen.sim.parameters import PARAMETERS
from msggen.sim.places import Home

NAN = math.nan
ZERO: Vector = (0.0, 0.0, 0.0)
FREE: Vector = (NAN, NAN, NAN)
"""A setpoint of which no component is controlled."""

GRAVITY = 9.80665

_POSITION_GAIN = PARAMETERS["MPC_XY_P"]
VELOCITY_GAIN = 2.0  # near MPC_XY_VEL_P_ACC and MPC_Z_VEL_P_ACC, without their integral parts
_LAG = 0.1
"""The time in s in which the acceleration follows its setpoint: that of motors and attitude together."""
_MAX_SPEED = PARAMETERS["MPC_XY_VEL_MAX"]
_MAX_CLIMB = PARAMETERS["MPC_Z_VEL_MAX_UP"]
_MAX_SINK = PARAMETERS["MPC_Z_VEL_MAX_DN"]
_MAX_ACCELERATION = PARAMETERS["MPC_ACC_HOR_MAX"]
_MAX_CLIMB_ACCELERATION = PARAMETERS["MPC_ACC_UP_MAX"]
_MAX_SINK_ACCELERATION = PARAMETERS["MPC_ACC_DOWN_MAX"]
_YAW_GAIN = PARAMETERS["MC_YAW_P"]
_MAX_YAW_RATE = 1.5
_ATTITUDE_GAIN = PARAMETERS["MC_ROLL_P"]
_MAX_RATE = math.radians(PARAMETERS["MC_ROLLRATE_MAX"])
_MAX_THRUST = 1 / PARAMETERS["MPC_THR_HOVER"]
DRAG = 1.0
"""The acceleration against a speed, in 1/s, where no controller holds the speed: that of PX4's simulator."""
_UPRIGHT = 0.5
"""The cosine of the lean, and the share of the thrust in hover, that position control begins with."""
_LIFT = 0.2
"""The upward acceleration in m/s^2 above which the vehicle leaves the ground. The same downwards presses it on it."""


class Target(NamedTuple):
    """A setpoint. NaN stands for a component that is not controlled, as in TrajectorySetpoint."""

    position: Vector = FREE
    velocity: Vector = FREE
    acceleration: Vector = FREE
    yaw: float = NAN
    yaw_rate: float = NAN
    speed: float = _MAX_SPEED
    """The limit of the horizontal speed."""
    climb: float = _MAX_CLIMB
    sink: float = _MAX_SINK
    turn: float = _MAX_YAW_RATE
    """The limit of the yaw rate."""


class Push(NamedTuple):
    """A setpoint of attitude or, without one, of rates in body axes. `thrust` is 1 in hover."""

    thrust: float
    attitude: Quaternion | None = None
    rates: Vector = ZERO
    forward: float = 0.0
    """The thrust of a fixed-wing aircraft, from 0 to 1."""


class Flight:
    """The state of motion, and the places that it refers to."""

    def __init__(self) -> None:
        self.position: Vector = ZERO
        self.velocity: Vector = ZERO
        self.acceleration: Vector = ZERO
        self.roll = self.pitch = 0.0
        self.yaw = 0.0
        """The heading in rad. It is not wrapped, so that the quaternion does not change its sign."""
        self.rates: Vector = ZERO
        """The angular velocity in rad/s, in body axes: forward, right, down."""
        self.is_on_ground = self.is_pressed = True
        """Whether the vehicle stands on the ground, and whether its setpoint asks it to go further down, or nowhere."""
        self.ground = 0.0
        """The down position of the ground."""
        self.home: Vector = ZERO
        """Where a return ends."""
        self.origin = Home()
        """The origin of positions: on the ground below the start, until a command sets another."""
        self.has_origin = True
        """Whether it is known where on earth that is."""
        self.has_position = True
        """Whether the vehicle knows its position."""
        self.gust = (0.0, 0.0)
        """The acceleration by wind, north and east, in m/s^2."""
        self._drag: Vector = ZERO
        """The part of the acceleration that is not thrust or gravity."""
        self._thrust: float | None = None
        """The acceleration by the motors under setpoints of attitude or rates."""
        self._rested = ZERO
        """Where the vehicle last came to rest."""
        self._rests = 0
        """How many steps before the last one it has stood there."""

    def step(self, seconds: float, target: Target | Push | None, climb: float = math.inf) -> None:
        """Move on by a short time. Without a target the motors are off. `climb` is the limit of a takeoff."""
        if isinstance(target, Push):
            self._push(seconds, target)
            return
        if self._thrust is not None:
            is_upright = down_axis(self.quaternion)[2] > _UPRIGHT and self._thrust > _UPRIGHT * GRAVITY
            if target is not None and not is_upright:
                self._push(seconds, Push(1.0, quaternion_of(0.0, 0.0, self.yaw)))
                return
            self._leave()
        wanted = (0.0, 0.0, GRAVITY) if target is None else self._wanted(target, climb)
        self.is_pressed = target is None or climb <= 0 or wanted[2] > _LIFT
        if self.is_on_ground and (self.is_pressed or wanted[2] > -_LIFT):
            self._rest(seconds)
            return
        self.is_on_ground = False
        share = 1.0 if target is None else min(1.0, seconds / _LAG)
        (x, y, z), (a, b, c) = self.acceleration, wanted
        self._move(seconds, x + (a - x) * share, y + (b - y) * share, z + (c - z) * share)
        if self._is_down():
            self._rest(seconds)
        else:
            self._turn(seconds, target)

    def _move(self, seconds: float, x: float, y: float, z: float) -> None:
        """Move with an acceleration."""
        (north, east, down), (vx, vy, vz) = self.position, self.velocity
        a, b = self.gust
        vx, vy, vz = vx + (x + a) * seconds, vy + (y + b) * seconds, vz + z * seconds
        self.acceleration, self.velocity = (x, y, z), (vx, vy, vz)
        self.position = (north + vx * seconds, east + vy * seconds, down + vz * seconds)

    def _is_down(self) -> bool:
        return self.position[2] >= self.ground and self.velocity[2] >= 0.0

    @property
    def quaternion(self) -> Quaternion:
        """The rotation from body axes to NED: w, x, y, z."""
        return quaternion_of(self.roll, self.pitch, self.yaw)

    @property
    def specific_force(self) -> Vector:
        """What an accelerometer measures, in body axes: (0, 0, -g) at rest. Thrust is along the z axis only."""
        x, y, z = self.acceleration
        if self._thrust is not None:
            return to_body(self.quaternion, (x, y, z - GRAVITY))
        return (0.0, 0.0, -self.thrust)

    @property
    def thrust(self) -> float:
        """The acceleration by the motors, in m/s^2."""
        if self._thrust is not None:
            return self._thrust
        x, y, z = self.acceleration
        return math.sqrt(x * x + y * y + (z - GRAVITY) ** 2)

    @property
    def heading(self) -> float:
        """The heading in rad, from -pi to pi."""
        return wrapped(self.yaw)

    def _rest(self, seconds: float) -> None:
        """Stand on the ground. What has stood there for two steps does not change any more."""
        self.is_on_ground = True
        stays = self.acceleration is ZERO and self.position is self._rested and self.position[2] == self.ground
        self._rests = self._rests + 1 if stays else 0
        if self._rests > 1:
            return
        if not stays:
            self.position = self._rested = (self.position[0], self.position[1], self.ground)
        self.velocity = self.acceleration = self._drag = ZERO
        self._turn(seconds, None)

    def _turn(self, seconds: float, target: Target | None) -> None:
        """Turn to the yaw of the target, and tilt so that the thrust gives the acceleration."""
        yaw_rate = _yaw_rate(target, self.yaw) if target else 0.0
        yaw = self.yaw + yaw_rate * seconds
        x, y, z = self.acceleration
        down = GRAVITY - z
        size = math.sqrt(x * x + y * y + down * down)
        roll, pitch = self.roll, self.pitch
        if size > 1.0:  # in free fall there is no thrust to give a direction
            sin_yaw, cos_yaw = math.sin(yaw), math.cos(yaw)
            forward = x * cos_yaw + y * sin_yaw
            right = y * cos_yaw - x * sin_yaw
            roll, pitch = math.asin(right / size), math.atan2(-forward, down)
        roll_rate, pitch_rate = (roll - self.roll) / seconds, (pitch - self.pitch) / seconds
        sin_roll, cos_roll, cos_pitch = math.sin(roll), math.cos(roll), math.cos(pitch)
        self.rates = (
            roll_rate - yaw_rate * math.sin(pitch),
            pitch_rate * cos_roll + yaw_rate * cos_pitch * sin_roll,
            yaw_rate * cos_pitch * cos_roll - pitch_rate * sin_roll,
        )
        self.roll, self.pitch, self.yaw = roll, pitch, yaw

    def _push(self, seconds: float, target: Push) -> None:
        """Turn as a setpoint of attitude or rates says, and let its thrust move the vehicle."""
        before = self.quaternion
        rates = target.rates if target.attitude is None else rates_to(before, target.attitude, _ATTITUDE_GAIN)
        roll, pitch, yaw = (max(-_MAX_RATE, min(_MAX_RATE, rate)) for rate in rates)
        after = turned(before, (roll, pitch, yaw), seconds)
        if self._thrust is None:
            self._thrust = 0.0 if self.is_on_ground else self.thrust
        goal = GRAVITY * max(0.0, min(_MAX_THRUST, target.thrust))
        self._thrust += (goal - self._thrust) * min(1.0, seconds / _LAG)
        x, y, z = (-self._thrust * axis for axis in down_axis(after))
        self.is_pressed = z + GRAVITY > _LIFT
        if self.is_on_ground and z + GRAVITY > -_LIFT:
            self._rest(seconds)
            return
        self.is_on_ground = False
        self.rates = roll, pitch, yaw
        self.roll, self.pitch, self.yaw = angles_of(after, self.yaw)
        self._drag = a, b, c = -DRAG * self.velocity[0], -DRAG * self.velocity[1], -DRAG * self.velocity[2]
        self._move(seconds, x + a, y + b, z + c + GRAVITY)
        if self._is_down():
            self._rest(seconds)

    def _leave(self) -> None:
        """Let the acceleration be that of the thrust, from which the attitude follows again."""
        x, y, z = self.acceleration
        a, b, c = self._drag
        self.acceleration = x - a, y - b, z - c
        self._thrust, self._drag = None, ZERO

    def _wanted(self, target: Target, climb: float) -> Vector:
        """Return the acceleration that leads to the target, within the limits."""
        (north, east, down), (x, y, z), (a, b, c) = self.position, target.position, target.velocity
        x, y = _limited(_speed(x - north, a), _speed(y - east, b), target.speed)
        z = _speed(z - down, c)
        z = max(-min(target.climb, climb), min(target.sink, z)) if not isnan(z) else z
        (vx, vy, vz), (a, b, c) = self.velocity, target.acceleration
        x, y = _limited(_pull(x, a, vx), _pull(y, b, vy), _MAX_ACCELERATION)
        return x, y, max(-_MAX_CLIMB_ACCELERATION, min(_MAX_SINK_ACCELERATION, _pull(z, c, vz)))


def wrapped(angle: float) -> float:
    """Return an angle in rad as one from -pi to pi."""
    return math.remainder(angle, math.tau)


def _speed(error: float, feed: float) -> float:
    """Return the speed for a distance to go, or NaN if neither position nor velocity is controlled."""
    if not isnan(feed):
        return feed if isnan(error) else _POSITION_GAIN * error + feed
    distance = abs(error)
    speed = min(_POSITION_GAIN * distance, math.sqrt(_MAX_SINK_ACCELERATION * distance))  # so that braking suffices
    return math.copysign(speed, error)


def _pull(speed: float, feed: float, here: float) -> float:
    """Return the acceleration for a speed. What is not controlled at all comes to rest."""
    if isnan(speed):
        return -VELOCITY_GAIN * here if isnan(feed) else feed
    return VELOCITY_GAIN * (speed - here) + (0.0 if isnan(feed) else feed)


def _limited(x: float, y: float, most: float) -> tuple[float, float]:
    """Return a horizontal vector of limited length. A component that is not controlled is NaN, and stays so."""
    size = math.hypot(x, y)
    if isnan(size):
        size = math.hypot(0.0 if isnan(x) else x, 0.0 if isnan(y) else y)
    return (x * most / size, y * most / size) if size > most else (x, y)


def _yaw_rate(target: Target, yaw: float) -> float:
    rate = 0.0 if isnan(target.yaw_rate) else target.yaw_rate
    if not isnan(target.yaw):
        rate += _YAW_GAIN * wrapped(target.yaw - yaw)
    return max(-target.turn, min(target.turn, rate))
