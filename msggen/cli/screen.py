"""What commands that draw again and again on a terminal have in common: a screen, or a line with their state."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from msggen.base.foreign import Styled
from msggen.cli.printing import is_terminal, terminal_width

_NOTICES = 20
"""The number of warnings that are kept."""


def can_draw() -> bool:
    """Whether there is a terminal that can be drawn on. Windows has no termios."""
    if not sys.stdout.isatty() or os.environ.get("TERM", "dumb") == "dumb":
        return False
    try:
        import termios  # noqa: F401
    except ImportError:
        return False
    return True


@contextmanager
def held_warnings() -> Iterator[Sequence[str]]:
    """Collect the warnings about the link, which would spoil the screen, and print them at the end."""
    from logging import Handler, LogRecord, getLogger

    texts: list[str] = []

    class _Collector(Handler):
        def emit(self, record: LogRecord) -> None:
            texts.append(record.getMessage())
            del texts[:-_NOTICES]

    logger, collector = getLogger("msggen.live"), _Collector()
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield texts
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagates
        for text in texts:
            print(text, file=sys.stderr)


class Status:
    """Lines that stay, and in a terminal a line below them with the state, which the next call replaces."""

    def __init__(self, *, is_quiet: bool) -> None:
        self._is_quiet = is_quiet
        self._has_state = is_terminal(sys.stdout)

    def show(self, *lines: str, state: Callable[[], str] = str) -> None:
        """Print `lines` and the new state, by default none, unless it is quiet. Programs can read them at once."""
        if self._is_quiet:
            return
        if self._has_state:
            print(Styled("\r\033[K"), end="")
        for line in lines:
            print(line)
        if self._has_state:
            print(state()[: terminal_width(80) - 1], end="")
        print(end="", flush=True)
