"""Tests of runs of executors: who waits for them, the next run, and its place after the cleanup of the one before."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from functools import partial
from typing import ClassVar

import pytest

from msggen.flight.errors import FlightError, NotReachedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from support.examples import by_day
from support.flown import EXTERNAL, Flown, Line, chosen, flying, flying_each

HOLD, RETURN, TAKEOFF, LAND = 4, 5, 17, 18


class Ends(Executor):
    """Takes off, and does what `end` says."""

    mode: ClassVar[type[Mode]] = Line
    starts: ClassVar[Start] = "selected"

    def __init__(self) -> None:
        self.runs = self.ends = 0

    async def run(self) -> None:
        self.runs += 1
        try:
            await self.arm()
            await self.takeoff(5.0)
            await self.end()
        finally:
            self.ends += 1

    async def end(self) -> None:
        """End at once."""


@flying_each()
async def test_a_user_waits_for_the_end_of_an_executor(flight: Flight, vehicle: Flown) -> None:
    executor = Ends()

    with pytest.raises(FlightError, match="executor Ends is not registered"):
        await flight.fly(Ends)
    await flight.add(executor)
    with pytest.raises(FlightError, match="'Line' belongs to executor Ends"):
        await flight.fly(Line)
    await asyncio.wait_for(flight.fly(Ends), 30.0)
    assert (executor.runs, executor.ends) == (1, 1)
    assert vehicle.world.mode == TAKEOFF
    await asyncio.wait_for(flight.fly(executor), 30.0)
    assert (executor.runs, executor.ends) == (2, 2)


@flying()
async def test_an_executor_that_has_ended_in_its_own_mode_is_flown_anew(flight: Flight, vehicle: Flown) -> None:
    class Rests(Mode, name="Rests"):
        async def fly(self) -> None:
            await self.hold(1.0)

    class Flies(Ends):
        mode = Rests

        async def end(self) -> None:
            await self.fly()

    executor = Flies()

    await flight.add(executor)
    for runs in (1, 2):
        await asyncio.wait_for(flight.fly(executor), 40.0)
        await asyncio.sleep(1.0)
        assert (executor.runs, executor.ends) == (runs, runs)
        assert vehicle.world.mode == EXTERNAL


@flying()
async def test_the_exception_of_an_executor_reaches_who_waits(
    flight: Flight, vehicle: Flown, caplog: pytest.LogCaptureFixture
) -> None:
    class Fails(Ends):
        async def end(self) -> None:
            raise LookupError("no target")

    await flight.add(Fails)
    with pytest.raises(LookupError, match="no target"):
        await asyncio.wait_for(flight.fly(Fails), 30.0)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 3.0)
    assert "executor Fails has failed" in caplog.text


class Stays(Ends):
    """Does not end."""

    async def end(self) -> None:
        await self.fly()


@flying()
async def test_every_wait_for_an_executor_ends(flight: Flight, vehicle: Flown) -> None:
    executor = Stays()

    async def flies() -> asyncio.Future[None]:
        waiting = asyncio.ensure_future(flight.fly(executor))
        await vehicle.until(lambda: executor.runs == executor.ends + 1 and vehicle.world.is_armed, 3.0)
        await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 20.0)
        return waiting

    await flight.add(executor)
    waiting = await flies()
    vehicle.choose(HOLD)
    await vehicle.until(waiting.done, 1.0)
    with pytest.raises(NotReachedError, match="executor Stays is no longer in charge"):
        await waiting
    assert executor.ends == 1
    waiting = await flies()
    other = asyncio.ensure_future(flight.fly(executor))
    await vehicle.until(waiting.done, 0.1)
    with pytest.raises(NotReachedError, match="executor Stays is started anew"):
        await waiting
    flight.close()
    await vehicle.until(other.done, 0.1)
    with pytest.raises(FlightError, match="executor Stays"):
        await other
    assert executor.runs == executor.ends


@flying()
async def test_a_wait_for_an_executor_ends_when_the_vehicle_restarts(flight: Flight, vehicle: Flown) -> None:
    """It waits for somebody who arms the vehicle."""

    class Patient(Ends):
        starts: ClassVar[Start] = "armed"

    await flight.add(Patient)
    waiting = asyncio.ensure_future(flight.fly(Patient))
    await asyncio.sleep(2.0)
    assert not waiting.done()
    await vehicle.restart_after(2.0)
    await vehicle.until(waiting.done, 5.0)
    with pytest.raises(FlightError, match="executor Patient"):
        await waiting


@by_day("way", ["after its end", "on the ground", "while it flies PX4's mode"], 2)
@flying_each()
async def test_an_executor_that_is_selected_again_runs_again(flight: Flight, vehicle: Flown, way: str) -> None:
    class Lands(Ends):
        async def end(self) -> None:
            if way == "on the ground":
                await self.land()
                await self.wait_disarmed()
            elif way != "after its end":
                await self.land()

    executor = Lands()

    await chosen(flight, executor)
    if way == "on the ground":
        await vehicle.until(lambda: executor.ends == 1, 40.0)
        assert not vehicle.world.is_armed
        await flight.set_mode("hold")
    elif way == "after its end":
        await vehicle.until(lambda: executor.ends == 1, 20.0)
    else:
        await vehicle.until(lambda: vehicle.world.mode == LAND, 20.0)
    await asyncio.sleep(1.0)
    assert executor.runs == 1
    await flight.set_mode(executor)
    await asyncio.sleep(1.0)
    assert executor.runs == 2
    assert executor.ends == 1 or way == "after its end"  # its takeoff has nothing to do
    await vehicle.until(lambda: executor.ends == 2, 60.0)


class Awaits(Stays):
    """Has a cleanup that waits."""

    async def run(self) -> None:
        try:
            await super().run()
        finally:
            await asyncio.sleep(0.5)


class Raises(Awaits):
    """Has a cleanup that fails after the first run."""

    async def run(self) -> None:
        try:
            await super().run()
        finally:
            if self.runs == 1:
                raise LookupError("no end")


class Swallows(Awaits):
    """Returns when it is cancelled."""

    async def run(self) -> None:
        with suppress(asyncio.CancelledError):
            await super().run()


@by_day(
    ("kind", "pause"),
    [
        *((Stays, 0.2), (Stays, 1.0), (Awaits, 1.0), (Awaits, 0.2)),
        *((Raises, 0.2), (Raises, 1.0), (Swallows, 1.0), (Swallows, 0.2)),
    ],
    2,
)
@flying()
async def test_the_next_run_of_an_executor_is_not_disturbed_by_the_cleanup_of_the_one_before(
    flight: Flight, vehicle: Flown, caplog: pytest.LogCaptureFixture, kind: type[Stays], pause: float
) -> None:
    executor = kind()

    await chosen(flight, executor)
    await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 2.0)
    vehicle.choose(HOLD)
    await asyncio.sleep(pause)
    waiting = asyncio.ensure_future(flight.fly(executor))
    await vehicle.until(lambda: executor.runs == 2, 1.0)
    await asyncio.sleep(1.0)
    assert vehicle.world.mode == TAKEOFF
    await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 20.0)
    await asyncio.sleep(2.0)
    assert not waiting.done()
    assert vehicle.world.flight.position[0] > 1.0
    assert executor.runs == 2
    assert ("no longer in charge, and its end has failed" in caplog.text) == (kind is Raises)


@flying_each()
async def test_a_cleanup_that_fails_after_a_pilot_has_taken_over_does_not_fly(flight: Flight, vehicle: Flown) -> None:
    """Neither does it end the wait of the next user, nor fails the mode."""

    class Breaks(Stays):
        async def run(self) -> None:
            try:
                await super().run()
            finally:
                await asyncio.sleep(1.0)
                raise LookupError("no end")

    await chosen(flight, Breaks)
    await vehicle.until(lambda: vehicle.world.mode == EXTERNAL and vehicle.world.is_armed, 20.0)
    await asyncio.sleep(1.0)
    vehicle.choose(HOLD)
    await asyncio.sleep(0.3)
    sent = len(vehicle.times("vehicle_command_mode_executor"))
    await asyncio.sleep(5.0)
    assert len(vehicle.times("vehicle_command_mode_executor")) == sent
    assert vehicle.world.mode == HOLD


@by_day("seconds", [0.0, 0.005, 0.3, 3.0, 6.0], 2)
@flying()
async def test_a_wait_for_an_executor_that_is_cancelled_ends_its_run(
    flight: Flight, vehicle: Flown, seconds: float
) -> None:
    class Much(Ends):
        async def end(self) -> None:
            await self.fly()

    executor = Much()

    await flight.add(executor)
    waiting = asyncio.ensure_future(flight.fly(executor))
    await asyncio.sleep(seconds)
    waiting.cancel()
    await asyncio.sleep(2.0)
    assert waiting.cancelled()
    sent = len(vehicle.times("vehicle_command_mode_executor"))
    await asyncio.sleep(10.0)
    assert len(vehicle.times("vehicle_command_mode_executor")) == sent
    assert executor.runs <= 1
    assert executor.ends == executor.runs, "it was cancelled"


@flying()
async def test_a_wait_for_an_executor_that_starts_when_it_is_armed_is_told(
    flight: Flight, caplog: pytest.LogCaptureFixture
) -> None:
    class Patient(Ends):
        starts: ClassVar[Start] = "armed"

    await flight.add(Patient)
    waiting = asyncio.ensure_future(flight.fly(Patient))
    await asyncio.sleep(1.0)
    assert "executor Patient starts when the vehicle is armed" in caplog.text
    await flight.arm()
    await waiting


@flying_each()
async def test_an_executor_that_fails_after_disarming_runs_again_when_the_vehicle_is_armed(
    flight: Flight, vehicle: Flown
) -> None:
    """Its mode does not stay refused."""

    class Waits(Ends):
        starts: ClassVar[Start] = "armed"

        async def run(self) -> None:
            self.runs += 1
            await self.wait_disarmed()
            await self.takeoff(5.0)

    executor = Waits()

    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    await chosen(flight, executor)
    for runs in (1, 2):
        await flight.arm()
        await vehicle.until(partial(lambda wanted: executor.runs == wanted, runs), 1.0)
        await flight.disarm()
        await asyncio.sleep(2.0)
