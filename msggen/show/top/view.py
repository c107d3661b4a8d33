"""What the user of the table has chosen to see, and what keys change."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from msggen.show.top.rows import Row

COLUMNS = ("topic", "rate", "limit", "age", "bandwidth", "size", "samples", "longest", "state")
"""The columns of the table, which are attributes of a Row."""

_TEXTS = ("topic", "state")
_ERASE = ("backspace", "delete")


class View(NamedTuple):
    """The choices of the user."""

    sort: str = "topic"
    """The column that decides the order: texts from A, numbers from the largest."""
    is_reversed: bool = False
    filter: str = ""
    """A part of the names to show."""
    is_typing: bool = False
    """Whether keys go into the filter."""
    is_paused: bool = False
    cursor: str = ""
    """The name of the selected topic."""
    is_open: bool = False
    """Whether the values of the selected topic are shown."""
    scroll: int = 0
    """The number of lines of values above the first one that is shown."""
    is_help: bool = False
    """Whether the keys are explained in place of the table."""
    is_ended: bool = False

    def shown(self, rows: Sequence[Row]) -> list[Row]:
        """Return the rows that the filter selects, in order. Rows without a number are the last ones."""
        selected = [row for row in rows if self.filter.lower() in row.topic.lower()]
        if self.sort in _TEXTS:
            return sorted(selected, key=lambda row: str(getattr(row, self.sort)), reverse=self.is_reversed)
        known = [row for row in selected if not math.isnan(getattr(row, self.sort))]
        known.sort(key=lambda row: float(getattr(row, self.sort)), reverse=not self.is_reversed)
        return known + [row for row in selected if math.isnan(getattr(row, self.sort))]

    def selected(self, shown: Sequence[Row]) -> int:
        """Return the index of the selected row, or 0."""
        return next((index for index, row in enumerate(shown) if row.topic == self.cursor), 0)


def press(view: View, key: str, shown: Sequence[Row], page: int) -> View:
    """Return the view after a key. `shown` are the rows of the view, and `page` is the number of rows on a screen."""
    if (view.is_typing or view.is_help) and key != "ctrl-c":
        return _type(view, key) if view.is_typing else view._replace(is_help=False)
    if key in _STEPS or key in _PAGES:
        return _move(view, _STEPS.get(key, 0) + _PAGES.get(key, 0) * max(1, page), shown)
    if key == "enter" and shown:
        selected = shown[view.selected(shown)].topic
        return view._replace(is_open=not view.is_open, cursor=selected, scroll=0)
    if view.is_open and key in _OTHERS:
        return _move(view._replace(is_open=False), _OTHERS[key], shown)._replace(is_open=True, scroll=0)
    if view.is_open and key in _BACK:
        return view._replace(is_open=False, scroll=0)
    change = _CHANGES.get(key)
    return change(view) if change else view


_STEPS = {"up": -1, "k": -1, "down": 1, "j": 1, "home": -(1 << 30), "g": -(1 << 30), "end": 1 << 30, "G": 1 << 30}
_PAGES = {"page up": -1, "page down": 1}
_OTHERS = {"left": -1, "right": 1}
_BACK = ("q", "escape", "backspace")
_CHANGES: Mapping[str, Callable[[View], View]] = {
    "q": lambda view: view._replace(is_ended=True),
    "ctrl-c": lambda view: view._replace(is_ended=True),
    "escape": lambda view: view._replace(filter=""),
    "/": lambda view: view._replace(is_typing=True, is_open=False, scroll=0),
    "space": lambda view: view._replace(is_paused=not view.is_paused),
    "p": lambda view: view._replace(is_paused=not view.is_paused),
    "r": lambda view: view._replace(is_reversed=not view.is_reversed),
    "s": lambda view: _sort(view, 1),
    "S": lambda view: _sort(view, -1),
    "?": lambda view: view._replace(is_help=True),
}

HELP = (
    ("up, down, home, end", "select a topic, or scroll its values"),
    ("k, j, g, G", "the same"),
    ("page up, page down", "the same, by a screen"),
    ("enter", "show the last values of the topic"),
    ("left, right", "show the values of another topic"),
    ("/", "show only the topics whose names contain what you type"),
    ("s, S", "sort by the next or the previous column"),
    ("r", "reverse the order"),
    ("space, p", "pause, go on"),
    ("escape", "clear the filter"),
    ("q", "leave the values, or quit"),
    ("?", "explain the keys"),
)
"""The keys, and what each does."""


def _type(view: View, key: str) -> View:
    if key == "enter":
        return view._replace(is_typing=False)
    if key == "escape":
        return view._replace(is_typing=False, filter="")
    if key in _ERASE:
        return view._replace(filter=view.filter[:-1])
    text = " " if key == "space" else key
    return view._replace(filter=view.filter + text) if len(text) == 1 else view


def _move(view: View, step: int, shown: Sequence[Row]) -> View:
    """Move the cursor, or the values of an open topic."""
    if view.is_open:
        return view._replace(scroll=max(0, view.scroll + step))
    if not shown:
        return view
    index = min(max(view.selected(shown) + step, 0), len(shown) - 1)
    return view._replace(cursor=shown[index].topic)


def _sort(view: View, step: int) -> View:
    column = COLUMNS[(COLUMNS.index(view.sort) + step) % len(COLUMNS)]
    return view._replace(sort=column, is_reversed=False)
