"""Tests that files which are read do not stay in memory."""

from __future__ import annotations

import mmap
import struct
import sys
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.exports.writer import Channel, Writer
from msggen.recordings.source.memory import drop_pages
from support.databases import Stored, write_database
from support.examples import by_day

SIZE = 16 << 20

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells which pages are in memory")


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.recordings.source.memory.LARGE", SIZE)


def resident_bytes(path: Path) -> int:
    """Return how many bytes of a mapped file are in the memory of this process."""
    found, is_it = 0, False
    for line in Path("/proc/self/smaps").read_text(encoding="utf-8").splitlines():
        words = line.split()
        if "-" in words[0] and not words[0].endswith(":"):
            is_it = line.endswith(str(path))
        elif is_it and words[0] == "Rss:":
            found += int(words[1]) * 1024
    return found


def test_pages_are_dropped_and_can_be_read_again(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(Random(1).randbytes(SIZE))  # noqa: S311 - no secret
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        octets = np.frombuffer(mapped, np.uint8)
        total = int(octets.sum())
        assert resident_bytes(path) == SIZE
        drop_pages(octets)
        assert resident_bytes(path) == 0
        assert int(octets.sum()) == total
        del octets


def test_small_files_and_arrays_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(Random(1).randbytes(SIZE - 1))  # noqa: S311 - no secret
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        octets = np.frombuffer(mapped, np.uint8)
        total = int(octets.sum())
        drop_pages(octets)
        assert resident_bytes(path) == SIZE
        copy = np.concatenate([octets, octets])
        drop_pages(copy)
        assert int(copy.sum()) == 2 * total
        del octets


def test_a_database_is_not_kept_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.recordings.files.rosbag2.sqlite_pages._BATCH", 1 << 20)
    chance = Random(1)  # noqa: S311 - no secret
    rows = [(1, number, b"\0\1\0\0" + chance.randbytes(1000)) for number in range(SIZE // 1000)]
    path = write_database(tmp_path / "flight.db3", [Stored(1, "/a", "a/msg/A")], rows)
    with recordings.open(path) as log:
        largest = max(resident_bytes(path) for _ in log.undecoded())
        assert largest < path.stat().st_size // 2
        assert sum(topic.count for topic in log.topics) == len(rows)
        assert resident_bytes(path) < path.stat().st_size // 2


@by_day("name", ["flight.ulg", "flight.mcap", "unindexed.mcap"], 3)
def test_a_recording_is_not_kept_in_memory(
    name: str, px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.recordings.source.gather.WINDOW", 1 << 20)
    monkeypatch.setattr("msggen.recordings.files.ulog.messages.WINDOW", 1 << 20)
    monkeypatch.setattr("msggen.recordings.files.mcap.reader._GROUP", 1 << 20)
    path = tmp_path / name
    info = px4_types.VehicleStatus.__msg__
    chance = Random(1)  # noqa: S311 - no secret
    if name == "flight.ulg":
        data = bytearray(b"ULog\x01\x12\x35\x01" + bytes(8))
        for kind, content in (("F", b"a:uint64_t timestamp;uint8_t[992] data;"), ("A", bytes(3) + b"a")):
            data += struct.pack("<HB", len(content), ord(kind)) + content
        for number in range(SIZE // 1000 + 40):
            data += struct.pack("<HBHQ", 1002, ord("D"), 0, number) + chance.randbytes(992)
        path.write_bytes(data)
    else:
        writer = Writer(str(path), "none")
        channel = writer.add_channel(Channel("/a", info.ros_type, info.definition, ""))
        for number in range(SIZE // 1000 + 40):
            writer.write(channel, number, number, b"\0\1\0\0" + chance.randbytes(1000))
        if name == "flight.mcap":
            writer.close()
        else:
            writer.flush()
            writer.abandon()
    with recordings.open(path) as log:
        assert resident_bytes(path) < SIZE // 2
        assert max(resident_bytes(path) for _ in log.undecoded()) < SIZE // 2
