"""What PX4's client takes for a sign of its agent, and when it pings it: docs/xrce.md, 3. Times are in us."""

from __future__ import annotations

from typing import Final

from msggen.link.xrce.client_inbox import LOOP
from msggen.link.xrce.wire import WireError

_PERIOD: Final = 1_000_001
"""More than 1 s: the time between pings, and the window in which samples are counted."""
_MISSED: Final = 3
"""The missed pings with which a session ends, after the answer to the last ping or 1 s."""
_ACTIVITY_KIND: Final = 0x0D


class Liveness:
    """The pings of a session, and the samples in both directions, which stand for answers."""

    def __init__(self, now: int, *, has_received: bool) -> None:
        """Begin a session. `has_received`: whether a sample has come in any session, which counts for this one too."""
        self.written = 0
        """The bytes of samples to the agent in this window."""
        self.read = int(has_received)
        """The bytes of samples from the agent in this window, for readers that do not exist too."""
        self.is_answered = False
        """Whether the agent has answered since the last ping. It has not before the first one."""
        self.ping_time = now + _PERIOD
        """The time of the next ping, unless samples flow in both directions."""
        self._missed = 0
        self._flows = False
        self._window_end = now + _PERIOD

    @property
    def next_time(self) -> int:
        """The time at which `is_ping_due` is to be called next."""
        return self._window_end if self._flows else min(self._window_end, self.ping_time)

    @property
    def is_over(self) -> bool:
        """Whether the session ends with the ping that was begun."""
        return self._missed >= _MISSED

    def is_ping_due(self, now: int) -> bool:
        """Return whether to ping. If so, the ping before it is counted as answered or missed."""
        if now >= self._window_end:
            flowed, self._flows = self._flows, bool(self.written and self.read)
            self.written = self.read = 0
            self._window_end = now + _PERIOD
            if flowed or self._flows:
                self.ping_time = now - LOOP + _PERIOD  # counted from the last loop in which samples flow
                self._missed = 0
        if self._flows or now < self.ping_time:
            return False
        self.ping_time = now + _PERIOD
        self._missed = 0 if self.is_answered else self._missed + 1
        self.is_answered = False
        return True


def is_known(info: bytes) -> bool | None:
    """Return whether the agent has a session, from the payload of an INFO. None: the INFO is no answer.

    The client reads the activity, which must be there, and ignores ids, status and configuration.
    """
    if len(info) < 8:
        raise WireError("INFO without activity")
    at = 17 if info[6] else 7
    if len(info) < at + 5 or info[at] != 1 or info[at + 1] != _ACTIVITY_KIND:
        raise WireError("INFO without activity")
    at += 2 + at % 2
    available = int.from_bytes(info[at : at + 2], "little", signed=True)
    return info[5] != 0 if available > 0 else None
