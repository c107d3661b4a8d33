"""Tests of tables of facts, which are text and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msggen.cli.table import Column, objects_of, print_table

if TYPE_CHECKING:
    import pytest

COLUMNS = (
    Column[str]("name", "name", lambda row: row),
    Column[str]("letters", "", len),
    Column[str]("", "size", lambda row: len(row) or None, "{} B".format, ">"),
    Column[str]("first", "first", lambda row: row[:1] or None),
    Column[str]("last", "none has it", lambda _: None),
)


def test_a_column_is_in_the_text_or_in_objects_or_in_both(capsys: pytest.CaptureFixture[str]) -> None:
    rows = ["rpm", "", "esc_status_0"]
    print_table(COLUMNS, rows)
    assert capsys.readouterr().out.splitlines() == [
        "name          size  first",
        "rpm            3 B  r",
        "",
        "esc_status_0  12 B  e",
    ]
    assert objects_of(COLUMNS, rows) == [
        {"name": row, "letters": len(row), "first": first, "last": None}
        for row, first in zip(rows, ("r", None, "e"), strict=True)
    ]


def test_a_table_without_rows_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(COLUMNS, [])
    assert not capsys.readouterr().out
    assert objects_of(COLUMNS, []) == []


def test_a_cell_cannot_move_the_columns_behind_it(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(COLUMNS, ["a\tb\n"])
    assert capsys.readouterr().out.splitlines()[1] == r"a\tb\n   4 B  a"
