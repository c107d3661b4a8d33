"""The layout of samples in numpy arrays: the dtype of rows, and where each byte of a row is in a sample.

A row of a message with a fixed size is its sample in little-endian XCDR1, with its encapsulation header and its
padding, where numpy can describe that; its fields have offsets. Otherwise it holds the values without padding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.definitions.layout import DelimiterHeader, Encoding, Leaf, lay_out
from msggen.definitions.model import ArrayKind
from msggen.definitions.primitives import PRIMITIVES
from msggen.recordings.decode.schemas import Schema, read_schema
from msggen.recordings.source.rows import Layout, bools_at, joined

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

HEADER = 4
"""The size of the encapsulation header."""
SURPLUS = 3
"""DDS fills samples up to a multiple of four bytes."""
USUAL = b"\0\1"
"""Little-endian XCDR1, in which PX4 writes."""
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
    runs: tuple[tuple[int, int, int], ...]
    """Where the values are in a sample, in the order of `Layout.runs`: offset, end, and the size of each value."""
    is_swapped: bool

    @cached_property
    def positions(self) -> NDArray[np.intp]:
        """Where the bytes of the values are in a sample, in the order of `Layout.positions`."""
        if not self.is_swapped:
            return joined([np.arange(start, stop) for start, stop, _ in self.runs])
        return joined([np.arange(start, stop).reshape(-1, size)[:, ::-1].ravel() for start, stop, size in self.runs])


class _NoDtypeError(Exception):
    """numpy cannot describe samples: elements are unevenly spaced, or padding of the last one is missing."""


def layout_of(ros_type: str, definition: str) -> Layout | None:
    """Return the layout of CDR samples, None for a message with strings or sequences. Raises SchemaError."""
    schema = read_schema(ros_type, definition)
    return _cdr_layout(schema) if schema.is_static else None


@lru_cache(1024)
def _cdr_layout(schema: Schema) -> Layout:
    laid_out = lay_out(schema.catalog, schema.message)
    size = HEADER + laid_out.size
    leaves = tuple(leaf._replace(offset=leaf.offset + HEADER) for leaf in laid_out.leaves)
    try:
        return _layout(leaves, size, SURPLUS, _dtype(leaves, 0, 0, size), in_place=True)
    except _NoDtypeError:
        packed = tuple(_packed(leaves))
        end = packed[-1].offset + packed[-1].size * packed[-1].element_count
        return _layout(packed, size, SURPLUS, _dtype(packed, 0, 0, end), in_place=False)


@lru_cache(1024)
def wire_of(schema: Schema, encapsulation: bytes) -> Wire:
    """Return the offsets of a message with a fixed size in an encapsulation, a key of ENCODINGS."""
    order, encoding = ENCODINGS[encapsulation]
    laid_out = lay_out(schema.catalog, schema.message, encoding)
    delimiters = tuple(
        (HEADER + item.offset, item.size) for item in laid_out.items if isinstance(item, DelimiterHeader)
    )
    runs = tuple(
        (HEADER + leaf.offset, HEADER + leaf.offset + leaf.size * leaf.element_count, leaf.size)
        for leaf in laid_out.leaves
    )
    return Wire(HEADER + laid_out.size, delimiters, runs, is_swapped=order == ">")


def _layout(leaves: Sequence[Leaf], size: int, surplus: int, dtype: np.dtype[Any], *, in_place: bool) -> Layout:
    places = [
        place
        for leaf in leaves
        if leaf.type.name == "bool"
        for place in range(leaf.offset, leaf.offset + leaf.element_count)
    ]
    bools = tuple(bools_at(sorted(places), dtype.itemsize))
    return Layout(dtype, tuple(_runs(leaves)), bools, size, surplus, in_place)


def _packed(leaves: Sequence[Leaf]) -> Iterator[Leaf]:
    offset = 0
    for leaf in leaves:
        yield leaf._replace(offset=offset)
        offset += leaf.size * leaf.element_count


def _runs(leaves: Iterable[Leaf]) -> Iterator[tuple[int, int]]:
    """Yield where values begin and end that have no padding between them."""
    start = stop = 0
    for leaf in leaves:
        if leaf.offset != stop:
            if stop > start:
                yield start, stop
            start = leaf.offset
        stop = leaf.offset + leaf.size * leaf.element_count
    yield start, stop


def _dtype(leaves: Sequence[Leaf], depth: int, low: int, high: int) -> np.dtype[Any]:
    """Return the dtype of the bytes from `low` up to `high`, of fields at a depth of nesting. Raises _NoDtypeError."""
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    for name, group in groupby(leaves, key=lambda leaf: leaf.path[depth][0]):
        field = tuple(group)
        format_, offset = _format(field, depth, high)
        if offset < low or _end(field) > high:
            raise _NoDtypeError
        names.append(name)
        formats.append(format_)
        offsets.append(offset - low)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": high - low})


def _format(field: tuple[Leaf, ...], depth: int, high: int) -> tuple[Any, int]:
    """Return the dtype of a field and its offset."""
    first = field[0]
    if len(first.path) == depth + 1:
        number = f"<{PRIMITIVES[first.type.name].code}"
        return (number if first.type.array is ArrayKind.SCALAR else (number, (first.type.length,))), first.offset
    elements = [tuple(group) for _, group in groupby(field, key=lambda leaf: leaf.path[depth][1])]
    if first.path[depth][1] is None:
        return _dtype(field, depth + 1, first.offset, _end(field)), first.offset
    starts = [element[0].offset for element in elements]
    count = len(elements)
    stride = starts[1] - starts[0] if count > 1 else _end(field) - first.offset
    # an element has the padding behind it, or the padding before it if the sample ends with the last element
    begin = min(starts[0], high - count * stride)
    types = [
        _dtype(element, depth + 1, begin + number * stride, begin + (number + 1) * stride)
        for number, element in enumerate(elements)
    ]
    if any(type_ != types[0] for type_ in types) or _overlaps(types[0]):
        raise _NoDtypeError
    return (types[0], (count,)), begin


def _overlaps(dtype: np.dtype[Any]) -> bool:
    """Whether fields overlap. numpy copies an array of such elements wrongly to another dtype."""
    end = 0
    for type_, offset, *_ in sorted((dtype.fields or {}).values(), key=lambda field: field[1]):
        if offset < end or (type_.base.names is not None and _overlaps(type_.base)):
            return True
        end = offset + type_.itemsize
    return False


def _end(leaves: Sequence[Leaf]) -> int:
    return max(leaf.offset + leaf.size * leaf.element_count for leaf in leaves)
