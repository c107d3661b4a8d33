"""What the pages draw: the bytes of a message in rows of eight, and the graph of messages that nest others.

The graph is laid out in columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby, pairwise
from typing import NamedTuple

from msggen.generate.render.views import LeafView, MessageView

PER_ROW = 8
"""The number of bytes in a row: the largest alignment."""

_COLOURS = 6
"""The number of colours in the style sheet."""

_FEW = 2
"""The largest number of rows, filled by the same values, that are all drawn."""


class Run(NamedTuple):
    """Neighbouring bytes from `start` up to `end`: values of a field, or padding, whose label is "".

    `field` is the field of the message that they belong to, and `number` counts runs of values.
    """

    start: int
    end: int
    label: str
    field: str = ""
    type: str = ""
    number: int = 0

    @property
    def title(self) -> str:
        """The label, the type, and the first and the last byte."""
        named = ", ".join(filter(None, (self.label or "padding", self.type)))
        return f"{named}: bytes {self.start} to {self.end - 1}"


class Cell(NamedTuple):
    """The part of a run in one row. `shows_label` is true for the widest part of each run, the first of several."""

    run: Run
    start: int
    end: int
    shows_label: bool

    @property
    def width(self) -> int:
        """The number of bytes."""
        return self.end - self.start

    @property
    def classes(self) -> str:
        """The classes in the style sheet: of the width, and of the colour."""
        return f"w{self.width} c{self.run.number % _COLOURS}" if self.run.label else f"w{self.width} padding"

    @property
    def label(self) -> str:
        """The text in the cell."""
        return self.run.label if self.shows_label else ""

    @property
    def type(self) -> str:
        """The type in the cell."""
        return self.run.type if self.shows_label else ""


class Row(NamedTuple):
    """A row, or several that one run fills, of which only the first and the last byte are shown."""

    start: int
    end: int
    cells: tuple[Cell, ...]

    @property
    def last(self) -> int:
        """The last byte."""
        return self.end - 1


def rows_of(leaves: tuple[LeafView, ...]) -> tuple[Row, ...]:
    """Return the rows of a message with these values."""
    rows: dict[int, list[Cell]] = {}
    for run in _runs(leaves):
        for cell in _cells(run):
            rows.setdefault(cell.start // PER_ROW, []).append(cell)
    return tuple(_shortened([Row(index * PER_ROW, cells[-1].end, tuple(cells)) for index, cells in rows.items()]))


def _runs(leaves: tuple[LeafView, ...]) -> Iterator[Run]:
    """Yield values and padding in the order of their bytes. All but the first element of an array are one run."""
    groups = groupby(leaves, key=lambda leaf: _repeated(leaf.path) or leaf.path)
    for number, (repeated, group) in enumerate(groups):
        found = list(group)
        first, last = found[0], found[-1]
        if first.padding:
            yield Run(first.offset - first.padding, first.offset, "")
        end = last.offset + last.count * last.item_size
        field = first.path.partition(".")[0].partition("[")[0]
        if repeated == first.path:
            yield Run(first.offset, end, first.path, field, first.field.type, number)
        else:
            highest = last.path[len(repeated) + 1 :].partition("]")[0]
            label = f"{repeated}[1]" if highest == "1" else f"{repeated}[1] to {repeated}[{highest}]"
            yield Run(first.offset, end, label, field, "", number)


def _repeated(path: str) -> str:
    """Return the array of messages in `path` of which it is in another element than the first, or ""."""
    parts = path.split(".")
    for index, part in enumerate(parts):
        name, bracket, element = part.partition("[")
        if bracket and element != "0]":
            return ".".join((*parts[:index], name))
    return ""


def _cells(run: Run) -> Iterator[Cell]:
    cuts = [run.start, *range((run.start // PER_ROW + 1) * PER_ROW, run.end, PER_ROW), run.end]
    pieces = list(pairwise(cuts))
    widest = max(pieces, key=lambda piece: piece[1] - piece[0])
    for piece in pieces:
        yield Cell(run, *piece, shows_label=piece == widest)


def _shortened(rows: list[Row]) -> Iterator[Row]:
    """Yield the rows. Of more than a few that one run fills, the first, one for the others, and the last are left."""
    for run, group in groupby(rows, key=_filling):
        same = list(group)
        if run is None or len(same) <= _FEW:
            yield from same
        else:
            yield same[0]
            yield Row(same[1].start, same[-2].end, ())
            yield same[-1]


def _filling(row: Row) -> Run | None:
    """Return the run that fills the whole row, or None."""
    first = row.cells[0]
    return first.run if first.width == PER_ROW else None


_WIDTH, _HEIGHT = 250, 30
_ACROSS, _DOWN = 340, 40
_SPACE = 16
"""Sizes in pixels: those of a node, the distances of columns and of nodes in one, and the space between groups."""


class Node(NamedTuple):
    """A message, drawn as a box whose upper left corner is (x, y)."""

    message: MessageView
    x: int
    y: int
    width: int = _WIDTH
    height: int = _HEIGHT

    @property
    def text_y(self) -> int:
        """The base line of the name."""
        return self.y + 20


class Edge(NamedTuple):
    """A line from a message to one that it nests."""

    outer: Node
    inner: Node

    @property
    def path(self) -> str:
        """The line, as SVG has it."""
        (x, y), (to_x, to_y) = (self.outer.x + _WIDTH, self.outer.y + 15), (self.inner.x, self.inner.y + 15)
        middle = (x + to_x) // 2
        return f"M{x} {y}C{middle} {y} {middle} {to_y} {to_x} {to_y}"


class Graph(NamedTuple):
    """A drawing of the graph."""

    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    width: int
    height: int


def draw(messages: Iterable[MessageView]) -> Graph:
    """Return the drawing of those `messages` that nest others or are nested, one connected group below the other."""
    outers = [message for message in messages if inner_of(message)]
    nodes: dict[MessageView, Node] = {}
    top = 0
    for group in _groups(outers):
        columns: dict[int, list[MessageView]] = {}
        for message, column in _columns(group).items():
            columns.setdefault(column, []).append(message)
        for column, stacked in columns.items():
            for index, message in enumerate(_beside_outers(stacked, group, nodes)):
                nodes[message] = Node(message, column * _ACROSS, top + index * _DOWN)
        top += max(map(len, columns.values())) * _DOWN + _SPACE
    edges = [Edge(nodes[outer], nodes[inner]) for outer in outers for inner in inner_of(outer)]
    width = max((node.x for node in nodes.values()), default=0) + _WIDTH
    return Graph(tuple(nodes.values()), tuple(edges), width, max(top - _SPACE, 0))


def inner_of(message: MessageView) -> tuple[MessageView, ...]:
    """Return the messages that fields of `message` hold, each once, in the order of the fields."""
    return tuple(dict.fromkeys(field.message for field in message.fields if field.message))


def _groups(outers: list[MessageView]) -> Iterator[list[MessageView]]:
    """Yield the messages that are connected with each other, in the order of the first of `outers` in each group."""
    neighbours: dict[MessageView, list[MessageView]] = {}
    for outer in outers:
        for inner in inner_of(outer):
            neighbours.setdefault(outer, []).append(inner)
            neighbours.setdefault(inner, []).append(outer)
    seen: set[MessageView] = set()
    for start in outers:
        waiting, group = [start], []
        while waiting:
            message = waiting.pop(0)
            if message not in seen:
                seen.add(message)
                group.append(message)
                waiting += neighbours[message]
        if group:
            yield group


def _columns(group: list[MessageView]) -> dict[MessageView, int]:
    """Return the column of each message: to the right of all messages that nest it."""
    columns = dict.fromkeys(group, 0)
    waiting = list(group)
    while waiting:
        outer = waiting.pop()
        for inner in inner_of(outer):
            if columns[inner] <= columns[outer]:
                columns[inner] = columns[outer] + 1
                waiting.append(inner)
    return dict(sorted(columns.items(), key=lambda item: item[1]))


def _beside_outers(
    stacked: list[MessageView], group: list[MessageView], nodes: dict[MessageView, Node]
) -> list[MessageView]:
    """Return the messages of a column, sorted by the mean height of the messages that nest them."""

    def height(message: MessageView) -> tuple[float, str]:
        above = [nodes[outer].y for outer in group if outer in nodes and message in inner_of(outer)]
        return (sum(above) / len(above) if above else 0, message.name)

    return sorted(stacked, key=height)
