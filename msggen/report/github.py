"""For GitHub Actions: workflow commands, which it shows as annotations of the lines.

GitHub keeps the first ten errors, warnings and notices of a step, so what is silent comes first.
"""

from __future__ import annotations

from msggen.compare.finding import Finding, Report
from msggen.report.line import deceives, level, printable, statement

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def write_github(report: Report) -> str:
    """Return a command for each finding, then the summary as a plain line."""
    findings = sorted(report.findings, key=lambda finding: not deceives(finding))
    return "\n".join([*map(_command, findings), printable(report.summary)])


def _command(finding: Finding) -> str:
    path, line, column = finding.change.location
    properties = {"file": printable(path)}
    if line:
        properties |= {"line": str(line), "col": str(column)}
    properties["title"] = printable(f"{finding.rule.id} {finding.change.subject}")
    pairs = ",".join(f"{name}={_property(value)}" for name, value in properties.items())
    return f"::{_COMMANDS[level(finding)]} {pairs}::{_data(statement(finding))}"


def _data(text: str) -> str:
    """Escape what GitHub would take for an escape; line ends are none any more."""
    return text.replace("%", "%25")


def _property(text: str) -> str:
    """Escape what would end a property, too."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")
