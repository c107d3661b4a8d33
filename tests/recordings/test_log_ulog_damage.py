"""Tests of ULogs that are cut off, damaged, or with garbage between messages: what is lost is told."""

from __future__ import annotations

import struct
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest

from msggen import recordings
from msggen.recordings.files.ulog.messages import SYNC
from msggen.recordings.log.log import Log
from support.examples import by_day, examples
from support.ulog import UTC, UlogWriter, flight

NAMES = ["SensorCombined", "VehicleStatus", "EscStatus", "VehicleAttitude"]
COUNT = 120


class Message(NamedTuple):
    """A message in a file."""

    start: int
    stop: int
    kind: int
    content: bytes


def messages_in(data: bytes) -> list[Message]:
    """Return the messages of a whole file, one after the other."""
    found, start = [], 16
    while start < len(data):
        size, kind = struct.unpack_from("<HB", data, start)
        found.append(Message(start, start + 3 + size, kind, data[start + 3 : start + 3 + size]))
        start += 3 + size
    return found


def times_of(log: Log) -> Counter[tuple[int, int]]:
    """Return which samples there are, by instance and time."""
    return Counter(
        (samples.topic.instance, int(time))
        for samples in log.load().values()
        for time in samples.array["timestamp"].tolist()
    )


@pytest.fixture(scope="module")
def whole(px4_types: Any) -> bytes:
    """Return a log without damage."""
    return bytes(flight(px4_types, NAMES, Random(1), count=COUNT, is_padded=True).data)  # noqa: S311 - no secret


def opened(data: bytes, path: Path) -> Log:
    path.write_bytes(data)
    return recordings.open(path)


def first_sample(data: bytes) -> int:
    return next(message.start for message in messages_in(data) if message.kind == ord("D"))


def time_in(message: Message) -> int:
    (time,) = struct.unpack_from("<Q", message.content, 2)
    return int(time)


def kept_times(log: Log) -> set[int]:
    return {time for _, time in times_of(log)}


def damage(data: bytes, chance: Random) -> tuple[bytes, int, int]:
    """Return damaged data, and from where to where the original is changed."""
    low = chance.randrange(first_sample(data), len(data))
    high = min(low + chance.choice([1, 2, 8, 50, 300, 3000]), len(data))
    kind = chance.randrange(5)
    if kind == 0:  # lost
        return data[:low] + data[high:], low, high
    if kind == 1:  # garbage
        return data[:low] + chance.randbytes(high - low) + data[high:], low, high
    if kind == 2:  # never written
        return data[:low] + bytes(high - low) + data[high:], low, high
    if kind == 3:  # garbage between
        return data[:low] + chance.randbytes(high - low) + data[low:], low, low
    return data[:low] + data[low:high] * 2 + data[high:], low, low  # written twice


@by_day("seed", range(10), 5)
def test_samples_beside_a_damage_are_kept_and_others_are_told(whole: bytes, seed: int, tmp_path: Path) -> None:
    chance = Random(seed)  # noqa: S311 - no secret
    messages = [message for message in messages_in(whole) if message.kind == ord("D")]
    for _ in range(100):
        data, low, high = damage(whole, chance)
        with opened(data, tmp_path / "a.ulg") as log:
            kept = kept_times(log)
            untouched = {time_in(each) for each in messages if each.stop <= low or each.start >= high}
            assert untouched <= kept
            if len(kept) < len(messages):
                assert log.problems
            assert all(problem.offset is None or 0 < problem.offset <= len(data) for problem in log.problems)


