"""A writer of MCAP files for ROS 2, whole after each `flush`.

The package `mcap` writes the records (https://mcap.dev/spec). This module gives channels the metadata that rosbag2
writes, and ends the file after each chunk, so that every reader can read it even if the program is killed.
"""

from __future__ import annotations

import os
from typing import Any, NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType
from mcap.writer import Writer as McapWriter

from msggen.base.version import __version__
from msggen.recordings.files.qos import QOS, QOS_VERSION

COMPRESSIONS = ("zstd", "lz4", "none")
CHUNK = 768 * 1024
"""The size of a chunk in bytes before compression, as rosbag2 has it."""


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
    """A new file. Raises OSError, FileExistsError among them."""

    def __init__(self, path: str, compression: str = "zstd") -> None:
        self.path = path
        self._file = _WholeFile(path)
        file: Any = self._file  # what the writer uses of a file
        self._writer = McapWriter(file, chunk_size=CHUNK, compression=_COMPRESSIONS[compression])
        self._writer.start("ros2", f"msggen {__version__}")
        self._writer.add_metadata("rosbag2", QOS_VERSION)
        self._schemas: dict[tuple[str, str], int] = {}
        try:
            self._file.flush()
        except OSError:
            self._file.close()
            os.remove(path)
            raise

    @property
    def size(self) -> int:
        """The bytes of the file, without the chunk that is not complete yet."""
        return self._file.size

    def add_channel(self, channel: Channel) -> int:
        """Add a topic, and return its number."""
        key = channel.ros_type, channel.definition
        schema = self._schemas.get(key)
        if schema is None:
            encoding = "ros2msg" if channel.definition else ""  # rosbag2 writes unknown definitions like this
            schema = self._writer.register_schema(channel.ros_type, encoding, channel.definition.encode())
            self._schemas[key] = schema
        metadata = {"offered_qos_profiles": QOS}
        if channel.type_hash:
            metadata["topic_type_hash"] = channel.type_hash
        return self._writer.register_channel(channel.topic, "cdr", schema, metadata)

    def write(self, channel: int, log_time: int, publish_time: int, payload: bytes) -> None:
        """Add a sample. Times are in ns since 1970, and `payload` is CDR with its header."""
        self._writer.add_message(channel, log_time, payload, publish_time)

    def flush(self) -> None:
        """Write the chunk to the file. Raises OSError; the file is then whole up to the chunk before."""
        self._writer.flush()

    def sync(self) -> None:
        """Wait until the disk has what was written, so that it survives a loss of power. Raises OSError."""
        self._file.sync()

    def close(self) -> None:
        """Write the rest and the index, and close the file. Raises OSError; the file is then whole without an index."""
        try:
            self._writer.flush()
            self._file.has_tail = False  # the writer ends the file with an index
            self._writer.finish()
            self._file.flush()
            self._file.sync()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is on the disk: whole, without an index."""
        self._file.close()


_COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}


def _tail() -> bytes:
    """Return the end of a file without an index."""
    records = RecordBuilder()
    DataEnd(0).write(records)
    Footer(0, 0, 0).write(records)
    return bytes(records.end()) + MCAP0_MAGIC


class _WholeFile:
    """A file whose end is written with each `flush`, in the same call of the system, over the end before."""

    def __init__(self, path: str) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._waiting: list[bytes] = []
        self._position = 0
        self._tail = _tail()
        self._is_closed = False
        self.size = 0
        """The bytes of the file, without its end."""
        self.has_tail = True
        """Whether to write an end."""

    def write(self, data: bytes) -> int:
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
