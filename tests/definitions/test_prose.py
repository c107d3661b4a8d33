"""Tests of the reader of units in sentences: it returns a unit only if there is no doubt."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.definitions.parse.prose import unit_in
from msggen.definitions.unit import SPELLINGS, known_unit, normalized_unit

READ = {
    "Wheel speed in m/s": "m/s",
    "Wheel speed in meters per second, positive forward": "m/s",
    "In volts. 0 while the pack is off": "V",
    "Lever arm (metres)": "m",
    "(microseconds) Age of the sample": "us",
    "Age of the sample (microseconds, UTC)": "us",
    "Slope[rad]": "rad",
    "Slope (rad, [-pi, pi])": "rad",
    "Pack voltage [V], if measured": "V",
    "Rate in radians/second^2": "rad/s^2",
    "Variance of the depth (m^2)": "m^2",
    "Depth in m s^-1": "m/s",
    "Case temperature in degrees Celsius": "°C",
    "Tank level in %, 0 is empty": "%",
    "Longitude in 1E-7 degrees": "1e-7 deg",
    "Depth in m, NaN in air (m)": "m",
    "Time in s since the last refill": "s",
    "Distance of the LED(s) in mm": "mm",
}

UNREAD = [
    "",
    "Wheel speed",
    "Length of the arm, 5 m at most",
    "Depth in m, or in cm if the sonar says so",
    "Depth (m) and speed (m/s)",
    "Depth and speed (m, m/s)",
    "Variance of the speed ((m/s)**2)",
    "Variance of the speed (m/s)^2",
    "Longitude in degrees * 1e7",
    "Longitude (deg * 1e7)",
    "Depth in cm, scaled by 100",
    "Depth in tenths of meters",
    "Depth in 0.1 m",
    "Slope in degrees of freedom",
    "Slope in dB per octave",
    "Speed in meters per second squared",
    "Also the progress in %",
    "Not in m, not in cm, not in ft",
    "LED(s) to light",
    "Share of the north (N)",
    "Smallest value (min)",
    "Shifts in second gear",
    "Flag (boolean)",
    "In NED, as in the frame of the body",
    "Depth [m/s^",
    "m/s",
    "Depth in " + "very " * 1000 + "m (m)",
]


@pytest.mark.parametrize("text", READ)
def test_a_unit_without_doubt_is_read(text: str) -> None:
    assert unit_in(text) == READ[text]


@pytest.mark.parametrize("text", UNREAD)
def test_doubt_gives_no_unit(text: str) -> None:
    assert unit_in(text) == ""


PIECES = [*sorted(SPELLINGS), "in ", "In ", "(", ")", "[", "]", " ", ", ", "/", "^2", "1e-7 ", "per ", "the ", "5"]


@pytest.mark.slow
@given(st.text(max_size=60) | st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
def test_a_unit_is_one_that_is_known(text: str) -> None:
    unit = unit_in(text)
    if unit:
        assert known_unit(unit) == unit
        assert normalized_unit(unit) not in ("", "1", "bool")


@given(st.lists(st.sampled_from(["the", "of", "a", "wheel", "and", "NED", "5", "in"]), max_size=12).map(" ".join))
def test_text_without_a_unit_gives_none(text: str) -> None:
    assert unit_in(text) == ""


@given(st.sampled_from(sorted(SPELLINGS)), st.sampled_from(sorted(SPELLINGS)))
def test_two_units_are_doubt(first: str, second: str) -> None:
    if known_unit(first) != known_unit(second):
        assert unit_in(f"Height, in square brackets [{first}, wide] and [{second}, high], in m (s)") == ""


@pytest.mark.parametrize("piece", ["in ", "(", "((m)", "[m", "in m/", "in m per ", "in 1e-7 ", "(m)(s)", "(m,"])
def test_the_time_is_linear(piece: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each "in" and each bracket reads a few characters behind it. Long texts are not read at all."""
    read = 0

    def counted(text: str) -> str:
        nonlocal read
        read += len(text)
        return known_unit(text)

    monkeypatch.setattr("msggen.definitions.parse.prose.known_unit", counted)
    short = piece * (1900 // len(piece))
    unit_in(short)
    assert read <= 4 * 40 * len(short)
    read = 0
    assert unit_in(piece * 1_000_000) == ""
    assert read == 0
