"""For how long what arrives from the network has waited on its way: its attachment tells when it was published.

The clocks of two computers differ. One that is behind makes samples look late, which is safe. One that is ahead would
hide that they are, so the shortest way of a publisher in the last minute counts as no way at all.
"""

from __future__ import annotations

from typing import Final, NamedTuple

_PERIOD_NS: Final = 30_000_000_000
"""Shortest ways are forgotten after this time, and at the latest after twice of it: a clock may be set."""
_MOST: Final = 1000


class _Ways(NamedTuple):
    """The shortest ways of a publisher in ns, by our clock: of this period and the one before."""

    since: int
    current: int
    before: int


class Waiting:
    """The ways of the publishers on a network."""

    def __init__(self) -> None:
        self._ways: dict[bytes, _Ways] = {}

    def of(self, gid: bytes, published: int, arrived: int) -> int:
        """Return the time in ns that a sample of a publisher has waited. Both times are in ns since 1970."""
        way = arrived - published
        found = self._ways.get(gid)
        if found is None:
            if len(self._ways) >= _MOST:
                self._ways.clear()
            found = _Ways(arrived, way, way)
        elif not 0 <= arrived - found.since < _PERIOD_NS:
            found = _Ways(arrived, way, found.current)
        self._ways[gid] = found = found._replace(current=min(found.current, way))
        return way - min(0, found.current, found.before)
