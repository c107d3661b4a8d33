"""The formatting of values and text as Python source.

All text of a definition is formatted by `literal` or `documentation`, so that no comment can end the string that
contains it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence

from msggen.generate.text.words import paragraphs

_DANGEROUS_QUOTES = re.compile(r'"{2,}|"$')

WIDTH = 110
"""The maximum line length of generated source."""


def literal(value: object) -> str:
    """Return `value` as a Python literal, with printable strings in double quotes."""
    if isinstance(value, str):
        if not value.isprintable():
            return ascii(value)
        # JSON quotes printable text as Python does. Skip the slow call for text without escapes, which is most text.
        plain = '"' not in value and "\\" not in value
        return f'"{value}"' if plain else json.dumps(value, ensure_ascii=False)
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    if isinstance(value, tuple):
        return f"({''.join(literal(item) + ', ' for item in value).strip()})"
    return repr(value)


def long_literal(text: str, indent: int) -> str:
    """Return text as a literal, or as several literals in brackets, one on each line, if it is longer than a line."""
    whole = literal(text)
    if len(whole) + indent <= WIDTH:
        return whole
    margin = "\n" + " " * indent
    *lines, last = _fill(text.split(" "), " ", WIDTH - indent - 8)
    parts = [*(literal(f"{line} ") for line in lines), literal(last)]
    return f"({''.join(f'{margin}    {part}' for part in parts)}{margin})"


def documentation(text: str, indent: int, *, closed: bool = False) -> str:
    r"""Return `text` as the content of a docstring, wrapped and indented; quotes are escaped.

    With `closed`, a text of several lines ends with a line break, which puts the closing quotes on a line of their own.
    """
    safe = text.replace("\\", "\\\\")
    if '"' in safe:
        safe = _DANGEROUS_QUOTES.sub(lambda quotes: '\\"' * len(quotes[0]), safe)
    if len(safe) <= WIDTH - indent - 6 and "\n" not in safe:
        return safe
    lines: list[str] = []
    for paragraph in paragraphs(safe.split("\n")):
        lines += _fill(paragraph.split(" "), " ", WIDTH - indent - 6)
    margin = "\n" + " " * indent
    text = "\n".join([lines[0], *(line and " " * indent + line for line in lines[1:])])
    return text + (margin if closed and len(lines) > 1 else "")


def arguments(values: Iterable[object]) -> str:
    """Return the values of a tuple as positional arguments."""
    return ", ".join(map(literal, values))


def wrapped(items: Iterable[str], indent: int, kind: str = "") -> str:
    """Return `items` separated by commas, on one line if they fit, else on indented lines.

    The `kind` "tuple" adds the comma that a tuple of one item needs.
    """
    listed = list(items)
    line = ", ".join(listed) + ("," if kind == "tuple" and len(listed) == 1 else "")
    if len(line) + indent + 20 <= WIDTH:
        return line
    margin = "\n" + " " * indent
    return margin + margin.join(_fill(listed, ", ", WIDTH - indent - 1)) + ",\n" + " " * (indent - 4)


def wrapped_tuple(expression: str, indent: int) -> str:
    """Return a tuple of names wrapped as by `wrapped`, and any other expression unchanged."""
    if not expression.startswith("(") or len(expression) + indent + 20 <= WIDTH:
        return expression
    return f"({wrapped(expression[1:-1].split(', '), indent + 4)})"


def joined_by(items: Sequence[str], operator: str, indent: int) -> str:
    """Return `items` joined by an operator, on one line if they fit, else on several lines."""
    margin = "\n" + " " * indent + operator.lstrip()
    lines = _fill(items, operator, WIDTH - indent - 2)
    return lines[0] if len(lines) == 1 else "\n" + " " * indent + margin.join(lines) + "\n" + " " * (indent - 4)


def _fill(items: Iterable[str], separator: str, width: int) -> list[str]:
    lines: list[list[str]] = []
    room = -1
    for item in items:
        room -= len(separator) + len(item)
        if room >= 0:
            lines[-1].append(item)
        else:
            lines.append([item])
            room = width - len(item)
    end = "," if separator == ", " else ""
    return [separator.join(line) + end for line in lines[:-1]] + [separator.join(line) for line in lines[-1:]]
