"""Exceptions that stand for Ctrl-C."""

from __future__ import annotations


def is_interrupt(error: BaseException) -> bool:
    """Whether an exception is Ctrl-C, or was raised while Ctrl-C ended something.

    KeyboardInterrupt in `threading.Condition.wait` becomes a RuntimeError if it comes before the lock is taken again.
    """
    found: BaseException | None = error
    while found is not None and not isinstance(found, KeyboardInterrupt):
        found = found.__context__
    return found is not None
