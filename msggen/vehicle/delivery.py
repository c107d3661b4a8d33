"""Messages to vehicles: whether they get through, and what the user is told of it."""

from __future__ import annotations

from logging import getLogger

from msggen.base.diagnostics import counted
from msggen.link.age import LATE
from msggen.link.link import Link, Remote, Route, StaleError

LOGGER = getLogger("msggen.live")


class Delivery:
    """Publishes on a link. Tells when messages begin not to get through, and when they get through again."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._late = 0
        """Messages that the link has dropped at once."""
        self._problem = ""
        self._dropped = 0

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int) -> None:
        """Send a sample to a vehicle until a time. Raises LinkError, but not StaleError: that is told."""
        problem = ""
        try:
            self._link.publish(remote, route, payload, until)
        except StaleError as error:
            problem = str(error)
            self._late += 1
        self.take(problem or self._link.problem(), self._late + self._link.late())

    def take(self, problem: str, dropped: int) -> None:
        """Take why messages do not get through, "" if they do, and how many were dropped so far."""
        if problem and not self._problem:
            LOGGER.warning("messages to the vehicle do not get through: %s", problem)
        elif not problem and dropped > self._dropped:
            LOGGER.warning("%s to the vehicle %s", counted(dropped - self._dropped, "message"), LATE)
        if not problem:
            self._dropped = dropped
        self._problem = problem
