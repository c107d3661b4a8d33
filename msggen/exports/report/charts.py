"""The charts of a report: their lines, with units as people read them, and rows of flags.

The script of a report reads their data as JSON, with numbers as base64 of binary arrays.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.analysis.recorded import Column, Recorded, angle_of, spans
from msggen.base.diagnostics import few
from msggen.exports.report.analysed import Axis, Image, analysed
from msggen.exports.report.drawing import MOST as MOST_OF_TRACK
from msggen.exports.report.plans import AID_SOURCES, GROUPS, LANES, Field, Group, Lanes, Plan
from msggen.recordings.columns.ordered import median
from msggen.recordings.log.thinning import MOST, spread, thinned_lines

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.analysis.figures import Track
    from msggen.analysis.timeline import Timeline

_DEGREES = 180 / np.pi
_CONVERTED = {
    ("rad", "deg"): _DEGREES,
    ("", "deg"): _DEGREES,
    ("rad s^-1", "deg/s"): _DEGREES,
    ("", "deg/s"): _DEGREES,
}
"""The factors from units in definitions, normalized, to those of charts. PX4 has angles in rad where it has no unit."""
_GAP, _USUAL = 1.0, 10
"""The length in s from which a time without samples is a gap, and the number of usual intervals."""
_HALF_TURN = 180
_MOST_ELEMENTS = 16
_MOST_CONSTANT = 4
"""The lines of a field up to which those with one value are drawn, too."""
_MOST_ROWS = 40
"""The rows of a chart of flags."""


@dataclass(frozen=True)
class Line:
    """A line of a chart."""

    label: str
    column: Column
    is_setpoint: bool = False
    flight: int = 0
    """The number of the flight, of two."""

    @property
    def table(self) -> tuple[object, ...]:
        """What lines that have the same times share."""
        times = self.column.times
        return self.flight, self.column.path.partition(".")[0], len(times), float(times[0])

    @property
    def summary(self) -> tuple[float, float, float]:
        """The smallest, the mean and the largest value."""
        found = self.column.finite
        return float(found.min()), float(found.mean()), float(found.max())


class Chart(NamedTuple):
    """Lines, over time if there is no other axis. `number` is its place in the data of the script."""

    number: int
    title: str
    unit: str
    lines: Sequence[Line]
    axis: Axis | None = None
    notes: Sequence[str] = ()

    @property
    def label(self) -> str:
        """The chart in words."""
        names = few(list(dict.fromkeys(line.label for line in self.lines)))
        unit = f" in {self.unit}" if self.unit else ""
        over = " over time" if self.axis is None else f" over {self.axis.unit}" if self.axis.unit else ""
        return f"{self.title}{unit}{over}: {names}"


class Row(NamedTuple):
    """The times in s at which a flag is set."""

    name: str
    spans: Sequence[tuple[float, float]]


class Flags(NamedTuple):
    """Flags over time."""

    title: str
    rows: Sequence[Row]
    left_out: int = 0
    """How many more rows there are."""


class Section(NamedTuple):
    """Charts below one heading."""

    title: str
    charts: Sequence[Chart]
    flags: Sequence[Flags] = ()
    images: Sequence[Image] = ()


class Charts(NamedTuple):
    """The charts of a recording, and those that it lacks: a text for each."""

    sections: Sequence[Section]
    missing: Sequence[str]
    untold: Sequence[str] = ()
    """The same for what analysis finds, with the reasons."""


def charts_of(recorded: Recorded) -> Charts:
    """Return the charts of a recording."""
    sections: list[Section] = []
    missing: dict[str, list[str]] = {}
    numbers = count()
    for group in GROUPS:
        charts = [Chart(next(numbers), *each) for each in _charts(recorded, group, missing)]
        flags = [found for lanes in LANES if lanes.group == group.title and (found := _flags(recorded, lanes))]
        if charts or flags:
            sections.append(Section(group.title, charts, flags))
    own, images, untold = analysed(recorded)
    if own:
        drawn = [
            Chart(next(numbers), each.title, each.unit, [Line(*line) for line in each.lines], each.axis, each.notes)
            for each in own
        ]
        sections.append(Section("Responses and spectra", drawn, images=images))
    return Charts(sections, [f"{', '.join(titles)} ({topics})" for topics, titles in missing.items()], untold)


def _charts(
    recorded: Recorded, group: Group, missing: dict[str, list[str]]
) -> Iterator[tuple[str, str, Sequence[Line]]]:
    """Yield titles, units and lines of a group, and add the titles that the recording lacks to `missing`, by topics."""
    drawn: set[str] = set()
    for plan in group.plans:
        if not drawn.isdisjoint(plan.instead_of):
            continue
        lines = _lines(recorded, plan)
        if lines:
            drawn.add(plan.title)
            yield plan.title, plan.unit, lines
        elif not plan.instead_of:
            missing.setdefault(_topics(plan), []).append(plan.title.lower())


def _topics(plan: Plan) -> str:
    """Return the topics that a chart needs one of: the first two."""
    paths = [path for field in plan.fields if not field.is_setpoint for path in field.paths]
    return " or ".join(list(dict.fromkeys(path.partition(".")[0] for path in paths))[:2])


def _lines(recorded: Recorded, plan: Plan) -> list[Line]:
    """Return the lines of a chart. Without any that is no setpoint, there are none."""
    found = [line for field in plan.fields for line in _lines_of(recorded, plan, field)]
    return found if any(not line.is_setpoint for line in found) else []


def _lines_of(recorded: Recorded, plan: Plan, field: Field) -> list[Line]:
    for path in field.paths:
        topic, _, name = path.partition(".")
        found = _of_all(recorded, field, topic, name) if field.is_each else _of_first(recorded, field, topic, name)
        lines = [
            Line(label, scaled, field.is_setpoint)
            for label, column in found
            if len((scaled := _scaled(column, plan.unit, field)).finite)
        ]
        if lines:
            return _moving(lines)
    return []


def _of_first(recorded: Recorded, field: Field, topic: str, name: str) -> Iterator[tuple[str, Column]]:
    """Yield a field of the first instance, without the values that cannot be used."""
    column = recorded.column(topic, name) or angle_of(recorded, topic, name)
    if column is not None:
        yield field.label, column.where(recorded.column(topic, field.valid))


def _of_all(recorded: Recorded, field: Field, topic: str, name: str) -> Iterator[tuple[str, Column]]:
    """Yield a field of each instance, or each element of an array that is in use."""
    instances = recorded.instances(topic)
    for instance in instances:
        number = f" {instance}" if len(instances) > 1 else ""
        elements = list(_elements(recorded, topic, name, instance))
        for index, path in elements:
            column = recorded.column(topic, path, instance)
            if column is not None:
                place = f" {index + 1}" if index is not None else ""
                yield f"{field.label}{place}{number}", column


def _elements(recorded: Recorded, topic: str, name: str, instance: int) -> Iterator[tuple[int | None, str]]:
    width = recorded.width(topic, name, instance)
    if not width:
        yield None, name
        return
    used = recorded.column(topic, {"output": "noutputs", "esc": "esc_count"}.get(name, ""), instance)
    count = int(used.values.max()) if used is not None and len(used.values) else width
    for index in range(min(count, width, _MOST_ELEMENTS)):
        yield index, f"{name}[{index}]" + (".esc_rpm" if name == "esc" else "")


def _moving(lines: list[Line]) -> list[Line]:
    """Return the lines that change, of many; all if none does. Outputs that are not in use have one value."""
    found = [line for line in lines if np.ptp(line.column.finite) > 0]
    return found if found and len(lines) > _MOST_CONSTANT else lines


def _scaled(column: Column, unit: str, field: Field) -> Column:
    """Return a column in the unit of a chart, NaN where a value cannot be used."""
    factor = _CONVERTED.get((column.unit, unit), 1.0) * field.scale
    is_usable = np.isfinite(column.values)
    if field.unknown is not None:
        is_usable &= column.values != field.unknown
    values = np.where(is_usable, column.values, np.nan)
    return column._replace(values=values * factor, unit=unit)


def _flags(recorded: Recorded, lanes: Lanes) -> Flags | None:
    """Return the rows of flags that are ever set, None if there are none."""
    rows = []
    for topic in sorted(recorded.topics):
        if not topic.startswith(lanes.topics):
            continue
        for flag in recorded.flags(topic):
            column = recorded.column(topic, flag) if flag.startswith(lanes.flags or ("",)) else None
            if column is None or not column.values.any() or (lanes.is_changing and column.values.all()):
                continue
            name = topic.removeprefix(AID_SOURCES) if flag == "innovation_rejected" else flag
            rows.append(Row(name, spans(column, column.values > 0, recorded.duration)))
    return Flags(lanes.title, rows[:_MOST_ROWS], max(len(rows) - _MOST_ROWS, 0)) if rows else None


def ends_of(lines: Sequence[Line], kept: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of some samples lines that share their times end at: before a gap, and where an angle turns around.

    A gap is longer than a second and ten usual intervals. Values that are held until the next one have no gaps.
    """
    is_end = np.zeros(max(len(kept) - 1, 0), bool)
    times = lines[0].column.times
    intervals = np.diff(times)
    if len(intervals) and not lines[0].column.is_held:
        gaps = np.flatnonzero(intervals > max(_GAP, _USUAL * median(intervals)))
        is_end |= np.searchsorted(gaps, kept[1:]) > np.searchsorted(gaps, kept[:-1])
    for line in lines:
        if line.column.unit == "deg":
            is_end |= np.abs(np.diff(line.column.values[kept])) > _HALF_TURN
    return np.flatnonzero(is_end)


