"""The rows of arrays of samples: their dtype, and where values are in a row."""

from __future__ import annotations

from bisect import bisect_left
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

_WORD = 8


class Bools(NamedTuple):
    """Up to eight bytes of a row, bools among them, that are read as one number."""

    offset: int
    size: int
    mask: int
    """The bits that are 0 in bools, which are 0 or 1."""

    @property
    def largest(self) -> NDArray[np.uint8]:
        """The largest value of each byte: 1 for bools."""
        return _largest(self.mask, self.size)


@lru_cache(1024)
def _largest(mask: int, size: int) -> NDArray[np.uint8]:
    return ~np.frombuffer(mask.to_bytes(size, "little"), np.uint8)


class Layout(NamedTuple):
    """The layout of the samples of a message with a fixed size."""

    dtype: np.dtype[Any]
    """The dtype of the rows."""
    runs: tuple[tuple[int, int], ...]
    """Where values are in a row, without padding between them: the offsets at which they begin and end."""
    bools: tuple[Bools, ...]
    """The bools in a row."""
    size: int
    """The size of a usual sample in bytes."""
    surplus: int
    """How many bytes a sample can have behind its values."""
    in_place: bool
    """Whether a row is the usual sample, byte for byte."""

    @property
    def positions(self) -> NDArray[np.intp]:
        """Where the bytes of the values are in a row: eight bytes for each, so only rows are a reason to make it."""
        return joined([np.arange(start, stop) for start, stop in self.runs])


def joined(positions: Sequence[NDArray[np.intp]]) -> NDArray[np.intp]:
    """Return several arrays of positions as one, also if there is none."""
    return np.concatenate([np.zeros(0, np.intp), *positions])


def bools_at(places: Sequence[int], size: int) -> Iterator[Bools]:
    """Yield the bools at `places` of a row of `size` bytes, several at a time."""
    index = 0
    while index < len(places):
        first = places[index]
        own = places[index : bisect_left(places, first + _WORD, index)]
        width = next(width for width in (1, 2, 4, _WORD) if width > own[-1] - first)
        offset = min(first, size - width)
        if offset < 0:  # a row that is shorter than the number
            own, width, offset = own[:1], 1, first
        yield Bools(offset, width, sum(0xFE << 8 * (place - offset) for place in own))
        index += len(own)
