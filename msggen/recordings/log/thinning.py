"""The samples that a line in a chart or a picture needs: bounded, and with every peak."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.recordings.columns.ordered import distinct
from msggen.recordings.log.series import PIXELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST = 6000
"""The most samples of a topic in a chart."""


def thinned_lines(
    times: NDArray[np.float64], lines: Sequence[NDArray[np.float64]], most: int = MOST
) -> NDArray[np.intp]:
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
    starts = _starts(places)
    kept = [np.array([0, count - 1]), *(extremes for line in lines for extremes in _extremes(line, starts))]
    return distinct(np.concatenate(kept))


def thinned(times: NDArray[np.float64], values: NDArray[Any], pixels: int = PIXELS) -> NDArray[np.intp]:
    """Return the indices of the samples that a line of so many pixels needs, in order: all of them if they are few.

    Of the samples in each pixel they are the first, the last, the smallest, the largest and the first that is no
    number. So the line has every peak, and it is broken wherever the line of all samples is.
    """
    count = len(times)
    if count <= 4 * pixels or times[-1] <= times[0]:
        return np.arange(count)
    starts = _starts(((times - times[0]) * ((pixels - 1) / (times[-1] - times[0]))).astype(np.intp))
    return distinct(np.concatenate([starts, np.append(starts[1:], count) - 1, *_extremes(values, starts)]))


def _starts(places: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the indices at which bins begin."""
    return np.flatnonzero(np.append(True, places[1:] != places[:-1]))


def _extremes(line: NDArray[Any], starts: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield the indices of the smallest and of the largest value in each bin, and of the first that is no number."""
    missing = np.isnan(line)
    lengths = np.diff(np.append(starts, len(line)))
    for reduce, other in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        filled = np.where(missing, other, line)
        extremes = np.repeat(reduce.reduceat(filled, starts), lengths)
        yield _first(starts, (filled == extremes) & ~missing)
    if missing.any():
        yield _first(starts, missing)


def _first(starts: NDArray[np.intp], mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the first index in each bin at which `mask` is set."""
    found = np.flatnonzero(mask)
    bins = np.searchsorted(starts, found, side="right")
    return found[np.flatnonzero(np.diff(bins, prepend=0))]


def spread(times: NDArray[np.float64], most: int) -> NDArray[np.intp]:
    """Return the indices of at most `most` samples, in order, about as long after each other; all if they are few."""
    if len(times) <= most:
        return np.arange(len(times))
    return distinct(np.searchsorted(times, np.linspace(times[0], times[-1], most)))
