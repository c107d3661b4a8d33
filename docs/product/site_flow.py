"""Drawings of the flowcharts of the pages, which GitHub draws with Mermaid: names, and arrows from left to right."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from itertools import pairwise
from typing import NamedTuple

_FENCE = re.compile(r"^```mermaid\nflowchart LR\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_WIDTH, _HEIGHT, _GAP = 100, 34, 34


class Place(NamedTuple):
    """The place of a name: its column and its row."""

    column: int
    row: int

    @property
    def x(self) -> int:
        """The left edge."""
        return 1 + self.column * (_WIDTH + _GAP)

    @property
    def y(self) -> int:
        """The upper edge."""
        return 1 + self.row * (_HEIGHT + _GAP // 2)


def with_drawings(text: str) -> str:
    """Return the text of a page with drawings instead of flowcharts."""
    return _FENCE.sub(lambda found: draw(found[1]), text)


def arrows(flowchart: str) -> tuple[tuple[str, str], ...]:
    """Return the arrows of a flowchart, whose lines are such as `a & b --> c --> d`. Raises ValueError for others."""
    found: list[tuple[str, str]] = []
    for line in filter(None, map(str.strip, flowchart.splitlines())):
        if not re.fullmatch(r"\w+( (&|-->) \w+)+", line):
            raise ValueError(f"no arrows between names: {line}")
        steps = [step.split(" & ") for step in line.split(" --> ")]
        found += [(one, other) for left, right in pairwise(steps) for one in left for other in right]
    return tuple(found)


def places(found: tuple[tuple[str, str], ...]) -> dict[str, Place]:
    """Return the places of all names: each is right of those before it, and near their rows."""
    names = [*dict.fromkeys(name for arrow in found for name in arrow)]
    before = {name: [one for one, other in found if other == name] for name in names}
    placed: dict[str, Place] = {}
    while len(placed) < len(names):
        ready = [name for name in names if name not in placed and all(each in placed for each in before[name])]
        if not ready:
            raise ValueError("the arrows make a circle")
        name = ready[0]
        column = max((placed[each].column + 1 for each in before[name]), default=0)
        rows = [placed[each].row for each in before[name]] or [0]
        taken = {place.row for place in placed.values() if place.column == column}
        free = [row for row in range(len(names)) if row not in taken]
        placed[name] = Place(column, min(free, key=lambda row: abs(row - sum(rows) / len(rows))))
    return placed


def draw(flowchart: str) -> str:
    """Return a flowchart as a picture, in a block that scrolls on narrow screens."""
    found = arrows(flowchart)
    placed = places(found)
    width = max(place.x for place in placed.values()) + _WIDTH + 1
    height = max(place.y for place in placed.values()) + _HEIGHT + 1
    about = "; ".join(f"{one} to {other}" for one, other in found)
    shapes = "".join([*_boxes(placed), *(_arrow(placed[one], placed[other]) for one, other in found)])
    return (
        f'<div class="flow" tabindex="0"><svg class="picture" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{escape(about)}"><defs><marker id="tip-flow" viewBox="0 0 8 8" refX="8" refY="4" '
        'markerWidth="8" markerHeight="8" markerUnits="userSpaceOnUse" orient="auto"><path class="tip" '
        f'd="M0 0L8 4L0 8z"/></marker></defs>{shapes}</svg></div>'
    )


def _boxes(placed: dict[str, Place]) -> Iterator[str]:
    for name, place in placed.items():
        yield f'<rect x="{place.x}" y="{place.y}" width="{_WIDTH}" height="{_HEIGHT}" rx="6"/>'
        yield f'<text class="name" x="{place.x + _WIDTH // 2}" y="{place.y + 22}">{name}</text>'


def _arrow(start: Place, end: Place) -> str:
    """Return an arrow that changes its row in the gap before its end."""
    x, y = start.x + _WIDTH, start.y + _HEIGHT // 2
    to_x, to_y = end.x, end.y + _HEIGHT // 2
    bend, middle = to_x - _GAP, to_x - _GAP // 2
    return f'<path marker-end="url(#tip-flow)" d="M{x} {y}H{bend}C{middle} {y} {middle} {to_y} {to_x} {to_y}"/>'
