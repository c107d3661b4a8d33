"""VERSION rules: the firmware's rules for versioned messages, which have the constant MESSAGE_VERSION.

When a message or a message that it nests changes, its version is raised by one, the previous definition is archived as
`msg/px4_msgs_old/msg/<Name>V<n>.msg`, and a header translates between both versions (PX4 v1.16 and later). Between two
releases, a version may be raised several times.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

from msggen.base.diagnostics import few
from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison, MessagePair, constants_of
from msggen.check.compare.semantic import retagged_messages
from msggen.check.compare.source_code import excerpt, wire_value
from msggen.check.compare.taken_back import find_remains, in_header
from msggen.check.finding import Change, Excerpt
from msggen.definitions.model import VERSION, Catalog, Message
from msggen.sources.history import ARCHIVE, TRANSLATIONS, VERSIONED, History, archived_name
from msggen.sources.translation_check import (
    Problem,
    Version,
    assigned,
    lost_values,
    missing_fields,
    unfinished_lines,
    unfinished_names,
    unknown_names,
)


class Coverage(NamedTuple):
    """The extent to which the new versions of a message translate it.

    `open` has the names that a header does not mention, mentions in a line marked TODO, or sets to a constant although
    the other version has the value. `copied` has the fields that all steps copy, and `computed` those that a step
    computes.
    """

    open: frozenset[str]
    copied: frozenset[str]
    computed: frozenset[str]


def find_not_raised(comparison: Comparison) -> Iterator[Change]:
    """Yield the versioned messages that changed, at any depth, but whose version was not raised step by step."""
    for pair in _versioned(comparison):
        before, after = pair.previous.message_version, pair.current.message_version
        skipped = _skipped(comparison, pair)
        jumps = (after < before or skipped is not None) and not _means_the_same(comparison, pair)
        if jumps or (pair.differs and after <= before):
            hint = "" if skipped is None else f", and version {skipped} is not in the archive"
            found = f"found {after}{hint}" if after >= before else f"found {after}, lower than {before}"
            yield _change(pair, f"'{pair.name}' changed: expected {VERSION} = {before + 1}, {found}")


def find_needless(comparison: Comparison) -> Iterator[Change]:
    """Yield the versioned messages whose version differs, but whose meaning does not."""
    for pair in _versioned(comparison):
        before, after = pair.previous.message_version, pair.current.message_version
        is_reverted = _skipped(comparison, pair) is None and bool(_between(comparison, pair))
        if before != after and _means_the_same(comparison, pair) and not is_reverted:
            text = f"{VERSION} is {after}, but {before} in {comparison.previous.label}"
            yield _change(pair, f"{text}; '{pair.name}' did not change")


def find_removed(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages that are no longer versioned, or moved out of msg/versioned, and missing archived versions."""
    for pair in comparison.pairs:
        problems = list(_problems(comparison, pair))
        if problems:
            yield _change(pair, f"'{pair.name}' {', and '.join(problems)}")
    before, after = comparison.previous.history, comparison.current.history
    if before and after and after.is_kept:
        for name in sorted(before.archived.keys() - after.archived):
            text = f"archived version '{name}' of {comparison.previous.label} is missing"
            place = Location(comparison.current.place, 0)
            yield Change(name, text, place, Excerpt(before.archived[name].location, f"{name}.msg"))


