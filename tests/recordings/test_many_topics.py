"""Tests of recordings with so many topics, chunks or problems that a step for each pair of them would never end."""

from __future__ import annotations

import struct
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from msggen import recordings
from msggen.exports.convert import convert, names
from msggen.exports.convert.types import TypeNames
from msggen.recordings import RecordingError
from msggen.recordings.files.mcap import writer as mcap_writer
from msggen.recordings.files.mcap.channels import Described
from msggen.recordings.files.mcap.reader import McapFile
from msggen.recordings.files.mcap.records import chunk_or_message_from
from msggen.recordings.files.ulog.formats import FormatError, Formats
from msggen.recordings.log.payloads import in_order
from msggen.recordings.source.source import Channel, Part, Problem
from msggen.recordings.topics.choice import names_of
from msggen.recordings.topics.find import by_name, find
from msggen.recordings.topics.topic import Topic
from support.databases import Stored, write_database
from support.log_files import Written, write_log

resource = pytest.importorskip("resource")
runner = pytest.importorskip("fuzz.runner")

MANY = 30_000
START = 10**18


@pytest.fixture(autouse=True)
def limits() -> Iterator[None]:
    """Limit the time and the memory of each test as in a campaign: all take a part of a second."""
    with runner.limited():
        yield


def topic(name: str, definition: str = "", ros_type: str = "our_msgs/msg/A") -> Topic:
    channel = Channel(0, name, ros_type, definition)
    return Topic(name, 0, ros_type, definition, "", ((0, channel),), lambda: np.zeros(0, np.int64))


def test_each_of_many_topics_is_found() -> None:
    topics = [topic(f"/t{number}") for number in range(MANY)]
    known = by_name(topics)
    for each in topics:
        assert find(known, each) is find(known, each.name) is find(known, (each.name, 0)) is each


