"""The samples that were read and left out. Each is counted once, however often it is read."""

from __future__ import annotations

from collections import defaultdict
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.source.source import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    Times = NDArray[np.int64]

Missing = dict[str, list["Times"]]
"""The log times of samples that one pass leaves out, by the reason."""


class _Counted(NamedTuple):
    """Log times in order, and how many samples each has."""

    times: Times
    counts: NDArray[np.int64]


class LeftOut:
    """The samples that all passes left out.

    Samples have no other identity than their log time. Of those with one time, the pass that left out the most counts.
    """

    def __init__(self) -> None:
        self._counted: dict[tuple[str, int, str], _Counted] = {}
        self._passes: list[Mapping[tuple[str, int], Missing]] = []

    @contextmanager
    def reading(self) -> Iterator[defaultdict[tuple[str, int], Missing]]:
        """Begin a pass over the recording, which adds what it leaves out by name and instance of the topic."""
        own: defaultdict[tuple[str, int], Missing] = defaultdict(dict)
        self._passes.append(own)
        try:
            yield own
        finally:
            self._take(own)
            self._passes = [each for each in self._passes if each is not own]

    @property
    def problems(self) -> list[Problem]:
        """The samples that were left out so far, by reason."""
        for each in self._passes:
            self._take(each)
        return [
            Problem(text, samples=int(found.counts.sum()), topic=topic, instance=instance)
            for (topic, instance, text), found in self._counted.items()
        ]

    def _take(self, own: Mapping[tuple[str, int], Missing]) -> None:
        """Take over what a pass has left out so far. Can be repeated."""
        for (topic, instance), missing in own.items():
            for text, times in missing.items():
                key = topic, instance, text
                found = _Counted(*np.unique(np.concatenate(times), return_counts=True))
                known = self._counted.get(key)
                self._counted[key] = found if known is None else _most(known, found)


def leave_out(missing: Missing | None, text: str, times: Times) -> None:
    """Add samples to those that a pass leaves out, if it counts them."""
    if missing is not None and len(times):
        missing.setdefault(text, []).append(np.array(times))


def _most(one: _Counted, other: _Counted) -> _Counted:
    times = np.union1d(one.times, other.times)
    counts = np.zeros(len(times), np.int64)
    for each in (one, other):
        places = np.searchsorted(times, each.times)
        counts[places] = np.maximum(counts[places], each.counts)
    return _Counted(times, counts)
