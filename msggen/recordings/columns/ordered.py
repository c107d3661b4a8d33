"""What numpy's `unique`, `median` and `percentile` return, without numpy.ma, whose import takes 17 ms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """Return the different values, of shape (n,), in order."""
    return np.unique(values, return_counts=True)[0]  # numpy.ma is only used without counts


def median(values: NDArray[Any]) -> float:
    """Return the median, NaN without values."""
    if not len(values):
        return np.nan
    middle = [(len(values) - 1) // 2, len(values) // 2]
    return float(np.partition(values, middle)[middle].mean())


def percentiles(values: NDArray[Any], percents: Sequence[float]) -> NDArray[np.float64]:
    """Return the values below which some percents of all numbers are, interpolated; NaN if there are no numbers."""
    numbers = np.sort(values[~np.isnan(values)])
    if not len(numbers):
        return np.full(len(percents), np.nan)
    places = np.asarray(percents) * ((len(numbers) - 1) / 100)
    return np.asarray(np.interp(places, np.arange(len(numbers)), numbers), np.float64)