def test_many_topics_with_one_name_for_the_disk_have_files_of_their_own() -> None:
    topics = [topic(f"/{'a' * 160}{number}") for number in range(MANY // 2)]
    assert len({*names.file_names(topics).values()}) == len(topics)


def test_many_definitions_of_one_type_have_names_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.exports.convert.types._hashes_of", lambda _, definition: (definition, {}))
    types = TypeNames()
    found = [types.name_of(topic("/a", f"not a definition {number}")) for number in range(MANY // 2)]
    assert found[:3] == ["our_msgs/msg/A", "our_msgs/msg/A2", "our_msgs/msg/A3"]
    assert len({*found}) == len(found)
    assert types.name_of(topic("/b", "not a definition 1")) == "our_msgs/msg/A2"


def test_many_problems_of_a_file_are_told_once_each() -> None:
    problems: list[Problem] = []
    described = Described(problems)
    for _ in range(2):
        for offset in range(MANY):
            described.report("damaged", offset)
    assert [each.offset for each in problems] == list(range(MANY))


def test_samples_of_many_channels_are_put_in_order() -> None:
    count = MANY // 3

    none = np.zeros(1, np.int64)
    times = {number: none + START - number for number in range(count)}
    parts = (Part(number, np.zeros(1, np.uint8), none, none + 1, own) for number, own in times.items())
    found = list(in_order(parts, times, dict.fromkeys(range(count), "/a"), 0, 1 << 62))
    assert [each.time for each in found] == list(range(START - count + 1, START + 1))


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(content: bytes) -> bytes:
    head = struct.pack("<QQQI", START, START, len(content), 0)
    return record(6, head + text("") + struct.pack("<Q", len(content)) + content)


def test_the_times_of_many_channels_in_many_chunks_are_read(tmp_path: Path) -> None:
    count = 8000
    parts = [b"\x89MCAP0\r\n", record(1, text("") * 2)]
    parts += [
        record(4, struct.pack("<HH", number, 0) + text(f"/t{number}") + text("cdr") + bytes(4))
        for number in range(count)
    ]
    for number in range(count):
        parts.append(chunk(record(5, struct.pack("<HIQQ", number, 0, START, START) + b"\0\1\0\0")))
        parts.append(record(7, struct.pack("<HIQQ", number, 16, START, 0)))
    parts += [record(15, bytes(4)), record(2, bytes(20)), b"\x89MCAP0\r\n"]
    path = tmp_path / "flight.mcap"
    path.write_bytes(b"".join(parts))
    file = McapFile(str(path))
    for number in range(count):
        assert file.times([number])[number].tolist() == [START]
    assert Counter(map(len, file.times(range(count)).values())) == {1: count}
    file.close()


def test_chunks_behind_many_damaged_places_are_found() -> None:
    piece = chunk(bytes(range(1, 5))) + b"\xff" * 3
    data = memoryview(piece * (MANY // 2))
    place = found = 0
    while place < len(data):
        assert place == found * len(piece)
        place = chunk_or_message_from(data, place + 1, ())
        found += 1
    assert found == MANY // 2


def test_many_formats_of_a_ulog_have_the_same_fields() -> None:
    formats = Formats()
    names = [f"a_{number}" for number in range(MANY)]
    for name in names:
        formats.add(f"{name}:uint64_t timestamp;uint8_t x")
    assert [formats.ros_type(name) for name in names] == [f"px4_msgs/msg/A{number}" for number in range(MANY)]
    formats.add("a:uint64_t timestamp;uint8_t x")
    assert {formats.ros_type(name) for name in names} == {"px4_msgs/msg/A"}


@pytest.mark.parametrize("again", [False, True], ids=["once", "defined again"])
def test_many_formats_of_a_ulog_nest_the_same_long_one(*, again: bool) -> None:
    formats, padding = Formats(), "".join(f"uint8_t _padding{number};" for number in range(3000))
    formats.add(f"long:uint64_t timestamp;{padding}")
    told = 0
    for number in range(MANY // 5):
        if again:
            formats.add("other:uint8_t x")
        formats.add(f"topic_{number}:uint64_t timestamp;long a")
        with suppress(FormatError):  # all of them have more bytes than a log may have
            told += bool(formats.described(f"topic_{number}"))
    assert told


@pytest.mark.night  # by day, many formats with short names
def test_long_names_of_formats_with_the_same_fields_have_no_ends() -> None:
    formats = Formats()
    names = ["_" * 60_000 + str(number) for number in range(100)]
    for name in names:
        formats.add(f"{name}:uint8_t x")
    assert len({formats.ros_type(name) for name in names}) == len(names)


@pytest.mark.night  # by day, many problems of another file
def test_many_damaged_samples_are_counted_in_a_folder_with_many_problems(tmp_path: Path) -> None:
    frame = b"\x28\xb5\x2f\xfd" + b"\xff" * 8
    count = MANY // 3
    rows = [(1, START + number, frame) for number in range(count)]
    write_database(tmp_path / "a.db3", [Stored(1, "/t", "our_msgs/msg/A", "uint8[] x\n")], rows)
    missing = "".join(f"  - m{number}.db3\n" for number in range(count))
    (tmp_path / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n  - a.db3\n{missing}", encoding="utf-8"
    )
    with recordings.open(tmp_path) as log:
        assert not len(log["/t"])
        assert len(log.problems) == count + 1
        assert [problem.samples for problem in log.problems if problem.topic] == [count]


def test_a_name_with_many_parts_has_no_ends() -> None:
    name = "/a" * MANY
    assert {*names_of(name, "our_msgs/msg/A")} == {name, "our_msgs/msg/A", "A"}
    assert "/b/c" in {*names_of("/a/b/c", "our_msgs/msg/A")}


def write_many(path: Path, count: int) -> Path:
    samples = [(START, START, b"\0\1\0\0" + bytes(8))]
    return write_log(
        path, [Written(f"/t{number}", "our_msgs/msg/A", "uint64 timestamp\n", samples) for number in range(count)]
    )


@pytest.mark.skipif(sys.platform != "linux", reason="counts the open files in /proc")
@pytest.mark.parametrize("format_", ["parquet", "csv", "arrow"])
def test_a_recording_can_have_more_topics_than_files_may_be_open(format_: str, tmp_path: Path) -> None:
    path = write_many(tmp_path / "flight.mcap", 100)
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    with recordings.open(path) as log:
        log.load()
        resource.setrlimit(resource.RLIMIT_NOFILE, (len([*Path("/proc/self/fd").iterdir()]) + 40, before[1]))
        try:
            assert len(convert(log, str(tmp_path / "made"), format=format_).files) == 100
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_more_topics_than_a_file_can_have_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_writer, "_MOST_CHANNELS", 3)
    with recordings.open(write_many(tmp_path / "flight.mcap", 4)) as log:
        with pytest.raises(RecordingError, match="an MCAP file has at most 3 channels, and these topics need more"):
            convert(log, str(tmp_path / "made.mcap"), format="mcap")
        convert(log, str(tmp_path / "made.mcap"), format="mcap", topics=["/t0", "/t1", "/t2"])
    assert sorted(each.name for each in tmp_path.iterdir()) == ["flight.mcap", "made.mcap"]
