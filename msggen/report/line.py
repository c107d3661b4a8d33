"""A finding in a line, in the house's form: `path:line:col: RULE_ID message`."""

from __future__ import annotations

from collections.abc import Collection

from msggen.compare.finding import Finding, Reader, Report, Severity


def write_concise(report: Report) -> str:
    """Return one line for each finding, then the summary."""
    return "\n".join([*map(line, report.findings), printable(report.summary)])


def line(finding: Finding) -> str:
    """Return the finding in a line."""
    return f"{finding.change.location}: {finding.rule.id} {statement(finding)}"


def statement(finding: Finding) -> str:
    """Return what was found, after the words that say how much it matters."""
    return mark(finding) + printable(finding.change.message)


def mark(finding: Finding) -> str:
    """Return the words that say how much a finding matters: `silent both ways: `, or nothing for a plain one."""
    holds = {
        silence(finding.silent_for): finding.is_silent,
        "handled": finding.is_handled,
        "warning": finding.rule.severity is Severity.WARNING,
    }
    words = ", ".join(word for word in holds if holds[word])
    return f"{words}: " if words else ""


def silence(readers: Collection[Reader]) -> str:
    """Return the word for a silent finding, and the readers that it concerns."""
    return "silent both ways" if len(readers) > 1 else f"silent for {''.join(each.value for each in readers)} readers"


def deceives(finding: Finding) -> bool:
    """Whether readers decode wrong values without an error, and nothing takes care of it: the worst there is."""
    return finding.is_silent and not finding.is_handled


def level(finding: Finding) -> str:
    """Return `error`, `warning`, or `note` for what is taken care of."""
    return "note" if finding.is_handled else finding.rule.severity.value


def printable(text: str) -> str:
    """Return `text` in one line, with escapes for what cannot be seen; nothing is left that XML forbids."""
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)
