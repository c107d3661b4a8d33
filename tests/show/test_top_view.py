"""Tests of the keys of `msggen top`, and of its screen at every size."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.link import Route
from msggen.show.top.drawing import screen
from msggen.show.top.rows import Health, Row, Table, rows_of
from msggen.show.top.view import _CHANGES, _OTHERS, _PAGES, _STEPS, COLUMNS, HELP, View, press
from msggen.vehicle.meter import Meter

KEYS = ("up", "down", "page up", "page down", "home", "end", "left", "right", "enter", "escape", "backspace", "space")
LETTERS = tuple("aoqjkgGprsS/?éß漢")
NUMBERS = [column for column in COLUMNS if column not in ("topic", "state")]


def rows(number: int) -> tuple[Row, ...]:
    """Return rows of topics with various rates, each third one silent."""
    meter = Meter()
    routes = [Route(f"/fmu/out/topic_{index:02}", "px4_msgs/msg/Some", "out", index) for index in range(number)]
    for index, route in enumerate(routes):
        for sample in range(2 + index % 7 if index % 3 else 0):
            meter(route, bytes(10 + index), 10_000_000_000 + sample * (index + 1) * 7_000_000)
    return rows_of(routes, meter.flows(11_000_000_000), {"/fmu/out/topic_01": 5.0}, "", 11_000_000_000)


ROWS = rows(31)
TABLE = Table(ROWS, "v1.18  udp://127.0.0.1:8888")


def pressed(*keys: str, view: View = View()) -> View:  # noqa: B008 - it cannot change
    for key in keys:
        view = press(view, key, view.shown(ROWS), 10)
    return view


def test_a_selected_topic_can_be_opened_and_closed() -> None:
    view = pressed("down", "down", "enter")
    assert (view.is_open, view.cursor) == (True, "/fmu/out/topic_02")
    assert pressed("right", view=view).cursor == "/fmu/out/topic_03"
    assert pressed("left", "left", "left", view=view).cursor == "/fmu/out/topic_00"
    for key in ("q", "escape", "backspace", "enter"):
        closed = pressed("down", key, view=view)
        assert (closed.is_open, closed.cursor, closed.scroll, closed.is_ended) == (False, "/fmu/out/topic_02", 0, False)


def test_values_are_scrolled() -> None:
    assert pressed("enter", "down", "down", "up", "page down").scroll == 11
    assert pressed("enter", "end", "home").scroll == 0


def test_the_cursor_stays_in_the_table() -> None:
    assert pressed("up").cursor == ROWS[0].topic
    assert pressed("G", "down").cursor == ROWS[-1].topic
    assert pressed("page down", "page down", "page up").cursor == ROWS[10].topic


def test_a_filter_is_typed_and_cleared() -> None:
    view = pressed("/", *"TOPIC_1q", "backspace", "enter")
    assert (view.filter, view.is_typing) == ("TOPIC_1", False)
    assert [row.topic[-2:] for row in view.shown(ROWS)] == [f"{number}" for number in range(10, 20)]
    assert pressed("escape", view=view).filter == ""
    assert pressed("/", "a", "escape") == View()
    assert pressed("/", "x", "y", "z", "enter", "enter", "down") == View(filter="xyz")


def test_pause_reverse_and_quit() -> None:
    assert pressed("space").is_paused
    assert not pressed("space", "p").is_paused
    assert pressed("r").is_reversed
    assert pressed("q").is_ended
    assert pressed("/", "ctrl-c").is_ended
    assert pressed("enter", "ctrl-c").is_ended


def test_every_column_can_decide_the_order() -> None:
    view, seen = View(), []
    for _ in COLUMNS:
        seen.append(view.sort)
        view = pressed("s", view=view)
    assert tuple(seen) == COLUMNS
    assert view.sort == "topic"
    assert pressed("S").sort == COLUMNS[-1]


@pytest.mark.parametrize("view", [View(sort=column, is_reversed=each) for column in NUMBERS for each in (True, False)])
def test_numbers_are_in_order_and_what_is_not_known_is_last(view: View) -> None:
    shown = view.shown(ROWS)
    values = [getattr(row, view.sort) for row in shown]
    known = [value for value in values if not math.isnan(value)]
    assert known == sorted(known, reverse=not view.is_reversed)
    assert all(math.isnan(value) for value in values[len(known) :])
    assert sorted(row.topic for row in shown) == [row.topic for row in ROWS]


@given(
    st.lists(st.sampled_from(KEYS + LETTERS), max_size=12),
    st.integers(1, 200),
    st.integers(1, 60),
    st.integers(0, 80),
    st.sampled_from(["", "disconnected"]),
)
def test_a_screen_of_any_size_is_filled_exactly(keys: list[str], width: int, height: int, more: int, text: str) -> None:
    view = pressed(*keys)
    values = [f"value {number} 漢字" for number in range(more)]
    lines = screen(TABLE._replace(trouble=text, notice=text), view, values, width, height)
    assert len(lines) == height
    assert all(line.cell_len <= width for line in lines)
    shown = view.shown(ROWS)
    if shown and not view.is_open and height > 6 and width > 40:
        end = shown[view.selected(shown)].topic[-8:]
        (marked,) = [line for line in lines if any(span.style == "reverse" for span in line.spans)]
        assert end in marked.plain


def test_a_narrow_screen_has_fewer_columns() -> None:
    heads = [screen(TABLE, View(), (), width, 40)[2].plain.split() for width in (116, 104, 80, 60)]
    assert heads[0] == [
        *("topic", "Hz", "last", "20", "s", "limit", "age", "s", "kB/s", "bytes", "samples", "longest", "s")
    ]
    assert heads[1] == ["topic", "Hz", "last", "20", "s", "limit", "age", "s", "kB/s", "bytes"]
    assert heads[2] == ["topic", "Hz", "limit", "age", "s", "kB/s", "bytes"]
    assert heads[3] == ["topic", "Hz", "age", "s"]


def test_the_head_line_has_the_state_of_the_vehicle() -> None:
    assert screen(TABLE, View(), (), 100, 20)[0].plain == "msggen top  v1.18  udp://127.0.0.1:8888"
    flying = TABLE._replace(health=Health("AUTO_RTL", "ARMED", True, 0.125, "CRITICAL"), lost=3)  # noqa: FBT003
    assert screen(flying, View(), (), 120, 20)[0].plain == (
        "msggen top  AUTO_RTL  ARMED  FAILSAFE  battery 12 % CRITICAL  v1.18  udp://127.0.0.1:8888  3 lost"
    )
    hostile = TABLE._replace(health=Health(mode="\x1b[2J"))
    assert screen(hostile, View(), (), 100, 20)[0].plain.startswith(r"msggen top  \x1b[2J  v1.18")


def test_the_help_explains_every_key() -> None:
    view = pressed("?")
    lines = [line.plain.rstrip() for line in screen(TABLE, view, (), 80, 24)]
    named = {key for keys, _ in HELP for key in keys.split(", ")}
    assert {*_STEPS, *_PAGES, *_OTHERS, *_CHANGES, "enter"} - {"ctrl-c"} == named
    assert all(any(line.strip().startswith(keys) and line.endswith(what) for line in lines) for keys, what in HELP)
    assert lines[-1] == "any key back to the table"
    assert pressed("x", view=view) == View()
    assert pressed("ctrl-c", view=view).is_ended
    assert pressed("/", "?").filter == "?"
