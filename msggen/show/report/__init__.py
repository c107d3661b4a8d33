"""Output formats of findings, for people and for programs: one module for each format."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msggen.base.diagnostics import Diagnostic
    from msggen.check.finding import Report

_PROGRAMS = ("json", "github", "sarif", "junit")
"""The formats for programs. Each is a module here, with `write_report` and `write_errors`."""

FORMATS = ("full", "concise", *_PROGRAMS)
"""The values of `--output-format`, the default first. Each format imports its libraries on first use."""

OF_CHANGES = ("summary", "markdown", *FORMATS)
"""Those of `breaking`, the default first."""


def render(
    report: Report,
    format: str,  # noqa: A002 - the name of the option
    *,
    width: int,
    colour: bool,
    handled: bool = False,
) -> str:
    """Return `report` in one of OF_CHANGES, without a line end after the last line.

    `width` and `colour` apply to formats for terminals. `summary` and `markdown` list findings that are handled if
    `handled`. Raises ValueError for an unknown format.
    """
    if format not in OF_CHANGES:
        raise ValueError(f"unknown format '{format}'")
    if format == "markdown":
        from msggen.show.report.summary import write_markdown

        return write_markdown(report, handled=handled)
    if format == "summary":
        from msggen.show.report.summary import write_summary

        return write_summary(report, width=width, colour=colour, handled=handled)
    if format in _PROGRAMS:
        return str(_module(format).write_report(report))
    if format == "full" and report.findings:
        from msggen.show.report.full import write_full

        return write_full(report, width=width, colour=colour)
    from msggen.show.report.line import write_concise

    return write_concise(report)


def render_errors(errors: Sequence[Diagnostic], format: str) -> str:  # noqa: A002 - as above
    """Return the errors that prevented a report as a document in one of FORMATS, or "" if it is one for people."""
    return str(_module(format).write_errors(errors)) if format in _PROGRAMS else ""


def _module(name: str) -> Any:
    return import_module(f"{__name__}.{name}")
