"""Values from JSON that somebody else wrote: of the expected type and in the expected range, or an error.

The files of sessions and flights are read with these functions, and what programs and owners of links tell each other.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

_Value = TypeVar("_Value")

SECONDS: Final = 1e12
"""The largest number of seconds that is taken for one, in either direction."""
TIME: Final = (1 << 63) - 1
"""The largest time in ns, or number of samples or bytes."""


class UnexpectedError(ValueError):
    """A value of another type, or out of range."""


def parsed(data: bytes) -> Any:
    """Return the value of JSON. Raises UnexpectedError for what is no JSON."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        raise UnexpectedError("no JSON") from None


def whole(value: object, least: int, most: int) -> int:
    """Return an integer from `least` to `most`. A bool is none. Raises UnexpectedError."""
    if type(value) is not int or not least <= value <= most:
        raise UnexpectedError(f"expected a whole number from {least} to {most}, got {shortened(value)}")
    return value


def real(value: object, *, may_be_nan: bool = False) -> float:
    """Return a finite number of at most SECONDS in either direction, or NaN if it may be. Raises UnexpectedError."""
    if type(value) in {int, float} and abs(value) <= SECONDS:  # type: ignore[arg-type]
        return float(value)  # type: ignore[arg-type]
    if may_be_nan and isinstance(value, float) and math.isnan(value):
        return value
    raise UnexpectedError(f"expected a number, got {shortened(value)}")


def truth(value: object) -> bool:
    """Return a bool. Raises UnexpectedError."""
    if not isinstance(value, bool):
        raise UnexpectedError(f"expected true or false, got {shortened(value)}")
    return value


def text(value: object, most: int = 4096) -> str:
    """Return a text of at most `most` characters that can be encoded. Raises UnexpectedError."""
    if not isinstance(value, str) or len(value) > most or not _can_be_encoded(value):
        raise UnexpectedError(f"expected a text of at most {most} characters, got {shortened(value)}")
    return value


def row(value: object, *parts: Callable[[Any], Any]) -> list[Any]:
    """Return the values of an array with a function for each, which checks it. Raises UnexpectedError."""
    if not isinstance(value, list) or len(value) != len(parts):
        raise UnexpectedError(f"expected {len(parts)} values, got {shortened(value)}")
    return [check(each) for check, each in zip(parts, value, strict=True)]


def several(value: object, part: Callable[[Any], _Value], most: int = 4096) -> list[_Value]:
    """Return the values of an array of at most `most`, each checked by a function. Raises UnexpectedError."""
    if not isinstance(value, list) or len(value) > most:
        raise UnexpectedError(f"expected an array of at most {most} values, got {shortened(value)}")
    return [part(each) for each in value]


def table(value: object, part: Callable[[Any], _Value], most: int = 4096) -> dict[str, _Value]:
    """Return an object of at most `most` values, each checked by a function. Raises UnexpectedError."""
    found = fields(value)
    if len(found) > most:
        raise UnexpectedError(f"expected an object of at most {most} values, got {len(found)}")
    return {text(name): part(each) for name, each in found.items()}


def fields(value: object) -> Mapping[str, Any]:
    """Return an object, whose values are not checked. Raises UnexpectedError."""
    if not isinstance(value, dict):
        raise UnexpectedError(f"expected an object, got {shortened(value)}")
    return value


def field(value: object, name: str) -> Any:
    """Return a value of an object, which is not checked. Raises UnexpectedError."""
    found = fields(value)
    if name not in found:
        raise UnexpectedError(f"'{name}' is missing")
    return found[name]


def shortened(value: object) -> str:
    """Return a value as a short text, for an error."""
    return f"{type(value).__name__}" if isinstance(value, (list, dict)) else f"{value!a:.40}"


def _can_be_encoded(value: str) -> bool:
    try:
        value.encode()
    except UnicodeEncodeError:  # a lone surrogate, which JSON can have
        return False
    return True
