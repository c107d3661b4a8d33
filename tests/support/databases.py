"""Databases as rosbag2's storage `sqlite3` writes them, made by statements of sqlite3."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from msggen.recordings.source.source import FOREVER, Source

Sample = tuple[int, bytes]
"""A log time in ns and a payload."""

_TOPICS = {
    1: "id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL",
    2: ",offered_qos_profiles TEXT NOT NULL",
    4: ",type_description_hash TEXT NOT NULL",
}
"""The columns of `topics` that each version of the schema adds: Dashing, Foxy, Iron."""
MESSAGES = "id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL"


class Stored(NamedTuple):
    """A row of the table `topics`."""

    number: int
    name: str
    ros_type: str = "px4_msgs/msg/VehicleStatus"
    definition: str = ""
    encoding: str = "cdr"
    type_hash: str = ""
    qos: str = ""


def open_database(  # noqa: PLR0913 - all but the path have defaults
    path: Path,
    topics: Iterable[Stored],
    *,
    page_size: int = 4096,
    version: int = 4,
    messages: str = MESSAGES,
    auto_vacuum: int = 0,
    journal: str = "DELETE",
) -> sqlite3.Connection:
    """Create a database with a version of rosbag2's schema, and return its connection."""
    base = sqlite3.connect(path, isolation_level=None)
    for name, value in (
        ("page_size", page_size),
        ("auto_vacuum", auto_vacuum),
        ("journal_mode", journal),
        ("synchronous", "OFF"),
    ):
        base.execute(f"PRAGMA {name} = {value}")
    base.execute("BEGIN")
    columns = "".join(text for since, text in _TOPICS.items() if since <= version)
    if version >= 3:
        base.execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL)")
        base.execute("INSERT INTO schema VALUES (?, 'test')", (version,))
        base.execute(
            "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL)"
        )
    base.execute(f"CREATE TABLE topics({columns})")
    if version >= 4:
        base.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,"
            "encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL)"
        )
    base.execute(f"CREATE TABLE messages({messages})" if "(" not in messages else messages)
    base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    for each in topics:
        row = (each.number, each.name, each.ros_type, each.encoding, each.qos, each.type_hash)[: columns.count(",") + 1]
        base.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(row))})", row)  # noqa: S608 - known columns
        if version >= 4 and each.definition:
            base.execute(
                "INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, "
                "type_description_hash) VALUES (?, 'ros2msg', ?, ?)",
                (each.ros_type, each.definition, each.type_hash),
            )
    base.execute("COMMIT")
    return base


def insert(base: sqlite3.Connection, rows: Iterable[tuple[int, int, bytes]]) -> None:
    """Insert messages: the number of the topic, the time and the payload. Begins no transaction."""
    base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)


def write_database(
    path: Path, topics: Sequence[Stored], rows: Iterable[tuple[int, int, bytes]], **options: Any
) -> Path:
    """Write a database, close it, and return its path."""
    base = open_database(path, topics, **options)
    base.execute("BEGIN")
    insert(base, rows)
    base.execute("COMMIT")
    base.close()
    return path


def samples_of(source: Source, start: int = 0, stop: int = FOREVER) -> dict[str, list[Sample]]:
    """Return the samples of each topic in the order of a file."""
    found: dict[str, list[Sample]] = defaultdict(list)
    for part in source.parts(source.channels, start, stop):
        data = part.buffer.data
        found[source.channels[part.channel].topic] += [
            (time, bytes(data[place : place + size]))
            for time, place, size in zip(
                part.log_times.tolist(), part.starts.tolist(), part.sizes.tolist(), strict=True
            )
        ]
    return dict(found)


def expected_of(topics: Iterable[Stored], rows: Iterable[tuple[int, int, bytes]]) -> dict[str, list[Sample]]:
    """Return what `samples_of` should find."""
    names = {each.number: each.name for each in topics}
    found: dict[str, list[Sample]] = defaultdict(list)
    for number, time, payload in rows:
        found[names[number]].append((time, payload))
    return dict(found)
