"""Tests of the numbers that commands print."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis.strategies import integers

from msggen.cli.printing import number_of_bytes

UNITS = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9}


@given(integers(0, 10**13))
@example(999)
@example(1000)
@example(999_499)
@example(999_999_999)
def test_a_number_of_bytes_is_rounded_to_a_digit_and_short(count: int) -> None:
    number, unit = number_of_bytes(count).split()
    assert abs(float(number) * UNITS[unit] - count) <= 0.05001 * UNITS[unit] + count / 1000 * (number == "1.0")
    assert len(number) <= len("999.9") or unit == "GB"
    assert ("." in number) == (unit != "B")


@pytest.mark.parametrize(
    ("count", "text"),
    [(0, "0 B"), (72.4, "72 B"), (999.6, "1.0 kB"), (13_016, "13.0 kB"), (999_960, "1.0 MB"), (2.5e9, "2.5 GB")],
)
def test_the_units_are_those_of_si(count: float, text: str) -> None:
    assert number_of_bytes(count) == text
