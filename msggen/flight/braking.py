"""How vehicles stay within limits: what they brake with, and the room that aircraft on wings need to turn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from msggen.flight.places import Vector

_GAIN = 0.5
"""The speed in m/s towards a limit that is 1 m away, low enough that a multicopter does not overshoot."""
_BRAKING = 2.0
"""The deceleration in m/s^2 that the vehicle is assumed to reach. PX4's limits are 3 and more by default."""
HORIZON = 0.5
"""The time in s within which an acceleration may bring the vehicle to the allowed speed."""
_ALONG = 0.01
"""The controlled share of a direction below which the speed along it counts as not controlled."""


def allowed(left: float) -> float:
    """Return the allowed speed in m/s towards a limit at a distance in m: 0 at the limit and beyond it."""
    return 0.0 if left <= 0.0 else min(_GAIN * left, math.sqrt(2.0 * _BRAKING * left))


def length(*values: float) -> float:
    """Return the length of the controlled part of a vector."""
    return math.hypot(*(each for each in values if not math.isnan(each)))


def _along(vector: Sequence[float], direction: Vector) -> float:
    """Return the component of the controlled part of a vector in a direction."""
    return sum(each * part for each, part in zip(vector, direction, strict=True) if not math.isnan(each))


def slowed_level(velocity: Vector, place: Vector, distance: float) -> Vector:
    """Return a velocity, reduced horizontally so that the vehicle can stop within the distance."""
    size = length(velocity.x, velocity.y)
    most = allowed(way_left(_direction(velocity), place, distance))
    if size <= most:
        return velocity
    return Vector(velocity.x * most / size, velocity.y * most / size, velocity.z)


def braked_level(acceleration: Vector, place: Vector, velocity: Vector, distance: float) -> Vector:
    """Return an acceleration, reduced towards where the vehicle flies, away from home, and in its own direction."""
    found = acceleration
    for direction in (_direction(velocity), _direction(place), _direction(acceleration)):
        most = allowed(way_left(direction, place, distance))
        found = cut(found, direction, (most - _along(velocity, direction)) / HORIZON)
    return found


def _direction(vector: Vector) -> Vector:
    """Return the horizontal direction of the controlled part of a vector."""
    x, y = (0.0 if math.isnan(each) else each for each in vector[:2])
    size = math.hypot(x, y)
    return Vector(x / size, y / size, 0.0) if size else Vector(0.0, 0.0, 0.0)


def way_left(direction: Vector, place: Vector, distance: float) -> float:
    """Return the distance to the circle around home in a direction. From outside: the part that leads nearer home."""
    along = direction.x * place.x + direction.y * place.y
    beyond = place.x * place.x + place.y * place.y - distance * distance
    if beyond >= 0.0:
        return max(0.0, -along)
    return math.sqrt(along * along - beyond) - along


def cut(vector: Sequence[float], direction: Vector, most: float) -> Vector:
    """Return a vector with at most a given component in a direction. Values that are not controlled stay NaN."""
    excess = _along(vector, direction) - most
    controlled = [0.0 if math.isnan(each) else part for each, part in zip(vector, direction, strict=True)]
    size = sum(each * each for each in controlled)
    if excess <= 0.0 or size < _ALONG * _ALONG:
        return Vector(*vector)
    x, y, z = (each - excess * part / size for each, part in zip(vector, controlled, strict=True))
    return Vector(x, y, z)


RADIUS: Final = 80.0
"""The radius in m of the circle that an aircraft on wings flies around a place: NAV_LOITER_RAD."""
_BANK = 9.81 * math.tan(math.radians(30))
"""The acceleration in m/s^2 in a turn with a bank of 30 degrees. FW_R_LIM is 50 degrees by default."""
_RUN_OUT = 1.0
"""The time in s that an aircraft on wings takes to bank before it turns."""
_SMALLEST = 0.01


def turn_radius(speed: float) -> float:
    """Return the radius in m of a turn at a speed in m/s with a bank of 30 degrees."""
    return speed * speed / _BANK


def leads_out(
    place: Sequence[float], velocity: Sequence[float], acceleration: Sequence[float], distance: float
) -> bool:
    """Whether an aircraft must turn back now to stay within a distance from home: later, its turn would leave it.

    The place is relative to home, and only north and east count.
    """
    motion = zip(place[:2], velocity[:2], acceleration[:2], strict=True)
    later = [(at + _RUN_OUT * (speed + _RUN_OUT / 2.0 * pull), speed + _RUN_OUT * pull) for at, speed, pull in motion]
    away, speed = (math.hypot(*each) for each in zip(*later, strict=True))
    outward = sum(at * going for at, going in later) / max(away * speed, _SMALLEST)
    turn = turn_radius(speed) * (1.0 - math.sqrt(1.0 - min(outward, 1.0) ** 2)) if outward > 0.0 else 0.0
    return away + turn > distance
