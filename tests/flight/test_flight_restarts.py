"""Tests of what shows that a vehicle has restarted: clocks that go back, and requests that do not come."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight.restarts import Restarts

OWN = 0b10
ALONE = 0b100
"""A check without a mode."""
ALL = OWN | ALONE
UTC = 1_700_000_000_000_000


class Requests:
    """The feed of requests for arming checks."""

    def __init__(self) -> None:
        self.age = 0.1
        self.take: Any = None

    def call(self, take: Any) -> Any:
        self.take = take
        return lambda: None


def status(timestamp: float, mode_time: float = 0.0, *, is_armed: bool = False) -> Any:
    """Return a VehicleStatus. Times are in s."""
    times = {"timestamp": round(timestamp * 1e6), "nav_state_timestamp": round(mode_time * 1e6)}
    return SimpleNamespace(**times, arming_state=2 if is_armed else 1, ARMING_STATE_ARMED=2)


class Watched:
    """What watches a vehicle that sends a status every 0.5 s, on a clock of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.told, self.lost, self.requests = 100.0, list[str](), list[int](), Requests()
        monkeypatch.setattr("asyncio.get_running_loop", lambda: SimpleNamespace(time=lambda: self.now))
        feeds: Any = {"arming_check_request": self.requests}
        self.restarts = Restarts(feeds, lambda: ALL, lambda: ALONE, self.tell)
        self.restarts.begin()

    def tell(self, why: str, lost: int) -> None:
        self.told.append(why)
        self.lost.append(lost)

    def ask(self, after: float = 0.3, **request: int) -> None:
        """Let a request come some time after the one before."""
        self.now += after
        self.requests.take(SimpleNamespace(**request))

    def take(self, *statuses: Any, every: float = 0.5) -> list[str]:
        """Return what is told of statuses."""
        for each in statuses:
            self.now += every
            self.restarts.take(each)
        return self.told


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    return Watched(monkeypatch)


def test_a_clock_since_boot_that_goes_back_is_a_restart(watched: Watched) -> None:
    assert watched.take(status(50.0), status(50.5), status(3.0), status(3.5)) == ["the vehicle has restarted"]


@pytest.mark.parametrize("base", [0.0, UTC / 1e6], ids=["since boot", "UTC"])
def test_messages_that_overtake_each_other_are_no_restart(base: float, watched: Watched) -> None:
    assert not watched.take(
        status(base + 50.0, 10.0), status(base + 50.6, 50.6), status(base + 50.5, 10.0), status(base + 51.0, 50.6)
    )


def test_a_clock_that_is_synchronized_is_no_restart(watched: Watched) -> None:
    assert not watched.take(
        status(50.0, 10.0), status(UTC / 1e6, 10.0), status(51.0, 10.0), status(UTC / 1e6 + 2, 10.0)
    )


def test_a_mode_that_was_entered_earlier_is_a_restart_in_utc(watched: Watched) -> None:
    assert watched.take(status(UTC / 1e6, 40.0), status(UTC / 1e6 + 0.5, 1.0)) == ["the vehicle has restarted"]


def test_a_gap_with_a_mode_that_was_entered_earlier_is_a_restart(watched: Watched) -> None:
    assert not watched.take(status(50.0, 40.0))
    assert watched.take(status(50.5, 1.0), every=2.0) == ["the vehicle has restarted"]


def test_requests_that_stay_away_show_that_nothing_is_registered(watched: Watched) -> None:
    watched.requests.age = 10.0
    assert not watched.take(*(status(50.0 + 0.5 * count) for count in range(7)))
    assert watched.take(status(53.5)) == ["the vehicle has restarted, or has removed what was registered"]


def test_after_a_gap_requests_have_time_to_come(watched: Watched) -> None:
    assert not watched.take(status(50.0))
    watched.requests.age = 10.0
    assert not watched.take(status(60.0), every=10.0)
    assert not watched.take(status(60.5), status(61.0))
    watched.requests.age = 0.1
    assert not watched.take(*(status(61.0 + 0.5 * count) for count in range(10)))


@pytest.mark.parametrize(("is_armed", "count"), [(False, 1), (True, 0)])
def test_an_id_that_is_not_asked_for_is_removed_on_the_ground(*, is_armed: bool, count: int, watched: Watched) -> None:
    watched.take(status(50.0, is_armed=is_armed))
    for mask in (ALL, 0, 0, 0, 0, ALL, 0, 0, 0, 0):
        watched.ask(valid_registrations_mask=mask)
    assert not watched.told
    watched.ask(valid_registrations_mask=0b1)
    assert watched.told == ["the vehicle has removed what was registered"] * count
    assert watched.lost == [ALL] * count


@pytest.mark.parametrize("lost", [OWN, ALONE])
def test_only_what_is_not_asked_for_is_lost(lost: int, watched: Watched) -> None:
    watched.take(status(50.0))
    for _ in range(5):
        watched.ask(valid_registrations_mask=ALL & ~lost)
    assert watched.lost == [lost]


def test_requests_that_have_waited_for_a_program_that_hung_are_not_counted(watched: Watched) -> None:
    watched.take(status(50.0))
    watched.now += 4.0
    for _ in range(12):
        watched.requests.take(SimpleNamespace(valid_registrations_mask=0))
    assert not watched.told
    watched.now += 0.3
    watched.requests.take(SimpleNamespace(valid_registrations_mask=ALL))
    assert not watched.told


def test_releases_without_a_mask_are_not_judged_by_it(watched: Watched) -> None:
    watched.take(status(50.0))
    for _ in range(10):
        watched.ask(request_id=1)
    assert not watched.told


@pytest.mark.parametrize(("pause", "is_lost"), [(0.9, False), (1.3, True)])
def test_without_a_mask_a_check_without_a_mode_is_lost_in_a_gap(
    pause: float, *, is_lost: bool, watched: Watched
) -> None:
    """It is registered again once the vehicle is disarmed. Modes may have been kept."""
    watched.take(status(50.0, is_armed=True))
    watched.ask(request_id=1)
    watched.ask(request_id=5, after=pause)
    watched.ask(request_id=6)
    assert not watched.told
    watched.take(status(52.0))
    watched.ask(request_id=7)
    assert watched.lost == ([ALONE] if is_lost else [])
    watched.ask(request_id=8)
    assert len(watched.lost) == is_lost
