"""Tests of planes: courses and altitudes, places, circles, limits, and what is sent with them."""

from __future__ import annotations

import asyncio
import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.flight.braking import RADIUS
from msggen.flight.errors import FlightError, LimitError, NotReachedError, UnsupportedError
from msggen.flight.feeds import Topics
from msggen.flight.flight import Flight
from msggen.flight.limits import Limits
from msggen.flight.mode import Mode
from msggen.flight.places import GlobalPlace
from msggen.flight.setpoints import Ranges
from msggen.messages.nav_states import RETURN
from msggen.messages.setpoints import ATTITUDE, FIXED_WING, RATES
from msggen.sim import Options
from support.examples import by_day
from support.flown import EXTERNAL, Flown, fly, flying, flying_each, up

PLANE = Options(vehicle="plane")
LATERAL, LONGITUDINAL, *CONFIGURATIONS = FIXED_WING.topics
NAN = math.nan


class Glides(Mode):
    """A mode of a plane."""

    setpoints = (FIXED_WING,)


def sent(call: Any, frame: str = "ned") -> tuple[Any, Any]:
    """Return the messages of a setpoint."""

    mode = Glides()
    mode.frame = frame  # type: ignore[misc, assignment]
    values: dict[str, Any] = {}

    class Own:
        def send_each(self, _: Any, given: Any) -> None:
            Ranges().check(given)
            values.update({topic: dict(each) for topic, each in given.items()})

    mode._active = Own()  # type: ignore[assignment]
    call(mode)
    assert values.keys() == {*FIXED_WING.topics}
    return values[LATERAL], values[LONGITUDINAL]


@given(st.floats(-10.0, 10.0), st.sampled_from(["ned", "enu"]))
def test_a_course_is_an_angle_of_the_frame(angle: float, frame: str) -> None:
    lateral, longitudinal = sent(lambda mode: mode.fixed_wing(course=angle), frame)
    wanted = angle if frame == "ned" else math.pi / 2 - angle
    assert math.cos(lateral["course"] - wanted) == pytest.approx(1.0)
    assert abs(lateral["course"]) <= math.pi
    assert sent(lambda mode: mode.fixed_wing(course_deg=math.degrees(angle)), frame)[0]["course"] == (
        pytest.approx(lateral["course"])
    )
    direction = sent(lambda mode: mode.fixed_wing(airspeed_direction=angle), frame)[0]
    assert direction["airspeed_direction"] == pytest.approx(lateral["course"])
    assert math.isnan(direction["course"])
    assert longitudinal["height_rate"] == 0.0  # the height is kept, if nothing else is said
    assert math.isnan(longitudinal["altitude"])


