"""Samples of recordings as CDR, in the order of their log times."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.decode.encoder import encoded
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.source.gather import at

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.source.memory import Octets
    from msggen.recordings.source.source import Part
    from msggen.recordings.topics.topic import Topic

WAITING = 32 << 20
"""The bytes of samples that wait for earlier ones. Formats write samples at most a few MB out of order."""


class Block(NamedTuple):
    """Samples of one size. All arrays have a row for each."""

    channel: int
    payloads: Octets
    """An array of two dimensions."""
    log_times: NDArray[np.int64]
    publish_times: NDArray[np.int64]


def blocks_of_parts(parts: Iterable[tuple[Topic, Part]], channel_of: Callable[[Topic], int]) -> Iterator[Block]:
    """Yield copies of the samples of a recording in CDR, or in another encoding that is not changed."""
    for topic, part in parts:
        published = part.log_times if part.publish_times is None else part.publish_times
        sizes = np.unique(part.sizes)
        for size in sizes.tolist():
            chosen = slice(None) if len(sizes) == 1 else np.flatnonzero(part.sizes == size)
            starts = part.starts[chosen]
            payloads = at(part.buffer, f"V{size}")[starts].view(np.uint8) if size else np.zeros(0, np.uint8)
            times, publish_times = part.log_times[chosen].copy(), published[chosen].copy()
            yield Block(channel_of(topic), payloads.reshape(len(starts), size), times, publish_times)


def blocks_of_ulog(
    batches: Iterable[Samples], channel_of: Callable[[Topic], tuple[int, str]], offset: int = 0
) -> Iterator[Block]:
    """Yield the samples of a ULog as CDR. `offset` in ns is added to all log times.

    `channel_of` returns the channel of a topic and the definition that it has there: the fields of the topic's own
    definition, in any order.
    """
    for samples in batches:
        topic = samples.topic
        layout = topic.channels[0][1].layout
        assert layout is not None  # noqa: S101 - a ULog has layouts
        channel, definition = channel_of(topic)
        own, written = (read_schema(topic.ros_type, each) for each in (topic.definition, definition))
        payloads = encoded(samples.array, layout, own, written)
        times = samples.log_times + offset
        yield Block(channel, payloads, times, times)


def ordered(blocks: Iterable[Block]) -> Iterator[list[Block]]:
    """Yield the same samples in lists, of which each has later ones than those before.

    At most WAITING bytes are kept: an earlier sample that comes after so many others is not put before them.
    """
    waiting: list[Block] = []
    size = 0
    for block in blocks:
        waiting.append(block)
        size += _size(block)
        if size > WAITING:
            limit = _middle(waiting)
            ready, waiting = _split(waiting, limit)
            size = sum(map(_size, waiting))
            yield ready
    if waiting:
        yield waiting


def merged(streams: Iterable[tuple[int, Iterator[list[Block]]]]) -> Iterator[list[Block]]:
    """Yield the samples of several streams as `ordered` yields them, in one order.

    Each stream comes with a log time before which it has no sample. It is begun when this time is reached, since each
    stream that was begun has samples in memory.
    """
    waiting: dict[int, list[Block]] = {}
    rest: dict[int, Iterator[list[Block]]] = {}
    coming = deque(sorted((first, number, stream) for number, (first, stream) in enumerate(streams)))
    while coming or rest or waiting:
        for number in [number for number in rest if number not in waiting]:
            blocks = next(rest[number], None)
            if blocks is None:
                del rest[number]
            else:
                waiting[number] = blocks
        # what comes next of each stream that has more is not before the last of what it has
        ends = [max(int(block.log_times.max()) for block in waiting[number]) for number in rest]
        if coming:
            first, number, stream = coming[0]
            if all(first <= int(block.log_times.min()) for blocks in waiting.values() for block in blocks):
                rest[number] = stream
                coming.popleft()
                continue
            ends.append(first - 1)
        limit = min(ends, default=None)
        ready: list[Block] = []
        for number, blocks in list(waiting.items()):
            taken, kept = (blocks, []) if limit is None else _split(blocks, limit + 1)
            ready += taken
            if kept:
                waiting[number] = kept
            else:
                del waiting[number]
        if ready:
            yield ready


def _split(blocks: Sequence[Block], limit: int) -> tuple[list[Block], list[Block]]:
    """Return the samples before a log time, and the others."""
    before, others = [], []
    for block in blocks:
        is_before = block.log_times < limit
        if is_before.all():
            before.append(block)
        elif not is_before.any():
            others.append(block)
        else:
            before.append(_chosen(block, is_before))
            others.append(_chosen(block, ~is_before))
    return before, others


def _chosen(block: Block, mask: NDArray[np.bool_]) -> Block:
    return Block(block.channel, block.payloads[mask], block.log_times[mask], block.publish_times[mask])


def _middle(blocks: Sequence[Block]) -> int:
    """Return a log time before which about half of the bytes are, and at least one sample is."""
    times = np.concatenate([block.log_times for block in blocks])
    sizes = np.concatenate([np.full(len(block.log_times), block.payloads.shape[1]) for block in blocks])
    order = np.argsort(times, kind="stable")
    middle = int(np.searchsorted(np.cumsum(sizes[order]), int(sizes.sum()) // 2))
    limit = int(times[order[middle]])
    return limit if limit > int(times[order[0]]) else limit + 1


def _size(block: Block) -> int:
    return int(block.payloads.size) + 16 * len(block.log_times)
