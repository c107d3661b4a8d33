"""Which session gives way to a new one when all places are taken. docs/xrce.md, 11."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from operator import attrgetter
from typing import Final

from msggen.link.xrce.session import Session

_OTHERS: Final = 8
"""One of so many places is for hosts other than the one with the most sessions."""


def find_least(sessions: Collection[Session], newcomer: str, now: float) -> Session | None:
    """Return the session that gives way to a client of the host of a newcomer, or None if none does.

    `sessions` take all places. The one whose last message, without samples, is oldest is first.
    """
    counts = Counter(map(attrgetter("host"), sessions))
    counts[newcomer] += 1
    largest = max(counts, key=counts.__getitem__)
    has_too_many = counts[largest] > len(sessions) - len(sessions) // _OTHERS
    if has_too_many:
        sessions = [session for session in sessions if session.host == largest]
    candidates = [session for session in sessions if not session.is_vehicle]
    candidates = candidates or [session for session in sessions if not session.is_busy(now)]
    if not candidates and has_too_many and largest != newcomer:
        candidates = list(sessions)
    return max(candidates, key=lambda session: counts[session.host], default=None)
