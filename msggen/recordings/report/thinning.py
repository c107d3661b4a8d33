"""The samples of lines that a chart needs: bounded, and with every peak."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST = 6000
"""The most samples of a topic in a chart."""


def thinned(times: NDArray[np.float64], lines: Sequence[NDArray[np.float64]], most: int = MOST) -> NDArray[np.intp]:
    """Return the indices of at most `most` samples of lines that have the same times, in order: all if they are few.

    Time is cut into bins of the same length. Of each, the samples with the smallest and the largest value of each line
    are kept, and the first that is no number; and of all, the first and the last one.
    """
    count = len(times)
    if count <= most:
        return np.arange(count)
    a_bin = sum(3 if np.isnan(line).any() else 2 for line in lines)
    bins = max((most - 2) // max(a_bin, 1), 1)
    span = float(times[-1] - times[0])
    places = (
        np.minimum(((times - times[0]) * (bins / span)).astype(np.intp), bins - 1)
        if span > 0
        else np.zeros(count, np.intp)
    )
    starts = np.flatnonzero(np.append(True, places[1:] != places[:-1]))
    lengths = np.diff(np.append(starts, count))
    kept = [np.array([0, count - 1])]
    for line in lines:
        missing = np.isnan(line)
        for reduce, other in ((np.minimum, np.inf), (np.maximum, -np.inf)):
            filled = np.where(missing, other, line)
            extremes = np.repeat(reduce.reduceat(filled, starts), lengths)
            kept.append(_first(starts, (filled == extremes) & ~missing))
        if missing.any():
            kept.append(_first(starts, missing))
    return np.unique(np.concatenate(kept))


def _first(starts: NDArray[np.intp], mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the first index in each bin at which `mask` is set."""
    found = np.flatnonzero(mask)
    bins = np.searchsorted(starts, found, side="right")
    return found[np.flatnonzero(np.diff(bins, prepend=0))]


def spread(times: NDArray[np.float64], most: int) -> NDArray[np.intp]:
    """Return the indices of at most `most` samples, in order, about as long after each other; all if they are few."""
    if len(times) <= most:
        return np.arange(len(times))
    return np.unique(np.searchsorted(times, np.linspace(times[0], times[-1], most)))
