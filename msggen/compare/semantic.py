"""SEMANTIC: the same bytes and names, but the tags of a comment say that the values mean something else.

Only a tag that is on both sides can change: to write down a unit where there was none is no change of the unit.
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.compare.comparison import Comparison, FieldPair, MessagePair
from msggen.compare.finding import Change, Excerpt
from msggen.model import Field
from msggen.tags import changed_tag, changed_tags


def find_other_unit(comparison: Comparison) -> Iterator[Change]:
    """Fields with another unit."""
    return _find(comparison, "unit")


def find_other_range(comparison: Comparison) -> Iterator[Change]:
    """Fields with another range."""
    return _find(comparison, "range")


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
    return not any(changed_tags(kept.previous, kept.current) for kept in _both(pair))


def _find(comparison: Comparison, what: str) -> Iterator[Change]:
    for pair in comparison.pairs:
        for kept in _both(pair):
            change = changed_tag(what, kept.previous, kept.current)
            if change:
                text = f"the {what} of '{kept.current.name}' is {change.after}, in {comparison.previous.label} "
                lines = _excerpt(kept.previous), _excerpt(kept.current)
                yield Change(pair.name, text + change.before, kept.current.location, *lines)


def _both(pair: MessagePair) -> Iterator[FieldPair]:
    """Yield the fields of both sides whose comments differ."""
    if pair.has_same_comments:
        return
    yield from (kept for kept in (*pair.kept, *pair.renamed) if kept.previous.comment != kept.current.comment)


def _excerpt(field: Field) -> Excerpt:
    return Excerpt(field.location, f"{field.type} {field.name}  # {field.comment._replace(text='')}")
