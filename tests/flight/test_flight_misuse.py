"""Tests of errors in programs: declarations that are wrong, and flights that are used wrongly."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import pytest

from msggen.flight.checks import Problem
from msggen.flight.errors import FlightError, NotReachedError, RefusedError, RegistrationError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import ATTITUDE, GOTO
from msggen.sim import Options
from msggen.sim.loop import run
from support.flown import EXTERNAL, SETPOINTS, Flown, Line, Short, chosen, fly, flying, flying_each


class Runs(Executor):
    """Takes off."""

    mode = Line
    starts: ClassVar[Start] = "selected"

    async def run(self) -> None:
        await self.arm()
        await self.takeoff(5.0)


class Other(Runs):
    """Another executor of the same mode."""


def names(vehicle: Flown) -> set[str]:
    """Return the names of the modes that the vehicle knows."""
    return {each.name for each in vehicle.world.commander.components.modes.values()}


# declarations


class Plain(Mode, name="Plain"):
    """Has a `fly` that is no coroutine."""

    def fly(self) -> None:  # type: ignore[override]
        pass


class Walks(Executor):
    """Has a `run` that is no coroutine."""

    mode = Line

    def run(self) -> None:  # type: ignore[override]
        pass


class Empty(Mode, name="Empty"):
    """Has no `fly`."""


class NoMode(Executor):
    """Has no mode."""

    async def run(self) -> None:
        pass


def with_values(base: type[Mode | Executor], **values: Any) -> Any:
    """Return a subclass with some attributes."""
    return type(base.__name__, (base,), values)


WRONG: list[tuple[Any, str]] = [
    (with_values(Line, frame="NED"), "mode 'Line': `frame`: expected 'ned' or 'enu', got 'NED'"),
    (with_values(Line, requires=ATTITUDE), "mode 'Line': `requires`: expected Requirement, such as LOCAL_POSITION"),
    (with_values(Line, setpoints=GOTO), r"mode 'Line': expected a tuple of kinds as `setpoints`, such as"),
    (with_values(Line, setpoints=[GOTO]), r"mode 'Line': expected a tuple of kinds as `setpoints`, such as"),
    (with_values(Line, replaces=99), "mode 'Line': expected a nav_state of a PX4 mode as `replaces`, got 99"),
    (with_values(Line, replaces="return"), "expected a nav_state of a PX4 mode as `replaces`, got 'return'"),
    (with_values(Line, limits=20.0), "mode 'Line': `limits`: expected Limits"),
    (with_values(Line, keeps=True), "mode 'Line': `keeps`: expected Keeps"),
    (Plain, r"mode 'Plain' needs a method `async def fly\(self\)`"),
    (Empty, r"mode 'Empty' needs a method `async def fly\(self\)`"),
    (with_values(Runs, starts="Armed"), "executor Runs: `starts`: expected 'armed' or 'selected' or 'registered', got"),
    (with_values(Runs, keeps=None), "executor Runs: `keeps`: expected Keeps"),
    (with_values(Runs, mode=with_values(Line, replaces=5)), "a mode that replaces a PX4 mode cannot have an executor"),
    (with_values(Runs, mode=Plain), r"mode 'Plain' needs a method `async def fly\(self\)`"),
    (Walks, r"executor Walks needs a method `async def run\(self\)`"),
    (NoMode, "executor NoMode has no mode: set its `mode`"),
]


@pytest.mark.parametrize(("part", "text"), WRONG, ids=[text[:50] for _, text in WRONG])
@flying()
async def test_a_wrong_declaration_is_an_error_before_anything_is_sent(
    flight: Flight, vehicle: Flown, part: Any, text: str
) -> None:
    with pytest.raises(RegistrationError, match=text):
        await flight.add(Short, part)
    assert vehicle.sent == []
    await flight.add(Short)
    assert names(vehicle) == {"Short"}


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ((Line(), Line()), "expected one object of each mode"),
        ((Line, Line), "expected one object of each mode"),
        ((Runs, Other), "one executor for it"),
    ],
)
@flying()
async def test_wrong_parts_leave_nothing_registered(flight: Flight, vehicle: Flown, parts: Any, text: str) -> None:
    with pytest.raises(RegistrationError, match=text):
        await flight.add(*parts)
    assert vehicle.sent == []
    assert not any(each.is_registered for each in parts if not isinstance(each, type))


def test_a_name_is_that_of_the_class_statement_or_body() -> None:
    class Body(Mode):
        name = "My square"

    class Both(Mode, name="Statement"):
        name = "Body"

    class Sub(Body):
        pass

    assert (Body.name, Both.name, Sub.name) == ("My square", "Statement", "Sub")


@flying()
async def test_offboard_in_an_unknown_frame_is_an_error_before_anything_is_sent(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    sent = len(vehicle.sent)
    with pytest.raises(ValueError, match="expected the frame 'ned' or 'enu', got 'NED'"):
        async with flight.offboard("NED"):  # type: ignore[arg-type]
            pass
    assert len(vehicle.sent) == sent


# conditions of a mode


@flying()
async def test_conditions_can_be_a_generator(flight: Flight, vehicle: Flown) -> None:
    class Yields(Short, name="Yields"):
        is_ready = False

        def problems(self) -> Any:
            def found() -> Iterator[Problem]:
                if not self.is_ready:
                    yield Problem("not_ready")

            return found()

    mode = Yields()

    await flight.add(mode)
    await vehicle.in_air(flight)
    with pytest.raises(RefusedError, match="says that it cannot run"):
        await flight.fly(mode)
    mode.is_ready = True
    await asyncio.sleep(0.7)
    await flight.fly(mode)


# setpoints and waits


@pytest.mark.parametrize("within", [0.0, -1.0, math.nan])
@flying()
async def test_a_place_that_cannot_be_reached_is_an_error_before_anything_is_sent(
    flight: Flight, vehicle: Flown, within: float
) -> None:
    class Never(Mode, name="Never"):
        async def fly(self) -> None:
            await self.goto((3.0, 0.0, -10.0), within=within)

    await flight.add(Never)
    await vehicle.in_air(flight)
    with pytest.raises(ValueError, match="expected `within` above 0 m"):
        await asyncio.wait_for(flight.fly(Never), 20.0)
    assert all(each.message.position[0] < 1.0 for each in vehicle.sent if each.topic == "goto_setpoint")
    async with flight.offboard() as setpoint:
        with pytest.raises(ValueError, match="expected `within` above 0 m"):
            await asyncio.wait_for(setpoint.goto((3.0, 0.0, -10.0), within=within), 20.0)
        await asyncio.sleep(0.1)
    assert all(each.message.position[0] < 1.0 for each in vehicle.sent if each.topic == "trajectory_setpoint")


@flying()
async def test_an_exception_of_a_condition_belongs_to_the_task_that_waits(flight: Flight) -> None:
    status = flight.feeds["vehicle_status"]
    waits = [
        asyncio.ensure_future(each)
        for each in (status.following(lambda each: each.is_typo), flight.wait_for_status(lambda _: 1 / 0 > 0, 5.0))
    ]
    await flight.arm()
    await flight.disarm()
    one, two = await asyncio.gather(*waits, return_exceptions=True)
    assert isinstance(one, AttributeError)
    assert isinstance(two, ZeroDivisionError)


@flying()
async def test_a_mode_that_does_not_fly_sends_nothing(flight: Flight, vehicle: Flown) -> None:
    mode = Line()

    with pytest.raises(FlightError, match="mode 'Line' is not registered"):
        await mode.goto((3.0, 0.0, -10.0))
    await flight.add(mode)
    await vehicle.in_air(flight)
    for setpoint in (mode.goto((3.0, 0.0, -10.0)), mode.hold()):
        with pytest.raises(NotReachedError, match="mode 'Line' does not fly"):
            await asyncio.wait_for(setpoint, 20.0)
    with pytest.raises(NotReachedError, match="mode 'Line' does not fly"):
        mode.trajectory(velocity=(1.0, 0.0, 0.0))
    await asyncio.sleep(0.5)
    assert not {each.topic for each in vehicle.sent} & SETPOINTS


# flights

ACTIONS: list[Callable[[Flight], Any]] = [
    Flight.arm,
    Flight.disarm,
    Flight.land,
    Flight.hold,
    Flight.takeoff,
    Flight.wait_armed,
    Flight.wait_disarmed,
    lambda flight: flight.add(Short),
    lambda flight: flight.fly(Short),
    lambda flight: flight.set_mode(Short),
    lambda flight: flight.telemetry.home(),
    lambda flight: flight.offboard().__aenter__(),
]


def test_a_flight_is_used_in_its_block_and_once(px4_types: Any) -> None:
    vehicle = Flown(px4_types)

    async def main() -> None:
        flight = Flight(vehicle)
        for each in ACTIONS:
            with pytest.raises(FlightError, match="the flight has not begun: `async with Flight"):
                await each(flight)
        async with flight:
            await flight.add(Line)
            with pytest.raises(FlightError, match="a flight is used once"):
                await flight.__aenter__()
            assert names(vehicle) == {"Line"}
        await asyncio.sleep(0.1)
        assert names(vehicle) == set()
        sent = len(vehicle.sent)
        for each in ACTIONS:
            with pytest.raises(FlightError, match=r"the flight has ended|not registered"):
                await asyncio.wait_for(each(flight), 20.0)
        with pytest.raises(FlightError, match="a flight is used once"):
            await flight.__aenter__()
        assert len(vehicle.sent) == sent

    run(main(), vehicle)


def test_an_object_belongs_to_one_flight(px4_types: Any) -> None:
    one, two = Flown(px4_types, Options(key=1)), Flown(px4_types, Options(key=2))
    mode, executor = Short(), Runs()

    async def main() -> None:
        async with Flight(one) as flight, Flight(two) as other:
            await flight.add(mode, executor)
            with pytest.raises(RegistrationError, match="mode 'Short' is registered already: each flight needs"):
                await other.add(mode)
            with pytest.raises(RegistrationError, match="executor Runs is registered already: each flight needs"):
                await other.add(executor)
            assert two.sent == []
            assert names(one) == {"Short", "Line"}
            await one.in_air(flight)
            await flight.fly(mode)
            assert one.world.flight.position[0] > 2.0
        async with Flight(two) as other:  # the flight before has ended
            await other.add(mode, executor)
            await two.in_air(other)
            await other.fly(mode)
            assert two.world.flight.position[0] > 2.0

    run(main(), one, two)


@flying()
async def test_an_executor_stands_for_its_mode(flight: Flight, vehicle: Flown) -> None:
    await chosen(flight, Runs)
    await vehicle.until(lambda: vehicle.world.is_armed, 2.0)
    with pytest.raises(FlightError, match="executor Other is not registered"):
        await flight.set_mode(Other)
    with pytest.raises(FlightError, match=r"'Line' belongs to executor Runs: `await flight\.fly\(Runs\)`"):
        await flight.fly(Line)


@pytest.mark.parametrize("parameters", [{}, {"COM_MODE_ARM_CHK": 1.0}])
def test_registering_in_flight_is_refused_before_anything_is_sent(types: Any, parameters: dict[str, float]) -> None:
    """PX4 takes it with the parameter, but then the mode that flies can be left."""

    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_mode(flight, Line)
        await asyncio.sleep(1.0)
        with pytest.raises(RegistrationError, match="Short: the vehicle is armed: register before arming"):
            await flight.add(Short)
        assert len(vehicle.times("register_ext_component_request")) == 1
        await asyncio.sleep(1.0)
        assert vehicle.world.mode == EXTERNAL

    fly(types, program, Options(parameters=parameters))


@flying_each()
async def test_a_part_that_is_refused_leaves_none_of_the_others(flight: Flight, vehicle: Flown) -> None:
    """PX4 has five executors: the fifth one is registered, and the sixth one is refused."""

    def runs(number: int) -> Any:
        return with_values(Runs, mode=with_values(Line, name=f"Line {number}"))

    await flight.add(*map(runs, range(4)))
    with pytest.raises(RegistrationError, match="5 executors"):
        await flight.add(runs(4), runs(5))
    await asyncio.sleep(0.2)
    assert names(vehicle) == {f"Line {number}" for number in range(4)}
    await flight.add(runs(4))
