"""Tables of facts: text for people, and objects of JSON for programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, Literal, TypeVar

from msggen.base.diagnostics import printable
from msggen.base.foreign import Styled
from msggen.cli.printing import colour

RowT = TypeVar("RowT")

BOLD, DIM, RED, YELLOW = 1, 2, 31, 33
"""Styles of texts on a terminal, as numbers of SGR. 0 is none."""
LEVEL_STYLES: Mapping[str, int] = MappingProxyType({"error": RED, "warning": YELLOW})
"""The styles of the levels of findings that have one."""


def styled(text: str, style: int) -> str:
    """Return a text in a style for stdout, if that has colours. The spaces around it have none."""
    plain = text.strip()
    if not (style and plain and colour(sys.stdout)):
        return text
    front, _, end = text.partition(plain)
    return f"{front}\033[{style}m{plain}\033[0m{end}"


@dataclass(frozen=True)
class Column(Generic[RowT]):
    """A fact about each row. It is in both outputs, unless its key or its heading is "": if their values differ."""

    key: str
    """Its key in objects."""
    heading: str
    """Its heading in the text."""
    value: Callable[[RowT], Any]
    form: Callable[[Any], str] = str
    """Returns the text of a value. That of None is ""."""
    align: Literal["<", ">"] = "<"
    """The side at which the texts are aligned, as in a format."""
    style: Callable[[Any], int] = lambda _: 0
    """Returns the style of a value."""

    def text(self, row: RowT) -> str:
        """Return the text of a cell."""
        value = self.value(row)
        return "" if value is None else self.form(value)


def objects_of(columns: Iterable[Column[RowT]], rows: Iterable[RowT]) -> list[dict[str, Any]]:
    """Return an object for each row."""
    keyed = [column for column in columns if column.key]
    return [{column.key: column.value(row) for column in keyed} for row in rows]


def print_table(
    columns: Iterable[Column[RowT]], rows: Sequence[RowT], below: Callable[[RowT], Iterable[str]] = lambda _: ()
) -> None:
    """Print rows under their headings, without empty columns. `below` returns the lines that follow a row.

    Cells are made `printable`, so that the columns stay aligned. On a terminal, headings are bold.
    """
    shown: list[list[str]] = []
    for column in columns:
        texts = [printable(column.text(row)) for row in rows] if column.heading else []
        if any(texts):
            width = max(map(len, (column.heading, *texts)))
            styles = [BOLD, *(column.style(column.value(row)) for row in rows)]
            cells = [f"{text:{column.align}{width}}" for text in (column.heading, *texts)]
            shown.append([*map(styled, cells, styles)])
    for line, further in zip(zip(*shown, strict=True), [(), *map(below, rows)], strict=False):  # no line without cells
        print(Styled("  ".join(line).rstrip()))
        for text in further:
            print(text)
