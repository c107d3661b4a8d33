"""The motion of a simulated multicopter: a point mass whose attitude follows from its acceleration.

Vectors are in NED, in m, m/s and m/s^2, with the origin on the ground below the start. Gains and limits have the
defaults of PX4's parameters, which msggen.live.sim.parameters lists.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from msggen.live.sim.parameters import PARAMETERS

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

NAN = math.nan
ZERO: Vector = (0.0, 0.0, 0.0)
FREE: Vector = (NAN, NAN, NAN)
"""A setpoint of which no component is controlled."""

GRAVITY = 9.80665

_POSITION_GAIN = PARAMETERS["MPC_XY_P"]
_VELOCITY_GAIN = 2.0  # near MPC_XY_VEL_P_ACC and MPC_Z_VEL_P_ACC, without their integral parts
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
_LIFT = 0.2
"""The upward acceleration in m/s^2 above which the vehicle leaves the ground."""


class Target(NamedTuple):
    """A setpoint. NaN stands for a component that is not controlled, as in TrajectorySetpoint."""

    position: Vector = FREE
    velocity: Vector = FREE
    acceleration: Vector = FREE
    yaw: float = NAN
    yaw_rate: float = NAN


class Flight:
    """The state of motion."""

    def __init__(self) -> None:
        self.position: Vector = ZERO
        self.velocity: Vector = ZERO
        self.acceleration: Vector = ZERO
        self.roll = self.pitch = 0.0
        self.yaw = 0.0
        """The heading in rad. It is not wrapped, so that the quaternion does not change its sign."""
        self.rates: Vector = ZERO
        """The angular velocity in rad/s, in body axes: forward, right, down."""
        self.is_on_ground = True

    def step(self, seconds: float, target: Target | None) -> None:
        """Move on by a short time. Without a target the motors are off."""
        wanted = (0.0, 0.0, GRAVITY) if target is None else self._wanted(target)
        if self.is_on_ground and (target is None or wanted[2] > -_LIFT):
            self._rest(seconds)
            return
        self.is_on_ground = False
        share = 1.0 if target is None else min(1.0, seconds / _LAG)
        acceleration = [now + (goal - now) * share for now, goal in zip(self.acceleration, wanted, strict=True)]
        velocity = [v + a * seconds for v, a in zip(self.velocity, acceleration, strict=True)]
        position = [p + v * seconds for p, v in zip(self.position, velocity, strict=True)]
        self.acceleration = (acceleration[0], acceleration[1], acceleration[2])
        self.velocity = (velocity[0], velocity[1], velocity[2])
        self.position = (position[0], position[1], position[2])
        if position[2] >= 0.0 and velocity[2] >= 0.0:
            self.position = (position[0], position[1], 0.0)
            self._rest(seconds)
        else:
            self._turn(seconds, target)

    @property
    def quaternion(self) -> Quaternion:
        """The rotation from body axes to NED: w, x, y, z."""
        cr, sr = math.cos(self.roll / 2), math.sin(self.roll / 2)
        cp, sp = math.cos(self.pitch / 2), math.sin(self.pitch / 2)
        cy, sy = math.cos(self.yaw / 2), math.sin(self.yaw / 2)
        return (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )

    @property
    def specific_force(self) -> Vector:
        """What an accelerometer measures, in body axes: (0, 0, -g) at rest. Thrust is along the z axis only."""
        x, y, z = self.acceleration
        return (0.0, 0.0, -math.sqrt(x * x + y * y + (z - GRAVITY) ** 2))

    @property
    def heading(self) -> float:
        """The heading in rad, from -pi to pi."""
        return wrapped(self.yaw)

    def _rest(self, seconds: float) -> None:
        self.is_on_ground = True
        self.velocity = self.acceleration = ZERO
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
            forward = x * math.cos(yaw) + y * math.sin(yaw)
            right = y * math.cos(yaw) - x * math.sin(yaw)
            roll, pitch = math.asin(right / size), math.atan2(-forward, down)
        roll_rate, pitch_rate = (roll - self.roll) / seconds, (pitch - self.pitch) / seconds
        sin_roll, cos_roll, cos_pitch = math.sin(roll), math.cos(roll), math.cos(pitch)
        self.rates = (
            roll_rate - yaw_rate * math.sin(pitch),
            pitch_rate * cos_roll + yaw_rate * cos_pitch * sin_roll,
            yaw_rate * cos_pitch * cos_roll - pitch_rate * sin_roll,
        )
        self.roll, self.pitch, self.yaw = roll, pitch, yaw

    def _wanted(self, target: Target) -> Vector:
        """Return the acceleration that leads to the target, within the limits."""
        found = zip(target.position, target.velocity, self.position, strict=True)
        x, y, z = [_speed(goal - here, speed) for goal, speed, here in found]
        x, y = _limited(x, y, _MAX_SPEED)
        z = max(-_MAX_CLIMB, min(_MAX_SINK, z)) if not math.isnan(z) else z
        speeds = zip((x, y, z), target.acceleration, self.velocity, strict=True)
        x, y, z = [_pull(speed, feed, here) for speed, feed, here in speeds]
        x, y = _limited(x, y, _MAX_ACCELERATION)
        return x, y, max(-_MAX_CLIMB_ACCELERATION, min(_MAX_SINK_ACCELERATION, z))


def wrapped(angle: float) -> float:
    """Return an angle in rad as one from -pi to pi."""
    return math.remainder(angle, math.tau)


def _speed(error: float, feed: float) -> float:
    """Return the speed for a distance to go, or NaN if neither position nor velocity is controlled."""
    if math.isnan(error):
        return feed
    distance = abs(error)
    speed = min(_POSITION_GAIN * distance, math.sqrt(_MAX_SINK_ACCELERATION * distance))  # so that braking suffices
    return math.copysign(speed, error) + (0.0 if math.isnan(feed) else feed)


def _pull(speed: float, feed: float, here: float) -> float:
    """Return the acceleration for a speed. What is not controlled at all comes to rest."""
    if math.isnan(speed):
        return -_VELOCITY_GAIN * here if math.isnan(feed) else feed
    return _VELOCITY_GAIN * (speed - here) + (0.0 if math.isnan(feed) else feed)


def _limited(x: float, y: float, most: float) -> tuple[float, float]:
    """Return a horizontal vector of limited length. A component that is not controlled is NaN, and stays so."""
    size = math.hypot(*(each for each in (x, y) if not math.isnan(each)))
    return (x * most / size, y * most / size) if size > most else (x, y)


def _yaw_rate(target: Target, yaw: float) -> float:
    rate = 0.0 if math.isnan(target.yaw_rate) else target.yaw_rate
    if not math.isnan(target.yaw):
        rate += _YAW_GAIN * wrapped(target.yaw - yaw)
    return max(-_MAX_YAW_RATE, min(_MAX_YAW_RATE, rate))
