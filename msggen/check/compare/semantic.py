"""SEMANTIC rules: the bytes and names are the same, but a tag shows that the values mean something else.

A tag changes only if both sides have it: documenting a unit that was not documented before does not change the unit.
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.base.diagnostics import suggestion
from msggen.check.compare.comparison import Comparison
from msggen.check.finding import Change, Excerpt
from msggen.definitions.model import Field
from msggen.definitions.tags import UNIT, Tag, TagChange
from msggen.definitions.unit import is_unit, nearest_unit


def find_changed(tag: Tag, comparison: Comparison) -> Iterator[Change]:
    """Yield the fields for which the meaning of `tag` differs."""
    for pair, kept in comparison.retagged:
        before, after = kept.previous, kept.current
        change = tag.change(before.comment.tag(tag.name), after.comment.tag(tag.name))
        if change:
            now, then = change.after + _source(after, tag), change.before + _source(before, tag)
            text = f"the {change.title} of '{after.name}' is {now}, but {then} in {comparison.previous.label}"
            text += _hint(change) if tag is UNIT else ""
            lines = _excerpt(before, tag), _excerpt(after, tag)
            yield Change(pair.name, text, after.location, *lines, names=(before.name, after.name))


def retagged_messages(comparison: Comparison) -> frozenset[str]:
    """Return the messages with a field for which the meaning of any tag differs."""
    changed = ((pair, kept.previous.comment, kept.current.comment) for pair, kept in comparison.retagged)
    return frozenset(pair.name for pair, before, after in changed if before.changed_tags(after))


def _hint(change: TagChange) -> str:
    """Return a hint if the new unit is unknown: the previous unit or another one, if it is spelled nearly the same."""
    if is_unit(change.after):
        return ""
    near = nearest_unit(change.after)
    return suggestion(change.after, [change.before]) or (f", did you mean '{near}'?" if near else "")


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
