"""`check`, `breaking` and `lint`: read the sources, apply the rules, summarize the findings."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import chain

from msggen.base.diagnostics import OF_BOARDS, Diagnostic, InputError, counted, suggestion
from msggen.base.disk.record import NO_RECORD, RECORD_NAME, Record, parse_record
from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison, Extra, Side
from msggen.check.compare.renaming import nearest_message
from msggen.check.compare.rules import BREAKING, CHECKED, find
from msggen.check.finding import Change, Finding, Report, Resized, Rule, Severity
from msggen.check.lint.definition import Definition, definitions_of
from msggen.check.lint.rules import LINT
from msggen.definitions.model import Catalog, Message, Service
from msggen.sources.bridged import on_one_list
from msggen.sources.catalog import COMPARABLE, bridged_names, read_catalog
from msggen.sources.embedded import release_path
from msggen.sources.finding import Sources, read_files
from msggen.sources.history import read_history
from msggen.sources.inferred import Inference

_OF_NEW_VERSIONS = ("S119",)
"""Notes about a tree that is newer than the known releases. A new version in the change itself would cause one."""

_OF_TAGS = ("M107",)
"""Warnings about unknown tags, which are findings of `lint`."""


def check(previous: Sources, current: Sources, *, topics_only: bool = False) -> Report:
    """Return the differences in meaning between `current` and its reference, `previous`.

    With `topics_only`, compare only the bridged messages, the messages that they nest, and the services. Raises
    InputError if a side cannot be read.
    """
    crossing = bridged_names(previous, current) if topics_only else _own_files(previous)
    if current.is_partial:
        names = {file.name.rpartition("/")[2] for file in current.messages if not file.package}
        crossing = names if crossing is None else names & crossing
    before = read_catalog(previous, wanted=crossing, tolerated=COMPARABLE)
    files = _files(before)
    after = _with_renamed(current, files, before)
    files |= {f"{file.stem}.msg" for file in previous.unbuilt}
    extra = () if topics_only or previous.is_partial else tuple(_extra(current, files))
    comparison = Comparison(
        Side(previous.label, _place(previous), before, previous.bridge is not None, inference=_inference(previous)),
        Side(
            current.label,
            _place(current),
            after,
            current.bridge is not None,
            extra=extra,
            inference=_inference(current),
        ),
    )
    rules = _as_strict(CHECKED, current)
    report = _report(comparison, rules, list(find(comparison, rules)), ("matches", "differs from"))
    of_lists = chain(*(on_one_list(each) for each, of in ((before, previous), (after, current)) if of.is_tree))
    return replace(report, notices=_without((*before.notices, *after.notices, *of_lists), OF_BOARDS))


def _inference(sources: Sources) -> Inference | None:
    """Return the inference of tags. Recordings and generated packages can lack comments, and say nothing by that."""
    return None if sources.is_partial else Inference(sources)


def breaking(
    previous: Sources,
    current: Sources,
    rules: Sequence[Rule] = BREAKING,
    ignored: Mapping[str, Collection[Rule]] | None = None,
    *,
    topics_only: bool = False,
) -> Report:
    """Return the findings of `rules` in the change from `previous` to `current`.

    `ignored` maps names of messages, services or topics to the rules to ignore there; `*` in a name matches any text.
    Ignored findings are only counted. With `topics_only`, compare only the messages that are bridged on either side,
    the messages that they nest, and the services. Raises InputError if a side cannot be read.
    """
    wanted = bridged_names(previous, current) | bridged_names(current, previous) if topics_only else None
    before = _side(previous, wanted)
    after = _side(current, None if wanted is None else wanted | _files(before.catalog))
    comparison = Comparison(before, after)
    rules, ignored = _as_strict(rules, current), ignored or {}
    found = list(find(comparison, rules))
    kept = [finding for finding in found if not is_ignored(finding, ignored)]
    applied = _applied(rules, ignored)
    report = _report(comparison, applied, kept, ("does not break", "breaks"), ignored=len(found) - len(kept))
    notices = (*previous.notices, *comparison.current.catalog.notices)
    subjects = {*_subjects(previous, before.catalog), *_subjects(current, after.catalog)}
    subjects |= {subject for finding in found for subject in _names_of(finding)}
    shown = _without(notices, OF_BOARDS + _OF_NEW_VERSIONS)
    return replace(report, notices=shown, unmatched=_unmatched(ignored, subjects))


def lint(
    sources: Sources,
    rules: Sequence[Rule] | None = None,
    ignored: Mapping[str, Collection[Rule]] | None = None,
    messages: Collection[str] = (),
) -> Report:
    """Return the findings of `rules`, by default those that are applied unless others are selected.

    Embedded definitions are only looked at if there are no others, and definitions of other packages never. `messages`
    limits them to messages and services with these names or files. `ignored` is as in `breaking`. Raises InputError if
    the sources cannot be read, or have no such message.
    """
    contents = read_files(sources)
    catalog = read_catalog(sources, contents, tolerated=_OF_TAGS)
    chosen = [rule for rule in LINT if rule.is_default] if rules is None else rules
    applied = _as_strict(chosen, sources)
    definitions = _named(messages, definitions_of(sources, catalog, contents), sources.label)
    ignored = ignored or {}
    found = [Finding(rule, change) for each in definitions for rule in applied for change in rule.find(each)]
    findings = [finding for finding in found if not is_ignored(finding, ignored)]
    hidden = len(found) - len(findings)
    subjects = {finding.change.subject for finding in findings}
    word = "finding" if sources.strict else "warning"
    counts = f"{counted(len(findings), word)} in {counted(len(subjects), 'definition')}" if findings else "no findings"
    return Report(
        previous="",
        current=sources.label,
        rules=_applied(applied, ignored),
        findings=_ordered(findings),
        compared=len({each.message.location.path for each in definitions}),
        summary=", ".join([f"{sources.label}: {counts}", *_count(hidden, "ignored")]),
        notices=_without(catalog.notices, OF_BOARDS + _OF_NEW_VERSIONS),
        ignored=hidden,
        unmatched=_unmatched(ignored, _subjects(sources, catalog)),
    )


def _named(names: Collection[str], definitions: Iterable[Definition], label: str) -> list[Definition]:
    """Return the definitions with these names or files, or all if there are no names. Raises InputError."""
    every = list(definitions)
    known = {name for each in every for name in each.names}
    wanted = {os.path.basename(name): name for name in names}
    if unknown := [base for base in wanted if base not in known]:
        stems = sorted({each.names[1] for each in every})
        raise InputError(
            Diagnostic(Location(wanted[base], 0), "S130", f"no such message in {label}{suggestion(base, stems)}")
            for base in unknown
        )
    return [each for each in every if not names or wanted.keys() & {*each.names}]


def _as_strict(rules: Sequence[Rule], current: Sources) -> tuple[Rule, ...]:
    """Return `rules`, whose warnings are errors if the sources are read with `--strict`."""
    return tuple(replace(rule, severity=Severity.ERROR) if current.strict else rule for rule in rules)


def _without(notices: Iterable[Diagnostic], codes: Collection[str]) -> tuple[Diagnostic, ...]:
    return tuple(notice for notice in notices if notice.code not in codes)


def _side(sources: Sources, wanted: Collection[str] | None) -> Side:
    """Return a side for `breaking`, with all files or those in `wanted`.

    A PX4-Autopilot tree without dds_topics.yaml bridges no topics. The topics of a package without it are unknown.
    """
    history = read_history(sources.root) if sources.root else None
    if history and sources.embedded:  # PX4's translation headers are not embedded: assume that they exist
        history = replace(history, is_translated=True)
    catalog = read_catalog(sources, wanted=wanted, tolerated=COMPARABLE)
    return Side(
        label=sources.label,
        place=_place(sources),
        catalog=catalog,
        has_bridge=sources.is_tree or sources.bridge is not None,
        history=history,
        inference=Inference(sources),
    )


def _place(sources: Sources) -> str:
    return sources.root.path if sources.root else sources.label


def record_of(sources: Sources) -> Record:
    """Return the record of the files that `sync` wrote into a package, empty if there is none."""
    if not sources.root or not sources.root.is_file(RECORD_NAME):
        return NO_RECORD
    return parse_record(sources.root.read(RECORD_NAME))


def _own_files(sources: Sources) -> set[str] | None:
    """Return the files that `sync` wrote, if it maintains the package; None if all files of the source count."""
    return {name.rpartition("/")[2] for name in record_of(sources).files} or None


def _extra(sources: Sources, files: Collection[str]) -> Iterator[Extra]:
    """Yield the definitions outside `files`.

    In a package that `sync` maintains, definitions that `sync` did not write do not count.
    """
    own = _own_files(sources)
    for kind, found in (("message", sources.messages), ("service", sources.services)):
        for file in found:
            name = file.name.rpartition("/")[2]
            if not file.package and name not in files and (own is None or name in own):
                yield Extra(kind, file.stem, Location(file.path))


def _with_renamed(sources: Sources, files: Collection[str], before: Catalog) -> Catalog:
    """Return the catalog of `files` and, for each missing message, of the message that may be its new name.

    The candidates for a new name are left out if they have errors, because the comparison does not require them.
    """
    names = {file.stem for file in sources.messages if not file.package}
    extra = [each.name for each in _extra(sources, files) if each.kind == "message"]
    missing = _names(before.uorb_messages) - names
    near = {f"{now}.msg" for name in missing if (now := nearest_message(name, extra))}
    if near:
        with suppress(InputError):
            return read_catalog(sources, wanted={*files, *near}, tolerated=COMPARABLE)
    return read_catalog(sources, wanted=files, tolerated=COMPARABLE)


def is_ignored(finding: Finding, ignored: Mapping[str, Collection[Rule]]) -> bool:
    """Whether a finding is about a name in `ignored`, for its rule."""
    return any(
        finding.rule.id in {rule.id for rule in rules} and _is_matched(name, _names_of(finding))
        for name, rules in ignored.items()
    )


def _applied(rules: Iterable[Rule], ignored: Mapping[str, Collection[Rule]]) -> tuple[Rule, ...]:
    """Return `rules` without those that are ignored everywhere."""
    nowhere = {rule.id for rule in ignored.get("*", ())}
    return tuple(rule for rule in rules if rule.id not in nowhere)


def _unmatched(ignored: Iterable[str], subjects: Collection[str]) -> dict[str, str]:
    """Return the names in `ignored` that match no subject, each with a hint."""
    return {name: suggestion(name, subjects) for name in ignored if not _is_matched(name, subjects)}


def _names_of(finding: Finding) -> set[str]:
    """Return the names of a finding's subject: for half of a service, also that of the service."""
    subject = finding.change.subject
    return {subject, subject.removesuffix("_Request").removesuffix("_Response")}


