"""The records of MCAP (https://mcap.dev/spec): where they are, what they hold, and where a damaged file has some."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.compression import LARGEST
from msggen.recordings.files.mcap.layouts import CHUNK_HEAD, ENTRY, FRONT, HEAD, INDEX_FRONT, INDEX_HEAD, RECORD
from msggen.recordings.source.gather import at
from msggen.recordings.source.source import Attached

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets, Places

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS = 2, 3, 4, 5, 6, 7, 8, 11
ATTACHMENT, METADATA, DATA_END = 9, 12, 15
LAST_OPCODE = 15
CHANNEL_AT = 9
"""Where the channel of a message is in its record."""
HEADS = np.dtype(
    {
        "names": ["opcode", "length", "channel", "log", "publish"],
        "formats": ["u1", "<i8", "<u4", "<u8", "<u8"],
        "offsets": [0, 1, 7, 15, 23],
        "itemsize": HEAD,
    }
)
"""A message record before its payload. `channel` begins with the upper two bytes of the length, which are 0."""
HEAD_BYTES = np.dtype(f"V{HEAD}")
INDEX_HEADS = np.dtype(
    {"names": ["opcode", "length", "channel", "size"], "formats": ["u1", "<u8", "<u2", "<u4"], "offsets": [0, 1, 9, 11]}
)
"""A message index before its entries."""
_INDEX_REST = INDEX_FRONT - FRONT
CRC = 4
"""The size of the CRC at the end of an attachment."""
_CHUNK_CRC = struct.Struct("<I")
_CHUNK_INDEX = struct.Struct("<QQQQI")
"""The front of a chunk index."""
_CHUNK_BEGINS = re.compile(rb"\x06.{36}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd)", re.DOTALL)
CHUNK_FRONT = 45
"""The most bytes that this takes."""
_STEP = 1 << 9
"""The bytes that are searched first for a chunk or a message."""
_MESSAGE_BEGINS = re.compile(rb"\x05.{3}\x00{5}", re.DOTALL)
"""Where a message of less than 16 MiB may begin."""
LARGEST_NUMBER = (1 << 62) - 1
"""The largest time and length that are believed. Later times, from the year 2116 on, are read as this one."""


class Chunk(NamedTuple):
    """A chunk of a file."""

    start: int
    """The offset of its content in the file."""
    length: int
    """The size of its content in bytes. It can end behind a file that is cut off."""
    first: int
    last: int
    """The log times of the first and the last message, in ns."""
    kind: str
    """The compression."""
    records: int
    """The offset of its records in the file."""
    stored: int
    """The size of its records in the file."""
    size: int
    """The size of its records without the compression."""
    indexes: Mapping[int, int]
    """The offset of the message index of each channel. Without one, the chunk is searched."""
    limit: int = LARGEST
    """How many of its records are read, in bytes without the compression."""
    index_size: int = 0
    """The size of its message indexes, which follow its content, if the index of chunks tells it."""


class Loose(NamedTuple):
    """Messages that are in no chunk."""

    start: int
    stop: int


def steps(data: memoryview, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, offset of the content, and length of the records up to `stop`, as far as they are whole."""
    while start + FRONT <= stop:
        opcode, length = RECORD.unpack_from(data, start)
        if start + FRONT + length > stop:
            return
        yield opcode, start + FRONT, length
        start += FRONT + length


def chunk_at(data: memoryview, start: int, length: int) -> Chunk | None:
    """Return the chunk whose content is at `start`, None if its lengths contradict each other. It has no indexes."""
    try:
        first, last, size, _ = CHUNK_HEAD.unpack_from(data, start)
        kind, place = text_at(data, start + CHUNK_HEAD.size)
        (stored,) = struct.unpack_from("<Q", data, place)
    except (struct.error, ValueError):
        return None
    first, last = min(first, LARGEST_NUMBER), min(last, LARGEST_NUMBER)
    chunk = Chunk(start, length, first, last, kind, place + 8, stored, size, {})
    return chunk if _is_sound(chunk) else None


def crc_of(data: memoryview, chunk: Chunk) -> int:
    """Return the CRC-32 of the records of a chunk, 0 if there is none."""
    crc: int = _CHUNK_CRC.unpack_from(data, chunk.start + CHUNK_HEAD.size - _CHUNK_CRC.size)[0]
    return crc


