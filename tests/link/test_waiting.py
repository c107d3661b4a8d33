"""Tests of how long samples from Zenoh and ROS have waited, as the clocks of two computers tell."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.age import LONGEST_NS
from msggen.link.link import StaleError
from msggen.link.waiting import Publisher, Waiting

SECOND = 10**9
BOOT = 10**13
NOW = 10**18 + 10**17
FIRST, OTHER = ("/fmu/in/first", bytes(16)), ("/fmu/in/first", bytes(15) + b"\1")


class Computer:
    """A computer on which samples arrive. Its clock since boot is never set, the other one can be."""

    def __init__(self) -> None:
        self.waiting = Waiting()
        self.boot, self.clock = BOOT, NOW

    def after(self, seconds: float) -> None:
        """Let time pass."""
        self.boot += round(seconds * SECOND)
        self.clock += round(seconds * SECOND)

    def waited(self, ago: float, publisher: Publisher = FIRST) -> float | None:
        """Return how long a sample has waited that was published some s ago, as its publisher's clock tells.

        None if its clock is ahead.
        """
        try:
            return round(self.waiting.of(publisher, round(ago * SECOND), self.clock, self.boot, 10**20) / SECOND, 6)
        except StaleError as error:
            assert "ahead" in str(error)  # noqa: PT017 - it is not expected each time
            return None


@pytest.fixture
def computer() -> Computer:
    return Computer()


def test_with_the_same_clock_it_is_the_time_since_then(computer: Computer) -> None:
    assert computer.waited(1.0) == 1.0
    assert computer.waited(0.0) == 0.0


def test_a_clock_that_is_behind_makes_samples_look_late(computer: Computer) -> None:
    assert computer.waited(3.0) == 3.0


def test_a_clock_that_is_ahead_is_refused_from_the_first_sample(computer: Computer) -> None:
    """An arm that was published 4 s ago by a clock that is 5 s ahead."""
    assert computer.waited(4.0 - 5.0) is None
    assert computer.waited(3.0 - 5.0) is None


def test_a_steady_queue_does_not_hide_a_clock_that_is_ahead(computer: Computer) -> None:
    for _ in range(100):
        assert computer.waited(-5.0) is None
        computer.after(0.1)
    for _ in range(100):
        assert computer.waited(4.9 - 5.0) is None
        computer.after(0.1)


def test_below_half_a_second_the_shortest_ways_count_as_none(computer: Computer) -> None:
    for _ in range(5):
        computer.waited(-0.4)
    assert computer.waited(-0.4) == 0.0
    assert computer.waited(0.3) == 0.7
    assert computer.waited(0.3, OTHER) == 0.3  # of another computer


def test_a_clock_that_was_set_is_known_after_a_minute(computer: Computer) -> None:
    for _ in range(5):
        computer.waited(-100.0)
    waited = []
    for _ in range(70):
        computer.after(1.0)
        waited.append(computer.waited(0.0))
    assert (waited[0], waited[-1]) == (None, 0.0)


@pytest.mark.parametrize("ahead", [0.45, 1.0, 100.0, 8e9])
def test_a_forged_sample_blocks_nobody(computer: Computer, ahead: float) -> None:
    for number in range(600):
        if number % 200 == 0:  # each 20 s
            computer.waited(-ahead)
        assert computer.waited(0.3) == 0.3
        computer.after(0.1)


@pytest.mark.parametrize("ahead", [0.45, 100.0])
def test_forged_samples_of_another_topic_or_publisher_block_nobody(computer: Computer, ahead: float) -> None:
    for _ in range(20):
        computer.waited(-ahead, ("/fmu/in/other", FIRST[1]))
        computer.waited(-ahead, OTHER)
        assert computer.waited(0.3) == 0.3


@pytest.mark.parametrize("step", [-100.0, -10.0, -1.0, 1.0, 10.0, 100.0])
def test_a_clock_of_this_computer_that_is_set_blocks_nobody_who_has_the_right_one(
    computer: Computer, step: float
) -> None:
    for _ in range(100):
        computer.waited(-step)  # of another computer, whose clock is right
        assert computer.waited(0.01, OTHER) == 0.01  # of this one
        computer.after(0.1)
    computer.clock += round(step * SECOND)
    assert computer.waited(0.0) == 0.0
    assert computer.waited(0.01, OTHER) == 0.01


@pytest.mark.parametrize("step", [-100.0, -10.0, -0.4, 0.4, 10.0, 100.0])
def test_a_clock_that_is_set_changes_no_way_that_beats_tell(computer: Computer, step: float) -> None:
    for _ in range(10):
        assert computer.waited(0.01) == 0.01
    computer.clock += round(step * SECOND)
    assert computer.waited(3.0) == 3.0
    assert computer.waited(0.01) == 0.01


def test_the_publishers_that_are_remembered_are_few_and_are_not_driven_out(computer: Computer) -> None:
    for _ in range(5):
        computer.waited(-0.4)
    for number in range(5000):
        computer.waited(0.0, ("/fmu/in/first", number.to_bytes(16, "big")[::-1]))
    assert len(computer.waiting._ways) <= 1000
    assert computer.waited(0.3) == 0.7
    computer.after(100.0)
    computer.waited(0.0, OTHER)
    assert OTHER in computer.waiting._ways


@given(st.lists(st.tuples(st.integers(0, 2**63 - 1), st.integers(0, 60 * SECOND)), min_size=1, max_size=20))
def test_no_time_is_negative_or_less_than_the_clocks_tell(told: list[tuple[int, int]]) -> None:
    computer = Computer()
    for published, later in told:
        computer.after(later / SECOND)
        with suppress(StaleError):
            way = computer.clock - published
            assert LONGEST_NS >= computer.waiting.of(FIRST, way, computer.clock, computer.boot) >= max(0, way)


@given(
    st.floats(-10.0, 10.0),
    st.lists(st.tuples(st.floats(0.0, 20.0), st.floats(0.0, 1.0)), min_size=1, max_size=60),
    st.sampled_from([0, 5]),
)
def test_what_waited_for_too_long_is_never_taken_once_the_clock_is_known(
    ahead: float, ways: list[tuple[float, float]], known: int
) -> None:
    computer = Computer()
    for _ in range(known):
        computer.waited(-ahead)
    for way, later in ways:
        waited = computer.waited(way - ahead)
        if waited is not None and waited <= 0.5:
            assert way <= 0.501 if known else abs(way - ahead) <= 0.501
        computer.after(later)
