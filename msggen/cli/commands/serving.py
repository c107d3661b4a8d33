"""What `msggen link serve` prints: who comes and goes, and in a terminal how many samples arrive."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted
from msggen.cli.screen import Status

if TYPE_CHECKING:
    from msggen.vehicle.owner.owner import Owner

_TURN_S = 1.0
"""How often the state is shown again, in s: the owner measures its rate as often."""
_LAST_S = 1.0
"""The longest wait in s for the last lines to be printed."""


class Events(logging.Handler):
    """Prints what the owner of a link tells, and in a terminal its state in a line below.

    A thread prints: a terminal that is stopped (Ctrl-S), or a full pipe, does not delay the link.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
        self._status = Status(is_quiet=False)
        self._owner: Owner | None = None
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._print, name="msggen-events", daemon=True)
        self._thread.start()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a line soon."""
        self._lines.put(self.format(record))

    def follow(self, owner: Owner) -> None:
        """Show the state of an owner from now on, if there is a terminal."""
        self._owner = owner

    def close(self) -> None:
        """Remove the state, and print what is left."""
        self._owner = None
        self._lines.put(None)
        self._thread.join(_LAST_S)
        super().close()

    def _print(self) -> None:
        """Print lines until `close`, or until nobody reads them: the link goes on without."""
        line: str | None = ""
        with suppress(BrokenPipeError):
            while line is not None:
                try:
                    line = self._lines.get(timeout=_TURN_S)
                except Empty:
                    line = ""
                self._status.show(*filter(None, (line,)), state=self._state)

    def _state(self) -> str:
        """Return who uses the link, and what arrives, for people."""
        owner = self._owner
        if owner is None:
            return ""
        with owner.lock:
            programs = sum(program.has_joined for program in owner.programs)
            lost = sum(vehicle.lost for vehicle in owner.vehicles.values())
            users = f"{counted(len(owner.vehicles), 'vehicle')}, {counted(programs, 'program')}"
        return f"{users}, {owner.rate:.0f} samples/s, {lost} lost"


@contextmanager
def printed_events(logger: logging.Logger) -> Iterator[Events]:
    """Print what a logger is told, and nothing else of it."""
    events, level = Events(), logger.level
    logger.addHandler(events)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield events
    finally:
        logger.removeHandler(events)
        events.close()
        logger.setLevel(level)
        logger.propagate = True
