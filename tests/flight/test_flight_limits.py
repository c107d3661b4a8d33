"""Tests of the limits on height and distance: whatever a program asks for, nothing beyond them is sent or flown."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.braking import allowed
from msggen.flight.errors import FlightError, LimitError, NoAnswerError, NotReachedError, UnsupportedError
from msggen.flight.executor import Executor
from msggen.flight.flight import Flight
from msggen.flight.limits import Fence, Limits
from msggen.flight.mode import Mode
from msggen.flight.places import Vector
from msggen.messages.setpoints import ATTITUDE, GOTO, RATES, TRAJECTORY
from support.examples import by_day, examples
from support.flown import Flown, chosen, fly

LIMITS = Limits(height=15.0, distance=20.0)
NAN = math.nan
FREE = (NAN, NAN, NAN)
ROUNDED = 1e-4
"""What the fields of messages, which are float32, differ from the numbers of a program in m."""
OVERSHOOT = 0.3
"""How far beyond a limit a vehicle may fly that was stopped there, in m."""
Program = Callable[[Flight, Flown], Coroutine[Any, Any, Any]]


class Scripted(Mode, name="Any"):
    """Does what a test says."""

    def __init__(self, do: Callable[[Scripted], Coroutine[Any, Any, None]]) -> None:
        self.do = do
        self.error: Exception | None = None

    async def fly(self) -> None:
        try:
            await self.do(self)
        except FlightError as error:
            self.error = error


def flown(package: Any, program: Program, limits: Limits = LIMITS) -> Flown:
    """Fly a program with limits, and return its vehicle, which has kept what was sent."""

    async def whole(flight: Flight, vehicle: Flown) -> Flown:
        await program(flight, vehicle)
        return vehicle

    return fly(package, whole, limits=limits)


def in_mode(do: Callable[[Scripted], Coroutine[Any, Any, None]], seconds: float) -> tuple[Scripted, Program]:
    """Return a mode, and a program that takes off, and flies it for some time."""
    mode = Scripted(do)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_mode(flight, mode)
        await asyncio.sleep(seconds)

    return mode, program


class Track:
    """How far a vehicle has been from home."""

    def __init__(self) -> None:
        self.height = self.distance = 0.0

    async def follow(self, vehicle: Flown) -> None:
        while True:
            x, y, z = vehicle.world.flight.position
            self.height, self.distance = max(self.height, -z), max(self.distance, math.hypot(x, y))
            await asyncio.sleep(0.02)


def tracked(package: Any, program: Program, limits: Limits = LIMITS) -> tuple[Flown, Track]:
    track = Track()

    async def followed(flight: Flight, vehicle: Flown) -> None:
        following = asyncio.ensure_future(track.follow(vehicle))
        try:
            await program(flight, vehicle)
        finally:
            following.cancel()

    return flown(package, followed, limits), track


def places(vehicle: Flown) -> list[tuple[float, float, float]]:
    """Return all places that were sent."""
    topics = {"goto_setpoint", "trajectory_setpoint"}
    return [tuple(each.message.position) for each in vehicle.sent if each.topic in topics]


def is_within(place: tuple[float, float, float], limits: Limits) -> bool:
    x, y, z = (0.0 if math.isnan(each) else each for each in place)
    return -z <= limits.height + ROUNDED and math.hypot(x, y) <= limits.distance + ROUNDED


# properties

near = st.floats(-60.0, 60.0)
maybe = st.just(NAN) | near
vectors = st.tuples(near, near, near)
velocities = st.tuples(maybe, maybe, maybe)
durations = st.floats(0.1, 8.0)
requests = st.one_of(
    st.tuples(st.just("goto"), vectors),
    st.tuples(st.just("trajectory"), st.fixed_dictionaries({"position": velocities, "velocity": vectors})),
    st.tuples(st.just("trajectory"), st.fixed_dictionaries({"velocity": vectors})),
    st.tuples(st.just("trajectory"), st.fixed_dictionaries({"acceleration": vectors})),
    st.tuples(st.just("trajectory"), st.fixed_dictionaries({"velocity": velocities, "acceleration": vectors})),
    st.tuples(
        st.just("trajectory"),
        st.fixed_dictionaries({"position": velocities, "velocity": velocities, "acceleration": velocities}),
    ),
)


@settings(max_examples=examples(60, by_day=3))
@given(st.lists(st.tuples(requests, durations), min_size=1, max_size=6), st.sampled_from(["mode", "offboard"]))
def test_no_place_beyond_the_limits_is_sent_or_flown(px4_types: Any, asked: list[Any], way: str) -> None:
    async def ask(target: Any) -> None:
        for (name, values), seconds in asked:
            try:
                if name == "goto":
                    await asyncio.wait_for(target.goto(values), seconds)
                else:
                    target.trajectory(**values)
                    await asyncio.sleep(seconds)
            except (LimitError, NotReachedError, ValueError, TimeoutError, asyncio.TimeoutError):
                continue

    _, program = in_mode(ask, sum(seconds for _, seconds in asked) + 5.0)

    async def offboard(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_air(flight)
        async with flight.offboard() as setpoint:
            await ask(setpoint)

    vehicle, track = tracked(px4_types, offboard if way == "offboard" else program)
    assert [each for each in places(vehicle) if not is_within(each, LIMITS)] == []
    assert track.height < LIMITS.height + OVERSHOOT
    assert track.distance < LIMITS.distance + OVERSHOOT


class Fixed:
    """Feeds with the messages of a test."""

    def __init__(self, home: tuple[float, float, float], *, is_known: bool = True) -> None:
        x, y, z = home
        self.home = SimpleNamespace(latest=SimpleNamespace(x=x, y=y, z=z, valid_lpos=is_known), age=0.0)

    def has(self, topic: str) -> bool:
        return topic == "home_position"

    def __getitem__(self, topic: str) -> Any:
        return self.home if topic == "home_position" else SimpleNamespace(latest=None, age=math.inf)


lengths = st.just(math.inf) | st.floats(0.5, 1e4)
homes = st.tuples(*[st.floats(-1e4, 1e4)] * 3)


@settings(max_examples=examples(500))
@given(st.builds(Limits, height=lengths, distance=lengths), homes, st.tuples(*[st.floats(-1e5, 1e5)] * 3))
def test_limits_count_from_home(limits: Limits, home: tuple[float, ...], place: tuple[float, ...]) -> None:
    feeds: Any = Fixed((home[0], home[1], home[2]))
    fence = Fence(feeds, limits)
    x, y, z = (there - here for there, here in zip(place, home, strict=True))
    is_inside = -z <= limits.height and math.hypot(x, y) <= limits.distance
    if is_inside:
        fence.check_place(place)
        assert math.dist(fence.nearest(place), place) < ROUNDED
    else:
        with pytest.raises(LimitError, match="nothing was sent"):
            fence.check_place(place)
        x, y, z = (there - here for there, here in zip(fence.nearest(place), home, strict=True))
        assert -z <= limits.height + ROUNDED
        assert math.hypot(x, y) <= limits.distance + ROUNDED


@given(st.floats(-10.0, 1e4))
def test_the_speed_towards_a_limit_lets_the_vehicle_stop(left: float) -> None:
    assert allowed(left) ** 2 / 2 / 2.0 <= max(left, 0.0) + 1e-9


# places


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ((0.0, 0.0, -15.1), r"15\.1 m above home: the limit is 15 m, and nothing was sent"),
        ((15.0, 15.0, -10.0), r"21\.2 m from home: the limit is 20 m, and nothing was sent"),
    ],
)
def test_a_place_beyond_the_limits_is_an_error(px4_types: Any, place: tuple[float, float, float], text: str) -> None:
    mode, program = in_mode(lambda found: found.goto(place), 2.0)
    vehicle = flown(px4_types, program)
    assert isinstance(mode.error, LimitError)
    assert re.match(text, str(mode.error))
    assert not [each for each in places(vehicle) if not is_within(each, LIMITS)]


def test_the_frame_of_a_mode_counts(px4_types: Any) -> None:
    class East(Scripted, name="East"):
        frame = "enu"
        limits = Limits(height=12.0)

    async def go(mode: Scripted) -> None:
        await mode.goto((3.0, 4.0, 11.0))
        await mode.goto((3.0, 4.0, 13.0))

    mode = East(go)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_mode(flight, mode)
        await vehicle.until(lambda: mode.error is not None, 20.0)
        assert math.dist(vehicle.world.flight.position, (4.0, 3.0, -11.0)) < 0.6

    flown(px4_types, program)
    assert str(mode.error) == "13.0 m above home: the limit is 12 m, and nothing was sent"


def test_one_horizontal_axis_alone_cannot_be_limited(px4_types: Any) -> None:
    async def go(mode: Scripted) -> None:
        mode.trajectory(position=(1.0, NAN, -10.0), velocity=(NAN, 3.0, NAN))

    mode, program = in_mode(go, 1.0)
    flown(px4_types, program)
    assert "only one horizontal axis" in str(mode.error)
    mode, program = in_mode(go, 1.0)
    flown(px4_types, program, Limits(height=15.0))
    assert mode.error is None


def test_takeoffs_and_places_on_earth_are_limited(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.arm()
        before = len(vehicle.times("vehicle_command"))
        with pytest.raises(LimitError, match=r"16\.0 m above home"):
            await flight.takeoff(16.0)
        with pytest.raises(LimitError, match="needs an altitude"):
            await flight.takeoff()
        home = vehicle.world.home
        with pytest.raises(LimitError, match="m from home"):
            await flight.goto(latitude=home.latitude + 0.001, longitude=home.longitude)
        with pytest.raises(LimitError, match=r"16\.0 m above home"):
            await flight.goto(latitude=home.latitude, longitude=home.longitude, altitude=home.altitude + 16.0)
        assert len(vehicle.times("vehicle_command")) == before
        await flight.takeoff(10.0)

    flown(px4_types, program)


def test_an_executor_keeps_the_limits_of_its_flight(px4_types: Any) -> None:
    errors: list[LimitError] = []

    class Waits(Mode, name="Waits"):
        async def fly(self) -> None:
            await self.hold(60.0)

    class High(Executor):
        mode = Waits

        async def run(self) -> None:
            try:
                await self.takeoff(50.0)
            except LimitError as error:
                errors.append(error)

    async def program(flight: Flight, _: Flown) -> None:
        await chosen(flight, High)
        await flight.arm()
        await asyncio.sleep(1.0)

    flown(px4_types, program)
    assert len(errors) == 1


# velocities


@by_day(("velocity", "seconds"), [((12.0, 0.0, 0.0), 20.0), ((-5.0, 9.0, 0.0), 20.0), ((0.0, 0.0, -3.0), 20.0)], 2)
def test_a_velocity_ends_at_the_limit(
    px4_types: Any, velocity: tuple[float, float, float], seconds: float, record_property: Any
) -> None:
    async def go(mode: Scripted) -> None:
        mode.trajectory(velocity=velocity)
        await asyncio.sleep(seconds)

    limits = Limits(height=40.0, distance=60.0)
    _, program = in_mode(go, seconds)
    _, track = tracked(px4_types, program, limits)
    record_property("overshoot", [track.height - limits.height, track.distance - limits.distance])
    assert track.height < limits.height + 0.05
    assert track.distance < limits.distance + 0.05
    assert max(track.height - limits.height, track.distance - limits.distance) > -0.3  # it gets there


def test_a_velocity_across_home_ends_at_the_limit(px4_types: Any) -> None:
    async def go(mode: Scripted) -> None:
        await mode.goto((-19.0, 0.0, -10.0))
        mode.trajectory(velocity=(12.0, 0.0, 0.0))
        await asyncio.sleep(15.0)

    _, program = in_mode(go, 30.0)
    _, track = tracked(px4_types, program)
    assert track.distance < LIMITS.distance + 0.05


def test_without_an_estimate_nothing_moves(px4_types: Any) -> None:
    message = px4_types.TrajectorySetpoint(velocity=(1.0, NAN, -1.0), acceleration=FREE)
    feeds: Any = Fixed((0.0, 0.0, 0.0))
    found = Fence(feeds, LIMITS).shaped({TRAJECTORY.topic: message})[TRAJECTORY.topic]
    assert found.velocity[0] == found.velocity[2] == 0.0
    assert math.isnan(found.velocity[1])
    assert message.velocity[0] == 1.0


def test_without_limits_nothing_changes(px4_types: Any) -> None:
    message = px4_types.TrajectorySetpoint(velocity=(1.0, NAN, -1.0))
    feeds: Any = Fixed((0.0, 0.0, 0.0), is_known=False)
    assert Fence(feeds).shaped({TRAJECTORY.topic: message}) == {TRAJECTORY.topic: message}
    Fence(feeds).check_place((1e6, 0.0, -1e6))
    assert Fence(feeds).nearest((1.0, 2.0, 3.0)) == Vector(1.0, 2.0, 3.0)


# what cannot be limited


def test_attitudes_and_rates_are_refused_before_anything_is_sent(px4_types: Any) -> None:
    class Tilts(Mode, name="Tilts"):
        setpoints = (GOTO, ATTITUDE, RATES)

        async def fly(self) -> None:
            await self.hold(1000.0)

    async def program(flight: Flight, vehicle: Flown) -> None:
        with pytest.raises(UnsupportedError, match=r"attitude and rates setpoints: .*GF_MAX_HOR_DIST"):
            await flight.add(Tilts)
        assert vehicle.sent == []

    flown(px4_types, program)


def test_another_kind_of_setpoint_with_places_is_refused() -> None:
    """Limits read the fields of GotoSetpoint and TrajectorySetpoint only: another place could be beyond them."""
    feeds: Any = Fixed((0.0, 0.0, 0.0))
    fence = Fence(feeds, LIMITS)
    fence.check_kinds((GOTO, TRAJECTORY))
    with pytest.raises(UnsupportedError, match="cannot be enforced for by rail setpoints"):
        fence.check_kinds((GOTO, TRAJECTORY._replace(name="by rail", number=99)))


def test_a_place_without_a_home_is_an_error() -> None:
    feeds: Any = Fixed((0.0, 0.0, 0.0), is_known=False)
    with pytest.raises(NoAnswerError, match="home position"):
        Fence(feeds, LIMITS).check_place((0.0, 0.0, -1.0))


@pytest.mark.parametrize("wrong", [0.0, -1.0, NAN])
def test_limits_are_positive(wrong: float) -> None:
    with pytest.raises(ValueError, match="height: expected a positive number"):
        Limits(height=wrong)
    with pytest.raises(ValueError, match="distance: expected a positive number"):
        Limits(distance=wrong)
