"""Tests of ULogs as MCAP with the definitions of releases: programs with px4_msgs of a release read what was logged."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msggen import recordings
from msggen.cli import main
from msggen.exports.convert import convert, join
from msggen.exports.convert.selection import Selection
from msggen.messages.firmware import releases
from msggen.sources.embedded import EMBEDDED
from support.examples import by_day, examples
from support.log_files import definition_in, write_ulog_of
from support.ulog import UTC, UlogWriter, formats_of, size_of, snake


def names_in(release: str) -> list[str]:
    """Return the messages that a release publishes and a ULog can name: the topic has the name of its message."""
    rows = releases()[release].values()
    return sorted(
        {row.message for row in rows if row.message == "".join(map(str.capitalize, snake(row.message).split("_")))}
    )


def converted(path: str, target: Path) -> list[str]:
    """Write a ULog as MCAP, and return the notes."""
    with recordings.open(path) as log:
        return list(convert(log, str(target), format="mcap").notes)


@by_day("release", EMBEDDED, 5)
def test_a_release_reads_the_samples_of_its_logs(
    release: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its own definitions, not those in the file, and another decoder."""
    names = names_in(release)[: examples(300, by_day=30)]
    assert len(names) > 20
    ulog = write_ulog_of(release, names, tmp_path / "flight.ulg", version=f"{release}.0")
    assert converted(ulog, tmp_path / "flight.mcap") == []
    store = get_typestore(Stores.EMPTY)
    for name in names:
        types = get_types_from_msg(definition_in(release, name), f"px4_msgs/msg/{name}")
        store.register({each: fields for each, fields in types.items() if each not in store.fielddefs})
    with recordings.open(ulog) as log, recordings.open(tmp_path / "flight.mcap") as copy:
        for name in names:
            topic = copy.topic(f"/fmu/out/{snake(name)}")
            assert (topic.ros_type, topic.definition) == (f"px4_msgs/msg/{name}", definition_in(release, name))
            read = [store.deserialize_cdr(payload, topic.ros_type) for _, _, payload in copy.payloads([topic])]
            logged, again = log[snake(name)], copy[topic.name]
            assert len(read) == len(logged) == len(again) == 3
            for column, values in log.columns(snake(name)).items():
                assert copy.columns(topic.name)[column].tobytes() == values.tobytes(), f"{name}.{column}"
            for field in logged.dtype.names or ():
                if logged.dtype[field].base.names is None:
                    found = [getattr(message, field) for message in read]
                    np.testing.assert_array_equal(np.array(found, logged.dtype[field].base), logged[field])
    assert main(["check", str(tmp_path / "flight.mcap"), release]) == 0
    assert "matches" in capsys.readouterr().out


def test_a_generated_class_reads_them(px4_types: Any, tmp_path: Path) -> None:
    names = names_in("v1.18")
    ulog = write_ulog_of("v1.18", names, tmp_path / "flight.ulg", count=5)
    converted(ulog, tmp_path / "flight.mcap")
    with recordings.open(ulog) as log, recordings.open(tmp_path / "flight.mcap") as copy:
        assert all(each.is_same for each in copy.compare(px4_types))
        for name in names:
            cls = getattr(px4_types, name)
            topic = f"/fmu/out/{snake(name)}"
            assert list(copy.messages(cls, topic=topic))
            payloads = [bytes(payload) for _, _, payload in copy.payloads([topic])]
            decoded = px4_types.batch.columns(cls.decode_batch(payloads))
            for column, values in log.columns(snake(name)).items():
                np.testing.assert_array_equal(decoded[column], values)


@pytest.mark.parametrize(
    ("version", "expected"),
    [("v1.16.2", "v1.16"), ("v1.13.0", "v1.14"), ("v1.15.1", "v1.15"), ("v1.99.0", "v1.18"), ("", "v1.18")],
)
def test_of_releases_with_the_same_fields_the_one_of_the_log_is_taken(
    version: str, expected: str, tmp_path: Path
) -> None:
    """Constants change while fields stay."""
    ulog = write_ulog_of(
        "v1.16", ["ActionRequest", "ActuatorTest", "OrbitStatus"], tmp_path / "flight.ulg", version=version
    )
    converted(ulog, tmp_path / "flight.mcap")
    with recordings.open(tmp_path / "flight.mcap") as copy:
        for topic in copy.topics:
            name = topic.ros_type.rpartition("/")[2]
            assert topic.definition == definition_in(expected, name)