def test_what_is_not_given_is_left_to_px4() -> None:
    lateral, longitudinal = sent(lambda mode: mode.fixed_wing(lateral_acceleration=2.0, altitude=500.0))
    assert math.isnan(lateral["course"])
    assert math.isnan(lateral["airspeed_direction"])
    assert lateral["lateral_acceleration"] == 2.0
    assert longitudinal.pop("altitude") == 500.0
    assert all(map(math.isnan, longitudinal.values()))
    _, longitudinal = sent(lambda mode: mode.fixed_wing(course=0.0, airspeed=14.0, throttle=0.4))
    assert (longitudinal["equivalent_airspeed"], longitudinal["throttle_direct"]) == (14.0, 0.4)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({}, "expected a course, an airspeed_direction or a lateral_acceleration"),
        ({"altitude": 500.0}, "0.0 is straight on"),
        ({"course": 0.0, "course_deg": 0.0}, "expected course or course_deg, got both"),
        ({"course": 0.0, "airspeed_direction": 0.0}, "got both: PX4 would ignore the course"),
        ({"course": 0.0, "altitude": 1.0, "height_rate": 0.0}, "got both: PX4 would ignore the altitude"),
        ({"course": 0.0, "airspeed": 0.0}, "expected an airspeed from 0.5 to 100 m/s, got 0, and nothing was sent"),
        ({"course": 0.0, "airspeed": -3.0}, "says what the vehicle has as FW_AIRSPD_MIN and FW_AIRSPD_MAX"),
        ({"course": 0.0, "airspeed": 101.0}, "from 0.5 to 100 m/s, got 101"),
        ({"course": 0.0, "height_rate": 100.0}, "expected a height rate from -15 to 15 m/s, got 100"),
        ({"course": 0.0, "height_rate": -100.0}, "from -15 to 15 m/s, got -100"),
        ({"lateral_acceleration": 1000.0}, "expected a lateral acceleration from -36.6114 to 36.6114 m/s^2, got 1000"),
        ({"course": 0.0, "throttle": 1.5}, "expected a throttle from 0 to 1, got 1.5"),
        *(
            ({"course": 0.0} | {name: value}, f"finite numbers for `{name.removesuffix('_deg')}`")
            for name in ("course", "lateral_acceleration", "altitude", "height_rate", "airspeed", "throttle")
            for value in (NAN, math.inf, 1e39)
        ),
    ],
)
def test_wrong_values_are_errors_before_anything_is_sent(options: Any, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        sent(lambda mode: mode.fixed_wing(**options))


def test_the_right_name_is_told() -> None:
    for wrong, right in (("equivalent_airspeed", "`airspeed`"), ("coarse", "course"), ("yaw", "it takes course")):
        with pytest.raises(TypeError, match=right):
            sent(lambda mode, wrong=wrong: mode.fixed_wing(**{wrong: 1.0}))


def test_both_configurations_are_sent_at_each_activation_and_each_second(types: Any) -> None:
    class Straight(Glides):
        async def fly(self) -> None:
            self.fixed_wing(course_deg=90.0)
            await asyncio.sleep(1000.0)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await up(flight, vehicle, Straight)
        for _ in range(2):
            begin = vehicle.time / 1e6
            await flight.set_mode(EXTERNAL)
            await asyncio.sleep(3.5)
            for topic in CONFIGURATIONS:
                found = [each.message for each in vehicle.sent if each.topic == topic and each.time > begin]
                times = [time for time in vehicle.times(topic) if time > begin]
                assert 4 <= len(times) <= 5
                assert times[0] < begin + 0.3
                values = {value for each in found for name, value in vars_of(each).items() if name != "timestamp"}
                assert all(math.isnan(value) for value in values if not isinstance(value, bool))
            await flight.hold()
            await asyncio.sleep(0.5)

    if any(each.uorb_topic == LATERAL for each in types.topics.ENDPOINTS):
        fly(types, program, PLANE)


def vars_of(message: Any) -> dict[str, Any]:
    """Return the fields of a message."""
    return {field.name: getattr(message, field.name) for field in message.__msg__.fields}


@flying(PLANE)
async def test_it_flies_a_course_an_altitude_and_an_airspeed(flight: Flight, vehicle: Flown) -> None:
    class Course(Glides):
        async def fly(self) -> None:
            here = await self.position()
            self.fixed_wing(course_deg=90.0, altitude=vehicle.world.origin.altitude - here.z + 20.0, airspeed=18.0)
            await asyncio.sleep(30.0)
            velocity = await self.velocity()
            assert math.degrees(math.atan2(velocity.y, velocity.x)) == pytest.approx(90.0, abs=2.0)
            assert (await self.position()).z == pytest.approx(here.z - 20.0, abs=2.0)
            assert velocity.y > 16.0
            self.fixed_wing(lateral_acceleration=3.0, height_rate=2.0)
            await asyncio.sleep(5.0)
            assert (await self.velocity()).z == pytest.approx(-2.0, abs=0.3)

    await up(flight, vehicle, Course)
    await flight.fly(Course)


class Visits(Glides, name="Visits"):
    """Flies to places."""

    def __init__(self, *places: Any, **options: Any) -> None:
        self.places, self.options = places, options
        self.distances: list[float] = []

    async def fly(self) -> None:
        for place in self.places:
            await self.goto(place, **self.options)
            self.distances.append(math.dist((await self.position())[:2], place[:2]))


@flying(PLANE)
async def test_goto_guides_it_over_places_and_around_the_last_one(flight: Flight, vehicle: Flown) -> None:
    visits = Visits((200.0, 0.0, -30.0), (200.0, 150.0, -35.0), within=15.0)

    await up(flight, vehicle, visits)
    await flight.fly(visits)
    await asyncio.sleep(25.0)
    x, y, z = vehicle.world.flight.position
    assert math.hypot(x - 200.0, y - 150.0) == pytest.approx(RADIUS, abs=8.0)
    assert z == pytest.approx(-35.0, abs=2.0)
    assert vehicle.world.mode == EXTERNAL
    assert max(visits.distances) < 15.0 + 2.0


@by_day(
    ("ahead", "side"),
    [(5.0, -5.0), (0.0, 30.0), (0.0, -30.0), (25.0, -30.0), (-25.0, 30.0), (-25.0, 5.0), (5.0, 5.0)],
    6,
)
@flying(PLANE)
async def test_a_place_inside_its_turn_is_reached(flight: Flight, vehicle: Flown, ahead: float, side: float) -> None:
    """An aircraft that turns to a place at its side as hard as it can flies around it for ever."""

    class Near(Glides):
        async def fly(self) -> None:
            self.fixed_wing(course_deg=0.0)
            await asyncio.sleep(10.0)
            here = await self.position()
            await asyncio.wait_for(self.goto(here.shifted(ahead, side), within=5.0), 60.0)

    await up(flight, vehicle, Near)
    await flight.fly(Near)


@flying(PLANE)
async def test_goto_takes_what_a_plane_can_do(flight: Flight, vehicle: Flown) -> None:
    mode = Visits((100.0, 0.0, -40.0), heading_deg=90.0)
    await up(flight, vehicle, mode)
    for options, text in (
        ({"heading_deg": 90.0}, "goto of a fixed-wing aircraft takes no heading here: it takes airspeed, within"),
        ({"max_speed": 9.0}, "takes no max_speed"),
    ):
        mode.options = options
        with pytest.raises(UnsupportedError, match=text):
            await flight.fly(mode)
    for wrong in ({"airspeed": 0.0}, {"within": 0.0}, {"airspeed": NAN}):
        mode.options = wrong
        with pytest.raises(ValueError, match="expected"):
            await flight.fly(mode)
    mode.options, mode.places = {}, ((100.0, 0.0, 20.0),)
    with pytest.raises(LimitError, match=r"20\.0 m below home"):
        await flight.fly(mode)


@flying(PLANE)
async def test_goto_on_the_ground_is_an_error(flight: Flight, vehicle: Flown) -> None:
    mode = Visits((100.0, 0.0, -40.0))
    await flight.add(mode)
    await flight.arm()
    with pytest.raises(NotReachedError, match="is on the ground, and goto does not lift"):
        await flight.fly(mode)
    assert not vehicle.times(LATERAL)  # so that the propeller stands


def test_a_course_on_the_ground_is_an_error(types: Any) -> None:
    class Forgets(Glides):
        async def fly(self) -> None:
            self.fixed_wing(course_deg=0.0, height_rate=2.0)
            await asyncio.sleep(100.0)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Forgets)
        await flight.arm()
        with pytest.raises(NotReachedError, match=r"fixed-wing does not lift .*`await flight.takeoff\("):
            await flight.fly(Forgets)
        assert not vehicle.times(LATERAL)

    if Topics(types).takes(FIXED_WING):
        fly(types, program, PLANE)


