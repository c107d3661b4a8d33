"""What the values of a mission file have to be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from msggen.flight.missions import plan
from msggen.messages.ranges import AIRSPEED, HEIGHT_RATE, SPEED, TURN_RATE, Bound

_LARGEST = 3.4e38
"""What a float32 holds."""


class Expected(NamedTuple):
    """What a value has to be, for people, and whether one is that."""

    text: str
    holds: Callable[[Any], bool]


def _number(least: float, most: float) -> Callable[[Any], bool]:
    return lambda value: type(value) in {int, float} and least <= value <= most


NUMBER: Final = Expected("a number", _number(-_LARGEST, _LARGEST))
NOT_NEGATIVE: Final = Expected("a number of at least 0", _number(0.0, _LARGEST))
LATITUDE: Final = Expected("a latitude from -90 to 90", _number(-90.0, 90.0))
LONGITUDE: Final = Expected("a longitude from -180 to 180", _number(-180.0, 180.0))
TRUTH: Final = Expected("true or false", lambda value: isinstance(value, bool))
TEXT: Final = Expected("a text", lambda value: isinstance(value, str))
OBJECT: Final = Expected("an object", lambda value: isinstance(value, dict))
ARRAY: Final = Expected("an array", lambda value: isinstance(value, list))


def _limit(unit: str, *bounds: Bound, is_above_0: bool = True) -> Expected:
    """Return what a limit of the flight has to be: no more than any vehicle has by the parameters of PX4."""
    most = max(each.extreme for each in bounds)
    is_within = _number(0.0, most)
    if not is_above_0:
        return Expected(f"a number from 0 to {most:g} {unit}", is_within)
    return Expected(f"a number above 0, and {most:g} {unit} at most", lambda value: is_within(value) and value > 0.0)


_LIMITS = (
    _limit("m/s", AIRSPEED.most, SPEED.most),
    _limit("m/s", HEIGHT_RATE.least, HEIGHT_RATE.most),
    _limit("degrees/s", TURN_RATE.most, is_above_0=False),
)
LIMITS: Final[Mapping[str, Expected]] = MappingProxyType(dict(zip(plan.SETTINGS, _LIMITS, strict=True)))
"""The limits of a flight. At a speed of 0, PX4 does not move, and would never arrive; without turning, it does."""
ARGUMENTS: Final[Mapping[str, Mapping[str, Expected]]] = MappingProxyType(
    {
        "takeoff": {"altitude": NUMBER},
        "land": {},
        "rtl": {},
        "hold": {"duration": NOT_NEGATIVE},
        plan.CHANGE: {**LIMITS, plan.RESET: TRUTH},
    }
)
"""The actions that every mission has, and the arguments that each takes."""
