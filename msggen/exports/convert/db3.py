"""A writer of databases of rosbag2: version 4 of the schema of its storage `sqlite3`, as ROS 2 Jazzy has it.

Humble reads them too: what the versions before do not have is in tables and columns of its own.
"""

from __future__ import annotations

import errno
import sqlite3
from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from mcap.records import Channel, Schema

from msggen.recordings.files.rosbag2.qos import offered
from msggen.recordings.source.source import RawSchema

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from msggen.exports.convert.payloads import Block
    from msggen.recordings.files.mcap.writer import Target
    from msggen.recordings.source.source import Attached

DISTRO = "unknown"
"""The release of ROS 2 that has written a recording: none."""
_VERSION = 4
_ENCODINGS = ("ros2msg", "ros2idl")
"""The formats of definitions in databases."""
_TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,
offered_qos_profiles TEXT NOT NULL,type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,
encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""


class Db3Writer:
    """A new file. Raises OSError, FileExistsError among them. It is whole after `close`.

    Its methods are those of `McapWriter`, and its channels and schemas are records of MCAP.
    """

    def __init__(self, path: str) -> None:
        open(path, "xb").close()
        self._path = path
        self._base = _connected(path)
        self._definitions: set[tuple[str, RawSchema]] = set()
        self.channels: list[Channel] = []
        self.schemas: list[Schema] = []
        self.counts: Counter[int] = Counter()
        """The number of samples of each channel."""
        self.first: int | None = None
        self.last = 0
        """The log times of the first and the last sample in ns."""
        self.left_out = 0
        """How many attachments, metadata records and definitions the format has no place for."""
        with _as_os_error(path):
            self._base.executescript(_TABLES)
            self._base.execute("INSERT INTO schema VALUES (?, ?)", (_VERSION, DISTRO))

    def add_channel(self, target: Target) -> int:
        """Add a channel, and return its number."""
        number = len(self.channels)
        qos = offered(target.qos, target.topic) if target.encoding == "cdr" or target.qos else ""
        schema = target.schema or RawSchema(target.ros_type, "ros2msg", target.definition.encode())
        self.schemas.append(Schema(id=number, name=schema.name, encoding=schema.encoding, data=schema.data))
        self.channels.append(
            Channel(
                id=number,
                topic=target.topic,
                message_encoding=target.encoding,
                metadata={"offered_qos_profiles": qos, "topic_type_hash": target.type_hash},
                schema_id=number,
            )
        )
        with _as_os_error(self._path):
            self._base.execute(
                "INSERT INTO topics VALUES (?, ?, ?, ?, ?, ?)",
                (number + 1, target.topic, schema.name, target.encoding, qos, target.type_hash),
            )
            self._add_definition(schema, target.type_hash)
        return number

    def _add_definition(self, schema: RawSchema, type_hash: str) -> None:
        """Add a definition. Those in other formats than ROS 2 has are counted: readers such as rosbags refuse them."""
        if not schema.data or (type_hash, schema) in self._definitions:
            return
        self._definitions.add((type_hash, schema))
        if schema.encoding not in _ENCODINGS:
            self.left_out += 1
            return
        self._base.execute(
            "INSERT INTO message_definitions "
            "(topic_type, encoding, encoded_message_definition, type_description_hash) VALUES (?, ?, ?, ?)",
            (schema.name, schema.encoding, schema.data.decode(errors="replace"), type_hash),
        )

    def add_attached(self, attached: Attached) -> None:
        """Count an attachment or a metadata record, which is not written."""
        del attached
        self.left_out += 1

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Count a metadata record, which is not written."""
        del name, values
        self.left_out += 1

    def write(self, blocks: Sequence[Block]) -> None:
        """Write samples in the order of their log times; of those with the same time, in the order of the blocks."""
        times = np.concatenate([block.log_times for block in blocks])
        if not len(times):
            return
        rows = [row for block in blocks for row in _rows(block)]
        order = np.argsort(times, kind="stable")
        with _as_os_error(self._path):
            self._base.executemany(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                (rows[index] for index in order.tolist()),
            )
        for block in blocks:
            self.counts[block.channel] += len(block.log_times)
        first = int(times.min())
        self.first = first if self.first is None else min(self.first, first)
        self.last = max(self.last, int(times.max()))

    def close(self) -> None:
        """Write what is left, and close the file. Raises OSError."""
        try:
            with _as_os_error(self._path):
                self._base.commit()
        finally:
            self._base.close()

    def abandon(self) -> None:
        """Close the file as it is. Can be repeated."""
        self._base.close()


def add_metadata_text(path: str, version: int, text: str) -> None:
    """Write the text of metadata.yaml into a database, where rosbag2 looks for it first. Raises OSError."""
    with _as_os_error(path):
        base = _connected(path)
        try:
            base.execute("INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)", (version, text))
            base.commit()
        finally:
            base.close()


def _connected(path: str) -> sqlite3.Connection:
    base = sqlite3.connect(path)
    # the folder is moved to its place when it is whole, so nothing has to survive a crash
    base.execute("PRAGMA journal_mode = OFF")
    base.execute("PRAGMA synchronous = OFF")
    return base


def _rows(block: Block) -> Iterator[tuple[int, int, bytes]]:
    data, size = block.payloads.tobytes(), block.payloads.shape[1]
    for index, time in enumerate(block.log_times.tolist()):
        yield block.channel + 1, time, data[index * size : (index + 1) * size]


@contextmanager
def _as_os_error(path: str) -> Iterator[None]:
    """Raise OSError for an error of sqlite3: a full disk, a sample that is too large for a database."""
    try:
        yield
    except sqlite3.Error as error:
        raise OSError(errno.EIO, f"the database cannot be written: {error}", path) from None
