"""MCAP files (https://mcap.dev/spec): indexed, not indexed, without chunks, cut off, or damaged."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from contextlib import closing
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.files.compression import Room
from msggen.recordings.files.frames import Frames
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.files.mcap.channels import Described
from msggen.recordings.files.mcap.checksums import Checks
from msggen.recordings.files.mcap.chunks import (
    Loaded,
    Loader,
    ahead,
    fetch_heads,
    fetch_indexes,
    in_steps,
    limited,
    records_of,
)
from msggen.recordings.files.mcap.layouts import MAGIC
from msggen.recordings.files.mcap.messages import Index, between, indexed, searched
from msggen.recordings.files.mcap.metadata import facts_of, notes_of
from msggen.recordings.files.mcap.records import (
    ATTACHMENT,
    CRC,
    LARGEST_NUMBER,
    METADATA,
    Chunk,
    Loose,
    attached_of,
    crc_of,
    entries_at,
    entries_of,
    times_of,
)
from msggen.recordings.files.mcap.scan import scan
from msggen.recordings.files.mcap.summary import Summary, differing_sections, read_summary
from msggen.recordings.source.facts import Facts
from msggen.recordings.source.memory import drop_pages
from msggen.recordings.source.source import (
    FOREVER,
    VERIFIED,
    Attached,
    Channel,
    Checksums,
    Contents,
    Part,
    RecordingError,
    Source,
    Verification,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets

_GROUP = 3 << 20
"""The bytes of chunks that are read at a time: many, as each step costs; few enough for the processor's large cache."""


