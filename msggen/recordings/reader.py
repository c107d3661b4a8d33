"""A reader of MCAP files, as much as playing needs. Files that were cut off are read up to their last whole chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader

if TYPE_CHECKING:
    from mcap.summary import Summary


class RecordingError(ValueError):
    """A file that cannot be read as a recording."""


class Topic(NamedTuple):
    """A topic of a recording."""

    name: str
    """The name in ROS 2: `/fmu/out/vehicle_status_v4`."""
    ros_type: str
    """The type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
    definition: str
    """The definition with all that it nests, or "" if the recording has none that is `ros2msg`."""


class Sample(NamedTuple):
    """A sample of a recording."""

    topic: str
    time: int
    """The time at which it was recorded, in ns since 1970."""
    payload: bytes
    """CDR with its header."""


class Recording:
    """A file. Raises RecordingError, and OSError if it cannot be opened.

    `topics` has those with CDR samples, by name. `first` and `last` are the times in ns of the first and the last
    sample, both 0 without one.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.first = self.last = 0
        summary = self._summary()
        self.is_indexed = summary is not None
        """Whether the file was ended. If it was cut off, its samples are read in the order in which they came."""
        if summary is not None:
            for channel in summary.channels.values():
                self._add(channel, summary.schemas)
            if summary.statistics is not None:
                self.first, self.last = summary.statistics.message_start_time, summary.statistics.message_end_time
        else:
            self._scan()

    def samples(self, start: int, takes: Callable[[str], bool] = lambda _: True) -> Iterator[Sample]:
        """Yield the samples from a time in ns on, of the topics that `takes` accepts. Raises RecordingError."""
        names = [name for name in self.topics if takes(name)]
        if not self.is_indexed:
            yield from (each for each in self._unindexed() if each.time >= start and each.topic in names)
            return
        with open(self.path, "rb") as file:
            try:
                for _, channel, message in make_reader(file).iter_messages(names, starting_at=start):
                    if channel.message_encoding == "cdr":
                        yield Sample(channel.topic, message.log_time, message.data)
            except _DAMAGE as error:
                raise RecordingError(f"is damaged: {error}") from error

    def _summary(self) -> Summary | None:
        """Return the index of the file, or None if it has none. Raises RecordingError."""
        with open(self.path, "rb") as file:
            try:
                reader = make_reader(file)
            except _DAMAGE:
                raise RecordingError("is not an MCAP file") from None
            try:
                summary = reader.get_summary()
            except _DAMAGE:
                return None
        if summary is None or summary.statistics is None or not summary.chunk_indexes:
            return None
        counts = summary.statistics.schema_count, summary.statistics.channel_count
        return summary if (len(summary.schemas), len(summary.channels)) == counts else None

    def _scan(self) -> None:
        for sample in self._unindexed():
            self.first = min(self.first or sample.time, sample.time)
            self.last = max(self.last, sample.time)

    def _unindexed(self) -> Iterator[Sample]:
        """Yield the samples in the order of the file, and add the topics before their first samples."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in _records(self.path):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
                self._add(record, schemas)
            elif isinstance(record, Message):
                channel = channels.get(record.channel_id)
                if channel is not None and channel.message_encoding == "cdr":
                    yield Sample(channel.topic, record.log_time, record.data)

    def _add(self, channel: Channel, schemas: dict[int, Schema]) -> None:
        """Add a topic, unless it is known or its type is not."""
        schema = schemas.get(channel.schema_id)
        if schema is None or channel.message_encoding != "cdr" or channel.topic in self.topics:
            return
        package, _, name = schema.name.replace("::", "/").partition("/")
        definition = schema.data.decode(errors="replace") if schema.encoding == "ros2msg" else ""
        ros_type = f"{package}/msg/{name.rpartition('/')[2]}"
        self.topics[channel.topic] = Topic(channel.topic, ros_type, definition)


def _records(path: str) -> Iterator[McapRecord]:
    """Yield the records up to the end of the file, or to the place where it is cut off or damaged."""
    with open(path, "rb") as file:
        records = iter(StreamReader(file).records)
        while True:
            try:
                record = next(records, None)
            except _DAMAGE:
                return
            if record is None:
                return
            yield record


def _errors() -> tuple[type[Exception], ...]:
    """Return what the readers raise for damaged files: their own errors, and those of the decompression."""
    from struct import error
    from zlib import error as zlib_error

    from zstandard import ZstdError

    # an OSError if a file is shorter than its last record
    return McapError, ZstdError, OSError, RuntimeError, ValueError, EOFError, IndexError, KeyError, error, zlib_error


_DAMAGE = _errors()