def fits(data: memoryview, chunk: Chunk) -> bool:
    """Whether a chunk begins as an index of chunks tells: this is not read before its samples are."""
    found = chunk_at(data, chunk.start, chunk.length)
    return found is not None and (found.kind, found.stored, found.size) == (chunk.kind, chunk.stored, chunk.size)


def chunk_in(record: memoryview) -> Chunk:
    """Return the chunk that a chunk index tells. Raises ValueError for contradictions, and struct.error."""
    first, last, offset, whole, size = _CHUNK_INDEX.unpack_from(record)
    place = _CHUNK_INDEX.size
    indexes = dict(struct.iter_unpack("<HQ", record[place : place + size]))
    (index_size,) = struct.unpack_from("<Q", record, place + size)
    kind, place = text_at(record, place + size + 8)
    stored, content = struct.unpack_from("<QQ", record, place)
    first, last = min(first, LARGEST_NUMBER), min(last, LARGEST_NUMBER)
    records = offset + FRONT + CHUNK_HEAD.size + 4 + len(kind.encode()) + 8
    chunk = Chunk(
        start=offset + FRONT,
        length=whole - FRONT,
        first=first,
        last=last,
        kind=kind,
        records=records,
        stored=stored,
        size=content,
        indexes=indexes,
        index_size=index_size,
    )
    if not _is_sound(chunk):
        raise ValueError(offset)
    return chunk


def _is_sound(chunk: Chunk) -> bool:
    """Whether the sizes of a chunk do not contradict each other, and its compression is known."""
    is_right = chunk.records + chunk.stored == chunk.start + chunk.length and (chunk.kind or chunk.size == chunk.stored)
    return bool(is_right) and chunk.kind in ("", "lz4", "zstd")


