"""Programs that fail or are cancelled at any await: what they had set is not sent any more, and PX4 returns."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Generator
from functools import cache
from typing import Any, ClassVar

import pytest

from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from support.flown import SETPOINTS, Flown, chosen, fly, flying

RETURN, LAND, TAKEOFF = 5, 18, 17
ARM = 400
COMMANDS = {"vehicle_command", "vehicle_command_mode_executor"}
_NEVER = 10_000


class Interrupted:
    """Awaits a coroutine, and raises an error in it at its await of a number, counted from 0."""

    def __init__(self, number: int, error: BaseException, tell: Callable[[], None]) -> None:
        self._number, self._error, self._tell = number, error, tell
        self.count = 0

    def __call__(self, coroutine: Coroutine[Any, Any, None]) -> Wrapped:
        return Wrapped(coroutine, self)

    def step(self) -> BaseException | None:
        """Return what is raised at the present await."""
        is_due = self.count == self._number
        self.count += 1
        if is_due:
            self._tell()
        return self._error if is_due else None


class Wrapped:
    def __init__(self, coroutine: Coroutine[Any, Any, None], interrupted: Interrupted) -> None:
        self._coroutine, self._interrupted = coroutine, interrupted

    def __await__(self) -> Generator[Any, Any, None]:
        """Pass on what the coroutine waits for."""
        try:
            waits = self._coroutine.send(None)
            while True:
                error = self._interrupted.step()
                if error is not None:
                    waits.cancel() if isinstance(error, asyncio.CancelledError) else None
                    waits._asyncio_future_blocking = False
                    waits = self._coroutine.throw(error)
                    continue
                try:
                    yield waits
                except BaseException as other:  # noqa: BLE001 - it is passed on
                    waits = self._coroutine.throw(other)
                else:
                    waits = self._coroutine.send(None)
        except StopIteration:
            return


def _program(at_run: Interrupted, at_fly: Interrupted) -> type[Executor]:
    class There(Mode, name="There"):
        async def fly(self) -> None:
            await at_fly(self._go())

        async def _go(self) -> None:
            begin = await self.position()
            await self.goto(begin.shifted(2.0, 0.0))
            await self.hold(0.2)
            self.trajectory(velocity=(1.0, 0.0, 0.0))
            await asyncio.sleep(0.5)
            await self.goto(begin)

    class Mission(Executor):
        mode = There
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await at_run(self._go())

        async def _go(self) -> None:
            await self.arm()
            await self.takeoff(4.0)
            await self.fly()
            await self.land()
            await self.wait_disarmed()

    return Mission


class _Flight:
    """A flight in which something goes wrong, and what is seen of it."""

    def __init__(self, package: Any, part: str, number: int, error: BaseException) -> None:
        self.vehicle: Flown | None = None
        self.was_armed = False
        self.time = 0
        at = Interrupted(number, error, self._tell)
        none = Interrupted(_NEVER, error, self._tell)
        self.counted = at
        self._mission = _program(at, none) if part == "run" else _program(none, at)
        fly(package, self._fly)

    def _tell(self) -> None:
        assert self.vehicle is not None
        self.time, world = self.vehicle.time, self.vehicle.world
        is_commanded = any(getattr(each.message, "command", 0) == ARM for each in self.vehicle.sent)
        self.was_armed = world.is_armed or (is_commanded and not world.commander.disarming_reason)

    async def _fly(self, flight: Flight, vehicle: Flown) -> None:
        self.vehicle = vehicle
        before = asyncio.all_tasks()
        await flight.add(self._mission)
        await flight.set_mode(self._mission.mode)
        for _ in range(4000):
            if self.time or (vehicle.world.commander.disarming_reason and not vehicle.world.is_armed):
                break
            await asyncio.sleep(0.01)
        if self.time:
            await self._watch(vehicle, before)

    async def _watch(self, vehicle: Flown, before: set[asyncio.Task[Any]]) -> None:
        """Check all that must hold after the error."""
        await asyncio.sleep(2.0)
        assert not [each for each in asyncio.all_tasks() - before if not each.done()]
        sent = len(vehicle.sent)
        for _ in range(400):
            assert vehicle.world.is_armed <= self.was_armed  # nothing is armed that was not
            await asyncio.sleep(0.01)
        topics = {each.topic for each in vehicle.sent[sent:]}
        assert not topics & (SETPOINTS | COMMANDS)
        late = [each for each in vehicle.sent if each.time * 1e6 > self.time]
        commands = [(each.message.command, each.message.param1) for each in late if each.topic in COMMANDS]
        assert set(commands) <= {(100_001, float(RETURN)), (100_001, float(LAND))}
        if vehicle.world.is_armed:
            assert vehicle.world.mode in {RETURN, LAND}
        elif vehicle.world.commander.disarming_reason == 0:
            assert not self.was_armed


@cache
def _awaits(package: Any, part: str) -> int:
    return _Flight(package, part, _NEVER, RuntimeError()).counted.count


@pytest.mark.parametrize("step", [16, pytest.param(1, marks=pytest.mark.night)], ids=["some", "all"])
@pytest.mark.parametrize("kind", [RuntimeError, asyncio.CancelledError])
@pytest.mark.parametrize("part", ["run", "fly"])
def test_after_an_error_at_any_await_nothing_is_sent(
    px4_types: Any, part: str, kind: type[BaseException], step: int
) -> None:
    """By day, every 16th await raises an exception, and every 16th one, half-way between them, is cancelled."""
    count = _awaits(px4_types, part)
    assert count > step // 2
    first = 0 if kind is RuntimeError else step // 2
    for number in range(first, count, step):
        found = _Flight(px4_types, part, number, kind())
        assert found.time, number
    print(f"{count} awaits of {part}")


@flying()
async def test_an_executor_that_has_failed_does_not_begin_again(flight: Flight, vehicle: Flown) -> None:
    """PX4 returns, lands and disarms. Its mode is selected still, and the executor in charge: it must not take off."""

    runs: list[int] = []

    class There(Mode, name="There"):
        pass

    class Fails(Executor):
        mode = There
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            runs.append(1)
            await self.arm()
            await self.takeoff(4.0)
            raise LookupError

    await chosen(flight, Fails)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 20.0)
    await vehicle.until(lambda: not vehicle.world.is_armed, 40.0)
    for _ in range(2000):
        await asyncio.sleep(0.01)
        assert not vehicle.world.is_armed
    await flight.set_mode("hold")
    await asyncio.sleep(1.0)
    await flight.set_mode(There)
    await vehicle.until(lambda: vehicle.world.is_armed, 2.0)  # a user has asked for it
    assert len(runs) == 2


@flying()
async def test_a_run_begins_when_the_one_before_has_ended(flight: Flight, vehicle: Flown) -> None:
    """The first run takes a second to end after its cancellation. Meanwhile, the executor comes into charge again."""

    ends: list[str] = []

    class There(Mode, name="There"):
        async def fly(self) -> None:
            await self.hold(1000.0)

    class Slow(Executor):
        mode = There
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            try:
                await self.arm()
                await self.takeoff(4.0)
                await self.fly()
            finally:
                await asyncio.sleep(1.0)
                ends.append("ended")

    await chosen(flight, Slow)
    await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 20.0)
    await flight.set_mode("hold")
    await asyncio.sleep(0.3)
    await flight.set_mode(There)
    await asyncio.sleep(2.0)
    assert ends == ["ended"]
    await flight.set_mode("land")
    await asyncio.sleep(2.0)
    assert ends == ["ended"] * 2


@flying()
async def test_an_executor_that_stops_to_wait_for_a_mode_ends_it(flight: Flight, vehicle: Flown) -> None:
    """The vehicle holds its place, and the executor goes on."""

    class Away(Mode, name="Away"):
        async def fly(self) -> None:
            await self.goto((500.0, 0.0, -4.0))

    class Patient(Executor):
        mode = Away
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await self.arm()
            await self.takeoff(4.0)
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(self.fly(), 3.0)
            speeds.append(vehicle.world.flight.velocity[0])
            await asyncio.sleep(6.0)
            speeds.append(vehicle.world.flight.velocity[0])
            await self.land()

    speeds: list[float] = []

    await chosen(flight, Patient)
    await vehicle.until(lambda: vehicle.world.mode == LAND, 30.0)
    assert speeds[0] > 1.0
    assert abs(speeds[1]) < 0.2


def test_an_exception_after_a_refused_flight_is_told(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    """An executor that was refused its mode waits for it no more: the next one who selects it is told what fails."""
    from msggen.flight.checks import Problem
    from msggen.flight.errors import RefusedError

    class Owned(Mode, name="Owned"):
        pass

    class Picky(Mode, name="Picky"):
        is_ready = False

        def problems(self) -> list[Problem]:
            return [] if self.is_ready else [Problem("not_ready")]

        async def fly(self) -> None:
            raise LookupError("no target")

    picky = Picky()

    class Tries(Executor):
        mode = Owned
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await self.arm()
            await self.takeoff(4.0)
            with pytest.raises(RefusedError):
                await self.fly(Picky)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Tries, picky)
        await flight.set_mode(Owned)
        await asyncio.sleep(10.0)
        picky.is_ready = True
        await asyncio.sleep(1.0)
        await flight.set_mode(Picky)
        await vehicle.until(lambda: vehicle.world.mode == RETURN, 2.0)

    fly(px4_types, program)
    assert "mode 'Picky' has failed" in caplog.text


def test_conditions_that_raise_an_exception_say_no(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Mode):
        is_broken = False

        def problems(self) -> tuple[()]:
            if self.is_broken:
                raise ZeroDivisionError
            return ()

        async def fly(self) -> None:
            await self.hold(1000.0)

    mode = Broken()

    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(mode)
        await vehicle.in_air(flight)
        await flight.set_mode(Broken)
        await asyncio.sleep(1.0)
        mode.is_broken = True
        return await vehicle.until(lambda: vehicle.world.mode == RETURN, 2.0)

    assert fly(px4_types, program) < 0.6  # and not after 1 s without any reply
    assert "`problems` of mode 'Broken' has failed" in caplog.text
