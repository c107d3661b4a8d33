"""What commands that draw again and again on a terminal have in common."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

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
