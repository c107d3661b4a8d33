"""Bars on stderr for what takes over a second."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING, Any, Protocol

from msggen.base.diagnostics import printable
from msggen.base.foreign import guard_output, unguarded, without_commands
from msggen.cli.printing import is_terminal

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

_PATIENCE = 1.0
"""The time in s after which a bar appears."""


class Show(Protocol):
    """A function that shows a share from 0 to 1, and what is done in words."""

    def __call__(self, share: float, text: str = "") -> None:
        """Show a share."""


@contextmanager
def progress_bar(options: argparse.Namespace, *, at_once: bool = False) -> Iterator[Show]:
    """Yield a function that shows progress in a bar, if a terminal shows it: after a second, or at once."""
    if not _is_shown(options):
        yield lambda share, text="": None  # noqa: ARG005 - as Show
        return
    bar = _Bar()
    if at_once:
        bar.start()
    try:
        yield bar.show
    finally:
        bar.close()


@contextmanager
def busy_bar(options: argparse.Namespace, text: str) -> Iterator[None]:
    """Show a bar without a share, for what does not tell how far it is: after a second, if a terminal shows it."""
    if not _is_shown(options):
        yield
        return
    bar = _Bar()
    timer = Timer(_PATIENCE, bar.start, (text, None))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may be starting the bar
        bar.close()


def _is_shown(options: argparse.Namespace) -> bool:
    """Whether a bar can be seen, and is wanted."""
    is_unwanted = getattr(options, "quiet", False) or getattr(options, "json", False)
    return not is_unwanted and is_terminal(sys.stderr)


class _Bar:
    """A bar of rich."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._progress: Any = None
        self._task: Any = None

    def start(self, text: str = "", total: float | None = 1.0) -> None:
        """Show an empty bar. Without a total, it moves but shows no share."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        words = TextColumn("{task.description}", markup=False)
        columns = (BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), words)
        progress = Progress(*columns, console=Console(file=unguarded(sys.stderr)), transient=True)
        self._task = progress.add_task(_shown(text), total=total)
        progress.start()
        guard_output()  # what is printed beside a bar passes through it
        self._progress = progress

    def show(self, share: float, text: str = "") -> None:
        """Show a share and a text, once the command takes over a second."""
        if self._progress is None:
            if time.monotonic() - self._begin < _PATIENCE:
                return
            self.start()
        self._progress.update(self._task, completed=share, description=_shown(text))

    def close(self) -> None:
        """Remove the bar."""
        if self._progress is not None:
            self._progress.stop()


def _shown(text: str) -> str:
    """Return a text as a bar shows it, which writes to the terminal itself."""
    return without_commands(printable(text), is_at_start=False)
