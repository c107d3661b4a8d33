"""Tests of the definitions in MCAP files: of all releases, of topics with several ones, and in other formats."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from msggen import recordings
from msggen.messages.firmware import releases
from msggen.recordings.decode.layouts import layout_of
from msggen.recordings.source.source import RecordingError
from support.log_files import Written, definition_in, write_log
from support.mcap_reference import flat

START = 1_790_000_000_000_000_000
NAMES = ("VehicleStatus", "BatteryStatus", "EscStatus", "VehicleOdometry", "FailsafeFlags")
TOPIC = "/fmu/out/airspeed_validated"
TYPE = "px4_msgs/msg/AirspeedValidated"


def written(topic: str, ros_type: str, definition: str, indices: range, seed: int = 1) -> Written:
    """Return a topic with a sample of random bytes at each index, in ms."""
    layout = layout_of(ros_type, definition)
    assert layout is not None
    chance = Random(seed)  # noqa: S311 - no secret
    times = [START + index * 1_000_000 for index in indices]
    samples = [(time, time - 5, b"\0\1\0\0" + chance.randbytes(layout.size - 4)) for time in times]
    return Written(topic, ros_type, definition, samples)


@pytest.mark.parametrize("release", list(releases()))
def test_definitions_of_all_releases_are_read_as_mcap_ros2_reads_them(release: str, tmp_path: Path) -> None:
    definitions = {f"px4_msgs/msg/{name}": definition_in(release, name) for name in NAMES}
    topics = [
        written(f"/{number}", ros_type, definition, range(number, 60, 7))
        for number, (ros_type, definition) in enumerate(definitions.items())
    ]
    path = write_log(tmp_path / "flight.mcap", topics)
    with recordings.open(path) as log, path.open("rb") as file:
        columns = {topic: log.columns(topic) for topic in ("/0", "/1", "/2", "/3", "/4")}
        counts = dict.fromkeys(columns, 0)
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            row = flat(message)
            assert row.keys() == columns[channel.topic].keys()
            for name, value in row.items():
                found = columns[channel.topic][name][counts[channel.topic]]
                np.testing.assert_array_equal(found, np.array(value).astype(found.dtype), name)
            counts[channel.topic] += 1
        assert counts == {topic.name: topic.count for topic in log.topics}
        assert log.problems == []


def test_a_definition_that_changes_within_a_file_makes_another_topic(tmp_path: Path) -> None:
    """The vehicle got another firmware while it was recorded."""
    old, new = (definition_in(release, "AirspeedValidated") for release in ("v1.15", "v1.18"))
    assert layout_of(TYPE, old) != layout_of(TYPE, new)
    parts = [written(TOPIC, TYPE, old, range(30)), written(TOPIC, TYPE, new, range(30, 50))]
    with recordings.open(write_log(tmp_path / "flight.mcap", parts, chunk_size=500)) as log:
        assert [(topic.name, topic.definition, topic.count) for topic in log.topics] == [
            (f"{TOPIC}#1", old, 30),
            (f"{TOPIC}#2", new, 20),
        ]
        for label, part in zip((f"{TOPIC}#1", f"{TOPIC}#2"), parts, strict=True):
            samples = log.samples(label)
            assert samples.log_times.tolist() == [time for time, _, _ in part.samples]
            assert samples.array["timestamp"].tolist() == [
                int.from_bytes(payload[4:12], "little") for _, _, payload in part.samples
            ]
        assert [payload for _, _, payload in log.payloads()] == [
            payload for part in parts for _, _, payload in part.samples
        ]
        assert log.problems == []
        assert len(log["airspeed_validated#2"]) == 20
        for name in (TOPIC, "airspeed_validated", "AirspeedValidated"):  # neither has all samples
            with pytest.raises(RecordingError, match=f"'{name}' is the name of several topics: {TOPIC}#1, {TOPIC}#2"):
                log.samples(name)


def test_channels_of_one_topic_with_one_definition_are_one_topic(tmp_path: Path) -> None:
    """Two programs publish it, or it was recorded in two runs."""
    text = definition_in("v1.18", "AirspeedValidated")
    even, odd = (written(TOPIC, TYPE, text, range(first, 60, 2), first) for first in (0, 1))
    expected = sorted([*even.samples, *odd.samples])
    with recordings.open(write_log(tmp_path / "flight.mcap", [even, odd], chunk_size=500)) as log:
        (topic,) = log.topics
        samples = log.samples("airspeed_validated")
        assert (topic.name, topic.count, len(topic.channels)) == (TOPIC, 60, 2)
        assert samples.log_times.tolist() == [time for time, _, _ in expected]
        assert samples.publish_times is not None
        assert samples.publish_times.tolist() == [time for _, time, _ in expected]
        timestamps = [int.from_bytes(payload[4:12], "little") for _, _, payload in expected]
        assert samples.array["timestamp"].tolist() == timestamps
        assert sorted(topic.times.tolist()) == samples.log_times.tolist()
        assert log.problems == []


def test_definitions_in_other_formats_are_told(tmp_path: Path) -> None:
    """PX4's messages are read by an embedded release; others are not decoded, but are there as bytes."""
    text = definition_in("v1.18", "AirspeedValidated")
    samples = written(TOPIC, TYPE, text, range(20)).samples
    path = tmp_path / "flight.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        kinds = [(TOPIC, TYPE, "ros2idl"), ("/other", "our_msgs/msg/Other", "ros2idl"), ("/odd", "our.Odd", "protobuf")]
        for topic, ros_type, encoding in kinds:
            schema = writer.register_schema(ros_type, encoding, b"module px4_msgs {};")
            channel = writer.register_channel(topic, "protobuf" if encoding == "protobuf" else "cdr", schema)
            for log_time, publish_time, payload in samples:
                writer.add_message(channel, log_time, payload, publish_time)
        writer.finish()
    with recordings.open(path) as log:
        loaded = log.load()
        assert [(name, len(each)) for name, each in loaded.items()] == [(TOPIC, 20)]
        assert "2 topics have no definitions as ros2msg in the recording; 1 taken from v1." in log.notes[0]
        assert [(problem.text, problem.samples) for problem in log.problems] == [
            ("/odd is not decoded: samples in 'protobuf', expected cdr", 20),
            ("/other is not decoded: its definition is in 'ros2idl', expected ros2msg", 20),
        ]
        with pytest.raises(RecordingError, match="/other cannot be decoded: its definition is in 'ros2idl'"):
            log.samples("/other")
        assert sum(1 for _ in log.payloads(["/other"])) == 20
