"""SEMANTIC rules: the bytes and names are the same, but a tag shows that the values mean something else.

A tag changes only if both sides have it: documenting a unit that was not documented before does not change the unit.
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.compare.comparison import Comparison, MessagePair
from msggen.compare.finding import Change, Excerpt
from msggen.model import Field
from msggen.tags import Tag


def find_changed(tag: Tag, comparison: Comparison) -> Iterator[Change]:
    """Yield the fields for which the meaning of `tag` differs."""
    for pair, kept in comparison.retagged:
        before, after = kept.previous, kept.current
        change = tag.change(before.comment.tag(tag.name), after.comment.tag(tag.name))
        if change:
            now, then = change.after + _source(after, tag), change.before + _source(before, tag)
            text = f"the {change.title} of '{after.name}' is {now}, but {then} in {comparison.previous.label}"
            yield Change(pair.name, text, after.location, before=_excerpt(before, tag), after=_excerpt(after, tag))


def has_same_tags(pair: MessagePair) -> bool:
    """Whether all tags mean the same on both sides."""
    return not any(kept.previous.comment.changed_tags(kept.current.comment) for kept in pair.recommented)


def _source(field: Field, tag: Tag) -> str:
    """Return the origin of a tag for a message to the user, "" for a tag in brackets."""
    origin = field.comment.origin(tag.name)
    return {"tag": "", "prose": " (as its comment says)"}.get(origin, f" ({origin})")


def _excerpt(field: Field, tag: Tag) -> Excerpt:
    """Return the definition of a field with its tags, and with the sentences if they give the content of `tag`."""
    comment = field.comment
    shown = comment if comment.origin(tag.name) == "prose" else comment._replace(text="")
    text = " ".join(f"{field.type} {field.name}  # {shown}".splitlines())
    return Excerpt(field.location, text.removesuffix("  # "))
