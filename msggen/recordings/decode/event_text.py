"""The templates of PX4's events: text with arguments, tags and escapes.

`{2:.1m}` is the second argument with one digit and a unit. `<param>` and `<a>` have their content, `<profile>` has it
for readers of one kind, and any other tag is left out (https://docs.px4.io/main/en/concept/events_interface.html).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

LONGEST = 2000
"""The length of a template, and of a text that is made of one, in characters: PX4's have up to 600."""
_PROFILE = "dev"
"""The readers for whom texts are: `dev` or `normal`. Those of logs are developers."""
_SPECIAL = re.compile(
    r"\\(?P<escaped>.?)"
    r'|<(?P<tag>[a-z]+)(?: [a-z]+="(?P<attribute>[^"]*)")?>'
    r"|\{(?P<number>[0-9]{1,4})(?::(?:\.(?P<digits>[0-9]{1,2}))?)?(?P<unit>m_v|m/s|m\^2|m|C)?\}",
    re.DOTALL,
)
_UNITS = {"m_v": "m"}
"""What is shown for units that are not shown as they are: a vertical distance is in m, too."""


class Placeholder(NamedTuple):
    """The place of an argument in a template."""

    position: int
    digits: int | None
    """The digits behind the point, None for as many as the value has."""
    unit: str
    source: str
    """The placeholder as it is in the template: shown for an argument that the event does not have."""


def parse_template(template: str) -> tuple[str | Placeholder, ...]:
    """Return the pieces of a template, which is cut at LONGEST."""
    return tuple(_pieces(template[:LONGEST]))


def fill(pieces: Sequence[str | Placeholder], values: Sequence[str | float]) -> str:
    """Return the text of a template with arguments, up to LONGEST."""
    made: list[str] = []
    length = 0
    for piece in pieces:
        text = piece if isinstance(piece, str) else _argument(piece, values)
        made.append(text)
        length += len(text)
        if length > LONGEST:
            break
    return "".join(made)[:LONGEST].strip()


def _pieces(template: str) -> Iterator[str | Placeholder]:
    place = 0
    while found := _SPECIAL.search(template, place):
        yield template[place : found.start()]
        place = found.end()
        if found["tag"]:
            end = template.find(f"</{found['tag']}>", place)
            if end < 0:
                yield "<"
                place = found.start() + 1
                continue
            yield from _content(found["tag"], found["attribute"] or "", template[place:end])
            place = end + len(found["tag"]) + 3
        elif found["number"]:
            digits = None if found["digits"] is None else int(found["digits"])
            unit = found["unit"] or ""
            yield Placeholder(int(found["number"]) - 1, digits, _UNITS.get(unit, unit), found[0])
        else:
            yield found["escaped"]
    yield template[place:]


def _content(tag: str, attribute: str, content: str) -> Iterator[str | Placeholder]:
    """Yield what is shown of the content of a tag."""
    if tag in ("a", "param"):
        yield content
    elif tag == "profile":
        is_shown = attribute[1:] != _PROFILE if attribute.startswith("!") else attribute == _PROFILE
        if is_shown:
            yield from _pieces(content)


def _argument(place: Placeholder, values: Sequence[str | float]) -> str:
    if not 0 <= place.position < len(values):
        return place.source
    value = values[place.position]
    is_rounded = place.digits is not None and not isinstance(value, str)
    text = f"{value:.{place.digits}f}" if is_rounded else str(value)
    return f"{text} {place.unit}" if place.unit else text
