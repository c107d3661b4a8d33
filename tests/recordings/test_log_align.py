"""Tests of samples side by side, against a search through all samples."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen import recordings
from msggen.recordings import Log, RecordingError
from msggen.recordings.columns.arrays import columns_of
from msggen.recordings.log.align import Direction, partners
from support.log_files import Written, write_log
from support.ulog import write_ulog

START = 1_790_000_000_000_000_000
TIMES = st.lists(st.one_of(st.integers(0, 30), st.integers(0, (1 << 62))), max_size=20)


def partner(time: int, others: list[int], tolerance: int, direction: Direction) -> int:
    """Return the index of the partner of a time: the obvious way."""
    near = [
        (abs(other - time), other, -index)
        for index, other in enumerate(others)
        if abs(other - time) <= tolerance and (direction == "nearest" or other <= time)
    ]
    return -min(near)[2] if near else -1


@settings(deadline=None)
@given(TIMES, TIMES, st.integers(0, 40), st.sampled_from(["latest", "nearest"]))
def test_partners_are_those_of_a_search(times: list[int], others: list[int], tolerance: int, way: Direction) -> None:
    found = partners(np.array(times, np.int64), np.array(others, np.int64), tolerance, way)
    assert found.tolist() == [partner(time, others, tolerance, way) for time in times]


def opened(folder: Path, topics: dict[str, list[Any]]) -> Log:
    """Return a recording of messages whose log times are 10 ms apart; their publish times run backwards."""
    written = [
        Written(
            f"/fmu/out/{topic}",
            messages[0].__msg__.ros_type,
            messages[0].__msg__.definition,
            [
                (START + number * 10_000_000, START - number * 10_000_000, message.encode())
                for number, message in enumerate(messages)
            ],
        )
        for topic, messages in topics.items()
    ]
    return recordings.open(write_log(folder / "flight.mcap", written))


@pytest.fixture
def log(px4_types: Any, tmp_path: Path) -> Log:
    """Attitudes every 10 ms, positions every 30 ms, and a list of ESCs, by the time of the vehicle."""
    attitudes = [px4_types.VehicleAttitude(timestamp=1000 + 10_000 * n, q=(1.0, n, 0.0, 0.5)) for n in range(12)]
    positions = [px4_types.VehicleLocalPosition(timestamp=2000 + 30_000 * n, z=float(n)) for n in range(4)]
    escs = [
        px4_types.EscStatus(timestamp=3000 + 50_000 * n, esc=(px4_types.EscReport(esc_rpm=n),) * 12, counter=n)
        for n in range(3)
    ]
    topics = {"vehicle_attitude": attitudes, "vehicle_local_position": positions, "esc_status": escs}
    return opened(tmp_path, topics)


def test_rows_have_the_values_of_all_topics(log: Log) -> None:
    found = log.align("vehicle_attitude", "vehicle_local_position", tolerance=0.02)
    columns = found.columns()
    times = [number for number in range(12) if number and (10 * number - 1) % 30 <= 20]
    assert columns["time"].tolist() == [1_000_000 + 10_000_000 * number for number in times]
    assert columns["vehicle_attitude.q[1]"].tolist() == times
    assert columns["vehicle_local_position.z"].tolist() == [(10 * number - 1) // 30 for number in times]
    assert list(columns)[:3] == ["time", "vehicle_attitude.timestamp", "vehicle_attitude.timestamp_sample"]
    assert (len(found), found.dropped, found.unmatched) == (8, 4, {"vehicle_local_position": 4})
    assert str(found) == "8 rows, 4 dropped, no partner for 4 in vehicle_local_position"


def test_the_nearest_sample_can_be_later(log: Log) -> None:
    found = log.align("vehicle_attitude", "vehicle_local_position", tolerance=0.02, direction="nearest").columns()
    assert found["vehicle_local_position.z"].tolist() == [min((10 * number + 14) // 30, 3) for number in range(12)]


def test_forms_have_the_same_values(log: Log) -> None:
    found = log.align("vehicle_attitude", "esc_status", "vehicle_local_position", tolerance=1)
    columns, array = found.columns(), found.array
    assert array.dtype.names == ("time", "vehicle_attitude", "esc_status", "vehicle_local_position")
    assert columns.keys() == columns_of(array).keys()
    for name, values in columns_of(array).items():
        np.testing.assert_array_equal(values, columns[name])
    assert columns["esc_status.esc[11].esc_rpm"].tolist() == columns["esc_status.counter"].tolist()
    for frame in (found.frame(), found.frame("polars")):
        assert list(frame["esc_status.counter"]) == columns["esc_status.counter"].tolist()
    assert found.table()["time"].to_pylist() == columns["time"].tolist()
    with pytest.raises(ValueError, match="expected 'pandas' or 'polars', got 'dask'"):
        found.frame("dask")  # type: ignore[call-overload]


def test_fields_are_chosen(log: Log) -> None:
    found = log.align("vehicle_attitude", "vehicle_local_position", "esc_status", tolerance=1)
    chosen = found.choose(["vehicle_attitude.q", "vehicle_local_position.z"])
    assert list(chosen.columns()) == [
        "time",
        *(f"vehicle_attitude.q[{n}]" for n in range(4)),
        "vehicle_local_position.z",
    ]
    assert list(found.choose(["esc_status.counter", "esc_status"]).columns())[1:] == [
        name for name in found.columns() if name.startswith("esc_status.")
    ]
    with pytest.raises(RecordingError, match="no topic is called 'vehicle_attitud"):
        found.choose(["vehicle_attitud.q"])
    with pytest.raises(RecordingError, match=re.escape("no field is called 'w'")):
        found.choose(["vehicle_attitude.w"])


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("sensor_gps", "sensor_gps"),
        ("SensorGps", "sensor_gps"),
        ("px4_msgs/msg/SensorGps", "sensor_gps"),
        ("/fmu/out/sensor_gps", "sensor_gps"),
        ("sensor_gps[1]", "sensor_gps_1"),
        ("sensor_gps_1", "sensor_gps_1"),
        ("sensor_gps 1", "sensor_gps_1"),
        ("SensorGps[1]", "sensor_gps_1"),
    ],
)
def test_fields_are_chosen_by_the_names_by_which_topics_are_aligned(name: str, column: str, tmp_path: Path) -> None:
    with recordings.open(write_ulog(tmp_path / "a.ulg")) as log:
        other = "sensor_gps" if column == "sensor_gps_1" else "sensor_gps[1]"
        found = log.align(name, other, tolerance=1)
        assert list(found.choose([f"{name}.fix_type"]).columns()) == ["time", f"{column}.fix_type"]
        assert found.choose([name]).samples.keys() == {column}
        with pytest.raises(RecordingError, match="'sensor_gps' has no instance 2"):
            found.choose(["sensor_gps[2].fix_type"])


@pytest.mark.parametrize("clock", ["log_time", "publish_time"])
def test_other_times(log: Log, clock: str) -> None:
    found = log.align("vehicle_attitude", "vehicle_local_position", tolerance=0, by=clock)
    assert len(found) == 4
    times = found.samples["vehicle_attitude"].log_times - START
    assert sorted(times.tolist()) == [0, 10_000_000, 20_000_000, 30_000_000]
    np.testing.assert_array_equal(times, found.samples["vehicle_local_position"].log_times - START)
    assert found.times.tolist() == sorted(found.times.tolist())


def test_partners_before_the_start_count(log: Log) -> None:
    whole = log.align("vehicle_attitude", "vehicle_local_position", tolerance=0.02, by="log_time")
    part = log.align("vehicle_attitude", "vehicle_local_position", tolerance=0.02, by="log_time", start=0.04, stop=0.06)
    assert part.samples["vehicle_attitude"].array["q"][:, 1].tolist() == [4, 5]
    assert part.samples["vehicle_local_position"].array["z"].tolist() == [3, 3]
    assert len(whole) == 6


def test_topics_without_their_own_time_are_aligned_by_log_time(px4_types: Any, tmp_path: Path) -> None:
    wind = px4_types.Wind
    rows = [(START + n * 10_000_000, START, wind(timestamp=7).encode()) for n in range(3)]
    other = [(START + n * 10_000_000, START, b"\0\1\0\0" + bytes([n] * 8)) for n in range(3)]
    topics = [
        Written("/fmu/out/wind", wind.__msg__.ros_type, wind.__msg__.definition, rows),
        Written("/mine", "my_msgs/msg/Mine", "uint64 number\n", other),
    ]
    with recordings.open(write_log(tmp_path / "flight.mcap", topics)) as log:
        found = log.align("wind", "/mine", tolerance=0)
        assert [value & 255 for value in found.columns()["mine.number"].tolist()] == [0, 1, 2]
        with pytest.raises(RecordingError, match="'/mine' has no time 'timestamp'"):
            log.align("wind", "/mine", tolerance=0, by="timestamp")
        assert len(log.align("wind", "/mine", tolerance=float("inf"), start=0.01)) == 2


def test_topics_whose_times_are_of_two_clocks_are_aligned_by_log_time(px4_types: Any, tmp_path: Path) -> None:
    """A vehicle on Zenoh sends times since its boot, and programs UTC."""
    boot = [px4_types.VehicleStatus(timestamp=12_000_000 + number) for number in range(3)]
    utc = [px4_types.Wind(timestamp=START // 1000 + number) for number in range(3)]
    log = opened(tmp_path, {"vehicle_status": boot, "wind": utc})
    assert len(log.align("wind", "vehicle_status", tolerance=0.001)) == 3
    assert len(log.align("wind", "vehicle_status", tolerance=0.001, by="timestamp")) == 0


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tolerance": -1}, "tolerance: expected a time in s of 0 or more, got -1"),
        ({"tolerance": float("nan")}, "tolerance: expected a time in s of 0 or more, got nan"),
        ({"tolerance": 1, "direction": "next"}, "expected the direction 'latest' or 'nearest', got 'next'"),
        ({"tolerance": 1, "by": "timestam"}, "has no time 'timestam', did you mean 'timestamp'?"),
        ({"tolerance": 1, "by": "q"}, "has no time 'q'"),
    ],
)
def test_wrong_options_are_refused(log: Log, options: dict[str, Any], text: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(text)):
        log.align("vehicle_attitude", "vehicle_local_position", **options)


def test_a_topic_is_named_once(log: Log) -> None:
    with pytest.raises(RecordingError, match="'/fmu/out/vehicle_attitude' is named 2 times"):
        log.align("vehicle_attitude", "VehicleAttitude", tolerance=1)


def test_topics_of_two_vehicles(px4_types: Any, tmp_path: Path) -> None:
    wind = px4_types.Wind
    rows = [(START, START, wind(timestamp=7).encode())]
    topics = [
        Written(f"/uav_{number}/fmu/out/wind", wind.__msg__.ros_type, wind.__msg__.definition, rows)
        for number in (1, 2)
    ]
    with recordings.open(write_log(tmp_path / "flight.mcap", topics)) as log:
        found = log.align("uav_1/fmu/out/wind", "/uav_2/fmu/out/wind", tolerance=0)
        assert list(found.samples) == ["/uav_1/fmu/out/wind", "/uav_2/fmu/out/wind"]
        assert list(found.choose(["/uav_2/fmu/out/wind.tas_innov"]).columns()) == [
            "time",
            "/uav_2/fmu/out/wind.tas_innov",
        ]
