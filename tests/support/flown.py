"""Programs that fly a simulated vehicle in their own process, on its clock."""

from __future__ import annotations

import asyncio
import functools
import inspect
import random
from collections.abc import Callable, Coroutine
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from msggen.flight.executor import Executor
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.sim import Options
from msggen.sim.loop import SimulatedLoop, run
from msggen.sim.near import NearVehicle

_Result = TypeVar("_Result")
EXTERNAL = 23
SETPOINTS = {"goto_setpoint", "trajectory_setpoint", "vehicle_attitude_setpoint", "vehicle_rates_setpoint"}
CORNERS = ((5.0, 0.0), (5.0, 5.0), (0.0, 0.0))
_TAKEOFF = 17
_THRUSTING = 1_800_000
"""A time in us from the start of the motors at which they nearly lift the vehicle."""
_BELOW = 1.0
"""How far below the end of a takeoff the climb goes on, in m."""


class Line(Mode, name="Line"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.goto((50.0, 0.0, -10.0))


class Short(Mode, name="Short"):
    """Flies to a place."""

    async def fly(self) -> None:
        await self.goto((3.0, 0.0, -10.0))


class Square(Mode, name="Square"):
    """Flies a square."""

    async def fly(self) -> None:
        begin = await self.position()
        for x, y in CORNERS:
            await self.goto(begin.shifted(x, y))


class Tour(Executor):
    """Takes off, flies the square, and lands."""

    mode = Square

    async def run(self) -> None:
        await self.takeoff(5.0)
        await self.fly()
        await self.land()


class Sent(NamedTuple):
    """A message of a program."""

    time: float
    topic: str
    message: Any


class Flown(NearVehicle):
    """A vehicle that keeps what programs send."""

    def __init__(self, package: ModuleType, options: Options = Options()) -> None:  # noqa: B008 - it is immutable
        super().__init__(package, options)
        self.sent: list[Sent] = []
        self.loss = 0.0
        """The share of messages that get lost, each way. 1: programs and vehicle do not hear each other."""
        self.lost: set[str] = set()
        """The topics of which no message arrives."""
        self._losses: dict[str, random.Random] = {}
        """For each topic, so that what is lost of it does not depend on how often others are published."""

    def loses(self, topic: str) -> bool:
        if topic in self.lost or self.loss == 0.0:
            return topic in self.lost
        if topic not in self._losses:
            seed = f"losses {self._options.seed} {self._options.key} {topic}"
            self._losses[topic] = random.Random(seed)  # noqa: S311 - not for secrets
        return self._losses[topic].random() < self.loss

    def advance(self, now: int) -> None:
        """Move on to a time. In a takeoff, the seconds are left out in which motors start that do not lift yet.

        A vehicle whose height drifts leaves the ground later.
        """
        super().advance(now)
        lift, world = getattr(self.world.autopilot, "lift", None), self.world
        if lift is None:
            return
        is_idle = lift._start is None and lift.climb < 0.0
        if is_idle and world.is_armed and world.mode == _TAKEOFF and not self._options.disturbances:
            lift._start = now - _THRUSTING

    def publish(self, topic: str, message: Any) -> None:
        self.sent.append(Sent(self.time / 1e6, topic, message))
        super().publish(topic, message)

    def times(self, topic: str) -> list[float]:
        """Return when messages of a topic were sent, in s."""
        return [each.time for each in self.sent if each.topic == topic]

    def lose_position(self, *, is_lost: bool = True) -> None:
        """Lose the position at once, or find it again."""
        self.world.has_position = self.world.has_gps = not is_lost

    def choose(self, mode: int) -> None:
        """Select a mode by its nav_state, as a pilot does."""
        self.world.command(100_001, [float(mode), *[0.0] * 6])

    def kill(self) -> None:
        """Disarm at once, also in the air."""
        self.world.command(400, [0.0, 21196.0, *[0.0] * 5])

    async def restart_after(self, seconds: float) -> None:
        """Restart the vehicle as PX4 does: it is not heard for some time before."""
        self.loss = 1.0
        await asyncio.sleep(seconds)
        self.restart()
        self.loss = 0.0

    def hang(self, seconds: float) -> None:
        """Let the vehicle move while the event loop of the program stands still. To be called in the program."""
        loop = asyncio.get_running_loop()
        assert isinstance(loop, SimulatedLoop)
        loop.block(seconds)

    async def until(self, condition: Callable[[], bool], seconds: float) -> float:
        """Wait until something is so. Return how long that took in s. Fails after some time."""
        begin = self.time
        while not condition():
            assert self.time - begin < seconds * 1e6, self.world.state(was_armed=False)
            await asyncio.sleep(0.01)
        return (self.time - begin) / 1e6

    async def in_air(self, flight: Flight, height: float = 10.0) -> None:
        """Arm and take off as a user does. The climb is left out, which takes longest: the vehicle is soon on top."""
        await flight.arm()
        climbing = asyncio.ensure_future(flight.takeoff(height))
        motion, top = self.world.flight, _BELOW - height - self.world.home.altitude + self.world.origin.altitude
        await self.until(lambda: climbing.done() or motion.position[2] < motion.ground - 0.5, 20.0)
        motion.position = (*motion.position[:2], min(motion.position[2], top))
        await climbing
        await self.until(lambda: self.world.mode == 4, 2.0)

    async def in_mode(self, flight: Flight, mode: Mode | type[Mode]) -> None:
        """Register a mode, take off, and select it."""
        await flight.add(mode)
        await self.in_air(flight)
        await flight.set_mode(mode)


async def up(flight: Flight, vehicle: Flown, mode: Mode | type[Mode] | None = None, height: float = 30.0) -> None:
    """Register a mode if one is given, and take off, until the vehicle is in Hold."""
    if mode is not None:
        await flight.add(mode)
    await flight.arm()
    await flight.takeoff(height)
    await vehicle.until(lambda: vehicle.world.mode == 4, 2.0)


async def chosen(flight: Flight, part: Any) -> None:
    """Register a mode or an executor, and select it."""
    await flight.add(part)
    await flight.set_mode(part)


def fly(
    package: ModuleType,
    program: Callable[[Flight, Flown], Coroutine[Any, Any, _Result]],
    options: Options = Options(),  # noqa: B008 - it is immutable
    *,
    made: type[Flown] = Flown,
    **given: Any,
) -> _Result:
    """Run a program with a vehicle that has stood for 1 s, and return what it returns. The Flight has what is given."""
    vehicle = made(package, options)

    async def main() -> _Result:
        await asyncio.sleep(1.0)
        async with Flight(vehicle, **given) as flight:
            return await program(flight, vehicle)

    return run(main(), vehicle)


Test = Callable[..., Coroutine[Any, Any, None]]


def flying(options: Options = Options(), *, types: str = "px4_types", **given: Any) -> Callable[[Test], Any]:  # noqa: B008 - it is immutable
    """Return a decorator of tests that fly, with the types of a fixture: they take a `flight`, and its `vehicle`."""

    def decorated(test: Test) -> Any:
        taken = dict(inspect.signature(test).parameters)
        own = {name: taken.pop(name, None) for name in ("flight", "vehicle")}
        fixtures = {types: inspect.Parameter(types, inspect.Parameter.KEYWORD_ONLY)} | taken

        @functools.wraps(test)
        def run_it(**found: Any) -> None:
            async def program(flight: Flight, vehicle: Flown) -> None:
                values = {"flight": flight, "vehicle": vehicle}
                await test(**{name: each for name, each in values.items() if own[name]}, **{n: found[n] for n in taken})

            fly(found[types], program, options, **given)

        del run_it.__wrapped__  # otherwise, pytest sees the parameters of the test
        kinds = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in fixtures.values()]
        vars(run_it)["__signature__"] = inspect.Signature(kinds)
        return run_it

    return decorated


flying_each = functools.partial(flying, types="types")
"""The same in each release that has modes."""
