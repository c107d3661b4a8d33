"""Tests of reading several topics in one pass: `Log.tables`, `Log.frames`, and loops over topics."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer as McapWriter

from msggen import recordings
from msggen.exports.convert import convert
from msggen.recordings.log import ahead
from msggen.recordings.log.reader import Reader

START = 1_790_000_000_000_000_000
COUNT = 12


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with twelve topics of 50 samples, and an empty one."""
    found = tmp_path / "flight.mcap"
    with found.open("wb") as file:
        writer = McapWriter(file, chunk_size=4000)
        writer.start("ros2")
        schema = writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\n")
        channels = [writer.register_channel(f"/t{number:02}", "cdr", schema) for number in range(COUNT)]
        writer.register_channel("/t00empty", "cdr", schema)
        for number in range(50 * COUNT):
            payload = b"\0\1\0\0" + struct.pack("<Q", number)
            writer.add_message(channels[number % COUNT], START + number, payload, START)
        writer.finish()
    return found


@pytest.fixture
def passes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of topics of each pass."""
    found: list[int] = []
    rows = Reader.rows

    def counted(reader: Reader, topics: Sequence[Any], low: int, high: int) -> Any:
        found.append(len(topics))
        return rows(reader, topics, low, high)

    monkeypatch.setattr(Reader, "rows", counted)
    return found


def test_tables_and_frames_are_those_of_each_topic(path: Path, passes: list[int]) -> None:
    with recordings.open(path) as log:
        tables = dict(log.tables())
        assert passes == [COUNT + 1]
        for key in log.keys()[::-1]:
            assert tables[key].equals(log.table(key))
        assert [key for key, _ in log.tables(["/t03", "/t01*"])] == ["/t03", "/t01"]
        for key, frame in log.frames(["/t02"], start=0, stop=1):
            assert frame.equals(log.frame(key))
        for key, table in log.tables(["/t02"], times=True):
            assert table.equals(log.table(key, times=True))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_loop_over_the_topics_takes_few_passes(storage: str, path: Path, passes: list[int], tmp_path: Path) -> None:
    """A database does not tell how many samples a topic has."""
    with recordings.open(path) as log:
        convert(log, str(tmp_path / "bag"), format="rosbag2", storage=storage)
    with recordings.open(tmp_path / "bag") as log:
        assert list(dict(log.tables())) == log.keys()
        assert len(passes) == 1
        whole = log.load()
        passes.clear()
        for key in log:
            assert log[key].tolist() == whole[key].array.tolist()
        assert sum(passes) == COUNT  # not the empty topic
        assert len(passes) == 1
        passes.clear()
        log["/t05"][:] = 0
        assert passes == [1]
        assert log["/t05"].tolist() == whole["/t05"].array.tolist()


@pytest.mark.parametrize("size", [1, 50 * 24, 50 * 24 * 3, 50 * 24 * 100])
def test_passes_are_bounded(size: int, path: Path, passes: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ahead, "BOUND", size)
    with recordings.open(path) as log:
        expected = log.load()
        passes.clear()
        assert {key: table["number"].to_pylist() for key, table in log.tables()} == {
            key: each.array["number"].tolist() for key, each in expected.items()
        }
        assert max(passes) <= max(size // (50 * 24), 1) + 1  # the empty topic
        for key in log:
            assert log[key].tolist() == expected[key].array.tolist()


def test_topics_in_another_order_are_read_alone(path: Path, passes: list[int]) -> None:
    with recordings.open(path) as log:
        for number in (3, 4, 8, 2, 9, 1, 1):
            log.samples(f"/t{number:02}")
        assert passes == [1] * 7


def test_a_closed_log_gives_nothing_that_was_read_ahead(path: Path) -> None:
    with recordings.open(path) as log:
        for key in log.keys()[:5]:
            log.samples(key)
    with pytest.raises(recordings.RecordingError, match="is closed"):
        log.samples("/t07")
