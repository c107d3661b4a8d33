"""SEMANTIC: the same bytes and names, but the tags of a comment say that the values mean something else.

Only a tag that is on both sides can change: to write down a unit where there was none is no change of the unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from msggen.compare.comparison import Comparison, FieldPair, MessagePair
from msggen.compare.finding import Change, Excerpt
from msggen.model import Comment, Field

_TAGS: Mapping[str, Callable[[Comment], str]] = {
    "unit": lambda comment: "".join(comment.unit.split()),
    "frame": lambda comment: "".join(comment.frame.split()),
    "enum": lambda comment: "".join(comment.enum.split()),
    "invalid value": lambda comment: _value(comment.invalid),
}
"""What a tag says."""


def _value(tag: str) -> str:
    """Return the number or constant that a tag begins with, for what follows only explains it; or else all of it."""
    first = tag.partition(" ")[0].strip(",;:.")
    try:
        return repr(float(first))
    except ValueError:
        return first if first.isupper() else tag.lower()


def find_other_unit(comparison: Comparison) -> Iterator[Change]:
    """Fields with another unit."""
    return _find(comparison, "unit")


def find_other_frame(comparison: Comparison) -> Iterator[Change]:
    """Fields in another frame."""
    return _find(comparison, "frame")


def find_other_invalid(comparison: Comparison) -> Iterator[Change]:
    """Fields with another value for "not known"."""
    return _find(comparison, "invalid value")


def find_other_enum(comparison: Comparison) -> Iterator[Change]:
    """Fields whose values are named by other constants."""
    return _find(comparison, "enum")


def has_same_tags(pair: MessagePair) -> bool:
    """Whether no tag says something else than before."""
    return not any(_others(pair, tag) for tag in _TAGS.values())


def _find(comparison: Comparison, what: str) -> Iterator[Change]:
    for pair in comparison.pairs:
        for kept in _others(pair, _TAGS[what]):
            before, after = (_TAGS[what](field.comment) for field in (kept.previous, kept.current))
            text = f"the {what} of '{kept.current.name}' is {after}, in {comparison.previous.label} {before}"
            lines = _excerpt(kept.previous), _excerpt(kept.current)
            yield Change(pair.name, text, kept.current.location, *lines)


def _others(pair: MessagePair, tag: Callable[[Comment], str]) -> list[FieldPair]:
    """Return the fields on both sides of which a tag says something, and not the same."""
    said = ((kept, tag(kept.previous.comment), tag(kept.current.comment)) for kept in (*pair.kept, *pair.renamed))
    return [kept for kept, before, after in said if before and after and before != after]


def _excerpt(field: Field) -> Excerpt:
    comment = field.comment
    tags = str(Comment("", comment.unit, "", comment.enum, comment.invalid, comment.frame))
    return Excerpt(field.location, f"{field.type} {field.name}  # {tags}")
