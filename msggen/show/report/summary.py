"""The formats `summary` and `markdown`, for reviewers: what is worst comes first, and what is less is counted.

A report is made of parts: lines, or the rows of a table. Each format draws the same parts.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

from rich.text import Text

from msggen.base.diagnostics import counted, few, printable
from msggen.check.finding import Effect, Finding, Report, Resized, Severity
from msggen.show.report.console import captured
from msggen.show.report.line import conclusion, is_misread, line, remedies, silent_mark

_TITLES = {
    Effect.SILENT: "silent: readers decode wrong values without an error",
    Effect.WIRE: "wire: nodes with the other definition get no samples, refuse them, or misread them",
    Effect.BUILD: "build: source code has to change",
    Effect.OTHER: "other",
}
_HANDLED = "handled: a new version of the message covers these"
_SIGNS = {"FIELD_ADDED": "+", "FIELD_REMOVED": "-"}
"""The sign before the name of a field that only one side has. Others have `~`."""
_FEW = 15
"""The most findings of which each has its line."""
_ROWS = 30
"""The most rows of a part of a report with more of them. Silent findings are never cut."""
_NAMES = 8
"""The most names in a row: a long one would be cut."""
_TOPICS = 1
_HEADS = ("message", "bytes", "silent", "topics", "fields")


class Part(NamedTuple):
    """A part of a report: rows of a table, or lines if there are no heads."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    more: int = 0
    """How many rows were left out."""
    is_alarm: bool = False

    @property
    def end(self) -> list[str]:
        """The line about the rows that were left out, if there are any."""
        return [f"... and {self.more} more, which --only shows"] if self.more else []


def write_summary(report: Report, *, width: int, colour: bool, handled: bool = False) -> str:
    """Return the parts of a report as text, then the commands that mend findings, and the summary."""
    with captured(width, colour=colour) as (console, rows):
        for part in _parts(report, handled=handled):
            for drawn in _drawn(part):
                console.print(drawn, soft_wrap=True)
            console.print()
        for text in _end(report, handled=handled):
            console.print(Text(text), soft_wrap=True)
    return "\n".join(rows)


def write_markdown(report: Report, *, handled: bool = False) -> str:
    """Return the parts of a report as Markdown of GitHub, for a comment or for the notes of a release."""
    blocks = [f"**{_marked(report.summary)}**"]
    for part in _parts(report, handled=handled):
        blocks.append(f"### {_marked(part.title)}")
        if part.heads:
            rows = [part.heads, ["---"] * len(part.heads), *part.rows]
            cells = [[cell if row is rows[1] else _marked(cell) for cell in row] for row in rows]
            blocks.append("\n".join(f"| {' | '.join(row)} |" for row in cells))
            blocks.extend(part.end)
        else:
            lines = [*("  ".join(row) for row in part.rows), *part.end]
            blocks.append("\n".join(f"- {_marked(text)}" for text in lines))
    end = [text for text in _end(report, handled=handled) if text != report.summary]
    if end:
        blocks.append("\n".join(f"- {_marked(text)}" for text in end))
    return "\n\n".join(blocks)


_MARKS = re.compile(r"([\\`*\[\]|#~]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9]))")
"""What means something in Markdown. A `_` inside a name does not."""


def _marked(text: str) -> str:
    """Return a text as Markdown shows it: without marks, HTML and mentions of its own."""
    plain = printable(text).replace("&", "&amp;").replace("<", "&lt;")
    return _MARKS.sub(r"\\\1", plain).replace("@", "&#64;")


def _parts(report: Report, *, handled: bool) -> Iterator[Part]:
    """Yield the parts that have rows, the worst first."""
    open_ones = _open(report)
    effects = {finding.effect for finding in open_ones}
    silent = [[line(finding)] for finding in open_ones if is_misread(finding)]
    if silent:
        yield Part(_TITLES[Effect.SILENT], (), silent, is_alarm=True)
    is_whole = _is_whole(report)
    most = None if is_whole else _ROWS
    changed = [*_changed(report, open_ones)]
    if changed:
        yield _part(_TITLES[Effect.WIRE] if Effect.WIRE in effects else "messages", _HEADS, changed, most)
    for effect in (Effect.WIRE, Effect.BUILD, Effect.OTHER):
        found = [finding for finding in open_ones if finding.effect is effect]
        title = "changes on the wire" if changed and effect is Effect.WIRE else _TITLES[effect]
        if len(open_ones) <= _FEW:
            rows = [[line(finding)] for finding in found]
        else:
            apart = {each.name for each in report.messages} if effect is Effect.WIRE else ()
            rows = [*_by_subject(found, apart)]
        if rows and (effect is not Effect.OTHER or is_whole):
            yield _part(title, (), rows, most)
    rows = [[line(finding)] for finding in report.findings if finding.is_handled and handled]
    if rows:
        yield Part(_HANDLED, (), rows)


def _open(report: Report) -> list[Finding]:
    """Return the findings that no new version covers."""
    return [finding for finding in report.findings if not finding.is_handled]


