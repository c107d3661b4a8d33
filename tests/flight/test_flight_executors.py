"""Tests of executors and actions in Python, with the types of every release."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.checks import LOCAL_POSITION
from msggen.flight.errors import FlightError, RefusedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.sim import Options
from support.examples import examples
from support.flown import EXTERNAL, Flown, chosen, fly, flying, flying_each

HOLD, RETURN, LAND, DESCEND = 4, 5, 18, 12


class There(Mode, name="There"):
    """Flies to a place and returns."""

    requires = LOCAL_POSITION

    async def fly(self) -> None:
        await self.goto((8.0, 0.0, -8.0))


class Mission(Executor):
    """Arms, takes off, flies its mode, and returns."""

    mode = There
    starts: ClassVar[Start] = "selected"

    def __init__(self) -> None:
        self.steps: list[str] = []

    async def run(self) -> None:
        try:
            await self.arm()
            self.steps.append("armed")
            await self.takeoff(8.0)
            self.steps.append("in the air")
            await self.fly()
            self.steps.append("there")
            await self.rtl()
            self.steps.append("home")
            await self.wait_disarmed()
            self.steps.append("disarmed")
        except asyncio.CancelledError:
            self.steps.append("cancelled")
            raise


@flying_each()
async def test_a_pilot_ends_an_executor_at_once(flight: Flight, vehicle: Flown) -> None:
    mission = Mission()

    await chosen(flight, mission)
    await vehicle.until(lambda: "in the air" in mission.steps, 20.0)
    await asyncio.sleep(1.0)
    await flight.set_mode("hold")
    await asyncio.sleep(0.3)
    assert mission.steps[-1] == "cancelled"
    assert vehicle.world.commander.executor_in_charge == 0
    sent = len(vehicle.sent)
    await asyncio.sleep(3.0)
    kinds = {each.topic for each in vehicle.sent[sent:]}
    assert kinds == {"arming_check_reply"}


@flying()
async def test_an_executor_can_start_once_it_is_registered(flight: Flight, vehicle: Flown) -> None:
    class Now(Mission):
        starts = "registered"

    mission = Now()

    await flight.add(mission)
    await vehicle.until(lambda: "disarmed" in mission.steps, 60.0)


@flying()
async def test_what_px4_refuses_is_raised_with_the_reason(flight: Flight, vehicle: Flown) -> None:
    errors: list[RefusedError] = []

    class Hopeful(Executor):
        mode = There
        starts = "selected"

        async def run(self) -> None:
            try:
                await self.arm()
            except RefusedError as error:
                errors.append(error)

    vehicle.lose_position()
    await asyncio.sleep(6.0)
    await chosen(flight, Hopeful)
    await asyncio.sleep(1.0)
    assert errors[0].result == 1
    assert "there is no local position" in errors[0].reasons


@flying()
async def test_the_exception_of_a_mode_reaches_its_executor(flight: Flight, vehicle: Flown) -> None:
    found: list[BaseException] = []

    class Lost(Mode):
        async def fly(self) -> None:
            await self.hold(0.5)
            raise LookupError("no target")

    class Searches(Executor):
        mode = Lost
        starts = "selected"

        async def run(self) -> None:
            await self.arm()
            await self.takeoff(5.0)
            try:
                await self.fly()
            except LookupError as error:
                found.append(error)
            await self.land()

    await chosen(flight, Searches)
    await vehicle.until(lambda: vehicle.world.mode == LAND, 30.0)  # and never in a failsafe
    await vehicle.until(lambda: not vehicle.world.is_armed, 30.0)
    assert [str(each) for each in found] == ["no target"]


@pytest.mark.parametrize("error", [RuntimeError, pytest.fail.Exception])
@flying()
async def test_an_executor_that_fails_lets_px4_return(
    flight: Flight, vehicle: Flown, error: Callable[[str], BaseException], caplog: pytest.LogCaptureFixture
) -> None:
    class Fails(Mission):
        async def run(self) -> None:
            await self.arm()
            await self.takeoff(5.0)
            await self.fly()
            raise error("broken")

    await chosen(flight, Fails)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 40.0)
    assert "executor Fails has failed" in caplog.text


@flying()
async def test_an_executor_flies_other_modes_that_are_registered(flight: Flight, vehicle: Flown) -> None:
    visited: list[str] = []

    def place(name: str, x: float) -> type[Mode]:
        async def go(self: Mode) -> None:
            await self.goto((x, 0.0, -5.0))
            visited.append(name)

        return type(name, (Mode,), {"fly": go})

    one, two = place("One", 3.0), place("Two", -3.0)

    class Tour(Executor):
        mode = There
        starts = "selected"

        async def run(self) -> None:
            await self.arm()
            await self.takeoff(5.0)
            for each in (one, two, one):
                await self.fly(each)
            with pytest.raises(FlightError, match="'Mode' is not registered"):
                await self.fly(type("Mode", (Mode,), {}))
            await self.land()

    await flight.add(Tour, one, two)
    await flight.set_mode(EXTERNAL)
    await vehicle.until(lambda: vehicle.world.mode == LAND, 60.0)
    assert visited == ["One", "Two", "One"]


@settings(max_examples=examples(40, by_day=3))
@given(st.floats(0.1, 40.0), st.sampled_from(["hold", "return", "land", "position lost"]))
def test_wherever_an_executor_is_ended_it_sends_nothing_more(px4_types: Any, seconds: float, way: str) -> None:
    """After a pilot or a failsafe has ended it, and until it is in charge again: no setpoint, no command."""
    mission = Mission()

    async def program(flight: Flight, vehicle: Flown) -> None:
        await chosen(flight, mission)
        await asyncio.sleep(seconds)
        if way == "position lost":
            vehicle.lose_position()
            await asyncio.sleep(6.5)
        else:
            await flight.set_mode(way)
            await asyncio.sleep(0.3)
        sent, end = len(vehicle.sent), vehicle.time + 2_000_000
        while vehicle.time < end and not vehicle.world.commander.executor_in_charge:
            assert {each.topic for each in vehicle.sent[sent:]} <= {"arming_check_reply"}
            await asyncio.sleep(0.01)

    fly(px4_types, program)


# actions of a user


@flying_each()
async def test_actions_fly_without_a_mode_of_its_own(flight: Flight, vehicle: Flown) -> None:
    actions = flight
    await actions.arm()
    await actions.takeoff(6.0)
    assert -vehicle.world.flight.position[2] == pytest.approx(6.0, abs=1.0)
    await actions.hold()
    with pytest.raises(RefusedError, match="the vehicle is in the air"):
        await actions.disarm()
    await actions.return_home()
    await actions.wait_disarmed()
    assert vehicle.world.is_landed


@flying_each()
async def test_offboard_flies_and_ends_in_hold(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight, 5.0)
    async with flight.offboard("enu") as setpoint:
        await setpoint.goto((6.0, 0.0, 5.0))
        assert vehicle.world.flight.position[1] == pytest.approx(6.0, abs=0.7)
        setpoint.trajectory(velocity=(0.0, 2.0, 0.0))
        await asyncio.sleep(2.0)
        assert vehicle.world.flight.velocity[0] == pytest.approx(2.0, abs=0.3)
    assert vehicle.world.mode == HOLD
    sent = len(vehicle.sent)
    await asyncio.sleep(1.0)
    assert len(vehicle.sent) == sent


def test_offboard_that_ends_with_an_exception_is_a_lost_signal(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await vehicle.in_air(flight, 5.0)
        with pytest.raises(ZeroDivisionError):
            async with flight.offboard():
                raise ZeroDivisionError
        return await vehicle.until(lambda: vehicle.world.commander.failsafe.is_active, 5.0)

    assert fly(px4_types, program) == pytest.approx(1.0, abs=0.2)  # COM_OF_LOSS_T


@flying_each()
async def test_telemetry_has_meaning(flight: Flight, vehicle: Flown, types: Any) -> None:
    await vehicle.in_air(flight, 5.0)
    telemetry, home = flight.telemetry, vehicle.world.home
    place = await telemetry.local_position()
    assert place.is_valid
    assert place.position == pytest.approx(vehicle.world.flight.position, abs=0.2)
    there = await telemetry.global_position()
    assert there.is_valid
    assert (there.latitude, there.longitude) == pytest.approx((home.latitude, home.longitude), abs=1e-5)
    assert there.altitude == pytest.approx(home.altitude + 5.0, abs=1.0)
    battery = await telemetry.battery()
    assert battery.is_valid
    assert 0.9 < battery.remaining <= 1.0
    assert (await telemetry.attitude()).yaw == pytest.approx(0.0, abs=0.05)
    if any(each.uorb_topic == "home_position" for each in types.topics.ENDPOINTS):  # not in v1.15
        assert (await telemetry.home()).is_valid
        assert not (await telemetry.land()).is_landed


@flying(Options(parameters={"COM_LOW_BAT_ACT": 3.0}))
async def test_failsafes_are_told_apart_from_ends(flight: Flight, vehicle: Flown) -> None:
    """A low battery takes the vehicle from an executor: it holds for 5 s, then returns (COM_LOW_BAT_ACT 3)."""

    mission = Mission()

    await chosen(flight, mission)
    await vehicle.until(lambda: "in the air" in mission.steps, 20.0)
    vehicle.world.battery.discharged = 0.94 * vehicle.world.battery.capacity
    await vehicle.until(lambda: vehicle.world.mode == HOLD, 1.0)
    await asyncio.sleep(0.3)
    assert mission.steps[-1] == "cancelled"
    assert await vehicle.until(lambda: vehicle.world.mode == RETURN, 6.0) == pytest.approx(4.7, abs=0.4)
