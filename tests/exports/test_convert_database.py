"""Tests of recordings as databases of rosbag2: what rosbags reads in them, and the tables that it writes itself."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from msggen import recordings
from msggen.base.recording_formats import STORAGES
from msggen.cli import main
from msggen.exports.convert import convert, join
from msggen.exports.convert import db3 as module
from support.examples import by_day
from support.flights import TEXTS, TOPICS, same_columns, write_flight
from support.recordings import START, read_ours, read_rosbags
from support.ulog import write_ulog

COUNT = 200


@pytest.fixture
def flight(px4_types: Any, tmp_path: Path) -> Path:
    return write_flight(tmp_path / "flight.mcap", px4_types, COUNT)


def written(path: Path, target: Path, **options: Any) -> recordings.Log:
    """Convert a recording to a folder with a database, and open it."""
    with recordings.open(path) as log:
        convert(log, str(target), format="rosbag2", storage="sqlite3", **options)
    return recordings.open(target)


def rows(path: Path, query: str) -> list[Any]:
    with closing(sqlite3.connect(path)) as base:
        return base.execute(query).fetchall()


@by_day("waiting", [10_000, 1, 10_000_000], 3)
def test_rosbags_reads_the_same_as_in_the_original(
    flight: Path, tmp_path: Path, waiting: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.exports.convert.payloads.WAITING", waiting)
    original_path = tmp_path / "original.mcap"
    with recordings.open(flight) as log:
        convert(log, str(original_path), format="mcap", topics=[*TOPICS, TEXTS[0]])
    written(original_path, tmp_path / "bag").close()
    assert sorted(os.listdir(tmp_path / "bag")) == ["bag_0.db3", "metadata.yaml"]
    expected = read_rosbags(original_path)
    assert read_rosbags(tmp_path / "bag") == expected
    with AnyReader([original_path]) as original, AnyReader([tmp_path / "bag"]) as bag:
        for name in ("message_count", "start_time", "end_time"):
            assert getattr(bag, name) == getattr(original, name)
        assert {each.topic: (each.msgtype, each.msgdef) for each in bag.connections} == {
            each.topic: (each.msgtype, each.msgdef) for each in original.connections
        }
        for one, other in zip(original.messages(), bag.messages(), strict=True):
            found = [reader.deserialize(each[2], each[0].msgtype) for reader, each in ((original, one), (bag, other))]
            assert repr(found[0]) == repr(found[1])


def test_we_read_the_same_columns(flight: Path, tmp_path: Path) -> None:
    with written(flight, tmp_path / "bag") as copy, recordings.open(flight) as log:
        same_columns(log, copy)
        assert [each.text for each in copy.problems] == ["/json is not decoded: samples in 'json', expected cdr"]
        convert(log, str(tmp_path / "copy.mcap"), format="mcap")
        with recordings.open(tmp_path / "copy.mcap") as other:
            channels, expected = (
                [each.channels[0][1]._replace(number=0, sample_count=0, schema=None, metadata=()) for each in topics]
                for topics in (copy.topics, other.topics)
            )
            assert channels == expected
        assert copy.notes == []


def test_the_tables_are_those_of_rosbag2(flight: Path, tmp_path: Path) -> None:
    written(flight, tmp_path / "bag").close()
    theirs = tmp_path / "theirs.db3"
    with closing(sqlite3.connect(theirs)) as base:
        base.executescript(Sqlite3Writer.SQLITE_SCHEMA)
    path = tmp_path / "bag" / "bag_0.db3"
    names = "SELECT type, name, tbl_name FROM sqlite_master ORDER BY name"
    assert rows(path, names) == rows(theirs, names)
    for kind, name, _ in rows(path, names):
        if kind == "table":
            assert rows(path, f"PRAGMA table_info({name})") == rows(theirs, f"PRAGMA table_info({name})")
    assert rows(path, "PRAGMA index_info(timestamp_idx)") == rows(theirs, "PRAGMA index_info(timestamp_idx)")
    assert rows(path, "SELECT schema_version FROM schema") == rows(theirs, "SELECT schema_version FROM schema")
    assert rows(path, "PRAGMA integrity_check") == [("ok",)]
    # as ros2 bag info of Humble asks
    query = (
        "SELECT name, type, serialization_format, COUNT(messages.id), MIN(messages.timestamp), offered_qos_profiles "
        "FROM messages JOIN topics ON topics.id = messages.topic_id GROUP BY topics.name"
    )
    assert {row[3] for row in rows(path, query)} == {COUNT}


def test_metadata_is_that_of_the_database(flight: Path, tmp_path: Path) -> None:
    written(flight, tmp_path / "bag").close()
    content = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8"))
    information = content["rosbag2_bagfile_information"]
    path = tmp_path / "bag" / "bag_0.db3"
    ((version, text),) = rows(path, "SELECT metadata_version, metadata FROM metadata")
    assert (version, yaml.safe_load(text)) == (information["version"], information)
    ((first, last, count),) = rows(path, "SELECT min(timestamp), max(timestamp), count(*) FROM messages")
    assert information["storage_identifier"] == "sqlite3"
    assert information["relative_file_paths"] == ["bag_0.db3"]
    assert information["starting_time"] == {"nanoseconds_since_epoch": first} == {"nanoseconds_since_epoch": START}
    assert information["duration"] == {"nanoseconds": last - first}
    assert information["message_count"] == count
    counts = dict(
        rows(path, "SELECT name, count(*) FROM messages JOIN topics ON topics.id = topic_id GROUP BY topics.id")
    )
    assert {
        each["topic_metadata"]["name"]: each["message_count"] for each in information["topics_with_message_count"]
    } == counts


def test_a_ulog_becomes_a_database_and_its_facts_are_told(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "flight.ulg")
    with recordings.open(path) as log:
        converted = convert(log, str(tmp_path / "bag"), format="rosbag2", storage="sqlite3")
        assert any("records not written: a database has no place for" in each for each in converted.notes)
        convert(log, str(tmp_path / "mcap"), format="rosbag2")
    assert read_rosbags(tmp_path / "bag") == read_rosbags(tmp_path / "mcap")


def test_several_recordings_become_one(px4_types: Any, tmp_path: Path) -> None:
    paths = [
        write_flight(tmp_path / f"{number}.mcap", px4_types, 50, number, START + number * 300_000_123)
        for number in range(3)
    ]
    logs = [recordings.open(path) for path in paths]
    for storage in STORAGES:
        join(logs, str(tmp_path / storage), format="rosbag2", storage=storage)
    with recordings.open(tmp_path / STORAGES[0]) as one, recordings.open(tmp_path / STORAGES[1]) as other:
        assert list(one.payloads()) == list(other.payloads())
    with pytest.raises(ValueError, match="expected one of mcap, sqlite3, got 'oracle'"):
        join(logs, str(tmp_path / "x"), format="rosbag2", storage="oracle")


def test_a_full_disk_leaves_nothing(flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    connect = module._connected

    def small(path: str) -> sqlite3.Connection:
        base = connect(path)
        base.execute("PRAGMA max_page_count = 20")
        return base

    monkeypatch.setattr(module, "_connected", small)
    with recordings.open(flight) as log, pytest.raises(OSError, match="database or disk is full") as error:
        convert(log, str(tmp_path / "bag"), format="rosbag2", storage="sqlite3")
    assert error.value.strerror
    assert os.listdir(tmp_path) == ["flight.mcap"]


def test_the_command_has_the_storage(
    flight: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(flight.parent)
    convert_ = ["log", "convert", "flight.mcap"]
    main([*convert_, "--format", "rosbag2", "--storage", "sqlite3", "-o", os.fsdecode(b"b\xff")])
    assert read_ours(os.fsdecode(b"b\xff")) == read_ours("flight.mcap")
    for words, expected in (
        (["--storage", "sqlite3"], "argument --storage: only with --format rosbag2, not parquet"),
        (["-o", "x.db3"], "a folder is written: --format rosbag2 --storage sqlite3 -o x\n"),
        (["--format", "rosbag2", "--storage", "sqlite"], "did you mean 'sqlite3'?"),
    ):
        with pytest.raises(SystemExit):
            main([*convert_, *words])
        assert expected in capsys.readouterr().err
