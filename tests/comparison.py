"""An obvious, slow comparison of two folders of definitions, to hold the fast one against.

It shares nothing with msggen: it reads `.msg` files with a regular expression, unfolds a message into one row for each
value as `(path, offset, type)`, and calls two messages the same when their rows and their types are.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

SIZES = {
    **dict.fromkeys(("bool", "byte", "char", "int8", "uint8"), 1),
    **dict.fromkeys(("int16", "uint16"), 2),
    **dict.fromkeys(("int32", "uint32", "float32"), 4),
    **dict.fromkeys(("int64", "uint64", "float64"), 8),
}
FIELD = re.compile(r"^\s*(\w+)(?:\[(\d+)\])?\s+([a-z]\w*)\s*(?:#.*)?$", re.MULTILINE)
CONSTANT = re.compile(r"^\s*(\w+)\s+([A-Z][A-Z0-9_]*)\s*=\s*([^#\n]*?)\s*(?:#.*)?$", re.MULTILINE)


class Definition(NamedTuple):
    """A message as its text says: fields as (type, length or None, name), constants as type and value by name."""

    fields: tuple[tuple[str, int | None, str], ...]
    constants: dict[str, tuple[str, str]]


class Row(NamedTuple):
    """One value: how to reach it, where it lies, and its type; char and byte are uint8 by other names (FACTS 3)."""

    path: str
    offset: int
    type: str


def read(folder: Path) -> dict[str, Definition]:
    """Return the messages of a release by name."""
    paths = [*(folder / "msg").glob("*.msg"), *(folder / "msg" / "versioned").glob("*.msg")]
    return {path.stem: definition(path.read_text()) for path in paths}


def definition(text: str) -> Definition:
    """Return what a text defines."""
    fields = tuple((type_, int(length) if length else None, name) for type_, length, name in FIELD.findall(text))
    return Definition(fields, {name: (type_, value) for type_, name, value in CONSTANT.findall(text)})


def rows(messages: dict[str, Definition], name: str) -> list[Row]:
    """Return every value of a message, the elements of arrays one by one, in XCDR1 (FACTS 3)."""
    found: list[Row] = []
    _unfold(messages, name, "", 0, found)
    return found


def differ(before: dict[str, Definition], after: dict[str, Definition], name: str) -> bool:
    """Whether bytes or names of a message are not the same on both sides."""
    same_rows = rows(before, name) == rows(after, name)
    return not (same_rows and spelling(before, name) == spelling(after, name))


def size(messages: dict[str, Definition], name: str) -> int:
    """Return the bytes of a sample without its header."""
    last = rows(messages, name)[-1]
    return last.offset + SIZES[last.type]


def spelling(messages: dict[str, Definition], name: str) -> list[str]:
    """Return the lines that the firmware hashes (FACTS 2)."""
    lines = []
    for type_, length, field in messages[name].fields:
        lines.append(f"{type_}[{length}] {field}" if length else f"{type_} {field}")
        lines += spelling(messages, type_) if type_ not in SIZES else []
    return lines


def _unfold(messages: dict[str, Definition], name: str, prefix: str, offset: int, found: list[Row]) -> int:
    for type_, length, field in messages[name].fields:
        for index in range(length or 1):
            path = f"{prefix}{field}[{index}]" if length else f"{prefix}{field}"
            if type_ in SIZES:
                offset = -(-offset // SIZES[type_]) * SIZES[type_]
                found.append(Row(path, offset, "uint8" if type_ in ("byte", "char") else type_))
                offset += SIZES[type_]
            else:
                offset = _unfold(messages, type_, f"{path}.", offset, found)
    return offset
