"""What modes and executors change of PX4's own doings: failsafes, disarming after landing, the home position."""

from __future__ import annotations

import asyncio
import math
from typing import Any, ClassVar

import pytest

from msggen.flight.errors import FlightError, NoAnswerError, UnsupportedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.registration import Deferral, Keeps
from msggen.sim import Options
from support.examples import by_day
from support.flown import EXTERNAL, Flown, chosen, fly, flying, flying_each

HOLD, RETURN = 4, 5
REQUEST = "config_overrides_request"
RETURNS = Options(parameters={"COM_LOW_BAT_ACT": 3.0})
"""A critical battery lets PX4 return."""


class Waits(Mode, name="Waits"):
    async def fly(self) -> None:
        await self.hold(1000.0)


class Stays(Executor):
    """Defers failsafes for some time in the air."""

    mode = Waits
    starts: ClassVar[Start] = "selected"
    seconds = 6.0
    leaves_at_once = False

    def __init__(self) -> None:
        self.deferral: Deferral | None = None
        self.waits = 0

    async def run(self) -> None:
        await self.arm()
        await self.takeoff(5.0)
        async with self.deferring_failsafes(self.seconds) as self.deferral:
            assert not self.deferral.is_waiting
            await self.deferral.wait()
            self.waits += 1
            if not self.leaves_at_once:
                await self.fly()
        await self.fly()


def _in_air(vehicle: Flown) -> bool:
    return vehicle.world.commander.failsafe.defer_state == 1


@pytest.mark.parametrize("is_left", [False, True])
def test_a_low_battery_is_deferred_and_told_once(types: Any, *, is_left: bool) -> None:
    """PX4 acts when the time is over, or the program no longer defers it: it holds for 5 s, and returns."""
    executor = Stays()
    executor.leaves_at_once = is_left

    async def program(flight: Flight, vehicle: Flown) -> float:
        await chosen(flight, executor)
        await vehicle.until(lambda: _in_air(vehicle), 20.0)
        await asyncio.sleep(0.1)  # until the program knows that it defers
        vehicle.world.battery.remaining = 0.06
        deferred = await vehicle.until(lambda: vehicle.world.commander.failsafe.is_active, 8.0)
        assert vehicle.world.mode == HOLD
        await asyncio.sleep(0.5)
        assert vehicle.world.commander.failsafe.defer_state in {0, 1}
        await vehicle.until(lambda: vehicle.world.mode == RETURN, 6.0)
        return deferred

    deferred = fly(types, program, RETURNS)
    print(f"{types.__name__}: deferred for {deferred:.2f} s")
    assert executor.waits == 1
    assert 0.0 < deferred < 0.6 if is_left else deferred == pytest.approx(6.0, abs=0.3)


def test_a_mode_defers_failsafes_too(types: Any) -> None:
    class Careful(Mode, name="Careful"):
        async def fly(self) -> None:
            async with self.deferring_failsafes(3) as deferral:
                await deferral.wait()
                seen.append(deferral.is_waiting)
                await self.hold(1000.0)

    seen: list[bool] = []

    async def program(flight: Flight, vehicle: Flown) -> float:
        await vehicle.in_mode(flight, Careful)
        await vehicle.until(lambda: _in_air(vehicle), 3.0)
        vehicle.world.battery.remaining = 0.06
        return await vehicle.until(lambda: vehicle.world.commander.failsafe.is_active, 5.0)

    assert fly(types, program, RETURNS) == pytest.approx(3.0, abs=0.3)
    assert seen == [True]


def test_what_was_deferred_is_not_when_the_executor_is_ended(types: Any) -> None:
    """The overrides are kept by PX4, so they are taken back, and told again when the executor comes into charge."""

    async def program(flight: Flight, vehicle: Flown) -> Any:
        await chosen(flight, Stays)
        await vehicle.until(lambda: _in_air(vehicle), 20.0)
        await flight.set_mode("hold")
        await asyncio.sleep(2.0)
        return [each.message for each in vehicle.sent if each.topic == REQUEST]

    requests = fly(types, program)
    assert requests[0].defer_failsafes
    assert requests[0].defer_failsafes_timeout_s == 6
    assert not requests[-1].defer_failsafes
    assert len(requests) >= 6  # the end is repeated


