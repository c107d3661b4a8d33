"""The motion of a simulated rover: a speed and a turn, on flat ground.

Lengths are in m, speeds in m/s, angles in rad, clockwise from north. Limits have the defaults of PX4's simulated rover.
"""

from __future__ import annotations

import math
from math import isnan
from typing import NamedTuple

from msggen.sim.flight import GRAVITY, NAN, ZERO, Flight, Push, Target, wrapped
from msggen.sim.parameters import PARAMETERS

_WHEEL_BASE, _MAX_STEERING = PARAMETERS["RA_WHEEL_BASE"], PARAMETERS["RA_MAX_STR_ANG"]
_STEERING_RATE = math.radians(PARAMETERS["RA_STR_RATE_LIM"])
_MAX_RATE = math.radians(PARAMETERS["RO_YAW_RATE_LIM"])
_ACCELERATION = PARAMETERS["RO_ACCEL_LIM"]
_MAX_SPEED, _FULL_SPEED = PARAMETERS["RO_SPEED_LIM"], PARAMETERS["RO_MAX_THR_SPEED"]
_YAW_GAIN = PARAMETERS["RO_YAW_P"]
_LAG = 0.2
"""The time in s in which the speed and the yaw rate follow their setpoints."""
_STANDING = 0.01
"""The speed below which a rover that is to stand stands."""


class Drive(NamedTuple):
    """A setpoint of a rover. NaN stands for what nobody sets: the motors keep the last value, as in PX4."""

    speed: float = NAN
    throttle: float = NAN
    """From -1 to 1. The speed replaces it."""
    yaw: float = NAN
    yaw_rate: float = NAN
    """Clockwise. The yaw replaces it."""
    steering: float = NAN
    """From -1, left, to 1. The yaw and the yaw rate replace it."""


class Wheels(Flight):
    """The state of motion of a rover. It steers its front wheels, or `turns_in_place` by the speeds of its sides."""

    def __init__(self, *, turns_in_place: bool) -> None:
        super().__init__()
        self.speed = 0.0
        """Forwards."""
        self._turns_in_place = turns_in_place
        self._goal = self._rate = self._steering = self._aim = 0.0

    def step(self, seconds: float, target: Target | Push | Drive | None, _climb: float = math.inf) -> None:
        """Move on by a short time. Without a setpoint the motors are off, and the rover rolls to a stop."""
        if isinstance(target, Drive):
            self._drive(seconds, target)
        else:
            self._coast(seconds)
        if not self.speed and not self._rate:
            self.velocity = self.acceleration = self.rates = ZERO
            return
        before = self.velocity
        self.yaw += self._rate * seconds
        north, east = self.speed * math.cos(self.yaw), self.speed * math.sin(self.yaw)
        self.velocity, self.rates = (north, east, 0.0), (0.0, 0.0, self._rate)
        self.acceleration = (north - before[0]) / seconds, (east - before[1]) / seconds, 0.0
        x, y, _ = self.position
        self.position = x + north * seconds, y + east * seconds, self.ground

    @property
    def specific_force(self) -> tuple[float, float, float]:
        """What an accelerometer measures, in body axes."""
        x, y, _ = self.acceleration
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return x * cos + y * sin, y * cos - x * sin, -GRAVITY

    def _coast(self, seconds: float) -> None:
        self._goal = self._aim = self._rate = 0.0
        self.speed -= self.speed * min(1.0, 0.1 * seconds)
        if abs(self.speed) < _STANDING:
            self.speed = 0.0

    def _drive(self, seconds: float, target: Drive) -> None:
        if not isnan(target.speed):
            self._goal = max(-_MAX_SPEED, min(_MAX_SPEED, target.speed))
        elif not isnan(target.throttle):
            self._goal = max(-1.0, min(1.0, target.throttle)) * _FULL_SPEED
        most = _ACCELERATION * seconds
        self.speed += max(-most, min(most, (self._goal - self.speed) * min(1.0, seconds / _LAG)))
        if not self._goal and abs(self.speed) < _STANDING:
            self.speed = 0.0
        self._turn_wheels(seconds, target)

    def _turn_wheels(self, seconds: float, target: Drive) -> None:
        rate, steering = target.yaw_rate, target.steering
        steering = steering if isnan(steering) else max(-1.0, min(1.0, steering))
        if not isnan(target.yaw):
            rate = _YAW_GAIN * wrapped(target.yaw - self.yaw)
        rate = rate if isnan(rate) else max(-_MAX_RATE, min(_MAX_RATE, rate))
        if self._turns_in_place:
            wanted = steering * _MAX_RATE if isnan(rate) else rate
            self._aim = self._aim if isnan(wanted) else wanted
            self._rate += (self._aim - self._rate) * min(1.0, seconds / _LAG)
            if not self._aim and abs(self._rate) < _STANDING:
                self._rate = 0.0
            return
        if not isnan(rate):
            speed = self.speed if abs(self.speed) > _STANDING else math.copysign(_STANDING, self._goal)
            self._aim = math.atan(rate * _WHEEL_BASE / speed)
        elif not isnan(steering):
            self._aim = steering * _MAX_STEERING
        wanted = max(-_MAX_STEERING, min(_MAX_STEERING, self._aim))
        most = _STEERING_RATE * seconds
        self._steering += max(-most, min(most, wanted - self._steering))
        self._rate = self.speed * math.tan(self._steering) / _WHEEL_BASE
