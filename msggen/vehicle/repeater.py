"""Messages that are published at a rate."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from logging import getLogger
from typing import TYPE_CHECKING, NamedTuple

from msggen.link.link import NotConnectedError
from msggen.messages.packages import Message

if TYPE_CHECKING:
    from typing_extensions import Self

LOGGER = getLogger("msggen.live")

_thread = threading.local()
"""Has the attribute `repeats` in the threads of repeaters."""


class Jitter(NamedTuple):
    """How punctual a repeater is."""

    sent: int
    """The messages that were published."""
    late: int
    """The times that were left out, because the program was more than a period late."""
    skipped: int
    """The times at which no vehicle was connected, or the callable returned None."""
    worst: float
    """The longest delay of a message, in s."""
    mean: float
    """The mean delay of all messages, in s."""


class Repeater:
    """Publishes a message at a rate, in a thread of its own, until `close`.

    No message is sent twice to make up for a late one. While no vehicle is connected, nothing is sent. A message that
    cannot be published, or a callable that raises, ends the repeater: the error is logged, and `error` has it.
    """

    def __init__(
        self, hz: float, message: Message | Callable[[], Message | None], publish: Callable[[Message], None]
    ) -> None:
        if not 0 < hz <= 1e4:  # noqa: PLR2004 - a thread of Python is not faster
            raise ValueError(f"expected a rate above 0 and up to 10000 Hz, got {hz}")
        self._period = 1 / hz
        self._message, self._publish = message, publish
        self._ended = threading.Event()
        self._count = self._late = self._skipped = 0
        self._worst = self._total = 0.0
        self.error: Exception | None = None
        """The exception that ended the repeater."""
        self._thread = threading.Thread(target=self._run, name=f"msggen.live every {hz:g} Hz", daemon=True)

    def __repr__(self) -> str:
        state = "running" if self.is_running else f"ended by {self.error!r}" if self.error else "closed"
        return f"<Repeater at {1 / self._period:g} Hz: {state}, {self.jitter}>"

    @property
    def is_running(self) -> bool:
        """Whether messages are still published."""
        return self._thread.is_alive()

    @property
    def jitter(self) -> Jitter:
        """How punctual the repeater is, since its start."""
        count = self._count
        return Jitter(count, self._late, self._skipped, self._worst, self._total / count if count else 0.0)

    def start(self) -> None:
        """Begin to publish."""
        self._thread.start()

    def close(self) -> None:
        """End the repeater. Can be repeated. No message is published after it returns.

        Callables of repeaters can call it. It does not wait in them: two would wait for each other.
        """
        self._ended.set()
        if not hasattr(_thread, "repeats") and self._thread.ident is not None:
            self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        _thread.repeats = True
        due = time.monotonic()
        while not self._ended.is_set():
            delay = time.monotonic() - due
            try:
                is_sent = self._send()
            except ReferenceError:  # the Vehicle was forgotten
                return
            except Exception as error:
                self.error = error
                LOGGER.exception("a repeater at %g Hz ends", 1 / self._period)
                return
            if is_sent:
                self._count += 1
                self._worst = max(self._worst, delay)
                self._total += delay
            else:
                self._skipped += 1
            due += self._period
            behind = int((time.monotonic() - due) / self._period)
            if behind > 0:
                self._late += behind
                due += behind * self._period
            self._ended.wait(max(0.0, due - time.monotonic()))

    def _send(self) -> bool:
        message = self._message() if callable(self._message) else self._message
        if message is None:
            return False
        try:
            self._publish(message)
        except NotConnectedError:
            return False
        return True
