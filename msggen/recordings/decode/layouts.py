"""The layout of samples in numpy arrays: the dtype of rows, and where each byte of a row is in a sample.

A row of a message with a fixed size is its sample in little-endian XCDR1, with its encapsulation header and its
padding, where numpy can describe that; its fields have offsets. Otherwise it holds the values without padding.
`encoded` makes CDR samples of the rows of a ULog, whose fields are in the order of uORB's struct, with its padding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from typing import TYPE_CHECKING, cast

import numpy as np

from msggen.definitions.dtypes import Leaf, bools_of, lay_out_rows, positions_of
from msggen.definitions.layout import DelimiterHeader, Encoding, lay_out
from msggen.definitions.layout import Layout as LaidOut
from msggen.definitions.model import ArrayKind
from msggen.definitions.primitives import PRIMITIVES
from msggen.recordings.decode.encapsulation import HEADER, SURPLUS, USUAL
from msggen.recordings.decode.schemas import Schema, read_schema
from msggen.recordings.source.rows import Layout, bools_at

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from msggen.definitions.layout import Path
    from msggen.recordings.source.memory import Octets

ENCODINGS = {
    b"\0\0": (">", Encoding.XCDR1),
    USUAL: ("<", Encoding.XCDR1),
    b"\0\6": (">", Encoding.XCDR2),
    b"\0\7": ("<", Encoding.XCDR2),
}
"""The byte order and the version of each encapsulation that is decoded (docs/wire.md, section 5)."""


@dataclass(frozen=True, eq=False)
class Wire:
    """The samples of a message in one encapsulation."""

    size: int
    """The size of a sample in bytes, with its header."""
    delimiters: tuple[tuple[int, int], ...]
    """The offset and the value of each delimiter header of XCDR2."""
    leaves: tuple[Leaf, ...]
    """The values, in the order of `Layout.runs`."""
    is_swapped: bool

    @cached_property
    def positions(self) -> NDArray[np.intp]:
        """Where the bytes of the values are in a sample, in the order of `Layout.positions`."""
        return cast("NDArray[np.intp]", positions_of(self.leaves, is_swapped=self.is_swapped))


def layout_of(ros_type: str, definition: str) -> Layout | None:
    """Return the layout of CDR samples, None for a message with strings or sequences. Raises SchemaError."""
    schema = read_schema(ros_type, definition)
    return _cdr_layout(schema) if schema.is_static else None


@lru_cache(1024)
def _cdr_layout(schema: Schema) -> Layout:
    laid_out = lay_out(schema.catalog, schema.message)
    size = HEADER + laid_out.size
    dtype, leaves, in_place = lay_out_rows(tuple(_leaves(laid_out)), size, 0)
    bools = tuple(bools_at(bools_of(leaves), dtype.itemsize))
    return Layout(dtype, tuple(_runs(leaves)), bools, size, SURPLUS, in_place)


@lru_cache(1024)
def wire_of(schema: Schema, encapsulation: bytes) -> Wire:
    """Return the offsets of a message with a fixed size in an encapsulation, a key of ENCODINGS."""
    order, encoding = ENCODINGS[encapsulation]
    laid_out = lay_out(schema.catalog, schema.message, encoding)
    delimiters = tuple(
        (HEADER + item.offset, item.size) for item in laid_out.items if isinstance(item, DelimiterHeader)
    )
    return Wire(HEADER + laid_out.size, delimiters, tuple(_leaves(laid_out)), is_swapped=order == ">")


def _leaves(laid_out: LaidOut) -> Iterator[Leaf]:
    for leaf in laid_out.leaves:
        length = None if leaf.type.array is ArrayKind.SCALAR else leaf.type.length
        yield Leaf(leaf.path, PRIMITIVES[leaf.type.name].code, leaf.size, length, HEADER + leaf.offset)


def _runs(leaves: Iterable[Leaf]) -> Iterator[tuple[int, int]]:
    """Yield where values begin and end that have no padding between them."""
    start = stop = 0
    for leaf in leaves:
        if leaf.offset != stop:
            if stop > start:
                yield start, stop
            start = leaf.offset
        stop = leaf.end
    yield start, stop


def encoded(rows: NDArray[np.void], layout: Layout, own: Schema, written: Schema) -> Octets:
    """Return rows as CDR samples of the definition `written`, with their headers: little-endian XCDR1, padding is 0.

    `own` is the definition whose order the rows have. Values stay as they are, so that their bytes only move.
    """
    wire = wire_of(written, USUAL)
    made = np.zeros((len(rows), wire.size), np.uint8)
    made[:, : len(USUAL)] = np.frombuffer(USUAL, np.uint8)
    octets = rows.view(f"V{rows.dtype.itemsize}").view(np.uint8).reshape(len(rows), -1)
    made[:, wire.positions] = octets[:, layout.positions[_moved(own, written)]]
    return made


@lru_cache(1024)
def _moved(own: Schema, written: Schema) -> NDArray[np.intp]:
    """Return where the bytes of the values of `written`, in its order, are among those of `own`."""
    places: dict[Path, range] = {}
    end = 0
    for leaf in lay_out(own.catalog, own.message).leaves:
        begin, end = end, end + leaf.size * leaf.element_count
        places[leaf.path] = range(begin, end)
    order = (places[leaf.path] for leaf in lay_out(written.catalog, written.message).leaves)
    return np.fromiter(chain.from_iterable(order), np.intp, end)
