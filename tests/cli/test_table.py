"""Tests of tables of facts, which are text and JSON."""

from __future__ import annotations

import re

import pytest

from msggen.cli.table import RED, Column, objects_of, print_table
from support.commands import run

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


def test_lines_of_a_row_are_below_it(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(COLUMNS[:1], ["rpm", "", "esc"], lambda row: [f"  {each}" for each in row[:2]])
    assert capsys.readouterr().out.splitlines() == ["name", "rpm", "  r", "  p", "", "esc", "  e", "  s"]
    print_table(COLUMNS[-1:], ["rpm"], lambda row: [row])
    assert not capsys.readouterr().out


def test_colours_do_not_move_the_columns(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    columns = [*COLUMNS, Column[str]("", "state", lambda row: "bad" if row == "rpm" else "", style=lambda _: RED)]
    print_table(columns, ["rpm", "esc_status_0"])
    plain = capsys.readouterr().out
    monkeypatch.setenv("FORCE_COLOR", "1")
    print_table(columns, ["rpm", "esc_status_0"])
    coloured = capsys.readouterr().out
    head, first, _ = coloured.splitlines()
    assert head.startswith("\033[1mname\033[0m          \033[1msize\033[0m")
    assert first.endswith("  \033[31mbad\033[0m")
    assert re.sub(r"\033\[\d*m", "", coloured) == plain
    monkeypatch.setenv("NO_COLOR", "1")
    print_table(columns, ["rpm", "esc_status_0"])
    assert capsys.readouterr().out == plain


@pytest.mark.parametrize("words", ["releases", "rules", "command --list", "command --list NAV_TAKEOFF"])
def test_a_list_has_colours_on_a_terminal_only(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = run(words.split()).stdout
    monkeypatch.setenv("FORCE_COLOR", "1")
    coloured = run(words.split()).stdout
    assert "\033[1m" in coloured
    assert re.sub(r"\033\[\d*m", "", coloured) == plain


def test_a_cell_with_a_style_cannot_have_one_of_its_own(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    print_table([Column[str]("", "name", str, style=lambda _: RED)], ["\033[32mgreen\033[2J"])
    assert capsys.readouterr().out.splitlines()[1] == "\033[31m" + r"\x1b[32mgreen\x1b[2J" + "\033[0m"


def test_a_table_without_rows_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(COLUMNS, [])
    assert not capsys.readouterr().out
    assert objects_of(COLUMNS, []) == []


def test_a_cell_cannot_move_the_columns_behind_it(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(COLUMNS, ["a\tb\n"])
    assert capsys.readouterr().out.splitlines()[1] == r"a\tb\n   4 B  a"
