"""The format `json`, for programs: one object, whose keys docs/ci.md describes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import Diagnostic, printable
from msggen.base.foreign import Styled, safe_json
from msggen.base.location import Location

if TYPE_CHECKING:
    from msggen.check.finding import Excerpt, Finding, Report, Resized


def write_report(report: Report) -> str:
    """Return the whole report as JSON."""
    return dump(report_object(report))


def report_object(report: Report) -> dict[str, Any]:
    """Return the whole report as an object of JSON."""
    return {
        "previous": report.previous or None,
        "current": report.current,
        "summary": report.summary,
        "compared": report.compared,
        "ignored": report.ignored,
        "answers": [printable(text) for text in report.answers],
        "messages": [_message(message) for message in report.messages],
        "findings": [_finding(finding) for finding in report.findings],
    }


def write_errors(errors: Sequence[Diagnostic]) -> str:
    """Return the errors that prevented a report. There is no key `findings`, because nothing was compared."""
    found = [{"code": each.code, "message": each.message, "location": _location(each.location)} for each in errors]
    return dump({"errors": found})


def dump(document: Any, indent: int | None = 2) -> Styled:
    """Return `document` as JSON that is safe to print, with null for numbers that are not finite.

    What JSON does not have, such as bytes, is text.
    """
    return Styled(safe_json(json.dumps(_finite(document), indent=indent, default=str, allow_nan=False)))


def _finite(value: Any) -> Any:
    """Return `value` without NaN and infinite numbers, because many JSON parsers reject them."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, float) and not isfinite(value):
        return None
    return [_finite(item) for item in value] if isinstance(value, (list, tuple)) else value


def _message(message: Resized) -> dict[str, Any]:
    return {
        "name": message.name,
        "bytes_before": message.before,
        "bytes_after": message.after,
        "silent_for": [reader.value for reader in message.silent_for],
        "topics": list(message.topics),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    rule, change = finding.rule, finding.change
    return {
        "rule": rule.id,
        "category": rule.category.name,
        "severity": rule.severity.value,
        "effect": finding.effect.value,
        "silent": finding.is_silent,
        "silent_for": [reader.value for reader in finding.silent_for],
        "handled": finding.is_handled,
        "fails": finding.fails,
        "subject": change.subject,
        "message": printable(change.message),
        "remedy": finding.remedy or None,
        "location": _location(change.location),
        "before": _excerpt(change.before),
        "after": _excerpt(change.after),
    }


def _excerpt(excerpt: Excerpt | None) -> dict[str, Any] | None:
    return {"location": _location(excerpt.location), "text": printable(excerpt.text)} if excerpt else None


def _location(location: Location) -> dict[str, Any]:
    return {"path": location.path, "line": location.line, "column": location.column}
