"""The log of commands that speak a protocol on stdout: lines on stderr."""

from __future__ import annotations

import logging
from typing import Any


class _OneLine(logging.Formatter):
    """A log with an exception in one line."""

    def formatException(self, ei: Any) -> str:  # noqa: N802 - the name in logging
        """Return the name and the text of an exception."""
        return f"  {ei[0].__name__}: {ei[1]}".replace("\n", " ")


def log_to_stderr(command: str) -> None:
    """Write warnings to stderr from now on."""
    log = logging.StreamHandler()
    log.setFormatter(_OneLine(f"msggen {command}: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[log])
