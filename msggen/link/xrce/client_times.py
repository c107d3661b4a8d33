"""The times that PX4's client asks its agent for, and how it estimates the offset of both clocks: docs/xrce.md, 7.

Times are in us.
"""

from __future__ import annotations

from typing import Final

from msggen.link.xrce import wire
from msggen.link.xrce.client_events import Exchange

_SLOW: Final = 10_000
"""The round trip from which a sample is an outlier."""
_FAR: Final = 100_000
"""The distance from the estimate from which a sample is an outlier."""
_OUTLIERS: Final = 10
"""The outliers in a row after which the estimate starts again."""
_FIRST_GAIN: Final = 0.05
_LAST_GAIN: Final = 0.003

_OLD: Final = 10_000
"""The age of a question that is not the last one, at least: the pause between two questions at the start."""


class OffsetFilter:
    """A filter whose gain falls while it converges. Without a window, the offset stays 0."""

    def __init__(self, window: int) -> None:
        """Converge with `window` samples."""
        self.window = window
        self._count = 0
        self._outliers = 0
        self._offset = 0.0

    @property
    def is_converged(self) -> bool:
        """Whether there are enough samples."""
        return self._count >= self.window

    @property
    def offset(self) -> int:
        """The agent's clock minus the client's, 0 before the first sample since the start of the filter."""
        return round(self._offset) if self.window else 0

    def add(self, sent: int, agent: int, received: int) -> None:
        """Take an exchange: the client's time of sending, the agent's time, the client's time of receiving."""
        observed = agent - (sent + received) / 2
        if received - sent >= _SLOW or (self._count and abs(observed - self._offset) > _FAR):
            self._outliers += 1
            if self._outliers > _OUTLIERS:
                self._count = self._outliers = 0
                self._offset = 0.0
            return
        self._outliers = 0
        share = min(1.0, self._count / self.window) if self.window else 1.0
        gain = _FIRST_GAIN + (_LAST_GAIN - _FIRST_GAIN) * share if self._count else 1.0
        self._offset += gain * (observed - self._offset)
        self._count += 1


class Question:
    """The last TIMESTAMP, and the reply to it."""

    def __init__(self) -> None:
        self.reply: wire.TimestampReply | None = None
        """The last reply since the question."""
        self._asked = 0

    def ask(self, now: int) -> bytes:
        """Return the TIMESTAMP of a question."""
        self.reply, self._asked = None, now
        return wire.Timestamp(now * 1000).pack()

    def is_answered(self, *, in_session: bool) -> bool:
        """Return whether a reply has come: in a session to any question, as in captures.

        At the start, a reply that was doubled or late waits for the end of the pause. Taken for the answer to the next
        question, it would make all later ones late.
        """
        reply = self.reply
        return reply is not None and (in_session or self._asked - reply.originated // 1000 < _OLD)

    def add_to(self, clock: OffsetFilter, now: int) -> Exchange | None:
        """Add the exchange to an estimate, and return it. None: the reply has no time of this client."""
        reply = self.reply
        sent, agent = (reply.originated // 1000, reply.transmitted // 1000) if reply else (-1, 0)
        if not 0 <= sent <= now:
            return None
        clock.add(sent, agent, now)
        return Exchange(agent, agent - (sent + now) // 2, now - sent)
