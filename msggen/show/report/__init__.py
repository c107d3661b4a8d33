"""Output formats of findings, for people and for programs: one module for each format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msggen.base.diagnostics import Diagnostic
    from msggen.check.finding import Report

FORMATS = ("full", "concise", "json", "github", "sarif", "junit")
"""The values of `--output-format`, the default first. Each format imports its libraries on first use."""


def render(report: Report, format: str, *, width: int, colour: bool) -> str:  # noqa: A002 - the name of the option
    """Return `report` in one of FORMATS, without a line end after the last line.

    `width` and `colour` apply to `full` only. Raises ValueError for an unknown format.
    """
    if format == "full" and report.findings:
        from msggen.show.report.full import write_full

        return write_full(report, width=width, colour=colour)
    if format in ("full", "concise"):
        from msggen.show.report.line import write_concise as write
    elif format == "json":
        from msggen.show.report.json import write_json as write
    elif format == "github":
        from msggen.show.report.github import write_github as write
    elif format == "sarif":
        from msggen.show.report.sarif import write_sarif as write
    elif format == "junit":
        from msggen.show.report.junit import write_junit as write
    else:
        raise ValueError(f"unknown format '{format}'")
    return write(report)


def render_errors(errors: Sequence[Diagnostic], format: str) -> str:  # noqa: A002 - as above
    """Return the errors that prevented a report as a document in one of FORMATS, or "" if it is one for people."""
    if format == "json":
        from msggen.show.report.json import write_errors as write
    elif format == "github":
        from msggen.show.report.github import write_errors as write
    elif format == "sarif":
        from msggen.show.report.sarif import write_errors as write
    elif format == "junit":
        from msggen.show.report.junit import write_errors as write
    else:
        return ""
    return write(errors)
