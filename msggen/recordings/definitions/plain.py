"""The fields of definitions that have only plain lines, read without the parser: to compare a lot of definitions."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING

from msggen.definitions.primitives import OCTETS, PRIMITIVES

if TYPE_CHECKING:
    from collections.abc import Callable

_FIELD = re.compile(r"(\w+(?:/\w+)?)(\[[1-9]\d*\])?[ \t]+([a-z]\w*)", re.ASCII)
_CONSTANT = re.compile(r"\w+[ \t]+[A-Z]\w*[ \t]*=[ \t]*[-+.\w]+", re.ASCII)

_MOST = 64
"""How many messages a definition has at most: PX4's have three, and a hostile one may nest without end."""

_Line = tuple[str, str, str]
"""The name of a field, the length of an array in brackets, and the type."""


def plain_content(text_of: Callable[[str], str], key: str) -> frozenset[object] | None:
    """Return the fields of a message such as `px4_msgs/EscStatus`, in no order, or None if only the parser can tell.

    `text_of` returns the definition of a message and of those that it nests, "" for an unknown one. Two contents are
    equal if and only if `content_of` of the two messages are.
    """
    return _content(text_of, key, {})


def _content(
    text_of: Callable[[str], str], key: str, known: dict[str, frozenset[object] | None]
) -> frozenset[object] | None:
    if key in known or len(known) == _MOST:
        return known.get(key)
    known[key] = None  # until it is read: a message that nests itself needs the parser, which reports it
    lines = _lines(text_of(key))
    if lines is None:
        return None
    fields: set[object] = set()
    for name, array, base in lines:
        own: object = base
        if base not in PRIMITIVES:
            own = _content(text_of, base if "/" in base else f"{key.partition('/')[0]}/{base}", known)
        if own is None:
            return None
        fields.add((name, array, own))
    known[key] = frozenset(fields)
    return known[key]


@lru_cache(2048)
def _lines(text: str) -> tuple[_Line, ...] | None:
    """Return the fields of a definition, or None if it has another line than those of fields, numbers and comments."""
    fields = []
    for line in text.split("\n"):
        code = line.partition("#")[0].strip()
        if not code or _CONSTANT.fullmatch(code):
            continue
        found = _FIELD.fullmatch(code)
        if found is None:
            return None
        base, array, name = found.groups("")
        fields.append((name, array, "uint8" if base in OCTETS else base))
    is_clear = fields and len({name for name, _, _ in fields}) == len(fields)
    return tuple(fields) if is_clear else None
