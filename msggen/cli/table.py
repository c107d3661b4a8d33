"""Tables of facts: text for people, and objects of JSON for programs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from msggen.base.diagnostics import printable

RowT = TypeVar("RowT")


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

    def text(self, row: RowT) -> str:
        """Return the text of a cell."""
        value = self.value(row)
        return "" if value is None else self.form(value)


def objects_of(columns: Iterable[Column[RowT]], rows: Iterable[RowT]) -> list[dict[str, Any]]:
    """Return an object for each row."""
    keyed = [column for column in columns if column.key]
    return [{column.key: column.value(row) for column in keyed} for row in rows]


def print_table(columns: Iterable[Column[RowT]], rows: Sequence[RowT]) -> None:
    """Print rows under their headings, without empty columns.

    Cells are made `printable`, so that the columns stay aligned.
    """
    shown: list[list[str]] = []
    for column in columns:
        texts = [printable(column.text(row)) for row in rows] if column.heading else []
        if any(texts):
            width = max(map(len, (column.heading, *texts)))
            shown.append([f"{text:{column.align}{width}}" for text in (column.heading, *texts)])
    for line in zip(*shown, strict=True):
        print("  ".join(line).rstrip())
