"""Tests of positions on earth, against the definition of the projection and against great circles."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msggen.messages import earth
from support.examples import examples

latitudes = st.floats(-89.0, 89.0)
longitudes = st.floats(-180.0, 180.0)
places = st.tuples(latitudes, longitudes)
metres = st.floats(-50_000.0, 50_000.0)


def defined(origin: tuple[float, float], latitude: float, longitude: float) -> tuple[float, float]:
    """Return what the azimuthal equidistant projection is defined as: the angle from the origin by its cosine."""
    here, there, turn = math.radians(origin[0]), math.radians(latitude), math.radians(longitude - origin[1])
    cosine = math.sin(here) * math.sin(there) + math.cos(here) * math.cos(there) * math.cos(turn)
    angle = math.acos(max(-1.0, min(1.0, cosine)))
    scale = earth.RADIUS * (angle / math.sin(angle) if angle > 1e-9 else 1.0)
    north = math.cos(here) * math.sin(there) - math.sin(here) * math.cos(there) * math.cos(turn)
    return scale * north, scale * math.cos(there) * math.sin(turn)


@settings(max_examples=examples(300))
@given(places, metres, metres)
def test_a_position_is_that_of_the_projection(origin: tuple[float, float], north: float, east: float) -> None:
    place = earth.placed(origin, north, east)
    assert -90.0 <= place[0] <= 90.0
    assert -180.0 <= place[1] <= 180.0
    assert earth.local(origin, *place) == pytest.approx((north, east), abs=1e-4)
    # the cosine of a small angle has few digits
    assert defined(origin, *place) == pytest.approx((north, east), abs=0.2, rel=1e-3)


@settings(max_examples=examples(300))
@given(places, places)
def test_the_distance_is_that_of_the_great_circle(origin: tuple[float, float], place: tuple[float, float]) -> None:
    def unit(latitude: float, longitude: float) -> tuple[float, float, float]:
        turn, rise = math.radians(longitude), math.radians(latitude)
        return math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn), math.sin(rise)

    chord = math.dist(unit(*origin), unit(*place))
    expected = 2.0 * earth.RADIUS * math.asin(min(1.0, chord / 2.0))
    assert math.hypot(*earth.local(origin, *place)) == pytest.approx(expected, abs=1.0, rel=1e-6)


def test_a_minute_of_latitude_is_a_nautical_mile() -> None:
    assert earth.local((47.0, 8.0), 47.0 + 1 / 60, 8.0) == pytest.approx((1853.2, 0.0), abs=0.1)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("index", range(4))
def test_what_is_not_finite_gives_nothing(bad: float, index: int) -> None:
    values = [47.0, 8.0, 47.1, 8.1]
    values[index] = bad
    assert all(map(math.isnan, earth.local((values[0], values[1]), values[2], values[3])))


@settings(max_examples=examples(300))
@example(15.0, 0.0, 165.0, 180.0)  # over the pole
@given(*[st.floats(allow_nan=False, allow_infinity=False)] * 4)
def test_numbers_that_are_no_place_have_a_position_on_earth(a: float, b: float, c: float, d: float) -> None:
    """Estimates of a vehicle can have any number."""
    assert math.hypot(*earth.local((a, b), c, d)) <= math.pi * earth.RADIUS + 1.0
