"""Whether what is published gets through to a vehicle, and what the user is told of it."""

from __future__ import annotations

from logging import getLogger

from msggen.base.diagnostics import counted
from msggen.live.age import LATE

LOGGER = getLogger("msggen.live")


class Delivery:
    """Tells when messages begin not to get through, and when they get through again."""

    def __init__(self) -> None:
        self._problem = ""
        self._dropped = 0

    def take(self, problem: str, dropped: int) -> None:
        """Take why messages do not get through, "" if they do, and how many were dropped so far."""
        if problem and not self._problem:
            LOGGER.warning("messages to the vehicle do not get through: %s", problem)
        elif not problem and dropped > self._dropped:
            LOGGER.warning("%s to the vehicle %s", counted(dropped - self._dropped, "message"), LATE)
        if not problem:
            self._dropped = dropped
        self._problem = problem
