"""Tests of modes in Python: they are registered, flown, completed and left, with the types of every release."""

from __future__ import annotations

import asyncio
import logging
import math
from typing import Any

import pytest

from msggen.flight.checks import LOCAL_POSITION, Requirement
from msggen.flight.errors import NoAnswerError, RefusedError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.places import Vector
from msggen.generate.cache import package_of
from msggen.sim import Options
from msggen.sim.near import NearVehicle
from support.flown import EXTERNAL, Flown, fly, flying

HOLD, RETURN, LAND = 4, 5, 18


class Square(Mode, name="Square"):
    """Flies a square, and keeps where it was."""

    requires = LOCAL_POSITION

    def __init__(self) -> None:
        self.corners: list[Vector] = []
        self.ends: list[str] = []

    async def fly(self) -> None:
        try:
            begin = await self.position()
            for x, y in ((5.0, 0.0), (5.0, 5.0), (0.0, 0.0)):
                await self.goto(begin.shifted(x, y))
                self.corners.append(await self.position())
        except asyncio.CancelledError:
            self.ends.append("cancelled")
            raise
        self.ends.append("returned")


class Waits(Mode, name="Waits"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.goto((50.0, 0.0, -10.0))


# every release


def test_a_mode_flies_its_places_and_is_completed(types: Any) -> None:
    mode = Square()

    async def program(flight: Flight, vehicle: Flown) -> list[tuple[str, int]]:
        await vehicle.in_mode(flight, mode)
        completed = await flight.feeds["mode_completed"].following(lambda each: each.nav_state == EXTERNAL)
        assert completed.result == 0
        place = vehicle.world.flight.position
        await asyncio.sleep(3.0)
        assert vehicle.world.mode == EXTERNAL
        assert math.dist(place, vehicle.world.flight.position) < 0.6  # it holds
        return [(each.topic, each.message.source_id) for each in vehicle.sent if each.topic.endswith(("config", "s"))]

    configured = fly(types, program)
    expected = "setpoint_config" if hasattr(types, "SetpointConfig") else "config_control_setpoints"
    assert (expected, EXTERNAL) in configured
    assert mode.ends == ["returned"]
    goals = [(5.0, 0.0), (5.0, 5.0), (0.0, 0.0)]
    assert all(math.dist(there[:2], goal) < 0.6 for there, goal in zip(mode.corners, goals, strict=True))


def test_a_mode_that_is_left_is_cancelled_and_sends_nothing_more(types: Any) -> None:
    mode = Square()

    async def program(flight: Flight, vehicle: Flown) -> float:
        await vehicle.in_mode(flight, mode)
        await asyncio.sleep(1.0)
        await flight.land()
        shown = next(each.time for each in vehicle.sent[::-1] if each.topic == "goto_setpoint")
        left = vehicle.world.commander.mode_time / 1e6
        return shown - left

    assert fly(types, program) < 0.3  # vehicle_status comes at 5 Hz
    assert mode.ends == ["cancelled"]


# requirements and failures


@flying()
async def test_a_mode_without_a_position_is_refused_with_the_reason(flight: Flight, vehicle: Flown) -> None:
    class Careful(Mode):
        requires = LOCAL_POSITION

        async def fly(self) -> None:
            await self.hold(1000.0)

    await flight.add(Careful)
    await vehicle.in_air(flight)
    vehicle.lose_position()
    await asyncio.sleep(6.0)
    with pytest.raises(RefusedError, match="mode 23: temporarily rejected: there is no local position"):
        await flight.set_mode(EXTERNAL)


def test_an_exception_ends_the_mode_and_the_vehicle_returns(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    class Fails(Mode):
        async def fly(self) -> None:
            await self.hold(0.5)
            raise RuntimeError("no target")

    async def program(flight: Flight, vehicle: Flown) -> float:
        await vehicle.in_mode(flight, Fails)
        completed = await flight.feeds["mode_completed"].following(lambda each: each.nav_state == EXTERNAL)
        assert completed.result == 100
        taken = await vehicle.until(lambda: vehicle.world.mode == RETURN, 2.0)
        await flight.set_mode("hold")
        await asyncio.sleep(1.0)
        await flight.set_mode(EXTERNAL)  # a user can try again
        return taken

    with caplog.at_level(logging.ERROR):
        assert fly(px4_types, program) < 0.6
    assert "mode 'Fails' has failed" in caplog.text
    assert "no target" in caplog.text


# registration


def test_a_firmware_without_modes_is_told() -> None:
    async def program(flight: Flight, _: Flown) -> None:
        await flight.add(Square)

    with pytest.raises(UnsupportedError, match=r"v1\.15 or later"):
        fly(package_of("v1.14"), program)


def test_a_vehicle_that_is_silent_is_told(px4_types: Any) -> None:
    class Silent(NearVehicle):
        def advance(self, now: int) -> None:
            self.time = now

    async def main(vehicle: Silent) -> None:
        async with Flight(vehicle):
            pass

    from msggen.sim.loop import run

    vehicle = Silent(px4_types)
    with pytest.raises(NoAnswerError, match="no vehicle_status within 5 s"):
        run(main(vehicle), vehicle)


@flying()
async def test_nothing_arms_by_itself(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Square, Waits)
    await flight.set_mode(EXTERNAL)
    await asyncio.sleep(20.0)
    assert not vehicle.world.is_armed
    assert not [each for each in vehicle.sent if getattr(each.message, "command", 0) == 400]


def test_requirements_are_fields_of_the_reply(px4_types: Any) -> None:
    names = {field.name for field in px4_types.ArmingCheckReply.__msg__.fields}
    assert {name for each in Requirement for name in each.fields} <= names


@pytest.mark.parametrize("parameters", [{}, {"COM_MODE_ARM_CHK": 1.0}])
def test_a_mode_is_unregistered_in_flight_only_if_px4_lets_it(px4_types: Any, parameters: dict[str, float]) -> None:
    async def program(flight: Flight, vehicle: Flown) -> int:
        await vehicle.in_mode(flight, Waits)
        await asyncio.sleep(1.0)
        flight.close()
        await asyncio.sleep(2.0)
        assert vehicle.world.mode == RETURN
        return len(vehicle.world.commander.components.modes)

    assert fly(px4_types, program, Options(parameters=parameters)) == (0 if parameters else 1)
