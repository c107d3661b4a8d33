"""Tests of the topics of a recording: which channels are one topic, and which topic a name stands for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen import recordings
from msggen.exports.convert import convert
from msggen.exports.player import endpoints_of
from msggen.recordings import Log, RecordingError
from msggen.recordings.topics.choice import Choice
from support.log_files import START, TYPE, Written, foos, opened, write_log
from support.scratch import scratch_folder
from support.ulog import write_ulog

NO_HASH = f"RIHS01_{'0' * 64}"


def write_bag(folder: Path, *files: Written) -> Path:
    """Write a recording of rosbag2 without metadata.yaml: a file for each topic."""
    folder.mkdir()
    for number, each in enumerate(files):
        write_log(folder / f"bag_{number}.mcap", [each])
    return folder


# which channels are one topic


@st.composite
def spellings(draw: st.DrawFn) -> str:
    """Return the definition FOO with other comments, spaces and constants."""
    lines = ["uint64 timestamp", "float32 x"]
    notes = ["", " # seconds", "   ", "\t# x"]
    extra = ["", "# Foo", "uint8 KIND=1", "uint8 KIND=2 # another"]
    drawn = [f"{line}{draw(st.sampled_from(notes))}" for line in lines]
    return "\n".join([draw(st.sampled_from(extra)), *drawn, draw(st.sampled_from(extra[:2])), ""])


@given(st.lists(spellings(), min_size=1, max_size=4))
def test_comments_and_constants_do_not_split_a_topic(definitions: list[str]) -> None:
    parts = [foos("/fmu/out/foo", range(number, 20, 4), text) for number, text in enumerate(definitions)]
    with scratch_folder() as folder, opened(folder, *parts) as log:
        assert log.keys() == ["/fmu/out/foo"]
        assert sorted(log["foo"]["timestamp"]) == sorted(
            number for n, _ in enumerate(parts) for number in range(n, 20, 4)
        )
        assert log.problems == []


def test_a_topic_with_several_definitions_is_never_read_in_part(tmp_path: Path) -> None:
    other = Written("/a", TYPE, "uint64 timestamp\n", [(START + 1, START, b"\0\1\0\0" + bytes(8))])
    with opened(tmp_path, foos("/a", range(3)), other) as log:
        assert log.keys() == ["/a#1", "/a#2"]
        assert [len(log[key]) for key in log] == [3, 1]
        for name in ("/a", "a", "Foo"):
            assert name not in log
            with pytest.raises(RecordingError, match=re.escape(f"'{name}' is the name of several topics: /a#1, /a#2")):
                log.samples(name)
        for pattern in ("*", "/a*", "Fo?"):
            assert list(log.load(pattern)) == ["/a#1", "/a#2"]
        made = convert(log, str(tmp_path / "tables"), format="csv", topics=["/a*"])
        assert [Path(each).name for each in made.files] == ["a-2.csv", "a.csv"]


def test_the_first_definition_of_a_topic_is_played(px4_types: Any, tmp_path: Path) -> None:
    info = px4_types.Wind.__msg__
    sample = (START, START, px4_types.Wind(timestamp=7).encode())
    topics = [
        Written("/fmu/out/wind", info.ros_type, info.definition, [sample]),
        Written("/fmu/out/wind", info.ros_type, "uint64 timestamp\n", [(START + 1, START, sample[2][:12])]),
    ]
    with opened(tmp_path, *topics) as log:
        endpoints = endpoints_of(log, Choice(["/fmu/out/wind"]))
        assert [(name, writer.name) for name, writer in endpoints.writers.items()] == [
            ("/fmu/out/wind#1", "rt/fmu/out/wind")
        ]
        assert [each.payload for each in log.payloads(endpoints.writers)] == [sample[2]]


def test_a_missing_definition_is_taken_from_another_file(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", foos("/a", range(3)), foos("/a", range(3, 5), ""))
    with recordings.open(folder) as log:
        (topic,) = log.topics
        assert (topic.name, topic.count, topic.is_lent) == ("/a", 5, False)
        assert log["/a"]["timestamp"].tolist() == [0, 1, 2, 3, 4]
        assert (log.notes, log.path) == ([], str(folder))
        assert "bag': mcap" in repr(log)


def test_a_definition_that_does_not_fit_is_not_taken(tmp_path: Path) -> None:
    short = Written("/a", TYPE, "", [(START, START, b"\0\1\0\0" + bytes(4))])
    folder = write_bag(tmp_path / "bag", foos("/a", range(3)), short)
    with recordings.open(folder) as log:
        assert log["/a"]["timestamp"].tolist() == [0, 1, 2]
        problems = [(each.text, each.samples) for each in log.problems if each.samples]
        assert problems == [("/a#2 is not decoded: the recording has no definition", 1)]


def test_a_channel_in_another_encoding_is_left_out_and_counted(tmp_path: Path) -> None:
    """The other samples of its topic, and the other topics, are read."""
    odd = [foos("/a", range(3, 5), encoding="json"), foos("/b", range(1), encoding="json")]
    with opened(tmp_path, *odd, foos("/a", range(3)), foos("/c", range(2))) as log:
        loaded = log.load()
        assert {key: samples.array["timestamp"].tolist() for key, samples in loaded.items()} == {
            "/a": [0, 1, 2],
            "/c": [0, 1],
        }
        text = "is not decoded: samples in 'json', expected cdr"
        assert {(each.text, each.samples) for each in log.problems} == {(f"/a#2 {text}", 2), (f"/b {text}", 1)}
        assert len(log["a"]) == len(log["/a"]) == 3
        assert log.keys() == ["/a", "/a#2", "/b", "/c"]
        assert [sample.topic for sample in log.payloads()].count("/a") == 3
        assert sum(len(part.starts) for _, part in log.undecoded(["/a*"])) == 5
        with pytest.raises(RecordingError, match="/b cannot be decoded: samples in 'json'"):
            log.load(["/a", "/b"])
        made = convert(log, str(tmp_path / "tables"), format="parquet")
        assert made.rows == 5
    with recordings.open(tmp_path / "flight.mcap") as log:
        assert (len(log["/a"]), [each.text for each in log.problems]) == (3, [f"/a#2 {text}"])


def test_a_hash_of_zeros_is_no_hash(px4_types: Any, tmp_path: Path) -> None:
    info = px4_types.Wind.__msg__
    sample = px4_types.Wind(timestamp=7).encode()
    wind = Written("/wind", info.ros_type, info.definition, [(START, START, sample)], {"topic_type_hash": NO_HASH})
    with opened(tmp_path, wind) as log:
        assert log.topic("wind").type_hash == ""
        assert [each.timestamp for each in log.messages(px4_types.Wind)] == [7]
        (compared,) = log.compare(px4_types)
        assert compared.is_same
        assert log.release().releases


def test_an_empty_message_is_decoded(tmp_path: Path) -> None:
    empties = [
        Written(name, "std_msgs/msg/Empty", text, [(START, START, b"\0\1\0\0\0")], format="ros2msg")
        for name, text in (("/a", ""), ("/b", "# nothing\n"))
    ]
    with opened(tmp_path, *empties) as log:
        assert {key: len(samples) for key, samples in log.load().items()} == {"/a": 1, "/b": 1}
        assert len(log.table("/b", times=True)) == 1
        assert log.problems == []


def test_a_definition_in_another_format_is_the_reason(tmp_path: Path) -> None:
    idl = foos("/a", range(2), "module our_msgs {};", format="ros2idl")
    with opened(tmp_path, idl) as log:
        with pytest.raises(
            RecordingError, match="/a cannot be decoded: its definition is in 'ros2idl', expected ros2msg"
        ):
            log["/a"]
        reason, hint = log.notes
        assert reason == "1 topic has no definition as ros2msg in the recording, and no embedded release fits"
        assert hint.startswith("for the types of our_msgs, name the folder of their package, --msg-dir our_msgs=DIR")


# names


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Log]:
    """Two instances of a topic, as ROS 2 has them."""
    topics = [foos(f"/uav/fmu/out/foo{end}", range(number + 1)) for number, end in enumerate(("", "_1", "_2_v3"))]
    with opened(tmp_path, *topics, foos("/fmu/out/foo_groundtruth", range(9))) as log:
        yield log


@pytest.fixture
def ulog(tmp_path: Path) -> Iterator[Log]:
    write_ulog(tmp_path / "flight.ulg")
    with recordings.open(tmp_path / "flight.ulg") as log:
        yield log


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize("front", ["foo", "fmu/out/foo", "/uav/fmu/out/foo", "Foo", TYPE])
def test_instances_in_ros_have_the_same_spellings(ros: Log, front: str, number: int) -> None:
    keys: list[Any] = [(front, number), f"{front}[{number}]", (front, np.int64(number))]
    if front.endswith("foo"):
        keys.append(f"{front}_{number}" if number else front)
    for key in keys:
        assert len(ros.samples(key)) == number + 1, key
        assert len(ros.samples(key, instance=number)) == number + 1
        with pytest.raises(
            RecordingError, match=rf"is the instance {number}, and instance=4 was asked for|has no inst"
        ):
            ros.samples(key, instance=4)
    assert len(ros.samples(front, instance=np.int64(number))) == number + 1  # type: ignore[arg-type]


def test_topics_of_a_ulog_have_their_names_in_ros(ulog: Log) -> None:
    expected = [ulog[key].tobytes() for key in ("sensor_gps", ("sensor_gps", 1))]
    for name in ("/fmu/out/sensor_gps", "/uav_1/fmu/out/sensor_gps", "/fmu/out/sensor_gps_v1"):
        assert ulog[name].tobytes() == expected[0]
        assert ulog[name, 1].tobytes() == ulog[f"{name}[1]"].tobytes() == expected[1]
    assert ulog["/fmu/out/sensor_gps_1"].tobytes() == expected[1]
    with pytest.raises(RecordingError, match="no topic is called '/fmu/out/sensor_mag'"):
        ulog["/fmu/out/sensor_mag"]


def test_instances_that_differ_are_refused(ulog: Log, ros: Log) -> None:
    for log, name in ((ulog, "sensor_gps"), (ros, "foo")):
        for key in ((name, 0), log.topic(name), f"{name}[0]"):
            assert len(log.samples(key, instance=0))
            with pytest.raises(RecordingError, match="is the instance 0, and instance=1 was asked for"):
                log.samples(key, instance=1)
    with pytest.raises(TypeError, match=r"^instance: expected a number, got 1\.5"):
        ulog.samples("sensor_gps", instance=1.5)  # type: ignore[arg-type]


def test_messages_take_the_instance(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.SensorGps
    info = cls.__msg__
    topics = [
        Written(
            f"/fmu/out/sensor_gps{end}",
            info.ros_type,
            info.definition,
            [(START, START, cls(timestamp=number).encode())],
        )
        for number, end in enumerate(("", "_1"))
    ]
    with opened(tmp_path, *topics) as log:
        for number in (0, 1):
            for options in ({}, {"topic": "sensor_gps"}, {"topic": ("sensor_gps", number)}):
                assert [each.timestamp for each in log.messages(cls, instance=number, **options)] == [number]
        assert [each.timestamp for each in log.messages(cls)] == [0]
        assert list(log.messages(cls, times=True)) == [(START, cls(timestamp=0))]
        with pytest.raises(RecordingError, match="has no instance 2"):
            log.messages(cls, instance=2)


def test_a_topic_of_another_log_stands_for_its_name(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    topics = [foos("/a", range(2)), foos("/b", range(3))]
    with opened(tmp_path, *topics) as one, opened(tmp_path / "b", *topics[::-1]) as other:
        for name in ("/a", "/b"):
            assert other.samples(one.topic(name)).array.tobytes() == one[name].tobytes()
    with opened(tmp_path, foos("/a", range(2))) as log:
        with pytest.raises(RecordingError, match="there is no topic '/b' here"):
            log.samples(one.topic("/b"))
        for read in (log.load, log.chosen):
            with pytest.raises(RecordingError, match="there is no topic '/b' here"):
                read([one.topic("/b")])


def test_the_topic_named_after_its_message_is_preferred(tmp_path: Path) -> None:
    with opened(tmp_path, foos("/foo_groundtruth", range(9)), foos("/foo", range(2))) as log:
        assert len(log["Foo"]) == len(log[TYPE]) == 2
    with (
        opened(tmp_path, foos("/one", range(9)), foos("/two", range(2))) as log,
        pytest.raises(RecordingError, match="'Foo' is the name of several topics: /one, /two"),
    ):
        log.samples("Foo")


def test_patterns_choose_topics(ulog: Log) -> None:
    assert list(ulog.load("sensor_*")) == ["sensor_gps", ("sensor_gps", 1)]
    assert list(ulog.load(["*gps*", "sensor_gps"])) == ["sensor_gps", ("sensor_gps", 1), "vehicle_gps_position"]
    assert list(ulog.load()) == [key for key in ulog.keys() if key in ulog.load()]  # noqa: SIM118 - not a dict
    with pytest.raises(RecordingError, match=r"no topic is called 'x\*'"):
        ulog.load("x*")


def test_what_is_no_key_is_not_in_a_log(ulog: Log) -> None:
    keys = (None, 1, "sensor_gps", "nope", ("sensor_gps", 7), ("sensor_gps",))
    assert [key for key in keys if key in ulog] == ["sensor_gps"]
