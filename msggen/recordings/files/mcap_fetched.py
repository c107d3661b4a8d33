"""The chunks of an MCAP file in a store, which are fetched before they are read."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING

from msggen.recordings.files.mcap_records import (
    CHUNK,
    CHUNK_FRONT,
    FRONT,
    RECORD,
    UNREAD,
    Chunk,
    Loose,
    chunk_at,
    index_ranges,
)
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msggen.recordings.files.mapped import MappedFile

Group = Sequence[Chunk] | Loose
_LARGEST_STEP = 32 << 20
"""The most bytes that are fetched ahead. Each step is twice as large as the last: a user may want the first samples."""


class Fetched:
    """The chunks of a file. Those of a file on this computer are there."""

    def __init__(self, mapped: MappedFile) -> None:
        self._mapped = mapped
        self._crcs: dict[int, int] = {}
        """The CRCs of chunks that were fetched, by their offsets."""

    def present(self, chunks: Sequence[Chunk]) -> Sequence[Chunk]:
        """Return chunks with their CRCs, when they and their message indexes are there.

        Raises RecordingError if one is not what the index of the file tells, and OSError.
        """
        if all(chunk.crc != UNREAD for chunk in chunks):
            return chunks
        self._mapped.need(map(_range, chunks))
        offsets = (offset for chunk in chunks for offset in chunk.indexes.values())
        self._mapped.need(index_ranges(self._mapped.octets.data, offsets))
        return [chunk._replace(crc=self._crc(chunk)) for chunk in chunks]

    def expected(self, chunks: Sequence[Chunk]) -> Iterator[Chunk]:
        """Yield chunks with their CRCs. Those that were not fetched are as the first: writers give all one, or none."""
        for chunk in chunks[:1]:
            self._mapped.need([(chunk.start - FRONT, min(chunk.start + CHUNK_FRONT, chunk.start + chunk.length))])
        crc = self._crc(chunks[0]) if chunks else 0
        for chunk in chunks:
            yield chunk._replace(crc=self._crcs.get(chunk.start, crc)) if chunk.crc == UNREAD else chunk

    def in_steps(self, groups: Sequence[Group]) -> Iterator[Sequence[Group]]:
        """Yield groups, as many at a time as are fetched together. Those that are there are one step."""
        begin, most = 0, 0
        while begin < len(groups):
            end = len(groups)
            if self._mapped.is_partial:
                most = min(max(2 * most, _size(groups[begin])), _LARGEST_STEP)
                sizes = accumulate(map(_size, groups[begin:]))
                end = begin + max(sum(size <= most for size in sizes), 1)
                self._mapped.need(_range(chunk) for group in groups[begin:end] for chunk in _chunks(group))
            yield groups[begin:end]
            begin = end

    def _crc(self, chunk: Chunk) -> int:
        if chunk.crc != UNREAD:
            return chunk.crc
        if chunk.start not in self._crcs:
            data = self._mapped.octets.data
            opcode, length = RECORD.unpack_from(data, chunk.start - FRONT)
            found = chunk_at(data, chunk.start, chunk.length) if (opcode, length) == (CHUNK, chunk.length) else None
            if found is None or _told(found) != _told(chunk):
                text = "has an index that does not fit its chunks: copy the file to this computer and read it there"
                raise RecordingError(f"{self._mapped.shown} {text}")
            self._crcs[chunk.start] = found.crc
        return self._crcs[chunk.start]


def _range(chunk: Chunk) -> tuple[int, int]:
    """Return where a chunk and its message indexes are."""
    return chunk.start - FRONT, chunk.start + chunk.length + chunk.index_size


def _chunks(group: Group) -> Sequence[Chunk]:
    return () if isinstance(group, Loose) else group


def _size(group: Group) -> int:
    return sum(stop - start for start, stop in map(_range, _chunks(group)))


def _told(chunk: Chunk) -> tuple[str, int, int, int]:
    """Return what both a chunk and its index tell."""
    return chunk.kind, chunk.records, chunk.stored, chunk.size
