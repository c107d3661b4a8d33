"""The summary at the end of an MCAP file, which has an index of its chunks."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.files.mcap_records import (
    ATTACHMENT,
    CHUNK,
    CHUNK_INDEX,
    CRC,
    ENTRY,
    FOOTER,
    FRONT,
    INDEX_FRONT,
    LARGEST_NUMBER,
    MAGIC,
    MESSAGE,
    METADATA,
    RECORD,
    STATISTICS,
    Chunk,
    chunk_at,
    statistics_of,
    steps,
    told_chunk,
)
from msggen.recordings.source.memory import drop_pages

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from msggen.recordings.files.mapped import MappedFile
    from msggen.recordings.files.mcap_channels import Described

_TAIL = 1 << 16
"""The bytes at the end of a file in a store that are fetched first: small summaries fit."""
_END = FRONT + 20 + len(MAGIC)
"""The size of the footer and of the magic bytes after it."""


class Summary(NamedTuple):
    """The contents of a summary. Channels are taken by `Described`."""

    chunks: Sequence[Chunk] | None
    """The chunks with their message indexes. None if they are not all messages, or if anything is contradictory."""
    counts: Mapping[int, int]
    """The number of messages of each channel in the statistics."""
    is_damaged: bool = False
    """Whether a file that is not cut off has no whole summary where it should be: bytes were changed or lost."""


def read_summary(mapped: MappedFile, described: Described) -> Summary:
    """Read the summary of a file. Of one in a store, only what it needs is fetched, and anything odd is no summary."""
    data = mapped.octets.data
    size = len(data)
    is_partial = mapped.is_partial
    mapped.need([(size - _TAIL, size)])
    if size < len(MAGIC) + _END or data[-len(MAGIC) :] != MAGIC:
        return Summary(None, {})
    opcode, _, start_of_summary, _, crc = struct.unpack_from("<BQQQI", data, size - _END)
    if opcode != FOOTER or not len(MAGIC) <= start_of_summary < size - _END:
        return Summary(None, {}, is_damaged=opcode != FOOTER or start_of_summary != 0)
    mapped.need([(start_of_summary, size)])
    chunks: list[Chunk] = []
    index_sizes: list[int] = []
    counts: dict[int, int] = {}
    chunk_count = message_count = -1
    for opcode, start, length in steps(data, start_of_summary, size - len(MAGIC)):
        try:
            if opcode == CHUNK_INDEX:
                chunk, index_size = _indexed_chunk(data, start, length, is_partial=is_partial)
                chunks.append(chunk)
                index_sizes.append(index_size)
                drop_pages(data)
            elif opcode == STATISTICS:
                message_count, chunk_count, counts = statistics_of(bytes(data[start : start + length]))
            else:
                described.take(data, opcode, start, length)
        except (struct.error, ValueError):
            break
    index_count = sum(len(chunk.indexes) for chunk in chunks)
    if sum(index_sizes) != index_count * INDEX_FRONT + message_count * ENTRY:
        index_sizes = [0] * len(chunks)
        if is_partial:
            return Summary(None, counts)
    is_right = described.checks.accepts(data[start_of_summary : size - len(MAGIC) - CRC], crc)
    is_whole = (
        is_right
        and chunk_count == len(chunks)
        and message_count == sum(counts.values())
        and counts.keys() <= described.channels.keys()
        and not described.lacks_schemas
        and _has_only(mapped, chunks, index_sizes, start_of_summary, described)
    )
    if is_whole:
        return Summary(chunks, counts)
    return Summary(None, counts, is_damaged=not (is_right and _is_whole(data, start_of_summary)))


def _is_whole(data: memoryview, start_of_summary: int) -> bool:
    """Whether records from an offset on lead exactly to the end of a file."""
    end = start_of_summary
    for _, start, length in steps(data, start_of_summary, len(data) - len(MAGIC)):
        end = start + length
    return end == len(data) - len(MAGIC)


def _indexed_chunk(data: memoryview, start: int, length: int, *, is_partial: bool) -> tuple[Chunk, int]:
    """Return the chunk that a chunk index names, and the size of its message indexes.

    If `is_partial`, the chunk itself is not read. Raises ValueError, and struct.error.
    """
    record = data[start : start + length]
    first, last, offset, whole, size = struct.unpack_from("<QQQQI", record)
    if offset + whole > len(data):
        raise ValueError(offset)
    indexes = dict(struct.iter_unpack("<HQ", record[36 : 36 + size]))
    (index_size,) = struct.unpack_from("<Q", record, 36 + size)
    if is_partial:
        chunk = told_chunk(record, 44 + size, offset + FRONT, whole - FRONT)
    else:
        opcode, content = RECORD.unpack_from(data, offset)
        chunk = chunk_at(data, offset + FRONT, content) if opcode == CHUNK and content + FRONT == whole else None
    if chunk is None or (not indexes and chunk.size):  # an index without message indexes is of no use
        raise ValueError(offset)
    first, last = min(first, LARGEST_NUMBER), min(last, LARGEST_NUMBER)
    return chunk._replace(first=first, last=last, indexes=indexes, index_size=index_size), index_size


def _has_only(
    mapped: MappedFile, chunks: Sequence[Chunk], index_sizes: Sequence[int], stop: int, described: Described
) -> bool:
    """Whether there is no other chunk, and no message outside of them. `described` takes what is attached.

    The message indexes behind the chunks are stepped over, each in its `index_sizes`.
    """
    data = mapped.octets.data
    place = len(MAGIC)
    spans = [
        (chunk.start - FRONT, chunk.start + chunk.length + size)
        for chunk, size in zip(chunks, index_sizes, strict=True)
    ]
    for begin, end in (*spans, (stop, stop)):
        mapped.need([(place, min(place + FRONT, begin))])
        for opcode, start, length in steps(data, place, begin):
            if opcode in (MESSAGE, CHUNK):
                return False
            mapped.need([(start + length, min(start + length + FRONT, begin))])  # `steps` reads the next head later
            if opcode in (ATTACHMENT, METADATA):
                mapped.need([(start, start + length if opcode == METADATA else start)])
                described.take_attached(data, opcode, start, length)
            place = start + length
        if place != begin:
            return False
        place = end
        drop_pages(data)
    return True
