"""The filters of templates in addition to those of Jinja2: spellings of names, and comments."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from textwrap import wrap
from types import MappingProxyType

from msggen.model import snake_case

_WIDTH = 100


def paragraphs(lines: list[str]) -> list[str]:
    """Return running text with its lines joined to paragraphs; lists and tables keep their lines."""
    found: list[list[str]] = []
    joinable = False
    for line in lines:
        running = bool(line) and (line[0].isalnum() or line[0] in "[(\"'`")
        if running and joinable:
            found[-1].append(line)
        else:
            found.append([line])
        joinable = running
    return [" ".join(parts) for parts in found]


def unknown_name(owner: object, name: str) -> str:
    """Return the error for an unknown name of a view, or "" if `owner` is not a view."""
    kind = type(owner).__name__
    return f"a {kind.removesuffix('View').lower()} has no '{name}'" if kind.endswith("View") else ""


def pascal_case(name: str) -> str:
    """Return `name` in PascalCase: `GyroRad` for `gyro_rad`."""
    return re.sub(r"(?:^|_)([a-z0-9])", lambda match: match[1].upper(), name)


def camel_case(name: str) -> str:
    """Return `name` in camelCase: `gyroRad` for `gyro_rad`."""
    spelled = pascal_case(name)
    return spelled[:1].lower() + spelled[1:]


def comment(text: str, prefix: str = "//", indent: int = 0) -> str:
    """Return `text` as comment lines with `prefix`, wrapped and, except the first line, indented.

    No line ends with a backslash, because C would continue the comment on the next line. Raises TypeError if `indent`
    is not a number.
    """
    if not isinstance(indent, int):
        raise TypeError(f"comment: expected a number of spaces as indent, got {indent!r}")
    room = _WIDTH - indent - len(prefix) - 1
    lines = [part for line in paragraphs(text.splitlines()) for part in wrap(line, room) or [""]]
    return f"\n{' ' * indent}".join(f"{prefix} {line}".rstrip("\\ ") for line in lines)


FILTERS: Mapping[str, Callable[..., str]] = MappingProxyType(
    {function.__name__: function for function in (snake_case, camel_case, pascal_case, comment)}
)
