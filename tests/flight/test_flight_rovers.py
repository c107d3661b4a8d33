"""Tests of rovers: speeds, throttles and directions, places, limits, and stopping."""

from __future__ import annotations

import asyncio
import math
import re
from typing import Any

import pytest

from msggen.flight.errors import LimitError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.limits import Limits
from msggen.flight.mode import Mode
from msggen.messages.nav_states import HOLD
from msggen.messages.setpoints import ROVER, ROVER_POSITION, ROVER_THROTTLE, Kind
from msggen.sim import Options
from support.flown import EXTERNAL, Flown, fly, flying

WHEELS = Options(vehicle="rover")
SPEED, THROTTLE = ROVER[1].topics[0], ROVER_THROTTLE[0].topics[0]
KINDS = {kind.number: kind for kind in (*ROVER, *ROVER_THROTTLE)}


class Drives(Mode, name="Drives"):
    """Drives as it is told, for 2 s each."""

    setpoints = (*ROVER, *ROVER_THROTTLE)

    def __init__(self, *ways: dict[str, float], seconds: float = 2.0) -> None:
        self.ways, self.seconds = ways, seconds

    async def fly(self) -> None:
        for way in self.ways:
            self.rover(**way)
            await asyncio.sleep(self.seconds)


async def drive(flight: Flight, mode: Mode) -> None:
    """Arm, and let a mode drive."""
    await flight.add(mode)
    await flight.arm()
    await flight.fly(mode)


