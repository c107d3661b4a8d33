"""SEMANTIC: the same bytes and names, but the tags of a comment say that the values mean something else.

Only a tag that is on both sides can change: to write down a unit where there was none is no change of the unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from msggen.compare.comparison import Comparison
from msggen.compare.finding import Change, Excerpt
from msggen.model import Comment, Field


def find_other_unit(comparison: Comparison) -> Iterator[Change]:
    """Fields with another unit."""
    return _find(comparison, "unit", lambda comment: _plain(comment.unit))


def find_other_frame(comparison: Comparison) -> Iterator[Change]:
    """Fields in another frame."""
    return _find(comparison, "frame", lambda comment: _plain(comment.frame))


def find_other_invalid(comparison: Comparison) -> Iterator[Change]:
    """Fields with another value for "not known"; what follows the value in its tag only explains it."""
    return _find(comparison, "invalid value", lambda comment: comment.invalid.partition(" ")[0].strip(",;:."))


def find_other_enum(comparison: Comparison) -> Iterator[Change]:
    """Fields whose values are named by other constants."""
    return _find(comparison, "enum", lambda comment: _plain(comment.enum))


def _find(comparison: Comparison, what: str, tag: Callable[[Comment], str]) -> Iterator[Change]:
    for pair in comparison.pairs:
        for kept in pair.kept:
            before, after = tag(kept.previous.comment), tag(kept.current.comment)
            if before and after and before != after:
                text = f"the {what} of '{kept.current.name}' is {after}, in {comparison.previous.label} {before}"
                lines = _excerpt(kept.previous), _excerpt(kept.current)
                yield Change(pair.name, text, kept.current.location, *lines)


def _plain(tag: str) -> str:
    return "".join(tag.split())


def _excerpt(field: Field) -> Excerpt:
    comment = field.comment
    tags = str(Comment("", comment.unit, "", comment.enum, comment.invalid, comment.frame))
    return Excerpt(field.location, f"{field.type} {field.name}  # {tags}")