@pytest.mark.parametrize("mode", ["hold", "land", "return"])
@flying_each(PLANE)
async def test_a_plane_that_has_not_taken_off_is_told(flight: Flight, vehicle: Flown, mode: str) -> None:
    """PX4 disarms other vehicles then, and a plane never."""
    await flight.arm()
    await flight.set_mode(mode)
    begin = vehicle.time
    with pytest.raises(FlightError, match=r"has not taken off.*`await flight.takeoff\(30.0\)` before, or `await"):
        await asyncio.wait_for(flight.wait_disarmed(), 60.0)
    assert vehicle.time - begin < 15e6
    disarmed = asyncio.ensure_future(flight.wait_disarmed())
    await asyncio.sleep(9.0)
    await flight.disarm()
    await disarmed


@flying_each(PLANE)
async def test_a_plane_that_returns_circles(flight: Flight, vehicle: Flown, caplog: pytest.LogCaptureFixture) -> None:
    await flight.arm()
    await flight.takeoff(30.0)
    home = vehicle.world.home
    await flight.goto(latitude=home.latitude + 0.003, longitude=home.longitude, altitude=home.altitude + 40.0)
    await asyncio.wait_for(flight.return_home(), 300.0)
    assert vehicle.world.mode == 5
    assert math.hypot(*vehicle.world.flight.position[:2]) < 110.0
    await flight.land()
    await flight.wait_disarmed()
    assert (
        "the return has ended in a circle, and PX4 does not land the plane: `await flight.land()` does" in caplog.text
    )


