"""MCAP files without an index, cut off or damaged: searched from the beginning."""

from __future__ import annotations

import struct
from collections import defaultdict
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.files.mcap.chunks import limited, records_of
from msggen.recordings.files.mcap.layouts import FRONT, MAGIC, RECORD
from msggen.recordings.files.mcap.messages import finder_in, records_in, searched
from msggen.recordings.files.mcap.records import (
    ATTACHMENT,
    CHUNK,
    DATA_END,
    FOOTER,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    STATISTICS,
    Chunk,
    Loose,
    chunk_at,
    chunk_or_message_from,
    entries_of,
    lengths_of,
    opcodes_of,
    statistics_of,
    steps,
)
from msggen.recordings.source.gather import at, walk
from msggen.recordings.source.memory import drop_pages

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.files.compression import Room
    from msggen.recordings.files.mcap.channels import Described
    from msggen.recordings.source.memory import Octets
    from msggen.recordings.source.source import Channel

    Times = Mapping[int, Sequence[NDArray[np.int64]]]

_SIZES = {DATA_END: 4, FOOTER: 20}


def scan(
    file: Octets, described: Described, summarized: Mapping[int, Channel], room: Room, *, is_damaged: bool
) -> tuple[Sequence[Chunk | Loose], Times, Mapping[int, int]]:
    """Find chunks, messages and channels. `summarized` has the channels of the summary, also those of lost chunks.

    Return the regions of the file, the times of the messages that no message index has, and the number of messages of
    each channel in the statistics, as far as there are any behind the messages.

    If `is_damaged`, message indexes are not used: one may be missing.
    """
    if is_damaged:
        described.report("the summary at the end is damaged or does not fit the file, which is searched instead")
    found = _Scan(file, described, uses_indexes=not is_damaged)
    regions = limited(found.regions(), room, described)
    described.lacks_channels = True
    for region in regions:
        if isinstance(region, Chunk) and not (region.indexes and region.indexes.keys() <= described.channels.keys()):
            _take_channels(file, region, described)
    described.channels = {**summarized, **described.channels}
    described.lacks_channels = False
    for region in regions:
        if isinstance(region, Chunk) and described.checks.error_of(region):
            described.report_damaged(file, region)
    regions = [_trusted(region, described) for region in regions]
    times: dict[int, list[NDArray[np.int64]]] = defaultdict(list)
    for region in regions:
        if isinstance(region, Loose) or not region.indexes:
            data = file if isinstance(region, Loose) else records_of(file, region, described)
            for part in searched(data, region, described.channels.keys(), described):
                times[part.channel].append(part.log_times.copy())
    return regions, times, found.counts


def _trusted(region: Chunk | Loose, described: Described) -> Chunk | Loose:
    """Return a region, a chunk without its message indexes if one of them has a channel that the file does not have."""
    if isinstance(region, Loose) or region.indexes.keys() <= described.channels.keys():
        return region
    described.report("the message index does not fit the chunk, which is searched instead", region.start)
    return region._replace(indexes={})


def _take_channels(file: Octets, chunk: Chunk, described: Described) -> None:
    """Take the channels within a chunk."""
    data = records_of(file, chunk, described)
    raw = data.data
    for starts in records_in(data, chunk, described):
        heads = at(data, "<u8")[starts]
        for index in np.flatnonzero(opcodes_of(heads) != MESSAGE).tolist():
            start = int(starts[index])
            opcode, length = RECORD.unpack_from(raw, start)
            described.take_or_report(raw, opcode, start + FRONT, length)


def _counts_from(data: memoryview, place: int) -> Mapping[int, int]:
    """Return the number of messages of each channel in the statistics behind an offset."""
    for opcode, start, length in steps(data, place, len(data)):
        if opcode == STATISTICS:
            with suppress(struct.error):
                return statistics_of(bytes(data[start : start + length]))[2]
    return {}


