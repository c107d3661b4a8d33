"""The page of two flights side by side: what differs, and the same charts over each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from msggen.analysis.compare import SIDES, Comparison, comparable, compare
from msggen.analysis.figures import Track, facts_of
from msggen.analysis.flight import Flight
from msggen.analysis.timeline import COLOURS, Timeline
from msggen.exports.report import charts as drawn
from msggen.exports.report.charts import Chart, Charts, Flags, Row, Section, Times, charts_of, data_of
from msggen.exports.report.drawing import drawing_of_flights
from msggen.exports.report.page import NOTHING, first_of, name_of, strip_of, template_of
from msggen.exports.report.plans import is_needed
from msggen.exports.report.tables import value_text
from msggen.messages.earth import local
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log

_LOCAL = "vehicle_local_position"
_FARTHEST = 5000.0
"""The distance in m between the origins of two tracks from which each begins in the middle."""


def report_of_both(*logs: Log) -> str:
    """Return a report on two flights as one HTML page. Raises RecordingError if it has nothing to draw."""
    with np.errstate(all="ignore"):  # damaged samples have values of any size
        first, second = (comparable(log, is_needed) for log in logs)
        comparison = compare(first, second)
        moments = comparison.moment.first, comparison.moment.second
        charts = _over_each_other([charts_of(each.recorded) for each in (first, second)], moments)
        if not charts.sections:
            raise RecordingError(NOTHING)
        return template_of("both").render(_values((first, second), comparison, charts))


def _values(flights: tuple[Flight, Flight], comparison: Comparison, charts: Charts) -> dict[str, object]:
    """Return what the template of two flights sees, by name. 0 is the moment at which they are compared."""
    moments = comparison.moment.first, comparison.moment.second
    begin = -max(moments)
    end = max(flight.duration - moment for flight, moment in zip(flights, moments, strict=True))
    axis = Times(begin, end - begin or 1.0)
    shown = list(_shown(flights, moments))
    tracks = [(each.name, each.track) for each in shown if each.track is not None]
    is_common = len(tracks) > 1 and _offset(*flights) is not None
    groups = (("In one flight", True), ("In both flights", False))
    told = ((title, list(_told(comparison, is_of_one=is_of_one))) for title, is_of_one in groups)
    parameters = [
        each._replace(first=value_text(each.first), second=value_text(each.second)) for each in comparison.parameters
    ]
    sides = list(zip(SIDES, flights, strict=True))
    return {
        "title": " and ".join(name_of(each.log) for each in flights),
        "leads": [_lead(*each) for each in sides],
        "comparison": comparison,
        "charts": charts,
        "axis": axis,
        "strips": [strip_of(each.name, each.timeline, axis) for each in shown],
        "told": [each for each in told if each[1]],
        "parameters": first_of(parameters),
        "rates": [each._replace(first=f"{each.first:.1f}", second=f"{each.second:.1f}") for each in comparison.rates],
        "topics": [(side, first_of(own)) for side, own in zip(SIDES, comparison.topics, strict=True) if own],
        "track": drawing_of_flights(tracks, is_common=is_common) if tracks else None,
        "data": Markup(data_of(axis, shown, charts.sections)),  # noqa: S704 - escaped
        "problems": first_of(
            list(dict.fromkeys(f"{side}: {each.text}" for side, flight in sides for each in flight.log.problems))
        ),
    }


def _lead(side: str, flight: Flight) -> str:
    """Return a flight in one line."""
    facts = {fact.name: fact.value for fact in facts_of(flight.recorded)}
    parts = name_of(flight.log), facts["Vehicle"], facts["Start"], facts["Firmware"]
    return f"{side}: {' · '.join(filter(None, parts))}"


def _told(comparison: Comparison, *, is_of_one: bool) -> Iterator[dict[str, object]]:
    """Yield the findings of one flight, or those of both, and why a rule cannot say anything of a flight."""
    moment = comparison.moment
    for told in comparison.findings:
        if told.is_of_one is not is_of_one:
            continue
        sides = zip(SIDES, (told.first, told.second), (moment.first, moment.second), told.unsaid, strict=True)
        for side, findings, start, reason in sides:
            for each in findings:
                time = None if each.time is None else each.time - start
                yield {"side": side, "level": each.level, "text": each.text, "time": time}
            if reason and not findings:
                yield {"side": side, "level": "info", "text": f"does not tell: {reason}", "time": None}


def _shown(flights: tuple[Flight, Flight], moments: tuple[float, float]) -> Iterator[drawn.Shown]:
    """Yield what is drawn of each flight, with the times of the page; a flight mode has the same colour in both."""
    names = dict.fromkeys(name for flight in flights for name in flight.timeline.colours)
    colours = {name: place % COLOURS for place, name in enumerate(names)}
    tracks = _tracks(*flights)
    for side, flight, moment, track in zip(SIDES, flights, moments, tracks, strict=True):
        timeline = flight.timeline
        modes = [
            each._replace(begin=each.begin - moment, end=each.end - moment, colour=colours[each.name])
            for each in timeline.modes
        ]
        failsafes = [(begin - moment, end - moment) for begin, end in timeline.failsafes]
        marks = [mark._replace(time=mark.time - moment) for mark in timeline.marks]
        moved = None if track is None else track._replace(times=track.times - moment)
        yield drawn.Shown(side, Timeline(modes, failsafes, marks), moved)


def _tracks(first: Flight, second: Flight) -> tuple[Track | None, Track | None]:
    """Return the tracks from the first position of the first flight, or each from its own."""
    one, other = first.track, second.track
    offset = _offset(first, second)
    if one is None or other is None or offset is None:
        return _moved(one), _moved(other)
    east, north = float(one.east[0]), float(one.north[0])
    return _moved(one), other._replace(east=other.east + offset[0] - east, north=other.north + offset[1] - north)


def _moved(track: Track | None) -> Track | None:
    """Return a track that begins in the middle."""
    return track and track._replace(east=track.east - track.east[0], north=track.north - track.north[0])


def _offset(first: Flight, second: Flight) -> tuple[float, float] | None:
    """Return how far the origin of the second track is to the east and north of that of the first one, in m.

    None if the recordings do not tell it, or if it is far.
    """
    here, there = _origin(first), _origin(second)
    if here is None or there is None:
        return None
    north, east = local(here, *there)
    return (east, north) if np.hypot(east, north) < _FARTHEST else None


def _origin(flight: Flight) -> tuple[float, float] | None:
    """Return the latitude and longitude in degrees of the origin of a track, None if the recording does not tell it."""
    if flight.track is None or flight.track.source != _LOCAL:
        return None
    valid = flight.recorded.column(_LOCAL, "xy_global")
    columns = [flight.recorded.column(_LOCAL, name) for name in ("ref_lat", "ref_lon")]
    found = [each.where(valid).finite for each in columns if each is not None]
    return (float(found[0][-1]), float(found[1][-1])) if len(found) > 1 and all(map(len, found)) else None


def _over_each_other(both: Sequence[Charts], moments: tuple[float, float]) -> Charts:
    """Return the charts of two flights over each other: those with the same titles."""
    titles = dict.fromkeys(section.title for charts in both for section in charts.sections)
    sections: list[Section] = []
    for title in titles:
        found = [next((each for each in charts.sections if each.title == title), None) for charts in both]
        charts: dict[str, Chart] = {}
        flags: dict[str, Flags] = {}
        for place, section in enumerate(found):
            for chart in section.charts if section else ():
                charts[chart.title] = _with(charts.get(chart.title), chart, place, moments[place])
            for each in section.flags if section else ():
                rows = [_row(row, place, moments[place]) for row in each.rows]
                known = flags.get(each.title, Flags(each.title, ()))
                flags[each.title] = Flags(each.title, [*known.rows, *rows], known.left_out + each.left_out)
        sections.append(Section(title, list(charts.values()), list(flags.values())))
    return _numbered(sections, both)


def _with(before: Chart | None, chart: Chart, place: int, moment: float) -> Chart:
    """Return a chart of the flights before with that of one more. One with an axis of its own has no times."""
    lines = [_line(line, place, 0.0 if chart.axis else moment) for line in chart.lines]
    notes = [f"{SIDES[place]}: {note}" for note in chart.notes]
    if before is None:
        return chart._replace(lines=lines, notes=notes)
    axis = before.axis and chart.axis and before.axis._replace(high=max(before.axis.high, chart.axis.high))
    return before._replace(lines=[*before.lines, *lines], notes=[*before.notes, *notes], axis=axis)


def _numbered(sections: Sequence[Section], both: Sequence[Charts]) -> Charts:
    """Return sections with the numbers of their charts, and what neither flight has."""
    numbered, number_ = [], 0
    for section in sections:
        charts = [chart._replace(number=place) for place, chart in enumerate(section.charts, number_)]
        number_ += len(charts)
        numbered.append(section._replace(charts=charts))
    return Charts(numbered, [each for each in both[0].missing if each in both[1].missing])


def _line(line: drawn.Line, place: int, moment: float) -> drawn.Line:
    column = line.column._replace(times=line.column.times - moment)
    return replace(line, label=f"{SIDES[place]} {line.label}", column=column, flight=place)


def _row(row: Row, place: int, moment: float) -> Row:
    return Row(f"{SIDES[place]} {row.name}", [(begin - moment, end - moment) for begin, end in row.spans])
