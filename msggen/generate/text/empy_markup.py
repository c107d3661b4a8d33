"""The markup of EmPy 3.3: where each piece of a template ends.

PX4's templates are written for EmPy 3.3. EmPy 4 ends some pieces elsewhere, so that the installed EmPy is not asked.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import lru_cache

_QUOTED = r"""('''|\"""|'|")(?:\\.|(?!\1).)*(?:\1|\Z)"""
"""A string of Python. Marks and brackets in it do not count."""

_STRING = re.compile(_QUOTED, re.DOTALL)
_WORD = re.compile(r"[a-zA-Z0-9_.]*")
_ESCAPES = {
    **{each: each for each in "()[]{}'\"\\ "},
    **dict(zip("0abefhnrstvz", "\0\a\b\x1b\f\x7f\n\r \t\v\4", strict=True)),
}
_NUMBERS = {"d": (3, 10), "o": (3, 8), "q": (4, 4), "x": (2, 16), "u": (4, 16), "U": (8, 16)}
"""The digits of a numeric escape, and their base."""

_CLOSING = {"(": ")", "[": "]", "{": "}", "<": ">"}


class MarkupError(Exception):
    """An error in the markup of a template, on `line`."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def first_outside_strings(marks: str, code: str) -> int:
    """Return the index of the first of `marks` in `code` that is not in a string of Python, or -1."""
    return next(_outside_strings(marks, code), -1)


def _outside_strings(marks: str, code: str, start: int = 0) -> Iterator[int]:
    return (found.start() for found in _pattern(marks).finditer(code, start) if found[0] in marks)


@lru_cache
def _pattern(marks: str) -> re.Pattern[str]:
    return re.compile(f"{_QUOTED}|[{re.escape(marks)}]", re.DOTALL)


class Markup:
    """The text of a template, read from its start to its end.

    `place` is the index of the next character, and `start` that of the last `@` that was read as markup.
    """

    def __init__(self, text: str) -> None:
        self.text = f"@#{text[2:]}" if text.startswith("#!") else text
        self.place = self.start = 0
        self._lines = [0, *(found.end() for found in re.finditer("\n", text))]

    @property
    def line(self) -> int:
        """The line of the last `@`."""
        return bisect_right(self._lines, self.start)

    def error(self, message: str) -> MarkupError:
        """Return an error of the markup that starts at the last `@`."""
        return MarkupError(message, self.line)

    def plain(self) -> str:
        """Read to the next `@`, or to the end."""
        end = self.text.find("@", self.place)
        return self._read(end if end >= 0 else len(self.text))

    def mark(self) -> str:
        """Read `@` and the next character, and return this character: "" at the end."""
        self.start = self.place
        return self._read(self.place + 2)[1:]

    def rest_of_line(self) -> str:
        """Read the rest of the line, and return it without its end."""
        end = self.text.find("\n", self.place)
        return self._read(end if end >= 0 else len(self.text), skip=1)

    def enclosed(self, opening: str) -> str:
        """Read to the bracket that closes `opening`, which was read, and return the code between them."""
        return self._read(self._closing(opening, self.place), skip=1)

    def name(self) -> str:
        """Read an expression that has no brackets around it, and whose first character was read: `name(1).other[0]`."""
        end = start = self.place - 1
        while end == start or self.text[end : end + 1] == ".":
            end = _WORD.match(self.text, end).end()  # type: ignore[union-attr] # it matches no character, too
            while (opening := self.text[end : end + 1]) and opening in "([{":
                if opening == "{":
                    raise self.error("curly braces can't open simple expressions")
                end = self._closing(opening, end + 1) + 1
        return self.text[start] + self._read(start + len(self.text[start:end].rstrip(".")))

    def string(self) -> str:
        """Read a string of Python, whose first quote was read."""
        start = self.place - 1
        found = _STRING.match(self.text, start)
        if not found or len(found[0]) < 2 * len(found[1]) or not found[0].endswith(found[1]):
            raise self.error("unterminated markup: expected the end of a string")
        return self.text[start] + self._read(found.end())

    def until(self, mark: str) -> str:
        """Read to the next `mark` that is not in a string of Python, and return the code before it."""
        end = next(_outside_strings(mark, self.text, self.place), -1)
        if end < 0:
            raise self.error(f"unterminated markup: expected '{mark}'")
        return self._read(end, skip=1)

    def escape(self) -> str:
        """Read an escaped character, whose backslash was read, and return the character."""
        code = self._read(self.place + 1)
        if code == "^":
            code = self._read(self.place + 1).upper()
            if code and code in "?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_`":
                return "\x7f" if code == "?" else chr(ord(code) - ord("@"))
        elif code in _NUMBERS:
            digits, base = _NUMBERS[code]
            number = self._read(self.place + digits)
            try:
                return chr(int(number if len(number) == digits else "", base))
            except (ValueError, OverflowError):
                raise self.error("invalid numeric escape code") from None
        elif code in _ESCAPES:
            return _ESCAPES[code]
        raise self.error("unrecognized escape code")

    def _read(self, end: int, skip: int = 0) -> str:
        """Return the text to `end`, and read `skip` characters more."""
        text, self.place = self.text[self.place : end], min(end + skip, len(self.text))
        return text

    def _closing(self, opening: str, start: int) -> int:
        """Return the index of the bracket that closes `opening`, of which the code starts at `start`."""
        closing, depth = _CLOSING[opening], 0
        for place in _outside_strings(opening + closing, self.text, start):
            depth += 1 if self.text[place] == opening else -1
            if depth < 0:
                return place
        raise self.error(f"unterminated markup: expected '{closing}'")