def test_overrides_are_confirmed_or_repeated(types: Any) -> None:
    is_confirmed = hasattr(types, "ConfigOverrides") and any(
        each.uorb_topic == "config_overrides_confirm" for each in types.topics.ENDPOINTS
    )

    class Kept(Waits, name="Kept"):
        keeps = Keeps(armed=True)

    async def program(flight: Flight, vehicle: Flown) -> int:
        await flight.add(Kept)
        await asyncio.sleep(2.0)
        return len(vehicle.times(REQUEST))

    async def silent(flight: Flight, vehicle: Flown) -> None:
        vehicle.lost = {"config_overrides_confirm"}
        with pytest.raises(NoAnswerError, match="has not confirmed"):
            await flight.add(Kept)
        await asyncio.sleep(0.1)
        assert not vehicle.world.commander.components.modes

    assert fly(types, program) == (1 if is_confirmed else 5)
    if is_confirmed:
        fly(types, silent)


@by_day("keeps", [True, False], 2)
@flying_each()
async def test_the_vehicle_is_not_disarmed_after_landing(flight: Flight, vehicle: Flown, *, keeps: bool) -> None:
    ends: list[str] = []

    class Lands(Executor):
        mode = Waits
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await self.arm()
            await self.takeoff(3.0)
            await self.land()
            await asyncio.sleep(10.0)
            ends.append("armed" if vehicle.world.is_armed else "disarmed")
            await self.disarm()
            ends.append("done")

    Lands.keeps = Keeps(armed=keeps)

    await chosen(flight, Lands)
    await vehicle.until(lambda: len(ends) == 2, 40.0)
    assert not vehicle.world.is_armed
    assert ends == ["armed" if keeps else "disarmed", "done"]


async def moved(flight: Flight, vehicle: Flown) -> None:
    """Take off, fly 7 m to the north, and land. The vehicle is armed in the mode that is selected."""
    selected = vehicle.world.mode
    await flight.arm()
    await flight.takeoff(5.0)
    here = vehicle.world.place
    await flight.goto(latitude=here.latitude + 0.000063, longitude=here.longitude)
    await flight.land()
    await flight.set_mode(selected)  # in others, home follows the vehicle while it is disarmed
    await flight.wait_disarmed()
    await flight.arm()
    await flight.disarm()


def test_the_home_position_is_kept_in_v1_18_only(types: Any) -> None:
    class Kept(Waits, name="Kept"):
        keeps = Keeps(home=True)

    async def program(flight: Flight, vehicle: Flown) -> Any:
        if "disable_auto_set_home" not in {field.name for field in types.ConfigOverrides.__msg__.fields}:
            with pytest.raises(UnsupportedError, match=r"needs PX4 v1\.18"):
                await flight.add(Kept)
            assert not vehicle.sent
            return None
        await flight.add(Kept)
        await moved(flight, vehicle)
        assert vehicle.world.origin.local(vehicle.world.home)[0] > 6.0, "the mode is not active"
        await flight.set_mode(Kept)
        await moved(flight, vehicle)
        assert vehicle.world.origin.local(vehicle.world.home)[0] < 8.0
        return next(each.message for each in vehicle.sent if each.topic == REQUEST)

    request = fly(types, program)
    assert request is None or (request.disable_auto_set_home, request.source_type, request.source_id) == (
        True,
        0,
        EXTERNAL,
    )


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan, math.inf, 40_000.0])
@flying()
async def test_a_time_without_limit_is_an_error(flight: Flight, vehicle: Flown, seconds: float) -> None:
    executor = Stays()

    await flight.add(executor)
    with pytest.raises(ValueError, match="expected a time of more than 0 s"):
        async with executor.deferring_failsafes(seconds):
            pass
    assert not vehicle.times(REQUEST)


@flying_each()
async def test_an_executor_that_is_not_in_charge_defers_nothing(flight: Flight) -> None:
    executor = Stays()

    with pytest.raises(FlightError, match="is not registered"):
        executor.deferring_failsafes(5)
    await flight.add(executor)
    with pytest.raises(FlightError, match="does not defer failsafes"):
        async with executor.deferring_failsafes(5):
            pass
