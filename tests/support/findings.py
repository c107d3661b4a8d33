"""The findings of the doctor in what was seen."""

from __future__ import annotations

from typing import Any

from msggen.check.finding import Report
from msggen.doctor.case import Case
from msggen.doctor.diagnose import diagnose
from msggen.doctor.expected import Expected
from msggen.doctor.observation import Observation
from msggen.vehicle.selection import Selection


def judged(seen: Observation, expected: Expected, *wanted: str, **selection: Any) -> Report:
    """Return the findings in what was seen."""
    case = Case(seen, dict.fromkeys((each.remote.number for each in seen.vehicles), expected), wanted)
    return diagnose(case._replace(selection=Selection(**selection)))


def ids(report: Report) -> list[str]:
    """Return the rules of findings, by their IDs."""
    return [finding.rule.id for finding in report.findings]


def texts(report: Report) -> str:
    """Return what findings say, a line each."""
    return "\n".join(finding.change.message for finding in report.findings)
