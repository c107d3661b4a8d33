"""The summary at the end of an MCAP file, which has an index of its chunks."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.files.mcap.checksums import crc32
from msggen.recordings.files.mcap.chunks import fetch_heads
from msggen.recordings.files.mcap.layouts import ENTRY, FRONT, INDEX_FRONT, MAGIC
from msggen.recordings.files.mcap.records import (
    ATTACHMENT,
    CHUNK,
    CHUNK_INDEX,
    CRC,
    DATA_END,
    FOOTER,
    MESSAGE,
    METADATA,
    STATISTICS,
    Chunk,
    chunk_in,
    fits,
    statistics_of,
    steps,
)
from msggen.recordings.source.gather import WINDOW
from msggen.recordings.source.memory import drop_pages

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from msggen.recordings.files.mapped import MappedFile
    from msggen.recordings.files.mcap.channels import Described
    from msggen.recordings.source.memory import Octets

_TAIL = 1 << 16
"""The bytes at the end of a file in a store that are fetched first: small summaries fit."""
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
_END = _FOOTER.size + len(MAGIC)
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
    footer = _footer_of(data)
    if footer is None:
        return Summary(None, {})
    opcode, start_of_summary, crc = footer
    if opcode != FOOTER or not len(MAGIC) <= start_of_summary < size - _END:
        return Summary(None, {}, is_damaged=opcode != FOOTER or start_of_summary != 0)
    mapped.need([(start_of_summary, size)])
    chunks, (message_count, chunk_count, counts) = _records_of(data, start_of_summary, described)
    index_count = sum(len(chunk.indexes) for chunk in chunks)
    if sum(chunk.index_size for chunk in chunks) != index_count * INDEX_FRONT + message_count * ENTRY:
        if is_partial:
            return Summary(None, counts)
        chunks = [chunk._replace(index_size=0) for chunk in chunks]  # they are stepped over one by one
    fetch_heads(mapped, (*chunks[:1], *chunks[-1:]))
    is_right = described.checks.accepts(data[start_of_summary : size - len(MAGIC) - CRC], crc)
    is_whole = (
        is_right
        and chunk_count == len(chunks)
        and message_count == sum(counts.values())
        and counts.keys() <= described.channels.keys()
        and not described.lacks_schemas
        and all(fits(data, chunk) for chunk in (*chunks[:1], *chunks[-1:]))
        and _has_only(mapped, chunks, start_of_summary, described)
    )
    if is_whole:
        return Summary(chunks, counts)
    return Summary(None, counts, is_damaged=not (is_right and _is_whole(data, start_of_summary)))


def _footer_of(data: memoryview) -> tuple[int, int, int] | None:
    """Return what is in the place of a footer: opcode, offset of the summary, CRC. None if a file does not end."""
    if len(data) < len(MAGIC) + _END or data[-len(MAGIC) :] != MAGIC:
        return None
    opcode, _, start_of_summary, _, crc = _FOOTER.unpack_from(data, len(data) - _END)
    return opcode, start_of_summary, crc


def _records_of(
    data: memoryview, start_of_summary: int, described: Described
) -> tuple[list[Chunk], tuple[int, int, dict[int, int]]]:
    """Return the chunks and the statistics, up to a record that is wrong. `described` takes schemas and channels."""
    chunks: list[Chunk] = []
    statistics: tuple[int, int, dict[int, int]] = -1, -1, {}
    for opcode, start, length in steps(data, start_of_summary, len(data) - len(MAGIC)):
        try:
            if opcode == CHUNK_INDEX:
                chunks.append(_indexed_chunk(data, start, length))
            elif opcode == STATISTICS:
                statistics = statistics_of(bytes(data[start : start + length]))
            else:
                described.take(data, opcode, start, length)
        except (struct.error, ValueError):
            break
    return chunks, statistics


def differing_sections(file: Octets) -> Iterator[str]:
    """Yield which of the two sections of a whole file differ from the CRCs that they have."""
    for name, begins, stop, crc in _sections(file.data):
        if crc and all(_crc_between(file, begin, stop) != crc for begin in begins):
            yield name


def _sections(data: memoryview) -> Iterator[tuple[str, Sequence[int], int, int]]:
    """Yield the name of each section, where it may begin, where it ends, and its CRC."""
    footer = _footer_of(data)
    if footer is None:
        return
    end = len(data) - _END
    opcode, start_of_summary, crc = footer
    if opcode != FOOTER or not (start_of_summary == 0 or len(MAGIC) <= start_of_summary <= end):
        return
    if start_of_summary:
        yield "the summary at the end", (start_of_summary,), len(data) - len(MAGIC) - CRC, crc
    place = (start_of_summary or end) - _DATA_END.size
    if place >= len(MAGIC):
        opcode, length, crc = _DATA_END.unpack_from(data, place)
        if (opcode, length) == (DATA_END, CRC):
            # the magic bytes are not in the section, and yet most programs count them
            yield "the data section", (0, len(MAGIC)), place, crc


def _crc_between(file: Octets, start: int, stop: int) -> int:
    """Return the CRC-32 of some bytes of a file, which are not kept in memory."""
    crc = 0
    for place in range(start, stop, WINDOW):
        crc = crc32(file[place : min(place + WINDOW, stop)], crc)
        drop_pages(file)
    return crc


def _is_whole(data: memoryview, start_of_summary: int) -> bool:
    """Whether records from an offset on lead exactly to the end of a file."""
    end = start_of_summary
    for _, start, length in steps(data, start_of_summary, len(data) - len(MAGIC)):
        end = start + length
    return end == len(data) - len(MAGIC)


def _indexed_chunk(data: memoryview, start: int, length: int) -> Chunk:
    """Return the chunk that a chunk index names. It is not read. Raises ValueError, and struct.error."""
    chunk = chunk_in(data[start : start + length])
    if chunk.start + chunk.length > len(data):
        raise ValueError(start)
    if not chunk.indexes and chunk.size:  # an index without message indexes is of no use
        raise ValueError(start)
    return chunk


def _has_only(mapped: MappedFile, chunks: Sequence[Chunk], stop: int, described: Described) -> bool:
    """Whether there is no other chunk, and no message outside of them. `described` takes what is attached.

    The message indexes behind the chunks are skipped.
    """
    data = mapped.octets.data
    place = len(MAGIC)
    spans = [(chunk.start - FRONT, chunk.start + chunk.length + chunk.index_size) for chunk in chunks]
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
