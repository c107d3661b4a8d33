"""How a value follows another one: slopes and correlations of two columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.analysis.recorded import Column

_LEAST = 30
"""The samples without which nothing is said."""


class Fit(NamedTuple):
    """How a value changes with another one. A trend over time is taken out of both, such as the discharge."""

    slope: float
    correlation: float
    """From -1 to 1, 0 if one of them does not change."""
    spread: float
    """The standard deviation of the other value."""


def fit(column: Column, other: Column) -> Fit | None:
    """Return how a column follows another one, None for fewer than 30 samples with both values."""
    causes = other.at(column.times)
    both = np.isfinite(causes) & np.isfinite(column.values)
    if both.sum() < _LEAST:
        return None
    times = column.times[both]
    effect, cause = (_without_trend(each[both], times) for each in (column.values, causes))
    product, square = float(cause @ effect), float(cause @ cause)
    norm = np.sqrt(square * float(effect @ effect))
    return Fit(product / square if square > 0 else 0.0, float(product / norm) if norm > 0 else 0.0, float(cause.std()))


def _without_trend(values: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    values, times = values - values.mean(), times - times.mean()
    square = float(times @ times)
    return values - times * (float(times @ values) / square) if square > 0 else values
