"""What the tags of a comment mean: two that are spelled otherwise may say the same.

Only a tag that is on both sides can change: to write down a unit where there was none is no change of the unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import NamedTuple

from msggen.model import Comment, Field


def _without_spaces(tag: str) -> str:
    return "".join(tag.split())


def _value(tag: str) -> str:
    """Return the number or constant that a tag begins with, for what follows only explains it; or else all of it."""
    first = tag.partition(" ")[0].strip(",;:.")
    try:
        return repr(float(first))
    except ValueError:
        return first if first.isupper() else tag.lower()


def _unit(tag: str) -> str:
    from msggen.unit import normalized_unit

    return normalized_unit(tag)


def _range(tag: str) -> str:
    from msggen.unit import normalized_range

    return normalized_range(tag)


_TAGS: Mapping[str, tuple[Callable[[Comment], str], Callable[[str], str]]] = {
    "unit": (attrgetter("unit"), _unit),
    "range": (attrgetter("range"), _range),
    "frame": (attrgetter("frame"), _without_spaces),
    "enum": (attrgetter("enum"), _without_spaces),
    "invalid value": (attrgetter("invalid"), _value),
}
"""What a tag says, and how it is spelled to be compared."""


class TagChange(NamedTuple):
    """A tag of a field that says something else than before: what it is about, and both texts."""

    what: str
    before: str
    after: str


def changed_tag(what: str, before: Field, after: Field) -> TagChange | None:
    """Return the change of the tag `what`; None where only one field has it, or both mean the same."""
    read, normalized = _TAGS[what]
    texts = read(before.comment), read(after.comment)
    is_same = not all(texts) or texts[0] == texts[1] or normalized(texts[0]) == normalized(texts[1])
    return None if is_same else TagChange(what, *texts)


def changed_tags(before: Field, after: Field) -> list[TagChange]:
    """Return the tags that both fields have, and that do not mean the same."""
    if before.comment == after.comment:
        return []
    return [change for what in _TAGS if (change := changed_tag(what, before, after))]
