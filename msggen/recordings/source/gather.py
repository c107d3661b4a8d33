"""Records of a buffer as numpy arrays, without a step of Python for each record."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.recordings.source.memory import drop_pages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets, Places

WINDOW = 1 << 23
"""The bytes of a buffer that are walked at a time."""
BLOCK = 1 << 13
"""The bytes between two places where a walk begins."""
_HEAD = 8
_LINE = 64
"""The bytes of a cache line of most processors."""


def at(buffer: Octets, dtype: Any, offset: int = 0) -> NDArray[Any]:
    """Return the value that begins at each byte of `buffer`, `offset` bytes further on: a view.

    `at(buffer, "V208", 31)[starts]` copies a row of 208 bytes for each start. A start too near to the end of the
    buffer raises IndexError.
    """
    kind = np.dtype(dtype)
    count = max(buffer.size - offset - kind.itemsize + 1, 0)
    # numpy refuses an offset behind the end, even for no values
    return np.ndarray((count,), kind, buffer if count else b"", offset if count else 0, (1,))


class Stretch(NamedTuple):
    """Records that follow one another."""

    starts: Places
    heads: NDArray[np.uint64]
    """The first eight bytes of each record."""
    end: int
    """The offset behind the last record."""


def walk(
    buffer: Octets,
    start: int,
    stop: int,
    length_of: Callable[[NDArray[np.uint64]], Places],
    find: Callable[[int, int], int],
) -> Iterator[Stretch]:
    """Yield the records of `buffer[start:stop]` in order, up to the first that is cut off.

    `length_of` returns the lengths of records from their heads; lengths are positive. `find(low, high)` returns an
    offset at which a record seems to begin, or -1. A window is walked from all these offsets at once, a record of each
    at a time. An offset at which the preceding record does not end is rejected, and the window ends before it.
    """
    heads_at = at(buffer, "<u8")
    if not heads_at.size:
        return
    while start + _HEAD <= stop:
        np.bitwise_or.reduce(
            buffer[start : min(start + WINDOW, stop) : _LINE]
        )  # fills the cache in order, which is fastest
        stretch = _walk_window(heads_at, start, min(start + WINDOW, stop), length_of, find)
        if not stretch.starts.size:
            if stretch.end > stop:
                return
            # a record that is longer than a window
            stretch = Stretch(np.array([start], np.int64), heads_at[start : start + 1], stretch.end)
        yield stretch
        drop_pages(buffer)
        start = stretch.end


def _walk_window(
    heads_at: NDArray[np.uint64],
    start: int,
    limit: int,
    length_of: Callable[[NDArray[np.uint64]], Places],
    find: Callable[[int, int], int],
) -> Stretch:
    """Return the records that begin at `start` and end up to `limit`."""
    entries = [start]
    for low in range(start + BLOCK, limit, BLOCK):
        entry = find(low, min(low + BLOCK, limit))
        if entry > entries[-1]:
            entries.append(entry)
    position = np.array(entries, np.int64)
    ends = np.append(position[1:], limit)
    last = heads_at.size - 1
    steps: list[tuple[Places, NDArray[np.uint64]]] = []
    while (position < ends).any():
        heads = heads_at[np.minimum(position, last)]
        steps.append((position, heads))
        position = np.minimum(position + length_of(heads), ends)
    starts, heads = (np.stack(each, axis=1) for each in zip(*steps, strict=True))
    inside = starts < ends[:, None]
    starts, heads = starts[inside], heads[inside]
    following = starts + length_of(heads)
    broken = np.flatnonzero(following[:-1] != starts[1:])
    if broken.size:
        count = int(broken[0]) + 1
        starts, heads, following = starts[:count], heads[:count], following[:count]
    if following[-1] > limit or starts[-1] > last:
        beyond = int(following[-1])
        starts, heads, following = starts[:-1], heads[:-1], following[:-1]
        if not starts.size:
            return Stretch(starts, heads, beyond)
    return Stretch(starts, heads, int(following[-1]))


def grouped(numbers: NDArray[Any]) -> tuple[Places, list[int], list[int]]:
    """Return the indices of `numbers`, which are small and not negative, those of each number together and in order.

    Return also which numbers there are, and from where to where the indices of each are.
    """
    if not numbers.size:
        return np.zeros(0, np.int64), [], [0]
    counts = np.bincount(numbers)
    present = np.flatnonzero(counts)
    bounds = np.append(0, np.cumsum(counts[present]))
    return np.argsort(numbers, kind="stable"), present.tolist(), bounds.tolist()


def groups(numbers: NDArray[Any]) -> Iterator[tuple[int, Places]]:
    """Yield each of `numbers`, which are small and not negative, with the indices where it stands, in order."""
    order, present, bounds = grouped(numbers)
    for number, (low, high) in zip(present, pairwise(bounds), strict=True):
        yield number, order[low:high]
