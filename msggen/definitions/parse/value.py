"""The parser of values of constants and defaults."""

from __future__ import annotations

import re

from msggen.definitions.model import ArrayKind, FieldType, Value
from msggen.definitions.primitives import PRIMITIVES, Primitive

_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_STRING_ITEM = re.compile(r"""\s*("(?:[^"\\]|\\.)*"\s*|'(?:[^'\\]|\\.)*'\s*|[^\s,\[\]"'][^,\[\]]*)(?:,|$)""")
"""A value with the spaces behind it. They match one part of the expression only, so that its time is linear."""


def parse_value(type_: FieldType, text: str, *, is_constant: bool) -> Value:
    """Return the value that `text` spells for `type_`.

    Raises ValueError with a message that names what was expected and what was found.
    """
    if not type_.is_primitive:
        raise ValueError(f"a message ('{type_}') takes no value")
    if type_.array is ArrayKind.SCALAR:
        return _bool(text) if is_constant and type_.name == "bool" else _scalar(type_, text)
    if is_constant:
        raise ValueError(f"a constant must be a single value, found type '{type_}'")
    return _array(type_, text)


def _array(type_: FieldType, text: str) -> tuple[Value, ...]:
    if not (text.startswith("[") and text.endswith("]")):
        raise ValueError(f"expected a list such as [1, 2], found {text}")
    inside = text[1:-1].strip()
    items = tuple(_scalar(type_, item) for item in _items(inside)) if inside else ()
    if type_.array is ArrayKind.FIXED and len(items) != type_.length:
        raise ValueError(f"expected {type_.length} values, found {len(items)}")
    if type_.array is ArrayKind.BOUNDED and len(items) > type_.length:
        raise ValueError(f"expected up to {type_.length} values, found {len(items)}")
    return items


def _items(inside: str) -> list[str]:
    if inside.endswith(","):
        raise ValueError("expected a value after the last comma")
    items, position = [], 0
    while position < len(inside):
        match = _STRING_ITEM.match(inside, position)
        if match is None:
            raise ValueError(
                f"cannot read the list from {inside[position:]!r}: expected values with commas between them"
            )
        items.append(match[1].rstrip())
        position = match.end()
    return items


def _scalar(type_: FieldType, text: str) -> Value:
    primitive = PRIMITIVES[type_.name]
    if primitive.is_string:
        return _string(type_, text)
    if not text:
        raise ValueError(f"expected a value of type '{type_.base}', found none")
    if primitive.is_integer:
        return _integer(primitive, text)
    if primitive.is_float:
        return _float(primitive, text)
    if text.lower() not in _BOOLEANS:
        raise ValueError(f"expected true, false, 1 or 0, found {text!r}")
    return _BOOLEANS[text.lower()]


def _bool(text: str) -> bool:
    """Return the value of a bool constant, for which the firmware's generator accepts any number too."""
    try:
        return bool(int(text, 0))
    except ValueError:
        return bool(_scalar(FieldType("bool"), text))


def _integer(type_: Primitive, text: str) -> int:
    try:
        value = int(text, 10 if text.lstrip("+-").isdecimal() else 0)
    except ValueError:
        raise ValueError(f"expected an integer, found {text!r}") from None
    if not type_.smallest <= value <= type_.largest:
        raise ValueError(f"{type_.name} holds {type_.smallest} to {type_.largest}, found {text}")
    return value


def _float(type_: Primitive, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"expected a number, found {text!r}") from None
    if abs(value) > type_.largest and "inf" not in text.lower():
        raise ValueError(f"{type_.name} holds up to {type_.largest}, found {text}")
    return value


def _string(type_: FieldType, text: str) -> str:
    quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "\"'"
    value = text[1:-1].replace(f"\\{text[0]}", text[0]) if quoted else text
    if type_.string_bound is not None and len(value) > type_.string_bound:
        raise ValueError(f"expected up to {type_.string_bound} characters, found {len(value)}")
    return value
