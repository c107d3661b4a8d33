"""Values of constants and defaults."""

from __future__ import annotations

import re

from msggen.model import FLOATS, INTEGER_RANGES, STRINGS, ArrayKind, FieldType, Value

_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_LARGEST = {"float32": 3.4028235677973362e38, "float64": 1.7976931348623157e308}
_STRING_ITEM = re.compile(r"""\s*("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^,\[\]"'][^,\[\]]*?)\s*(?:,|$)""")


def parse_value(type_: FieldType, text: str, *, is_constant: bool) -> Value:
    """Return the value that `text` spells for `type_`.

    Raises ValueError, saying what was expected and what was found.
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
        items.append(match[1])
        position = match.end()
    return items


def _scalar(type_: FieldType, text: str) -> Value:
    if not text and type_.name not in STRINGS:
        raise ValueError(f"expected a value of type '{type_.base}', found none")
    if type_.name in INTEGER_RANGES:
        return _integer(type_.name, text)
    if type_.name in FLOATS:
        return _float(type_.name, text)
    if type_.name in STRINGS:
        return _string(type_, text)
    if text.lower() not in _BOOLEANS:
        raise ValueError(f"expected true, false, 1 or 0, found {text!r}")
    return _BOOLEANS[text.lower()]


def _bool(text: str) -> bool:
    """Return a constant: the firmware's generator takes numbers too."""
    try:
        return bool(int(text, 0))
    except ValueError:
        return bool(_scalar(FieldType("bool"), text))


def _integer(name: str, text: str) -> int:
    low, high = INTEGER_RANGES[name]
    try:
        value = int(text, 10 if text.lstrip("+-").isdecimal() else 0)
    except ValueError:
        raise ValueError(f"expected an integer, found {text!r}") from None
    if not low <= value <= high:
        raise ValueError(f"{name} holds {low} to {high}, found {text}")
    return value


def _float(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"expected a number, found {text!r}") from None
    if abs(value) > _LARGEST[name] and "inf" not in text.lower():
        raise ValueError(f"{name} holds up to {_LARGEST[name]}, found {text}")
    return value


def _string(type_: FieldType, text: str) -> str:
    quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "\"'"
    value = text[1:-1].replace(f"\\{text[0]}", text[0]) if quoted else text
    if type_.string_bound is not None and len(value) > type_.string_bound:
        raise ValueError(f"expected up to {type_.string_bound} characters, found {len(value)}")
    return value
