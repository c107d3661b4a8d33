"""Samples that are compressed one by one, each a frame of zstd, as rosbag2 writes them on request."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.files.compression import LARGEST, ZSTD, CompressionError, Room, decompress_frame
from msggen.recordings.source.source import Channel, Part, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_BATCH = 16 << 20
"""The bytes of samples that are decompressed at a time, unless one sample is larger."""


class Frames:
    """The samples of a file without their compression. What cannot be decompressed is added to `problems`.

    Samples are decompressed if `is_by_sample`, or from the first part on that begins with a frame of zstd.
    """

    def __init__(self, room: Room, problems: list[Problem], *, is_by_sample: bool) -> None:
        self._room = room
        self._problems = problems
        self._is_by_sample = is_by_sample
        """Whether samples are compressed, as far as it is known yet."""
        self._taken: Counter[int] = Counter()
        """The bytes that the samples of each channel have taken of the room. Reading them again takes nothing."""
        self._lost: set[tuple[int, int]] = set()
        """The channels and the log times of samples that cannot be decompressed, which are counted once."""
        self._places: dict[str, int] = {}
        """Where the problem with them is among all, by topic: a folder can have one for each name in metadata.yaml."""

    def unpacked(self, parts: Iterable[Part], channels: Mapping[int, Channel]) -> Iterator[Part]:
        """Yield parts of channels without the compression of single samples."""
        used: Counter[int] = Counter()
        for part in parts:
            channel = channels[part.channel]
            is_cdr = channel.is_cdr  # others may be frames of their own
            self._is_by_sample = self._is_by_sample or (is_cdr and _begins_with_frame(part))
            if self._is_by_sample and is_cdr:
                yield from self._unpacked(part, channel.topic, used)
            else:
                yield part

    def _unpacked(self, part: Part, topic: str, used: Counter[int]) -> Iterator[Part]:
        """Yield the samples of a part without compression. `used` counts the bytes of this reading by channel.

        Those without a frame of zstd stay as they are.
        """
        data = part.buffer.data
        kept: list[int] = []
        samples: list[bytes] = []
        size = spent = 0
        room = self._room_for(part.channel, used)
        for index, (start, length) in enumerate(zip(part.starts.tolist(), part.sizes.tolist(), strict=True)):
            sample = bytes(data[start : start + length])
            if sample.startswith(ZSTD):
                try:
                    sample = decompress_frame(sample, min(room - spent, LARGEST))
                    spent += len(sample)
                except CompressionError as error:
                    spent += error.spent
                    self._leave_out(part.channel, topic, int(part.log_times[index]), str(error))
                    continue
            kept.append(index)
            samples.append(sample)
            size += len(sample)
            if size >= _BATCH:
                self._take(part.channel, spent, used)
                yield _part_of(part, kept, samples)
                kept, samples, size, spent = [], [], 0, 0
                room = self._room_for(part.channel, used)
        self._take(part.channel, spent, used)
        if kept:
            yield _part_of(part, kept, samples)

    def _room_for(self, number: int, used: Counter[int]) -> int:
        """Return how many bytes the next samples of a channel may have."""
        return self._room.left + max(self._taken[number] - used[number], 0)

    def _take(self, number: int, size: int, used: Counter[int]) -> None:
        """Take samples of a channel from the room, as far as no reading before has taken them."""
        used[number] += size
        self._room.take(max(used[number] - self._taken[number], 0))
        self._taken[number] = max(used[number], self._taken[number])

    def _leave_out(self, number: int, topic: str, time: int, text: str) -> None:
        """Count a sample that cannot be decompressed."""
        if (number, time) in self._lost:
            return
        self._lost.add((number, time))
        place = self._places.setdefault(topic, len(self._problems))
        if place == len(self._problems):
            self._problems.append(Problem(f"samples that cannot be decompressed: {text}", topic=topic))
        problem = self._problems[place]
        self._problems[place] = problem._replace(samples=problem.samples + 1)


def _part_of(part: Part, kept: list[int], samples: list[bytes]) -> Part:
    chosen = np.array(kept, np.intp)
    sizes = np.fromiter(map(len, samples), np.int64, len(samples))
    published = None if part.publish_times is None else part.publish_times[chosen]
    buffer = np.frombuffer(b"".join(samples), np.uint8)
    return Part(part.channel, buffer, np.cumsum(sizes) - sizes, sizes, part.log_times[chosen], published)


def _begins_with_frame(part: Part) -> bool:
    """Whether the first sample of a part is a frame of zstd, which cannot be the beginning of CDR."""
    start, size = int(part.starts[0]), int(part.sizes[0])
    return size >= len(ZSTD) and bytes(part.buffer.data[start : start + len(ZSTD)]) == ZSTD
