"""What the values of a mission file have to be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from msggen.base.checked import shortened

_LARGEST = 3.4e38
"""What a float32 holds."""


class Expected(NamedTuple):
    """What a value has to be, for people, and whether one is that."""

    text: str
    holds: Callable[[Any], bool]

    def wrong(self, value: object) -> str:
        """Return what is wrong with a value without positions, or ""."""
        return "" if self.holds(value) else f"expected {self.text}, got {shortened(value)}"


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
