"""The findings of a recording as an object of JSON, whose keys docs/findings.md describes."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

from msggen.analysis.finding import FAILING
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import flight_of
from msggen.analysis.rules.table import TOPICS
from msggen.base.diagnostics import few
from msggen.recordings.log.origin import time_of_day

if TYPE_CHECKING:
    from msggen.analysis.finding import Finding, Findings
    from msggen.analysis.flight import Flight
    from msggen.recordings.log.log import Log


def examined(log: Log) -> tuple[Flight, Findings]:
    """Return the flight in a recording with the topics that rules read, and what they say about it."""
    flight = flight_of(log, TOPICS.__contains__)
    return flight, findings_of(flight)


def document_of(flight: Flight, findings: Findings) -> dict[str, Any]:
    """Return what the rules say about a flight as an object of JSON. Times are in s after the start."""
    log, recorded = flight.log, flight.recorded
    start = time_of_day(log.start, log.utc_offset)
    return {
        "recording": log.path,
        "vehicle": log.vehicle or None,
        "namespace": recorded.namespace,
        "firmware": str(log.release()),
        "start": f"{start:%Y-%m-%dT%H:%M:%SZ}" if start else None,
        "duration": flight.duration,
        "findings": list(map(_finding, findings.findings)),
        "unsaid": [{"rule": each.rule.id, "reason": each.reason} for each in findings.silences],
        "clear": [rule.id for rule in findings.clear],
        "notes": notes_of(flight, "the findings are"),
        "problems": [each.text for each in log.problems],
    }


def notes_of(flight: Flight, subject: str) -> list[str]:
    """Return which vehicle `the findings are` about, if there are several, and where definitions are from."""
    shown, others = flight.recorded.namespace or "the vehicle without a namespace", flight.recorded.others
    return [*([f"{subject} about {shown}, not about: {few(others)}"] if others else ()), *flight.log.notes]


def fails(document: Mapping[str, Any]) -> bool:
    """Whether somebody has to look at a recording: a finding is an error or a warning, or a part cannot be read."""
    return bool(document["problems"]) or any(each["level"] in FAILING for each in document["findings"])


def _finding(finding: Finding) -> dict[str, Any]:
    return {"rule": finding.rule.id, **seen_of(finding), "meaning": finding.rule.purpose, "fix": finding.rule.fix}


def seen_of(finding: Finding) -> dict[str, Any]:
    """Return what was seen as an object of JSON, with null for evidence that is no number."""
    return {
        "level": finding.level,
        "text": finding.text,
        "time": finding.time,
        "end": finding.end,
        "values": {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in finding.values.items()
        },
    }