@by_day("seed", range(5), 5)
def test_samples_beside_a_damage_are_kept_though_their_topics_are_named_late(seed: int, tmp_path: Path) -> None:
    """A topic is named before its first sample, and a damage hits samples only."""
    chance = Random(seed)  # noqa: S311 - no secret
    writer = UlogWriter()
    for number in range(30):
        writer.format(f"topic_{number}", f"uint64_t timestamp;uint8_t[{1 + 3 * number}] x")
    for index in range(600):
        if index % 10 == 0 and index < 300:
            writer.subscribe(index // 10, f"topic_{index // 10}")
        number = chance.randrange(min(index // 10 + 1, 30))
        writer.sample(number, struct.pack("<Q", UTC + index) + chance.randbytes(1 + 3 * number))
    messages = messages_in(bytes(writer.data))
    named = [message for message in messages if message.kind == ord("A")]
    samples = [message for message in messages if message.kind == ord("D")]
    tried = 0
    while tried < 60:
        data, low, high = damage(bytes(writer.data), chance)
        if all(each.stop <= low or each.start >= high for each in named):
            tried += 1
            with opened(data, tmp_path / "a.ulg") as log:
                assert {time_in(each) for each in samples if each.stop <= low or each.start >= high} <= kept_times(log)


def test_any_file_is_read_or_refused(whole: bytes, tmp_path: Path) -> None:
    """Mutations anywhere, also among the definitions."""
    chance = Random(5)  # noqa: S311 - no secret
    front = whole[: first_sample(whole) + 3000]
    for number in range(examples(300)):
        data = bytearray(front)
        for _ in range(chance.choice([1, 3, 20])):
            place = chance.randrange(7, len(data))
            if number % 2:
                data[place] = chance.randrange(256)
            else:
                data[place : place + 2] = struct.pack("<H", chance.choice([0, 1, 0x7FFF, 0xFFFF]))
        with suppress(recordings.RecordingError), opened(bytes(data), tmp_path / "a.ulg") as log:
            log.load()
            assert log.facts is not None
            assert log.utc_offset is None
            assert not any("\n" in problem.text for problem in log.problems)


def test_a_changed_byte_of_a_format_matters_only_to_the_topics_that_need_it(whole: bytes, tmp_path: Path) -> None:
    """Of the bytes of a format, those of its size are changed too."""
    chance = Random(7)  # noqa: S311 - no secret
    with opened(whole, tmp_path / "a.ulg") as log:
        expected = {key: samples.array for key, samples in log.load().items()}
    total = sum(map(len, expected.values()))
    shares = []
    for message in (each for each in messages_in(whole) if each.kind == ord("F")):
        name = message.content.partition(b":")[0].decode()
        own = {"esc_report": "esc_status"}.get(name, name)
        for place in [
            message.start,
            message.start + 1,
            *(chance.randrange(message.start, message.stop) for _ in "12345678"),
        ]:
            data = bytearray(whole)
            data[place] ^= chance.randrange(1, 256)
            with opened(bytes(data), tmp_path / "a.ulg") as log:
                found = {key: samples.array for key, samples in log.load().items()}
                for key, rows in expected.items():
                    if (key if isinstance(key, str) else key[0]) != own:
                        assert found[key].tobytes() == rows.tobytes(), (place, key)
                shares.append(sum(map(len, found.values())) / total)
                assert shares[-1] == 1 or log.problems
    assert sum(shares) / len(shares) > 0.85  # each of the four topics has a quarter of the samples


def test_formats_and_subscriptions_between_samples_are_known_before_them(whole: bytes, tmp_path: Path) -> None:
    """The definitions of a log with a damage before them are in one stretch with the samples."""
    place = next(message.start for message in messages_in(whole) if message.kind == ord("F"))
    with opened(whole[:place] + b"\xff" * 70_000 + SYNC + whole[place:], tmp_path / "a.ulg") as log:
        assert len(kept_times(log)) == COUNT


def test_zeros_and_garbage_without_end(whole: bytes, tmp_path: Path) -> None:
    chance = Random(6)  # noqa: S311 - no secret
    for garbage in (bytes(1 << 20), chance.randbytes(1 << 20), b"D" * (1 << 20), SYNC[:3] * (1 << 18)):
        with opened(whole + garbage, tmp_path / "a.ulg") as log:
            assert len(kept_times(log)) == COUNT
            assert sum(problem.size for problem in log.problems) > len(garbage) - 20_000


def test_unknown_samples_and_messages_are_counted(whole: bytes, tmp_path: Path) -> None:
    place = first_sample(whole)
    writer = UlogWriter()
    writer.data = bytearray(whole[:place])
    for _ in range(30):
        writer.sample(999, b"nobody knows")
    unknown = len(writer.data)
    writer.message("Z", b"new")
    writer.message("Z", bytes(300))
    short = len(writer.data)
    for _ in range(2):
        writer.sample(0, b"too short")
    with opened(bytes(writer.data) + whole[place:], tmp_path / "a.ulg") as log:
        assert len(kept_times(log)) == COUNT
        layout = log.topic("sensor_combined").channels[0][1].layout
        assert layout is not None
        assert {problem[:4] for problem in log.problems} == {
            ("samples of topics that were never named (numbers 999)", None, 0, 30),
            ("a message of the unknown kind 'Z'", unknown, 6, 0),
            ("a message of the unknown kind 'Z'", unknown + 6, 303, 0),
            (f"9 bytes, expected {layout.size}: not samples of this definition", short, 0, 2),
        }


def test_of_many_unknown_messages_the_first_are_told_one_by_one(whole: bytes, tmp_path: Path) -> None:
    place = first_sample(whole)
    with opened(whole[:place] + b"\1\0Z?" * 1500 + whole[place:], tmp_path / "a.ulg") as log:
        assert len(kept_times(log)) == COUNT
        texts = Counter(problem.text for problem in log.problems)
        assert texts == {"a message of the unknown kind 'Z'": 1000, "500 further messages of unknown kinds": 1}


@pytest.mark.parametrize("kind", "RSOLCFABIMPQ")
def test_a_sample_that_seems_to_be_another_message_is_told(whole: bytes, kind: str, tmp_path: Path) -> None:
    samples = [message for message in messages_in(whole) if message.kind == ord("D")]
    for lost in samples[:10]:
        data = whole[: lost.start + 2] + kind.encode() + whole[lost.start + 3 :]
        with opened(data, tmp_path / "a.ulg") as log:
            assert kept_times(log) == {time_in(each) for each in samples if each != lost}
            assert [(each.offset, each.size) for each in log.problems] == [(lost.start, lost.stop - lost.start)]


@pytest.mark.parametrize(("kind", "count"), [("Z", 2), ("Z", 30), *((kind, 3) for kind in "ZLCSROIP")])
def test_samples_in_another_message_are_found(whole: bytes, kind: str, count: int, tmp_path: Path) -> None:
    """Damage that has the size of some messages ends where one of them does."""
    messages = messages_in(whole)
    first = [message.start for message in messages].index(first_sample(whole))
    for index in range(first, first + 25):
        start, stop = messages[index].start, messages[index + count - 1].stop
        data = whole[:start] + struct.pack("<HB", stop - start - 3, ord(kind)) + whole[start + 3 :]
        with opened(data, tmp_path / "a.ulg") as log:
            behind = [each for each in messages[index + 1 :] if each.kind == ord("D")]
            assert {time_in(each) for each in behind} <= kept_times(log)
            hidden = [each.start for each in behind if each.start < stop]
            end = hidden[0] if hidden else stop
            assert [(each.offset, each.size) for each in log.problems] == [(start, end - start)]


@pytest.mark.parametrize("count", [2, 3, 30])
def test_samples_in_a_sample_of_another_size_are_found(whole: bytes, count: int, tmp_path: Path) -> None:
    messages = messages_in(whole)
    samples = [index for index, message in enumerate(messages) if message.kind == ord("D")]
    for index in samples[:25]:
        start, stop = messages[index].start, messages[index + count - 1].stop
        data = whole[:start] + struct.pack("<H", stop - start - 3) + whole[start + 2 :]
        with opened(data, tmp_path / "a.ulg") as log:
            lost = messages[index]
            assert kept_times(log) == {time_in(messages[each]) for each in samples} - {time_in(lost)}
            found = next((messages[each].start for each in samples if index < each < index + count), start)
            assert [(each.offset, each.size) for each in log.problems] == [(start, found - start)]


def test_texts_of_other_writers_are_kept(whole: bytes, tmp_path: Path) -> None:
    """Those with another level, other times, or damaged characters."""
    place = first_sample(whole)
    writer = UlogWriter()
    writer.data = bytearray(whole[:place])
    writer.text(-40, 1_000_000, "with a number as its level")
    writer.text(6, 5_000_000_000, "late")
    writer.text(6, 1_000_000, "damaged \x01")
    with opened(bytes(writer.data) + whole[place:], tmp_path / "a.ulg") as log:
        assert [(each.level, each.text[:7]) for each in log.texts] == [
            ("unknown", "with a "),
            ("info", "late"),
            ("info", "damaged"),
        ]
        assert log.problems == []


def test_a_topic_whose_format_is_missing_or_wrong(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("itself", "uint64_t timestamp;itself other")
    writer.format("empty", "")
    writer.format("large", "uint64_t timestamp;uint8_t[65535] data")
    writer.format("odd", "uint64_t timestamp;uint8_t[x] data")
    writer.format("twice", "uint64_t timestamp;uint8_t a;uint8_t a")
    writer.format("bomb", "nothing[65535] a;nothing[65535] b")
    writer.format("nothing", "")
    writer.format("good", "uint64_t timestamp")
    names = ["itself", "empty", "large", "odd", "twice", "bomb", "missing", "good"]
    for number, name in enumerate(names):
        writer.subscribe(number, name)
        writer.sample(number, struct.pack("<Q", number))
    with opened(bytes(writer.data), tmp_path / "a.ulg") as log:
        assert [topic.name for topic in log.topics] == ["good"]
        assert log["good"]["timestamp"].tolist() == [7]
        assert {problem.topic: problem.samples for problem in log.problems} == dict.fromkeys(names[:-1], 1)


def test_times_beyond_all_limits(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("good", "uint64_t timestamp")
    writer.subscribe(0, "good")
    for time in (0, (1 << 64) - 1, (1 << 64) - 9):
        writer.sample(0, struct.pack("<Q", time))
    writer.text(9, (1 << 64) - 1, "late")
    with opened(bytes(writer.data), tmp_path / "a.ulg") as log:
        samples = log.samples("good")
        assert np.all(np.diff(samples.log_times) >= 0)
        assert samples.array["timestamp"].tolist() == [0, (1 << 64) - 1, (1 << 64) - 9]
        assert log.texts[0].level == "unknown"


@pytest.mark.parametrize("start", [0, 5_000_000])
def test_samples_with_damaged_times_are_left_out(tmp_path: Path, start: int) -> None:
    writer = UlogWriter(start=start)
    writer.format("a", "uint64_t timestamp;float x")
    writer.subscribe(0, "a")
    for step in range(100):
        time = 5_000_000 + step * 10_000
        writer.sample(0, struct.pack("<Qf", time | 1 << 60 if step % 40 == 7 else time, step))
    with recordings.open(writer.write(tmp_path / "noise.ulg")) as log:
        assert log["a"]["x"].tolist() == [step for step in range(100) if step % 40 != 7]
        assert log.end == (5_000_000 + 99 * 10_000) * 1000
        (problem,) = log.problems
        assert (problem.text, problem.samples) == ("times more than 30 days after the other samples", 3)
        assert log.topic("a").count == 97


def test_times_of_day_are_no_damage(tmp_path: Path) -> None:
    """The clock of an old simulation counts from 1970, and the header of such a log can have the time 0."""
    writer = UlogWriter(start=0)
    writer.format("a", "uint64_t timestamp;float x")
    writer.subscribe(0, "a")
    for step in range(10):
        writer.sample(0, struct.pack("<Qf", UTC + step, step))
    with recordings.open(writer.write(tmp_path / "simulation.ulg")) as log:
        assert (len(log["a"]), log.problems) == (10, [])


def test_a_last_sample_that_is_too_short_for_a_time(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("a", "uint64_t timestamp;float x")
    writer.format("short", "uint16_t x")
    for number, name in enumerate(("a", "short")):
        writer.subscribe(number, name)
    writer.sample(0, struct.pack("<Qf", 2_000_000, 1.5))
    writer.sample(1, struct.pack("<H", 7))
    with recordings.open(writer.write(tmp_path / "short.ulg")) as log:
        assert (log["a"]["x"].tolist(), log["short"]["x"].tolist()) == ([1.5], [7])
        assert log.samples("short").log_times.tolist() == [2_000_000_000]
        assert log.problems == []
