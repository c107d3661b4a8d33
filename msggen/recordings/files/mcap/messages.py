"""The messages of an MCAP file: by the message indexes of chunks, or record by record."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.mcap.layouts import ENTRY, FRONT, HEAD
from msggen.recordings.files.mcap.records import (
    CHANNEL_AT,
    HEAD_BYTES,
    HEADS,
    MESSAGE,
    Chunk,
    Loose,
    lengths_of,
    message_from,
    opcodes_of,
    times_of,
)
from msggen.recordings.source.gather import at, groups, walk
from msggen.recordings.source.source import FOREVER, Part

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from msggen.recordings.files.mcap.channels import Described
    from msggen.recordings.source.memory import Octets, Places


class Index(NamedTuple):
    """The message index of a channel in a chunk."""

    channel: int
    entries: Octets
    base: int
    """The offset of the chunk in a buffer."""
    size: int
    """The size of the chunk in the buffer."""


def indexed(buffer: Octets, indexes: Sequence[Index]) -> list[Part] | None:
    """Return the messages of each channel at the offsets of its message indexes, None if one of them is wrong.

    The indexes are sorted by channel, and none is empty. All messages are checked together: each step costs, whatever
    its size.
    """
    channels, all_entries, all_bases, all_sizes = zip(*indexes, strict=True)
    counts = np.array([entries.size for entries in all_entries]) // ENTRY
    stops = np.cumsum(counts)
    firsts = stops - counts
    bases, sizes = np.array(all_bases), np.array(all_sizes)
    offsets = np.concatenate(all_entries).view("<u8")[1::2]
    if int(sizes.min()) < HEAD or (np.maximum.reduceat(offsets, firsts) > (sizes - HEAD).astype(np.uint64)).any():
        return None
    starts = offsets.view(np.int64) + np.repeat(bases, counts)
    heads = at(buffer, HEAD_BYTES)[starts].view(HEADS)
    numbers = np.array(channels, np.uint32)
    if (heads["opcode"] != MESSAGE).any() or (heads["channel"] != np.repeat(numbers << np.uint32(16), counts)).any():
        return None
    lasts = np.flatnonzero(np.append(numbers[1:] != numbers[:-1], True))
    is_back = starts[1:] <= starts[:-1]
    is_back[stops[lasts[:-1]] - 1] = False  # the next channel begins
    if is_back.any() and np.unique(starts).size != starts.size:
        return None
    starts += HEAD
    payloads = heads["length"] - (HEAD - FRONT)
    ends = np.maximum.reduceat(starts + payloads, firsts)
    if int(np.minimum.reduce(payloads)) < 0 or (ends > bases + sizes).any():
        return None
    if int(payloads.sum()) + HEAD * len(payloads) > sum(dict(zip(all_bases, all_sizes, strict=True)).values()):
        return None  # messages overlap
    log_times, publish_times = times_of(heads["log"]), times_of(heads["publish"])
    found = []
    begin = 0
    for number, stop in zip(numbers[lasts].tolist(), stops[lasts].tolist(), strict=True):
        own = slice(begin, stop)
        found.append(Part(number, buffer, starts[own], payloads[own], log_times[own], publish_times[own]))
        begin = stop
    return found


def searched(data: Octets, region: Chunk | Loose, wanted: Collection[int], described: Described) -> Iterator[Part]:
    """Yield the messages of a region record by record. `data` is the file, or the records of a chunk."""
    for starts in records_in(data, region, described):
        for number, places in _by_channel(data, starts, region.start, described):
            if number in wanted:
                heads = at(data, HEAD_BYTES)[places].view(HEADS)
                # as the walk has them: the upper byte may be damaged
                sizes = lengths_of(at(data, "<u8")[places]) - HEAD
                yield Part(number, data, places + HEAD, sizes, times_of(heads["log"]), times_of(heads["publish"]))


def records_in(data: Octets, region: Chunk | Loose, described: Described) -> Iterator[Places]:
    """Yield the offsets of whole records, in several stretches. What makes no sense is left out and reported."""
    start, stop = (region.start, region.stop) if isinstance(region, Loose) else (0, data.size)
    raw = data.data
    while start < stop:
        end = start
        for stretch in walk(data, start, stop, lengths_of, finder_in(raw)):
            yield stretch.starts
            end = stretch.end
        if end >= stop:
            return
        start = message_from(raw, end + 1, stop, stop, described.channels)
        start = stop if start < 0 else start
        if isinstance(region, Loose):
            described.report(f"{start - end} bytes are not MCAP records", end, start - end)
        else:
            text = f"{start - end} bytes at {end} of a chunk are not MCAP records"
            described.report(text, region.start, start - end)


def finder_in(data: memoryview) -> Callable[[int, int], int]:
    """Return a function for `walk`: where from `low` up to `high` a message of any channel seems to begin."""
    return lambda low, high: message_from(data, low, high, len(data), None)


def _by_channel(data: Octets, starts: Places, offset: int, described: Described) -> Iterator[tuple[int, Places]]:
    """Yield the messages among records, by channel. `offset` is that of the region in the file."""
    heads = at(data, "<u8")[starts]
    is_message = opcodes_of(heads) == MESSAGE
    is_whole = is_message & (lengths_of(heads) >= HEAD)
    short = int(np.count_nonzero(is_message) - np.count_nonzero(is_whole))
    if short:
        described.report("messages that are too short", offset, samples=short)
    starts = starts[is_whole]
    for number, chosen in groups(at(data, "<u2", CHANNEL_AT)[starts]):
        if number in described.channels:
            yield number, starts[chosen]
        else:
            text = f"messages of channel {number}, which the file does not describe"
            described.report(text, offset, samples=len(chosen))


def between(part: Part, start: int, stop: int) -> Part | None:
    """Return the samples with log times from `start` up to `stop`, None if there are none."""
    if start <= 0 and stop >= FOREVER:
        return part
    chosen = (part.log_times >= start) & (part.log_times < stop)
    if chosen.all():
        return part
    if not chosen.any():
        return None
    times, published = part.log_times[chosen], part.publish_times
    return Part(
        part.channel,
        part.buffer,
        part.starts[chosen],
        part.sizes[chosen],
        times,
        None if published is None else published[chosen],
    )
