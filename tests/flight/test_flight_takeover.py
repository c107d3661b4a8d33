"""Tests of programs that lose the vehicle: to a pilot, in a hang, or with the link. Nothing is sent any more."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from msggen.flight.errors import FlightError, NoAnswerError, NotReachedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from support.examples import by_day
from support.flown import SETPOINTS, Flown, fly, flying, flying_each

HOLD, OFFBOARD, LAND = 4, 14, 18
EAST = (0.0, 3.0, 0.0)


class Away(Mode, name="Away"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.goto((500.0, 0.0, -10.0))


def setpoints(vehicle: Flown, since: float = 0.0) -> list[float]:
    """Return when setpoints were sent, from a time in s on."""
    return [each.time for each in vehicle.sent if each.topic in SETPOINTS and each.time >= since]


# Offboard


@flying_each()
async def test_after_a_pilot_has_left_offboard_nothing_is_sent(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        setpoint.trajectory(velocity=EAST)
        await asyncio.sleep(2.0)
        vehicle.choose(HOLD)
        await asyncio.sleep(0.5)
        sent = len(vehicle.sent)
        await asyncio.sleep(3.0)
        with pytest.raises(NotReachedError, match="Offboard mode has ended"):
            setpoint.trajectory(velocity=EAST)
        with pytest.raises(NotReachedError, match="Offboard mode has ended"):
            await setpoint.goto((9.0, 0.0, -10.0))
        vehicle.choose(LAND)
        await asyncio.sleep(1.0)
    await vehicle.until(lambda: not vehicle.world.is_armed, 30.0)
    assert vehicle.sent[sent:] == []  # no heartbeat, and no command at the end of the block


@flying()
async def test_a_block_that_a_pilot_has_left_does_not_go_on_in_offboard(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        setpoint.trajectory(velocity=EAST)
        await asyncio.sleep(1.0)
        vehicle.choose(HOLD)
        await asyncio.sleep(0.4)
        sent = len(vehicle.sent)
        vehicle.choose(OFFBOARD)  # PX4 has heard the heartbeat within the last second
        await asyncio.sleep(0.4)
        assert vehicle.world.mode == OFFBOARD
        await asyncio.sleep(2.0)
        assert vehicle.sent[sent:] == []


def test_a_flight_to_a_place_ends_when_a_pilot_leaves_offboard(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await vehicle.in_air(flight)
        async with flight.offboard() as setpoint:
            going = asyncio.ensure_future(setpoint.goto((500.0, 0.0, -10.0)))
            await asyncio.sleep(2.0)
            vehicle.choose(HOLD)
            taken = await vehicle.until(going.done, 3.0)
            with pytest.raises(NotReachedError, match=r"the flight to a place was not completed: .* in mode hold"):
                await going
        return taken

    assert fly(px4_types, program) < 1.2  # a status comes at 5 Hz, and a place can still be reached for 0.5 s


@flying_each()
async def test_before_offboard_is_entered_only_heartbeats_are_sent(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    begin = len(vehicle.sent)
    entered = []
    end = flight.feeds["vehicle_status"].call(
        lambda status: entered.append(len(vehicle.sent)) if status.nav_state == OFFBOARD else None
    )
    async with flight.offboard():
        await asyncio.sleep(0.5)
    end()
    before = vehicle.sent[begin : entered[0]]
    assert {each.topic for each in before} == {"offboard_control_mode", "vehicle_command"}
    beats = [each for each in before if each.topic == "offboard_control_mode"]
    assert 9 <= len(beats) <= 13  # 1 s at 10 Hz, and until the status shows the mode
    assert len(setpoints(vehicle)) > 20


def test_after_a_hang_in_offboard_a_new_status_has_to_show_the_mode(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> tuple[float, float]:
        await vehicle.in_air(flight)
        async with flight.offboard() as setpoint:
            setpoint.trajectory(velocity=EAST)
            await asyncio.sleep(1.0)
            vehicle.hang(0.7)  # PX4 leaves Offboard after 1 s
            back = vehicle.time / 1e6
            status = await flight.feeds["vehicle_status"].following(lambda each: each.timestamp > back * 1e6)
            await asyncio.sleep(0.5)
            assert status.nav_state == OFFBOARD
            return status.timestamp / 1e6, setpoints(vehicle, back)[0]

    confirmed, sent = fly(px4_types, program)
    assert confirmed <= sent < confirmed + 0.15


@flying()
async def test_a_pilot_who_takes_over_in_a_hang_gets_no_setpoint(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        setpoint.trajectory(velocity=EAST)
        await asyncio.sleep(1.0)
        vehicle.choose(LAND)
        vehicle.lost = {"vehicle_status"}
        vehicle.hang(1.0)
        back = vehicle.time / 1e6
        await asyncio.sleep(0.4)
        vehicle.lost.clear()
        await asyncio.sleep(1.0)
        assert [each for each in vehicle.sent if each.time >= back] == []


@flying()
async def test_a_second_offboard_block_is_refused(flight: Flight, vehicle: Flown) -> None:
    """Otherwise, the vehicle gets the setpoints of both in turn, and the end of one ends the other."""
    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        setpoint.trajectory(velocity=EAST)
        with pytest.raises(FlightError, match=r"`offboard\(\)` block already"):
            async with flight.offboard():
                pass
        await asyncio.sleep(2.0)
        assert vehicle.world.mode == OFFBOARD
        assert vehicle.world.flight.velocity[1] == pytest.approx(3.0, abs=0.3)
    assert vehicle.world.mode == HOLD
    async with flight.offboard():
        assert vehicle.world.mode == OFFBOARD


def test_two_tasks_do_not_enter_offboard_at_once(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> tuple[BaseException | None, BaseException | None]:
        await vehicle.in_air(flight)

        async def hovers() -> None:
            async with flight.offboard():
                await asyncio.sleep(1.0)

        return await asyncio.gather(hovers(), hovers(), return_exceptions=True)

    one, two = fly(px4_types, program)
    assert one is None
    assert isinstance(two, FlightError)


# lost messages of the vehicle


@by_day(
    ("is_taken", "lost"),
    itertools.product([False, True], [{"vehicle_status"}, {"vehicle_status", "arming_check_request"}]),
    3,
)
@flying_each()
async def test_setpoints_of_a_mode_stop_when_the_vehicle_is_not_heard(
    flight: Flight, vehicle: Flown, lost: set[str], *, is_taken: bool
) -> None:
    """Without its status, the program does not know that the mode was left: Land with setpoints does not land."""
    await vehicle.in_mode(flight, Away)
    await asyncio.sleep(2.0)
    vehicle.lost = lost
    silent = vehicle.time / 1e6
    if is_taken:
        vehicle.choose(LAND)
    await asyncio.sleep(10.0)
    assert setpoints(vehicle, silent)
    assert setpoints(vehicle, silent + 1.6 + 0.05) == []
    if is_taken:
        await vehicle.until(lambda: not vehicle.world.is_armed, 20.0)


@flying_each()
async def test_setpoints_of_offboard_stop_when_the_vehicle_is_not_heard(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        setpoint.trajectory(velocity=(0.0, 0.0, -0.5))
        await asyncio.sleep(1.0)
        vehicle.lost = {"vehicle_status"}
        silent = vehicle.time / 1e6
        vehicle.choose(LAND)
        await vehicle.until(lambda: not vehicle.world.is_armed, 40.0)
        late = [each for each in vehicle.sent if each.time > silent + 1.65]
        assert late == []
        vehicle.lost.clear()
        await asyncio.sleep(1.0)


@flying()
async def test_setpoints_go_on_when_the_vehicle_is_heard_again_in_the_mode(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_mode(flight, Away)
    await asyncio.sleep(1.0)
    vehicle.lost = {"vehicle_status"}
    await asyncio.sleep(2.5)
    back = vehicle.time / 1e6
    vehicle.lost.clear()
    await asyncio.sleep(1.5)
    again = setpoints(vehicle, back)
    assert again
    assert again[0] < back + 0.6


# no link

Action = Callable[[Flight], Coroutine[Any, Any, None]]


ACTIONS: dict[str, Action] = {
    "takeoff": lambda flight: flight.takeoff(30.0),
    "land": Flight.land,
    "return_home": Flight.return_home,
    "wait_disarmed": Flight.wait_disarmed,
    "fly": lambda flight: flight.fly(Away),
    "goto": lambda flight: flight.goto(latitude=47.4, longitude=8.5456),
}


@by_day("action", ACTIONS.values(), 2, ids=ACTIONS)
def test_a_wait_without_a_link_ends(px4_types: Any, action: Action) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(Away)
        await flight.arm()
        if action is not ACTIONS["takeoff"]:
            await flight.takeoff(10.0)
        waiting = asyncio.ensure_future(action(flight))
        await asyncio.sleep(2.0)
        assert not waiting.done()
        vehicle.loss = 1.0
        taken = await vehicle.until(waiting.done, 30.0)
        with pytest.raises(NoAnswerError, match="no vehicle_status for 10 s"):
            await waiting
        return taken

    taken = fly(px4_types, program)
    assert 9.5 < taken < 11.1
