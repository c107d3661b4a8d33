"""What the values of a mission file have to be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from msggen.flight.missions.plan import CHANGE, HEADING_RATE, RESET, SETTINGS

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
POSITIVE: Final = Expected("a number above 0", lambda value: NOT_NEGATIVE.holds(value) and value > 0.0)
LATITUDE: Final = Expected("a latitude from -90 to 90", _number(-90.0, 90.0))
LONGITUDE: Final = Expected("a longitude from -180 to 180", _number(-180.0, 180.0))
TRUTH: Final = Expected("true or false", lambda value: isinstance(value, bool))
TEXT: Final = Expected("a text", lambda value: isinstance(value, str))
OBJECT: Final = Expected("an object", lambda value: isinstance(value, dict))
ARRAY: Final = Expected("an array", lambda value: isinstance(value, list))

LIMITS: Final[Mapping[str, Expected]] = MappingProxyType(
    {name: NOT_NEGATIVE if name == HEADING_RATE else POSITIVE for name in SETTINGS}
)
"""The limits of a flight. At a speed of 0, PX4 does not move, and would never arrive; without turning, it does."""
ARGUMENTS: Final[Mapping[str, Mapping[str, Expected]]] = MappingProxyType(
    {
        "takeoff": {"altitude": NUMBER},
        "land": {},
        "rtl": {},
        "hold": {"duration": NOT_NEGATIVE},
        CHANGE: {**LIMITS, RESET: TRUTH},
    }
)
"""The actions that every mission has, and the arguments that each takes."""
