"""The format `full`, for people: findings by subject, with the lines that differ side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

from rich.box import ASCII
from rich.table import Table
from rich.text import Text

from msggen.base.diagnostics import printable
from msggen.check.finding import OF_VEHICLES, Excerpt, Finding, Node, Report, Rule
from msggen.show.report.console import captured
from msggen.show.report.line import conclusion, is_misread, mark, remedies, silent_mark

if TYPE_CHECKING:
    from rich.console import Console

_DECODE = "decode wrong values without an error"
_ALARM = "bold white on red"
_BETWEEN = len("    |")
"""The width of the separators around the two columns."""
_INDENT = 2
_MANY = 8
"""The most definitions that only one side has of which each is shown with its lines."""


def write_full(report: Report, *, width: int, colour: bool) -> str:
    """Return the findings by subject with their lines, the silent subjects, the remedies, and the summary.

    Tables are drawn in ASCII, so that they look the same in terminals, logs and mails.
    """
    with captured(width, colour=colour) as (console, rows):
        for text in report.answers:
            _print_line(console, Text(printable(text)))
        _print_lines(console, [each for each in report.findings if each.rule.category in OF_VEHICLES])
        of_files = [each for each in report.findings if each.rule.category not in OF_VEHICLES]
        subjects = _by_subject(of_files)
        listed = _whole_definitions(subjects)
        for rule, names in listed.items():
            _print_names(console, rule, names)
        told = {name for names in listed.values() for name in names}
        for subject, findings in subjects.items():
            if subject not in told:
                _print_group(console, report, subject, findings)
        for readers, misread in _misread_subjects(report.findings).items():
            _print_line(
                console, Text.assemble((_explain_silent(readers), _ALARM), f": {printable(', '.join(misread))}")
            )
        for remedy in remedies(report.findings):
            _print_line(console, Text(remedy))
        *advice, summary = conclusion(report)
        for text in advice:
            _print_line(console, Text(text))
        _print_line(console, Text(summary, "bold"))
    return "\n".join(rows)


def _by_subject(findings: Sequence[Finding]) -> dict[str, list[Finding]]:
    groups: dict[str, list[Finding]] = {}
    for finding in findings:
        groups.setdefault(finding.change.subject, []).append(finding)
    return groups


def _whole_definitions(subjects: Mapping[str, Sequence[Finding]]) -> dict[Rule, list[str]]:
    """Return the subjects that only one side has, by rule, of rules with many of them. A table of each says no more."""
    found: dict[Rule, list[str]] = {}
    for subject, (first, *others) in subjects.items():
        if not others and not first.change.names and (first.change.before is None) != (first.change.after is None):
            found.setdefault(first.rule, []).append(subject)
    return {rule: names for rule, names in found.items() if len(names) > _MANY}


def _print_names(console: Console, rule: Rule, names: Sequence[str]) -> None:
    """Print the subjects of a rule, in lines of their own."""
    _print_line(console, Text.assemble((rule.id, "bold"), f" ({len(names)} times): {rule.purpose}"))
    for text in wrap(printable(", ".join(names)), console.width - _INDENT, break_on_hyphens=False):
        _print_line(console, Text(" " * _INDENT + text))
    _print_line(console, Text())


def _misread_subjects(findings: Sequence[Finding]) -> dict[tuple[Node, ...], list[str]]:
    """Return the subjects that readers misread silently, by the readers."""
    silent = [finding for finding in findings if is_misread(finding)]
    kinds = dict.fromkeys(finding.silent_for for finding in silent)
    return {kind: [*_by_subject([each for each in silent if each.silent_for == kind])] for kind in kinds}


def _explain_silent(readers: Sequence[Node]) -> str:
    return f"{silent_mark(readers)}: {'readers' if len(readers) > 1 else 'they'} {_DECODE}"


def _print_group(console: Console, report: Report, subject: str, findings: Sequence[Finding]) -> None:
    heading = Text(printable(subject), "bold")
    for readers in _misread_subjects(findings):
        heading = Text.assemble(heading, " ", (f"({_explain_silent(readers)})", _ALARM))
    _print_line(console, heading)
    _print_lines(console, findings)
    pairs = dict.fromkeys((finding.change.before, finding.change.after) for finding in findings)
    pairs.pop((None, None), None)
    if pairs:
        _print_line(console, Text())
        console.print(_side_by_side(report, list(pairs), console.width))
    _print_line(console, Text())


def _print_lines(console: Console, findings: Sequence[Finding]) -> None:
    for finding in findings:
        _print_line(console, _line(finding))


def _print_line(console: Console, text: Text) -> None:
    """Print `text` without wrapping, because terminals wrap lines, and whole lines in logs are easier to search."""
    console.print(text, soft_wrap=True)


def _line(finding: Finding) -> Text:
    style = _ALARM if is_misread(finding) else "dim" if finding.is_handled else "yellow"
    words = mark(finding).rstrip(": ")
    return Text.assemble(
        f"{finding.change.location}: ",
        (finding.rule.id, "bold"),
        " ",
        (words, style),
        ": " if words else "",
        printable(finding.change.message),
    )


def _side_by_side(report: Report, pairs: Sequence[tuple[Excerpt | None, Excerpt | None]], width: int) -> Table:
    table = Table(box=ASCII, show_edge=False, expand=True, header_style="bold")
    digits = len(str(max(excerpt.location.line for pair in pairs for excerpt in pair if excerpt)))
    names = [report.previous, report.current] if report.previous else [report.current]
    for name, style in zip(names, ("red", "green") if report.previous else ("",), strict=True):
        table.add_column(Text(printable(name)), ratio=1, overflow="fold", style=style)
    for pair in pairs:
        cells = pair[-len(names) :]
        table.add_row(*(_cell(each, digits, (width - _BETWEEN) // len(names)) if each else "" for each in cells))
    return table


def _cell(excerpt: Excerpt, digits: int, width: int) -> Text:
    """Return the number and the text of a line; a long line is wrapped with a hanging indent."""
    number = f"{excerpt.location.line or '':>{digits}}  "
    lines = wrap(printable(excerpt.text), max(width - len(number), 1), break_on_hyphens=False)
    return Text(number + f"\n{' ' * len(number)}".join(lines))
