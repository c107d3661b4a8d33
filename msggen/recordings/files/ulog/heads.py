"""The fronts of the messages of a ULog, and the messages that can be found all at once because their topics are known.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.recordings.files.ulog.formats import FRONT
from msggen.recordings.source.gather import at

if TYPE_CHECKING:
    import mmap
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from msggen.recordings.files.ulog.topics import Topics
    from msggen.recordings.source.memory import Octets, Places

DATA = ord("D")
"""The kind of a sample."""
HEAD = struct.Struct("<HB")
"""The size and the kind of a message."""
SIZE = 8
"""The bytes that the walk through a file reads of each message."""
_MOST = 256
"""How many messages are looked for one by one, and one for each of `_SHARE` samples."""
_SHARE = 16
_NEW = 256
"""How many topics may be named between samples. PX4 numbers topics one after the other."""
_OFTEN = 4
_NO_RUN = 0, 0, 0, 0


class Heads(NamedTuple):
    """Where messages begin, and what they begin with: an element for each."""

    starts: Places
    sizes: NDArray[np.uint16]
    """The sizes without the fronts."""
    kinds: NDArray[np.uint8]
    numbers: NDArray[np.uint16]
    """The numbers of the topics of samples."""

    def take(self, chosen: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Heads:
        """Return some of the messages."""
        return Heads(self.starts[chosen], self.sizes[chosen], self.kinds[chosen], self.numbers[chosen])

    def joined(self, other: Heads) -> Heads:
        """Return two groups of messages as one, in the order of the file."""
        both = concatenated([self, other])
        return both.take(np.argsort(both.starts))


def concatenated(groups: Sequence[Heads]) -> Heads:
    """Return groups of messages, one behind the other."""
    starts, sizes, kinds, numbers = zip(*groups, strict=True)
    return Heads(np.concatenate(starts), np.concatenate(sizes), np.concatenate(kinds), np.concatenate(numbers))


def heads_at(file: Octets, starts: Places) -> Heads:
    """Return the heads of the messages at some offsets. There are eight bytes of each, or more."""
    return heads_of(starts, at(file, "<u8")[starts])


def heads_of(starts: Places, fronts: NDArray[np.uint64]) -> Heads:
    """Return the heads of messages from their first eight bytes."""
    kinds, numbers = (fronts >> np.uint64(16)).astype(np.uint8), (fronts >> np.uint64(24)).astype(np.uint16)
    return Heads(starts, fronts.astype(np.uint16), kinds, numbers)


def chained(data: mmap.mmap, file: Octets, topics: Topics, start: int, limit: int) -> tuple[Heads, int] | None:
    """Return the messages that follow one another from `start` up to `limit`, and where they end.

    Return None if too few of them are samples of known topics: it takes a step of Python for each other one. Bytes that
    begin as such a sample count only where the message before them ends.
    """
    last = file.size - SIZE
    known = _probable(file, topics, start, min(limit, last + 1))
    ends = known.starts + known.sizes
    ends += FRONT
    is_within = ends <= limit
    if not is_within.all():
        known, ends = known.take(is_within), ends[is_within]
    breaks = np.flatnonzero(ends[:-1] != known.starts[1:])
    lows, highs = np.append(0, breaks + 1), np.append(breaks + 1, len(ends))
    firsts = known.starts[lows[: len(ends)]].tolist()
    runs = [*zip(firsts, ends[highs - 1].tolist(), lows.tolist(), highs.tolist(), strict=True)] if firsts else [_NO_RUN]
    others: list[int] = []
    taken: list[tuple[bool, slice]] = []
    place, steps = start, len(ends) // _SHARE + _MOST
    while place <= last and steps:
        steps -= 1
        first, end, low, high = runs[bisect_right(firsts, place) - 1]
        if first <= place < end:
            low += int(known.starts[low:high].searchsorted(place)) if place > first else 0
            if low < high and known.starts[low] == place:
                taken.append((True, slice(low, high)))
                place = end
                continue
        size, _ = HEAD.unpack_from(data, place)
        if not size or place + FRONT + size > limit:  # no message has the size 0
            break
        taken.append((False, slice(len(others), len(others) + 1)))
        others.append(place)
        place += FRONT + size
    if not steps:
        return None
    unusual = heads_at(file, np.array(others, np.int64))
    return _pieces(known, unusual, taken) if taken else unusual, place


def _pieces(known: Heads, unusual: Heads, taken: Sequence[tuple[bool, slice]]) -> Heads:
    """Return pieces of both, one behind the other. There can be some hundreds."""

    def joined(own: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
        found: NDArray[Any] = np.concatenate([(own if is_known else other)[each] for is_known, each in taken])
        return found

    return Heads(
        joined(known.starts, unusual.starts),
        joined(known.sizes, unusual.sizes),
        joined(known.kinds, unusual.kinds),
        joined(known.numbers, unusual.numbers),
    )


def _probable(file: Octets, topics: Topics, low: int, high: int) -> Heads:
    """Return the samples that may begin from `low` up to `high`, as their sizes say.

    The topics that are named between these samples are not known yet: what is often there with one size is one of them.
    """
    places = np.flatnonzero(file[low + 2 : max(high, low) + 2] == DATA)
    places += low
    heads = heads_at(file, places)
    sizes, numbers = heads.sizes, heads.numbers
    largest = topics.largest[numbers]
    fits = (sizes >= topics.smallest[numbers]) & (sizes <= largest)
    others = np.flatnonzero((largest == 0) & (numbers < topics.end + _NEW))
    if len(others):
        pairs = sizes[others].astype(np.uint32) << 16 | numbers[others]
        _, inverse, counts = np.unique(pairs, return_inverse=True, return_counts=True)
        fits[others] = counts[inverse] >= _OFTEN
    return heads.take(np.flatnonzero(fits))
