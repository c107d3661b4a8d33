"""Tests of the samples of a ULog as CDR: by the slow codec of the tests, and beside what the converter writes."""

from __future__ import annotations

import struct
from collections import defaultdict
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.recordings import RecordingError
from msggen.recordings.decode.schemas import read_schema
from support.reference import Values, deserialize, padding, serialize
from support.ulog import UlogWriter, flight, write_ulog

NAMES = ("EscStatus", "VehicleStatus", "SensorCombined", "BatteryStatus", "VehicleCommand", "ObstacleDistance", "Event")


def values_of(row: Any) -> Values:
    """Return the values of a row of a structured array."""
    return {name: _value(row[name]) for name in row.dtype.names}


def _value(value: Any) -> Any:
    if isinstance(value, np.void):
        return values_of(value)
    if isinstance(value, np.ndarray):
        return [_value(each) for each in value]
    return value.item()


def check(log: recordings.Log) -> int:
    """Check each sample with the slow codec, and return the time of the last one."""
    found: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    last = 0
    for sample in log.payloads():
        assert sample.time >= last
        last = sample.time
        found[sample.topic].append((sample.time, sample.payload))
    for topic in log.topics:
        if not topic.definition:
            continue
        schema = read_schema(topic.ros_type, topic.definition)
        samples = log.samples(topic)
        own = found.pop(f"{topic.name}[{topic.instance}]" if topic.instance else topic.name, [])
        assert [time for time, _ in own] == samples.log_times.tolist()
        for row, (_, payload) in zip(samples.array, own, strict=True):
            values = values_of(row)
            expected = serialize(schema.catalog, schema.message, values, "little", 1)
            if "nan" in repr(values):  # Python keeps no bits of NaN
                assert len(payload) == len(expected)
                assert repr(deserialize(schema.catalog, schema.message, payload)) == repr(values)
                assert not any(payload[place] for place in padding(schema.catalog, schema.message, values, "little", 1))
            else:
                assert payload == expected
    assert not found
    return last


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("is_padded", [False, True])
def test_samples_are_those_of_the_slow_codec(px4_types: Any, tmp_path: Path, seed: int, *, is_padded: bool) -> None:
    names = [name for name in NAMES if hasattr(px4_types, name)]
    writer = flight(px4_types, names, Random(seed), count=200, is_padded=is_padded)  # noqa: S311 - no secret
    with recordings.open(writer.write(tmp_path / "flight.ulg")) as log:
        assert check(log)
        assert sum(1 for _ in log.payloads()) == 200


def test_all_topics_of_a_log_with_nested_messages(tmp_path: Path) -> None:
    with recordings.open(write_ulog(tmp_path / "flight.ulg")) as log:
        assert check(log)
        topic = log.topic("esc_status")
        schema = read_schema(topic.ros_type, topic.definition)
        first = next(log.payloads(["esc_status"]))
        read = deserialize(schema.catalog, schema.message, first.payload)
        assert read["timestamp"] == log["esc_status"]["timestamp"][0]


def test_a_name_finds_the_topic_of_a_sample(tmp_path: Path) -> None:
    with recordings.open(write_ulog(tmp_path / "flight.ulg")) as log:
        names = {sample.topic for sample in log.payloads(["sensor_gps", ("sensor_gps", 1)])}
        assert names == {"sensor_gps", "sensor_gps[1]"}
        assert {log.topic(name).instance for name in names} == {0, 1}
        with pytest.raises(RecordingError, match="has samples in 'ulog', and names that ROS 2 does not allow"):
            log.payloads(["odd"])


def test_times_are_limits_and_wrong_sizes_are_left_out(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("rates", "uint64_t timestamp;float x;bool is_on")
    writer.subscribe(0, "rates")
    for index in range(10):
        short = index == 4
        writer.sample(0, struct.pack("<Qf", 1_000_000 + index, index) + (b"" if short else b"\2"))
    with recordings.open(writer.write(tmp_path / "x.ulg")) as log:
        found = [struct.unpack("<4sQf?", sample.payload)[2:] for sample in log.payloads()]
        assert found == [(index, True) for index in range(10) if index != 4]  # bools are 0 or 1
        later = [sample.time for sample in log.payloads(start=2e-6, stop=6e-6)]
        assert later == [log.start + 1000 * index for index in (2, 3, 5)]
        assert [problem.samples for problem in log.problems if "rates" in problem.topic] == [1]
