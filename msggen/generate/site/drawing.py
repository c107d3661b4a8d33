"""The bytes of a message in rows of eight, as the pages draw them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import NamedTuple

from msggen.generate.render.views import LeafView

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
