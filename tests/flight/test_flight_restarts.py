"""Tests of what shows that a vehicle has restarted: clocks that go back, and requests that do not come."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight.restarts import Restarts

OWN = 0b10
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
        self.now, self.told, self.requests = 100.0, list[str](), Requests()
        monkeypatch.setattr("asyncio.get_running_loop", lambda: SimpleNamespace(time=lambda: self.now))
        feeds: Any = {"arming_check_request": self.requests}
        self.restarts = Restarts(feeds, lambda: OWN, self.told.append)
        self.restarts.begin()

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
    for mask in (OWN, 0, 0, 0, 0, OWN, 0, 0, 0, 0):
        watched.now += 0.3
        watched.requests.take(SimpleNamespace(valid_registrations_mask=mask))
    assert not watched.told
    watched.now += 0.3
    watched.requests.take(SimpleNamespace(valid_registrations_mask=0b1))
    assert len(watched.told) == count


def test_requests_that_have_waited_for_a_program_that_hung_are_not_counted(watched: Watched) -> None:
    watched.take(status(50.0))
    watched.now += 4.0
    for _ in range(12):
        watched.requests.take(SimpleNamespace(valid_registrations_mask=0))
    assert not watched.told
    watched.now += 0.3
    watched.requests.take(SimpleNamespace(valid_registrations_mask=OWN))
    assert not watched.told


def test_releases_without_a_mask_are_not_judged_by_it(watched: Watched) -> None:
    watched.take(status(50.0))
    for _ in range(10):
        watched.requests.take(SimpleNamespace(request_id=1))
    assert not watched.told
