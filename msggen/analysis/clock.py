"""How the log times of a recording go on: where they step back, and where no topic has a sample."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.columns.ordered import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

BACK = 1.0
"""The time in s from which log times step back: several threads of a recorder write samples in another order."""
GAP = 10.0
"""The shortest time in s without a sample that is told."""
_USUAL = 10
"""How many times as long as usually the topic with the most samples has to be silent."""


class Jump(NamedTuple):
    """A place where log times jump, in s after the start of the recording."""

    before: float
    after: float


def jumps_of(log: Log) -> tuple[list[Jump], list[Jump]]:
    """Return where log times step back, and where no topic has a sample for long.

    The topic with the most samples tells it. Times of others are read only where that one is silent.
    """
    topics = [each for each in log.topics if each.known_count != 0 and each.read_times is not None]
    if not topics:
        return [], []
    most = max(topics, key=lambda each: each.known_count or 0)
    start = log.start
    return _back(most, start), _silent(topics, most, start)


def _back(topic: Topic, start: int) -> list[Jump]:
    if topic.read_times is None or len({number for number, _ in topic.channels}) < len(topic.channels):
        return []  # the channels of a file follow each other
    times = _seconds(topic.read_times(), start)
    places = np.flatnonzero(np.diff(times) <= -BACK)
    return [Jump(float(times[place]), float(times[place + 1])) for place in places]


def _silent(topics: list[Topic], most: Topic, start: int) -> list[Jump]:
    steps = np.diff(_seconds(most.times, start))
    limit = max(GAP, _USUAL * median(steps)) if len(steps) else GAP
    if not (steps > limit).any():
        return []
    times = np.sort(np.concatenate([_seconds(each.times, start) for each in topics]))
    return [Jump(float(times[place]), float(times[place + 1])) for place in np.flatnonzero(np.diff(times) > limit)]


def _seconds(times: NDArray[np.int64], start: int) -> NDArray[np.float64]:
    """Return times in s after the start. A ULog has samples from before it."""
    return np.maximum(times - start, 0) / 1e9