@pytest.mark.parametrize(
    ("way", "number", "values"),
    [
        ({"speed": 1.5, "heading": 8.0}, 8, (1.5, 8.0 - math.tau)),
        ({"speed": -1.0, "heading_deg": 90.0}, 8, (-1.0, math.pi / 2)),
        ({"speed": 1.5, "turn_rate": 0.4}, 9, (1.5, 0.4)),
        ({"speed": 1.5, "steering": -0.5}, 10, (1.5, -0.5)),
        ({"throttle": 0.3, "heading": 0.0}, 11, (0.3, 0.0)),
        ({"throttle": -0.3, "turn_rate": 0.0}, 12, (-0.3, 0.0)),
        ({"throttle": 0.3, "steering": 1.0}, 13, (0.3, 1.0)),
    ],
)
def test_the_keywords_tell_the_kind(px4_types: Any, way: dict[str, float], number: int, values: Any) -> None:
    sent: list[tuple[Kind, dict[str, Any]]] = []

    class Own:
        def send_each(self, kind: Kind, given: Any) -> None:
            sent.append(
                (kind, {topic: px4_types.topics.endpoint(f"/fmu/in/{topic}") and each for topic, each in given.items()})
            )

    mode = Drives()
    mode._active = Own()  # type: ignore[assignment]
    mode.rover(**way)
    ((kind, messages),) = sent
    assert kind == KINDS[number]
    found = [next(iter(messages[topic].values())) for topic in kind.topics]
    assert found == pytest.approx(list(values))
    mode.frame = "enu"  # type: ignore[misc]
    mode.rover(**way)
    turned = next(iter(sent[1][1][kind.topics[1]].values()))
    if "turn_rate" in way:
        assert turned == -values[1]
    elif "steering" in way:
        assert turned == values[1]
    else:
        assert math.cos(turned - (math.pi / 2 - values[1])) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("way", "text"),
    [
        ({}, "expected a speed or a throttle, and a heading, a turn_rate or a steering, got none of them"),
        ({"speed": 1.0}, "got speed"),
        ({"speed": 1.0, "throttle": 0.1, "heading": 0.0}, "got speed, throttle, heading"),
        ({"speed": 1.0, "heading": 0.0, "steering": 0.0}, "got speed, heading, steering"),
        ({"speed": 1.0, "heading": 0.0, "heading_deg": 0.0}, "heading or heading_deg, got both"),
        ({"throttle": 1.1, "heading": 0.0}, "expected a throttle from -1 to 1, got 1.1"),
        ({"speed": 1.0, "steering": -1.1}, "expected a steering from -1 to 1, got -1.1"),
        ({"speed": 1.0, "heading": math.inf}, "expected finite numbers for a heading, got (inf,)"),
        ({"speed": 1.0, "heading_deg": math.nan}, "expected finite numbers for a heading, got (nan,)"),
        ({"speed": math.nan, "heading": 0.0}, "expected finite numbers for `speed` and `heading`"),
        ({"speed": 1.0, "turn_rate": math.inf}, "expected finite numbers for `speed` and `turn_rate`"),
        ({"throttle": math.nan, "heading": 0.0}, "expected finite numbers"),
    ],
)
@flying(WHEELS)
async def test_wrong_values_are_errors_before_anything_is_sent(
    flight: Flight, vehicle: Flown, way: dict[str, float], text: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        await drive(flight, Drives(way))
    assert not vehicle.times(THROTTLE)
    assert all(each.message.speed_body_x == 0.0 for each in vehicle.sent if each.topic == SPEED)


@pytest.mark.parametrize("turn", [{"heading_deg": 90.0}, {"turn_rate": 0.0}, {"steering": 0.0}], ids=str)
@pytest.mark.parametrize("kind", ["rover", "differential"])
def test_a_throttle_does_not_fight_the_speed_of_before(px4_types: Any, kind: str, turn: dict[str, float]) -> None:
    """PX4 goes on with a speed setpoint until one without a number comes, as no flag changes."""

    async def program(flight: Flight, vehicle: Flown) -> None:
        mode = Drives({"speed": 2.0, **turn}, {"throttle": 0.2, **turn}, seconds=4.0)
        driving = asyncio.ensure_future(drive(flight, mode))
        await vehicle.until(lambda: bool(vehicle.times(THROTTLE)), 10.0)
        await asyncio.sleep(3.5)
        assert math.hypot(*vehicle.world.flight.velocity) == pytest.approx(0.2 * 3.2, abs=0.1)
        await driving
        await asyncio.sleep(2.0)
        assert math.hypot(*vehicle.world.flight.velocity) < 0.05  # it stops at the end
        begin = vehicle.times(THROTTLE)[0]
        speeds = [each for each in vehicle.sent if each.topic == SPEED]
        last = vehicle.times(THROTTLE)[-1]
        assert all(each.message.speed_body_x == 2.0 for each in speeds if 3.0 < each.time < begin)
        assert all(math.isnan(each.message.speed_body_x) for each in speeds if begin < each.time < last)

    fly(px4_types, program, Options(vehicle=kind))


@pytest.mark.parametrize("kind", ["rover", "differential"])
def test_goto_drives_it_to_a_place_where_it_stands(types: Any, kind: str) -> None:
    class Goes(Mode):
        setpoints = (ROVER_POSITION,)

        async def fly(self) -> None:
            for place in ((15.0, 0.0, 0.0), (15.0, 10.0, 0.0)):
                await self.goto(place, max_speed=2.0)
                assert math.dist((await self.position())[:2], place[:2]) < 1.0
            with pytest.raises(UnsupportedError, match="goto of a rover takes no airspeed here: it takes max_speed"):
                await self.goto((0.0, 0.0, 0.0), airspeed=10.0)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await drive(flight, Goes())
        await asyncio.sleep(2.0)
        assert math.hypot(*vehicle.world.flight.velocity) < 0.05
        cruising = {each.message.cruising_speed for each in vehicle.sent if each.topic == ROVER_POSITION.topic}
        assert 2.0 in cruising

    if any(each.uorb_topic == SPEED for each in types.topics.ENDPOINTS):
        fly(types, program, Options(vehicle=kind))


@pytest.mark.parametrize("kinds", [ROVER, (ROVER_POSITION,), ROVER[3:], ROVER_THROTTLE, (ROVER[1],)], ids=len)
@flying(WHEELS)
async def test_it_stops_by_what_the_mode_declares(flight: Flight, vehicle: Flown, kinds: tuple[Kind, ...]) -> None:
    class Stops(Mode):
        setpoints = (*kinds, ROVER_THROTTLE[2])

        async def fly(self) -> None:
            self.rover(throttle=0.5, steering=0.0)
            await asyncio.sleep(3.0)
            await self.hold(10.0)

    await drive(flight, Stops())
    assert math.hypot(*vehicle.world.flight.velocity) < 0.3


@flying(WHEELS)
async def test_it_stops_before_it_lands(flight: Flight, vehicle: Flown) -> None:
    """PX4 counts a rover in Land as landed while it drives on."""
    await flight.add(Drives({"speed": 3.0, "heading": 0.0}, seconds=1000.0))
    await flight.arm()
    await flight.set_mode(EXTERNAL)
    await asyncio.sleep(3.0)
    assert math.hypot(*vehicle.world.flight.velocity) > 2.5
    modes: list[int] = []
    flight.feeds["vehicle_status"].call(lambda each: modes.append(each.nav_state))
    await flight.land()
    assert math.hypot(*vehicle.world.flight.velocity) < 0.1
    assert HOLD in modes
    await flight.wait_disarmed()


@flying(WHEELS)
async def test_limits_stop_it(flight: Flight) -> None:
    class Away(Mode):
        setpoints = ROVER
        limits = Limits(distance=15.0, height=1.0)

        async def fly(self) -> None:
            with pytest.raises(LimitError, match=r"20\.0 m from home"):
                await self.goto((20.0, 0.0, 0.0))
            self.rover(speed=2.0, heading=0.0)
            await asyncio.sleep(30.0)
            assert (await self.position()).x == pytest.approx(15.0, abs=0.3)
            self.rover(speed=-2.0, heading=0.0)
            await asyncio.sleep(3.0)
            assert (await self.position()).x < 12.0

    class Throttled(Drives):
        limits = Limits(distance=15.0)

    with pytest.raises(UnsupportedError, match="limits cannot be enforced for rover throttle and attitude"):
        await flight.add(Throttled())
    await drive(flight, Away())


@pytest.mark.parametrize("up", [99.0, -488.0, 2e4])
@flying(WHEELS)
async def test_the_flight_itself_drives_to_a_place_at_any_altitude(flight: Flight, vehicle: Flown, up: float) -> None:
    home = vehicle.world.home
    await flight.arm()
    await flight.goto(latitude=home.latitude + 1e-4, longitude=home.longitude, altitude=home.altitude + up)
    x, y, _ = vehicle.world.flight.position
    assert math.dist((x, y), (11.1, 0.0)) < 1.1
    await flight.land()