def find_not_archived(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages with a raised version whose previous definition is missing in the archive or differs there."""
    for pair in _raised(comparison):
        if not _is_archived(comparison, pair):
            name = archived_name(pair.previous)
            known = comparison.current.history and name in comparison.current.history.archived
            problem = f"differs from {comparison.previous.label}" if known else "is missing"
            expected = f"expected the definition of version {pair.previous.message_version}"
            headers = [*_from_previous(comparison, pair)] if known else []
            again = f"; if it was never released, delete it and {' and '.join(map(repr, headers))}, and run msggen bump"
            yield _change(pair, f"'{ARCHIVE}/{name}.msg' {problem}: {expected}{again if headers else ''}")


def find_not_translated(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages with a raised version that no headers translate, step by step, from the previous version."""
    for pair in _raised(comparison):
        reached = max(_reached(comparison, pair))
        if reached < pair.current.message_version:
            text = f"no header that all_translations.h includes translates '{pair.name}' from version {reached}"
            yield _change(pair, f"{text}: expected one in {TRANSLATIONS}")


def find_invalid_translations(comparison: Comparison) -> Iterator[Change]:
    """Yield the names in translation headers that their version of the message lacks, and remains of other versions."""
    history = comparison.current.history
    if not history:
        return
    for pair in _raised(comparison):
        for header, problem in _unknown_names(comparison, pair):
            yield in_header(history, header, problem.line, pair.name, problem.text)
    others = {change.subject for find in (find_not_raised, find_not_translated) for change in find(comparison)}
    yield from (change for change in find_remains(comparison) if change.subject not in others)


def find_unfinished_translations(comparison: Comparison) -> Iterator[Change]:
    """Yield the translation headers that leave out a field or its value, or have a TODO."""
    history = comparison.current.history
    if not history:
        return
    for pair in _raised(comparison):
        for older, newer, headers in _steps(comparison, pair):
            for header, text in headers.items():
                missing, todo = missing_fields(text, older.message, newer.message), unfinished_lines(text)
                problems = [f"does not mention {few(missing)}"] if missing else []
                problems += [f"has TODO in {_lines(todo)}"] if todo else []
                lost = [each for each in _lost_values(pair, text, older, newer) if each.line not in todo]
                problems += [each.text for each in lost]
                if problems:
                    found = f"'{header}' {' and '.join(problems)}"
                    line = [*todo, *(each.line for each in lost), 1][0]
                    yield in_header(history, header, line, pair.name, found)


def handled(comparison: Comparison) -> dict[str, Coverage]:
    """Return the messages whose change is covered by one or more complete new versions, and to what extent."""
    return {
        pair.name: _coverage(comparison, pair)
        for pair in _raised(comparison)
        if _is_archived(comparison, pair)
        and _skipped(comparison, pair) is None
        and pair.current.message_version in _reached(comparison, pair)
        and not any(_unknown_names(comparison, pair))
    }


def is_bumped(comparison: Comparison, pair: MessagePair) -> bool:
    """Whether `msggen bump` makes a new version for the change of a message, or completes it.

    It changes nothing if the version is complete, and refuses if it rose by more than one or is archived differently.
    """
    history = comparison.current.history
    is_versioned = pair.previous.is_versioned and pair.current.is_versioned and _is_in_versioned(pair.current)
    if not history or not is_versioned:
        return False
    before, after = pair.previous.message_version, pair.current.message_version
    is_archived = archived_name(pair.previous) in history.archived
    if after == before:
        return not is_archived or _is_archived(comparison, pair)
    is_complete = _is_archived(comparison, pair) and after in _reached(comparison, pair)
    return after == before + 1 and not is_complete and (not is_archived or _is_archived(comparison, pair))


def _coverage(comparison: Comparison, pair: MessagePair) -> Coverage:
    open_: set[str] = set()
    copied: set[str] = set()
    computed: set[str] = set()
    for older, newer, headers in _steps(comparison, pair):
        for text in headers.values():
            fields = assigned(text, older, newer)
            copied |= fields.copied
            computed |= fields.computed
            open_.update(unfinished_names(text), missing_fields(text, older.message, newer.message))
            open_.update(name for each in _lost_values(pair, text, older, newer) for name in each.names)
    return Coverage(frozenset(open_), frozenset(copied - computed), frozenset(computed))


def _lost_values(pair: MessagePair, text: str, older: Version, newer: Version) -> Iterator[Problem]:
    renamed = {each.previous.name: each.current.name for each in pair.renamed}
    return lost_values(text, older, newer, renamed)


def _unknown_names(comparison: Comparison, pair: MessagePair) -> Iterator[tuple[str, Problem]]:
    """Yield each name in a header that its version of the message lacks, with the name of the header."""
    for older, newer, headers in _steps(comparison, pair):
        for header, text in headers.items():
            yield from ((header, problem) for problem in unknown_names(text, older, newer))


def _problems(comparison: Comparison, pair: MessagePair) -> Iterator[str]:
    """Yield the reasons why a message is no longer versioned."""
    if pair.previous.is_versioned and not pair.current.is_versioned:
        yield f"has no {VERSION}, which is {pair.previous.message_version} in {comparison.previous.label}"
    history = comparison.current.history
    if history and history.is_kept and _is_in_versioned(pair.previous) and not _is_in_versioned(pair.current):
        yield f"is no longer in {VERSIONED}"


def _is_in_versioned(message: Message) -> bool:
    return os.path.basename(os.path.dirname(message.location.path)) == os.path.basename(VERSIONED)


def _versioned(comparison: Comparison) -> Iterator[MessagePair]:
    return (pair for pair in comparison.pairs if pair.previous.is_versioned and pair.current.is_versioned)


def _raised(comparison: Comparison) -> Iterator[MessagePair]:
    """Yield the messages with a raised version, if the current side is a tree with versioned messages."""
    history = comparison.current.history
    if history and history.is_kept:
        for pair in _versioned(comparison):
            if pair.current.message_version > pair.previous.message_version:
                yield pair


def _is_archived(comparison: Comparison, pair: MessagePair) -> bool:
    history = comparison.current.history
    archived = history.archived.get(archived_name(pair.previous)) if history else None
    return (
        history is not None
        and archived is not None
        and archived.message_version == pair.previous.message_version
        and _is_copy(history, archived, comparison.previous.catalog, pair.previous)
    )


def _skipped(comparison: Comparison, pair: MessagePair) -> int | None:
    """Return the first version between both sides that is missing in the archive, or None. A package has no archive."""
    history = comparison.current.history
    between = range(pair.previous.message_version + 1, pair.current.message_version)
    archived = _between(comparison, pair)
    return (
        next((version for version in between if version not in archived), None) if history and history.is_kept else None
    )


def _between(comparison: Comparison, pair: MessagePair) -> dict[int, Message]:
    """Return the archived versions between the versions of both sides, by number."""
    history = comparison.current.history
    numbers = range(pair.previous.message_version + 1, pair.current.message_version)
    messages = history.archived.values() if history else ()
    return {
        old.message_version: old
        for old in messages
        if old.name == f"{pair.name}V{old.message_version}" and old.message_version in numbers
    }


def _steps(comparison: Comparison, pair: MessagePair) -> Iterator[tuple[Version, Version, dict[str, str]]]:
    """Yield each step of translation from the previous to the current version: both versions, and the headers."""
    history = comparison.current.history
    if not history:
        return
    previous, current, archived = comparison.previous.catalog, comparison.current.catalog, history.archived
    between = _between(comparison, pair)
    versions = [
        Version(pair.previous, lambda message, field: previous.nested(message, field.type)),
        *(Version(between[number], lambda _, field: archived.get(field.type.name)) for number in sorted(between)),
        Version(pair.current, lambda message, field: current.nested(message, field.type), is_current=True),
    ]
    for older, newer in combinations(versions, 2):
        target = None if newer.is_current else newer.message.message_version
        headers = history.translating(pair.name, older.message.message_version, target)
        if headers:
            yield older, newer, headers


def _from_previous(comparison: Comparison, pair: MessagePair) -> dict[str, str]:
    """Return the headers that translate from the previous version to the current one."""
    history = comparison.current.history
    return history.translating(pair.name, pair.previous.message_version) if history else {}


def _reached(comparison: Comparison, pair: MessagePair) -> set[int]:
    """Return the previous version, and the versions that headers translate it to, step by step."""
    history = comparison.current.history
    if history and history.is_translated:
        return {pair.previous.message_version, pair.current.message_version}
    found = {pair.previous.message_version}
    for older, newer, _ in _steps(comparison, pair):
        if older.message.message_version in found:
            found.add(newer.message.message_version)
    return found


def _is_copy(history: History, archived: Message, catalog: Catalog, message: Message) -> bool:
    """Whether `archived` has the same fields as `message`, and nests archived versions of the same messages."""
    if len(archived.fields) != len(message.fields):
        return False
    for kept, field in zip(archived.fields, message.fields, strict=True):
        if kept.name != field.name or (kept.type.array, kept.type.length) != (field.type.array, field.type.length):
            return False
        if field.type.is_primitive:
            if kept.type != field.type:
                return False
            continue
        inner = catalog.nested(message, field.type)
        found = history.archived.get(kept.type.name)
        if not found or found.name != archived_name(inner) or not _is_copy(history, found, catalog, inner):
            return False
    return True


def _means_the_same(comparison: Comparison, pair: MessagePair) -> bool:
    """Whether fields, constants and tags mean the same on both sides; fields and tags at every depth."""
    before, after = (
        {name: wire_value(constant) for name, constant in constants_of(message).items() if name != VERSION}
        for message in (pair.previous, pair.current)
    )
    names = {pair.name, *(inner.name for inner in comparison.current.catalog.nested_all(pair.current))}
    return not pair.differs and before == after and not names & retagged_messages(comparison)


def _change(pair: MessagePair, text: str) -> Change:
    before, after = constants_of(pair.previous).get(VERSION), constants_of(pair.current).get(VERSION)
    location = after.location if after else pair.current.location
    return Change(
        pair.name,
        text,
        location,
        before=excerpt(before) if before else None,
        after=excerpt(after) if after else None,
    )


def _lines(numbers: list[int]) -> str:
    return f"line{'s' * (len(numbers) > 1)} {few([*map(str, numbers)])}"
