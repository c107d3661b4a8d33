"""An event loop of asyncio on the clock of simulated vehicles: programs run as fast as they can be computed.

`asyncio.sleep(60)` takes as long as it takes to simulate the vehicles for 60 s. Programs and vehicles share the clock,
so each run is the same.
"""

from __future__ import annotations

import asyncio
import math
import selectors
from collections.abc import Callable, Coroutine, Sequence
from contextvars import Context
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from typing_extensions import TypeVarTuple, Unpack

    _Arguments = TypeVarTuple("_Arguments")

_Result = TypeVar("_Result")


class Simulated(Protocol):
    """What moves with the clock. Times are in us."""

    @property
    def next_time(self) -> int:
        """The time at which something happens next."""

    def advance(self, now: int) -> None:
        """Move on to a time."""


class _Clock:
    """The time of a loop, and what moves with it."""

    def __init__(self, simulated: Sequence[Simulated], start: int) -> None:
        self.time = start
        self._simulated = simulated

    def advance(self, until: int | None) -> None:
        """Move on to the next thing that happens, but not beyond a time."""
        times = [each.next_time for each in self._simulated]
        self.time = max(self.time, min(times if until is None else [*times, until]))
        for each in self._simulated:
            if each.next_time <= self.time:
                each.advance(self.time)


class _Selector(selectors.DefaultSelector):
    """Waits by moving the clock on."""

    clock: _Clock
    loop: SimulatedLoop

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return the sockets that are ready. Instead of waiting, let the vehicles move until a program has to run."""
        found = super().select(0)
        until = None if timeout is None else self.clock.time + math.ceil(timeout * 1e6)
        self.loop.is_due = False
        while not found and not self.loop.is_due and (until is None or self.clock.time < until):
            self.clock.advance(until)
            found = super().select(0)
        return found


class SimulatedLoop(asyncio.SelectorEventLoop):
    """An event loop whose time is that of simulated vehicles, in s since `start`, which is in us since boot."""

    def __init__(self, simulated: Sequence[Simulated], start: int = 0) -> None:
        self._simulation = _Clock(simulated, start)
        self.is_due = False
        """Whether a callback has come since the last wait."""
        selector = _Selector()
        selector.clock, selector.loop = self._simulation, self
        super().__init__(selector)

    def time(self) -> float:
        """Return the time of the vehicles in s."""
        return self._simulation.time / 1e6

    def block(self, seconds: float) -> None:
        """Let time pass while the program stands still, as `time.sleep` does."""
        end = self._simulation.time + round(seconds * 1e6)
        while self._simulation.time < end:
            self._simulation.advance(end)

    def call_soon(
        self,
        callback: Callable[[Unpack[_Arguments]], object],
        *args: Unpack[_Arguments],
        context: Context | None = None,
    ) -> asyncio.Handle:
        """See asyncio."""
        self.is_due = True
        return super().call_soon(callback, *args, context=context)


def run(main: Coroutine[Any, Any, _Result], *simulated: Simulated, start: int = 0) -> _Result:
    """Run a coroutine as `asyncio.run` does, on the clock of simulated vehicles."""
    loop = SimulatedLoop(simulated, start)
    try:
        return loop.run_until_complete(main)
    finally:
        loop.run_until_complete(_end())
        loop.close()


async def _end() -> None:
    """End what a program has left."""
    loop = asyncio.get_running_loop()
    left = asyncio.all_tasks() - {asyncio.current_task()}
    for task in left:
        task.cancel()
    await asyncio.gather(*left, return_exceptions=True)
    await loop.shutdown_asyncgens()
    await loop.shutdown_default_executor()
