"""A writer of MCAP files for ROS 2 (https://mcap.dev/spec): channels as rosbag2 has them, chunks, and their index.

The package `mcap` writes the small records. A chunk comes with all its messages, which are not touched one by one.
"""

from __future__ import annotations

import zlib
from collections import Counter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.records import Channel as ChannelRecord

from msggen.base.version import __version__
from msggen.recordings.files.mcap.layouts import CHUNK_HEAD, ENTRY, FRONT, INDEX_HEAD, MAGIC, RECORD
from msggen.recordings.files.mcap.metadata import IS_LENT
from msggen.recordings.files.rosbag2.qos import QOS_VERSION, offered
from msggen.recordings.source.source import RawSchema, RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import TypeAlias

    from msggen.recordings.source.source import Attached

    Octets: TypeAlias = bytes | bytearray | memoryview

CHUNK = 768 * 1024
"""The size of a chunk in bytes before compression, as rosbag2 has it."""
_MOST_CHANNELS = 1 << 16
FASTEST, SMALLER = 1, 3
"""Levels of zstd: of a flight log, SMALLER makes files 8 % smaller, and takes 10 % longer with all that is done."""


class Target(NamedTuple):
    """A channel to write."""

    topic: str
    ros_type: str
    definition: str
    encoding: str = "cdr"
    type_hash: str = ""
    qos: str = ""
    schema: RawSchema | None = None
    metadata: tuple[tuple[str, str], ...] = ()
    """As in a channel of a recording."""
    is_lent: bool = False
    """Whether the definition was not recorded."""


class Chunk(NamedTuple):
    """Messages with their heads, and where they are."""

    data: Octets
    first: int
    last: int
    """The least and the largest log time in ns."""
    entries: Mapping[int, Octets]
    """For each channel, an INDEX_ENTRY of each of its messages."""


class Sink(Protocol):
    """A file that is only appended to."""

    def write(self, data: Octets, /) -> int:
        """Append bytes."""

    def tell(self) -> int:
        """Return the position of the next byte."""


