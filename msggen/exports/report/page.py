"""The page of a report: one HTML file that loads nothing else."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

import jinja2
import numpy as np
from markupsafe import Markup

from msggen.analysis import devices
from msggen.analysis.document import notes_of
from msggen.analysis.figures import duration_text, facts_of, figures_of
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import Flight, flight_of
from msggen.analysis.rules.table import FLIGHT, TOPICS
from msggen.analysis.timeline import Timeline
from msggen.base.disk.resources import resource, template_text
from msggen.base.version import __version__
from msggen.exports.report import charts as drawn
from msggen.exports.report.charts import Charts, Times, charts_of, data_of
from msggen.exports.report.drawing import bars, drawing_of
from msggen.exports.report.plans import is_needed
from msggen.exports.report.tables import changes_of, parameters_of, topics_of
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log

_MOST_MARKS = 2000
"""The texts and events in the table."""
MOST_ROWS = 2000
"""The rows of the other tables. A vehicle has some 1,500 parameters."""
LONGEST = 500
"""The letters of a text that are shown. A page with longer ones takes a browser seconds."""
_MOST_PROBLEMS = 100
"""The problems in the list."""


NOTHING = (
    "there are no samples of topics that a report shows, such as vehicle_local_position, vehicle_attitude, "
    "vehicle_status, battery_status or sensor_combined"
)
"""Why there is no report."""


class Shown(NamedTuple):
    """The rows of a table or a list that are shown, of so many."""

    rows: Sequence[Any]
    total: int

    @property
    def left_out(self) -> int:
        """How many are not shown."""
        return self.total - len(self.rows)


def _values(flight: Flight, charts: Charts) -> dict[str, object]:
    """Return what the template of a report sees, by name."""
    log, recorded, timeline = flight.log, flight.recorded, flight.timeline
    facts = [fact for fact in facts_of(recorded) if fact.value]
    told = {fact.name: fact.value for fact in facts}
    lead = told.get("Vehicle"), told.get("Start"), duration_text(recorded.duration), told.get("Firmware")
    findings = findings_of(flight)
    axis = Times(0.0, recorded.duration or 1.0)
    flights = [drawn.Shown("", timeline, flight.track)]
    values = {
        "title": name_of(log),
        "lead": " · ".join(filter(None, lead)),
        "charts": charts,
        "facts": facts,
        "devices": devices.devices_of(recorded),
        "figures": figures_of(recorded, flight.track),
        "findings": findings,
        "unsaid": len({silence.rule.id for silence in findings.silences}),
        "rules": len(FLIGHT),
        "track": None if flight.track is None else drawing_of(flight.track, timeline),
        "axis": axis,
        "strips": [strip_of("", timeline, axis)],
        "marks": first_of(timeline.marks, _MOST_MARKS),
        "event_notes": log.event_notes,
        "parameters": first_of(parameters_of(log)),
        "no_parameters": _no_parameters(log),
        "changes": first_of(changes_of(log)),
        "topics": first_of(topics_of(log)),
        "notes": notes_of(flight, "The report is"),
        "data": Markup(data_of(Times(0.0, recorded.duration), flights, charts.sections)),  # noqa: S704 - escaped
    }
    found = (f"{each.topic}: {each.text}" if each.topic else each.text for each in log.problems)  # known at last
    return {**values, "problems": first_of(list(dict.fromkeys(found)), _MOST_PROBLEMS)}


def name_of(log: Log) -> str:
    """Return the name of a recording, without its folder."""
    return os.path.basename(os.path.abspath(log.path))


def _no_parameters(log: Log) -> str:
    """Return why no parameters are shown."""
    if not log.parameters:
        return "The recording has no parameters."
    if not log.facts.has_defaults:
        return f"The recording has {len(log.parameters)} parameters, but not their defaults."
    return "All parameters were default at the start."


def strip_of(name: str, timeline: Timeline, axis: Times) -> dict[str, object]:
    """Return what happened in a flight over time: paths of SVG in a box as wide as the log is long, and 1 high."""
    spans: dict[str, list[tuple[float, float]]] = {}
    for each in timeline.modes:
        spans.setdefault(each.name, []).append((each.begin, each.end))
    colours = timeline.colours
    modes = [
        {"name": mode, "path": bars(found, axis.duration), "colour": colours[mode]} for mode, found in spans.items()
    ]
    return {"name": name, "modes": modes, "failsafes": bars(timeline.failsafes, axis.duration)}


def first_of(rows: Sequence[Any], most: int = MOST_ROWS) -> Shown:
    """Return the first rows of a table."""
    return Shown(rows[:most], len(rows))


def _hash(script: str) -> str:
    return f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"


def report(log: Log) -> str:
    """Return a report on a recording as one HTML page. Raises RecordingError if it has nothing to draw."""
    with np.errstate(all="ignore"):  # damaged samples have values of any size
        flight = flight_of(log, lambda name: is_needed(name) or name in TOPICS or name in devices.TOPICS)
        charts = charts_of(flight.recorded)
        if not charts.sections:
            raise RecordingError(NOTHING)
        return template_of("report").render(_values(flight, charts))


@cache
def template_of(name: str) -> jinja2.Template:
    """Return the template of a page. All that it shows is escaped, and texts are cut, except for what is drawn."""
    loader = jinja2.FileSystemLoader(resource("templates"))
    environment = jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
        finalize=_cut,
    )
    environment.filters["clock"] = clock
    environment.filters["drawn"] = Markup
    environment.filters["bars"] = bars
    style = template_text("report/uplot.css") + template_text("report/report.css")
    library, program = template_text("report/uplot.js"), template_text("report/report.js")
    hashes = " ".join(map(_hash, (library, program)))  # no other script may run
    texts = {"style": style, "library": library, "program": program, "script_hashes": hashes}
    environment.globals.update(version=__version__, **{key: Markup(text) for key, text in texts.items()})  # noqa: S704
    return environment.get_template(f"report/{name}.html.j2")


def _cut(value: object) -> object:
    """Return what the page shows: the start of a text that is too long, and its length."""
    if not isinstance(value, str) or isinstance(value, Markup) or len(value) <= LONGEST:
        return value
    return f"{value[:LONGEST]}… ({len(value):,} characters)"


def clock(seconds: float) -> str:
    """Return a time in s after the start: `12.3 s`, or `2:05.3`, or `1:02:05.3`."""
    if abs(seconds) < 120:  # noqa: PLR2004 - two minutes
        return f"{round(seconds, 1) + 0.0:.1f} s"
    minutes, rest = divmod(round(abs(seconds), 1), 60)
    hours, minutes = divmod(int(minutes), 60)
    front = f"{hours}:{minutes:02}" if hours else f"{minutes}"
    return f"{'-' if seconds < 0 else ''}{front}:{rest:04.1f}"