def _is_matched(name: str, subjects: Iterable[str]) -> bool:
    return any(fnmatchcase(subject, name) for subject in subjects)


def _subjects(sources: Sources, catalog: Catalog) -> set[str]:
    """Return the names of all messages, services and topics that findings can be about."""
    files = (*sources.messages, *sources.unbuilt, *sources.services)
    return {file.stem for file in files} | {entry.topic for entry in catalog.bridge}


def _report(
    comparison: Comparison,
    rules: Sequence[Rule],
    findings: Sequence[Finding],
    verdicts: tuple[str, str],
    ignored: int = 0,
) -> Report:
    """Return a report with the findings, sorted by subject and location, and a summary."""
    previous, current = comparison.previous, comparison.current
    messages = _names(previous.catalog.uorb_messages) & _names(current.catalog.uorb_messages)
    services = _names(previous.catalog.own_services) & _names(current.catalog.own_services)
    failing = [finding for finding in findings if finding.fails]
    warned = sum(finding.rule.severity is Severity.WARNING for finding in findings)
    counts = [
        f"{counted(len(failing), 'finding')} in {counted(len({each.change.subject for each in failing}), 'definition')}"
        if failing
        else f"{counted(len(messages), 'message')}, {counted(len(services), 'service')}",
        *_count(sum(finding.is_silent for finding in failing), "silent"),
        *_count(sum(finding.is_handled for finding in findings), "handled"),
        *_count(ignored, "ignored"),
    ]
    warnings = counted(warned, "warning")
    if warned and failing:
        counts.append(warnings)
    caveat = f" with {warnings}" if warned and not failing else ""
    summary = f"{current.label} {verdicts[bool(failing)]} {previous.label}{caveat}: {', '.join(counts)}"
    return Report(
        previous=previous.label,
        current=current.label,
        rules=tuple(rules),
        findings=_ordered(findings),
        compared=len(messages) + len(services),
        summary=summary,
        ignored=ignored,
        messages=tuple(_resized(comparison)),
    )


