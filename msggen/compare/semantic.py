"""SEMANTIC rules: the bytes and names are the same, but a tag shows that the values mean something else.

A tag changes only if both sides have it: documenting a unit that was not documented before does not change the unit.
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.compare.comparison import Comparison, FieldPair, MessagePair
from msggen.compare.finding import Change, Excerpt
from msggen.model import Field
from msggen.tags import Tag


def find_changed(tag: Tag, comparison: Comparison) -> Iterator[Change]:
    """Yield the fields for which the meaning of `tag` differs."""
    for pair in comparison.pairs:
        for kept in _both(pair):
            before, after = kept.previous, kept.current
            change = tag.change(before.comment.tag(tag.name), after.comment.tag(tag.name))
            if change:
                text = f"the {change.title} of '{after.name}' is {change.after}, but {change.before}"
                text += f" in {comparison.previous.label}"
                yield Change(pair.name, text, after.location, before=_excerpt(before), after=_excerpt(after))


def has_same_tags(pair: MessagePair) -> bool:
    """Whether all tags mean the same on both sides."""
    return not any(kept.previous.comment.changed_tags(kept.current.comment) for kept in _both(pair))


def _both(pair: MessagePair) -> Iterator[FieldPair]:
    """Yield the fields that both sides have and whose comments differ."""
    if pair.has_same_comments:
        return
    yield from (kept for kept in (*pair.kept, *pair.renamed) if kept.previous.comment != kept.current.comment)


def _excerpt(field: Field) -> Excerpt:
    return Excerpt(field.location, f"{field.type} {field.name}  # {field.comment._replace(text='')}")
