"""The samples of several topics as bytes, in the order of their log times."""

from __future__ import annotations

from bisect import bisect_left
from heapq import heapify, heapreplace, merge
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.source.source import FOREVER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.decode.decoder import Decoded
    from msggen.recordings.source.memory import Octets
    from msggen.recordings.source.source import Part


class Sample(NamedTuple):
    """A sample of a recording."""

    topic: str
    """The name, of another instance than the first one in a ULog with its number: `sensor_gps[1]`."""
    time: int
    """The time at which it was recorded, in ns since 1970; in a ULog, since the start of the vehicle."""
    payload: bytes
    """CDR with its header."""


def merged(streams: Sequence[tuple[int, Iterator[Sample]]]) -> Iterator[Sample]:
    """Return the samples of several streams by time. Each stream comes with a time before which it has no sample.

    It is begun when this time is reached, since each stream that was begun has samples in memory. Samples of one time
    are in the order of the streams.
    """
    if len(streams) == 1:  # as fast as the stream alone
        return streams[0][1]
    found = merge(*(_from(*each) for each in streams), key=lambda each: (each.time, type(each) is Sample))
    return (sample for sample in found if type(sample) is Sample)


class _Begin(Sample):
    """The time before which a stream has no sample."""


def _from(first: int, stream: Iterator[Sample]) -> Iterator[Sample]:
    """Yield where a stream begins, and its samples: `merge` takes the first of them when it has come to that time."""
    yield _Begin("", first, b"")
    yield from stream


class Encoder(NamedTuple):
    """What makes CDR of the samples of a channel."""

    rows: Callable[[Part], Decoded]
    encode: Callable[[NDArray[np.void]], Octets]
    """Returns an array of bytes with a row for each sample."""


def as_cdr(parts: Iterable[Part], encoders: Mapping[int, Encoder]) -> Iterator[Part]:
    """Yield samples as CDR: those of channels that have an encoder are encoded, the others are CDR."""
    for part in parts:
        encoder = encoders.get(part.channel)
        if encoder is None:
            yield part
            continue
        rows, kept = encoder.rows(part)
        if not len(rows):
            continue
        payloads = encoder.encode(rows)
        count, size = payloads.shape
        times = part.log_times if kept is None else part.log_times[kept]
        starts = np.arange(count, dtype=np.int64) * size
        yield part._replace(
            buffer=payloads.ravel(), starts=starts, sizes=np.full(count, size), log_times=times, publish_times=None
        )


def in_order(
    parts: Iterable[Part],
    times: Mapping[int, NDArray[np.int64]],
    names: Mapping[int, str],
    start: int,
    stop: int,
) -> Iterator[Sample]:
    """Yield samples of a file by log time, those from `start` up to `stop`. Those of one time are in the file's order.

    `times` are the log times of all samples of each channel, and `names` its topic. A part is kept until no earlier
    sample can follow it, as these times tell.
    """
    coming = {number: _Coming(own, start, stop) for number, own in times.items()}
    waiting: list[tuple[int, int, int, Sample]] = []
    """Samples after their time, the number of their buffer, and their place in it."""
    queue = [(each.earliest, number) for number, each in coming.items()]
    heapify(queue)
    reached, buffer = start, 0
    of_buffer: set[int] = set()
    for part in parts:
        if part.channel in of_buffer:
            buffer += 1
            of_buffer.clear()
        of_buffer.add(part.channel)
        topic, data = names[part.channel], part.buffer.data
        for time, place, size in zip(part.log_times.tolist(), part.starts.tolist(), part.sizes.tolist(), strict=True):
            waiting.append((time, buffer, place, Sample(topic, time, bytes(data[place : place + size]))))
        coming[part.channel].take(part.log_times)
        while queue[0][0] < coming[queue[0][1]].earliest:  # these times only grow
            heapreplace(queue, (coming[queue[0][1]].earliest, queue[0][1]))
        if queue[0][0] > reached:
            reached = queue[0][0]
            waiting.sort()
            count = bisect_left(waiting, (reached,))
            yield from (sample for *_, sample in waiting[:count])
            del waiting[:count]
    yield from (sample for *_, sample in sorted(waiting))


class _Coming:
    """The times of a channel, in the order of the file, and how many of them were read."""

    def __init__(self, times: NDArray[np.int64], start: int, stop: int) -> None:
        self._times = times[(times >= start) & (times < stop)]
        self._lowest = np.minimum.accumulate(self._times[::-1])[::-1]
        self._count = 0

    @property
    def earliest(self) -> int:
        """The earliest time that is still to come."""
        return int(self._lowest[self._count]) if self._count < len(self._lowest) else FOREVER

    def take(self, times: NDArray[np.int64]) -> None:
        """Count the samples of a part. Those that a damaged file has lost before its last sample are skipped."""
        last = self._count + len(times) - 1
        found = np.flatnonzero(self._times[last:] == times[-1])[:1].tolist()
        self._count = last + 1 + sum(found)