def test_other_fields_stay_in_their_order_and_are_noted(tmp_path: Path) -> None:
    """Also where another topic of the same type has the fields of a release."""
    formats = {
        "vehicle_gps_position": "uint64_t timestamp;float mine;uint8_t[4] _padding0",
        "my_topic": "uint64_t timestamp;uint32_t a;uint8_t b",
        **formats_of("px4_msgs/msg/SensorGps", definition_in("v1.16", "SensorGps")),
    }
    writer = UlogWriter()
    random = np.random.default_rng(3)
    for name, text in formats.items():
        writer.format(name, text)
    for number, name in enumerate(formats):
        writer.subscribe(number, name)
        size = size_of(formats, name, with_end=False)
        writer.sample(number, struct.pack("<Q", number) + random.bytes(size - 8))
    ulog = writer.write(tmp_path / "flight.ulg")
    notes = converted(ulog, tmp_path / "flight.mcap")
    text = "2 topics in uORB's order of fields, because no embedded release has these fields"
    assert notes[-1] == f"programs with px4_msgs misread {text}: vehicle_gps_position, my_topic"
    assert len(notes) == 2
    assert "VehicleGpsPosition" in notes[0]
    with recordings.open(ulog) as log, recordings.open(tmp_path / "flight.mcap") as copy:
        assert copy.topic("/fmu/out/sensor_gps").definition == definition_in("v1.16", "SensorGps")
        assert copy.topic("/fmu/out/my_topic").definition == "uint64 timestamp\nuint32 a\nuint8 b\n"
        assert copy.topic("/fmu/out/vehicle_gps_position").definition == "uint64 timestamp\nfloat32 mine\n"
        for topic in log.topics:
            columns = copy.columns(f"/fmu/out/{topic.name}")
            assert {name: each.tobytes() for name, each in columns.items()} == {
                name: each.tobytes() for name, each in log.columns(topic).items()
            }


def test_copies_keep_the_definitions(tmp_path: Path) -> None:
    """A part has them, and logs of two releases as one file have a type for each definition."""
    paths = [
        write_ulog_of(
            release, ["EscStatus", "VehicleAttitude"], tmp_path / f"{release}.ulg", version=f"{release}.0", count=20
        )
        for release in ("v1.16", "v1.18")
    ]
    converted(paths[0], tmp_path / "flight.mcap")
    chosen = Selection(["esc_status"], 0.005, 0.009, None)
    for source in (paths[0], str(tmp_path / "flight.mcap")):
        with recordings.open(source) as log:
            part = tmp_path / f"part_of_{Path(source).stem}.mcap"
            join([log], str(part), chosen)
            expected = log.columns("esc_status", start=0.005, stop=0.009)
        with recordings.open(part) as copy:
            (topic,) = copy.topics
            assert topic.definition == definition_in("v1.16", "EscStatus")
            columns = copy.columns(topic)
            assert len(columns["timestamp"]) == 4
            assert {name: each.tobytes() for name, each in columns.items()} == {
                name: each.tobytes() for name, each in expected.items()
            }


def test_logs_of_two_releases_have_a_type_for_each_definition(tmp_path: Path) -> None:
    paths = [
        write_ulog_of(release, ["EscStatus"], tmp_path / f"{release}.ulg", version=f"{release}.0", boot=UTC)
        for release in ("v1.16", "v1.18")
    ]
    with recordings.open(paths[0]) as first, recordings.open(paths[1]) as second:
        notes = join([first, second], str(tmp_path / "joined.mcap")).notes
    assert not [note for note in notes if note.startswith("programs")]
    with recordings.open(tmp_path / "joined.mcap") as log:
        found = {topic.definition: topic.ros_type for topic in log.topics}
        both = [definition_in(release, "EscStatus") for release in ("v1.16", "v1.18")]
        assert [found[each] for each in both] == ["px4_msgs/msg/EscStatus", "px4_msgs/msg/EscStatus2"]
        assert all(len(log[topic.name]) == 3 for topic in log.topics)
