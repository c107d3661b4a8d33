"""What is fetched of an MCAP file in a store before it is read. Files of this computer are there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING

from msggen.recordings.files.mcap.layouts import FRONT, INDEX_FRONT
from msggen.recordings.files.mcap.records import CHUNK_FRONT, Chunk, Loose, index_ranges

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from msggen.recordings.files.mapped import MappedFile

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
