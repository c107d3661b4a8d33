"""Samples in stretches without gaps: what spectra and responses are computed of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from msggen.analysis.recorded import spans
from msggen.analysis.spans import Spans, common
from msggen.recordings.columns.ordered import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.analysis.recorded import Recorded


def usual_interval(times: NDArray[np.float64]) -> float:
    """Return the median of the intervals in s that are no steps back, infinite without any."""
    intervals = np.diff(times)
    intervals = intervals[intervals > 0]
    return median(intervals) if len(intervals) else np.inf


def runs(times: NDArray[np.float64], longest: float, fewest: int) -> list[tuple[int, int]]:
    """Return where stretches begin and end whose samples follow each other within `longest` s.

    A stretch has at least `fewest` samples. A time that is not later than the one before ends a stretch, too.
    """
    intervals = np.diff(times)
    ends = np.flatnonzero(~((intervals > 0) & (intervals <= longest))) + 1
    begins, ends = np.append(0, ends), np.append(ends, len(times))
    is_long = ends - begins >= fewest
    return list(zip(begins[is_long].tolist(), ends[is_long].tolist(), strict=True))


def flown(recorded: Recorded, start: float | None = None, stop: float | None = None) -> Spans:
    """Return when the vehicle was armed and had not landed, between two times in s.

    If it was never armed, they are all times; if it never left the ground, those in which it was armed.
    """
    asked = (start or 0.0, recorded.duration if stop is None else stop)
    landed = recorded.column("vehicle_land_detected", "landed")
    armed = recorded.armed or ((0.0, recorded.duration),)
    airborne = () if landed is None else common(armed, spans(landed, landed.values == 0, recorded.duration))
    return common(airborne or armed, (asked,))


TOPICS = "vehicle_status", "actuator_armed", "vehicle_land_detected"
"""The topics that tell when the vehicle flew."""
