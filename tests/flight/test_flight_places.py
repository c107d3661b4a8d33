"""Tests of places on earth, and of a vehicle on the ground."""

from __future__ import annotations

import asyncio
import math
import re
from typing import Any

import pytest

from msggen.flight import GLOBAL_POSITION, FlightError, GlobalPlace, LimitError, Limits, NoAnswerError, NotReachedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import ATTITUDE, TRAJECTORY
from support.flown import Flown, chosen, fly, flying, flying_each

NORTH = 0.0002
"""A difference of latitude in degrees: 22.24 m."""
FAR = 22.24
GOTO = "goto_setpoint"


def away(vehicle: Flown, up: float = 10.0) -> GlobalPlace:
    """Return a place that is 22 m north of home."""
    home = vehicle.world.home
    return GlobalPlace(home.latitude + NORTH, home.longitude, home.altitude + up)


class Visits(Mode, name="Visits"):
    """Flies to a place."""

    requires = GLOBAL_POSITION
    frame = "enu"

    def __init__(self, place: Any) -> None:
        self.place = place

    async def fly(self) -> None:
        await self.goto(self.place, max_speed=4.0)


@flying_each()
async def test_a_mode_flies_to_a_place_on_earth_in_each_frame(flight: Flight, vehicle: Flown) -> None:
    mode = Visits(away(vehicle))
    await flight.add(mode)
    await vehicle.in_air(flight)
    await flight.fly(mode)
    sent = [each.message for each in vehicle.sent if each.topic == GOTO]
    assert sent[0].position == pytest.approx((FAR, 0.0, -10.0), abs=0.01)
    assert vehicle.world.flight.position == pytest.approx((FAR, 0.0, -10.0), abs=0.6)


@flying_each()
async def test_offboard_flies_to_a_place_on_earth(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard("enu") as setpoint:
        await setpoint.goto(away(vehicle))
    assert vehicle.world.flight.position == pytest.approx((FAR, 0.0, -10.0), abs=0.6)


@flying_each()
async def test_a_place_on_earth_needs_a_global_position(flight: Flight, vehicle: Flown) -> None:
    class Tries(Visits, name="Tries"):
        requires = Mode.requires

        async def fly(self) -> None:
            with pytest.raises(NoAnswerError, match="where on earth it is"):
                await self.goto(self.place)

    mode = Tries(away(vehicle))
    await flight.add(mode)
    await vehicle.in_air(flight)
    vehicle.lose_position()
    await asyncio.sleep(0.1)
    with pytest.raises(NoAnswerError, match="where on earth it is"):
        await flight.find(mode).mode.goto(mode.place)
    assert not [each for each in vehicle.sent if each.topic == GOTO]


@flying(limits=Limits(distance=20.0))
async def test_limits_count_for_a_place_on_earth(flight: Flight, vehicle: Flown) -> None:
    errors = []

    class Limited(Visits, name="Limited"):
        async def fly(self) -> None:
            try:
                await super().fly()
            except LimitError as error:
                errors.append(str(error))

    mode = Limited(away(vehicle))
    await flight.add(mode)
    await vehicle.in_air(flight)
    await flight.fly(mode)
    for up in (None, 10.0):
        place = away(vehicle, up or 0.0)
        altitude = place.altitude if up else None
        with pytest.raises(LimitError, match=r"22\.2 m from home"):
            await flight.goto(latitude=place.latitude, longitude=place.longitude, altitude=altitude)
    assert errors == ["22.2 m from home: the limit is 20 m, and nothing was sent"]


@pytest.mark.parametrize("place", [(91.0, 0.0, 0.0), (0.0, -181.0, 0.0), (math.nan, 0.0, 0.0), (0.0, 0.0, math.inf)])
def test_what_is_no_place_on_earth_is_an_error(place: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"expected a latitude from -90 to 90|expected finite numbers for a place"):
        GlobalPlace(*place)


@flying_each()
async def test_goto_on_the_ground_is_an_error_before_anything_is_sent(flight: Flight, vehicle: Flown) -> None:
    mode = Visits((0.0, 5.0, 5.0))
    await flight.add(mode)
    with pytest.raises(FlightError, match="the vehicle is on the ground: take off first"):
        await flight.goto(away(vehicle))
    await flight.set_mode(mode)
    await flight.arm()
    with pytest.raises(NotReachedError, match="goto does not lift a vehicle off the ground: take off first"):
        await flight.fly(mode)
    assert not [each for each in vehicle.sent if each.topic == "vehicle_command" and each.message.command == 192]


@pytest.mark.parametrize("has_lifted", [False, True])
@flying_each()
async def test_a_trajectory_on_the_ground_is_an_error(flight: Flight, *, has_lifted: bool) -> None:
    """PX4 does not lift by it."""

    class Climbs(Mode, name="Climbs"):
        setpoints = (TRAJECTORY, ATTITUDE)

        async def fly(self) -> None:
            if has_lifted:
                self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.9)
                await asyncio.sleep(1.5)
            for _ in range(3):
                self.trajectory(velocity=(0.0, 0.0, -1.0))
                await asyncio.sleep(0.5)

    await chosen(flight, Climbs)
    await flight.arm()
    if has_lifted:
        await flight.fly(Climbs)
        return
    with pytest.raises(NotReachedError, match="mode 'Climbs' is on the ground, and trajectory does not lift"):
        await flight.fly(Climbs)


@flying()
async def test_a_place_below_home_is_refused(flight: Flight, vehicle: Flown) -> None:
    mode = Visits((5.0, 0.0, -5.0))
    await flight.add(mode)
    await vehicle.in_air(flight)
    with pytest.raises(LimitError, match=r"^5\.0 m below home, and nothing was sent: z points down in NED"):
        await flight.fly(mode)
    mode.place = GlobalPlace(vehicle.world.home.latitude, vehicle.world.home.longitude, 8.0)
    with pytest.raises(LimitError, match=r"^480\.0 m below home"):
        await flight.fly(mode)


def test_a_link_that_is_lost_is_not_told_as_a_lost_position(px4_types: Any) -> None:
    errors = []

    class Asks(Mode, name="Asks"):
        async def fly(self) -> None:
            while True:
                await asyncio.sleep(0.1)
                try:
                    await self.position()
                except NoAnswerError as error:
                    errors.append(str(error))
                    return

    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_mode(flight, Asks)
        await asyncio.sleep(1.0)
        vehicle.loss = 1.0
        await vehicle.until(lambda: bool(errors), 5.0)
        vehicle.loss = 0.0

    fly(px4_types, program)
    assert re.fullmatch(r"no vehicle_local_position for 1\.\d s: is the link lost\?", errors[0])


@flying()
async def test_offboard_tells_where_the_vehicle_is(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    async with flight.offboard("enu") as setpoint:
        await setpoint.goto((3.0, 2.0, 9.0))
        assert await setpoint.position() == pytest.approx((3.0, 2.0, 9.0), abs=0.6)
    vehicle.lose_position()
    await asyncio.sleep(0.2)
    with pytest.raises(NoAnswerError, match="needs GPS"):
        await setpoint.position()


@pytest.mark.parametrize("place", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0)])
@flying()
async def test_a_place_has_three_numbers(flight: Flight, vehicle: Flown, place: tuple[float, ...]) -> None:
    mode = Visits(place)
    await flight.add(mode)
    await vehicle.in_air(flight)
    with pytest.raises(ValueError, match="expected three numbers, got"):
        await flight.fly(mode)
