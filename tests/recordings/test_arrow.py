"""Tests of tables: their types, and what their metadata tells of units, frames and names of values."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from msggen import recordings
from support.flights import TOPICS, write_flight
from support.ulog import write_ulog


@pytest.fixture(scope="module")
def log(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[recordings.Log]:
    path = write_flight(tmp_path_factory.mktemp("arrow") / "flight.mcap", px4_types, 20)
    with recordings.open(path) as found:
        yield found


def described(table: Any, name: str) -> dict[str, str]:
    return {key.decode(): text.decode() for key, text in (table.schema.field(name).metadata or {}).items()}


def test_fields_have_the_units_and_frames_of_the_generated_package(log: recordings.Log, px4_types: Any) -> None:
    seen = 0
    for topic in TOPICS:
        table = log.table(topic)
        message = px4_types.by_type(log.topic(topic).ros_type)
        for field in message.__msg__.fields:
            names = [name for name in table.column_names if name.partition("[")[0] == field.name and "." not in name]
            for name in names:
                found = described(table, name)
                assert found.get("unit", "") == field.unit
                assert found.get("frame", "") == field.frame
                seen += bool(field.unit)
    assert seen > 50


def test_enums_are_the_members_of_the_generated_package(log: recordings.Log, px4_types: Any) -> None:
    table = log.table("vehicle_status")
    message = px4_types.VehicleStatus
    enums = [field.name for field in message.__msg__.fields if message.__msg__.enum(field.name)]
    assert "nav_state" in enums
    for name in enums:
        members = json.loads(described(table, name)["enum"])
        for value, member in members.items():
            assert message.__msg__.enum(name)[member] == int(value)


def test_the_table_tells_its_topic_and_type(log: recordings.Log) -> None:
    metadata = log.table("esc_status").schema.metadata
    assert metadata == {b"topic": b"/fmu/out/esc_status", b"instance": b"0", b"type": b"px4_msgs/msg/EscStatus"}


def test_values_are_those_of_the_columns(log: recordings.Log) -> None:
    for topic in (*TOPICS, "texts"):
        columns, table = log.columns(topic), log.table(topic)
        assert sorted(table.column_names) == sorted(columns)
        assert table.column_names[0] == next(iter(columns))
        for name, values in columns.items():
            if values.dtype == object:
                assert str(table[name].to_pylist()) == str([_plain(value) for value in values.tolist()])
            else:
                assert table[name].type == pa.from_numpy_dtype(values.dtype)
                assert table[name].to_numpy().tobytes() == values.tobytes()


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_frames_have_the_rows(log: recordings.Log, library: Any) -> None:
    frame = log.frame("sensor_combined", library, fields=["timestamp", "gyro_rad"])
    times = frame.index if library == "pandas" else frame["log_time"]
    assert times.name == "log_time"
    assert times[0].isoformat() == "2026-09-21T14:13:20.000001+00:00"
    assert np.asarray(times, "M8[ns]").astype(np.int64).tolist() == log.samples("sensor_combined").log_times.tolist()
    names = ["timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"]
    assert list(frame.columns) == (names if library == "pandas" else ["log_time", *names])
    assert frame["timestamp"].to_list() == log["sensor_combined"]["timestamp"].tolist()
    assert len(log.frame("texts", library)) == 20


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_frames_of_a_ulog_have_the_time_since_the_start_of_the_vehicle(library: Any, tmp_path: Path) -> None:
    with recordings.open(write_ulog(tmp_path / "flight.ulg")) as log:
        frame = log.frame("sensor_gps", library, instance=1)
        times = frame.index if library == "pandas" else frame["log_time"]
        assert times[0] == timedelta(seconds=1, microseconds=1)
        assert (
            np.asarray(times, "m8[ns]").astype(np.int64).tolist()
            == log.samples("sensor_gps", instance=1).log_times.tolist()
        )
