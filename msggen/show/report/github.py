"""The format `github`: workflow commands, which GitHub Actions shows as annotations of lines.

GitHub keeps the first ten errors, warnings and notices of a step, so silent findings come first.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

from msggen.base.diagnostics import Diagnostic, printable
from msggen.base.foreign import without_commands
from msggen.base.location import Location
from msggen.check.finding import Finding, Report
from msggen.show.report.line import conclusion, is_misread, level, remedies, statement

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def write_report(report: Report) -> str:
    """Return a command for each finding and each notice, then the summary as a plain line."""
    findings = sorted(report.findings, key=lambda finding: not is_misread(finding))
    notices = [_of_diagnostic(found, _COMMANDS[found.level.value]) for found in report.notices]
    return "\n".join([*map(_of_finding, findings), *notices, *map(without_commands, conclusion(report))])


def write_errors(errors: Sequence[Diagnostic]) -> str:
    """Return a command for each error that prevented the comparison."""
    return "\n".join(_of_diagnostic(found, "error") for found in errors)


def _of_diagnostic(found: Diagnostic, command: str) -> str:
    return _command(command, found.location, found.code, printable(found.message))


def _of_finding(finding: Finding) -> str:
    title = f"{finding.rule.id} {finding.change.subject}"
    return _command(_COMMANDS[level(finding)], finding.change.location, title, statement(finding), remedies([finding]))


def _command(command: str, location: Location, title: str, message: str, more: Sequence[str] = ()) -> str:
    """Return a command for a location, with `more` lines below its message.

    GitHub shows only locations in files, so the message names a folder or an option.
    """
    path, line, column = location
    properties = {"file": printable(path)} if line or os.path.isfile(path) else {}
    if line:
        properties |= {"line": str(line), "col": str(column)}
    text = message if properties else f"{printable(path)}: {message}"
    pairs = ",".join(f"{name}={_property(value)}" for name, value in (properties | {"title": printable(title)}).items())
    return f"::{command} {pairs}::{'%0A'.join(map(_data, [text, *more]))}"


def _data(text: str) -> str:
    """Escape `%`, which starts an escape sequence, and commands of other servers; `text` has no line ends."""
    return without_commands(text, is_at_start=False).replace("%", "%25")


def _property(text: str) -> str:
    """Escape `text` for a property, which `:` and `,` would end."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")
