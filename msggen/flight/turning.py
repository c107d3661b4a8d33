"""How aircraft on wings turn: they cannot stop, and need room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

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
