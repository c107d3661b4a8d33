"""Tests of runs of `fly`: their end, what outlives them, the next run, and who waits for them."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from msggen.flight.errors import FlightError, NoAnswerError, NotReachedError, RestartedError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.limits import Fence
from msggen.flight.mode import Mode
from msggen.flight.running_mode import ActiveMode
from support.examples import by_day
from support.flown import EXTERNAL, SETPOINTS, Flown, Line, Short, fly, flying, flying_each

HOLD, LAND = 4, 18


class Turns(Mode):
    """Flies north for ever the first time, then to a place in the east. `end` is its cleanup."""

    def __init__(self) -> None:
        self.runs = 0

    async def fly(self) -> None:
        self.runs += 1
        goal = (50.0, 0.0, -10.0) if self.runs == 1 else (0.0, 5.0, -10.0)
        try:
            await self.goto(goal)
        finally:
            await self.end()

    async def end(self) -> None:
        """Clean up."""


def setpoints(vehicle: Flown, since: float) -> list[Any]:
    """Return the setpoints that were sent from a time in s on."""
    return [each for each in vehicle.sent if each.topic in SETPOINTS and each.time >= since]


# the end of `fly`


@by_day("delay", [0.0, 0.002, 0.01, 0.05, 0.2], 2)
@flying_each()
async def test_a_flight_that_is_cancelled_early_does_not_begin(flight: Flight, vehicle: Flown, delay: float) -> None:
    """The command is under way: the vehicle can still enter the mode, and then holds its place."""
    await flight.add(Line)
    await vehicle.in_air(flight)
    flying = asyncio.ensure_future(flight.fly(Line))
    await asyncio.sleep(delay)
    flying.cancel()
    await asyncio.wait([flying])
    assert flying.cancelled()
    await asyncio.sleep(4.0)
    assert math.dist(vehicle.world.flight.position, (0.0, 0.0, -10.0)) < 1.0
    assert all(each.message.position[0] < 1.0 for each in setpoints(vehicle, vehicle.time / 1e6 - 2.0))
    assert vehicle.world.mode in {HOLD, EXTERNAL}
    await flight.hold()
    await asyncio.sleep(1.0)
    await flight.set_mode(Line)  # a user has asked for it
    await asyncio.sleep(3.0)
    assert vehicle.world.flight.position[0] > 1.0


def test_an_error_in_the_handler_of_an_error_still_ends_the_mode(
    px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The vehicle cannot hold its place where `fly` fails: PX4 leaves the mode, and both errors are told."""
    told: list[str] = []

    class Fails(Mode):
        async def fly(self) -> None:
            monkeypatch.setattr(Fence, "nearest", lack_home)
            raise RuntimeError("planned")

    def lack_home(*_: object) -> Any:
        raise NoAnswerError("no home")

    async def program(flight: Flight, vehicle: Flown) -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, what: told.append(str(what["exception"])))
        await vehicle.in_mode(flight, Fails)
        await asyncio.sleep(3.0)
        assert vehicle.world.mode != EXTERNAL
        assert told == ["no home", "planned"]
        await flight.hold()
        await asyncio.sleep(1.0)
        with pytest.raises(RuntimeError, match="planned"):
            await flight.fly(Fails)

    fly(px4_types, program)


@flying()
async def test_a_failed_test_in_a_mode_ends_the_flight(flight: Flight, vehicle: Flown) -> None:
    """What pytest raises is no Exception."""

    class Fails(Mode):
        async def fly(self) -> None:
            pytest.fail("planned")

    await flight.add(Fails)
    await vehicle.in_air(flight)
    with pytest.raises(pytest.fail.Exception, match="planned"):
        await flight.fly(Fails)