def _resized(comparison: Comparison) -> Iterator[Resized]:
    """Yield the messages whose bytes changed."""
    for pair in comparison.changed:
        before, after = pair.previous_layout, pair.current_layout
        if not pair.is_only_renamed:
            sizes = (before and before.size, after and after.size)
            yield Resized(pair.name, *sizes, pair.misread_by, comparison.topics.get(pair.name, ()))


def _ordered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings in the order of a report, with the paths of embedded releases as people read them."""
    found = sorted(findings, key=lambda finding: (finding.change.subject, finding.change.location))
    return tuple(replace(each, change=_placed(each.change)) for each in found)


def _placed(change: Change) -> Change:
    before, after = (each and replace(each, location=_shown(each.location)) for each in (change.before, change.after))
    return replace(change, location=_shown(change.location), before=before, after=after)


def _shown(location: Location) -> Location:
    return location._replace(path=release_path(location.path))


def _files(catalog: Catalog) -> set[str]:
    """Return the file names of uORB's definitions in a catalog."""
    messages, services = _names(catalog.uorb_messages), _names(catalog.own_services)
    return {f"{name}.msg" for name in messages} | {f"{name}.srv" for name in services}


def _names(definitions: Iterable[Message | Service]) -> set[str]:
    return {definition.name for definition in definitions}


def _count(number: int, word: str) -> list[str]:
    return [f"{number} {word}"] if number else []
