"""The parser of comments: text, and the tags that PX4 writes in brackets (docs/build.md).

`# [m/s] [@range 0, 100] [@enum STATE] [@invalid NaN] [@frame NED] What the field means.`
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from msggen.definitions.model import Comment
from msggen.definitions.tags import NAMES, UNIT

_TAG = re.compile(r" ?\[@(\w+)\b\s*([^\]]*)\]")
_UNIT = re.compile(r"\s*\[(?![-+\d., ]*\d[-+\d., ]*\])([^@\]\[]{1,24})\]")
_BOUND = r"[-+]?(?:\d[\d.]*|(?:\d[\d.]* ?\*? ?)?(?:pi|Pi|PI|π)(?:/\d+)?|inf|INF|Inf|infinity)"
_RANGE = re.compile(rf"\s*\[ *({_BOUND} *(?:, *|\.\.+ *|to +|- *){_BOUND}) *\]")
"""Two bounds in brackets in the place of a unit: `[-pi, pi]`."""

_LONGEST = 200
"""Maximum number of characters of a unit or a range in brackets."""

_PLACES = {name: place for place, name in enumerate(NAMES)}
_NOTHING = Comment()


def parse_comment(lines: Sequence[str]) -> Comment:
    """Return the comment in `lines`, which belong to one field or constant and have no `#`.

    A unit is recognised at the start of a line, where PX4 writes it, and so is a range without a tag, `[-pi, pi]`.
    `@` tags are recognised anywhere, even if their names are unknown. Everything else is text.
    """
    if not lines:
        return _NOTHING
    whole = "\n".join(lines)
    if "[" not in whole:
        return Comment(whole.strip())
    tags = {UNIT.name: ""}
    text = [_take_tags(line, tags) for line in lines]
    unit = tags.pop(UNIT.name)
    found = sorted(tags.items(), key=_place) if len(tags) > 1 else tags.items()
    return Comment("\n".join(text).strip(), unit, tuple(found))


def parse_constant_comment(lines: Sequence[str]) -> Comment:
    """Return the comment of a constant. Tags after a `|` stay in the text: they belong to parameters of a command.

    `# Take off. |Unused|Unused|Unused|[deg] Heading|...` documents the parameters of VEHICLE_CMD_NAV_TAKEOFF.
    """
    own, bar, parameters = "\n".join(lines).partition("|")
    if not bar:
        return parse_comment(lines)
    comment = parse_comment(own.split("\n"))
    space = " " if own[-1:].isspace() else ""
    return comment._replace(text=f"{comment.text}{space}|{parameters}".strip())


def _place(tag: tuple[str, str]) -> int:
    """Return the position of a tag for sorting. Tags with unknown names come last."""
    return _PLACES.get(tag[0], len(_PLACES))


def _take_tags(line: str, tags: dict[str, str]) -> str:
    unit = _UNIT.match(line, 0, _LONGEST)
    if unit and not tags[UNIT.name] and not _RANGE.match(line, 0, _LONGEST):
        tags[UNIT.name] = unit[1].strip()
        line = line[unit.end() :]
    closed = line.rfind("]") + 1 if "[@" in line else 0  # what follows is not searched for the end of a tag
    text = (_TAG.sub(lambda tag: _take_tag(tag, tags), line[:closed]) + line[closed:]).strip()
    found = _RANGE.match(text, 0, _LONGEST) if text[:1] == "[" and "range" not in tags else None
    if found:
        tags["range"] = found[1]
        text = text[found.end() :].strip()
    return text


def _take_tag(tag: re.Match[str], tags: dict[str, str]) -> str:
    """Add a tag to `tags` and return "", which replaces it. A second tag with the same name stays in the text."""
    if tag[1] in tags:
        return tag[0]
    tags[tag[1]] = tag[2].strip()
    return ""
