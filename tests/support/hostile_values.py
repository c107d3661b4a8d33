"""Python values that a field may be given and should not be, as expressions, so that a case can be saved and repeated.

`random_expression` returns an expression, and `evaluated` its value.
"""

from __future__ import annotations

import decimal
import fractions
import math
from array import array
from collections import deque
from collections.abc import Iterator, Sequence
from random import Random
from typing import Any

import numpy as np


class Lying:
    """A sequence whose `__len__` is wrong."""

    def __init__(self, length: int, values: Any) -> None:
        self.length, self.values = length, values

    def __len__(self) -> int:
        return self.length

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    def __getitem__(self, index: Any) -> Any:
        return self.values[index]


class Tuple(tuple[Any, ...]):
    """A tuple whose length is wrong."""

    __slots__ = ()

    def __len__(self) -> int:
        return 3


class Text(str):
    """A string whose length and bytes are wrong."""

    __slots__ = ()

    def __len__(self) -> int:
        return 1

    def encode(self, *_: Any) -> bytes:
        return b"\0" * 5


class Octets(bytes):
    """Bytes whose length is wrong."""

    def __len__(self) -> int:
        return 2


class Index:
    """An integer by `__index__`."""

    def __init__(self, value: int) -> None:
        self.value = value

    def __index__(self) -> int:
        return self.value


class Float:
    """A number by `__float__`."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return self.value


class Failing:
    """A value whose conversions all fail."""

    def __init__(self, error: type[Exception]) -> None:
        self.error = error

    def _fail(self, *_: object) -> Any:
        raise self.error("no")

    __index__ = __float__ = __int__ = __len__ = __iter__ = __getitem__ = __bool__ = _fail


def endless(value: Any) -> Iterator[Any]:
    """Yield `value` a hundred million times."""
    return (value for _ in range(10**8))


SCALARS = (
    *("None", "True", "False", "...", "0", "1", "-1", "10**400", "-10**400", "0.5", "-0.0", "1e39", "1e400"),
    *("math.nan",),
    *("-math.inf", "1j", "'a'", "''", "'1'", "'\\ud800'", "'\\0'", "'x' * 70000", "b'a'", "b''", "bytearray(b'a')"),
    *("decimal.Decimal('0.1')", "decimal.Decimal('sNaN')", "fractions.Fraction(1, 3)", "object()", "int", "print"),
    *("Index(1)", "Index(2**64)", "Float(0.5)", "Failing(TypeError)", "Failing(ValueError)", "Failing(OverflowError)"),
    *("Text('abc')", "Octets(b'abcd')", "np.bool_(True)", "np.float64(0.5)", "np.datetime64(1, 's')", "np.str_('a')"),
    *("np.longdouble(1)", "np.array(1)", "np.array(0.5)", "np.array('a')", "np.array(None)"),
    *("np.array([1])", "np.void(b'ab')", "memoryview(b'a')", "float('1e308') * 10", "2.0**127 * 2", "16777217.0"),
)
INTEGERS = tuple(
    f"{sign}2**{bits}{change}"
    for sign in ("", "-")
    for bits in (7, 8, 15, 16, 31, 32, 63, 64)
    for change in ("", "-1", "+1")
)
NUMPY = (
    "b",
    "B",
    "h",
    "H",
    "i",
    "I",
    "q",
    "Q",
    "f",
    "d",
    "e",
    "?",
    "g",
    "F",
    "O",
    "S3",
    "U3",
    ">i4",
    ">f8",
    "M8[s]",
    "V4",
)
SEVERAL = (
    *("[{x}] * {n}", "({x},) * {n}", "{{{x}}}", "frozenset([{x}])", "{{{x}: {x}}}", "iter([{x}] * {n})"),
    *("deque([{x}] * {n})",),
    *("range({n})", "range(10**9)", "range(-10**18, 10**18)", "endless({x})", "(each for each in [{x}] * {n})"),
    *("Lying({n}, [{x}] * 3)", "Lying(10**9, [{x}] * {n})", "Lying(-1, [{x}] * {n})", "Lying({n}, endless({x}))"),
    *("Tuple([{x}] * {n})", "bytes({n})", "bytearray({n})", "memoryview(bytes({n}))"),
    *("memoryview(bytes(8 * {n})).cast('{a}')", "memoryview(bytes(2 * {n}))[::2]", "Octets(bytes({n}))"),
    *("'a' * {n}", "array('{a}', bytes(8 * {n}))", "array('{a}', range({n}))", "array('u', 'a' * {n})"),
    *("np.zeros({n}, '{d}')", "np.zeros(({n}, 2), '{d}')", "np.zeros((1, {n}), '{d}')"),
    *("np.zeros(2 * {n}, '{d}')[::2]",),
    *("np.zeros({n}, '{d}')[::-1]", "np.full({n}, {x})", "np.ma.masked_all({n})", "np.zeros({n}, 'i4,f4')"),
    *("[[{x}] * {n}]", "[{x}] * {n} + [None]", "[{x}, *range({n})]", "dict.fromkeys(range({n}), {x}).keys()"),
    *("dict.fromkeys(range({n}), {x})", "set(range({n}))", "map(float, range({n}))", "np.broadcast_to({x}, ({n},))"),
)


def random_expression(chance: Random, length: int | None, *, is_limited: bool = True) -> str:
    """Return the expression of a value for a field, which has `length` elements if that is not None.

    A field that is not limited may have so many elements that no value of many is wrong.
    """
    scalar = chance.choice((*SCALARS, *SCALARS, *INTEGERS, f"np.zeros((), '{chance.choice(NUMPY)}')[()]"))
    forms = SEVERAL if is_limited else [text for text in SEVERAL if "10**" not in text and "endless" not in text]
    if length is None or chance.random() < 0.1:
        return scalar if chance.random() < 0.95 else _several(chance, forms, scalar, 1)
    return _several(chance, forms, chance.choice((scalar, "0", "1", "0.5", "True", "'a'")), length)


def _several(chance: Random, forms: Sequence[str], scalar: str, length: int) -> str:
    count = max(0, length + chance.choice((0, 0, 0, 0, 1, -1, -length)))
    text = chance.choice(forms)
    return text.format(x=scalar, n=count, a=chance.choice("bBhHiIqQfd"), d=chance.choice(NUMPY))


_NAMES: dict[str, Any] = {cls.__name__: cls for cls in (Lying, Tuple, Text, Octets, Index, Float, Failing)}
_NAMES |= {"np": np, "math": math, "array": array, "deque": deque, "endless": endless}
_NAMES |= {"decimal": decimal, "fractions": fractions}


def evaluated(expression: str, **more: Any) -> Any:
    """Return the value of an expression of this module, or None if Python refuses to make it."""
    try:
        return eval(expression, {**_NAMES, **more})  # noqa: S307 - an expression of this module
    except (TypeError, ValueError, OverflowError):
        return None
