"""Tests of MCAP files: equal to a slow reader, to mcap-ros2-support and to rosbags, whole or damaged."""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from msggen.recordings.columns.samples import Samples
from msggen.recordings.files.mcap import reader as mcap
from msggen.recordings.log import opening
from msggen.recordings.log.log import Log
from msggen.recordings.source.source import Contents, Problem, RecordingError
from support.examples import by_day, examples
from support.log_files import Written, write_log
from support.mcap_reference import Message, flat, messages
from support.random_mcap import NAMES, WAYS, recording
from support.recordings import START
from support.scratch import scratch_folder


def found_in(log: Log) -> list[tuple[str, int, bytes]]:
    """Return all payloads in CDR, in order."""
    return [tuple(each) for each in log.payloads()]  # type: ignore[misc]  # three values


def problems_of(log: Log) -> list[Problem]:
    """Return the problems, without that of the topic in JSON, which every file has."""
    return [problem for problem in log.problems if not problem.text.startswith("/strange is not decoded")]


def expected_of(whole: list[Message]) -> list[tuple[str, int, bytes]]:
    """Return what `found_in` should find."""
    chosen = [(each.topic, each.log_time, each.payload) for each in whole if each.topic != "/strange"]
    return sorted(chosen, key=lambda each: each[1])


@settings(max_examples=examples(40))
@given(st.integers(0, 120), st.integers(0, 1000), st.sampled_from([300, 5000, 1 << 20]), st.sampled_from(list(WAYS)))
def test_all_messages_are_those_of_the_reference(px4_types: Any, count: int, seed: int, chunk: int, way: str) -> None:
    data = recording(px4_types, count, seed, chunk, **WAYS[way])
    whole = messages(data)
    with scratch_folder() as folder:
        path = folder / "flight.mcap"
        path.write_bytes(data)
        with opening.open(path) as log:
            assert problems_of(log) == []
            assert found_in(log) == expected_of(whole)
            loaded = log.load()
            assert {topic.name: topic.count for topic in log.topics if topic.count} == {
                name: sum(each.topic == name for each in whole) for name in {each.topic for each in whole}
            }
            for topic in log.topics:
                times = [each.log_time for each in whole if each.topic == topic.name]
                assert (topic.first, topic.last) == ((min(times), max(times)) if times else (0, 0))
                assert topic.times.tolist() == sorted(times)
            for name, samples in loaded.items():
                own = sorted((each for each in whole if each.topic == name), key=lambda each: each.log_time)
                assert samples.log_times.tolist() == [each.log_time for each in own]
                assert samples.publish_times is not None
                assert samples.publish_times.tolist() == [each.publish_time for each in own]
                stop = (START + 30_000 - log.start) / 1e9
                early = log.samples(name, stop=stop)
                count = sum(each.log_time < START + 30_000 for each in own)
                assert early.log_times.tolist() == samples.log_times[:count].tolist()
                assert repr(early.array.tolist()) == repr(samples.array[:count].tolist())