@flying(PLANE)
async def test_it_circles_until_the_first_setpoint_and_when_it_holds(flight: Flight, vehicle: Flown) -> None:
    class Waits(Glides):
        async def fly(self) -> None:
            await asyncio.sleep(10.0)
            await self.hold(10.0)
            raise ValueError("it is enough")

    await up(flight, vehicle, Waits)
    await asyncio.sleep(1.0)
    here = vehicle.world.flight.position
    with pytest.raises(ValueError, match="it is enough"):
        await flight.fly(Waits)
    assert vehicle.world.mode == EXTERNAL
    for _ in range(3):
        assert math.dist(vehicle.world.flight.position[:2], here[:2]) < 5 * RADIUS
        assert vehicle.world.flight.position[2] == pytest.approx(here[2], abs=2.0)
        await asyncio.sleep(5.0)


@flying(PLANE)
async def test_an_error_that_nobody_awaits_lets_px4_return(flight: Flight, vehicle: Flown) -> None:
    class Fails(Glides):
        async def fly(self) -> None:
            self.fixed_wing(course_deg=0.0)
            await asyncio.sleep(1.0)
            raise FlightError("lost")

    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    await up(flight, vehicle, Fails)
    await flight.set_mode(EXTERNAL)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 3.0)


@by_day("course", [0.0, 90.0], 2)
@flying(PLANE)
async def test_limits_turn_it_back(flight: Flight, vehicle: Flown, course: float) -> None:
    seen: list[tuple[float, float]] = []

    class Away(Glides):
        limits = Limits(distance=250.0, height=50.0)

        async def fly(self) -> None:
            with pytest.raises(LimitError, match="above home"):
                self.fixed_wing(course_deg=course, altitude=vehicle.world.home.altitude + 60.0)
            with pytest.raises(LimitError, match="from home"):
                await self.goto((400.0, 0.0, -40.0))
            home = (await self.telemetry.home()).position  # where it has left the runway
            self.fixed_wing(course_deg=course, height_rate=3.0)
            for _ in range(35):
                await asyncio.sleep(1.0)
                x, y, z = vehicle.world.flight.position
                seen.append((math.dist((x, y), home[:2]), -z))

    await up(flight, vehicle, Away)
    await flight.fly(Away)
    assert 170.0 < max(distance for distance, _ in seen) < 250.0
    assert 45.0 < max(height for _, height in seen) < 51.0


@flying(PLANE)
async def test_the_thrust_of_attitude_and_rates_is_forward(flight: Flight, vehicle: Flown) -> None:
    class Pushes(Mode):
        setpoints = (ATTITUDE, RATES)

        async def fly(self) -> None:
            self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.6)
            await asyncio.sleep(0.2)
            self.rates(roll=0.0, pitch=0.0, yaw=0.0, thrust=0.5)
            await asyncio.sleep(0.2)

    await up(flight, vehicle, Pushes)
    await flight.fly(Pushes)
    for kind, share in ((ATTITUDE, 0.6), (RATES, 0.5)):
        found = [each.message.thrust_body for each in vehicle.sent if each.topic == kind.topic]
        assert found
        assert all(each == pytest.approx((share, 0.0, 0.0)) for each in found)


@flying(PLANE)
async def test_the_flight_itself_goes_to_a_place_and_circles_there(flight: Flight, vehicle: Flown) -> None:
    await flight.arm()
    await flight.takeoff(30.0)
    home = vehicle.world.home
    place = GlobalPlace(home.latitude + 0.0015, home.longitude, home.altitude + 40.0)
    await flight.goto(place)
    x, y, z = vehicle.world.flight.position
    assert math.hypot(x - 167.0, y) < 110.0
    assert z == pytest.approx(-40.0, abs=11.0)
    await flight.land()
    await flight.wait_disarmed()
