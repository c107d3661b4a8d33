"""A writer of MCAP files (https://mcap.dev/spec) for many samples at a time, with an index.

The package `mcap` writes the small records. Chunks and their indexes are made here without a step for each sample.
"""

from __future__ import annotations

import zlib
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
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
from mcap.writer import MCAP0_MAGIC

from msggen.base.version import __version__
from msggen.recordings.files.mcap_channels import IS_LENT
from msggen.recordings.files.mcap_records import ATTACHMENT, METADATA, RECORD
from msggen.recordings.files.qos import QOS, QOS_VERSION, numbered
from msggen.recordings.source.gather import at, groups
from msggen.recordings.source.source import RawSchema, RecordingError
from msggen.recordings.writer import CHUNK

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import IO

    from numpy.typing import NDArray

    from msggen.recordings.convert.payloads import Block
    from msggen.recordings.source.source import Attached

_MESSAGE, _CHUNK, _MESSAGE_INDEX = 5, 6, 7
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
"""What is before the payload of a message."""
_ENTRY = np.dtype([("log", "<u8"), ("start", "<u8")])
"""An entry of a message index."""
_FRONT = 9
"""The opcode and the length of a record, in bytes."""
_MOST_CHANNELS = 1 << 16
_FASTEST = 1
"""The level of compression: for recordings, higher ones take several times as long for a few percent."""


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


class McapWriter:
    """A new file. Raises OSError, FileExistsError among them. It is whole after `close`."""

    def __init__(self, path: str) -> None:
        self._file: IO[bytes] = open(path, "xb")  # noqa: SIM115 - until `close`
        self._compressor = zstandard.ZstdCompressor(level=_FASTEST)
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
        self._file.write(MCAP0_MAGIC)
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
            metadata["offered_qos_profiles"] = numbered(target.qos) or (QOS if "/fmu/out/" in target.topic else "")
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
        encoding = "ros2msg" if target.definition else ""
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
        offset, length = self._file.tell(), _FRONT + len(content)
        self._file.write(RECORD.pack(ATTACHMENT if attached.is_attachment else METADATA, len(content)))
        self._file.write(content)
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
        offset = self._file.tell()
        self._write(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=offset, length=self._file.tell() - offset, name=name))

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
                self._write_chunk(
                    buffer[begin : int(ends[high - 1])], times[chosen], channels[chosen], starts[chosen] - begin
                )
                low = high

    def close(self) -> None:
        """Write the index, and close the file. Raises OSError."""
        try:
            self._write(DataEnd(data_section_crc=0))
            self._write_summary()
            self._file.flush()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is. Can be repeated."""
        self._file.close()

    def _write(self, record: Any) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())

    def _write_chunk(
        self,
        data: NDArray[np.uint8],
        times: NDArray[np.int64],
        channels: NDArray[np.uint16],
        starts: NDArray[np.int64],
    ) -> None:
        """Write messages, which are in the order of their log times, and their index."""
        packed = self._compressor.compress(data.data)
        unsigned = times.astype(np.uint64)  # a damaged time can be 2^63 ns or more
        first, last = int(unsigned.min()), int(unsigned.max())
        kind = b"zstd"
        head = b"".join(
            (
                first.to_bytes(8, "little"),
                last.to_bytes(8, "little"),
                len(data).to_bytes(8, "little"),
                zlib.crc32(data.data).to_bytes(4, "little"),
                len(kind).to_bytes(4, "little"),
                kind,
                len(packed).to_bytes(8, "little"),
            )
        )
        begin = self._file.tell()
        content = len(head) + len(packed)
        self._file.write(_CHUNK.to_bytes(1, "little") + content.to_bytes(8, "little") + head)
        self._file.write(packed)
        place = end = begin + _FRONT + content
        offsets, indexes = {}, []
        for number, chosen in groups(channels):
            entries = np.empty(len(chosen), _ENTRY)
            entries["log"], entries["start"] = times[chosen], starts[chosen]
            size = entries.nbytes
            indexes.append(
                _MESSAGE_INDEX.to_bytes(1, "little")
                + (size + 6).to_bytes(8, "little")
                + number.to_bytes(2, "little")
                + size.to_bytes(4, "little")
                + entries.tobytes()
            )
            offsets[number] = place
            place += len(indexes[-1])
            self.counts[number] += len(chosen)
        self._file.write(b"".join(indexes))
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - begin,
                chunk_start_offset=begin,
                compression=kind.decode(),
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=place - end,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )
        self.first = first if self.first is None else min(self.first, first)
        self.last = max(self.last, last)

    def _write_summary(self) -> None:
        start = self._file.tell()
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
        summary = RecordBuilder()
        offsets = RecordBuilder()
        place = start
        kinds: Sequence[tuple[int, Sequence[Any]]] = (
            (0x03, self.schemas),
            (0x04, self._channels),
            (0x0B, [statistics]),
            (0x08, self._chunks),
            (0x0A, self._attachments),
            (0x0D, self._metadata),
        )
        for opcode, records in kinds:
            builder = RecordBuilder()
            for record in records:
                record.write(builder)
            data = builder.end()
            summary.write(data)
            if data:
                SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(data)).write(offsets)
            place += len(data)
        body = bytes(summary.end()) + bytes(offsets.end())
        footer = RecordBuilder()
        Footer(summary_start=start, summary_offset_start=place, summary_crc=0).write(footer)
        front = bytes(footer.end())[:-4]
        crc = zlib.crc32(body + front)
        self._file.write(body + front + crc.to_bytes(4, "little") + MCAP0_MAGIC)


def _place(buffer: NDArray[np.uint8], starts: NDArray[np.int64], block: Block) -> None:
    """Write the messages of a block to their offsets in a buffer."""
    count, size = block.payloads.shape
    records = np.empty(count, np.dtype([("head", _HEAD), ("payload", f"V{size}")]) if size else _HEAD)
    head = records["head"] if size else records
    head["opcode"], head["length"], head["channel"] = _MESSAGE, _HEAD.itemsize - _FRONT + size, block.channel
    head["sequence"], head["log"], head["publish"] = 0, block.log_times, block.publish_times
    if size:
        records["payload"] = np.ascontiguousarray(block.payloads).view(f"V{size}").reshape(count)
    row = f"V{records.dtype.itemsize}"
    at(buffer, row)[starts] = records.view(row)
