"""The data of a report's charts, as its script reads them: JSON, with numbers as base64 of binary arrays."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.exports.report.charts import Chart, Line, Section, ends_of
from msggen.exports.report.drawing import MOST as MOST_OF_TRACK
from msggen.recordings.log.thinning import MOST, spread, thinned_lines

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.exports.report.flight import Track
    from msggen.exports.report.timeline import Timeline

_MOST_MARKS = 400
"""The texts that are marked in charts: of more, those that are warnings or worse come first."""
_COLOURS, _SETPOINT = 10, 1
"""The number of colours of lines, and that of setpoints."""
_WHOLE = 0xFFFF_FFFF
_CALM = ("notice", "info", "debug", "unknown")


def data_of(duration: float, timeline: Timeline, sections: Sequence[Section], track: Track | None) -> str:
    """Return the data as JSON that can stand in a script element of a page."""
    made = {
        "duration": duration,
        "modes": [list(each) for each in timeline.modes],
        "failsafes": [list(each) for each in timeline.failsafes],
        "marks": _marks(timeline, duration),
        "charts": [_chart(chart, duration) for section in sections for chart in section.charts],
        "track": _track(track, duration),
    }
    text = json.dumps(made, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _marks(timeline: Timeline, duration: float) -> list[list[Any]]:
    found = [mark for mark in timeline.marks if 0 <= mark.time <= duration]
    chosen = sorted(found, key=lambda mark: mark.level in _CALM)[:_MOST_MARKS]
    return [[mark.time, int(mark.level in _CALM), mark.text[:120]] for mark in sorted(chosen)]


def _chart(chart: Chart, duration: float) -> dict[str, Any]:
    tables: dict[tuple[object, ...], list[Line]] = {}
    for line in chart.lines:
        tables.setdefault(line.table, []).append(line)
    colours = _colours(chart.lines)
    return {
        "unit": chart.unit,
        "lines": [
            {"label": line.label, "colour": colours[line.label], "dash": line.is_setpoint, "step": line.column.is_held}
            for lines in tables.values()
            for line in lines
        ],
        "tables": [_table(lines, duration, MOST // len(tables)) for lines in tables.values()],
    }


def _colours(lines: Sequence[Line]) -> dict[str, int]:
    """Return the numbers of colours: in all charts, that of setpoints is the same one, if there are some."""
    others = [line.label for line in lines if not line.is_setpoint]
    has_setpoint = len(others) < len(lines)
    free = [number for number in range(_COLOURS) if not (has_setpoint and number == _SETPOINT)]
    found = {label: free[place % len(free)] for place, label in enumerate(others)}
    return {**{line.label: _SETPOINT for line in lines if line.is_setpoint}, **found}


def _table(lines: Sequence[Line], duration: float, most: int) -> list[Any]:
    """Return the times of lines that share them, and the values of each. NaN ends a line."""
    times, values = lines[0].column.times, [line.column.values for line in lines]
    kept = thinned_lines(times, values, most)
    ends = ends_of(lines, kept)
    middles = (times[kept[ends]] + times[kept[ends + 1]]) / 2
    own = np.insert(times[kept], ends + 1, middles)
    return [_packed_times(own, duration), [_packed(np.insert(each[kept], ends + 1, np.nan)) for each in values]]


def _track(track: Track | None, duration: float) -> list[str] | None:
    if track is None:
        return None
    kept = spread(track.times, MOST_OF_TRACK)
    return [_packed_times(track.times[kept], duration), _packed(track.east[kept]), _packed(track.north[kept])]


def _packed_times(times: NDArray[np.float64], duration: float) -> str:
    """Return times as shares of the duration, in steps of a uint32."""
    shares = np.clip(times / duration, 0, 1) if duration > 0 else np.zeros(len(times))
    return b64encode(np.rint(shares * _WHOLE).astype("<u4").tobytes()).decode()


def _packed(values: NDArray[np.float64]) -> str:
    with np.errstate(over="ignore"):
        return b64encode(values.astype("<f4").tobytes()).decode()
