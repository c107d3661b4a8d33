"""Tests of actions in rare cases: other origins, commands at once, modes that replace PX4's, lost messages, refusal."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from msggen.flight.errors import FlightError, LimitError, NotReachedError, RefusedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.limits import Limits
from msggen.flight.mode import Mode
from msggen.messages.commands import ARM_DISARM
from msggen.messages.nav_states import HOLD, MODE_NAMES, OFFBOARD, RETURN
from msggen.messages.refusals import REQUIREMENTS, reasons_for_command
from msggen.sim.loop import run
from support.flown import EXTERNAL, Flown, Line, fly, flying, flying_each

# takeoff


@pytest.mark.parametrize("above", [-30.0, 30.0])
def test_a_takeoff_counts_from_the_vehicle_and_not_from_the_origin(types: Any, above: float) -> None:
    async def program(flight: Flight, _: Flown) -> float:
        ground = await flight.telemetry.global_position()
        await flight.set_origin(latitude=ground.latitude, longitude=ground.longitude, altitude=ground.altitude + above)
        await asyncio.sleep(1.0)
        await flight.arm()
        await flight.takeoff(5.0)
        return (await flight.telemetry.global_position()).altitude - ground.altitude

    assert fly(types, program) == pytest.approx(5.0, abs=1.0)


@flying(limits=Limits(height=20.0))
async def test_the_limit_of_a_takeoff_counts_from_home(flight: Flight) -> None:
    ground = await flight.telemetry.global_position()
    await flight.set_origin(latitude=ground.latitude, longitude=ground.longitude, altitude=ground.altitude - 30.0)
    await asyncio.sleep(1.0)
    await flight.arm()
    with pytest.raises(LimitError):
        await flight.takeoff(21.0)
    await flight.takeoff(5.0)
    altitude = (await flight.telemetry.global_position()).altitude
    assert altitude - ground.altitude == pytest.approx(5.0, abs=1.0)


@flying_each()
async def test_a_takeoff_in_the_air_counts_from_home_and_does_not_descend(flight: Flight, vehicle: Flown) -> None:
    heights: list[float] = []

    class Climbs(Executor):
        mode = Line
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await self.arm()
            for height in (5.0, 10.0, 9.5, 4.0, None):
                await self.takeoff(height)
                heights.append(-vehicle.world.flight.position[2])

    await flight.add(Climbs)
    await flight.fly(Climbs)
    assert heights == pytest.approx([5.0, 10.0, 10.0, 10.0, 10.0], abs=1.0)
    assert heights[1:] == pytest.approx([heights[1]] * 4, abs=0.9)


@flying_each()
async def test_takeoff_and_land_need_an_armed_vehicle(flight: Flight, vehicle: Flown) -> None:
    for action, name in (
        (flight.takeoff(5.0), "take off"),
        (flight.land(), "land"),
        (flight.return_home(), "return"),
    ):
        with pytest.raises(FlightError, match=f"{name}: the vehicle is not armed"):
            await action
    assert not vehicle.times("vehicle_command")


@flying()
async def test_takeoff_does_not_end_a_failsafe_in_the_air(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    vehicle.world.has_sticks = True
    await asyncio.sleep(1.0)
    vehicle.world.has_sticks = False
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 8.0)
    await asyncio.sleep(1.0)
    with pytest.raises(FlightError, match="the vehicle is in mode return, in a failsafe, in the air: select another"):
        await flight.takeoff(20.0)
    assert vehicle.world.mode == RETURN


@flying()
async def test_a_flight_tells_whether_it_is_armed_and_which_mode_flies(flight: Flight) -> None:
    await flight.add(Line)
    assert (flight.is_armed, flight.mode) == (False, "hold")
    await flight.arm()
    assert flight.is_armed
    await flight.takeoff(5.0)
    await flight.set_mode(Line)
    assert flight.mode == "Line"


@flying_each()
async def test_a_takeoff_whose_end_is_not_told_ends_in_hold(flight: Flight, vehicle: Flown) -> None:
    await flight.arm()
    vehicle.lost = {"mode_completed"}
    await flight.takeoff(10.0)
    assert -vehicle.world.flight.position[2] == pytest.approx(10.0, abs=1.0)


@flying_each()
async def test_a_takeoff_that_a_pilot_ends_below_its_altitude_is_told(flight: Flight, vehicle: Flown) -> None:
    await flight.arm()
    taking_off = asyncio.ensure_future(flight.takeoff(10.0))
    await vehicle.until(lambda: vehicle.world.flight.position[2] < -4.0, 20.0)
    vehicle.choose(HOLD)
    with pytest.raises(NotReachedError, match="the takeoff was not completed: the vehicle is in mode hold"):
        await taking_off


# commands


@flying_each()
async def test_answers_to_commands_at_once_are_not_mixed_up(flight: Flight, vehicle: Flown) -> None:
    """An answer names only the number of its command. Without sticks, Position is refused."""
    await vehicle.in_air(flight)
    for one, two in (("position", "land"), ("land", "position"), ("position", "hold")):
        found = await asyncio.gather(flight.set_mode(one), flight.set_mode(two), return_exceptions=True)
        refused = dict(zip((one, two), found, strict=True))
        assert isinstance(refused.pop("position"), RefusedError)
        assert [*refused.values()] == [None]
    assert vehicle.world.mode == HOLD


@flying()
async def test_a_command_is_not_sent_again_after_the_end_of_the_flight(flight: Flight, vehicle: Flown) -> None:
    vehicle.lost = {"vehicle_command_ack", "vehicle_status"}  # neither an answer nor the effect
    arming = asyncio.ensure_future(flight.disarm())
    await asyncio.sleep(0.1)
    flight.close()
    with pytest.raises(FlightError, match="the flight has ended"):
        await arming
    assert len(vehicle.times("vehicle_command")) == 1


# modes that replace PX4's


class Returns(Mode, name="Own return"):
    """Replaces Return."""

    replaces = 5

    async def fly(self) -> None:
        await self.goto((0.0, 0.0, -10.0))


class Holds(Mode, name="Own hold"):
    """Replaces Hold."""

    replaces = HOLD

    async def fly(self) -> None:
        await self.hold(1.0)


@flying_each()
async def test_a_return_that_a_mode_replaces_ends_with_the_mode(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Returns)
    await vehicle.in_air(flight)
    await asyncio.wait_for(flight.return_home(), 30.0)
    assert vehicle.world.mode == EXTERNAL
    assert vehicle.world.is_armed


@flying_each()
async def test_hold_can_be_a_mode_that_replaces_it(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Holds)
    await flight.arm()
    await flight.takeoff(10.0)
    await flight.hold()
    assert vehicle.world.mode == EXTERNAL
    await flight.fly(Holds)
    await flight.set_mode("hold")
    await flight.land()


@flying()
async def test_a_mode_that_is_no_longer_registered_replaces_nothing(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Holds)
    await vehicle.restart_after(2.0)
    vehicle.lost = {"register_ext_component_request"}
    await asyncio.sleep(1.0)
    await flight.set_mode("hold")
    assert vehicle.world.mode == HOLD


# deferred failsafes


def test_a_deferral_inside_another_one_is_refused(types: Any) -> None:
    """Nothing is sent after the end of the flight, also not for a block that ends with it."""
    vehicle = Flown(types)
    deferred: list[bool] = []

    class Defers(Mode):
        async def fly(self) -> None:
            async with self.deferring_failsafes(60.0):
                with pytest.raises(FlightError, match="failsafes are deferred already"):
                    async with self.deferring_failsafes(10.0):
                        pass
                await asyncio.sleep(2.0)
                requests = [each.message for each in vehicle.sent if each.topic == "config_overrides_request"]
                deferred.append(requests[-1].defer_failsafes)
                await self.hold(1000.0)

    async def main() -> None:
        await asyncio.sleep(1.0)
        async with Flight(vehicle) as flight:
            await vehicle.in_mode(flight, Defers)
            await asyncio.sleep(4.0)
        sent = len(vehicle.sent)
        await asyncio.sleep(3.0)
        assert vehicle.sent[sent:] == []

    run(main(), vehicle)
    assert deferred == [True]


@flying_each()
async def test_a_vehicle_that_is_left_in_offboard_mode_tells_how_to_arm_it(flight: Flight) -> None:
    with pytest.raises(ArithmeticError):
        async with flight.offboard():  # the vehicle stays in the mode after an exception
            raise ArithmeticError
    assert flight.mode == "offboard"
    await asyncio.sleep(1.5)
    with pytest.raises(RefusedError) as raised:
        await flight.arm()
    assert raised.value.reasons[:2] == (
        "OffboardControlMode does not arrive at 2 Hz",
        "mode offboard is selected (`hold()` selects another)",
    )
    await flight.hold()
    await flight.arm()


@flying_each()
async def test_the_end_of_an_offboard_block_on_the_ground_leaves_a_vehicle_that_can_be_armed(flight: Flight) -> None:
    async with flight.offboard():
        assert flight.mode == "offboard"
    assert flight.mode == "hold"
    await flight.arm()


def flags(**lacking: set[int]) -> Any:
    """Return FailsafeFlags in which requirements of modes are not met."""
    found = {f"mode_req_{name}": sum(1 << mode for mode in modes) for name, modes in lacking.items()}
    invalid = {REQUIREMENTS[name][0]: True for name in lacking if name in REQUIREMENTS}
    return SimpleNamespace(**found, **invalid, battery_warning=0)


@pytest.mark.parametrize("requirement", [*REQUIREMENTS, "other", "prevent_arming"])
def test_another_mode_is_advised_only_if_it_can_be_armed(requirement: str) -> None:
    for mode, name in MODE_NAMES.items():
        status = SimpleNamespace(nav_state=mode, pre_flight_checks_pass=True)
        advice = f"mode {name} is selected (x selects another)"
        alone = flags(**{requirement: {mode}})
        found = [*reasons_for_command(ARM_DISARM, [1.0], alone, status, "x")]
        assert len(found) == 2 if mode != HOLD else found
        assert (advice in found) == (mode != HOLD)
        both = flags(**{requirement: {mode, HOLD}})
        found = [*reasons_for_command(ARM_DISARM, [1.0], both, status, "x")]
        assert (advice in found) == (requirement == "prevent_arming" and mode != HOLD)


def test_nothing_is_said_of_a_mode_whose_requirements_are_met() -> None:
    status = SimpleNamespace(nav_state=OFFBOARD, pre_flight_checks_pass=False)
    found = [*reasons_for_command(ARM_DISARM, [1.0], flags(mission={3}), status, "x")]
    assert found == ["the preflight checks fail (pre_flight_checks_pass)"]
