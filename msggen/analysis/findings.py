"""What a reader of a flight should know at once: the findings of all rules, and what they cannot say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msggen.analysis.finding import LEVELS, Finding, Findings, FlightRule, Seen, Silence, Unsaid
from msggen.analysis.flight import Flight
from msggen.analysis.recorded import Recorded
from msggen.analysis.rules.table import FLIGHT

_SHOWN = 2
"""The topics or fields that are named, of several ones of which a rule needs one."""


def findings_of(flight: Flight, rules: Sequence[FlightRule] = FLIGHT) -> Findings:
    """Return what rules say about a flight."""
    found: list[Finding] = []
    silences: list[Silence] = []
    clear: list[FlightRule] = []
    for rule in rules:
        said = _said(rule, flight)
        found += [_finding(rule, each, flight.duration) for each in said if isinstance(each, Seen)]
        silences += [Silence(rule, each.reason) for each in said if isinstance(each, Unsaid)]
        if not said:
            clear.append(rule)
    return Findings(tuple(sorted(found, key=_rank)), tuple(silences), tuple(clear))


def _said(rule: FlightRule, flight: Flight) -> list[Seen | Unsaid]:
    missing = [paths for paths in rule.needs if not any(_has(flight.recorded, path) for path in paths)]
    if missing:
        return [Unsaid(f"the recording has no {_either(paths)}") for paths in missing[:1]]
    if rule.is_about_flight and not flight.recorded.armed:
        return [Unsaid("the vehicle was never armed")]
    with np.errstate(all="ignore"):  # damaged samples have values of any size
        return list(rule.find(flight))


def _has(recorded: Recorded, path: str) -> bool:
    """Whether a recording has a topic, or a number of a field."""
    topic, _, field = path.partition(".")
    if not field:
        return topic in recorded
    columns = (recorded.column(topic, field, instance) for instance in recorded.instances(topic))
    return any(column is not None and len(column.finite) for column in columns)


def _either(paths: Sequence[str]) -> str:
    return " or ".join(paths) if len(paths) <= _SHOWN else f"{paths[0]} or one of {len(paths) - 1} others"


def _finding(rule: FlightRule, seen: Seen, duration: float) -> Finding:
    """Return a finding. What was seen can begin before the recording, as a text, or end after it, as a dropout."""
    time, end = (None if each is None else min(max(each, 0.0), duration) for each in (seen.time, seen.end))
    return Finding(rule, seen.level or rule.severity.value, seen.text, time, end, seen.values)


def _rank(finding: Finding) -> tuple[int, float]:
    return LEVELS.index(finding.level), -1.0 if finding.time is None else finding.time
