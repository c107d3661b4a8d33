"""For how long what arrives from a network, Zenoh or DDS, has waited on its way: it tells when it was published.

Programs of msggen tell times of `age.now` of this computer, which they know from beats. Nobody sets that clock. All
others tell ns since 1970, by their own clocks:

- one that is behind makes samples look late, which is safe
- one that is ahead would hide that they are: what is published more than 0.5 s after it has arrived is refused
- below that, the shortest ways of a publisher in the last minute count as no way at all

A sample without the gid of its publisher is judged alone: the clock of one publisher must not hold up the others.

One forged sample changes nothing for a publisher: several of its ways have to be as short.
"""

from __future__ import annotations

import time
from typing import Final, NamedTuple, TypeAlias

from msggen.link import age
from msggen.link.age import LONGEST_NS, LONGEST_S
from msggen.link.link import StaleError

Publisher: TypeAlias = tuple[str, bytes]
"""The name of a topic, and the gid of who publishes it, b"" if that is not known."""
_AHEAD: Final = f"the clock of the computer that published it is more than {LONGEST_S:g} s ahead of this one: dropped"
_PERIOD_NS: Final = 30_000_000_000
"""Shortest ways are forgotten after this time, and at the latest after twice of it: a clock may be set."""
_MOST: Final = 1000
_AGREEING: Final = 5
"""How many ways have to be short until all count from them."""
_STEP_NS: Final = 100_000_000
"""The change of this computer's clock above which it was set."""


class _Ways(NamedTuple):
    """The shortest ways of a publisher in ns, by our clock: of this period and the one before, in order."""

    since: int
    current: tuple[int, ...] = ()
    before: tuple[int, ...] = ()


class Waiting:
    """The ways of the publishers on a network."""

    def __init__(self) -> None:
        self._ways: dict[Publisher, _Ways] = {}
        self._offset = 0
        """Of the clock of this computer to `age.now`."""

    def since(self, publisher: Publisher, published: int, longest: int = LONGEST_NS) -> float:
        """Return the time in s since a publisher has told to have published, in ns since 1970; 0 if it tells none.

        Raises StaleError as `of`.
        """
        arrived, now = time.time_ns(), age.now()
        return self.of(publisher, arrived - published, arrived, now, longest) / 1e9 if published > 0 else 0.0

    def of(self, publisher: Publisher, way: int, arrived: int, now: int, longest: int = LONGEST_NS) -> int:
        """Return the time in ns that a sample of a publisher has waited.

        `way` is how long it was on its way, if both clocks were the same. `arrived` is when it has arrived, in ns since
        1970, and `now` the same by `age.now`. Raises StaleError if it has waited for more than `longest` ns, or if the
        publisher's clock is ahead.
        """
        if abs(arrived - now - self._offset) > _STEP_NS:
            self._ways.clear()  # they tell nothing any more
        self._offset = arrived - now
        shortest = self._shortest(publisher, way, now) if publisher[1] else 0
        if min(way, shortest) < -LONGEST_NS:
            raise StaleError(_AHEAD)
        if way - shortest > longest:
            late = f"waited for more than {longest / 1e9:g} s: dropped"
            raise StaleError(f"{late}, or the clock of the computer that published it is behind")
        return max(0, way - shortest)

    def _shortest(self, publisher: Publisher, way: int, now: int) -> int:
        """Take a way. Return what counts as no way, which is 0 or less: 0 until it is known."""
        found = self._ways.get(publisher, _Ways(now))
        if now - found.since >= _PERIOD_NS:
            found = _Ways(now, (), found.current)
        found = found._replace(current=tuple(sorted((*found.current, way))[:_AGREEING]))
        if publisher in self._ways or self._has_place(now):
            self._ways[publisher] = found
        both = sorted(found.current + found.before)
        return min(0, both[_AGREEING - 1]) if len(both) >= _AGREEING else 0

    def _has_place(self, now: int) -> bool:
        """Whether another publisher can be remembered. Forged ones do not drive out the others."""
        if len(self._ways) >= _MOST:
            self._ways = {each: ways for each, ways in self._ways.items() if now - ways.since < 2 * _PERIOD_NS}
        return len(self._ways) < _MOST
