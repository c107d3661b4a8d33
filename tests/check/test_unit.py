"""Tests that different spellings of a unit or range mean the same."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.definitions.unit import normalized_range, normalized_unit

SAME_UNITS = [
    [
        "m/s^2",
        "m/s2",
        "m s^-2",
        "m s-2",
        "m.s^-2",
        "m/s/s",
        "m*s**-2",
        "m·s⁻²",
        "m/s²",
        "m / s^2",
        "m/(s*s)",
        "m/s^(2)",
    ],
    ["rad/s", "rad s^-1", "rad.s^-1", "s^-1 rad", "radians/second"],
    ["°C", "degC", "deg C", "deg_C", "° C", "℃", "celsius", "celcius", "degrees Celsius"],
    ["deg", "°", "degrees"],
    ["(m/s)^2", "m^2/s^2", "m²/s²"],
    ["(m/s^2)^2", "m^2/s^4"],
    ["-", "1", "norm", "normalized", "m/m"],
    ["us", "µs", "μs", "microseconds"],
    ["min", "minutes"],
    ["bool", "boolean"],
    ["Gauss", "gauss", "G"],
    ["1e-7 deg", "1e-7deg"],
    ["more or less", "more  or less"],
    ["(m", " (m"],
    ["m)", "m) "],
    [""],
]


@pytest.mark.parametrize("spellings", SAME_UNITS, ids=lambda spellings: spellings[0])
def test_a_unit_has_one_spelling_and_no_other_unit_has_it(spellings: list[str]) -> None:
    [spelling] = {normalized_unit(text) for text in spellings}
    others = {normalized_unit(text) for others in SAME_UNITS if others is not spellings for text in others}
    assert spelling not in others


@pytest.mark.parametrize(
    "pair", ["m m/s", "rad deg", "mW MW", "m cm", "V mV", "rad/s rad/s^2", "K degC", "us s", "s^-1 s"]
)
def test_other_units_stay_apart(pair: str) -> None:
    one, other = pair.split()
    assert normalized_unit(one) != normalized_unit(other)


SAME_RANGES = [
    ["0,1", "0, 1", "0.0, 1.0", "0 - 1", "0..1", "0 to 1", "0-1", "0 \u2013 1"],
    ["-1, 1", "-1 (Left), 1 (Right)", "-1..1", "-1.0 - 1", "-1 to +1"],
    ["-5, -1", "-5 - -1", "-5 to -1"],
    ["0, inf", "0, INF", "0, +inf", "0 - Infinity"],
    ["-inf, inf", "-inf (Backwards), inf (Forwards)"],
    ["-pi, pi", "-PI,PI", "-π, π"],
    ["1,", "1, "],
    ["0, 2 * pi", "0, 2*pi"],
    ["any", "Any"],
    [""],
]


@pytest.mark.parametrize("spellings", SAME_RANGES, ids=lambda spellings: spellings[0])
def test_a_range_has_one_spelling_and_no_other_range_has_it(spellings: list[str]) -> None:
    [spelling] = {normalized_range(text) for text in spellings}
    others = {normalized_range(text) for others in SAME_RANGES if others is not spellings for text in others}
    assert spelling not in others


@pytest.mark.slow
@given(st.text(max_size=40) | st.text(alphabet="ms^2-/()*. °0", max_size=40))
def test_any_text_has_a_spelling_that_stays(text: str) -> None:
    for normalized in (normalized_unit, normalized_range):
        assert normalized(normalized(text)) == normalized(text)
