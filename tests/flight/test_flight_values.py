"""Setpoints that are not finite or in degrees, and positions that are not known: an error, and nothing is sent."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.blocking import BlockingFlight
from msggen.flight.checks import Problem
from msggen.flight.errors import LimitError, NoAnswerError, RefusedError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.missions import ActionItem, Mission, Plan
from msggen.flight.mode import Mode
from msggen.flight.pytest import SimVehicle
from msggen.messages.setpoints import ATTITUDE, FIXED_WING, RATES, ROVER
from msggen.sim import Options
from support.examples import examples
from support.flown import SETPOINTS, Flown, fly, flying

RETURN = 5
BAD = st.sampled_from([math.nan, math.inf, -math.inf, 1e39, -1e300])
GOOD = st.floats(-50.0, 50.0)


def numbers(size: int) -> st.SearchStrategy[tuple[float, ...]]:
    """Return numbers of which one at least is not one that a message can hold."""
    places = st.integers(0, size - 1)
    return st.tuples(st.tuples(*[GOOD] * size), places, BAD).map(lambda each: _with(*each))


def _with(values: tuple[float, ...], place: int, bad: float) -> tuple[float, ...]:
    return (*values[:place], bad, *values[place + 1 :])


CALLS: dict[str, tuple[int, Any]] = {
    "goto": (3, lambda mode, values: mode.goto(values)),
    "goto heading": (1, lambda mode, values: mode.goto((1.0, 0.0, -5.0), heading=values[0])),
    "goto heading in degrees": (1, lambda mode, values: mode.goto((1.0, 0.0, -5.0), heading_deg=values[0])),
    "goto speed": (1, lambda mode, values: mode.goto((1.0, 0.0, -5.0), max_speed=values[0])),
    "goto climb": (1, lambda mode, values: mode.goto((1.0, 0.0, -5.0), max_climb=values[0])),
    "rates": (3, lambda mode, values: mode.rates(roll=values[0], pitch=values[1], yaw=values[2], thrust=0.5)),
    "thrust": (1, lambda mode, values: mode.rates(roll=0.0, pitch=0.0, yaw=0.0, thrust=values[0])),
    "attitude": (4, lambda mode, values: mode.attitude(values, thrust=0.5)),
    "attitude turn rate": (
        1,
        lambda mode, values: mode.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.5, turn_rate=values[0]),
    ),
}


@settings(max_examples=examples(60, by_day=5))
@given(st.data(), st.sampled_from(sorted(CALLS)))
def test_what_is_not_finite_is_an_error(px4_types: Any, data: st.DataObject, name: str) -> None:
    size, call = CALLS[name]
    values = data.draw(numbers(size))
    errors: list[Exception] = []

    class Wrong(Mode):
        setpoints = (*Mode.setpoints, ATTITUDE, RATES)

        async def fly(self) -> None:
            try:
                found = call(self, values)
                await found if found is not None else None
            except ValueError as error:
                errors.append(error)
            await asyncio.Event().wait()

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Wrong)
        await vehicle.in_air(flight, 3.0)
        await flight.set_mode(Wrong)
        await asyncio.sleep(0.5)
        assert not SETPOINTS & {each.topic for each in vehicle.sent}

    fly(px4_types, program)
    assert errors


@settings(max_examples=examples(40))
@given(st.tuples(*[st.one_of(GOOD, BAD)] * 9), st.one_of(st.none(), GOOD, BAD))
def test_a_trajectory_is_finite_or_free_in_each_value(
    px4_types: Any, values: tuple[float, ...], heading: float | None
) -> None:
    """NaN says that something is not controlled. Infinity and what a float32 cannot hold is an error."""
    from msggen.flight.sending import Trajectory

    axes = values[:3], values[3:6], values[6:]
    is_large = any(not math.isnan(each) and abs(each) > 3.4e38 for each in values)
    is_open = any(all(math.isnan(axis[place]) for axis in axes) for place in range(3))
    is_bad = heading is not None and not abs(heading) < 1e38
    if is_large or is_open or is_bad:
        with pytest.raises(ValueError, match=r"expected finite|each axis needs"):
            Trajectory(*axes, heading, None, math.nan).values("ned")
    else:
        found = px4_types.TrajectorySetpoint(**Trajectory(*axes, heading, None, math.nan).values("ned"))
        assert px4_types.TrajectorySetpoint.decode(found.encode()).position == pytest.approx(axes[0], nan_ok=True)


@pytest.mark.parametrize(
    "call",
    [
        lambda flight: flight.takeoff(math.inf),
        lambda flight: flight.takeoff(math.nan),
        lambda flight: flight.takeoff(-2.0),
        lambda flight: flight.goto(latitude=math.nan, longitude=8.0),
        lambda flight: flight.goto(latitude=47.0, longitude=8.0, altitude=math.inf),
        lambda flight: flight.goto(latitude=91.0, longitude=8.0),
        lambda flight: flight.goto(latitude=47.0, longitude=181.0),
        lambda flight: flight.set_home(latitude=47.0, longitude=8.0),
        lambda flight: flight.set_home(latitude=47.0, longitude=8.0, altitude=math.nan),
        lambda flight: flight.set_origin(latitude=47.0, longitude=math.inf, altitude=0.0),
    ],
)
@flying()
async def test_commands_with_impossible_places_are_not_sent(flight: Flight, vehicle: Flown, call: Any) -> None:
    with pytest.raises((ValueError, TypeError), match="expected"):
        await call(flight)
    assert not vehicle.sent


def test_without_an_estimate_there_is_no_position(px4_types: Any) -> None:
    """The last one that was known is not used."""
    errors: list[str] = []

    class Blind(Mode):
        setpoints = (RATES,)

        async def fly(self) -> None:
            await self.position()
            vehicles[0].lose_position()
            await asyncio.sleep(0.6)
            for call in (self.position, self.velocity, self.heading, self.hold):
                with pytest.raises(NoAnswerError) as caught:
                    await call()
                errors.append(str(caught.value))
            await asyncio.Event().wait()

    vehicles: list[Flown] = []

    async def program(flight: Flight, vehicle: Flown) -> None:
        vehicles.append(vehicle)
        await vehicle.in_mode(flight, Blind)
        await vehicle.until(lambda: len(errors) == 4, 6.0)
        with pytest.raises(NoAnswerError, match="no valid local position"):
            async with flight.offboard():
                pass

    fly(px4_types, program)
    assert {each.partition(":")[0] for each in errors} == {"the vehicle has no valid local position"}


@flying()
async def test_a_mode_that_cannot_hold_says_so(
    flight: Flight, vehicle: Flown, caplog: pytest.LogCaptureFixture
) -> None:
    class Turns(Mode):
        setpoints = (RATES,)

        async def fly(self) -> None:
            await self.hold(1.0)

    await vehicle.in_mode(flight, Turns)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 2.0)
    assert "for a multicopter, declare `setpoints = (GOTO, TRAJECTORY)`" in caplog.text
    assert UnsupportedError.__name__ in caplog.text


def test_a_time_that_is_none_is_an_error_and_not_waited_for(px4_types: Any) -> None:
    """asyncio would wait for ever."""

    class Holds(Mode):
        async def fly(self) -> None:
            for wrong in (math.nan, -1.0):
                with pytest.raises(ValueError, match="expected a time in s, got"):
                    await self.hold(wrong)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Holds)
        await vehicle.in_air(flight, 3.0)
        await flight.fly(Holds)
        await flight.hold()
        with pytest.raises(ValueError, match="a timeout above 0 s, got nan"):
            await flight.to_fixed_wing(timeout=math.nan)
        with pytest.raises(ValueError, match="a timeout in s, got nan"):
            await flight.wait_for_status(lambda _: False, math.nan)
        mission = Mission(Plan((ActionItem("rtl"),)))
        mission._path = "survey.json"
        with pytest.raises(ValueError, match="a period in s, got nan"):
            await mission.follow(math.nan)

    fly(px4_types, program)
    with BlockingFlight(SimVehicle(px4_types)) as flight, pytest.raises(ValueError, match="a time in s, got nan"):
        flight.sleep(math.nan)


class Turns(Mode, name="Turns"):
    """Calls what it is given."""

    def __init__(self, call: Any, kinds: Any = Mode.setpoints) -> None:
        self.call, self.setpoints = call, kinds  # type: ignore[misc]

    async def fly(self) -> None:
        found = self.call(self)
        if found is not None:
            await found


@pytest.mark.parametrize(
    ("vehicle", "kinds", "call"),
    [
        ("multicopter", Mode.setpoints, lambda mode: mode.goto((0.0, 0.0, -5.0), heading=90.0)),
        ("multicopter", Mode.setpoints, lambda mode: mode.trajectory(velocity=(0.0, 0.0, 0.0), heading=-180.0)),
        ("plane", (FIXED_WING,), lambda mode: mode.fixed_wing(course=90.0)),
        ("plane", (FIXED_WING,), lambda mode: mode.fixed_wing(airspeed_direction=90.0)),
        ("rover", ROVER, lambda mode: mode.rover(speed=1.0, heading=180.0)),
    ],
)
def test_degrees_in_the_place_of_radians_are_an_error(px4_types: Any, vehicle: str, kinds: Any, call: Any) -> None:
    async def program(flight: Flight, flown: Flown) -> None:
        mode = Turns(call, kinds)
        await flight.add(mode)
        await flight.arm()
        if vehicle != "rover":
            await flight.takeoff(30.0 if vehicle == "plane" else 5.0)
        sent = len(flown.sent)
        with pytest.raises(ValueError, match=r"in rad, from -4 pi to 4 pi, got -?\d+: did you mean `\w+_deg=-?\d+`"):
            await flight.fly(mode)
        assert not [each for each in flown.sent[sent:] if getattr(each.message, "yaw", 0.0) in {90.0, 180.0}]

    fly(px4_types, program, Options(vehicle=vehicle))


@flying(Options(vehicle="plane"))
async def test_an_altitude_in_the_ground_is_an_error(flight: Flight) -> None:
    mode = Turns(lambda mode: mode.fixed_wing(course=0.0, altitude=50.0), (FIXED_WING,))
    await flight.add(mode)
    await flight.arm()
    await flight.takeoff(30.0)
    with pytest.raises(LimitError, match=r"438.* m below home, and nothing was sent: .* altitudes are above sea level"):
        await flight.fly(mode)


@flying()
async def test_a_refusal_names_the_problems_that_the_program_reports(flight: Flight) -> None:
    class Track(Turns, name="Track"):
        def problems(self) -> Any:
            return [Problem("track_no_target")]

    await flight.add(Track(None))
    await flight.arm()
    await flight.takeoff(5.0)
    with pytest.raises(RefusedError, match="'Track' reports track_no_target"):
        await flight.fly(Track)
