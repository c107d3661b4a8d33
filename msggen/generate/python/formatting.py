"""Values and text as Python source.

Whatever a definition says reaches Python source through `literal` or `documentation`, so that no comment can end
the string it stands in.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence

from msggen.text.words import paragraphs

_DANGEROUS_QUOTES = re.compile(r'"{2,}|"$')

WIDTH = 110
"""Columns of generated source."""


def literal(value: object) -> str:
    """Return `value` as a Python literal, printable strings in double quotes."""
    if isinstance(value, str):
        if not value.isprintable():
            return ascii(value)
        # What can be printed, JSON quotes as Python does; most of it needs no escape.
        plain = '"' not in value and "\\" not in value
        return f'"{value}"' if plain else json.dumps(value, ensure_ascii=False)
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    if isinstance(value, tuple):
        return f"({''.join(literal(item) + ', ' for item in value).strip()})"
    return repr(value)


def documentation(text: str, indent: int, *, closed: bool = False) -> str:
    r"""Return `text` as the inside of a docstring, wrapped and indented; nothing in it can end the docstring.

    `closed` puts the closing quotes on a line of their own where there are several lines.
    """
    safe = text.replace("\\", "\\\\")
    if '"' in safe:
        safe = _DANGEROUS_QUOTES.sub(lambda quotes: '\\"' * len(quotes[0]), safe)
    if len(safe) <= WIDTH - indent - 6 and "\n" not in safe:
        return safe
    lines: list[str] = []
    for paragraph in paragraphs(safe.split("\n")):
        lines += _filled(paragraph.split(" "), " ", WIDTH - indent - 6)
    margin = "\n" + " " * indent
    text = "\n".join([lines[0], *(line and " " * indent + line for line in lines[1:])])
    return text + (margin if closed and len(lines) > 1 else "")


def arguments(values: Iterable[object]) -> str:
    """Return the values of a tuple as positional arguments."""
    return ", ".join(map(literal, values))


def wrapped(items: Iterable[str], indent: int, kind: str = "") -> str:
    """Return `items` with commas, in one line or, indented, in as many as they need; a "tuple" keeps its comma."""
    listed = list(items)
    line = ", ".join(listed) + ("," if kind == "tuple" and len(listed) == 1 else "")
    if len(line) + indent + 20 <= WIDTH:
        return line
    margin = "\n" + " " * indent
    return margin + margin.join(_filled(listed, ", ", WIDTH - indent - 1)) + ",\n" + " " * (indent - 4)


def wrapped_tuple(expression: str, indent: int) -> str:
    """Return a tuple of names, wrapped like `wrapped`; any other expression as it is."""
    if not expression.startswith("(") or len(expression) + indent + 20 <= WIDTH:
        return expression
    return f"({wrapped(expression[1:-1].split(', '), indent + 4)})"


def joined_by(items: Sequence[str], operator: str, indent: int) -> str:
    """Return `items` joined by an operator, on as many lines as they need."""
    margin = "\n" + " " * indent + operator.lstrip()
    lines = _filled(items, operator, WIDTH - indent - 2)
    return lines[0] if len(lines) == 1 else "\n" + " " * indent + margin.join(lines) + "\n" + " " * (indent - 4)


def _filled(items: Iterable[str], separator: str, width: int) -> list[str]:
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