@flying()
async def test_an_error_that_nothing_takes_still_ends_the_mode(
    flight: Flight, vehicle: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def fail(*_: object) -> None:
        raise UnsupportedError("planned")

    asyncio.get_running_loop().set_exception_handler(lambda _, what: told.append(str(what["exception"])))
    await flight.add(Short)
    await vehicle.in_air(flight)
    monkeypatch.setattr(ActiveMode, "_tell", fail)
    await flight.set_mode(Short)
    await vehicle.until(lambda: vehicle.world.mode != EXTERNAL, 20.0)
    assert told == ["planned"]


def test_a_task_that_outlives_fly_sends_nothing(px4_types: Any) -> None:
    errors: list[str] = []

    class Steers(Mode):
        async def fly(self) -> None:
            async def steer() -> None:
                try:
                    while True:
                        self.trajectory(velocity=(1.0, 0.0, 0.0))
                        await asyncio.sleep(0.05)
                except NotReachedError as error:
                    errors.append(str(error))

            self.task = asyncio.ensure_future(steer())
            await asyncio.sleep(2.0)

    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(Steers)
        await vehicle.in_air(flight)
        await flight.fly(Steers)
        await asyncio.sleep(2.0)
        place = vehicle.world.flight.position
        await asyncio.sleep(5.0)
        return math.dist(place, vehicle.world.flight.position)

    assert fly(px4_types, program) < 0.2  # it holds
    assert errors == ["mode 'Steers' does not fly: its `fly` has ended, or has not begun"]


class Awaits(Turns):
    """Has a cleanup that waits, and sends a setpoint."""

    async def end(self) -> None:
        if self.runs == 1:
            await asyncio.sleep(1.0)
            self.trajectory(velocity=(0.0, 0.0, 0.0))


class Sends(Turns):
    """Has a cleanup that sends a setpoint at once."""

    async def end(self) -> None:
        if self.runs == 1:
            self.trajectory(velocity=(0.0, 0.0, 0.0))


class Raises(Turns):
    """Has a cleanup that fails in the first run."""

    async def end(self) -> None:
        await asyncio.sleep(0.5)
        if self.runs == 1:
            raise LookupError("no end")


class Swallows(Turns):
    """Does not end when it is cancelled."""

    async def fly(self) -> None:
        try:
            await super().fly()
        except asyncio.CancelledError:
            await asyncio.sleep(0.5)


CLEANUPS: list[type[Turns]] = [Turns, Awaits, Sends, Raises, Swallows]


PAUSES = (0.0, 0.3, 2.0)


@by_day(
    ("kind", "pause"),
    [(kind, PAUSES[(place + turn) % 3]) for place, kind in enumerate(CLEANUPS) for turn in range(3)],
    3,
)
@flying()
async def test_the_next_run_is_not_disturbed_by_the_cleanup_of_the_one_before(
    flight: Flight, vehicle: Flown, caplog: pytest.LogCaptureFixture, kind: type[Turns], pause: float
) -> None:
    mode = kind()

    await vehicle.in_mode(flight, mode)
    await asyncio.sleep(2.0)
    await flight.hold()
    left = vehicle.time / 1e6
    await asyncio.sleep(pause)
    assert setpoints(vehicle, left) == []
    await asyncio.wait_for(flight.fly(mode), 20.0)
    assert vehicle.world.flight.position[1] > 4.0
    assert vehicle.times("trajectory_setpoint") == []
    assert mode.runs == 2
    assert ("its end has failed" in caplog.text) == (kind is Raises)


@by_day("kind", CLEANUPS, 2)
@flying()
async def test_a_flight_that_is_cancelled_and_flown_anew_is_not_disturbed(
    flight: Flight, vehicle: Flown, kind: type[Turns]
) -> None:
    mode = kind()

    await flight.add(mode)
    await vehicle.in_air(flight)
    before = asyncio.ensure_future(flight.fly(mode))
    await asyncio.sleep(2.0)
    before.cancel()
    await asyncio.wait_for(flight.fly(mode), 20.0)
    assert vehicle.world.flight.position[1] > 4.0
    assert vehicle.times("trajectory_setpoint") == []
    assert mode.runs == 2


@flying()
async def test_a_fly_that_never_ends_sends_nothing_after_the_mode_was_left(flight: Flight, vehicle: Flown) -> None:
    class Stubborn(Mode):
        async def fly(self) -> None:
            for _ in range(20):
                try:
                    await self.goto((50.0, 0.0, -10.0))
                except BaseException:  # noqa: BLE001 - this is what is tested
                    await asyncio.sleep(0.5)

    await vehicle.in_mode(flight, Stubborn)
    await asyncio.sleep(2.0)
    await flight.hold()
    left = vehicle.time / 1e6
    await asyncio.sleep(5.0)
    assert setpoints(vehicle, left) == []
    assert vehicle.times("mode_completed") == []


# who waits for `fly`


async def ends(waiting: asyncio.Future[None], error: type[FlightError], text: str) -> None:
    """Check with which error a wait ends."""
    with pytest.raises(error, match=text):
        await asyncio.wait_for(waiting, 20.0)


@flying_each()
async def test_every_wait_for_a_mode_ends(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Line, Short)
    await ends(asyncio.ensure_future(flight.fly(Line)), FlightError, "'Line' needs an armed vehicle")
    assert vehicle.times("vehicle_command") == []
    await vehicle.in_air(flight)
    one, two = (asyncio.ensure_future(flight.fly(Short)) for _ in range(2))
    await asyncio.wait_for(two, 20.0)
    await ends(one, NotReachedError, "'Short' is flown anew")
    waiting = asyncio.ensure_future(flight.fly(Line))
    await asyncio.sleep(1.0)
    again = asyncio.ensure_future(flight.fly(Line))
    await asyncio.sleep(1.0)
    await ends(waiting, NotReachedError, "'Line' was left before its end")
    flight.close()
    await ends(again, FlightError, "'Line'")


def test_a_wait_for_a_mode_ends_when_the_vehicle_restarts(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(Line)
        await vehicle.in_air(flight)
        waiting = asyncio.ensure_future(flight.fly(Line))
        await asyncio.sleep(2.0)
        await vehicle.restart_after(2.0)
        taken = await vehicle.until(waiting.done, 5.0)
        with pytest.raises(RestartedError, match="the vehicle has restarted, so mode 'Line' has ended"):
            await waiting
        return taken

    assert fly(types, program) < 1.0


@flying()
async def test_a_wait_for_a_mode_ends_when_the_vehicle_is_disarmed(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Line)
    await vehicle.in_air(flight)
    waiting = asyncio.ensure_future(flight.fly(Line))
    await asyncio.sleep(1.0)
    vehicle.choose(LAND)
    await vehicle.until(waiting.done, 1.0)
    with pytest.raises(NotReachedError):
        await waiting
