"""The end of a program that flies: by a signal, even while it computes, and at the exit of the interpreter."""

from __future__ import annotations

import asyncio
import atexit
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

_TERMINATED = 128 + signal.SIGTERM
"""The exit code of a program that was ended by SIGTERM."""


class Ending:
    """Tells the vehicle when a program ends, and cancels its task at SIGTERM.

    Signals are handled only if the event loop runs in the main thread. A SIGTERM handler of the program is kept.
    """

    def __init__(self, release: Callable[[], None]) -> None:
        """Take the function that tells the vehicle. It is called from any thread, and may be called several times."""
        self._release = release
        self._task = asyncio.current_task()
        self._loop = asyncio.get_running_loop()
        self.is_terminated = False

    def begin(self) -> None:
        """Start to watch for the end."""
        atexit.register(self._release)
        if threading.current_thread() is threading.main_thread():
            _handlers.add(self)

    def close(self) -> None:
        """Stop watching."""
        atexit.unregister(self._release)
        _handlers.remove(self)

    def leave(self, error: BaseException | None) -> None:
        """Raise SystemExit instead of the cancellation that SIGTERM has caused."""
        if self.is_terminated and isinstance(error, asyncio.CancelledError):
            raise SystemExit(_TERMINATED) from None

    def take(self, number: int) -> None:
        """Handle a signal. Another thread tells the vehicle: the program may hang or hold a lock of the link."""
        threading.Thread(target=self._release, name="msggen flight end", daemon=True).start()
        if number == signal.SIGTERM and self._task is not None:
            self.is_terminated = True
            self._loop.call_soon_threadsafe(self._task.cancel)


class _Handlers:
    """The handlers of signals, while there are flights in the main thread."""

    def __init__(self) -> None:
        self._endings: list[Ending] = []
        self._before: dict[int, Any] = {}

    def add(self, ending: Ending) -> None:
        """Install the handlers for the first flight."""
        self._endings.append(ending)
        if len(self._endings) > 1:
            return
        for number in (signal.SIGINT, signal.SIGTERM):
            before = signal.getsignal(number)
            if (number == signal.SIGINT and callable(before)) or before is signal.SIG_DFL:
                self._before[number] = before
                signal.signal(number, self._take)

    def remove(self, ending: Ending) -> None:
        """Restore the previous handlers after the last flight."""
        if ending not in self._endings:
            return
        self._endings.remove(ending)
        if self._endings:
            return
        for number, before in self._before.items():
            if signal.getsignal(number) == self._take:
                signal.signal(number, before)
        self._before.clear()

    def _take(self, number: int, frame: FrameType | None) -> None:
        before = self._before.get(number)
        for ending in [*self._endings]:
            ending.take(number)
        if callable(before):
            before(number, frame)


_handlers = _Handlers()
