"""The layout of samples in numpy arrays: the dtype of a row, and the positions of the bytes of its values.

Generated packages have a copy of this module. It imports the standard library and numpy only.
"""

from __future__ import annotations

from itertools import groupby
from typing import NamedTuple

TYPE_CHECKING: bool = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    np: Any  # its types of structured arrays change between versions
else:
    import numpy as np


class Leaf(NamedTuple):
    """A number or an array of numbers in a sample or a row."""

    path: tuple[tuple[str, int | None], ...]
    """The field name, and the index in an array of messages or None, for each level, the outermost first."""
    code: str
    """The type of the numbers, as `struct` and numpy name it."""
    size: int
    """The size of one number in bytes."""
    length: int | None
    """The number of elements, None if it is not an array."""
    offset: int

    @property
    def end(self) -> int:
        """The offset after its last byte."""
        return self.offset + self.size * (1 if self.length is None else self.length)


class _NoDtypeError(Exception):
    """numpy cannot describe samples: elements are unevenly spaced, or padding of the last one is missing."""


def lay_out_rows(leaves: tuple[Leaf, ...], size: int, start: int) -> tuple[Any, tuple[Leaf, ...], bool]:
    """Return the dtype of rows, the leaves in a row, and whether a row is the sample of `size` bytes, byte for byte.

    `leaves` are those of the sample, in its order. If numpy cannot describe the sample, a row has its values without
    padding, from the offset `start`.
    """
    try:
        return _dtype(leaves, 0, size, 0), leaves, True
    except _NoDtypeError:
        packed: list[Leaf] = []
        for leaf in leaves:
            packed.append(leaf._replace(offset=packed[-1].end if packed else start))
        return _dtype(packed, 0, packed[-1].end, 0), tuple(packed), False


def positions_of(leaves: Sequence[Leaf], *, is_swapped: bool = False) -> Any:
    """Return the position of each byte of the values, those of swapped numbers from the last byte to the first."""
    places = [np.arange(leaf.offset, leaf.end, dtype=np.intp) for leaf in leaves]
    if is_swapped:
        places = [each.reshape(-1, leaf.size)[:, ::-1].ravel() for leaf, each in zip(leaves, places, strict=True)]
    return np.concatenate(places)


def bools_of(leaves: Sequence[Leaf]) -> list[int]:
    """Return the positions of the bools."""
    return [position for leaf in leaves if leaf.code == "?" for position in range(leaf.offset, leaf.end)]


def _dtype(leaves: Sequence[Leaf], low: int, high: int, depth: int) -> Any:
    """Return the dtype of the bytes from `low` up to `high`, of fields at a depth of nesting. Raises _NoDtypeError."""
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    for name, group in groupby(leaves, key=lambda leaf: leaf.path[depth][0]):
        field = tuple(group)
        format_, offset = _format(field, high, depth)
        if offset < low or field[-1].end > high:
            raise _NoDtypeError
        names.append(name)
        formats.append(format_)
        offsets.append(offset - low)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": high - low})


def _format(field: tuple[Leaf, ...], high: int, depth: int) -> tuple[Any, int]:
    """Return the dtype of a field and its offset."""
    first, end = field[0], field[-1].end
    if len(first.path) == depth + 1:
        number = f"<{first.code}"
        return (number if first.length is None else (number, (first.length,))), first.offset
    if first.path[depth][1] is None:
        return _dtype(field, first.offset, end, depth + 1), first.offset
    elements = [tuple(group) for _, group in groupby(field, key=lambda leaf: leaf.path[depth][1])]
    starts = [element[0].offset for element in elements]
    count = len(elements)
    stride = starts[1] - starts[0] if count > 1 else end - first.offset
    # An element has the padding behind it, or the padding before it if the sample ends with the last element.
    begin = min(starts[0], high - count * stride)
    types = [
        _dtype(element, begin + number * stride, begin + (number + 1) * stride, depth + 1)
        for number, element in enumerate(elements)
    ]
    if any(type_ != types[0] for type_ in types) or _overlaps(types[0]):
        raise _NoDtypeError
    return (types[0], (count,)), begin


def _overlaps(dtype: Any) -> bool:
    """Whether fields overlap. numpy copies an array of such elements wrongly to another dtype."""
    end = 0
    for type_, offset, *_ in sorted(dtype.fields.values(), key=lambda field: field[1]):
        if offset < end or (type_.base.names is not None and _overlaps(type_.base)):
            return True
        end = offset + type_.itemsize
    return False