@pytest.mark.parametrize("way", [way for way in WAYS if way != "without-repeated-schemas"])  # mcap refuses those
def test_columns_are_those_of_other_libraries(way: str, px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(recording(px4_types, 150, 7, **WAYS[way]))
    theirs: dict[str, dict[str, list[dict[str, Any]]]] = {"mcap_ros2": defaultdict(list), "rosbags": defaultdict(list)}
    with path.open("rb") as file:
        decoders = [DecoderFactory()]
        for _, channel, _, message in make_reader(file, decoder_factories=decoders).iter_decoded_messages(
            [f"/fmu/out/{name.lower()}" for name in NAMES]
        ):
            theirs["mcap_ros2"][channel.topic].append(flat(message))
    if way in ("zstd", "lz4", "none"):  # rosbags refuses the others
        with AnyReader([path]) as bag:
            chosen = [each for each in bag.connections if each.topic.startswith("/fmu")]
            for connection, _, data in bag.messages(chosen):
                theirs["rosbags"][connection.topic].append(flat(bag.deserialize(data, connection.msgtype)))
    compared = 0
    with opening.open(path) as log:
        for by_topic in theirs.values():
            for topic, rows in by_topic.items():
                columns = log.columns(topic)
                for name in rows[0]:
                    expected = np.array([row[name] for row in rows]).astype(columns[name].dtype)
                    assert columns[name].tobytes() == expected.tobytes(), (topic, name)
                    compared += 1
                assert set(columns) == set(rows[0])
    assert compared > 100


@by_day("way", ["zstd", "lz4", "none", "without-index", "without-chunks"], 3)
def test_readers_of_one_file_do_not_disturb_each_other(
    way: str, px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap, "_GROUP", 8000)
    path = tmp_path / "flight.mcap"
    path.write_bytes(recording(px4_types, 200, 11, 1500, **WAYS[way]))

    def of_batches(batches: Iterable[Samples]) -> dict[str, list[str]]:
        found: defaultdict[str, list[str]] = defaultdict(list)
        for samples in batches:
            found[samples.topic.name] += rows_of(samples)
        return {name: sorted(rows) for name, rows in found.items()}

    with opening.open(path) as log:
        whole = {name: rows_of(samples) for name, samples in log.load().items() if len(samples)}
        first, second = in_turns(log.batches(), log.batches())
        assert of_batches(first) == of_batches(second) == whole
        names = sorted(whole) * 4
        with ThreadPoolExecutor(4) as pool:
            assert [rows_of(each) for each in pool.map(log.samples, names)] == [whole[name] for name in names]
        assert problems_of(log) == []


def rows_of(samples: Samples) -> list[str]:
    """Return the rows in an order of their own: batches are in the order of the file."""
    return sorted(map(repr, samples.array.tolist()))


def in_turns(first: Iterator[Samples], second: Iterator[Samples]) -> tuple[list[Samples], list[Samples]]:
    """Return what two iterators yield that take turns."""
    pairs = list(zip(first, second, strict=True))
    return [one for one, _ in pairs], [other for _, other in pairs]


def mutated(data: bytes, chance: Random) -> bytes:
    """Return a damaged file."""
    found = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        kind, place = chance.randrange(6), chance.randrange(len(found))
        if kind == 0:
            found[place] ^= 1 << chance.randrange(8)
        elif kind == 1:
            found[place] = chance.choice((0, 255, 5, 6, chance.randrange(256)))
        elif kind == 2:
            del found[place:]
        elif kind == 3:
            del found[place : place + chance.randrange(1, 200)]
        elif kind == 4:
            source = chance.randrange(len(found))
            found[place:place] = found[source : source + chance.randrange(1, 400)]
        else:
            found[place : place + 8] = bytes([chance.choice((0, 255))] * 8)
        if not found:
            return b""
    return bytes(found)


@pytest.mark.parametrize("way", WAYS)
def test_damaged_files_are_read_or_refused_and_nothing_is_silent(way: str, px4_types: Any, tmp_path: Path) -> None:
    data = recording(px4_types, 25, 3, 1200, **WAYS[way])
    whole = expected_of(messages(data))
    path = tmp_path / "flight.mcap"
    refused, count = 0, examples(150, by_day=20)
    for seed in range(count):
        path.write_bytes(mutated(data, Random(seed)))  # noqa: S311 - no secret
        try:
            with opening.open(path) as log:
                loaded = sum(len(samples) for samples in log.load().values())
                assert loaded == len(whole) or problems_of(log)
                found_in(log)
                log.verify()
        except RecordingError:
            refused += 1
    assert refused < count * 20 / 150


def test_a_message_that_an_index_has_twice_is_read_once(tmp_path: Path) -> None:
    """And the one that it lacks is found, also if the channels do not overlap in time."""
    path = tmp_path / "twice.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("px4_msgs/msg/A", "ros2msg", b"uint64 timestamp\n")
        for name in ("/a", "/b"):
            channel = writer.register_channel(name, "cdr", schema)
            for time in (1, 2, 3):
                writer.add_message(channel, time, b"\0\1\0\0" + struct.pack("<Q", time), time)
        writer.finish()
    data = bytearray(path.read_bytes())
    first = next(start for opcode, start in records_of(data) if opcode == 7)
    data[first + 15 + 16 : first + 15 + 32] = data[first + 15 : first + 15 + 16]
    path.write_bytes(data)
    with opening.open(path) as log:
        assert {name: samples.array["timestamp"].tolist() for name, samples in log.load().items()} == {
            "/a": [1, 2, 3],
            "/b": [1, 2, 3],
        }
        assert problems_of(log)


@pytest.mark.parametrize("way", ["zstd", "none"])
def test_a_whole_summary_is_all_that_is_read_to_open_a_file(way: str, px4_types: Any, tmp_path: Path) -> None:
    """Only the first and the last chunk are looked at, and the message indexes of few, for first and last times."""
    data = bytearray(recording(px4_types, 120, 3, 1200, **WAYS[way]))
    path = tmp_path / "flight.mcap"
    path.write_bytes(data)
    with opening.open(path) as log:
        expected = [(topic.name, topic.count) for topic in log.topics]
        whole = found_in(log)
    begins = [start for opcode, start in records_of(data) if opcode == 6]
    assert len(begins) > 8
    data[begins[1] : begins[-1]] = bytes(begins[-1] - begins[1])
    path.write_bytes(data)
    with opening.open(path) as log:
        assert log.problems == []
        assert [(topic.name, topic.count) for topic in log.topics] == expected
        assert log.contents == Contents(len(begins), (way,), 0, 0)
        assert log.missing_checksums == 0
        found = found_in(log)
        assert 0 < len(found) < len(whole)
        assert set(found) < set(whole)
        assert problems_of(log)


@by_day("way", ["zstd", "lz4", "none"], 2)
def test_a_damaged_front_of_a_chunk_costs_nothing(way: str, px4_types: Any, tmp_path: Path) -> None:
    """But a damaged checksum costs the chunk."""
    data = recording(px4_types, 60, 3, 1200, **WAYS[way])
    whole = expected_of(messages(data))
    begin = [start for opcode, start in records_of(data) if opcode == 6][2]
    path = tmp_path / "flight.mcap"
    for place in range(begin, begin + 9 + 28 + 4 + len(way.replace("none", "")) + 8):
        damaged = bytearray(data)
        damaged[place] ^= 0x41
        path.write_bytes(damaged)
        with opening.open(path) as log:
            found, problems = found_in(log), [each.text for each in problems_of(log)]
            log.verify()
        is_crc = begin + 9 + 24 <= place < begin + 9 + 28
        is_time = begin + 9 <= place < begin + 9 + 16
        is_front = place < begin + 9  # the record before is read by the index
        assert (found == whole) != is_crc
        if is_crc:
            assert any("does not match its CRC and is left out" in each for each in problems)
        elif not (is_time or is_front):
            assert problems == ["a chunk does not begin as the index of chunks tells, which is used instead"]


def records_of(data: bytes | bytearray) -> Iterator[tuple[int, int]]:
    """Yield the opcodes and the offsets of the records outside of chunks."""
    place = 8
    while place + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, place)
        yield opcode, place
        place += 9 + length


