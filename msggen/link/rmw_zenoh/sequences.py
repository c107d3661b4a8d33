"""The sequence numbers of the topics of a vehicle: what is missing, and whether two vehicles count."""

from __future__ import annotations

from collections import Counter
from typing import Final

from msggen.link.link import Route

_MOST_LOST: Final = 1_000_000
"""The largest gap that is one. PX4 counts 250 samples of a topic in a second."""
_TWINS: Final = 5
"""How often the numbers of a topic go back until two vehicles must count. A vehicle that restarts goes back once."""


class Sequences:
    """The numbers of a session."""

    def __init__(self) -> None:
        self._last: dict[Route, int] = {}
        self._backwards: Counter[Route] = Counter()
        self.are_two = False
        """Whether two vehicles count, so that gaps tell nothing."""

    def forget(self, route: Route) -> None:
        """Forget the number of a topic, of which samples were left out on purpose."""
        self._last.pop(route, None)

    def missing(self, route: Route, number: int) -> int:
        """Take the number of a sample, and return how many samples of its topic are missing before it."""
        last = self._last.get(route)
        self._last[route] = number
        if last is None or number == last + 1 or self.are_two:
            return 0
        if number <= last:
            self._backwards[route] += 1
            self.are_two = self._backwards[route] >= _TWINS
            return 0
        return number - last - 1 if number - last - 1 <= _MOST_LOST else 0