def index_ranges(data: memoryview, offsets: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield where the message indexes at offsets are, by their heads."""
    for offset in offsets:
        if offset + INDEX_FRONT <= len(data):
            opcode, _, _, size = INDEX_HEAD.unpack_from(data, offset)
            if opcode == MESSAGE_INDEX:
                yield offset, offset + INDEX_FRONT + size


def entries_of(file: Octets, number: int, offset: int) -> Octets | None:
    """Return the message index of a channel at an offset, as `entries_at` does for several."""
    start = offset + INDEX_FRONT
    if start > file.size:
        return None
    opcode, length, channel, size = INDEX_HEAD.unpack_from(file.data, offset)
    if opcode != MESSAGE_INDEX or channel != number or size % ENTRY or length != size + _INDEX_REST:
        return None
    return file[start : start + size] if start + size <= file.size else None


def entries_at(file: Octets, numbers: Sequence[int], offsets: Sequence[int]) -> list[Octets] | None:
    """Return the message indexes of channels at offsets, each pairs of log time and offset. None if one is wrong.

    All are checked together: each step costs, whatever its size.
    """
    places = np.array(offsets, np.uint64)
    if not places.size:
        return []
    if int(places.max()) + INDEX_FRONT > file.size:
        return None
    starts = places.view(np.int64)
    heads = at(file, INDEX_HEADS)[starts]
    sizes = heads["size"].astype(np.uint64)
    starts += INDEX_FRONT
    stops = starts + sizes.view(np.int64)
    if (
        (heads["opcode"] != MESSAGE_INDEX).any()
        or (heads["channel"] != np.array(numbers, np.uint16)).any()
        or (sizes % np.uint64(ENTRY)).any()
        or (heads["length"] != sizes + np.uint64(_INDEX_REST)).any()
        or int(stops.max()) > file.size
    ):
        return None
    return [file[start:stop] for start, stop in zip(starts.tolist(), stops.tolist(), strict=True)]


def statistics_of(record: bytes) -> tuple[int, int, dict[int, int]]:
    """Return the numbers of messages and of chunks, and the number of messages of each channel."""
    messages, _, _, _, _, chunks = struct.unpack_from("<QHIIII", record)
    (size,) = struct.unpack_from("<I", record, 42)
    return messages, chunks, dict(struct.iter_unpack("<HQ", record[46 : 46 + size]))


def times_of(values: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return times in ns, none of which is later than LARGEST_NUMBER."""
    return np.minimum(values, np.uint64(LARGEST_NUMBER)).view(np.int64)


def text_at(data: bytes | memoryview, start: int) -> tuple[str, int]:
    """Return a text with its length before it, and where it ends. Raises ValueError if it is cut off."""
    found, end = bytes_at(data, start)
    return found.decode(errors="replace"), end


def bytes_at(data: bytes | memoryview, start: int) -> tuple[bytes, int]:
    """Return bytes with their number before them, and where they end. Raises ValueError if they are cut off."""
    (size,) = struct.unpack_from("<I", data, start)
    end = start + 4 + size
    if end > len(data):
        raise ValueError(size)
    return bytes(data[start + 4 : end]), end


def attached_of(content: memoryview, opcode: int) -> Attached:
    """Return an attachment or a metadata record. Raises ValueError and struct.error if other readers would refuse it.

    The CRC of an attachment is not compared.
    """
    if opcode == METADATA:
        name, place = bytes_at(content, 0)
        (size,) = struct.unpack_from("<I", content, place)
        place += 4
        end = place + size
        while place < end:
            for _ in ("key", "value"):
                text, place = bytes_at(content, place)
                text.decode()
        if place != end:
            raise ValueError(place)
        found = Attached(name.decode(), content, is_attachment=False)
    else:
        log_time, create_time = struct.unpack_from("<QQ", content)
        name, place = bytes_at(content, 16)
        media_type, place = bytes_at(content, place)
        (size,) = struct.unpack_from("<Q", content, place)
        end = place + 8 + size + CRC
        found = Attached(
            name.decode(),
            content,
            is_attachment=True,
            log_time=log_time,
            create_time=create_time,
            media_type=media_type.decode(),
            size=size,
        )
    if end != len(content):
        raise ValueError(end)
    return found


# many records at once


def opcodes_of(heads: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the opcodes of records, from their first eight bytes."""
    return heads.astype(np.uint8)


def lengths_of(heads: NDArray[np.uint64]) -> Places:
    """Return the lengths of records from their first eight bytes, a huge one if there is none with this opcode.

    The upper byte of a length, which is 0, is not among them.
    """
    lengths = (heads >> np.uint64(8)).view(np.int64) + FRONT
    lengths[opcodes_of(heads) == 0] = LARGEST_NUMBER >> 2
    return lengths


# where records seem to begin


def message_from(data: memoryview, low: int, high: int, stop: int, channels: Collection[int] | None) -> int:
    """Return the first offset from `low` up to `high` at which a message seems to begin, or -1.

    It has one of `channels`, if they are given, and a record or nothing follows it, up to `stop`.
    """
    end = min(high + FRONT, stop)
    # a search for one after the other, as they can overlap, and a lookahead takes ten times as long
    while (found := _MESSAGE_BEGINS.search(data, low, end)) is not None:
        place = found.start()
        low = place + 1
        if place >= high or place + HEAD > stop:
            break
        (length,) = struct.unpack_from("<I", data, place + 1)
        (channel,) = struct.unpack_from("<H", data, place + CHANNEL_AT)
        after = place + FRONT + length
        if length < HEAD - FRONT or after > stop or (channels is not None and channel not in channels):
            continue
        if after == stop:
            return place
        if after + FRONT <= stop:
            opcode, following = RECORD.unpack_from(data, after)
            if 0 < opcode <= LAST_OPCODE and after + FRONT + following <= stop:
                return place
    return -1


def chunk_or_message_from(data: memoryview, low: int, channels: Collection[int]) -> int:
    """Return the first offset from `low` on at which a chunk or a message seems to begin, the end if there is none."""
    size = len(data)
    begin, step = low, _STEP
    while begin < size:  # there may be many of one and none of the other, for which all of the file would be searched
        end = min(begin + step, size)
        message = message_from(data, begin, end, size, channels)
        limit = end if message < 0 else message
        for found in _CHUNK_BEGINS.finditer(data, begin, min(limit + CHUNK_FRONT, size)):
            if found.start() >= limit:
                break
            _, length = RECORD.unpack_from(data, found.start())
            if chunk_at(data, found.start() + FRONT, length) is not None:
                return found.start()
        if message >= 0:
            return message
        begin, step = end, 2 * step
    return size
