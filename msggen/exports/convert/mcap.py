"""A writer of MCAP files for many samples at a time: chunks and their indexes are made without a step for each one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mcap.opcode import Opcode

from msggen.recordings.files.mcap.layouts import FRONT
from msggen.recordings.files.mcap.writer import CHUNK, Chunk, ChunkWriter
from msggen.recordings.source.gather import at, groups

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import IO

    from numpy.typing import NDArray

    from msggen.exports.convert.payloads import Block

_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<u8"),
        ("publish", "<u8"),
    ]
)
"""What is before the payload of a message, as MESSAGE_HEAD."""
_ENTRY = np.dtype([("log", "<u8"), ("start", "<u8")])
"""An entry of a message index, as INDEX_ENTRY."""


class McapWriter(ChunkWriter):
    """A new file. Raises OSError, FileExistsError among them. It is whole after `close`."""

    def __init__(self, path: str) -> None:
        self._file: IO[bytes] = open(path, "xb")  # noqa: SIM115 - until `close`
        super().__init__(self._file)

    def write(self, blocks: Sequence[Block]) -> None:
        """Write samples in the order of their log times; of those with the same time, in the order of the blocks."""
        times = np.concatenate([block.log_times for block in blocks])
        if not len(times):
            return
        channels = np.concatenate([np.full(len(block.log_times), block.channel, np.uint16) for block in blocks])
        lengths = np.concatenate(
            [np.full(len(block.log_times), _HEAD.itemsize + block.payloads.shape[1], np.int64) for block in blocks]
        )
        order = np.argsort(times, kind="stable")
        ends = np.cumsum(lengths[order])
        starts = np.empty(len(order), np.int64)
        starts[order] = ends - lengths[order]
        buffer = np.empty(int(ends[-1]), np.uint8)
        place = 0
        for block in blocks:
            count = len(block.log_times)
            _place(buffer, starts[place : place + count], block)
            place += count
        # a chunk ends with the first message behind its size
        cuts = np.unique(np.searchsorted(ends, np.arange(CHUNK, int(ends[-1]), CHUNK)))
        low = 0
        for high in [*(cuts + 1).tolist(), len(order)]:
            if high > low:
                chosen = order[low:high]
                begin = int(starts[chosen[0]])
                data = buffer[begin : int(ends[high - 1])]
                self.add_chunk(_chunk(data, times[chosen], channels[chosen], starts[chosen] - begin))
                low = high

    def close(self) -> None:
        """Write the index, and close the file. Raises OSError."""
        try:
            self.finish()
            self._file.flush()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is. Can be repeated."""
        self._file.close()


def _chunk(
    data: NDArray[np.uint8], times: NDArray[np.int64], channels: NDArray[np.uint16], starts: NDArray[np.int64]
) -> Chunk:
    """Return messages, which are in the order of their log times, as a chunk."""
    found = {}
    for number, chosen in groups(channels):
        entries = np.empty(len(chosen), _ENTRY)
        entries["log"], entries["start"] = times[chosen], starts[chosen]
        found[number] = entries.tobytes()
    unsigned = times.astype(np.uint64)  # a damaged time can be 2^63 ns or more
    return Chunk(data.data, int(unsigned.min()), int(unsigned.max()), found)


def _place(buffer: NDArray[np.uint8], starts: NDArray[np.int64], block: Block) -> None:
    """Write the messages of a block to their offsets in a buffer."""
    count, size = block.payloads.shape
    records = np.empty(count, np.dtype([("head", _HEAD), ("payload", f"V{size}")]) if size else _HEAD)
    head = records["head"] if size else records
    head["opcode"], head["length"], head["channel"] = Opcode.MESSAGE, _HEAD.itemsize - FRONT + size, block.channel
    head["sequence"], head["log"], head["publish"] = 0, block.log_times, block.publish_times
    if size:
        records["payload"] = np.ascontiguousarray(block.payloads).view(f"V{size}").reshape(count)
    row = f"V{records.dtype.itemsize}"
    at(buffer, row)[starts] = records.view(row)
