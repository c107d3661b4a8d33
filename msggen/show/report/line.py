"""The format `concise`: a line for each finding, `path:line:col: RULE_ID message`.

The other formats use the texts about a finding from here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from msggen.base.diagnostics import printable
from msggen.check.finding import Finding, Node, Report, Severity


def write_concise(report: Report) -> str:
    """Return the answers, a line for each finding, then the summary."""
    answers, findings = map(printable, report.answers), map(line, report.findings)
    return "\n".join([*answers, *findings, *remedies(report.findings), *conclusion(report)])


def line(finding: Finding) -> str:
    """Return the line for a finding."""
    return f"{finding.change.location}: {finding.rule.id} {statement(finding)}"


def statement(finding: Finding) -> str:
    """Return the message of a finding with its mark, such as `handled: `."""
    return mark(finding) + printable(finding.change.message)


def remedies(findings: Iterable[Finding]) -> list[str]:
    """Return a line for each command that mends one of `findings`, in the order in which to run the commands."""
    commands = dict.fromkeys(each.remedy for each in sorted(findings, key=lambda each: each.rank))
    return [printable(f"to fix: {command}") for command in commands if command]


def conclusion(report: Report) -> list[str]:
    """Return the last lines of a report for people: the advice, if there is any, and the summary."""
    return [printable(text) for text in (report.advice, report.summary) if text]


def mark(finding: Finding) -> str:
    """Return the prefix of a message, such as `silent both ways: `, or "" for a finding without a mark."""
    holds = {
        silent_mark(finding.silent_for): finding.is_silent,
        "handled": finding.is_handled,
        "warning": finding.rule.severity is Severity.WARNING,
    }
    words = ", ".join(word for word in holds if holds[word])
    return f"{words}: " if words else ""


def silent_mark(readers: Collection[Node]) -> str:
    """Return the mark of a silent finding, which names the affected readers."""
    return "silent both ways" if len(readers) > 1 else f"silent for {''.join(each.value for each in readers)} readers"


def is_misread(finding: Finding) -> bool:
    """Whether readers decode wrong values without an error, and no new version covers the change."""
    return finding.is_silent and not finding.is_handled


def level(finding: Finding) -> str:
    """Return the level of a finding: `error`, `warning`, or `note` if it is handled."""
    return "note" if finding.is_handled else finding.rule.severity.value
