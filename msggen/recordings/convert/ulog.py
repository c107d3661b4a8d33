"""The texts of a ULog as samples of /rosout."""

from __future__ import annotations

import struct
from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.convert.payloads import Block
from msggen.recordings.decode.layouts import USUAL
from msggen.recordings.files.mcap_writer import Target
from msggen.recordings.source.source import SEPARATOR

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from msggen.recordings.convert.selection import Selection
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.facts import Text

_ROSOUT = Target(
    "/rosout",
    "rcl_interfaces/msg/Log",
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n"
    f"{SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
)
"""The topic on which nodes of ROS 2 publish texts."""
_LEVELS = {"emergency": 50, "alert": 50, "critical": 50, "error": 40, "warning": 30, "notice": 20, "info": 20}
_DEBUG = 10
_LARGEST = (1 << 31) * 10**9 - 1
"""The largest time in ns that the type has. A time in a damaged ULog can be larger."""
_NAME = "px4"
"""The name of the node in texts."""


def blocks_of_texts(
    log: Log, selection: Selection, channel_of: Callable[[Target], int], offset: int
) -> Iterator[Block]:
    """Yield the texts of a ULog as samples of /rosout."""
    low, high = selection.limits(log.start)
    by_size: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
    for text in log.texts:
        if low <= text.time < high:
            payload = _log_message(text, text.time + offset)
            by_size[len(payload)].append((text.time + offset, payload))
    for size, found in by_size.items():
        log_times = np.array([time for time, _ in found], np.int64)
        payloads = np.frombuffer(b"".join(payload for _, payload in found), np.uint8).reshape(len(found), size)
        yield Block(channel_of(_ROSOUT), payloads, log_times, log_times)


def _log_message(text: Text, time: int) -> bytes:
    """Return a text as CDR of rcl_interfaces/msg/Log."""
    seconds, nanoseconds = divmod(min(time, _LARGEST), 10**9)
    made = bytearray(USUAL + b"\0\0")
    made += struct.pack("<iIB", seconds, nanoseconds, _LEVELS.get(text.level, _DEBUG))
    for value in (_NAME, text.text, "", ""):
        data = value.encode() + b"\0"
        made += b"\0" * (-len(made) % 4) + struct.pack("<I", len(data)) + data
    return bytes(made + b"\0" * (-len(made) % 4) + struct.pack("<I", 0))
