"""Tests of what is found all at once in a ULog: it is what reading one message after the other finds."""

from __future__ import annotations

import gc
import mmap
import struct
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.recordings.files.ulog.formats import LONGEST_RUN
from msggen.recordings.files.ulog.heads import SIZE, chained
from msggen.recordings.files.ulog.notes import usual_parameters
from msggen.recordings.files.ulog.reader import UlogFile
from msggen.recordings.files.ulog.topics import Topics
from support.ulog import UlogWriter, write_ulog

TOPICS = 3


def topics_of() -> Topics:
    topics = Topics()
    for number in range(TOPICS):
        topics.formats.add(f"topic_{number}:uint64_t timestamp;uint8_t[{number + 3}] x;")
        topics.subscribe(0, number, f"topic_{number}", 0)
    return topics


def messages(chance: Random, count: int) -> bytes:
    """Return messages of known and of new topics, others, and contents that look like samples."""
    data = bytearray(16)
    for _ in range(count):
        number = chance.choice([*range(TOPICS), *range(TOPICS), 77, 999])
        size = 8 + number + 3 if number < TOPICS else 20
        content = chance.randbytes(size)
        if chance.random() < 0.3:
            inner = chance.randrange(TOPICS)
            content = (struct.pack("<HBH", 2 + 8 + inner + 3, ord("D"), inner) + content)[:size]
        if chance.random() < 0.1:
            text = chance.randbytes(chance.randrange(1, 30))
            data += struct.pack("<HB", len(text), chance.choice(b"LSIMPA")) + text
        else:
            data += struct.pack("<HBH", len(content) + 2, ord("D"), number) + content
    return bytes(data)


def one_by_one(data: bytes, start: int, limit: int) -> tuple[list[tuple[int, int, int]], int]:
    """Return offset, size and kind of the messages up to `limit`, and where they end."""
    found = []
    while start <= len(data) - SIZE:
        size, kind = struct.unpack_from("<HB", data, start)
        if not size or start + 3 + size > limit:
            break
        found.append((start, size, kind))
        start += 3 + size
    return found, start


@pytest.mark.parametrize("seed", range(30))
def test_messages_that_follow_one_another(seed: int) -> None:
    chance = Random(seed)  # noqa: S311 - no secret
    data = bytearray(messages(chance, chance.choice([0, 1, 5, 200])) or bytes(16))
    data += bytes(SIZE)
    if seed % 3 == 0:
        place = chance.randrange(16, len(data))
        data[place] ^= 0xFF
    with mmap.mmap(-1, len(data)) as file:
        file[:] = bytes(data)
        octets = np.frombuffer(file, np.uint8).copy()
        for limit in {len(data), len(data) - SIZE, chance.randrange(16, len(data) + 1)}:
            found = chained(file, octets, topics_of(), 16, limit)
            assert found is not None
            heads, end = found
            expected, expected_end = one_by_one(bytes(data), 16, limit)
            assert [*zip(heads.starts.tolist(), heads.sizes.tolist(), heads.kinds.tolist(), strict=True)] == expected
            assert end == expected_end
            assert heads.numbers.tolist() == [struct.unpack_from("<H", data, place + 3)[0] for place, *_ in expected]


def test_too_few_known_samples_are_left_to_others() -> None:
    data = bytes(16) + (struct.pack("<HB", 1, ord("L")) + b"x") * 1000
    with mmap.mmap(-1, len(data)) as file:
        file[:] = data
        assert chained(file, np.frombuffer(data, np.uint8), topics_of(), 16, len(data)) is None


