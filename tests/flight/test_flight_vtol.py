"""Tests of VTOLs: the change between hovering and forward flight, in modes of programs and of PX4."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from msggen.flight.errors import FlightError, NoAnswerError, NotReachedError, RefusedError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.vtol import KNOWN, TRANSITION
from msggen.messages.commands import VTOL_TRANSITION
from msggen.messages.setpoints import FIXED_WING, GOTO, TRAJECTORY
from msggen.messages.vehicle_types import VtolState
from msggen.sim import Options
from support.examples import by_day
from support.flown import EXTERNAL, Flown, fly, flying, flying_each, up

VTOL = Options(vehicle="vtol")
_LATERAL, _LONGITUDINAL, *_ = FIXED_WING.topics


class Vtol(Mode):
    """A mode that flies a VTOL in each of its states."""

    setpoints = (GOTO, TRAJECTORY, FIXED_WING)


def has_wings(types: Any) -> bool:
    """Whether a release takes fixed-wing setpoints."""
    return any(each.uorb_topic == _LATERAL and each.direction == "in" for each in types.topics.ENDPOINTS)


def state(vehicle: Flown) -> VtolState:
    """Return the state of the vehicle."""
    found = vehicle.world.vtol_state
    assert found is not None
    return VtolState(found)


@by_day(("kind", "takes_both"), [("vtol", False), ("tailsitter", True), ("tailsitter", False), ("vtol", True)], 3)
def test_a_mode_flies_forward_and_back(types: Any, kind: str, takes_both: bool) -> None:  # noqa: FBT001 - a case
    """It works whether PX4 takes fixed-wing setpoints of a VTOL that hovers, as v1.18 does since September 2026."""
    heights: list[float] = []

    class There(Vtol):
        async def fly(self) -> None:
            following = self._own.feeds["vehicle_local_position"].call(lambda each: heights.append(-each.z))
            await self.to_fixed_wing()
            assert state(found) == VtolState.FORWARD
            following()
            await self.goto((150.0, 0.0, -25.0))
            await self.to_multicopter()
            assert state(found) == VtolState.HOVER
            await self.goto((170.0, 0.0, -25.0))

    found: Any = None

    async def program(flight: Flight, vehicle: Flown) -> None:
        nonlocal found
        found = vehicle
        commander = vehicle.world.commander
        commander.rules = commander.rules._replace(takes_both_of_vtol=takes_both)
        await up(flight, vehicle, There, 20.0)
        await flight.fly(There)

    if not has_wings(types):
        return
    fly(types, program, Options(vehicle=kind))
    assert max(heights) - min(heights) < 3.0
    asked = {each.message.type for each in found.sent if each.topic == "setpoint_config"}
    assert asked <= {TRAJECTORY.number}
    both = [found.times(topic) for topic in (TRAJECTORY.topic, _LATERAL)]
    assert len({*both[0]} & {*both[1]}) > 50 * 0.5  # together in the transitions


@flying_each(VTOL)
async def test_before_v1_17_a_vtol_changes_in_modes_of_px4(flight: Flight, vehicle: Flown, types: Any) -> None:
    class Asks(Mode):
        async def fly(self) -> None:
            await self.to_fixed_wing()

    await up(flight, vehicle, Asks, 20.0)
    wanted = r"before PX4 v1.17.*`await flight.hold\(\)`, then `await flight.to_fixed_wing\(\)`"
    if has_wings(types):
        wanted = "add `FIXED_WING` to its `setpoints`"
    with pytest.raises(UnsupportedError, match=wanted):
        await flight.fly(Asks)
    assert state(vehicle) == VtolState.HOVER
    await flight.hold()
    await flight.to_fixed_wing()
    assert state(vehicle) == VtolState.FORWARD
    await flight.to_fixed_wing()  # it is there already
    await flight.to_multicopter()
    assert state(vehicle) == VtolState.HOVER


@flying(VTOL)
async def test_a_change_on_the_ground_is_refused_before_it_is_sent(flight: Flight, vehicle: Flown) -> None:
    with pytest.raises(FlightError, match="on the ground, PX4 changes at once, and the vehicle flips over"):
        await flight.to_fixed_wing()
    await flight.arm()
    with pytest.raises(FlightError, match="take off first"):
        await flight.to_fixed_wing()
    assert VTOL_TRANSITION not in {each.message.command for each in vehicle.sent if "command" in each.topic}
    climb = asyncio.ensure_future(flight.takeoff(20.0))
    await vehicle.until(lambda: vehicle.world.flight.position[2] < -5.0, 20.0)
    await asyncio.sleep(0.5)
    with pytest.raises(RefusedError, match="change to forward flight: temporarily rejected"):
        await flight.to_fixed_wing()
    await climb


@flying(VTOL)
async def test_the_mode_of_a_program_and_offboard_change_by_their_own_call(flight: Flight, vehicle: Flown) -> None:
    class Stays(Vtol):
        async def fly(self) -> None:
            await self.hold(1000.0)

    await up(flight, vehicle, Stays, 20.0)
    await flight.set_mode(EXTERNAL)
    with pytest.raises(FlightError, match=r"`await self.to_fixed_wing\(\)` in the mode, or `await flight.hold\(\)`"):
        await flight.to_fixed_wing()
    await flight.hold()
    with pytest.raises(ValueError, match="a timeout above 0 s"):
        await flight.to_fixed_wing(timeout=0.0)


def test_a_vehicle_that_is_not_heard_or_does_not_change_is_told(px4_types: Any) -> None:
    """CustomTimeoutIsUsed, and a status that is older than 5 s is none, as in the library."""
    assert KNOWN == 5.0
    assert TRANSITION > 15.0  # VT_TRANS_TIMEOUT

    async def program(flight: Flight, vehicle: Flown) -> None:
        await up(flight, vehicle, height=20.0)
        begin = vehicle.time
        with pytest.raises(NotReachedError, match="has not changed to forward flight within 1 s"):
            await flight.to_fixed_wing(timeout=1.0)
        assert vehicle.time - begin < 1.5e6
        await asyncio.sleep(3.0)
        await flight.to_multicopter()
        vehicle.lost.add("vehicle_status")
        await asyncio.sleep(5.1)
        with pytest.raises(NoAnswerError, match="no vehicle_status within 5 s"):
            await flight.to_fixed_wing()
        vehicle.lost.clear()

    fly(px4_types, program, VTOL)


async def chute(vehicle: Flown) -> None:
    """Let the wings fail."""
    assert vehicle.world.command(VTOL_TRANSITION, [3.0, 1.0, *[0.0] * 5]) == 0


@flying(VTOL)
async def test_a_quad_chute_in_a_transition_is_told_and_the_mode_holds_its_place(
    flight: Flight, vehicle: Flown
) -> None:
    class Falls(Vtol):
        async def fly(self) -> None:
            with pytest.raises(NotReachedError, match="a quad-chute has ended it"):
                await self.to_fixed_wing()
            await asyncio.sleep(3.0)

    await up(flight, vehicle, Falls, 20.0)
    flying = asyncio.ensure_future(flight.fly(Falls))
    await vehicle.until(lambda: vehicle.world.vtol_state == VtolState.TO_FORWARD, 3.0)
    await asyncio.sleep(0.5)
    await chute(vehicle)
    await flying
    assert vehicle.world.mode == EXTERNAL
    assert math.hypot(*vehicle.world.flight.velocity) < 0.2


@pytest.mark.parametrize("way", ["goto", "course"])
@flying(VTOL)
async def test_a_quad_chute_in_forward_flight_ends_the_way_and_holds(
    flight: Flight, vehicle: Flown, way: str, caplog: pytest.LogCaptureFixture
) -> None:
    class Falls(Vtol):
        async def fly(self) -> None:
            await self.to_fixed_wing()
            is_ready.set()
            if way == "goto":
                with pytest.raises(NotReachedError, match="flies on its wings no more"):
                    await self.goto((900.0, 0.0, -20.0))
            else:
                self.fixed_wing(course_deg=0.0)
                await asyncio.sleep(3.0)
            with pytest.raises(FlightError, match=r"hovers now, and does not follow .* `await self.to_fixed_wing\(\)`"):
                self.fixed_wing(course_deg=0.0)
            await asyncio.sleep(5.0)

    is_ready: Any = None

    is_ready = asyncio.Event()
    await up(flight, vehicle, Falls, 20.0)
    flying = asyncio.ensure_future(flight.fly(Falls))
    await is_ready.wait()
    await asyncio.sleep(1.0)
    await chute(vehicle)
    await flying
    assert math.hypot(*vehicle.world.flight.velocity) < 0.2
    assert vehicle.times(_LATERAL)[-1] < vehicle.times(GOTO.topic)[-1] - 4.0
    assert "mode 'Falls' holds its place: the VTOL hovers now" in caplog.text


class Hovers(Mode):
    """Has setpoints for hovering only."""

    async def fly(self) -> None:
        await asyncio.sleep(100.0)


class Glides(Hovers):
    """Has setpoints for forward flight only."""

    setpoints = (FIXED_WING,)


@pytest.mark.parametrize("mode", [Hovers, Glides])
def test_a_mode_without_setpoints_for_how_the_vtol_flies_is_not_entered(
    types: Any, mode: type[Mode], caplog: pytest.LogCaptureFixture
) -> None:
    """PX4 would fly on with the setpoints of the mode before, for ever."""
    wrong = "on its wings now" if mode is Hovers else "hovers now"

    async def program(flight: Flight, vehicle: Flown) -> None:
        await up(flight, vehicle, mode, 20.0)
        if mode is Hovers:
            await flight.to_fixed_wing()
        await asyncio.sleep(1.0)
        with pytest.raises(RefusedError, match=f"{wrong}, and the mode declares no setpoints for that"):
            await flight.fly(mode)
        assert vehicle.world.mode == 4
        await (flight.to_multicopter if mode is Hovers else flight.to_fixed_wing)()
        await asyncio.sleep(1.0)
        await flight.set_mode(mode)

    if mode is Hovers or has_wings(types):
        fly(types, program, VTOL)
        assert f"{wrong}, and the mode declares no setpoints for that" in caplog.text


@by_day("seconds", [0.0, 0.5, 4.0], 2)
@flying(VTOL)
async def test_a_mode_that_a_transition_catches_without_setpoints_is_left(
    flight: Flight, vehicle: Flown, seconds: float
) -> None:
    """It was entered just before PX4 asked, or a pilot lets the vehicle change in it."""
    await up(flight, vehicle, Hovers, 20.0)
    if not seconds:
        await flight.set_mode(Hovers)
    vehicle.world.command(VTOL_TRANSITION, [4.0, 0.0, *[0.0] * 5])
    if seconds:
        await asyncio.sleep(seconds)
        vehicle.choose(EXTERNAL)
    await vehicle.until(lambda: vehicle.world.mode != EXTERNAL, 1.5)
    await asyncio.sleep(0.3)
    left = vehicle.time / 1e6
    await asyncio.sleep(2.0)
    assert not [each for each in vehicle.times(GOTO.topic) if each > left]


def test_what_a_vtol_does_not_follow_now_is_an_error(px4_types: Any) -> None:
    errors: list[str] = []

    class Tries(Vtol):
        async def fly(self) -> None:
            self._try(lambda: self.fixed_wing(course_deg=0.0))
            going = asyncio.ensure_future(self.to_fixed_wing())
            await vehicle_.until(lambda: vehicle_.world.vtol_state == VtolState.TO_FORWARD, 3.0)
            await asyncio.sleep(0.5)
            self._try(lambda: self.trajectory(velocity=(1.0, 0.0, 0.0)))
            with pytest.raises(FlightError, match="wait for the end, as `await self"):
                await self.goto((100.0, 0.0, -20.0))
            await going
            self._try(lambda: self.trajectory(velocity=(1.0, 0.0, 0.0)))
            for name in ("heading", "max_speed", "max_climb"):
                with pytest.raises(UnsupportedError, match=f"takes no {name} in forward flight: it takes airspeed"):
                    await self.goto((100.0, 0.0, -20.0), **{name: 1.0})

        def _try(self, call: Any) -> None:
            with pytest.raises(FlightError) as caught:
                call()
            errors.append(str(caught.value))

    vehicle_: Any = None

    async def program(flight: Flight, vehicle: Flown) -> None:
        nonlocal vehicle_
        vehicle_ = vehicle
        await up(flight, vehicle, Tries, 20.0)
        await flight.fly(Tries)

    fly(px4_types, program, VTOL)
    hovers, between, flies = errors
    assert hovers == (
        "mode 'Tries': the VTOL hovers now, and does not follow fixed-wing setpoints: "
        "`await self.to_fixed_wing()` before"
    )
    assert between.startswith("mode 'Tries': the VTOL changes between hovering and forward flight: wait for the end")
    assert flies.endswith("does not follow trajectory setpoints: `await self.to_multicopter()` before")


@flying(VTOL)
async def test_a_cancelled_change_is_completed_and_then_the_mode_holds(flight: Flight, vehicle: Flown) -> None:
    class Cancels(Vtol):
        async def fly(self) -> None:
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(self.to_fixed_wing(), 1.0)
            await asyncio.sleep(4.0)

    await up(flight, vehicle, Cancels, 20.0)
    await flight.fly(Cancels)
    assert state(vehicle) == VtolState.FORWARD
    here = vehicle.world.flight.position
    await asyncio.sleep(15.0)
    assert math.dist(vehicle.world.flight.position[:2], here[:2]) < 180.0
    assert abs(vehicle.world.flight.position[2] - here[2]) < 5.0