def _is_whole(report: Report) -> bool:
    """Whether to show all parts with all their rows: there are few findings, or only those of one effect."""
    open_ones = _open(report)
    return len(open_ones) <= _FEW or len({finding.effect for finding in open_ones}) == 1


def _part(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], most: int | None) -> Part:
    """Return a part with at most so many rows."""
    shown = rows[:most]
    return Part(title, heads, shown, len(rows) - len(shown))


def _changed(report: Report, findings: Sequence[Finding]) -> Iterator[list[str]]:
    """Yield a row for each message whose bytes changed: first the silent ones, then those of topics."""
    of_wire: dict[str, list[Finding]] = {}
    for finding in findings:
        if finding.effect in {Effect.SILENT, Effect.WIRE}:
            of_wire.setdefault(finding.change.subject, []).append(finding)
    messages = [each for each in report.messages if each.name in of_wire]
    for each in sorted(messages, key=lambda each: (not each.silent_for, not each.topics, each.name)):
        fields = _fields(of_wire[each.name])
        yield [
            each.name,
            _sizes(each),
            silent_mark(each.silent_for).removeprefix("silent ") if each.silent_for else "",
            _topics(each.topics),
            few(fields),
        ]


def _sizes(message: Resized) -> str:
    before, after = ("varies" if size is None else str(size) for size in (message.before, message.after))
    return f"{before} -> {after}"


def _topics(topics: Sequence[str]) -> str:
    names = [topic.removeprefix("/fmu/") for topic in topics[:_TOPICS]]
    return ", ".join(names) + (f" and {len(topics) - _TOPICS} more" if len(topics) > _TOPICS else "")


def _fields(findings: Iterable[Finding]) -> list[str]:
    """Return the names of the fields that changed, each with its sign."""
    signed: dict[str, str] = {}
    for finding in findings:
        for name in finding.change.names[-1:]:
            signed.setdefault(name, _SIGNS.get(finding.rule.id, "~"))
    return [f"{sign}{name}" for name, sign in signed.items()]


def _by_subject(findings: Sequence[Finding], apart: Collection[str]) -> Iterator[list[str]]:
    """Yield the rows of each subject: its findings, or how many of a rule, without the subjects `apart`."""
    groups: dict[str, list[Finding]] = {}
    whole: dict[str, list[str]] = {}
    for finding in findings:
        subject = finding.change.subject
        if subject not in apart:
            if finding.effect is Effect.BUILD and not finding.change.names:  # the message itself
                whole.setdefault(finding.rule.id, []).append(subject)
            else:
                groups.setdefault(subject, []).append(finding)
    for rule, subjects in whole.items():
        for start in range(0, len(subjects), _NAMES):
            yield [f"{rule}: {', '.join(subjects[start : start + _NAMES])}"]
    for subject, group in groups.items():
        yield from ([f"{subject}: {text}"] for text in _of_rules(group))


def _of_rules(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield what the findings of each rule say: the names of several that have some, otherwise their messages."""
    rules: dict[str, list[Finding]] = {}
    for finding in findings:
        rules.setdefault(finding.rule.id, []).append(finding)
    names: dict[tuple[str, ...], list[str]] = {}
    for rule, group in rules.items():
        found = tuple(dict.fromkeys(each.change.names[0] for each in group if each.change.names))
        if len(group) == 1 or not found:
            yield from (f"{rule} {each.change.message}" for each in group)
        else:
            names.setdefault(found, []).append(rule)
    for found, ids in names.items():
        yield f"{' and '.join(ids)} of {len(found)}: {few(found)}"


def _drawn(part: Part) -> Iterator[Text]:
    """Yield the lines of a part. The last column is as wide as its texts."""
    rows = [[printable(cell) for cell in row] for row in part.rows]
    widths = [max(map(len, column)) for column in zip(part.heads, *rows, strict=True)] if part.heads else []
    yield Text(part.title, "bold white on red" if part.is_alarm else "bold")
    if part.heads:
        yield Text("  ".join(f"{head:{width}}" for head, width in zip(part.heads, widths, strict=True)), "dim")
    for row in rows:
        yield Text("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths or [0], strict=True)))
    yield from map(Text, part.end)


def _end(report: Report, *, handled: bool) -> Iterator[str]:
    """Yield what is only counted, what mends findings, and the summary."""
    is_whole = _is_whole(report)
    counts = Counter(
        (finding.rule.id, finding.rule.severity)
        for finding in _open(report)
        if finding.effect is Effect.OTHER and not is_whole
    )
    told = [_count(rule, number, severity) for (rule, severity), number in counts.items()]
    covered = sum(finding.is_handled for finding in report.findings)
    if covered and not handled:
        told.append(f"{covered} handled, which --handled lists")
    if told:
        yield f"not shown: {', '.join(told)}; --output-format full shows all lines"
    yield from remedies(report.findings)
    yield from conclusion(report)


def _count(rule: str, number: int, severity: Severity) -> str:
    return counted(number, f"{rule} warning") if severity is Severity.WARNING else f"{number} {rule}"
