"""The samples of a topic in a recording as an object of JSON: statistics of each column, and some rows."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.columns.text import Printer, json_value, member_name
from msggen.recordings.log.thinning import spread
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.columns.annotations import Annotation
    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log.log import Log

_MOST_CELLS, _MOST_COLUMNS = 20_000, 100
_MOST_NAMES = 30
"""The values with names that are counted, the most frequent ones."""


def table_of(log: Log, samples: Samples, rows: int) -> dict[str, Any]:
    """Return statistics of the columns of all samples, and at most `rows` of them, about as long after each other.

    Times are in s after the start of the recording. Raises RecordingError if there are no samples.
    """
    if not len(samples):
        raise RecordingError(f"there are no samples of {samples.topic.label} in this time")
    columns = Printer(samples.topic).columns(samples)
    names = list(columns)[:_MOST_COLUMNS]
    times = (samples.log_times - log.start) / 1e9
    chosen = spread(times, min(rows, _MOST_CELLS // (len(names) + 1)))
    about = {name: annotation_of(samples.topic, name) for name in names}
    return {
        "topic": samples.topic.label,
        "type": samples.topic.ros_type,
        "samples": len(samples),
        "first": times[0],
        "last": times[-1],
        "columns": {name: _column(times, columns[name], about[name]) for name in names},
        "columns_left_out": list(columns)[_MOST_COLUMNS:],
        "row_names": ["time", *names],
        "rows": [
            [json_value(times[index]), *(json_value(columns[name][index]) for name in names)]
            for index in chosen.tolist()
        ],
    }


def _column(times: NDArray[np.float64], values: Any, about: Annotation) -> dict[str, Any]:
    told = {"unit": about.unit, "frame": about.frame}
    return {**{name: text for name, text in told.items() if text}, **_statistics(times, values, about)}


def _statistics(times: NDArray[np.float64], values: Any, about: Annotation) -> dict[str, Any]:
    """Return how often values with names occur, or the extremes of numbers with their times; nothing of text."""
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "biuf":
        return {}
    if values.dtype.kind == "b" or about.members:
        numbers, counts = np.unique(values, return_counts=True)
        found = Counter(dict(zip(map(json_value, numbers), counts.tolist(), strict=True)))
        return {"counts": {_name(value, about): count for value, count in found.most_common(_MOST_NAMES)}}
    numbers = values.astype(np.float64)
    finite = np.flatnonzero(np.isfinite(numbers))
    if not len(finite):
        return {"finite": 0}
    kept = numbers[finite]
    low, high = finite[kept.argmin()], finite[kept.argmax()]
    with np.errstate(all="ignore"):
        return {
            "finite": len(kept),
            "min": json_value(values[low]),
            "min_time": float(times[low]),
            "max": json_value(values[high]),
            "max_time": float(times[high]),
            "mean": float(f"{kept.mean():.7g}"),
            "deviation": float(f"{kept.std():.7g}"),
        }


def _name(value: Any, about: Annotation) -> str:
    name = "" if isinstance(value, bool) else member_name(about, value)
    return f"{value} {name}" if name else str(value).lower()