@pytest.mark.parametrize("change", ["channel", 5, 8, "removed"])
@pytest.mark.parametrize("number", range(5))
def test_a_damaged_message_index_in_a_file_with_a_damaged_summary(
    change: str | int, number: int, px4_types: Any, tmp_path: Path
) -> None:
    data = bytearray(recording(px4_types, 25, 3, 1200, **WAYS["none"]))
    whole = expected_of(messages(bytes(data)))
    place = [start for opcode, start in records_of(data) if opcode == 7][number]
    if change == "channel":
        data[place + 10] ^= 6
    elif change == "removed":
        (length,) = struct.unpack_from("<Q", data, place + 1)
        del data[place : place + 9 + length]
    else:
        data[place] = int(change)
    footer = max(start for opcode, start in records_of(data) if opcode == 2)
    data[footer + 9 : footer + 17] = (1 << 60).to_bytes(8, "little")  # where the summary is
    path = tmp_path / "flight.mcap"
    path.write_bytes(data)
    with opening.open(path) as log:
        assert found_in(log) == whole or problems_of(log)
        if change != "removed":
            assert set(whole) <= set(found_in(log))


@pytest.mark.parametrize("way", ["none", "zstd"])
@pytest.mark.parametrize("time", [0, 1, 1 << 62, (1 << 64) - 1])
def test_a_damaged_time_in_a_message_index_is_told(time: int, way: str, px4_types: Any, tmp_path: Path) -> None:
    """A topic has the times of its messages, and no gap of decades."""
    whole = recording(px4_types, 25, 3, 1200, **WAYS[way])
    path = tmp_path / "flight.mcap"
    path.write_bytes(whole)
    with opening.open(path) as log:
        expected = {topic.key: topic.times.tolist() for topic in log.topics}
    for place in [start for opcode, start in records_of(whole) if opcode == 7][::4]:
        data = bytearray(whole)
        struct.pack_into("<Q", data, place + 9 + 2 + 4, time)
        path.write_bytes(data)
        with opening.open(path) as log:
            assert {topic.key: topic.times.tolist() for topic in log.topics} == expected
            assert ["the message index has other times" in each.text for each in problems_of(log)] == [True]


