"""Tests of flights with topics that PX4 publishes on change only: the last sample is known, and outlives programs."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from msggen.flight import Flight, Limits, NoAnswerError
from msggen.flight.feeds import Feed
from msggen.link.session_files import records_folder
from msggen.live import Vehicle
from msggen.vehicle.entry import Memory
from support.flown import Flown, fly
from support.flying import CALM, QUICK, publish_once, simulated
from support.ports import free_port
from support.served import owners

pytest_plugins = ["support.owned_links"]

WAIT = 20.0
SLOW = ("vehicle_land_detected", "battery_status")


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture(autouse=True)
def home_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let vehicles publish home_position once in a session."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    publish_once(monkeypatch, "home_position")


async def home_of(flight: Flight) -> float:
    async with flight:
        await flight._fence.wait_for_home()
        assert flight._fence._known_home() is not None
        return (await flight.telemetry.home()).age


def until(condition: Any) -> None:
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def is_recorded() -> bool:
    """Whether the record of the session has the home position."""
    return any(b"home_position" in each.read_bytes().partition(b'"samples"')[2] for each in _records())


def _records() -> list[Path]:
    return [*Path(records_folder()).glob("*.json")]


def test_home_is_known_on_an_own_link(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url, QUICK), Vehicle(url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(WAIT)
        vehicle.wait_firmware(WAIT)
        time.sleep(0.2)
        assert asyncio.run(home_of(Flight(vehicle, limits=Limits(height=50.0)))) > 0.1


@pytest.mark.night  # by day, a program leaves home to the next one
@pytest.mark.usefixtures("owned")
def test_home_is_known_on_a_shared_link_also_after_its_owner_was_killed(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url, QUICK):
        with Vehicle(url, px4_types) as vehicle:
            vehicle.wait_connected(WAIT)
            vehicle.wait_firmware(WAIT)
        assert asyncio.run(home_of(Flight(url, px4_types, limits=Limits(height=50.0)))) >= 0.0
        until(is_recorded)
        (owner,) = owners()
        os.kill(owner.state["pid"], signal.SIGKILL)
        assert asyncio.run(home_of(Flight(url, px4_types, limits=Limits(height=50.0)))) > 2.0


def test_a_program_leaves_home_to_the_next_one(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url, QUICK):
        with Vehicle(url, px4_types, direct=True) as vehicle:
            vehicle.wait_connected(WAIT)
            vehicle.wait_firmware(WAIT)
            until(is_recorded)
        with Vehicle(url, px4_types, direct=True) as vehicle:
            assert vehicle.wait_connected(WAIT).continued
            assert asyncio.run(home_of(Flight(vehicle, limits=Limits(height=50.0)))) > 2.0


@pytest.mark.parametrize("fixtures", [(), ("owned",)])
def test_the_last_samples_of_slow_topics_are_known_at_once(
    fixtures: tuple[str, ...],
    url: str,
    px4_types: Any,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    """They are published once only here, before the flight."""
    for each in fixtures:
        request.getfixturevalue(each)

    async def ages() -> list[float]:
        async with Flight(vehicle) as flight:
            return [(await flight.telemetry.land()).age, (await flight.telemetry.battery()).age]

    publish_once(monkeypatch, *SLOW)
    with simulated(px4_types, url, CALM), Vehicle(url, px4_types) as vehicle:
        kept = [vehicle.subscribe(topic) for topic in SLOW]
        vehicle.wait_connected(WAIT)
        for subscription in kept:
            subscription.wait_for(lambda _: True, WAIT)
            subscription.close()
        assert min(asyncio.run(ages())) > 0.0


def test_a_topic_of_1_hz_is_waited_for_longer_than_its_period(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float | None] = []

    async def wait(_self: Feed, _condition: object, timeout: float | None = None) -> Any:
        waits.append(timeout)
        raise TimeoutError

    async def asks(flight: Flight, _: Flown) -> None:
        monkeypatch.setattr(Feed, "wait", wait)
        for ask in (flight.telemetry.land, flight.telemetry.battery, flight.telemetry.home):
            with pytest.raises(NoAnswerError, match=r"within 3 s$"):
                await ask()
        with pytest.raises(NoAnswerError, match=r"within 1 s$"):
            await flight.telemetry.attitude()

    fly(px4_types, asks)
    assert waits == [3.0, 3.0, 3.0, 1.0]


# Which samples are remembered


S = 1_000_000_000


def test_samples_that_others_follow_soon_are_not_remembered() -> None:
    memory = Memory()
    home, status = (b"home", S), (b"status", S)
    assert memory.look({"home": home, "status": status}, S) is None
    assert memory.look({"home": home, "status": (b"status", 4 * S)}, 4 * S) == {"home": home}
    assert memory.look({"home": home, "status": (b"status", 5 * S)}, 5 * S) is None
    changed = (b"changed", 60 * S)
    assert memory.look({"home": changed, "status": (b"status", 60 * S)}, 60 * S) == {"home": changed}, "at once"
    assert memory.look({"home": (b"again", 61 * S)}, 61 * S) == {}, "it is frequent by now"


# Feeds


class Connected:
    """A connection whose messages a test gives."""

    package = None

    def subscribe(self, _topic: str, take: Any) -> Any:
        self.take = take
        return lambda: None

    def recall(self, _topic: str, take: Any) -> None:
        self.kept = take


def test_a_kept_message_is_the_latest_but_does_not_happen_now() -> None:
    async def main() -> None:
        connection, taken = Connected(), list[int]()
        feed = Feed(connection, "a")  # type: ignore[arg-type]
        feed.call(taken.append)
        waiting = asyncio.ensure_future(feed.wait(lambda each: each == 7, 5.0))
        following = asyncio.ensure_future(feed.following(lambda _: True, 5.0))
        await asyncio.sleep(0)
        connection.kept(7, 30.0)
        assert await waiting == feed.latest == 7
        assert feed.age >= 30.0
        assert (taken, following.done()) == ([], False)
        connection.take(8)
        assert await following == 8
        connection.kept(9, 1.0)
        assert (feed.latest, taken) == (8, [8])

    asyncio.run(main())


def test_one_who_takes_a_message_and_fails_keeps_it_from_no_other() -> None:
    async def main() -> list[str]:
        told: list[str] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, what: told.append(str(what["exception"])))
        connection, taken = Connected(), list[int]()
        feed = Feed(connection, "a")  # type: ignore[arg-type]
        feed.call(lambda _: 1 / 0)  # type: ignore[arg-type]
        feed.call(taken.append)
        connection.take(8)
        assert taken == [8]
        return told

    assert asyncio.run(main()) == ["division by zero"]
