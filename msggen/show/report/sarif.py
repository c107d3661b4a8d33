"""The format `sarif`, for code scanning: SARIF 2.1.0, the OASIS standard, which defines the keys.

The document is made of plain dictionaries, which the tests validate with the standard's JSON schema. docs/libraries.md
gives the reason for using no library.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import quote

from msggen.base.diagnostics import Diagnostic, printable
from msggen.base.location import Location
from msggen.base.version import __version__
from msggen.check.finding import Excerpt, Finding, Report, Rule
from msggen.link.link_types import LINK_TYPES
from msggen.show.report.json import dump
from msggen.show.report.line import level, remedies, statement

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"


def write_report(report: Report) -> str:
    """Return a SARIF log with one run: the rules that were applied, and a result for each finding."""
    run = {
        "tool": {"driver": {"name": "msggen", "version": __version__, "rules": [_rule(rule) for rule in report.rules]}},
        "columnKind": "unicodeCodePoints",
        "results": list(_results(report)),
        "properties": {
            "previous": report.previous or None,
            "current": report.current,
            "compared": report.compared,
            "ignored": report.ignored,
            "summary": report.summary,
        },
    }
    return _log(run)


def write_errors(errors: Sequence[Diagnostic]) -> str:
    """Return a SARIF log of a run that failed: its errors are notifications, because they are not results."""
    invocation = {"executionSuccessful": False, "toolExecutionNotifications": [*map(_notification, errors)]}
    driver = {"name": "msggen", "version": __version__}
    run = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "invocations": [invocation], "results": []}
    return _log(run)


def _notification(error: Diagnostic) -> dict[str, Any]:
    """Return a notification. An option is no location in a file, so the message names it."""
    in_file = os.path.exists(error.location.path)
    text = error.message if in_file else f"{error.location.path}: {error.message}"
    found = {"level": "error", "descriptor": {"id": error.code}, "message": {"text": printable(text)}}
    return {**found, "locations": [_place(error.location)]} if in_file else found


def _log(run: dict[str, Any]) -> str:
    return dump({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]})


def _rule(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.id,
        "shortDescription": {"text": rule.purpose},
        "fullDescription": {"text": f"{rule.category.name}: {rule.category.value}"},
        "help": {"text": f"{rule.fix} 'msggen explain {rule.id}' shows an example."},
        "defaultConfiguration": {"level": rule.severity.value},
        "properties": {"category": rule.category.name},
    }


def _results(report: Report) -> Iterator[dict[str, Any]]:
    indices = {rule.id: index for index, rule in enumerate(report.rules)}
    seen: Counter[str] = Counter()
    for finding in report.findings:
        fingerprint = _fingerprint(finding)
        seen[fingerprint] += 1
        result = {
            "ruleId": finding.rule.id,
            "ruleIndex": indices[finding.rule.id],
            "level": level(finding),
            "message": {"text": "\n".join([statement(finding), *remedies([finding])])},
            "locations": [_place(finding.change.location)],
            "partialFingerprints": {"primaryLocationLineHash": f"{fingerprint}:{seen[fingerprint]}"},
            "properties": {
                "subject": finding.change.subject,
                "silent": finding.is_silent,
                "silentFor": [reader.value for reader in finding.silent_for],
                "handled": finding.is_handled,
            },
        }
        if finding.change.before:
            result["relatedLocations"] = [_previous(report, finding.change.before)]
        yield result


def _fingerprint(finding: Finding) -> str:
    """Return a fingerprint that does not change when lines move, by which GitHub recognizes an alert."""
    change = finding.change
    texts = [excerpt.text if excerpt else "" for excerpt in (change.before, change.after)]
    facts = "\0".join([finding.rule.id, change.subject, *texts])
    return hashlib.sha256(facts.encode(errors="backslashreplace")).hexdigest()[:16]


def _previous(report: Report, excerpt: Excerpt) -> dict[str, Any]:
    text = printable(f"{report.previous}: {excerpt.text}")
    return {"id": 1, "message": {"text": text}, **_place(excerpt.location)}


def _place(location: Location) -> dict[str, Any]:
    place: dict[str, Any] = {"artifactLocation": {"uri": _uri(location.path)}}
    if location.line:
        place["region"] = {"startLine": location.line, "startColumn": location.column}
    return {"physicalLocation": place}


def _uri(path: str) -> str:
    """Return the URI of a path: a relative reference below the current folder, otherwise an absolute URI.

    The address of a link is a URI already.
    """
    scheme, mark, _ = path.partition("://")
    if mark and scheme in LINK_TYPES:
        return quote(path, safe=":/?=[]")
    below = os.path.relpath(path)
    outside = below == os.pardir or below.startswith(os.pardir + os.sep)
    text = os.path.abspath(path) if outside else below
    return ("file://" if outside else "") + quote(os.fsencode(text.replace(os.sep, "/")))
