"""The simulated vehicle of a test."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from types import CodeType, ModuleType, TracebackType
from typing import Any, Concatenate, ParamSpec, TypeVar

from msggen.flight.flight import Flight
from msggen.flight.pytest.faults import Faults
from msggen.flight.pytest.flown import Flown, Recording, Sent, mode_name
from msggen.flight.runners import CallerRunner
from msggen.sim import Options
from msggen.sim.loop import SimulatedLoop
from msggen.sim.near import NearVehicle

_Result = TypeVar("_Result")
_Parameters = ParamSpec("_Parameters")
_LOOK = 0.05
"""The period in s at which a condition is checked."""
_BEFORE = 1_000_000
"""The time in us since boot when a test begins."""


class Airspace:
    """Vehicles that share a clock. Vehicles can be added at any time."""

    def __init__(self) -> None:
        self.vehicles: list[SimVehicle] = []

    @property
    def time(self) -> int:
        """The time in us."""
        return max((each.time for each in self.vehicles), default=0)

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        return min((each.next_time for each in self.vehicles), default=self.time + _BEFORE)

    def advance(self, now: int) -> None:
        """Move on to a time."""
        for each in self.vehicles:
            if each.next_time <= now:
                each.advance(now)

    def run(self, coroutine: Coroutine[Any, Any, _Result], limit: float) -> _Result:
        """Run a coroutine on the clock. Raises TimeoutError after `limit` s of flight."""
        __tracebackhide__ = True
        runner = CallerRunner(self.new_loop())
        try:
            return runner.run(_limited(coroutine, limit))
        except BaseException as error:
            error.__traceback__ = _inside(error.__traceback__, getattr(coroutine, "cr_code", None))
            raise
        finally:
            runner.close()

    def new_loop(self) -> SimulatedLoop:
        """Return an event loop on the clock."""
        return SimulatedLoop([self], self.time)


class SimVehicle(NearVehicle, Flown):
    """A vehicle in the process of the test: `Flight(sim_vehicle)` and `BlockingFlight(sim_vehicle)` fly it.

    Its clock advances while programs wait. `limit` is the time in s after which a program that has not ended fails.
    """

    def __init__(
        self,
        package: ModuleType,
        options: Options = Options(),  # noqa: B008 - it is immutable
        *,
        recording: Recording | None = None,
        limit: float = 600.0,
        airspace: Airspace | None = None,
    ) -> None:
        NearVehicle.__init__(self, package, options)
        Flown.__init__(self)
        self._recording, self._limit = recording, limit
        self.airspace = Airspace() if airspace is None else airspace
        """All vehicles that share the clock."""
        self.faults = Faults(self, f"{options.seed} {options.key}")
        """Faults on request: `sim_vehicle.faults.lose_link(2.0, at=12.0)`."""
        begin = max(_BEFORE, self.airspace.time)
        self.airspace.vehicles.append(self)
        while self.time < begin:
            self.advance(self.next_time)

    def __repr__(self) -> str:
        return f"<SimVehicle at {self.time / 1e6:.2f} s: {self.state}>"

    # Programs

    def run(
        self,
        program: Callable[Concatenate[Flight, _Parameters], Coroutine[Any, Any, _Result]],
        *arguments: _Parameters.args,
        **options: _Parameters.kwargs,
    ) -> _Result:
        """Run a coroutine function with a `Flight` of this vehicle, and return its result.

        Can be called again: the vehicle continues as it is. Raises TimeoutError after `limit` s of flight.
        """
        __tracebackhide__ = True

        async def main() -> _Result:
            __tracebackhide__ = True
            async with Flight(self) as flight:
                return await program(flight, *arguments, **options)

        return self.run_coroutine(main())

    def run_coroutine(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        """Run a coroutine on the clock of the vehicle. Raises TimeoutError after `limit` s of flight."""
        __tracebackhide__ = True
        return self.airspace.run(coroutine, self._limit)

    def new_loop(self) -> SimulatedLoop:
        """Return an event loop on the clock of the vehicle."""
        return self.airspace.new_loop()

    async def until(self, condition: Callable[[], bool], seconds: float = 60.0) -> float:
        """Wait until a condition holds. Return how long this took in s. Raises TimeoutError."""
        begin = self.time
        while not condition():
            if self.time - begin >= seconds * 1e6:
                raise TimeoutError(f"the condition does not hold after {seconds:g} s: {self.state}")
            await asyncio.sleep(_LOOK)
        return (self.time - begin) / 1e6

    # What was flown

    @property
    def mode(self) -> str:
        """The name of the active mode."""
        return mode_name(self.world)

    @property
    def is_armed(self) -> bool:
        """Whether the vehicle is armed."""
        return self.world.is_armed

    @property
    def position(self) -> tuple[float, float, float]:
        """Where the vehicle is, relative to its start: north, east and down in m."""
        return self.world.flight.position

    @property
    def state(self) -> str:
        """The state as a text for people, such as `armed, takeoff`."""
        return self.world.state(was_armed=False)

    @property
    def recording(self) -> str | None:
        """The path of the ULog that is written."""
        return None if self._recording is None else self._recording.path

    # What the clock and programs call

    def advance(self, now: int) -> None:
        """See NearVehicle."""
        self.faults.advance(now)
        super().advance(now)
        self._observe(self.world, now)
        if self._recording is not None:
            self._recording.observe(self.world, now)

    def publish(self, topic: str, message: Any) -> None:
        """See NearVehicle."""
        super().publish(topic, message)
        self._sent.append(Sent(self.time / 1e6, topic, message))

    def loses(self, topic: str) -> bool:
        """See NearVehicle."""
        return self.faults.loses(topic)

    def close(self, *, is_kept: bool) -> None:
        """End the recording, and remove it unless it is kept."""
        if self._recording is not None:
            self._recording.close(is_kept=is_kept)

    def _receive(self, topic: str, message: Any) -> None:
        super()._receive(topic, message)
        if self._recording is not None:
            self._recording.add(topic, message)

    def _send(self, topic: str, message: Any) -> None:
        if self._recording is not None:
            self._recording.add(topic, message)
        super()._send(topic, message)


def _inside(trace: TracebackType | None, code: CodeType | None) -> TracebackType | None:
    """Return the part of a traceback from a coroutine on, without the event loop. Return all of it if there is none."""
    found = trace
    while found is not None and found.tb_frame.f_code is not code:
        found = found.tb_next
    return found or trace


async def _limited(coroutine: Coroutine[Any, Any, _Result], limit: float) -> _Result:
    task = asyncio.ensure_future(coroutine)
    try:
        await asyncio.wait([task], timeout=limit)
    except BaseException:
        task.cancel()
        raise
    if not task.done():
        task.cancel()
        await asyncio.wait([task], timeout=1.0)
        raise TimeoutError(f"the program has not ended after {limit:g} s of flight")
    return task.result()
