"""Tests of where the topics of a recording are in a fleet."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen import read, recordings
from msggen.exports.convert import convert
from msggen.exports.convert.names import Place, place_of
from msggen.exports.fleet import update
from msggen.exports.fleet.layout import cleaned, day_in
from msggen.recordings.source.source import Channel
from msggen.recordings.topics.topic import Topic
from msggen.sources.embedded import EMBEDDED
from support.fleet_recordings import parquet_in, rows_of
from support.log_files import Written, write_log
from support.recordings import START
from support.ulog import write_ulog


def topic(name: str, instance: int = 0, ros_type: str = "px4_msgs/msg/A") -> Topic:
    channel = Channel(0, name, ros_type, "", instance=instance)
    return Topic(name, instance, ros_type, "", "", ((0, channel),), lambda: np.zeros(0, np.int64))


def test_a_number_can_belong_to_the_name_of_the_message() -> None:
    assert place_of(topic("/fmu/out/powers_of_2", ros_type="my_msgs/msg/PowersOf2")) == ("powers_of_2", "", 0)
    assert place_of(topic("/fmu/out/powers_of_2", ros_type="my_msgs/msg/PowersOf")) == ("powers_of", "", 2)


@pytest.mark.parametrize(
    ("name", "instance", "place"),
    [
        ("vehicle_command", 0, ("vehicle_command", "", 0)),  # of a ULog
        ("/fmu/out/vehicle_command", 0, ("vehicle_command", "", 0)),
        ("/fmu/out/vehicle_command_v3", 0, ("vehicle_command", "", 0)),
        ("/fmu/in/vehicle_command", 0, ("fmu_in_vehicle_command", "", 0)),
        ("/uav_1/fmu/out/vehicle_command", 0, ("vehicle_command", "uav_1", 0)),
        ("/swarm/uav_1/fmu/in/vehicle_command_v1", 0, ("fmu_in_vehicle_command", "swarm.uav_1", 0)),
        ("sensor_gyro", 1, ("sensor_gyro", "", 1)),
        ("/fmu/out/sensor_gyro_1", 0, ("sensor_gyro", "", 1)),
        ("/fmu/out/sensor_gyro_2_v1", 0, ("sensor_gyro", "", 2)),
        ("actuator_controls_status_1", 0, ("actuator_controls_status_1", "", 0)),
        ("/fmu/out/actuator_controls_status_1", 0, ("actuator_controls_status_1", "", 0)),
        ("/fmu/out/sensor_gyro_10", 0, ("sensor_gyro_10", "", 0)),
        ("/camera/left/info", 0, ("camera.left.info", "", 0)),
        ("/camera_1", 0, ("camera_1", "", 0)),
        ("/tf", 0, ("tf", "", 0)),
        ("/Camera/left", 0, ("Camera.left-83c72a38", "", 0)),
    ],
)
def test_the_place_of_a_topic(name: str, instance: int, place: Place) -> None:
    assert place_of(topic(name, instance)) == place


def test_no_topic_of_px4_ends_in_the_number_of_an_instance() -> None:
    """So `/fmu/out/sensor_gyro_1` is an instance."""
    catalogs = [read(release) for release in EMBEDDED]
    names = {name for catalog in catalogs for message in catalog.uorb_messages for name in message.topic_names}
    assert len(names) > 200
    for name in names:
        assert place_of(topic(f"/fmu/out/{name}")) == place_of(topic(name)) == (name, "", 0)


ROS_NAMES = st.text("abAB_1/.-", min_size=1, max_size=12)


@given(st.sets(ROS_NAMES.map(lambda name: f"/{name.strip('/')}"), min_size=2, max_size=6))
def test_topics_of_other_programs_have_folders_of_their_own(names: set[str]) -> None:
    folders = {place_of(topic(name)).name.casefold() for name in names}
    assert len(folders) == len(names)


def test_a_folder_does_not_depend_on_the_other_topics(tmp_path: Path) -> None:
    first, second = "uint64 timestamp\n", "uint64 timestamp\nfloat32 x\n"
    names = [f"{front}/fmu/{way}/a" for front in ("", "/uav_1", "/uav_2") for way in ("in", "out")]
    for number, chosen in enumerate((names[:1], names, names[3:4])):
        stamps = [(START, START, b"\0\1\0\0" + struct.pack("<Q", number + 1))]
        written = [Written(name, "px4_msgs/msg/A", first, stamps) for name in chosen]
        later = [(START + 1, START + 1, b"\0\1\0\0" + struct.pack("<Qf", 9, 0.5))]
        (tmp_path / "logs").mkdir(exist_ok=True)
        changed = Written(names[1], "px4_msgs/msg/A", second, later)
        write_log(tmp_path / "logs" / f"{number}.mcap", [*written, *[changed] * (number == 1)])
    fleet = tmp_path / "fleet"
    update(str(tmp_path / "logs"), str(fleet), by=["date"])
    found: Counter[tuple[str, str]] = Counter()
    for topic, rows in rows_of(fleet).items():
        for row in rows:
            assert row["instance"] == 0
            assert row["x"] == (0.5 if row["timestamp"] == 9 else None) if topic == "a" else "x" not in row
            found[topic, row["namespace"]] += 1
    every = {(folder, space): 1 for folder in ("a", "fmu_in_a") for space in ("none", "uav_1", "uav_2")}
    assert found == {**every, ("fmu_in_a", "none"): 2, ("a", "none"): 2, ("a", "uav_1"): 2}
    assert len(parquet_in(fleet)) == 2


@pytest.mark.parametrize(
    ("name", "day"),
    [
        ("log_12_2026-11-22-10-00-01.ulg", "2026-11-22"),
        ("px4_2026-11-22_19-11-58.mcap", "2026-11-22"),
        ("20261122_1530.mcap", "2026-11-22"),
        ("2026_11_22", "2026-11-22"),
        ("2026-13-22 2026-01-02", "2026-01-02"),
        ("2026-1122", ""),
        ("120261122", ""),
        ("11_22_33.ulg", ""),
    ],
)
def test_days_in_names(name: str, day: str) -> None:
    assert day_in(name) == day


@pytest.mark.parametrize(("text", "value"), [("a b/c=d", "a_b_c_d"), ("..", "unknown"), ("", "unknown"), ("ü1", "1")])
def test_values_of_keys_are_plain(text: str, value: str) -> None:
    assert cleaned(text) == value


def test_a_ulog_and_the_mcap_file_made_of_it_are_in_the_same_folders(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    ulog = write_ulog(tmp_path / "logs" / "one.ulg")
    with recordings.open(ulog) as log:
        assert convert(log, str(tmp_path / "logs" / "two.mcap"), format="mcap").rows
    fleet = tmp_path / "fleet"
    update(str(tmp_path / "logs"), str(fleet), by=["date"])
    found: dict[str, set[tuple[str, int]]] = {"one": set(), "two": set()}
    for topic, rows in rows_of(fleet).items():
        for row in rows:
            assert row["namespace"] == "none"
            found[row["log"][:3]].add((topic, row["instance"]))
    assert ("sensor_gps", 1) in found["one"]
    assert found["one"] - found["two"] == {("odd", 0)}  # its fields have names that ROS 2 does not allow
    assert found["two"] - found["one"] <= {("px4.log", 0), ("rosout", 0)}
