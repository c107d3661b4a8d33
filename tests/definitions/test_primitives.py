"""Tests that the table of primitive types agrees with `struct`."""

from __future__ import annotations

import math
import struct

import pytest

from msggen.definitions.primitives import FLOATS, INTEGERS, OCTETS, PRIMITIVES, STRINGS


@pytest.mark.parametrize("name", [name for name in PRIMITIVES if name not in STRINGS])
def test_the_size_is_that_of_the_code(name: str) -> None:
    assert struct.calcsize(f"<{PRIMITIVES[name].code}") == PRIMITIVES[name].size


@pytest.mark.parametrize("name", INTEGERS)
def test_the_code_takes_the_range_and_no_more(name: str) -> None:
    code, (low, high) = f"<{PRIMITIVES[name].code}", PRIMITIVES[name].integer_range
    assert [struct.unpack(code, struct.pack(code, value))[0] for value in (low, high)] == [low, high]
    for value in (low - 1, high + 1):
        with pytest.raises(struct.error):
            struct.pack(code, value)


def test_the_largest_floats_are_the_last_that_do_not_overflow() -> None:
    largest = PRIMITIVES["float32"].largest
    assert math.isfinite(struct.unpack("<f", struct.pack("<f", largest))[0])
    with pytest.raises(OverflowError):
        struct.pack("<f", math.nextafter(largest, math.inf))
    assert math.nextafter(PRIMITIVES["float64"].largest, math.inf) == math.inf
    assert all(PRIMITIVES[name].smallest == -PRIMITIVES[name].largest for name in FLOATS)


@pytest.mark.parametrize("name", PRIMITIVES)
def test_zero_is_a_value_of_the_python_type(name: str) -> None:
    zeros = {"False": False, "0": 0, "0.0": 0.0, '""': ""}
    assert type(zeros[PRIMITIVES[name].zero]).__name__ == PRIMITIVES[name].python_type


def test_every_type_is_of_one_kind() -> None:
    assert sorted(["bool", *INTEGERS, *FLOATS, *STRINGS]) == sorted(PRIMITIVES)
    assert OCTETS == ("byte", "char", "uint8")
    assert all(PRIMITIVES[name].code == "" for name in STRINGS)
