"""Tests of ULogs that are whole: their samples are those that pyulog reads, bit by bit."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.files.ulog.names import MESSAGES
from msggen.recordings.log.origin import release_text
from msggen.recordings.source.facts import Dropout, Text
from support.repository import DEFINITIONS, SOME
from support.ulog import UlogWriter, columns_of_pyulog, content_of, differences, flight, formats_of, size_of, snake

ATTITUDE = "uint64_t timestamp;float[4] q;bool is_valid;uint8_t[7] _padding0"


def chance(seed: int) -> Random:
    return Random(seed)  # noqa: S311 - no secret


def small(**options: Any) -> UlogWriter:
    writer = UlogWriter(**options)
    writer.format("vehicle_attitude", ATTITUDE)
    writer.subscribe(0, "vehicle_attitude")
    return writer


def attitude(time: int, *, padding: int = 0) -> bytes:
    return struct.pack("<Q4fB", time, 0.5, 0.5, 0.5, 0.5, 1) + bytes(padding)


def test_all_columns_equal_those_of_pyulog(px4_types: Any, tmp_path: Path) -> None:
    path = flight(px4_types, SOME, chance(1), count=600).write(tmp_path / "a.ulg")
    theirs = columns_of_pyulog(path)
    with recordings.open(path) as log:
        ours = {(each.topic.name, each.topic.instance): each for each in log.load().values() if len(each)}
        assert ours.keys() == theirs.keys()
        assert len(ours) == 2 * len(SOME)
        for key, samples in ours.items():
            assert list(differences(samples.columns(), theirs[key])) == []
            assert (samples.log_times == samples.array["timestamp"].astype(np.int64) * 1000).all()
        assert sum(map(len, ours.values())) == 600
        assert log.problems == []


def test_padding_at_the_end_of_samples_changes_nothing(px4_types: Any, tmp_path: Path) -> None:
    """pyulog 1.3 leaves such samples out."""
    found = []
    for is_padded in (False, True):
        path = flight(px4_types, SOME, chance(1), count=200, is_padded=is_padded).write(tmp_path / f"{is_padded}.ulg")
        with recordings.open(path) as log:
            found.append({key: samples.columns() for key, samples in log.load().items()})
            assert log.problems == []
    assert found[0].keys() == found[1].keys()
    for key, columns in found[0].items():
        assert list(differences(columns, found[1][key])) == []


def _plain(px4_types: Any, name: str) -> str:
    """Return a definition without comments and constants."""
    lines = re.sub("#.*", "", getattr(px4_types, name).__msg__.definition).splitlines()
    return "\n".join(line.strip() for line in lines if line.strip() and "=" not in line)


def test_messages_of_all_definitions_are_read_as_their_formats_say(px4_types: Any, tmp_path: Path) -> None:
    names = [name for name in px4_types.msg.__all__ if re.match("uint64 timestamp\\b", _plain(px4_types, name))]
    assert len(names) > 100
    path = flight(px4_types, names[::3], chance(2), count=400).write(tmp_path / "a.ulg")
    theirs = columns_of_pyulog(path)
    with recordings.open(path) as log:
        for samples in log.load().values():
            if len(samples):
                key = samples.topic.name, samples.topic.instance
                assert list(differences(samples.columns(), theirs[key])) == []
        for topic in log.topics:
            schema = read_schema(topic.ros_type, topic.definition)
            own = getattr(px4_types, topic.ros_type.rpartition("/")[2]).__msg__
            assert {field.name for field in schema.message.fields} == {
                field.name for field in read_schema(own.ros_type, own.definition).message.fields
            }
        assert log.problems == []


def test_the_size_of_samples_is_that_of_an_independent_count(px4_types: Any, tmp_path: Path) -> None:
    for name in SOME:
        info = getattr(px4_types, name).__msg__
        formats = formats_of(info.ros_type, info.definition)
        writer = UlogWriter()
        for each, fields in formats.items():
            writer.format(each, fields)
        writer.subscribe(7, snake(name))
        for with_end in (False, True):
            size = size_of(formats, snake(name), with_end=with_end)
            for surplus in (-1, 0, 1):
                writer.sample(7, content_of(chance(3), size + surplus, 5))
        with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
            (topic,) = log.topics
            layout = topic.channels[0][1].layout
            assert layout is not None
            assert layout.size == size_of(formats, snake(name), with_end=False)
            assert layout.size + layout.surplus == size_of(formats, snake(name), with_end=True)
            wrong = {size - 1 for size in (layout.size,)} | {layout.size + layout.surplus + 1}
            assert {int(problem.text.split()[0]) for problem in log.problems} == wrong


def test_names_of_messages_are_those_of_the_definitions() -> None:
    expected = {}
    for path in DEFINITIONS:
        for topic in " ".join(re.findall(r"^# TOPICS (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)).split():
            if "".join(part[:1].upper() + part[1:] for part in topic.split("_")) != path.stem:
                expected[topic] = path.stem
    assert expected == MESSAGES


def test_a_topic_of_another_name_has_the_message_of_a_format_with_the_same_fields(tmp_path: Path) -> None:
    writer = UlogWriter()
    for number, name in enumerate(
        ["rover_thing", "rover_thing_2", "rover_thing_other", "vehicle_gps_position", "thing"]
    ):
        writer.format(
            name, "uint64_t timestamp;float x" if name != "rover_thing_other" else "uint64_t timestamp;float y"
        )
        writer.subscribe(number, name)
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert {topic.name: topic.ros_type.removeprefix("px4_msgs/msg/") for topic in log.topics} == {
            "rover_thing": "RoverThing",
            "rover_thing_2": "RoverThing",
            "rover_thing_other": "RoverThingOther",
            "thing": "Thing",
            "vehicle_gps_position": "SensorGps",
        }


def test_nested_formats_bools_and_chars(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("inner", "uint32_t a;bool b;uint8_t[3] _padding0")
    writer.format("outer", "uint64_t timestamp;inner[2] items;inner one;char[3] text;bool last")
    writer.subscribe(1, "outer")
    writer.sample(1, struct.pack("<QIB3xIB3xIB3x3sB", 9, 1, 1, 2, 0, 3, 7, b"ab\xff", 2))
    path = writer.write(tmp_path / "a.ulg")
    with recordings.open(path) as log:
        columns = log.columns("outer")
        assert {name: values.tolist() for name, values in columns.items()} == {
            "timestamp": [9],
            "items[0].a": [1],
            "items[0].b": [True],
            "items[1].a": [2],
            "items[1].b": [False],
            "one.a": [3],
            "one.b": [True],
            "text[0]": [97],
            "text[1]": [98],
            "text[2]": [255],
            "last": [True],
        }
        assert list(differences(columns, columns_of_pyulog(path)["outer", 0])) == []
        assert log.topics[0].definition == (
            "uint64 timestamp\nInner[2] items\nInner one\nchar[3] text\nbool last\n"
            f"{'=' * 80}\nMSG: px4_msgs/Inner\nuint32 a\nbool b\n"
        )
        assert read_schema(log.topics[0].ros_type, log.topics[0].definition).is_static


def test_instances_and_topics_that_are_named_late_or_again(tmp_path: Path) -> None:
    writer = small()
    writer.sample(0, attitude(1000))
    writer.subscribe(1, "vehicle_attitude", 1)
    writer.sample(1, attitude(2000))
    writer.subscribe(0, "vehicle_attitude")
    writer.sample(0, attitude(3000, padding=7))
    writer.subscribe(0, "vehicle_attitude", 2)
    writer.sample(0, attitude(4000))
    writer.remove(0)
    writer.sample(0, attitude(5000))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        times = {topic.label: topic.times.tolist() for topic in log.topics}
        assert times == {
            "vehicle_attitude": [1_000_000, 3_000_000],
            "vehicle_attitude 1": [2_000_000],
            "vehicle_attitude 2": [4_000_000],
        }
        assert [topic.count for topic in log.topics] == [2, 1, 1]
        assert log["vehicle_attitude", 2]["q"].tolist() == [[0.5] * 4]
        assert [(problem.samples, problem.text) for problem in log.problems] == [
            (1, "samples of topics that were never named (numbers 0)")
        ]


def test_samples_of_formats_without_a_time_have_that_of_the_sample_before(tmp_path: Path) -> None:
    writer = small()
    writer.format("count", "uint32_t number")
    writer.subscribe(5, "count")
    for number in range(3):
        writer.sample(5, struct.pack("<I", number))
        writer.sample(0, attitude(1000 * (number + 1)))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        samples = log.samples("count")
        assert samples.log_times.tolist() == [0, 1_000_000, 2_000_000]
        assert samples.array["number"].tolist() == [0, 1, 2]


def test_start_and_stop_choose_samples(px4_types: Any, tmp_path: Path) -> None:
    path = flight(px4_types, ["SensorCombined", "EscStatus"], chance(4), count=300).write(tmp_path / "a.ulg")
    with recordings.open(path) as log:
        whole = log.samples("sensor_combined")
        part = log.samples("sensor_combined", start=0.1, stop=0.2)
        low, high = log.start + 100_000_000, log.start + 200_000_000
        expected = whole.array[(whole.log_times >= low) & (whole.log_times < high)]
        assert 0 < len(expected) < len(whole)
        assert part.array.tobytes() == expected.tobytes()


def test_data_that_is_appended_after_a_crash(tmp_path: Path) -> None:
    writer = small()
    writer.sample(0, attitude(1000))
    writer.data += struct.pack("<HB", 40, ord("D")) + b"\0\0 cut"
    writer.append_from_here()
    writer.text(2, 3_000, "hard fault")
    writer.sample(0, attitude(2000))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:  # pyulog forgets the topics at the first offset
        assert log["vehicle_attitude"]["timestamp"].tolist() == [1000, 2000]
        assert [text.text for text in log.texts] == ["hard fault"]
        assert [problem.size for problem in log.problems] == [9]


def test_old_files_have_no_flags(tmp_path: Path) -> None:
    writer = small(flags=False, version=0)
    writer.sample(0, attitude(1000))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log.kind == "ulog"
        assert log["vehicle_attitude"]["timestamp"].tolist() == [1000]
        assert log.problems == []


def test_a_file_without_samples(tmp_path: Path) -> None:
    with recordings.open(small().write(tmp_path / "a.ulg")) as log:
        assert len(log["vehicle_attitude"]) == 0
        assert (log.start, log.end, log.duration) == (0, 0, 0.0)


def test_what_a_log_has_beside_its_samples(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("vehicle_attitude", ATTITUDE)
    writer.information("char[3] sys_name", b"PX4")
    writer.information("uint32_t ver_sw_release", struct.pack("<I", 0x011100FF))
    writer.information("char[6] ver_sw", b"abc123")
    writer.information("char[4] sys_uuid", b"0042")
    writer.information("float[2] pair", struct.pack("<2f", 0.5, 1.5))
    writer.information("uint8_t[2] raw", b"\1\2")
    writer.part("char[3] perf", b"one", continues=False)
    writer.part("char[3] perf", b"two", continues=True)
    writer.part("char[5] perf", b"three", continues=False)
    writer.parameter("SYS_AUTOSTART", 4001)
    writer.parameter("MPC_XY_P", 0.5)
    writer.parameter("MPC_XY_P", 0.25, default=1)
    writer.parameter("MPC_Z_P", 0.75, default=3)
    writer.parameter("MPC_Z_P", 1.75, default=2)
    writer.subscribe(0, "vehicle_attitude")
    writer.sample(0, attitude(1000))
    writer.text(4, 1500, "low battery\t")  # as PX4 writes it if there is an event, too
    writer.text(6, 1600, "tagged", tag=3)
    writer.sample(0, attitude(2000))
    writer.dropout(25)
    writer.parameter("MPC_XY_P", 1.5)
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log.parameters == {"SYS_AUTOSTART": 4001, "MPC_XY_P": 0.5}
        assert log.facts.default_parameters == {"MPC_XY_P": 0.25, "MPC_Z_P": 0.75}
        assert log.facts.airframe_defaults == {"MPC_Z_P": 1.75}
        assert list(log.facts.changed_parameters) == [(2_000_000, "MPC_XY_P", 1.5)]
        assert list(log.texts) == [
            Text(1_500_000, "warning", "low battery", is_event=True),
            Text(1_600_000, "info", "tagged", 3),
        ]
        assert list(log.dropouts) == [Dropout(2_000_000, 25_000_000)]
        assert log.information == {
            "sys_name": "PX4",
            "ver_sw_release": 0x011100FF,
            "ver_sw": "abc123",
            "sys_uuid": "0042",
            "pair": (0.5, 1.5),
            "raw": b"\1\2",
            "perf": [["one", "two"], ["three"]],
        }
        assert log.firmware == ("v1.17.0", "abc123")
        assert log.vehicle == "0042"
        assert log.problems == []


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    with pytest.raises(recordings.RecordingError, match="flags that this version cannot read"):
        recordings.open(UlogWriter(incompatible=b"\2" + bytes(7)).write(path))
    with pytest.raises(recordings.RecordingError, match="flags that this version cannot read"):
        recordings.open(UlogWriter(incompatible=bytes(7) + b"\1").write(path))
    path.write_bytes(bytes(UlogWriter().data[:12]))
    with pytest.raises(recordings.RecordingError, match="cut off within its header"):
        recordings.open(path)


GPS = (
    "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;uint8_t fix_type;"
    "uint8_t[7] _padding0"
)


def gps(time: int, utc: int, fix: int = 3) -> bytes:
    return struct.pack("<QQ2dB", time, utc, 47.5, 8.5, fix)


def flight_with_facts() -> UlogWriter:
    """Return a log with two receivers, a parameter, a text, a dropout and a damaged end."""
    writer = UlogWriter()
    writer.format("sensor_gps", GPS)
    writer.information("char[3] sys_name", b"PX4")
    writer.information("uint32_t ver_sw_release", struct.pack("<I", 0x011100FF))
    writer.information("char[4] sys_uuid", b"0042")
    writer.parameter("MPC_XY_P", 0.5)
    for instance in range(2):
        writer.subscribe(instance, "sensor_gps", instance)
    writer.text(4, 1_500_000, "low battery")
    for number in range(3):
        time = 1_000_000 * (number + 1)
        writer.sample(0, gps(time, 1_790_000_000_000_000 + time))
        writer.sample(1, gps(time, 0, fix=0))
    writer.dropout(25)
    writer.data += b"\x20\0D\0\0"
    return writer


@pytest.mark.parametrize(
    ("samples", "offset"),
    [
        ([], None),
        ([gps(5, 0)], None),
        ([gps(5, 1000)], None),
        ([gps(5, 1 << 63)], None),
        ([gps(5, 1_700_000_000_000_005, fix=0)], 1_700_000_000_000_000_000),
        ([gps(5, 1_600_000_000_000_005, fix=2), gps(7, 1_700_000_000_000_007)], 1_700_000_000_000_000_000),
        # a simulator that counts since 1970, without and with samples before its clock is set
        ([gps(1_700_000_000_000_005, 0)], 0),
        ([gps(0, 0, fix=0), gps(1_700_000_000_000_005, 1_700_000_000_000_005)], 0),
    ],
)
def test_utc_comes_from_receivers_with_a_fix(samples: list[bytes], offset: int | None, tmp_path: Path) -> None:
    writer = UlogWriter(start=1_700_000_000_000_000 if offset == 0 else 1_000_000)
    writer.format("vehicle_gps_position", GPS)
    writer.subscribe(0, "vehicle_gps_position")
    for sample in samples:
        writer.sample(0, sample)
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log.utc_offset == offset


def test_a_recording_starts_with_the_time_in_the_header(tmp_path: Path) -> None:
    writer = UlogWriter(start=50_000_000)
    writer.format("vehicle_gps_position", GPS)
    writer.subscribe(0, "vehicle_gps_position")
    for time in (0, 49_000_000, 51_000_000, 52_000_000, 60_000_000):
        writer.sample(0, gps(time, 0))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert (log.start, log.end, log.duration) == (50_000_000_000, 60_000_000_000, 10.0)
        times = [log.samples("vehicle_gps_position", start=start, stop=2.5).array["timestamp"] for start in (None, 0)]
        assert list(map(len, times)) == [4, 4]
        parts = [log.samples("vehicle_gps_position", start=start, stop=start + 2) for start in (0, 2, 4, 6, 8)]
        assert [len(part) for part in parts] == [3, 1, 0, 0, 0]
        assert len(log.samples("vehicle_gps_position", start=10)) == 1


def test_utc_comes_from_the_start_of_the_vehicle_first(tmp_path: Path) -> None:
    writer = flight_with_facts()
    del writer.data[-5:]
    writer.information("uint64_t boot_time_utc_us", struct.pack("<Q", 1_780_000_000_000_000))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log.utc_offset == 1_780_000_000_000_000_000


@pytest.mark.parametrize(
    ("number", "release"),
    [
        (0x011100FF, "v1.17.0"),
        (0x011001C0, "v1.16.1-rc"),
        (0x011001C2, "v1.16.1-rc2"),
        (0x010F0080, "v1.15.0-beta"),
        (0x010F0041, "v1.15.0-alpha1"),
        (0x010F0000, "v1.15.0-dev"),
    ],
)
def test_releases(number: int, release: str) -> None:
    assert release_text(number) == release


def test_another_log_has_its_own_formats(tmp_path: Path) -> None:
    for inner, size in [("float x", 4), ("double x", 8), ("float y", 4)]:
        writer = UlogWriter()
        writer.format("inner", inner)
        writer.format("outer", "uint64_t timestamp;inner[2] items")
        writer.subscribe(1, "outer")
        writer.sample(1, bytes(8 + 2 * size))
        with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
            array = log["outer"]
            assert array.dtype["items"].base.names == (inner[-1],)
            assert array.dtype.itemsize == 8 + 2 * size
            array.dtype.names = ("a", "b")  # a program can do this
        with recordings.open(tmp_path / "a.ulg") as log:
            assert log["outer"].dtype.names == ("timestamp", "items")


def test_parameters_change_at_the_latest_time_of_the_samples_before_them(tmp_path: Path) -> None:
    random = chance(5)
    writer = small()
    writer.format("thing", "uint32_t x")
    writer.subscribe(1, "thing")
    expected, latest = [], 0
    writer.sample(0, attitude(latest))
    for index in range(500):
        kind = random.randrange(5)
        time = random.randrange(1_000_000)
        if kind == 0:
            writer.parameter("MC_P", index)
            expected.append((latest * 1000, "MC_P", index))
        elif kind == 1:
            writer.sample(0, attitude(time)[:-2])  # left out
        elif kind == 2:
            writer.sample(1, bytes(4))  # without a time
        else:
            writer.sample(0, attitude(time))
            latest = max(latest, time)
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        assert log.facts.changed_parameters == expected


def test_a_sample_without_a_time_has_that_of_the_sample_before(tmp_path: Path) -> None:
    """It stays at its place, makes no gap, and is told."""
    writer = UlogWriter(start=48_000_000)
    for name in ("a", "b"):
        writer.format(name, "uint64_t timestamp;float x")
    writer.format("c", "float x")
    for number, name in enumerate("abc"):
        writer.subscribe(number, name)
    writer.sample(2, struct.pack("<f", 0))
    writer.sample(1, struct.pack("<Qf", 0, -1))
    for step in range(10):
        writer.sample(0, struct.pack("<Qf", 48_000_000 + step * 10_000, step))
    for step in (10, 11):
        writer.sample(0, struct.pack("<Qf", 0, step))
    with recordings.open(writer.write(tmp_path / "unset.ulg")) as log:
        assert log["a"]["x"].tolist() == [*range(12)]
        assert log["a"]["timestamp"].tolist()[-2:] == [0, 0]
        assert log.samples("a").log_times.tolist()[-3:] == [48_090_000_000] * 3
        assert [log.topic(name).first for name in "abc"] == [48_000_000_000] * 3
        assert log.topic("a").gaps == []
        assert log.duration == pytest.approx(0.09)
        assert log.problems == []
        assert log.notes == [
            "a: 2 samples with timestamp 0, which got the time of the sample before in the file",
            "b: 1 sample with timestamp 0, which got the time of the sample before in the file",
        ]
