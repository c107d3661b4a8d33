"""The tags in comments of definitions, `[m/s] [@range 0, 100]`: one table, which everything else reads."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


def _without_spaces(text: str) -> str:
    return "".join(text.split())


def _value(text: str) -> str:
    """Return the number or constant that a tag begins with, because the rest only explains it; or else all of it."""
    first = text.partition(" ")[0].strip(",;:.")
    try:
        return repr(float(first))
    except ValueError:
        return first if first.isupper() else text.lower()


def _unit(text: str) -> str:
    from msggen.unit import normalized_unit

    return normalized_unit(text)


def _range(text: str) -> str:
    from msggen.unit import normalized_range

    return normalized_range(text)


class TagChange(NamedTuple):
    """A tag of a field whose meaning has changed: the title of the tag, and both texts."""

    title: str
    before: str
    after: str


class Tag(NamedTuple):
    """A tag, written as `[@name ...]`."""

    name: str
    documentation: str
    """The meaning of the content."""
    purpose: str = ""
    """The purpose of the rule `<NAME>_CHANGED`. A tag without one is known, but neither an attribute nor compared."""
    normalized: Callable[[str], str] = _without_spaces
    """Returns the same text for contents that mean the same."""
    message_name: str = ""
    """The name in messages, where it is not `name`."""
    rank: int = 9
    """The place of the rule among those of other tags."""

    @property
    def title(self) -> str:
        """The name in messages."""
        return self.message_name or self.name

    def change(self, before: str, after: str) -> TagChange | None:
        """Return the change between two contents; None where they mean the same, or one is missing.

        To write down a unit where there was none does not change the unit.
        """
        is_same = not before or not after or before == after or self.normalized(before) == self.normalized(after)
        return None if is_same else TagChange(self.title, before, after)


UNIT = Tag("unit", "Unit of the values.", "the values of a field count in another unit", _unit, rank=1)
"""The only tag without a name: `[m/s]`."""

TAGS: tuple[Tag, ...] = (
    UNIT,
    Tag("range", "Smallest and largest value.", "the values of a field lie in another range", _range, rank=2),
    Tag("enum", "Prefix of the constants that are the values.", "other constants name the values of a field", rank=5),
    Tag(
        "invalid",
        'Value that means "unknown".',
        "another value of a field means 'not known'",
        _value,
        message_name="invalid value",
        rank=4,
    ),
    Tag("frame", "Frame of reference.", "the values of a field are given in another frame", rank=3),
    Tag("uncontrolled", "Value of a setpoint that is not controlled."),
)
"""In the order in which comments and descriptions of fields list them."""

ATTRIBUTES = tuple(tag for tag in TAGS if tag.purpose)
"""The tags that are attributes of fields in `__msg__` and in the views of `render`."""

COMPARED = tuple(sorted(ATTRIBUTES, key=lambda tag: tag.rank))
"""The tags that rules compare, in the order of the rules."""

NAMES = tuple(tag.name for tag in TAGS if tag is not UNIT)
"""The names that are known behind an `@`."""