class McapFile(Source):
    """A file, with the room for its content. Raises RecordingError if it is not MCAP, and OSError."""

    kind = "mcap"

    def __init__(
        self,
        path: str,
        room: Room | None = None,
        verification: Verification = VERIFIED,
        *,
        is_by_sample: bool = False,
    ) -> None:
        super().__init__(path)
        self._checks = Checks(verification)
        self._described = Described(self.problems, self._checks)
        self._regions: Sequence[Chunk | Loose] = ()
        self._span: tuple[int, int] | None = None
        self._times: Mapping[int, Sequence[NDArray[np.int64]]] = {}
        """The times of the messages that no message index has."""
        self._mapped = MappedFile(path, in_ranges=True)
        self._mapped.need([(0, len(MAGIC))])
        self.close_with(self._mapped.close)
        if bytes(self._file[: len(MAGIC)]) != MAGIC:
            raise RecordingError(f"{path} is not an MCAP file")
        room = room or Room(self._file.size)
        self._frames = Frames(room, self.problems, is_by_sample=is_by_sample)
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

    @property
    def missing_checksums(self) -> int:
        """How many chunks, and stretches of messages outside of chunks, have no checksum.

        Programs write checksums of all chunks or of none, so only the first and the last one are read if they agree.
        """
        chunks = self._chunks
        loose = len(self._regions) - len(chunks)
        data = self._file.data
        fetch_heads(self._mapped, (*chunks[:1], *chunks[-1:]))
        has_crc = {bool(crc_of(data, chunk)) for chunk in (*chunks[:1], *chunks[-1:])}
        if len(has_crc) > 1:
            fetch_heads(self._mapped, chunks)
            return loose + sum(not crc_of(data, chunk) for chunk in chunks)
        return loose + len(chunks) * (False in has_crc)

    @property
    def contents(self) -> Contents:
        """See Source.contents."""
        kinds = tuple(sorted({chunk.kind or "none" for chunk in self._chunks}))
        opcodes = [opcode for opcode, *_ in self._described.attached]
        return Contents(len(self._chunks), kinds, opcodes.count(ATTACHMENT), opcodes.count(METADATA))

    def verify(self) -> Checksums:
        """Compare chunks, attachments, data section and summary with their CRCs, and report those that differ."""
        self._mapped.check()
        self._mapped.need_all()
        known = [(chunk, crc) for chunk in self._chunks if (crc := crc_of(self._file.data, chunk))]
        for chunk, crc in known:
            if not self._checks.is_compared(chunk):
                data = records_of(self._file, chunk, self._described)
                if data.size == chunk.size and not self._checks.compare(chunk, crc, data.data):
                    self._described.report_damaged(self._file, chunk)
        for _ in self.attached():
            pass
        for part in differing_sections(self._file):
            self._described.report(f"{part} does not match its CRC")
        return Checksums(len(known), len(self._regions) - len(known))

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
        return self._frames.unpacked(self._counted(set(channels), start, stop), self.channels)

    def _counted(self, wanted: set[int], start: int, stop: int) -> Iterator[Part]:
        """Yield the messages of channels, and compare their numbers with those in the summary."""
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
        if self._mapped.is_partial:  # all at once, for several requests at a time
            of_chunks = [(chunk, number) for chunk in chunks for number in found.keys() & chunk.indexes.keys()]
            fetch_indexes(self._mapped, [chunk.indexes[number] for chunk, number in of_chunks])
        for chunk in chunks:
            for number in found.keys() & chunk.indexes.keys():
                found[number] += self._times_in(chunk, number)
            drop_pages(file)
        return {number: np.concatenate(each or [np.zeros(0, np.int64)]) for number, each in found.items()}

    def ends(self, channel: int) -> tuple[int, int] | None:
        """See Source.ends. Only the message indexes of few chunks are read: those that may have these samples."""
        self._mapped.check()
        loose = self._times.get(channel, ())
        firsts = [int(each.min()) for each in loose if len(each)]
        lasts = [int(each.max()) for each in loose if len(each)]
        for chunk in self._chunks_by_first:
            if firsts and chunk.first >= min(firsts):
                break
            self._fetch_all_indexes(chunk, channel)
            firsts += [int(each.min()) for each in self._times_in(chunk, channel)]
        for chunk in self._chunks_by_last:
            if lasts and chunk.last <= max(lasts):
                break
            self._fetch_all_indexes(chunk, channel)
            lasts += [int(each.max()) for each in self._times_in(chunk, channel)]
        return (min(firsts), max(lasts)) if firsts and lasts else None

    def _fetch_all_indexes(self, chunk: Chunk, channel: int) -> None:
        """Fetch the message indexes of a chunk that has a channel: those of other channels are often asked for next."""
        if channel in chunk.indexes:
            end = chunk.start + chunk.length
            self._mapped.need([(end, end + chunk.index_size)])

    def _times_in(self, chunk: Chunk, channel: int) -> Iterator[NDArray[np.int64]]:
        """Yield the log times of a channel in a chunk, if there are any."""
        if channel not in chunk.indexes:
            return
        if self._mapped.is_partial:
            fetch_indexes(self._mapped, [chunk.indexes[channel]])
        entries = entries_of(self._file, channel, chunk.indexes[channel])
        if entries is None or not entries.size:
            return
        times = times_of(entries.view("<u8")[::2])
        if chunk.first <= int(times.min()) and int(times.max()) <= chunk.last:
            yield times
            return
        self._mapped.need([(chunk.start, chunk.start + chunk.length)])
        own = [part.log_times for part in self._of_chunk(chunk, {channel})]
        if not np.array_equal(np.sort(times), np.sort(np.concatenate([times[:0], *own]))):
            text = "the message index has other times than the messages of the chunk, which are taken instead"
            self._described.report(text, chunk.start)
        yield from own

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
    def _chunks_by_first(self) -> Sequence[Chunk]:
        return sorted(self._chunks, key=lambda chunk: chunk.first)

    @cached_property
    def _chunks_by_last(self) -> Sequence[Chunk]:
        return sorted(self._chunks, key=lambda chunk: -chunk.last)

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

        def load(group: Sequence[Chunk] | Loose) -> Loaded | None:
            if isinstance(group, Loose) or not all(chunk.indexes for chunk in group):
                return None
            return loader.load(self._file, group)

        for groups in in_steps(self._mapped, list(self._groups(wanted, start, stop))):
            with closing(ahead(load, groups)) as loading:
                for group, loaded in loading:
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
