"""Tests of the writer: other readers read every file, also one that was not ended, cut off, or on a full disk."""

from __future__ import annotations

import errno
import os
from itertools import accumulate
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from msggen.exports.convert.mcap import McapWriter
from msggen.exports.convert.payloads import Block
from msggen.exports.writer import COMPRESSIONS, Channel, Writer
from msggen.recordings.files.mcap.writer import FASTEST, Target
from msggen.recordings.log import opening
from msggen.recordings.source.source import RecordingError
from support.examples import examples
from support.recordings import START, Found, channel_of, check_decoded, check_read, read_mcap, read_ours, route_of
from support.scratch import scratch_folder

TOPICS = ("vehicle_status", "sensor_combined", "battery_status")


def channels(package: Any) -> list[Channel]:
    return [channel_of(package, route_of(package, topic)) for topic in TOPICS]


def write(writer: Writer, numbers: dict[str, int], found: Found) -> None:
    writer.write(numbers[found.topic], found.time, found.time - 1000, found.payload)


def samples(known: list[Channel], count: int, seed: int = 0) -> list[Found]:
    """Return samples with random payloads, which a recorder does not look at."""
    chance = Random(seed)  # noqa: S311 - no secret
    return [
        Found(chance.choice(known).topic, START + number * 1000, b"\0\1\0\0" + chance.randbytes(chance.randrange(90)))
        for number in range(count)
    ]


def opened(path: Path, known: list[Channel], compression: str = "zstd") -> tuple[Writer, dict[str, int]]:
    writer = Writer(str(path), compression)
    return writer, {channel.topic: writer.add_channel(channel) for channel in known}


@settings(max_examples=examples(12))
@given(
    st.lists(st.integers(0, 40), min_size=1, max_size=6),
    st.sampled_from(COMPRESSIONS),
    st.sampled_from(["close", "abandon"]),
)
def test_other_readers_find_what_was_written(px4_types: Any, counts: list[int], compression: str, ending: str) -> None:
    known = channels(px4_types)
    expected = samples(known, sum(counts))
    with scratch_folder() as folder:
        path = folder / "flight.mcap"
        writer, numbers = opened(path, known, compression)
        for end, count in zip(accumulate(counts), counts, strict=True):
            for found in expected[end - count : end]:
                write(writer, numbers, found)
            writer.flush()
            assert read_mcap(path) == expected[:end]
        getattr(writer, ending)()
        assert opening.open(path).problems == []
        if expected:
            check_read(path, expected)


@settings(max_examples=examples(20))
@given(st.integers(0, 60), st.sampled_from([1, 100_000]), st.randoms(use_true_random=False))
def test_both_writers_write_the_same_file(px4_types: Any, count: int, chunk: int, chance: Random) -> None:
    """Sample by sample, or all at once in blocks of equal sizes, with a chunk for each sample or for all."""
    known = channels(px4_types)
    expected = samples(known, count, chance.randrange(1000))
    numbers = {channel.topic: number for number, channel in enumerate(known)}
    by_size: dict[tuple[int, int], list[Found]] = {}
    for each in expected:
        by_size.setdefault((numbers[each.topic], len(each.payload)), []).append(each)
    blocks = [
        Block(
            number,
            np.frombuffer(b"".join(each.payload for each in found), np.uint8).reshape(len(found), size),
            np.array([each.time for each in found]),
            np.array([each.time - 1000 for each in found]),
        )
        for (number, size), found in by_size.items()
    ]
    with scratch_folder() as folder, pytest.MonkeyPatch.context() as patch:
        for module in ("msggen.exports.writer", "msggen.exports.convert.mcap"):
            patch.setattr(f"{module}.CHUNK", chunk)
        patch.setattr("msggen.exports.writer.SMALLER", FASTEST)
        writer, _ = opened(folder / "one.mcap", known)
        for each in expected:
            write(writer, numbers, each)
        writer.close()
        bulk = McapWriter(str(folder / "bulk.mcap"))
        for channel in known:
            topic, ros_type, definition, type_hash = channel
            bulk.add_channel(Target(topic, ros_type, definition, type_hash=type_hash))
        if blocks:
            bulk.write(blocks)
        bulk.close()
        assert (folder / "one.mcap").read_bytes() == (folder / "bulk.mcap").read_bytes()
        assert read_mcap(folder / "one.mcap") == expected


