"""The parameters of vehicle commands, which PX4 documents in the comments of their constants.

`# Take off. |Unused|Unused|Unused|[deg] Heading|[deg] Latitude|[deg] Longitude|[m] Altitude|` has seven parts: what
`param1` to `param7` of VehicleCommand mean for the command.
"""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import NamedTuple

from msggen.definitions.model import Comment, Constant, Message
from msggen.definitions.parse.comment import parse_comment

COUNT = 7
"""The number of parameters of a command."""

PREFIX = "VEHICLE_CMD_"
"""The prefix of the constants that are commands."""

_FIELDS = frozenset({"command", *(f"param{number}" for number in range(1, COUNT + 1))})

_LONGEST_NAME = 3
_UNUSED = re.compile(r"(?:unused|reserved|empty|none|n/?a)\b", re.IGNORECASE)
_END = re.compile(r"[^\w\s'-]")
_FIRST = frozenset({"a", "an", "the", "its", "desired", "new", "this", "which", "maximum", "minimum"})
"""Words that are left out at the start of a name. The last two are kept if nothing follows them."""
_ENDING = (
    "above after along allowed amsl and are as at be before below between by can for from if in into is near of "
    "on only or over per that to until used using via what when where while will with within"
)
_LAST = frozenset(_ENDING.split())
"""Words that end a name."""


class Parameter(NamedTuple):
    """A parameter of a command."""

    number: int
    """1 for `param1`."""
    name: str
    """A name made of the first words of its comment: `altitude`; `param1` if there are none."""
    comment: Comment


def commands(message: Message) -> tuple[Constant, ...]:
    """Return the constants that are commands; none if `message` has no field for each parameter."""
    if not _FIELDS.issubset(field.name for field in message.fields):
        return ()
    return tuple(each for each in message.constants if each.name.startswith(PREFIX) and type(each.value) is int)


def parameters(constant: Constant) -> tuple[Parameter, ...]:
    """Return the parameters that the comment of a command describes, without those that are unused."""
    parts = constant.comment.text.split("|")[1:][:COUNT]
    found: list[Parameter] = []
    for number, part in enumerate(parts, 1):
        comment = parse_comment([part.strip()])
        if str(comment) and not _UNUSED.match(comment.text):
            taken = {parameter.name for parameter in found}
            name = _name(comment) or f"param{number}"
            found.append(Parameter(number, f"{name}_{number}" if name in taken else name, comment))
    return tuple(found)


def description(constant: Constant) -> str:
    """Return the comment of a command without its parameters."""
    return constant.comment.text.partition("|")[0].strip()


def _name(comment: Comment) -> str:
    """Return the first words of a comment as a name, or else the name of its enum; "" for neither."""
    words = _END.split(comment.text, maxsplit=1)[0].lower().replace("-", " ").replace("'", "").split()
    while words and words[0] in _FIRST:
        words.pop(0)
    end = next((index for index, word in enumerate(words) if word in _LAST), len(words))
    names = ("_".join(words[: min(end, _LONGEST_NAME)]), comment.tag("enum").lower())
    return next((name for name in names if name.isidentifier() and name.isascii() and not iskeyword(name)), "")
