"""Decode and encode, one message at a time, and one field of a message through the lazy view."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import geometric_mean
from typing import NamedTuple

from contest import Entry, enter
from effort import Effort
from messages import Sample
from peers import FLOOR, OURS, PEERS, Peer
from rounds import Contestant, race_groups

Times = Mapping[str, Mapping[str, float]]
"""Shortest times in seconds, by message and contestant."""


class Speeds(NamedTuple):
    """The times of one direction. `missing` has the reason for a missing time, by message and contestant."""

    times: Times
    missing: Mapping[tuple[str, str], str]

    def ratios(self, contestant: str, base: str = OURS.name) -> list[float]:
        """Return the ratio of a contestant's time to that of `base`, for each message that it supports."""
        return [times[contestant] / times[base] for times in self.times.values() if contestant in times]

    def mean(self, contestant: str, base: str = OURS.name) -> float:
        """Return the geometric mean of `ratios`, or 0 if there are none."""
        ratios = self.ratios(contestant, base)
        return geometric_mean(ratios) if ratios else 0.0


Entries = Mapping[str, Mapping[str, Entry]]
"""Entries by message and contestant."""


def enter_all(samples: Sequence[Sample], peers: Iterable[Peer] = (OURS, FLOOR, *PEERS)) -> Entries:
    """Return the entries of all contestants, whose results have been compared."""
    peers = tuple(peers)
    return {sample.name: {peer.name: enter(peer, sample) for peer in peers} for sample in samples}


def measure(entries: Entries, direction: str, effort: Effort) -> Speeds:
    """Return the times of a direction, "decode" or "encode"."""
    ready: dict[str, dict[str, Contestant]] = {message: {} for message in entries}
    missing: dict[tuple[str, str], str] = {}
    for message, by_peer in entries.items():
        for name, entry in by_peer.items():
            contestant = entry.decode if direction == "decode" else entry.encode
            if isinstance(contestant, str):
                missing[message, name] = contestant
            else:
                ready[message][name] = contestant
    return Speeds(race_groups(ready, effort.rounds, effort.turn), missing)