@pytest.mark.parametrize("seed", range(20))
def test_parameters_that_are_read_later_are_those_that_are_read_at_once(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some with other types, damaged names, or the name of another one."""
    chance = Random(seed)  # noqa: S311 - no secret
    writer = UlogWriter()
    writer.format("a", "uint64_t timestamp;float x")
    for number in range(chance.choice([3, 50, 5000])):
        name = f"P{chance.randrange(3000)}_{'P' * chance.randrange(5)}"
        writer.parameter(name, chance.choice([number, number / 7, -1, float("inf")]))
        if chance.random() < 0.01:
            key = chance.choice([b"int64_t X", b"bool \xc3\xa9", b"float \xff", b"float ", b"char[2] x"])
            writer.message("P", bytes([len(key)]) + key + bytes(chance.choice([1, 4, 8])))
    writer.subscribe(0, "a")
    writer.sample(0, bytes(12))
    path = writer.write(tmp_path / "a.ulg")
    with recordings.open(path) as log:
        found, problems = log.facts, log.problems
    monkeypatch.setattr("msggen.recordings.files.ulog.reader.usual_parameters", lambda _, start, __: [start])
    with recordings.open(path) as log:
        assert list(found.parameters.items()) == list(log.facts.parameters.items())
        assert problems == log.problems


@pytest.mark.parametrize("size", range(12))
def test_parameters_are_looked_for_at_the_end_of_a_file(size: int) -> None:
    data = (struct.pack("<HBB", 12, ord("P"), 7) + b"float x1234")[:size]
    assert usual_parameters(np.frombuffer(data, np.uint8), 0, size) == [0]


def test_parameters_are_there_after_the_log_is_closed(tmp_path: Path) -> None:
    with recordings.open(write_ulog(tmp_path / "a.ulg")) as log:
        assert log.information["sys_name"] == "PX4"
    assert log.parameters == {"MC_P": 6.5}


@pytest.mark.parametrize("is_late", [False, True])
def test_logs_with_the_same_first_formats_have_their_own_further_ones(*, is_late: bool, tmp_path: Path) -> None:
    """A format that comes later changes only its own log."""
    for extra in ("x", "y", None):
        writer = UlogWriter()
        writer.format("a", "uint64_t timestamp;float x")
        writer.format("b_0", "uint64_t timestamp;uint8_t x")
        if extra and not is_late:
            writer.information("int32_t n", bytes(4))
        if extra:
            writer.format("b", f"uint64_t timestamp;uint8_t {extra}")
        writer.subscribe(0, "a")
        writer.subscribe(1, "b_0")
        writer.sample(0, bytes(12))
        writer.sample(1, bytes(9))
        with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
            assert log.topic("b_0").ros_type == f"px4_msgs/msg/{'B' if extra == 'x' else 'B0'}"


def test_more_formats_than_are_kept_are_read(tmp_path: Path) -> None:
    writer = UlogWriter()
    count = LONGEST_RUN // 30
    for number in range(count):
        writer.format(f"topic_{number}", "uint64_t timestamp;float x")
    writer.subscribe(0, f"topic_{count - 1}")
    writer.sample(0, struct.pack("<Qf", 1, 2.5))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log[f"topic_{count - 1}"]["x"].tolist() == [2.5]
        assert log.problems == []


def test_topics_that_are_named_between_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their samples are found as those of the first topics are."""
    writer = UlogWriter()
    writer.format("a", "uint64_t timestamp;float x")
    expected: dict[int, list[float]] = {}
    for index in range(1000):
        if index % 50 == 0:
            writer.subscribe(index // 50, "a", index // 50)
        number = index % (index // 50 + 1)
        expected.setdefault(number, []).append(index)
        writer.sample(number, struct.pack("<Qf", index, index))
    walked: list[Any] = []
    monkeypatch.setattr("msggen.recordings.files.ulog.messages.walk", lambda *arguments: walked.append(arguments))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert {topic.instance: log[topic.key]["x"].tolist() for topic in log.topics} == expected
    assert walked == []


def test_a_log_is_freed_without_the_collector(tmp_path: Path) -> None:
    path = str(write_ulog(tmp_path / "a.ulg"))
    with recordings.open(path) as log:
        log.load()
    gc.collect()
    gc.disable()
    try:
        with recordings.open(path) as log:
            loaded = log.load()
            assert loaded["odd"].topic.read_times is None
            del loaded, log
        assert not any(isinstance(each, UlogFile) for each in gc.get_objects())
    finally:
        gc.enable()
