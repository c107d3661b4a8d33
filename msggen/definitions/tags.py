"""The tags in comments of definitions, such as `[m/s] [@range 0, 100]`, in one table."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


def _without_spaces(text: str) -> str:
    return "".join(text.split())


def _value(text: str) -> str:
    """Return the number or constant at the start of a tag, without the explanation after it, or else the whole text."""
    first = text.partition(" ")[0].strip(",;:.")
    try:
        return repr(float(first))
    except ValueError:
        return first if first.isupper() else text.lower()


def _unit(text: str) -> str:
    from msggen.definitions.unit import normalized_unit

    return normalized_unit(text)


def _range(text: str) -> str:
    from msggen.definitions.unit import normalized_range

    return normalized_range(text)


class TagChange(NamedTuple):
    """A change in the meaning of a tag: the title of the tag, and both contents."""

    title: str
    before: str
    after: str


class Tag(NamedTuple):
    """A kind of tag, written as `[@name ...]`."""

    name: str
    documentation: str
    """The meaning of the content."""
    purpose: str = ""
    """The purpose of the rule `<NAME>_CHANGED`; "" for a known tag that is neither an attribute nor compared."""
    normalized: Callable[[str], str] = _without_spaces
    """A function that returns the same text for all contents with the same meaning."""
    message_name: str = ""
    """The name in messages to the user, if it is not `name`."""
    rank: int = 9
    """The position of the rule among the rules of all tags."""
    is_inherited: bool = False
    """Whether a field without the tag takes it from the same field of an embedded release."""

    @property
    def title(self) -> str:
        """The name in messages to the user."""
        return self.message_name or self.name

    def change(self, before: str, after: str) -> TagChange | None:
        """Return the change between two contents, or None if they mean the same or one is missing.

        Documenting a unit that was not documented before does not change the unit.
        """
        is_same = not before or not after or before == after or self.normalized(before) == self.normalized(after)
        return None if is_same else TagChange(self.title, before, after)


UNIT = Tag("unit", "Unit of the values.", "the unit of a field changed", _unit, rank=1, is_inherited=True)
"""The only tag without a name: `[m/s]`."""

ENUM = Tag(
    "enum",
    "Prefix of the constants that are the values.",
    "the enum of a field changed: other constants name its values",
    rank=5,
    is_inherited=True,
)

TAGS: tuple[Tag, ...] = (
    UNIT,
    Tag("range", "Smallest and largest value.", "the range of a field changed", _range, rank=2),
    ENUM,
    Tag(
        "invalid",
        'Value that means "unknown".',
        "the invalid value of a field, which means 'unknown', changed",
        _value,
        message_name="invalid value",
        rank=4,
        is_inherited=True,
    ),
    Tag("frame", "Frame of reference.", "the frame of reference of a field changed", rank=3, is_inherited=True),
    Tag("uncontrolled", "Value of a setpoint that is not controlled."),
)
"""All known tags, in the order in which comments and descriptions of fields list them."""

ATTRIBUTES = tuple(tag for tag in TAGS if tag.purpose)
"""The tags that are attributes of fields in `__msg__` and in the views of `render`."""

INHERITED = tuple(tag for tag in TAGS if tag.is_inherited)
"""The tags that a field takes from an embedded release. A range belongs to one version of a message."""

COMPARED = tuple(sorted(ATTRIBUTES, key=lambda tag: tag.rank))
"""The tags that rules compare, in the order of their rules."""

NAMES = tuple(tag.name for tag in TAGS if tag is not UNIT)
"""The known names after an `@`."""
