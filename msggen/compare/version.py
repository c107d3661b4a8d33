"""VERSION: the firmware's rules for versioned messages, those with a MESSAGE_VERSION.

When a message or anything that it nests changes, its version goes up by one, the old definition is archived as
`msg/px4_msgs_old/msg/<Name>V<n>.msg`, and a header translates between both (PX4 v1.16 and later).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from msggen.compare.comparison import Comparison, MessagePair, constants_of
from msggen.compare.finding import Change, Excerpt
from msggen.compare.semantic import has_same_tags
from msggen.compare.source import excerpt, wire_value
from msggen.firmware.history import ARCHIVE, TRANSLATIONS, History, archived_name, without_comments
from msggen.location import Location
from msggen.model import VERSION, Catalog, Message


def find_not_raised(comparison: Comparison) -> Iterator[Change]:
    """Versioned messages that changed, at any depth, and whose version did not go up by exactly one."""
    for pair in _versioned(comparison):
        before, after = pair.previous.message_version, pair.current.message_version
        jumps = after not in (before, before + 1) and not _means_the_same(pair)
        if after != before + 1 and (pair.differs or jumps):
            yield _change(pair, f"'{pair.name}' changed: expected {VERSION} = {before + 1}, found {after}")


def find_needless(comparison: Comparison) -> Iterator[Change]:
    """Versioned messages with another version that mean the same as before."""
    for pair in _versioned(comparison):
        before, after = pair.previous.message_version, pair.current.message_version
        if before != after and _means_the_same(pair):
            text = f"{VERSION} is {after}, in {comparison.previous.label} {before}, but '{pair.name}' is the same"
            yield _change(pair, text)


def find_removed(comparison: Comparison) -> Iterator[Change]:
    """Messages that are versioned no more, and archived versions that are gone."""
    for pair in comparison.pairs:
        if pair.previous.is_versioned and not pair.current.is_versioned:
            text = (
                f"'{pair.name}' has lost its {VERSION}, {pair.previous.message_version} in {comparison.previous.label}"
            )
            yield _change(pair, text)
    before, after = comparison.previous.history, comparison.current.history
    if before and after and after.is_kept:
        for name in sorted(before.archived.keys() - after.archived):
            text = f"archived version '{name}' of {comparison.previous.label} is missing"
            place = Location(comparison.current.place, 0)
            yield Change(name, text, place, Excerpt(before.archived[name].location, f"{name}.msg"))


def find_not_archived(comparison: Comparison) -> Iterator[Change]:
    """Messages with a higher version whose previous definition is not in the archive, or another is there."""
    for pair in _raised(comparison):
        if not _is_archived(comparison, pair):
            name = archived_name(pair.previous)
            known = comparison.current.history and name in comparison.current.history.archived
            what = f"is not what {comparison.previous.label} has" if known else "is missing"
            yield _change(
                pair, f"'{ARCHIVE}/{name}.msg' {what}: the definition of version {pair.previous.message_version}"
            )


def find_not_translated(comparison: Comparison) -> Iterator[Change]:
    """Messages with a higher version that no header translates from the previous one."""
    for pair in _raised(comparison):
        if not _is_translated(comparison, pair):
            text = f"no header that all_translations.h includes translates '{pair.name}' from version "
            yield _change(pair, f"{text}{pair.previous.message_version}: expected in {TRANSLATIONS}")


def find_unfinished_translations(comparison: Comparison) -> Iterator[Change]:
    """Headers that translate, but leave out a field, or have a line with TODO on it."""
    for pair in _raised(comparison):
        for header, text in _translating(comparison, pair).items():
            code = without_comments(text)
            names = [field.name for field in (*pair.current.fields, *pair.removed)]
            missing = [name for name in names if not re.search(rf"\.{name}\b", code)]
            left = [f"does not mention {', '.join(missing)}"] if missing else []
            left += ["has lines with TODO"] if "TODO" in text else []
            if left:
                yield _change(pair, f"'{header}' {' and '.join(left)}")


def handled(comparison: Comparison) -> frozenset[str]:
    """Return the messages whose change a complete new version takes care of."""
    return frozenset(
        pair.name
        for pair in _raised(comparison)
        if pair.current.message_version == pair.previous.message_version + 1
        and _is_archived(comparison, pair)
        and _is_translated(comparison, pair)
    )


def _versioned(comparison: Comparison) -> Iterator[MessagePair]:
    return (pair for pair in comparison.pairs if pair.previous.is_versioned and pair.current.is_versioned)


def _raised(comparison: Comparison) -> Iterator[MessagePair]:
    """Yield the messages with a higher version, where the current side is a tree that keeps earlier ones."""
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


def _is_translated(comparison: Comparison, pair: MessagePair) -> bool:
    history = comparison.current.history
    return (history is not None and history.is_translated) or bool(_translating(comparison, pair))


def _translating(comparison: Comparison, pair: MessagePair) -> dict[str, str]:
    history = comparison.current.history
    return history.translating(pair.name, pair.previous.message_version) if history else {}


def _is_copy(history: History, archived: Message, catalog: Catalog, message: Message) -> bool:
    """Whether `archived` has the fields of `message`; what it nests is archived, too, and called so."""
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


def _means_the_same(pair: MessagePair) -> bool:
    before, after = (
        {name: wire_value(constant) for name, constant in constants_of(message).items() if name != VERSION}
        for message in (pair.previous, pair.current)
    )
    return not pair.differs and before == after and has_same_tags(pair)


def _change(pair: MessagePair, text: str) -> Change:
    before, after = constants_of(pair.previous).get(VERSION), constants_of(pair.current).get(VERSION)
    location = after.location if after else pair.current.location
    return Change(pair.name, text, location, excerpt(before) if before else None, excerpt(after) if after else None)
