"""The fronts of the messages of a ULog, and the messages that can be found all at once because their topics are known.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.ulog_formats import FRONT

if TYPE_CHECKING:
    import mmap
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from msggen.recordings.files.ulog_topics import Topics
    from msggen.recordings.source.gather import Stretch
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


def heads_of(stretch: Stretch) -> Heads:
    """Return the heads of messages from their first eight bytes."""
    heads = stretch.heads
    return Heads(
        stretch.starts,
        heads.astype(np.uint16),
        (heads >> np.uint64(16)).astype(np.uint8),
        (heads >> np.uint64(24)).astype(np.uint16),
    )


def heads_at(file: Octets, starts: Places) -> Heads:
    """Return the heads of the messages at some offsets. There are eight bytes of each, or more."""
    return Heads(starts, numbers_at(file, starts), file[starts + 2], numbers_at(file, starts + FRONT))


def numbers_at(file: Octets, places: Places) -> NDArray[np.uint16]:
    """Return the numbers of 16 bits at some offsets. numpy gathers bytes several times as fast as unaligned numbers."""
    high = file[places + 1].astype(np.uint16)
    high <<= 8
    high |= file[places]
    return high


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
    runs = _runs(known.starts, ends)
    firsts = [run.first for run in runs]
    others: list[int] = []
    taken: list[tuple[bool, slice]] = []
    place, steps = start, len(ends) // _SHARE + _MOST
    while place <= last and steps:
        steps -= 1
        run = runs[bisect_right(firsts, place) - 1] if runs else _NO_RUN
        if run.first <= place < run.end:
            low = run.low if run.first == place else run.low + int(known.starts[run.low : run.high].searchsorted(place))
            if low < run.high and known.starts[low] == place:
                taken.append((True, slice(low, run.high)))
                place = run.end
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
    pieces = [(known if is_known else unusual).take(each) for is_known, each in taken]
    return concatenated(pieces or [unusual]), place


class _Run(NamedTuple):
    """Probable samples, of which each begins where the one before it ends."""

    low: int
    high: int
    first: int
    """The offset of the first one."""
    end: int


_NO_RUN = _Run(0, 0, 0, 0)


def _runs(starts: Places, ends: Places) -> list[_Run]:
    """Return the runs of probable samples."""
    if not len(starts):
        return []
    breaks = np.flatnonzero(ends[:-1] != starts[1:])
    lows, highs = np.append(0, breaks + 1), np.append(breaks + 1, len(starts))
    return [*map(_Run, lows.tolist(), highs.tolist(), starts[lows].tolist(), ends[highs - 1].tolist())]


def _probable(file: Octets, topics: Topics, low: int, high: int) -> Heads:
    """Return the samples that may begin from `low` up to `high`, as their sizes say.

    The topics that are named between these samples are not known yet: what is often there with one size is one of them.
    """
    places = np.flatnonzero(file[low + 2 : max(high, low) + 2] == DATA)
    places += low
    sizes, numbers = numbers_at(file, places), numbers_at(file, places + FRONT)
    largest = topics.largest[numbers]
    fits = (sizes >= topics.smallest[numbers]) & (sizes <= largest)
    others = np.flatnonzero((largest == 0) & (numbers < topics.end + _NEW))
    if len(others):
        pairs = sizes[others].astype(np.uint32) << 16 | numbers[others]
        _, inverse, counts = np.unique(pairs, return_inverse=True, return_counts=True)
        fits[others] = counts[inverse] >= _OFTEN
    chosen = np.flatnonzero(fits)
    return Heads(places[chosen], sizes[chosen], np.full(len(chosen), DATA, np.uint8), numbers[chosen])