class _Scan:
    """One pass over a file."""

    def __init__(self, file: Octets, described: Described, *, uses_indexes: bool) -> None:
        self._file = file
        self._uses_indexes = uses_indexes
        self._data = file.data
        self._described = described
        self._regions: list[Chunk | Loose] = []
        self._chunk: Chunk | None = None
        """The chunk whose message indexes may follow."""
        self._indexes: dict[int, int] | None = None
        """Its message indexes so far, None if one of them is wrong."""
        self.counts: Mapping[int, int] = {}
        """The number of messages of each channel in the statistics."""

    def regions(self) -> list[Chunk | Loose]:
        """Return the regions of the file, in order."""
        place, size = len(MAGIC), self._file.size
        while True:
            end = self._records_from(place)
            self._end_chunk(has_all_indexes=end is None)
            if end is None:
                break
            place = chunk_or_message_from(self._data, end + 1, self._described.channels)
            if place >= size:
                self._described.report("the file has no end: it is cut off or damaged", end, size - end)
                break
            self._described.report("the file is damaged", end, place - end)
        return self._regions

    def _records_from(self, place: int) -> int | None:
        """Take the records from `place` on. Return where they make no sense any more, None at the regular end."""
        size = self._file.size
        while place + FRONT <= size:
            opcode, length = RECORD.unpack_from(self._data, place)
            start, end = place + FRONT, place + FRONT + length
            if opcode in _SIZES and length == _SIZES[opcode] and end <= size:
                self.counts = _counts_from(self._data, end)
                return None
            if opcode == CHUNK:
                chunk = chunk_at(self._data, start, length)
                if chunk is None:
                    return place
                self._end_chunk()
                self._chunk, self._indexes = chunk, {}
            elif opcode in (0, DATA_END, FOOTER) or end > size:
                return place
            elif opcode == MESSAGE:
                self._indexes = None  # it may have been a message index
                self._end_chunk()
                end = self._take_loose(place)
            elif opcode == MESSAGE_INDEX:
                self._take_index(place)
            else:
                self._indexes = None  # likewise
                self._take(opcode, start, length)
            place = end
        return min(place, size)

    def _take(self, opcode: int, start: int, length: int) -> None:
        if opcode in (ATTACHMENT, METADATA):
            self._described.take_attached(self._data, opcode, start, length)
        else:
            self._described.take_or_report(self._data, opcode, start, length)

    def _end_chunk(self, *, has_all_indexes: bool = True) -> None:
        """Add a chunk. If it is cut off, or its message indexes are wrong or perhaps not all, it is to be searched."""
        chunk = self._chunk
        drop_pages(self._file)
        if chunk is not None:
            is_trusted = self._uses_indexes and has_all_indexes and chunk.records + chunk.stored <= self._file.size
            self._regions.append(chunk._replace(indexes=(self._indexes or {}) if is_trusted else {}))
        self._chunk = None

    def _take_index(self, place: int) -> None:
        """Take the message index of a chunk. One that is wrong or that the chunk has twice spoils them all."""
        if self._chunk is None or self._indexes is None:
            return
        (number,) = struct.unpack_from("<H", self._data, place + FRONT) if place + 11 <= self._file.size else (0,)
        if entries_of(self._file, number, place) is None or number in self._indexes:
            self._indexes = None
        else:
            self._indexes[number] = place

    def _take_loose(self, place: int) -> int:
        """Take messages outside of chunks, and what is between them. Return where they end."""
        end = place
        for stretch in walk(self._file, place, self._file.size, lengths_of, finder_in(self._data)):
            opcodes = opcodes_of(stretch.heads)
            end = stretch.end
            for index in np.flatnonzero(opcodes != MESSAGE).tolist():
                opcode, start = int(opcodes[index]), int(stretch.starts[index])
                if opcode in (CHUNK, DATA_END, FOOTER):
                    self._regions.append(Loose(place, start))
                    return start
                _, length = RECORD.unpack_from(self._data, start)
                self._take(opcode, start + FRONT, length)
        self._regions.append(Loose(place, end))
        return end
