"""`check` and `breaking`: reads both sides, asks the rules, and says in a line what came of it."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase

from msggen.compare.comparison import Comparison, Extra, Side
from msggen.compare.finding import Category, Finding, Report, Rule, Severity
from msggen.compare.renaming import nearest_message
from msggen.compare.rules import BREAKING, CHECKED, find
from msggen.diagnostics import InputError, counted
from msggen.disk.record import RECORD_NAME, parse_record
from msggen.firmware.catalog import COMPARABLE, bridged_names, read_catalog
from msggen.firmware.history import read_history
from msggen.firmware.sources import Sources, find_sources
from msggen.firmware.tree import Folder, Snapshot
from msggen.location import Location
from msggen.model import Catalog, Message, Service


def check(previous: Sources, current: Sources, *, topics_only: bool = False) -> Report:
    """Return how `current` differs in meaning from `previous`, by which it is judged.

    With `topics_only` only what crosses the bridge counts, with what it nests, and the services. Raises InputError
    where a side cannot be read.
    """
    crossing = bridged_names(previous, current) if topics_only else _own_files(previous)
    before = read_catalog(previous, wanted=crossing, tolerated=COMPARABLE)
    files = {f"{name}.msg" for name in _names(before.uorb_messages)}
    files |= {f"{name}.srv" for name in _names(before.own_services)}
    after = _with_renamed(current, files, before)
    files |= {f"{file.stem}.msg" for file in previous.unbuilt}
    extra = () if topics_only else tuple(_extra(current, files))
    comparison = Comparison(
        Side(previous.label, _place(previous), before, previous.bridge is not None),
        Side(current.label, _place(current), after, current.bridge is not None, extra=extra),
    )
    report = _report(comparison, CHECKED, list(find(comparison, CHECKED)), ("matches", "differs from"))
    return replace(report, notices=(*before.notices, *after.notices))


def breaking(
    previous: Sources,
    current: Sources,
    rules: Sequence[Rule] = BREAKING,
    ignored: Mapping[str, Collection[Rule]] | None = None,
) -> Report:
    """Return what the change from `previous` to `current` breaks, asking `rules`.

    `ignored` has rules that do not count, by name of message, service or topic, in which `*` stands for anything.
    Raises InputError where a side cannot be read.
    """
    comparison = Comparison(_side(previous), _side(current))
    findings = [finding for finding in find(comparison, rules) if not _is_ignored(finding, ignored or {})]
    report = _report(comparison, rules, findings, ("breaks nothing of", "breaks"))
    return replace(report, notices=(*previous.notices, *comparison.current.catalog.notices))


def example_of(rule: Rule) -> Report:
    """Return what `rule` finds in its example, a pair of folders `previous` and `current`."""
    previous, current = (find_sources(_example(rule, side)) for side in ("previous", "current"))
    report = check(previous, current) if rule.category is Category.DRIFT else breaking(previous, current, (rule,))
    findings = tuple(finding for finding in report.findings if finding.rule is rule)
    return replace(report, rules=(rule,), findings=findings)


def _example(rule: Rule, side: str) -> Snapshot:
    root = os.path.join(os.path.dirname(__file__), "compare", "examples", rule.id, side)
    paths = [os.path.join(folder, name) for folder, _, names in os.walk(root) for name in names]
    folder = Folder(root)
    names = [os.path.relpath(path, root).replace(os.sep, "/") for path in paths]
    return Snapshot(side, {name: folder.read(name) for name in names}, {})


def _side(sources: Sources) -> Side:
    """Return a side for `breaking`. A tree of the firmware without a bridge bridges nothing; a package does not say."""
    history = read_history(sources.root) if sources.root else None
    if history and sources.embedded:  # without the headers, which are PX4's
        history = replace(history, is_translated=True)
    catalog = read_catalog(sources, tolerated=COMPARABLE)
    return Side(
        label=sources.label,
        place=_place(sources),
        catalog=catalog,
        has_bridge=sources.is_tree or sources.bridge is not None,
        history=history,
    )


def _place(sources: Sources) -> str:
    return sources.root.path if sources.root else sources.label


def _own_files(sources: Sources) -> set[str] | None:
    """Return the files of a package that `sync` keeps, without its user's own; None where all count."""
    if not sources.root or not sources.root.is_file(RECORD_NAME):
        return None
    return {name.rpartition("/")[2] for name in parse_record(sources.root.read(RECORD_NAME)).files} or None


def _extra(sources: Sources, files: Collection[str]) -> Iterator[Extra]:
    """Yield the definitions that are none of `files`; in a package that `sync` keeps, its user's own do not count."""
    own = _own_files(sources)
    for kind, found in (("message", sources.messages), ("service", sources.services)):
        for file in found:
            name = file.name.rpartition("/")[2]
            if not file.package and name not in files and (own is None or name in own):
                yield Extra(kind, file.stem, Location(file.path))


def _with_renamed(sources: Sources, files: Collection[str], before: Catalog) -> Catalog:
    """Return the catalog of `files`, and of what may be one of them by another name if one is missing.

    Those are left out if they cannot be read: nobody has asked for them.
    """
    names = {file.stem for file in sources.messages if not file.package}
    extra = [each.name for each in _extra(sources, files) if each.kind == "message"]
    missing = _names(before.uorb_messages) - names
    near = {f"{now}.msg" for name in missing if (now := nearest_message(name, extra))}
    if near:
        with suppress(InputError):
            return read_catalog(sources, wanted={*files, *near}, tolerated=COMPARABLE)
    return read_catalog(sources, wanted=files, tolerated=COMPARABLE)


def _is_ignored(finding: Finding, ignored: Mapping[str, Collection[Rule]]) -> bool:
    subject = finding.change.subject
    service = subject.removesuffix("_Request").removesuffix("_Response")
    return any(
        finding.rule in rules and (fnmatchcase(subject, name) or fnmatchcase(service, name))
        for name, rules in ignored.items()
    )


def _report(
    comparison: Comparison, rules: Sequence[Rule], findings: Sequence[Finding], verdicts: tuple[str, str]
) -> Report:
    """Sort what was found by place, and sum it up."""
    previous, current = comparison.previous, comparison.current
    messages = _names(previous.catalog.uorb_messages) & _names(current.catalog.uorb_messages)
    services = _names(previous.catalog.own_services) & _names(current.catalog.own_services)
    failing = [finding for finding in findings if finding.fails]
    counts = [
        f"{counted(len(failing), 'finding')} in {counted(len({each.change.subject for each in failing}), 'definition')}"
        if failing
        else f"{counted(len(messages), 'message')}, {counted(len(services), 'service')}",
        *_counted(sum(finding.is_silent for finding in failing), "silent"),
        *_counted(sum(finding.is_handled for finding in findings), "handled"),
        *_counted(sum(finding.rule.severity is Severity.WARNING for finding in findings), "only warned of"),
    ]
    summary = f"{current.label} {verdicts[bool(failing)]} {previous.label}: {', '.join(counts)}"
    ordered = sorted(findings, key=lambda finding: (finding.change.subject, finding.change.location))
    return Report(
        previous=previous.label,
        current=current.label,
        rules=tuple(rules),
        findings=tuple(ordered),
        compared=len(messages) + len(services),
        summary=summary,
    )


def _names(definitions: Iterable[Message | Service]) -> set[str]:
    return {definition.name for definition in definitions}


def _counted(number: int, what: str) -> list[str]:
    return [f"{number} {what}"] if number else []
