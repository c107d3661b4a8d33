"""MCAP files (https://mcap.dev/spec): indexed, not indexed, without chunks, cut off, or damaged."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from contextlib import closing
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.files.checksums import Checks
from msggen.recordings.files.compression import Room
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.files.mcap_channels import Described
from msggen.recordings.files.mcap_chunks import Loaded, Loader, ahead, limited, records_of
from msggen.recordings.files.mcap_fetched import Fetched
from msggen.recordings.files.mcap_messages import Index, between, indexed, searched
from msggen.recordings.files.mcap_records import (
    ATTACHMENT,
    CRC,
    INDEX_FRONT,
    LARGEST_NUMBER,
    MAGIC,
    Chunk,
    Loose,
    attached_of,
    entries_at,
    entries_of,
    index_ranges,
    times_of,
)
from msggen.recordings.files.mcap_scan import scan
from msggen.recordings.files.mcap_summary import Summary, read_summary
from msggen.recordings.files.metadata import facts_of, notes_of
from msggen.recordings.source.memory import drop_pages
from msggen.recordings.source.source import (
    FOREVER,
    VERIFIED,
    Attached,
    Channel,
    Checksums,
    Facts,
    Part,
    Problem,
    RecordingError,
    Verification,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets

_GROUP = 3 << 20
"""The bytes of chunks that are read at a time: many, as each step costs; few enough for the processor's large cache."""


