"""The times that PX4's client asks its agent for: docs/xrce.md, 7. Times are in us."""

from __future__ import annotations

from typing import Final

from msggen.link.xrce import wire
from msggen.link.xrce.client_events import Exchange
from msggen.link.xrce.offset import OffsetFilter

_OLD: Final = 10_000
"""The age of a question that is not the last one, at least: the pause between two questions at the start."""


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