_MOST_MARKS = 400
"""The texts that are marked in charts: of more, those that are warnings or worse come first."""
_COLOURS, _SETPOINT = 10, 1
"""The number of colours of lines, and that of setpoints."""
_OF_FLIGHTS = (0, 5, 7, 2), (1, 6, 4, 9)
"""The colours of lines of each of two flights."""
_WHOLE = 0xFFFF_FFFF
_CALM = ("notice", "info", "debug", "unknown")


class Times(NamedTuple):
    """The time axis of a page, in s: when it begins, and how long it is."""

    begin: float
    duration: float


class Shown(NamedTuple):
    """A flight behind the charts and on the track. Its times are those of the axis."""

    name: str
    """"" for the only one."""
    timeline: Timeline
    track: Track | None


def data_of(span: Times, flights: Sequence[Shown], sections: Sequence[Section]) -> str:
    """Return the data as JSON that can stand in a script element of a page."""
    made = {
        "begin": span.begin,
        "duration": span.duration,
        "flights": [
            {
                "name": name,
                "modes": [list(each) for each in timeline.modes],
                "failsafes": [list(each) for each in timeline.failsafes],
                "track": _track(track, span),
            }
            for name, timeline, track in flights
        ],
        "marks": sorted(mark for flight in flights for mark in _marks(flight, span, _MOST_MARKS // len(flights))),
        "charts": [_chart(chart, span, len(flights)) for section in sections for chart in section.charts],
    }
    text = json.dumps(made, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _marks(flight: Shown, span: Times, most: int) -> list[list[Any]]:
    found = [mark for mark in flight.timeline.marks if 0 <= mark.time - span.begin <= span.duration]
    chosen = sorted(found, key=lambda mark: mark.level in _CALM)[:most]
    front = f"{flight.name}: " if flight.name else ""
    return [[mark.time, int(mark.level in _CALM), f"{front}{mark.text[:120]}"] for mark in chosen]


def _chart(chart: Chart, span: Times, flights: int) -> dict[str, Any]:
    tables: dict[tuple[object, ...], list[Line]] = {}
    for line in chart.lines:
        tables.setdefault(line.table, []).append(line)
    colours = _colours(chart.lines) if flights == 1 else _colours_of_flights(chart.lines)
    axis = chart.axis
    return {
        "unit": chart.unit,
        "axis": axis and {**axis._asdict(), "marks": [list(mark) for mark in axis.marks]},
        "lines": [
            {"label": line.label, "colour": colours[line.label], "dash": line.is_setpoint, "step": line.column.is_held}
            for lines in tables.values()
            for line in lines
        ],
        "tables": [
            _own_table(lines) if axis else _table(lines, span, MOST // len(tables)) for lines in tables.values()
        ],
    }


def _colours(lines: Sequence[Line]) -> dict[str, int]:
    """Return the numbers of colours: in all charts, that of setpoints is the same one, if there are some."""
    others = [line.label for line in lines if not line.is_setpoint]
    has_setpoint = len(others) < len(lines)
    free = [number for number in range(_COLOURS) if not (has_setpoint and number == _SETPOINT)]
    found = {label: free[place % len(free)] for place, label in enumerate(others)}
    return {**{line.label: _SETPOINT for line in lines if line.is_setpoint}, **found}


def _colours_of_flights(lines: Sequence[Line]) -> dict[str, int]:
    """Return the numbers of colours: cold ones for lines of the first flight, warm ones for those of the second."""
    counts = [count() for _ in _OF_FLIGHTS]
    return {line.label: _OF_FLIGHTS[line.flight][next(counts[line.flight]) % len(_OF_FLIGHTS[0])] for line in lines}


def _table(lines: Sequence[Line], span: Times, most: int) -> list[Any]:
    """Return the times of lines that share them, and the values of each. NaN ends a line."""
    times, values = lines[0].column.times, [line.column.values for line in lines]
    kept = thinned_lines(times, values, most)
    ends = ends_of(lines, kept)
    middles = (times[kept[ends]] + times[kept[ends + 1]]) / 2
    own = np.insert(times[kept], ends + 1, middles)
    return [_packed_times(own, span), [_packed(np.insert(each[kept], ends + 1, np.nan)) for each in values]]


def _own_table(lines: Sequence[Line]) -> list[Any]:
    """Return the places on the axis of a chart that is not over time, and the values of each line."""
    return [_packed(lines[0].column.times), [_packed(line.column.values) for line in lines]]


def _track(track: Track | None, span: Times) -> list[str] | None:
    if track is None:
        return None
    kept = spread(track.times, MOST_OF_TRACK)
    heights = [_packed(track.up[kept])] if np.isfinite(track.up).any() else []
    return [_packed_times(track.times[kept], span), _packed(track.east[kept]), _packed(track.north[kept]), *heights]


def _packed_times(times: NDArray[np.float64], span: Times) -> str:
    """Return times as shares of the axis, in steps of a uint32."""
    begin, duration = span
    shares = np.clip((times - begin) / duration, 0, 1) if duration > 0 else np.zeros(len(times))
    return b64encode(np.rint(shares * _WHOLE).astype("<u4").tobytes()).decode()


def _packed(values: NDArray[np.float64]) -> str:
    with np.errstate(over="ignore"):
        return b64encode(values.astype("<f4").tobytes()).decode()
