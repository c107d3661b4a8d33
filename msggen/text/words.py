"""The few filters that templates get besides Jinja2's own: names in other spellings, and comments."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from textwrap import wrap
from types import MappingProxyType

from msggen.model import snake_case

_WIDTH = 100


def paragraphs(lines: list[str]) -> list[str]:
    """Join the lines of running text; lists and tables keep their lines."""
    paragraphs: list[str] = []
    joinable = False
    for line in lines:
        running = bool(line) and (line[0].isalnum() or line[0] in "[(\"'`")
        if running and joinable:
            paragraphs[-1] += " " + line
        else:
            paragraphs.append(line)
        joinable = running
    return paragraphs


def unknown_name(owner: object, name: str) -> str:
    """Return in plain words that a thing of the catalog has no such name, or "" where `owner` is another object."""
    kind = type(owner).__name__
    return f"a {kind.removesuffix('View').lower()} has no '{name}'" if kind.endswith("View") else ""


def pascal_case(name: str) -> str:
    """Return `name` as types are spelled: `gyro_rad` as `GyroRad`."""
    return re.sub(r"(?:^|_)([a-z0-9])", lambda match: match[1].upper(), name)


def camel_case(name: str) -> str:
    """Return `name` as JavaScript spells variables: `gyro_rad` as `gyroRad`."""
    spelled = pascal_case(name)
    return spelled[:1].lower() + spelled[1:]


def comment(text: str, prefix: str = "//", indent: int = 0) -> str:
    """Return `text` as lines of comments, each with `prefix`, all but the first indented; running text is filled.

    No line ends in a backslash: C would take the next one for comment too. Raises TypeError for an indent that is no
    number.
    """
    if not isinstance(indent, int):
        raise TypeError(f"comment: expected a number of spaces as indent, got {indent!r}")
    room = _WIDTH - indent - len(prefix) - 1
    lines = [part for line in paragraphs(text.splitlines()) for part in wrap(line, room) or [""]]
    return f"\n{' ' * indent}".join(f"{prefix} {line}".rstrip("\\ ") for line in lines)


FILTERS: Mapping[str, Callable[..., str]] = MappingProxyType(
    {function.__name__: function for function in (snake_case, camel_case, pascal_case, comment)}
)
