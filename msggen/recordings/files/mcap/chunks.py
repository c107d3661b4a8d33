"""The records of the chunks of an MCAP file, without their compression."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from msggen.recordings.files.compression import LARGEST, CompressionError, Room, decompress_into, prefix_of
from msggen.recordings.files.mcap.layouts import FRONT, INDEX_FRONT
from msggen.recordings.files.mcap.records import CHUNK_FRONT, Chunk, Loose, crc_of, fits, index_ranges
from msggen.recordings.source.memory import drop_pages, large_empty

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

    from msggen.recordings.files.mapped import MappedFile
    from msggen.recordings.files.mcap.channels import Described
    from msggen.recordings.files.mcap.checksums import Checks
    from msggen.recordings.source.memory import Octets

_FEW = 3
"""The number of items below which a thread costs more than it saves."""
_BUFFER = 4 << 20
"""The smallest buffer for chunks, which numpy takes in large pages."""


class Loaded(NamedTuple):
    """The records of several chunks."""

    buffer: Octets
    bases: Sequence[int]
    """The offset of each chunk in the buffer."""


class Loader:
    """Memory for chunks: the pages of new memory take longer than the decompression of a few chunks."""

    def __init__(self, checks: Checks) -> None:
        self._checks = checks
        self._buffer: Octets = np.zeros(0, np.uint8)
        self._spare: Octets = np.zeros(0, np.uint8)

    def load(self, file: Octets, chunks: Sequence[Chunk]) -> Loaded | None:
        """Return the records of chunks, None if one of them is damaged or does not match its CRC.

        The buffer is valid until the second call from here on.
        """
        drop_pages(file)
        if any(chunk.records + chunk.stored > file.size or not fits(file.data, chunk) for chunk in chunks):
            return None
        return self._decompressed(file, chunks) if any(chunk.kind for chunk in chunks) else self._in_place(file, chunks)

    def _in_place(self, file: Octets, chunks: Sequence[Chunk]) -> Loaded | None:
        """Return the records of chunks without compression, where they are in the file."""
        places = [(chunk, file[chunk.records : chunk.records + chunk.stored]) for chunk in chunks]
        is_right = all(self._checks.passes(chunk, crc_of(file.data, chunk), data) for chunk, data in places)
        return Loaded(file, [chunk.records for chunk in chunks]) if is_right else None

    def _decompressed(self, file: Octets, chunks: Sequence[Chunk]) -> Loaded | None:
        stops = list(accumulate(chunk.size for chunk in chunks))
        if stops[-1] > LARGEST or any(chunk.size > chunk.limit for chunk in chunks):
            return None
        self._buffer, self._spare = self._spare, self._buffer
        if self._buffer.size < stops[-1]:
            self._buffer = large_empty(max(stops[-1], _BUFFER))
        buffer = self._buffer[: stops[-1]]
        bases = [0, *stops[:-1]]
        memory = buffer.data
        for chunk, base in zip(chunks, bases, strict=True):
            data = file[chunk.records : chunk.records + chunk.stored]
            target = memory[base : base + chunk.size]
            try:
                decompress_into(chunk.kind, data, target)
            except CompressionError:
                return None
            # here, while they are in the cache of the processor
            if not self._checks.passes(chunk, crc_of(file.data, chunk), target):
                return None
        return Loaded(buffer, bases)


Item = TypeVar("Item")
Result = TypeVar("Result")


def ahead(load: Callable[[Item], Result], items: Sequence[Item]) -> Generator[tuple[Item, Result], None, None]:
    """Yield items and what `load` returns for them. A thread loads the next item while the last one is in use."""
    if len(items) < _FEW:
        yield from ((item, load(item)) for item in items)
        return
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(load, items[0])
        for item, following in zip(items, [*items[1:], None], strict=True):
            loaded = coming.result()
            if following is not None:
                coming = pool.submit(load, following)
            yield item, loaded


def limited(regions: Sequence[Chunk | Loose], room: Room, described: Described) -> list[Chunk | Loose]:
    """Return the regions of a file, of whose compressed chunks so many bytes are read as there is room for.

    Those that are compressed the most are the first of which less is read: their sizes may be damaged.
    """
    found = list(regions)
    packed = [
        (region.size / max(region.stored, 1), index, region)
        for index, region in enumerate(found)
        if isinstance(region, Chunk) and region.kind
    ]
    total = sum(chunk.size for _, _, chunk in packed)
    if total <= room.left:
        room.take(total)
        return found
    text = room.excess()
    left_out = 0
    for _, index, chunk in sorted(packed, key=lambda each: each[:2]):
        found[index] = chunk._replace(limit=min(room.left, LARGEST))
        left_out += not room.left
        room.take(chunk.size)
    described.report(f"{text}, and {left_out} of its chunks are not read" if left_out else text)
    return [region for region in found if isinstance(region, Loose) or region.limit]


def records_of(file: Octets, chunk: Chunk, described: Described) -> Octets:
    """Return the records of a chunk.

    A damaged one is reported. If it has a CRC and is to be left out, none of its records is returned, otherwise those
    that can be read.
    """
    drop_pages(file)
    if not fits(file.data, chunk):
        described.report("a chunk does not begin as the index of chunks tells, which is used instead", chunk.start)
    data = file[chunk.records : chunk.records + chunk.stored]
    if not chunk.kind and data.size == chunk.size:
        return _checked(data, file, chunk, described)
    text = "is cut off"
    if data.size == chunk.stored:
        if chunk.size <= chunk.limit:
            found = np.empty(chunk.size, np.uint8)
            try:
                decompress_into(chunk.kind, data, found.data)
            except CompressionError as error:
                text = f"is damaged: {error}"
                if crc_of(file.data, chunk) and described.checks.leaves_out:
                    described.checks.fail(chunk, error)
                    described.report_damaged(file, chunk)
                    return data[:0]
            else:
                return _checked(found, file, chunk, described)
        else:
            text = f"has {chunk.size} bytes, more than {chunk.limit}"
    prefix = np.frombuffer(prefix_of(chunk.kind, data, min(chunk.size, chunk.limit)), np.uint8)
    text = f"a chunk {text}; {prefix.size} of its {chunk.size} bytes can be read"
    described.report(text, chunk.start, chunk.length)
    return prefix


def _checked(data: Octets, file: Octets, chunk: Chunk, described: Described) -> Octets:
    """Return the records of a chunk, none if they do not match its CRC and are left out. That is reported."""
    if described.checks.passes(chunk, crc_of(file.data, chunk), data.data):
        return data
    described.report_damaged(file, chunk)
    return data[:0] if described.checks.leaves_out else data


# what is fetched of a file in a store before it is read; files of this computer are there


Group = Sequence[Chunk] | Loose
_LARGEST_STEP = 32 << 20
"""The most bytes that are fetched ahead. Each step is twice as large as the last: a user may want the first samples."""


def in_steps(mapped: MappedFile, groups: Sequence[Group]) -> Iterator[Sequence[Group]]:
    """Yield groups, as many at a time as are fetched together: all of a file that is here."""
    begin, most = 0, 0
    while begin < len(groups):
        end = len(groups)
        if mapped.is_partial:
            most = min(max(2 * most, _size(groups[begin])), _LARGEST_STEP)
            sizes = accumulate(map(_size, groups[begin:]))
            end = begin + max(sum(size <= most for size in sizes), 1)
            _fetch_chunks(mapped, [chunk for group in groups[begin:end] for chunk in _chunks(group)])
        yield groups[begin:end]
        begin = end


def fetch_heads(mapped: MappedFile, chunks: Iterable[Chunk]) -> None:
    """Fetch what chunks have before their records."""
    mapped.need((chunk.start - FRONT, min(chunk.start + CHUNK_FRONT, chunk.start + chunk.length)) for chunk in chunks)


def fetch_indexes(mapped: MappedFile, places: Sequence[int]) -> None:
    """Fetch the message indexes at offsets."""
    mapped.need((place, place + INDEX_FRONT) for place in places)
    mapped.need(index_ranges(mapped.octets.data, places))


def _fetch_chunks(mapped: MappedFile, chunks: Sequence[Chunk]) -> None:
    mapped.need(map(_range, chunks))
    fetch_indexes(mapped, [place for chunk in chunks for place in chunk.indexes.values()])


def _range(chunk: Chunk) -> tuple[int, int]:
    """Return where a chunk and its message indexes are."""
    return chunk.start - FRONT, chunk.start + chunk.length + chunk.index_size


def _chunks(group: Group) -> Sequence[Chunk]:
    return () if isinstance(group, Loose) else group


def _size(group: Group) -> int:
    return sum(stop - start for start, stop in map(_range, _chunks(group)))
