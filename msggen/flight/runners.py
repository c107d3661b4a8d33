"""Event loops for programs without asyncio: in a separate thread, or in the calling thread."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, wait
from contextlib import suppress
from typing import Any, TypeVar

from msggen.flight.errors import FlightError

_Result = TypeVar("_Result")
_LOOK = 0.2
"""The period in s at which a thread checks whether another one has ended."""
_PATIENCE = 2.0
"""How long to wait for the end of a task, and of the thread, in s."""
_HANGS = 3.0
"""The time in s after which a loop that does nothing counts as hanging."""
_LIFE = 0.5
"""The time in s for which a program counts as alive after its last call."""


class CallerRunner:
    """A loop in the calling thread, for a simulated vehicle: time stands still between two calls."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def run(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        """Run a coroutine, and return what it returns. Raises FlightError after the end."""
        if self._loop.is_closed():
            raise _closed(coroutine)
        task = self._loop.create_task(coroutine)
        try:
            return self._loop.run_until_complete(task)
        except BaseException:
            task.cancel()  # after a Ctrl-C
            raise

    def is_alive(self) -> bool:
        """Return True: time stands still while the program does something else."""
        return True

    def close(self) -> None:
        """End all tasks."""
        if not self._loop.is_closed():
            self._loop.run_until_complete(_end())
            self._loop.close()


class ThreadRunner:
    """A loop in a separate thread, which ends with the thread that created it. `at_end` runs last."""

    def __init__(self, at_end: Callable[[], Coroutine[Any, Any, object]]) -> None:
        self._at_end = at_end
        self._owner = threading.current_thread()
        self._loop = asyncio.new_event_loop()
        self._is_closing = asyncio.Event()
        self._calls = 0
        self._called = self._beat = time.monotonic()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._work, name="msggen flight", daemon=True)
        self._thread.start()

    def run(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        """See CallerRunner. An exception in this thread, such as a KeyboardInterrupt, cancels the coroutine."""
        if threading.current_thread() is self._thread:
            coroutine.close()
            raise FlightError("a mode or an executor cannot call this: it would wait for itself")
        with self._lock:
            if self._loop.is_closed():
                raise _closed(coroutine)
            future = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
            self._calls += 1
        try:
            return self._result(future)
        except BaseException:
            future.cancel()
            raise
        finally:
            with self._lock:
                self._calls -= 1
                self._called = time.monotonic()

    def is_alive(self) -> bool:
        """Whether the program runs: it waits for a coroutine, or waited for one within the last 0.5 s."""
        return self._owner.is_alive() and (self._calls > 0 or time.monotonic() - self._called < _LIFE)

    def close(self) -> None:
        """End all tasks. If a task does not end, its thread is left running, with a warning."""
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._is_closing.set)
        self._thread.join(2 * _PATIENCE)
        if self._thread.is_alive():
            logging.getLogger(__name__).warning("a mode or an executor does not end: its thread is left running")

    def _result(self, future: Future[_Result]) -> _Result:
        while not wait([future], _LOOK).done:  # so that a signal is seen on every system
            if not self._thread.is_alive():
                raise FlightError("the flight has ended")
            if time.monotonic() - self._beat > _HANGS:
                raise FlightError(f"a mode or an executor has blocked the loop for {_HANGS:g} s: use asyncio there")
        return future.result()

    def _work(self) -> None:
        try:
            self._loop.run_until_complete(self._live())
            self._loop.run_until_complete(_end())
        finally:
            with self._lock:
                self._loop.close()

    async def _live(self) -> None:
        closing = asyncio.ensure_future(self._is_closing.wait())
        while not closing.done() and self._owner.is_alive():
            self._beat = time.monotonic()
            await asyncio.wait([closing], timeout=_LOOK)
        closing.cancel()
        await self._at_end()


async def _end() -> None:
    """Cancel all tasks, and wait a limited time for their end."""
    left = asyncio.all_tasks() - {asyncio.current_task()}
    for task in left:
        task.cancel()
    if left:
        await asyncio.wait(left, timeout=_PATIENCE)
    await asyncio.get_running_loop().shutdown_asyncgens()


def _closed(coroutine: Coroutine[Any, Any, object]) -> FlightError:
    coroutine.close()
    return FlightError("the flight has ended, or has not begun: use `with BlockingFlight(...) as flight`")
