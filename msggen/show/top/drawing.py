"""The table as lines of text: for a screen of any size, and without a limit for a pipe."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from rich.text import Text

from msggen.base.foreign import escaped
from msggen.show.top.rows import SECONDS, Health, Row, Table, sparkline
from msggen.show.top.view import HELP, View

if TYPE_CHECKING:
    from rich.console import Console

_NARROWEST = 34
"""Columns are left out until names have this many characters."""
_FIRST = 3
"""The lines above the first row."""


class _Column(NamedTuple):
    """A column of numbers: its heading, its width, and its text in a row."""

    name: str
    heading: str
    width: int
    text: Callable[[Row], str]


def _number(value: float) -> str:
    """Return a number of at least 0 with three digits, as far as it has them after the point. NaN is "-"."""
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"  # noqa: PLR2004


_NUMBERS = (
    _Column("rate", "Hz", 6, lambda row: _number(row.rate)),
    _Column("limit", "limit", 6, lambda row: "-" if math.isnan(row.limit) else f"{row.limit:g}"),
    _Column("age", "age s", 6, lambda row: _number(row.age)),
    _Column("bandwidth", "kB/s", 6, lambda row: _number(row.bandwidth / 1000)),
    _Column("size", "bytes", 6, lambda row: "-" if math.isnan(row.size) else f"{row.size:.0f}"),
    _Column("samples", "samples", 8, lambda row: str(row.samples)),
    _Column("longest", "longest s", 9, lambda row: _number(row.longest)),
    _Column("state", "", 6, lambda row: row.state),
)
_RATES = _Column("rates", f"last {SECONDS} s", SECONDS, lambda row: sparkline(row.rates))
_COLUMNS = (_NUMBERS[0], _RATES, *_NUMBERS[1:])
"""The columns of a screen, on which the rates are drawn again and again."""
_DISPENSABLE = ("longest", "samples", "rates", "size", "limit", "bandwidth")
"""The columns that a narrow screen does not have, the first one first."""

_STYLES = {"silent": "dim", "late": "red", "": ""}


def screen(table: Table, view: View, values: Sequence[str], width: int, height: int) -> list[Text]:
    """Return the lines of a screen, at most `height`. `values` are those of the open topic."""
    lines = [_title(table, view), _text(table.trouble, "bold red") if table.trouble else Text(table.summary)]
    lines += [_text(table.notice, "yellow")] if table.notice else []
    shown = view.shown(table.rows)
    if view.is_help:
        lines += [Text(), *_help()]
    elif view.is_open and shown:
        lines += [*_table(shown[view.selected(shown)], view, width), Text()]
        room = height - len(lines) - 1
        start = min(view.scroll, max(0, len(values) - room))
        lines += [_text(line) for line in values[start : start + max(0, room)]]
    else:
        lines += _rows(shown, view, width, height - len(lines) - 2)
    keys = _keys(view)
    lines = [*lines[: height - 1], *(Text() for _ in range(height - 1 - len(lines))), keys]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines[-height:]


def ansi(console: Console, lines: Sequence[Text], width: int) -> list[str]:
    """Return lines of a screen with the codes for their styles, as far as the terminal of `console` has them."""
    with console.capture() as captured:
        console.print(Text("\n").join(lines), end="", no_wrap=True, overflow="ignore", crop=False, width=width)
    return captured.get().split("\n")


def page_of(height: int) -> int:
    """Return the number of rows on a screen of this height."""
    return max(1, height - _FIRST - 1)


def plain(table: Table) -> list[str]:
    """Return the table for a pipe: a line for each topic, below the headings."""
    columns = _NUMBERS
    width = max((len(escaped(row.topic)) for row in table.rows), default=0)
    lines = [_heading(columns, width, View()), *(_line(row, columns, width) for row in table.rows)]
    return [line.plain.rstrip() for line in lines]


def _text(foreign: str, style: str = "") -> Text:
    return Text(escaped(foreign), style)


def _title(table: Table, view: View) -> Text:
    title = Text.assemble(("msggen top", "bold"))
    if view.is_paused:
        title.append("  paused", "bold yellow")
    for text, style in _health(table.health):
        title.append(f"  {escaped(text)}", style)
    title.append(f"  {escaped(table.label)}")
    if table.lost:
        title.append(f"  {table.lost} lost", "yellow")
    return title


def _health(health: Health) -> Iterator[tuple[str, str]]:
    """Yield the state of the vehicle in words, each with its style."""
    if health.mode:
        yield health.mode, "bold"
    if health.arming:
        yield health.arming, "bold red" if health.arming == "ARMED" else "bold"
    if health.is_failsafe:
        yield "FAILSAFE", "bold red reverse"
    if not math.isnan(health.battery):
        warning = f" {health.warning}" if health.warning else ""
        yield f"battery {health.battery:.0%}{warning}".replace("%", " %"), "bold yellow" if warning else ""


def _help() -> list[Text]:
    """Return the keys and what they do."""
    width = max(len(keys) for keys, _ in HELP)
    return [Text.assemble((f"  {keys:{width}}", "bold"), f"   {what}") for keys, what in HELP]


def _keys(view: View) -> Text:
    if view.is_help:
        return Text.assemble(("any key", "bold"), " back to the table")
    if view.is_typing:
        return Text.assemble(("filter: ", "bold"), view.filter, ("_", "blink"), "   enter keep   escape clear")
    if view.is_open:
        pairs = [("q", "back"), ("up/down", "scroll"), ("left/right", "other topic")]
    else:
        filtered = f"filter: {view.filter}" if view.filter else "filter"
        pairs = [("q", "quit"), ("enter", "values"), ("/", filtered), ("s", f"sort: {view.sort}"), ("r", "reverse")]
    pairs += [("space", "go on" if view.is_paused else "pause"), ("?", "help")]
    return Text("   ").join(Text.assemble((key, "bold"), f" {what}") for key, what in pairs)


def _rows(shown: Sequence[Row], view: View, width: int, room: int) -> list[Text]:
    """Return the headings and as many rows as there is room for, with the selected one among them."""
    columns, names = _columns(width)
    selected = view.selected(shown)
    start = max(0, min(selected - room // 2, len(shown) - room))
    lines = [_heading(columns, names, view)]
    for index, row in enumerate(shown[start : start + max(0, room)], start):
        line = _line(row, columns, names)
        if index == selected:
            line.stylize("reverse")
        lines.append(line)
    return lines


def _table(row: Row, view: View, width: int) -> list[Text]:
    columns, names = _columns(width)
    return [_heading(columns, names, view), _line(row, columns, names)]


def _columns(width: int) -> tuple[list[_Column], int]:
    """Return the columns for which a screen has room, and the width of the names."""
    columns = [*_COLUMNS]
    for name in (*_DISPENSABLE, ""):
        names = width - sum(column.width + 1 for column in columns)
        if names >= _NARROWEST:
            break
        columns = [column for column in columns if column.name != name]
    return columns, max(names, 8)


def _heading(columns: Sequence[_Column], names: int, view: View) -> Text:
    line = Text.assemble(("topic", _style(view.sort == "topic")), " " * (names - len("topic")))
    for column in columns:
        line.append(" " * (column.width + 1 - len(column.heading)))
        line.append(column.heading, _style(view.sort == column.name))
    return line


def _style(is_sorted: bool) -> str:  # noqa: FBT001 - the only argument
    return "bold underline" if is_sorted else "bold"


def _line(row: Row, columns: Sequence[_Column], names: int) -> Text:
    """Return the line of a topic. Of a name that is too long, the end is shown, which tells it from others."""
    topic = escaped(row.topic)
    name = topic if len(topic) <= names else f"…{topic[1 - names :]}"
    line = Text(f"{name:{names}}", style=_STYLES[row.state])
    for column in columns:
        line.append(" ").append(f"{column.text(row):>{column.width}}", "cyan" if column is _RATES else None)
    return line
