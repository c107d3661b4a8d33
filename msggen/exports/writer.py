"""A writer of MCAP files for ROS 2, whole after each `flush`.

It ends the file after each chunk, so that every reader can read it even if the program is killed.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from msggen.recordings.files.mcap.layouts import FRONT, INDEX_ENTRY, MESSAGE_HEAD
from msggen.recordings.files.mcap.metadata import CLOCK
from msggen.recordings.files.mcap.writer import CHUNK, COMPRESSIONS, SMALLER, Chunk, ChunkWriter, Target, unindexed_end
from msggen.recordings.files.rosbag2.qos import QOS

if TYPE_CHECKING:
    from msggen.recordings.files.mcap.writer import Octets

__all__ = ["COMPRESSIONS", "Channel", "Writer"]

_MESSAGE = int(Opcode.MESSAGE)
_PLAIN = MESSAGE_HEAD.size - FRONT
"""The length of a message without a payload."""


class Channel(NamedTuple):
    """A topic in a recording."""

    topic: str
    """The name in ROS 2: `/fmu/out/vehicle_status_v4`."""
    ros_type: str
    """The type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
    definition: str
    """The definition with all that it nests, as `__msg__.definition` of a generated class, or "" if it is unknown."""
    type_hash: str
    """The type hash of ROS 2 (RIHS01), or "" if it is unknown."""


class Writer:
    """A new file, with a note on the clock of its messages. Raises OSError, FileExistsError among them."""

    def __init__(self, path: str, compression: str = "zstd", clock: str = "") -> None:
        self.path = path
        self._file = _WholeFile(path)
        self._data = bytearray()
        """The messages of the chunk that is not complete yet."""
        self._entries: dict[int, bytearray] = {}
        self._times: list[int] = []
        try:
            self._writer = ChunkWriter(self._file, compression, SMALLER)
            if clock:
                self._writer.add_metadata(CLOCK, {"notes": clock})
            self._file.flush()
        except (OSError, ImportError):
            self._file.close()
            os.remove(path)
            raise

    @property
    def size(self) -> int:
        """The bytes of the file, without the chunk that is not complete yet."""
        return self._file.size

    def add_channel(self, channel: Channel) -> int:
        """Add a topic, and return its number."""
        topic, ros_type, definition, type_hash = channel
        return self._writer.add_channel(Target(topic, ros_type, definition, type_hash=type_hash, qos=QOS))

    def write(self, channel: int, log_time: int, publish_time: int, payload: bytes) -> None:
        """Add a sample. Times are in ns since 1970, and `payload` is CDR with its header."""
        data = self._data
        head = MESSAGE_HEAD.pack(_MESSAGE, _PLAIN + len(payload), channel, 0, log_time, publish_time)
        entry = INDEX_ENTRY.pack(log_time, len(data))
        data += head
        data += payload
        try:
            self._entries[channel] += entry
        except KeyError:
            self._entries[channel] = bytearray(entry)
        self._times.append(log_time)
        if len(data) >= CHUNK:
            self._end_chunk()

    def _end_chunk(self) -> None:
        if self._data:
            times = self._times
            self._writer.add_chunk(Chunk(self._data, min(times), max(times), self._entries))
            self._data, self._entries, self._times = bytearray(), {}, []

    def flush(self) -> None:
        """Write the chunk to the file. Raises OSError; the file is then whole up to the chunk before."""
        self._end_chunk()
        self._file.flush()

    def sync(self) -> None:
        """Wait until the disk has what was written, so that it survives a loss of power. Raises OSError."""
        self._file.sync()

    def close(self) -> None:
        """Write the rest and the index, and close the file. Raises OSError; the file is then whole without an index."""
        try:
            self.flush()
            self._file.has_tail = False  # the index ends the file
            self._writer.finish()
            self._file.flush()
            self._file.sync()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is on the disk: whole, without an index."""
        self._file.close()


class _WholeFile:
    """A file whose end is written with each `flush`, in the same call of the system, over the end before."""

    def __init__(self, path: str) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._waiting: list[bytes] = []
        self._position = 0
        self._tail = unindexed_end()
        self._is_closed = False
        self.size = 0
        """The bytes of the file, without its end."""
        self.has_tail = True
        """Whether to write an end."""

    def write(self, data: Octets, /) -> int:
        """Keep bytes until `flush`."""
        self._waiting.append(bytes(data))
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the position of the next byte."""
        return self._position

    def flush(self) -> None:
        """Write what waits, and the end of the file. Raises OSError; the file then ends where it did before."""
        data = b"".join(self._waiting) + (self._tail if self.has_tail else b"")
        self._waiting.clear()
        try:
            self._write_at(self.size, data)
        except OSError:
            self._write_at(self.size, self._tail)  # over the end before, so it needs no space
            os.ftruncate(self._descriptor, self.size + len(self._tail))
            raise
        self.size = self._position

    def _write_at(self, place: int, data: bytes) -> None:
        os.lseek(self._descriptor, place, os.SEEK_SET)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]

    def sync(self) -> None:
        """Wait until the disk has what was written."""
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Close the file. What waits is dropped. Can be repeated."""
        if not self._is_closed:
            self._is_closed = True
            os.close(self._descriptor)