class McapFile:
    """A file, with the room for its content. Raises RecordingError if it is not MCAP, and OSError."""

    kind = "mcap"

    def __init__(self, path: str, room: Room | None = None, verification: Verification = VERIFIED) -> None:
        self.path = path
        self.problems: list[Problem] = []
        self._checks = Checks(verification)
        self._described = Described(self.problems, self._checks)
        self._regions: Sequence[Chunk | Loose] = ()
        self._span: tuple[int, int] | None = None
        self._times: Mapping[int, Sequence[NDArray[np.int64]]] = {}
        """The times of the messages that no message index has."""
        self.notes: Sequence[str] = ()
        self._mapped = MappedFile(path, in_ranges=True)
        self._mapped.need([(0, len(MAGIC))])
        self._fetched = Fetched(self._mapped)
        if bytes(self._file[: len(MAGIC)]) != MAGIC:
            raise RecordingError(f"{path} is not an MCAP file")
        room = room or Room(self._file.size)
        summary = self._summary()
        self._stated = summary.counts
        if summary.chunks is None:
            self._scan(room, is_damaged=summary.is_damaged)
        else:
            self._regions = limited(summary.chunks, room, self._described)
            self._described.set_counts(summary.counts)
            present = [chunk for chunk in summary.chunks if chunk.indexes]
            if present:
                self._span = min(each.first for each in present), max(each.last for each in present)
        if self._span is not None and self._span[1] == LARGEST_NUMBER:
            self._described.report(f"log times from the year 2116 on are read as {LARGEST_NUMBER} ns")
        self._facts = facts_of(self._described.metadata, self._described.report)
        self.notes = notes_of(self._described.metadata)

    @property
    def _file(self) -> Octets:
        return self._mapped.octets

    @property
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""
        return self._described.channels

    @property
    def facts(self) -> Facts:
        """What an MCAP file tells that was made of a ULog."""
        return self._facts

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""
        return self._span

    def close(self) -> None:
        """Close the file. Can be repeated."""
        self._mapped.close()

    @property
    def missing_checksums(self) -> int:
        """How many chunks, and stretches of messages outside of chunks, have no checksum."""
        loose = len(self._regions) - len(self._chunks)
        return loose + sum(not chunk.crc for chunk in self._fetched.expected(self._chunks))

    def verify(self) -> Checksums:
        """Compare the chunks and attachments with their CRCs, and add those that differ to `problems`."""
        self._mapped.check()
        self._mapped.need_all()
        chunks = [chunk for chunk in self._fetched.present(self._chunks) if chunk.crc]
        for chunk in chunks:
            if not self._checks.is_compared(chunk):
                data = records_of(self._file, chunk, self._described)
                if data.size == chunk.size and not self._checks.compare(chunk, data.data):
                    self._described.report_damaged(self._file, chunk)
        for _ in self.attached():
            pass
        return Checksums(len(chunks), self.missing_checksums)

    def attached(self) -> Iterator[Attached]:
        """See Source.attached."""
        self._mapped.check()
        for opcode, start, length in self._described.attached:
            self._mapped.need([(start, start + length)])
            content = self._file.data[start : start + length]
            try:
                found = attached_of(content, opcode)
            except (struct.error, ValueError):
                kind = "an attachment" if opcode == ATTACHMENT else "a metadata record"
                self._described.report(f"{kind} is damaged", start, length)
                continue
            crc = int.from_bytes(content[-CRC:], "little") if found.is_attachment else 0
            if self._checks.accepts(content[:-CRC], crc):
                yield found
            elif self._checks.leaves_out:
                self._described.report("an attachment does not match its CRC and is left out", start, length)
            else:
                self._described.report("an attachment does not match its CRC", start)
                yield found

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """See Source.parts."""
        self._mapped.check()
        wanted = set(channels)
        counts: Counter[int] = Counter()
        for part in self._parts(wanted, start, stop):
            counts[part.channel] += len(part.starts)
            yield part
        if start <= 0 and stop >= FOREVER:
            found = {number: counts[number] + self._described.count_left_out(number) for number in wanted}
            self._described.compare_counts(self._stated, found)

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        self._mapped.check()
        found: dict[int, list[NDArray[np.int64]]] = {number: list(self._times.get(number, ())) for number in channels}
        file = self._file
        chunks = self._chunks_with(channels)
        if self._mapped.is_partial:
            places = [chunk.indexes[number] for chunk in chunks for number in found.keys() & chunk.indexes.keys()]
            self._mapped.need((place, place + INDEX_FRONT) for place in places)
            self._mapped.need(index_ranges(file.data, places))
        for chunk in chunks:
            for number in found.keys() & chunk.indexes.keys():
                entries = entries_of(file, number, chunk.indexes[number])
                if entries is not None:
                    found[number].append(times_of(entries.view("<u8")[::2]))
            drop_pages(file)
        return {number: np.concatenate(each or [np.zeros(0, np.int64)]) for number, each in found.items()}

    def _chunks_with(self, channels: Collection[int]) -> Iterable[Chunk]:
        """Return the chunks that may have messages of channels. Topics ask for one channel after the other."""
        if len(channels) == 1:
            (number,) = channels
            return self._chunks_by_channel.get(number, ())
        return self._chunks

    @cached_property
    def _chunks(self) -> Sequence[Chunk]:
        return [region for region in self._regions if isinstance(region, Chunk)]

    @cached_property
    def _chunks_by_channel(self) -> Mapping[int, Sequence[Chunk]]:
        found: dict[int, list[Chunk]] = defaultdict(list)
        for chunk in self._chunks:
            for number in chunk.indexes:
                found[number].append(chunk)
        return found

    def _summary(self) -> Summary:
        """Read the summary. A file in a store that has none that can be relied on is fetched whole."""
        is_partial = self._mapped.is_partial
        summary = read_summary(self._mapped, self._described)
        if summary.chunks is not None or not is_partial:
            return summary
        self._mapped.need_all()
        self.problems.clear()
        self._described = Described(self.problems, self._checks)
        return read_summary(self._mapped, self._described)

    def _scan(self, room: Room, *, is_damaged: bool) -> None:
        """Search the file, which has no index of all its messages. If `is_damaged`, so may be the message indexes."""
        summarized = self._described.channels
        self._described = Described(self.problems, self._checks)
        self._regions, self._times, found = scan(self._file, self._described, summarized, room, is_damaged=is_damaged)
        self._stated = self._stated or found
        times = self.times(self.channels)
        counts = {number: len(of_channel) for number, of_channel in times.items()}
        self._described.set_counts(counts)
        self._described.compare_counts(self._stated, counts)
        present = [each for each in times.values() if len(each)]
        if present:
            self._span = min(int(each.min()) for each in present), max(int(each.max()) for each in present)

    def _parts(self, wanted: set[int], start: int, stop: int) -> Iterator[Part]:
        loader = Loader(self._checks)  # one for each pass: passes take turns, or are in several threads

        def load(group: Sequence[Chunk] | Loose) -> tuple[Sequence[Chunk] | Loose, Loaded | None]:
            if isinstance(group, Loose):
                return group, None
            group = self._fetched.present(group)
            return group, loader.load(self._file, group) if all(chunk.indexes for chunk in group) else None

        for groups in self._fetched.in_steps(list(self._groups(wanted, start, stop))):
            with closing(ahead(load, groups)) as loading:
                for _, (group, loaded) in loading:
                    for part in self._of_group(group, loaded, wanted):
                        chosen = between(part, start, stop)
                        if chosen is not None:
                            yield chosen

    def _of_group(self, group: Sequence[Chunk] | Loose, loaded: Loaded | None, wanted: set[int]) -> Iterable[Part]:
        """Return the messages of one group of `_groups`. What has no correct message index is searched."""
        if isinstance(group, Loose):
            return searched(self._file, group, wanted, self._described)
        parts = None if loaded is None else self._by_index(group, loaded, wanted)
        return chain.from_iterable(self._of_chunk(chunk, wanted) for chunk in group) if parts is None else parts

    def _groups(self, wanted: set[int], start: int, stop: int) -> Iterator[Sequence[Chunk] | Loose]:
        """Yield the chunks that may have samples of `wanted`, several at a time: each step costs, whatever its size."""
        group: list[Chunk] = []
        size = 0
        for region in self._regions:
            if isinstance(region, Loose):
                if group:
                    yield group
                    group, size = [], 0
                yield region
            elif (
                region.last >= start
                and region.first < stop
                and not (region.indexes and wanted.isdisjoint(region.indexes))
                and not self._checks.is_left_out(region)
            ):
                group.append(region)
                size += region.size
                if size >= _GROUP:
                    yield group
                    group, size = [], 0
        if group:
            yield group

    def _by_index(self, group: Sequence[Chunk], loaded: Loaded, wanted: Collection[int]) -> list[Part] | None:
        """Return the messages of chunks by their message indexes, None if one of the chunks needs a closer look."""
        found = sorted(
            (number, place, chunk.indexes[number])
            for place, chunk in enumerate(group)
            for number in wanted & chunk.indexes.keys()
        )
        numbers, places, offsets = zip(*found, strict=True) if found else ((), (), ())
        entries = entries_at(self._file, numbers, offsets)
        if entries is None:
            return None
        indexes = [
            Index(number, each, loaded.bases[place], group[place].size)
            for number, place, each in zip(numbers, places, entries, strict=True)
            if each.size
        ]
        return indexed(loaded.buffer, indexes) if indexes else []

    def _of_chunk(self, chunk: Chunk, wanted: Collection[int]) -> Iterator[Part]:
        """Yield the messages of a chunk that is searched, because something is wrong or missing."""
        data = records_of(self._file, chunk, self._described)
        loaded = Loaded(data, [0])
        if chunk.indexes and data.size == chunk.size and self._by_index([chunk], loaded, chunk.indexes.keys()) is None:
            text = "the message index does not fit the chunk, which is searched instead"
            self._described.report(text, chunk.start)
        yield from searched(data, chunk, wanted, self._described)
