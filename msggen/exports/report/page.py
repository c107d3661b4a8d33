"""The page of a report: one HTML file that loads nothing else."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

import jinja2
import numpy as np
from markupsafe import Markup

from msggen.analysis import devices
from msggen.analysis.facts import Fact, facts_of
from msggen.analysis.figures import Figure, Track, duration_text, figures_of
from msggen.analysis.finding import Findings
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import Flight, flight_of
from msggen.analysis.recorded import Recorded
from msggen.analysis.rules.table import FLIGHT, TOPICS
from msggen.analysis.timeline import Timeline
from msggen.base.diagnostics import few
from msggen.base.disk.resources import resource, template_text
from msggen.base.version import __version__
from msggen.exports.report import charts as drawn
from msggen.exports.report.charts import Charts, Times, charts_of, data_of
from msggen.exports.report.drawing import Drawing, bars, drawing_of
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


class Bar(NamedTuple):
    """The times of a mode: a path of SVG in a box as wide as the log is long, and 1 high."""

    name: str
    path: str
    colour: int


class Shown(NamedTuple):
    """The rows of a table or a list that are shown, of so many."""

    rows: Sequence[Any]
    total: int

    @property
    def left_out(self) -> int:
        """How many are not shown."""
        return self.total - len(self.rows)


class Strip(NamedTuple):
    """What happened in a flight over time, above the charts."""

    name: str
    """"" for the only flight."""
    modes: Sequence[Bar]
    failsafes: str
    """The times of failsafes as a path, "" if there are none."""


class Shell:
    """What all pages of reports have: the program and its style."""

    @property
    def version(self) -> str:
        """The version of msggen."""
        return __version__

    @property
    def style(self) -> Markup:
        """The style sheets."""
        return Markup(template_text("report/uplot.css") + template_text("report/report.css"))  # noqa: S704 - our own

    @property
    def library(self) -> Markup:
        """The script of uPlot."""
        return Markup(template_text("report/uplot.js"))  # noqa: S704

    @property
    def program(self) -> Markup:
        """The script of the report."""
        return Markup(template_text("report/report.js"))  # noqa: S704

    @property
    def script_hashes(self) -> Markup:
        """The scripts that may run, for the content security policy: no other one does."""
        return Markup(" ".join(map(_hash, (self.library, self.program))))  # noqa: S704


@dataclass(frozen=True)
class Page(Shell):
    """What the template of a report sees."""

    flight: Flight
    charts: Charts

    @property
    def _log(self) -> Log:
        return self.flight.log

    @property
    def recorded(self) -> Recorded:
        """The samples."""
        return self.flight.recorded

    @property
    def timeline(self) -> Timeline:
        """What happened when."""
        return self.flight.timeline

    @property
    def flown(self) -> Track | None:
        """The track, None if there are no positions."""
        return self.flight.track

    @property
    def title(self) -> str:
        """The name of the recording."""
        return os.path.basename(os.path.abspath(self._log.path))

    @property
    def lead(self) -> str:
        """The flight in one line."""
        wanted = {fact.name: fact.value for fact in self.facts}
        parts = [
            wanted.get("Vehicle"),
            wanted.get("Start"),
            duration_text(self.recorded.duration),
            wanted.get("Firmware"),
        ]
        return " · ".join(filter(None, parts))

    @cached_property
    def facts(self) -> list[Fact]:
        """What is known of the vehicle and the file."""
        return [fact for fact in facts_of(self.recorded) if fact.value]

    @cached_property
    def devices(self) -> list[devices.Device]:
        """The sensors of the vehicle."""
        return devices.devices_of(self.recorded)

    @cached_property
    def figures(self) -> list[Figure]:
        """The flight in numbers."""
        return figures_of(self.recorded, self.flown)

    @cached_property
    def findings(self) -> Findings:
        """What a reader should know at once, and what the recording does not tell."""
        return findings_of(self.flight)

    @property
    def unsaid(self) -> set[str]:
        """The IDs of the rules that cannot say anything."""
        return {silence.rule.id for silence in self.findings.silences}

    @property
    def rules(self) -> int:
        """The number of rules that were asked."""
        return len(FLIGHT)

    @cached_property
    def track(self) -> Drawing | None:
        """The track, None if there are no positions."""
        return None if self.flown is None else drawing_of(self.flown, self.timeline)

    @cached_property
    def axis(self) -> Times:
        """The time axis."""
        return Times(0.0, self.recorded.duration or 1.0)

    @cached_property
    def strips(self) -> list[Strip]:
        """What happened when."""
        return [strip_of("", self.timeline, self.axis)]

    @cached_property
    def marks(self) -> Shown:
        """The first texts and events."""
        return _first(self.timeline.marks, _MOST_MARKS)

    @property
    def event_notes(self) -> Sequence[str]:
        """Why events have no texts."""
        return self._log.event_notes

    @cached_property
    def parameters(self) -> Shown:
        """The first parameters that were not default at the start."""
        return _first(parameters_of(self._log), MOST_ROWS)

    @property
    def no_parameters(self) -> str:
        """Why there are none."""
        if not self._log.parameters:
            return "The recording has no parameters."
        if not self._log.facts.has_defaults:
            return f"The recording has {len(self._log.parameters)} parameters, but not their defaults."
        return "All parameters were default at the start."

    @cached_property
    def changes(self) -> Shown:
        """The first parameters that changed during the log."""
        return _first(changes_of(self._log), MOST_ROWS)

    @cached_property
    def topics(self) -> Shown:
        """The first topics of the recording."""
        return _first(topics_of(self._log), MOST_ROWS)

    @property
    def missing(self) -> str:
        """The charts that the recording has no values for."""
        return "; ".join(self.charts.missing)

    @property
    def notes(self) -> list[str]:
        """Where definitions are from that are not in the recording, and which vehicles are not shown."""
        shown, others = self.recorded.namespace or "the vehicle without a namespace", self.recorded.others
        return [*([f"The report is about {shown}, not about: {few(others)}"] if others else ()), *self._log.notes]

    @cached_property
    def problems(self) -> Shown:
        """The first problems of the recording, a line each."""
        found = (f"{each.topic}: {each.text}" if each.topic else each.text for each in self._log.problems)
        return _first(list(dict.fromkeys(found)), _MOST_PROBLEMS)

    @cached_property
    def data(self) -> Markup:
        """The data of the charts: JSON without characters of HTML."""
        axis = Times(0.0, self.recorded.duration)
        flights = [drawn.Shown("", self.timeline, self.flown)]
        return Markup(data_of(axis, flights, self.charts.sections))  # noqa: S704


def strip_of(name: str, timeline: Timeline, axis: Times) -> Strip:
    """Return what happened in a flight over time."""
    spans: dict[str, list[tuple[float, float]]] = {}
    for each in timeline.modes:
        spans.setdefault(each.name, []).append((each.begin, each.end))
    colours = timeline.colours
    modes = [Bar(mode, bars(found, axis.duration), colours[mode]) for mode, found in spans.items()]
    return Strip(name, modes, bars(timeline.failsafes, axis.duration))


def _first(rows: Sequence[Any], most: int) -> Shown:
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
        return template_of("report").render(page=Page(flight, charts))


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