def test_a_cut_file_has_every_whole_message(px4_types: Any, tmp_path: Path) -> None:
    for way in ("none", "zstd", "without-chunks"):
        data = recording(px4_types, 60, 5, 1500, **WAYS[way])
        whole = messages(data)
        for size in range(3000, len(data), 33100 // examples(100)):
            path = tmp_path / "cut.mcap"
            path.write_bytes(data[:size])
            expected = expected_of(messages(data[:size])) if way != "zstd" else []
            with opening.open(path) as log:
                found = found_in(log)
                assert found[: len(expected)] == expected or set(expected) <= set(found)
                assert set(found) <= set(expected_of(whole))
                assert problems_of(log) or len(found) == len(expected_of(whole))


def test_a_damage_between_messages_costs_only_those(px4_types: Any, tmp_path: Path) -> None:
    data = bytearray(recording(px4_types, 60, 5, **WAYS["without-chunks"]))
    whole = expected_of(messages(bytes(data)))
    payload = whole[20][2]
    place = data.find(payload) - 31
    data[place + 1 : place + 9] = b"\xff" * 8  # the length of its record
    path = tmp_path / "flight.mcap"
    path.write_bytes(data)
    with opening.open(path) as log:
        assert found_in(log) == whole[:20] + whole[21:]
        assert any(problem.offset == place and problem.size == 31 + len(payload) for problem in log.problems)


def test_a_damaged_upper_byte_of_a_length_costs_nothing(px4_types: Any, tmp_path: Path) -> None:
    """No record has a length of 2^56 bytes, and the next record is where the other bytes tell."""
    data = bytearray(recording(px4_types, 60, 5, **WAYS["without-chunks"]))
    whole = expected_of(messages(bytes(data)))
    data[data.find(whole[20][2]) - 31 + 8] = 0xB8
    path = tmp_path / "flight.mcap"
    path.write_bytes(data)
    with opening.open(path) as log:
        assert found_in(log) == whole
        for _, part in log.undecoded():
            assert (part.sizes >= 0).all()
            assert ((part.starts + part.sizes) <= part.buffer.size).all()


@pytest.mark.parametrize(("options", "missing"), [({"enable_crcs": False}, 7), ({"use_chunking": False}, 1)])
def test_missing_checksums_are_counted(options: dict[str, Any], missing: int, px4_types: Any, tmp_path: Path) -> None:
    """rosbag2 writes none by default. They are no damage."""
    path = tmp_path / "flight.mcap"
    path.write_bytes(recording(px4_types, 60, 5, **options))
    with opening.open(path) as log:
        assert log.missing_checksums == missing
        assert log.verify() == (0, missing)
        assert problems_of(log) == []


def test_sizes_that_a_file_declares_are_not_believed(px4_types: Any, tmp_path: Path) -> None:
    """A statistics record with 2^56 messages, and a chunk of 2^60 bytes."""
    data = bytearray(recording(px4_types, 60, 5, 1 << 20, **WAYS["zstd"]))
    path = tmp_path / "flight.mcap"
    statistics = data.rfind(b"\x0b", 0, len(data) - 29)
    chunk = data.find(b"\x04\0\0\0zstd") - 37
    for place, value in ((statistics + 9, 1 << 56), (chunk + 9 + 16, 1 << 60)):
        changed = bytearray(data)
        changed[place : place + 8] = value.to_bytes(8, "little")
        path.write_bytes(changed)
        with opening.open(path) as log:
            assert sum(map(len, log.load().values())) == len(expected_of(messages(bytes(data))))
            assert problems_of(log) or place != chunk + 25


def test_empty_files(px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(b"")
    with pytest.raises(RecordingError, match="is empty"):
        opening.open(path)
    path.write_bytes(recording(px4_types, 0))
    with opening.open(path) as log:
        assert (log.start, log.end, log.duration, log.problems) == (0, 0, 0.0, [])
        assert sum(len(samples) for samples in log.load().values()) == 0
    with pytest.raises(RecordingError, match="is closed"):
        log.load()


@pytest.mark.parametrize("way", WAYS)
def test_times_that_no_clock_has_are_the_same_everywhere(way: str, tmp_path: Path) -> None:
    """Samples, spans, and times of topics have one rule: the largest time is 2^62 - 1 ns."""
    largest = (1 << 62) - 1
    stamps = [5, largest - 1, largest, 1 << 62, (1 << 63) - 1, 1 << 63, (1 << 64) - 1]
    topic = Written("/a", "demo/msg/A", "int8 x\n", [(stamp, stamp, b"\0\1\0\0\1") for stamp in stamps])
    path = write_log(tmp_path / "late.mcap", [topic], **WAYS[way])
    expected = [5, largest - 1] + [largest] * 5
    with opening.open(path) as log:
        assert (log.start, log.end) == (5, largest)
        samples = log.samples("/a")
        assert samples.log_times.tolist() == expected
        assert samples.publish_times is not None
        assert samples.publish_times.tolist() == expected
        assert (log.topic("/a").first, log.topic("/a").last) == (5, largest)
        assert [sample.time for sample in log.payloads()] == expected
        assert len(log.samples("/a", start=1)) == 6
        assert [problem.text for problem in log.problems] == [
            f"log times from the year 2116 on are read as {largest} ns"
        ]