def test_a_channel_is_as_rosbag2_writes_it(px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    known = [*channels(px4_types), Channel("/fmu/out/mine", "px4_msgs/msg/Mine", "", "")]
    writer, numbers = opened(path, known)
    for channel in known:
        write(writer, numbers, Found(channel.topic, START, b"\0\1\0\0"))
    writer.close()
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert [each.name for each in reader.iter_metadata()] == ["rosbag2"]
    assert summary is not None
    for written in summary.channels.values():
        schema = summary.schemas[written.schema_id]
        info = None if schema.name.endswith("Mine") else px4_types.by_type(schema.name).__msg__
        assert written.message_encoding == "cdr"
        assert (schema.encoding, schema.data.decode()) == (("ros2msg", info.definition) if info else ("", ""))
        assert written.metadata.get("topic_type_hash") == (info.type_hash if info else None)
    with AnyReader([path]) as bag:
        for connection in bag.connections:
            ext: Any = connection.ext
            assert [(each.reliability.name, each.durability.name) for each in ext.offered_qos_profiles] == [
                ("BEST_EFFORT", "TRANSIENT_LOCAL")
            ]


def test_every_message_of_a_release_is_decoded_by_its_schema(px4_types: Any, tmp_path: Path) -> None:
    """Two other libraries read the same values as the generated classes."""
    path = tmp_path / "flight.mcap"
    known = {each.ros_name: route_of(px4_types, each.uorb_topic) for each in px4_types.topics.out}
    writer, numbers = opened(path, [channel_of(px4_types, route) for route in known.values()])
    chance = Random(1)  # noqa: S311 - no secret
    for number, (name, route) in enumerate(known.items()):
        cls = px4_types.by_type(route.ros_type)
        body = chance.randbytes(cls.__msg__.cdr_size)
        message = cls.decode(b"\0\1\0\0" + bytes(each & 1 for each in body))  # booleans are 0 or 1
        write(writer, numbers, Found(name, START + number, message.encode()))
    writer.close()
    assert check_decoded(path, px4_types) == len(known)


@pytest.mark.parametrize("is_ended", [True, False])
def test_a_file_that_is_cut_off_is_read_up_to_its_last_whole_chunk(
    px4_types: Any, tmp_path: Path, *, is_ended: bool
) -> None:
    known = channels(px4_types)
    expected = samples(known, 60)
    writer, numbers = opened(tmp_path / "flight.mcap", known)
    ends = []
    for start in range(0, 60, 10):
        for each in expected[start : start + 10]:
            write(writer, numbers, each)
        writer.flush()
        ends.append(writer.size)
    (writer.close if is_ended else writer.abandon)()
    data = (tmp_path / "flight.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    for size in [*range(0, len(data), 97), *ends, *(end - 1 for end in ends)]:
        cut.write_bytes(data[:size])
        whole = sum(end <= size for end in ends)
        try:
            found = read_ours(cut)
        except RecordingError:
            assert size < ends[0]
            continue
        # the index records after a chunk are not needed to read it
        assert found == sorted(expected[: len(found)], key=lambda each: each.time)
        assert whole * 10 <= len(found) <= whole * 10 + 10


def test_a_full_disk_keeps_what_was_written(px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever part of the last chunk the disk still takes."""
    known = channels(px4_types)
    expected = samples(known, 40)
    real = os.write
    for room in (0, 1, 100, 1000):
        path = tmp_path / f"{room}.mcap"
        writer, numbers = opened(path, known)
        for found in expected[:20]:
            write(writer, numbers, found)
        writer.flush()
        for found in expected[20:]:
            write(writer, numbers, found)
        limit = writer.size + 50 + room

        def limited(descriptor: int, data: Any, limit: int = limit) -> int:
            rest = limit - os.lseek(descriptor, 0, os.SEEK_CUR)
            if rest <= 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            return real(descriptor, data[:rest])

        with monkeypatch.context() as patch:
            patch.setattr(os, "write", limited)
            with pytest.raises(OSError, match="No space"):
                (writer.flush if room % 2 else writer.close)()
        writer.abandon()
        check_read(path, expected[:20])


def test_a_file_that_exists_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_text("mine")
    with pytest.raises(FileExistsError):
        Writer(str(path))
    assert path.read_text() == "mine"


def test_a_file_that_cannot_be_begun_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space"):
            Writer(str(tmp_path / "flight.mcap"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_other_files_are_refused_or_empty(text: bytes, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(text)
    if len(text) == 8:
        assert opening.open(path).topics == ()
    else:
        with pytest.raises(RecordingError, match="is not a recording" if text else "is empty"):
            opening.open(path)
