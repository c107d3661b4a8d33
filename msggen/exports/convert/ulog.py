"""The texts of a ULog as samples of /rosout, and its decoded events as samples of /events."""

from __future__ import annotations

import struct
from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from msggen.exports.convert.payloads import Block
from msggen.recordings.decode.encapsulation import USUAL
from msggen.recordings.files.mcap.writer import Target
from msggen.recordings.log.decoded_events import DEFINITION, TOPIC, TYPE, values_of
from msggen.recordings.source.source import SEPARATOR

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from msggen.exports.convert.selection import Selection
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.facts import Event, Text

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
