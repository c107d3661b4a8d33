"""JSON whose values know where they begin, read as strictly as RFC 8259 says."""

from __future__ import annotations

import math
import re
from json import JSONDecodeError, JSONDecoder
from typing import Any, Final, NoReturn, TypeAlias

_SPACE = re.compile(r"[ \t\n\r]*")
_DEEPEST = 64
"""How deep values may be nested."""
_INTEGERS: Final = range(-(1 << 63), 1 << 64)
"""The integers that readers in C++ keep as such. Others become floats, as there."""
_DIGITS = 20
"""The most digits of an integer."""

Content: TypeAlias = "bool | int | float | str | list[Value] | dict[str, Value] | None"


class BrokenError(ValueError):
    """A text that is no JSON: what is wrong, and at which position."""

    def __init__(self, text: str, position: int) -> None:
        self.position = position
        super().__init__(text)


class Value:
    """A value with the position where it begins and, in an object, that of its name."""

    __slots__ = ("content", "name", "start")

    def __init__(self, content: Content, start: int, name: int) -> None:
        self.content, self.start, self.name = content, start, name

    @property
    def plain(self) -> Any:
        """The same without positions."""
        if isinstance(self.content, dict):
            return {name: value.plain for name, value in self.content.items()}
        return [value.plain for value in self.content] if isinstance(self.content, list) else self.content


def read(text: str) -> Value:
    """Return the value of a text. Raises BrokenError at the first place that is no JSON."""
    value, end = _value(text, _skip(text, 0), 0)
    if end < len(text):
        _fail(text, end, "the end of the file")
    return value


def _value(text: str, start: int, depth: int, name: int | None = None) -> tuple[Value, int]:
    """Return the value at a position, and the position of what follows it."""
    if depth > _DEEPEST:
        raise BrokenError(f"expected at most {_DEEPEST} objects and arrays in each other", start)
    mark = text[start : start + 1]
    content: Content
    if mark == "{":
        content, end = _object(text, start + 1, depth + 1)
    elif mark == "[":
        content, end = _array(text, start + 1, depth + 1)
    else:
        content, end = _scalar(text, start)
    return Value(content, start, start if name is None else name), _skip(text, end)


def _object(text: str, at: int, depth: int) -> tuple[dict[str, Value], int]:
    found: dict[str, Value] = {}
    at = _skip(text, at)
    if text.startswith("}", at):
        return found, at + 1
    while True:
        if not text.startswith('"', at):
            _fail(text, at, "a name in quotes")
        name, end = _scalar(text, at)
        if name in found:
            raise BrokenError(f"{name!r} is given twice", at)
        found[str(name)], end = _value(text, _skip(text, _after(text, _skip(text, end), ":")), depth, at)
        if text.startswith("}", end):
            return found, end + 1
        at = _skip(text, _after(text, end, ",", "'}'"))


def _array(text: str, at: int, depth: int) -> tuple[list[Value], int]:
    found: list[Value] = []
    at = _skip(text, at)
    if text.startswith("]", at):
        return found, at + 1
    while True:
        value, end = _value(text, at, depth)
        found.append(value)
        if text.startswith("]", end):
            return found, end + 1
        at = _skip(text, _after(text, end, ",", "']'"))


def _after(text: str, at: int, mark: str, other: str = "") -> int:
    if not text.startswith(mark, at):
        _fail(text, at, f"{mark!r} or {other}" if other else repr(mark))
    return at + 1


def _scalar(text: str, at: int) -> tuple[Any, int]:
    try:
        found, end = _DECODER.raw_decode(text, at)
    except JSONDecodeError as error:
        if not text.startswith('"', at):
            _fail(text, at, "a value")
        raise BrokenError(
            f"broken text: {error.msg.removesuffix(' at').removesuffix(' starting').lower()}", error.pos
        ) from None
    except ValueError as error:
        raise BrokenError(str(error), at) from None
    if isinstance(found, str) and not found.isascii():
        try:
            found.encode()
        except UnicodeEncodeError:
            raise BrokenError("broken text: half of a surrogate pair", at) from None
    return found, end


def _integer(text: str) -> float:
    number = int(text) if len(text) <= _DIGITS else None
    return number if number is not None and number in _INTEGERS else _real(text)


def _real(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise ValueError(f"the number {text[:_DIGITS]} is too large")
    return number


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is not JSON: expected a number")


_DECODER = JSONDecoder(parse_int=_integer, parse_float=_real, parse_constant=_refuse)


def _skip(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    return at if found is None else found.end()


def _fail(text: str, at: int, expected: str) -> NoReturn:
    found = repr(text[at]) if at < len(text) else "the end of the file"
    raise BrokenError(f"expected {expected}, found {found}", at)
