"""Tests of how long samples from the network have waited, as the clocks of two computers tell."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.rmw_zenoh.waiting import Waiting

SECOND = 10**9
NOW = 10**18
GID, OTHER = bytes(16), bytes(15) + b"\1"


def test_with_the_same_clock_it_is_the_time_since_then() -> None:
    waiting = Waiting()
    assert waiting.of(GID, NOW - SECOND, NOW) == SECOND
    assert waiting.of(GID, NOW, NOW + 5) == 5


def test_a_clock_that_is_behind_makes_samples_look_late() -> None:
    assert Waiting().of(GID, NOW - 3 * SECOND, NOW) == 3 * SECOND


def test_a_clock_that_is_ahead_does_not_hide_that_samples_are_late() -> None:
    waiting = Waiting()
    assert waiting.of(GID, NOW + 100 * SECOND, NOW) == 0
    assert waiting.of(GID, NOW + 100 * SECOND, NOW + SECOND) == SECOND
    assert waiting.of(OTHER, NOW + 100 * SECOND, NOW + SECOND) == 0  # of another computer


def test_a_clock_that_was_set_back_is_known_after_a_minute() -> None:
    waiting = Waiting()
    waiting.of(GID, NOW + 100 * SECOND, NOW)
    waited = [waiting.of(GID, NOW + second * SECOND, NOW + second * SECOND) for second in range(1, 70)]
    assert waited[0] == 100 * SECOND
    assert waited[-1] == 0


@pytest.mark.parametrize("number", [5000])
def test_the_publishers_that_are_remembered_are_few(number: int) -> None:
    waiting = Waiting()
    for each in range(number):
        waiting.of(each.to_bytes(16, "big"), NOW, NOW)
    assert len(waiting._ways) <= 1000


@given(st.lists(st.tuples(st.integers(0, 2**63 - 1), st.integers(0, 60 * SECOND)), min_size=1, max_size=20))
def test_no_time_is_negative_or_less_than_the_clocks_tell(told: list[tuple[int, int]]) -> None:
    waiting, arrived = Waiting(), NOW
    for published, later in told:
        arrived += later
        assert waiting.of(GID, published, arrived) >= max(0, arrived - published)
