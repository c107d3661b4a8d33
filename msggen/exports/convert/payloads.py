"""Samples of recordings as CDR, in the order of their log times.

The texts of a ULog are samples of /rosout, and its decoded events samples of /events.
"""

from __future__ import annotations

import struct
from collections import defaultdict, deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.decode.encapsulation import USUAL
from msggen.recordings.decode.layouts import encoded
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.files.mcap.writer import Target
from msggen.recordings.log.decoded_events import DEFINITION, TOPIC, TYPE, values_of
from msggen.recordings.source.gather import at
from msggen.recordings.source.source import SEPARATOR

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from msggen.exports.convert.selection import Selection
    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.facts import Event, Text
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


_ROSOUT = Target(
    "/rosout",
    "rcl_interfaces/msg/Log",
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n"
    f"{SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
)
"""The topic on which nodes of ROS 2 publish texts."""
_EVENTS = Target(TOPIC, TYPE, DEFINITION)
_LEVELS = {"emergency": 50, "alert": 50, "critical": 50, "error": 40, "warning": 30, "notice": 20, "info": 20}
_DEBUG = 10
_LARGEST = (1 << 31) * 10**9 - 1
"""The largest time in ns that the type has. A time in a damaged ULog can be larger."""
_NAME = "px4"
"""The name of the node in texts."""


def blocks_of_texts(
    log: Log, selection: Selection, channel_of: Callable[[Target], int], offset: int
) -> Iterator[Block]:
    """Yield the texts and the events of a ULog as samples of /rosout and /events."""
    low, high = selection.limits(log.start)
    texts = ((text.time, _rosout(text, text.time + offset)) for text in log.texts)
    events = ((event.time, _decoded(event, event.time + offset)) for event in log.events)
    for target, found in ((_ROSOUT, texts), (_EVENTS, events)):
        by_size: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
        for time, payload in found:
            if low <= time < high:
                by_size[len(payload)].append((time + offset, payload))
        for size, samples in by_size.items():
            log_times = np.array([time for time, _ in samples], np.int64)
            payloads = np.frombuffer(b"".join(payload for _, payload in samples), np.uint8).reshape(-1, size)
            yield Block(channel_of(target), payloads, log_times, log_times)


def _rosout(text: Text, time: int) -> bytes:
    """Return a text as CDR of rcl_interfaces/msg/Log."""
    front = struct.pack("<iIB", *_stamp(time), _LEVELS.get(text.level, _DEBUG))
    made = _with_strings(front, (_NAME, text.text, "", ""))
    return made + b"\0" * (-len(made) % 4) + struct.pack("<I", 0)


def _decoded(event: Event, time: int) -> bytes:
    """Return an event as CDR of its type."""
    return _with_strings(struct.pack("<iIIH", *_stamp(time), event.number, event.sequence), values_of(event))


def _stamp(time: int) -> tuple[int, int]:
    return divmod(min(time, _LARGEST), 10**9)


def _with_strings(front: bytes, texts: Iterable[str]) -> bytes:
    """Return CDR of some values and texts behind them."""
    made = bytearray(USUAL + b"\0\0" + front)
    for text in texts:
        data = text.encode() + b"\0"
        made += b"\0" * (-len(made) % 4) + struct.pack("<I", len(data)) + data
    return bytes(made)
