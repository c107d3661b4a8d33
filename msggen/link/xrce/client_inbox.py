"""The datagrams that have arrived and that PX4's client has not read yet: docs/xrce.md, 3. Times are in us."""

from __future__ import annotations

from collections import deque
from typing import Final

LOOP: Final = 2_000
"""The time of a loop in which nothing is waited for: the client polls for 1 ms, reads and writes."""
_TAKEN: Final = 10
"""The most datagrams that a loop takes."""
_ROOM: Final = 256
"""The datagrams that wait, about as many small ones as a socket of Linux holds."""


class Inbox:
    """Datagrams in the order of their arrival."""

    def __init__(self) -> None:
        self._waiting: deque[bytes] = deque()
        self._left = _TAKEN
        self._loop_end = 0

    def __bool__(self) -> bool:
        return bool(self._waiting)

    @property
    def loop_end(self) -> int:
        """The time of the next loop, in which more datagrams can be taken."""
        return self._loop_end

    def add(self, data: bytes) -> bool:
        """Keep a datagram. Return False if there is no room."""
        if len(self._waiting) >= _ROOM:
            return False
        self._waiting.append(data)
        return True

    def take(self, now: int, *, is_limited: bool) -> bytes | None:
        """Return the next datagram, or None if this loop takes no more. A wait for an answer takes any number."""
        if not self._waiting:
            return None
        if is_limited:
            if now >= self._loop_end:
                self._loop_end, self._left = now + LOOP, _TAKEN
            if not self._left:
                return None
            self._left -= 1
        return self._waiting.popleft()