class ChunkWriter:
    """Writes a file, which is whole after `finish`. Raises OSError of the file."""

    def __init__(self, file: Sink, compression: str = "zstd", level: int = FASTEST) -> None:
        self._sink = file
        self._compression = compression
        self._compress = _COMPRESSORS[compression](level)
        self._schemas: dict[RawSchema, Schema] = {}
        self._channels: list[ChannelRecord] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self.counts: Counter[int] = Counter()
        """The number of samples of each channel."""
        self.first: int | None = None
        self.last = 0
        """The log times of the first and the last sample in ns."""
        file.write(MAGIC)
        self._write(Header(profile="ros2", library=f"msggen {__version__}"))
        self.add_metadata("rosbag2", QOS_VERSION)

    @property
    def channels(self) -> Sequence[ChannelRecord]:
        """The channels."""
        return self._channels

    @property
    def schemas(self) -> Sequence[Schema]:
        """The definitions."""
        return list(self._schemas.values())

    def add_channel(self, target: Target) -> int:
        """Add a channel, and return its number. Raises RecordingError if the format has no number for it."""
        if len(self._channels) == _MOST_CHANNELS:
            raise RecordingError(f"an MCAP file has at most {_MOST_CHANNELS} channels, and these topics need more")
        metadata = dict(target.metadata)
        if target.encoding == "cdr" or target.qos:
            metadata["offered_qos_profiles"] = offered(target.qos, target.topic)
        if target.type_hash:
            metadata["topic_type_hash"] = target.type_hash
        if target.is_lent:
            metadata[IS_LENT] = "true"
        channel = ChannelRecord(
            id=len(self._channels),
            topic=target.topic,
            message_encoding=target.encoding,
            metadata=metadata,
            schema_id=self._schema_of(target),
        )
        self._channels.append(channel)
        self._write(channel)
        return channel.id

    def _schema_of(self, target: Target) -> int:
        """Return the number of a schema, 0 if there is none."""
        encoding = "ros2msg" if target.definition else ""  # rosbag2 writes unknown definitions like this
        raw = target.schema or RawSchema(target.ros_type, encoding, target.definition.encode())
        if not any(raw):
            return 0
        if raw not in self._schemas:
            number = len(self._schemas) + 1
            self._schemas[raw] = Schema(id=number, name=raw.name, encoding=raw.encoding, data=raw.data)
            self._write(self._schemas[raw])
        return self._schemas[raw].id

    def add_attached(self, attached: Attached) -> None:
        """Add an attachment or a metadata record as it is in another file."""
        name, content = attached.name, attached.content
        offset, length = self._sink.tell(), FRONT + len(content)
        opcode = Opcode.ATTACHMENT if attached.is_attachment else Opcode.METADATA
        self._sink.write(RECORD.pack(opcode, len(content)))
        self._sink.write(content)
        if not attached.is_attachment:
            self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))
            return
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                log_time=attached.log_time,
                create_time=attached.create_time,
                data_size=attached.size,
                name=name,
                media_type=attached.media_type,
            )
        )

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        offset = self._sink.tell()
        self._write(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=offset, length=self._sink.tell() - offset, name=name))

    def add_chunk(self, chunk: Chunk) -> None:
        """Add messages, and their index."""
        packed = self._compress(chunk.data)
        kind = b"" if self._compression == "none" else self._compression.encode()
        begin = self._sink.tell()
        head = b"".join(
            (
                CHUNK_HEAD.pack(chunk.first, chunk.last, len(chunk.data), zlib.crc32(chunk.data)),
                len(kind).to_bytes(4, "little"),
                kind,
                len(packed).to_bytes(8, "little"),
            )
        )
        self._sink.write(RECORD.pack(Opcode.CHUNK, len(head) + len(packed)) + head)
        self._sink.write(packed)
        place = end = begin + FRONT + len(head) + len(packed)
        offsets, indexes = {}, []
        for number, entries in sorted(chunk.entries.items()):
            octets = bytes(entries)
            size = len(octets)
            indexes.append(INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, size + 6, number, size) + octets)
            offsets[number] = place
            place += len(indexes[-1])
            self.counts[number] += size // ENTRY
        self._sink.write(b"".join(indexes))
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - begin,
                chunk_start_offset=begin,
                compression=kind.decode(),
                compressed_size=len(packed),
                message_end_time=chunk.last,
                message_index_length=place - end,
                message_index_offsets=offsets,
                message_start_time=chunk.first,
                uncompressed_size=len(chunk.data),
            )
        )
        self.first = chunk.first if self.first is None else min(self.first, chunk.first)
        self.last = max(self.last, chunk.last)

    def finish(self) -> None:
        """Write the index, and the end of the file."""
        self._write(DataEnd(data_section_crc=0))
        start = self._sink.tell()
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self.counts),
            chunk_count=len(self._chunks),
            message_count=sum(self.counts.values()),
            message_end_time=self.last,
            message_start_time=self.first or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        kinds: Sequence[tuple[Opcode, Sequence[Any]]] = (
            (Opcode.SCHEMA, self.schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary, offsets, place = [], [], start
        for opcode, records in kinds:
            data = packed_records(records)
            if data:
                summary.append(data)
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(data)))
            place += len(data)
        body = b"".join((*summary, packed_records(offsets)))
        footer = packed_records([Footer(summary_start=start, summary_offset_start=place, summary_crc=0)])
        crc = zlib.crc32(body + footer[:-4])
        self._sink.write(body + footer[:-4] + crc.to_bytes(4, "little") + MAGIC)

    def _write(self, record: Any) -> None:
        self._sink.write(packed_records([record]))


def packed_records(records: Sequence[Any]) -> bytes:
    """Return small records of `mcap` as they are in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


def unindexed_end() -> bytes:
    """Return the end of a file without an index."""
    end = (DataEnd(data_section_crc=0), Footer(summary_start=0, summary_offset_start=0, summary_crc=0))
    return packed_records(end) + MAGIC


def _zstd(level: int) -> Callable[[Octets], bytes]:
    import zstandard

    return zstandard.ZstdCompressor(level=level).compress


def _lz4(_: int) -> Callable[[Octets], bytes]:
    import lz4.frame

    compress: Callable[[Octets], bytes] = lz4.frame.compress
    return compress


_COMPRESSORS: Mapping[str, Callable[[int], Callable[[Octets], bytes]]] = MappingProxyType(
    {"zstd": _zstd, "lz4": _lz4, "none": lambda _: bytes}
)
COMPRESSIONS = tuple(_COMPRESSORS)
"""The compressions of chunks."""
