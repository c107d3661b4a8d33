"""Tests of recordings without definitions of ROS's standard types: an installation, a folder, or rosbags has them."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from msggen import recordings
from msggen.cli import main
from msggen.generate.cache import package_of
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.definitions import lent, ros_types
from msggen.recordings.definitions.ros_types import standard_types, types_in
from support.catalogs import write_definitions
from support.databases import Stored, write_database
from support.log_files import Written, write_log
from support.recordings import START
from support.ros_packages import DEFINITIONS

STORE = get_typestore(Stores.ROS2_HUMBLE)
POSE = "geometry_msgs/msg/PoseStamped"
STRING = "std_msgs/msg/String"
LACKING = "2 topics have no definitions in the recording"


def payload_of(ros_type: str, **values: Any) -> bytes:
    """Return a sample of a type with some values, as rosbags encodes it."""
    return bytes(STORE.serialize_cdr(STORE.types[ros_type](**values), ros_type))


def pose(index: int) -> bytes:
    types = STORE.types
    time = types["builtin_interfaces/msg/Time"](sec=index, nanosec=5)
    header = types["std_msgs/msg/Header"](stamp=time, frame_id=f"map{index}")
    point = types["geometry_msgs/msg/Point"](x=1.0 + index, y=2.0, z=3.0)
    turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    return payload_of(POSE, header=header, pose=types["geometry_msgs/msg/Pose"](position=point, orientation=turn))


def write_bag(path: Path, *further: Stored, samples: tuple[tuple[int, bytes], ...] = ()) -> Path:
    """Write poses and texts without definitions, as ROS 2 Humble does."""
    topics = [Stored(1, "/pose", POSE), Stored(2, "/chatter", "std_msgs/msg/String"), *further]
    rows = [(1, START + index * 1000, pose(index)) for index in range(5)]
    rows += [
        (2, START + index * 1000 + 1, payload_of("std_msgs/msg/String", data=f"text {index}")) for index in range(5)
    ]
    rows += [(number, START + 10_000, payload) for number, payload in samples]
    return write_database(path, topics, rows, version=2)


def write_packages(share: Path, names: tuple[str, ...] = tuple(DEFINITIONS)) -> Path:
    for name in names:
        write_definitions(share / name, DEFINITIONS[name])
    return share


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path / "bag.db3")


@pytest.fixture
def no_rosbags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_types, "_of_rosbags", lambda _: None)


@pytest.fixture(autouse=True)
def no_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


def check_poses(log: recordings.Log) -> None:
    columns = log.columns("/pose")
    assert columns["header.frame_id"].tolist() == [f"map{index}" for index in range(5)]
    assert columns["pose.position.x"].tolist() == [1.0 + index for index in range(5)]
    assert columns["pose.orientation.w"].tolist() == [1.0] * 5


def test_rosbags_has_the_standard_types(bag: Path) -> None:
    with recordings.open(bag) as log:
        check_poses(log)
        assert log.columns("/chatter")["data"].tolist() == [f"text {index}" for index in range(5)]
        assert log.notes == [
            f"{LACKING}; 2 taken from the table 'ros2_humble' of rosbags, which has them",
        ]
        assert log.problems == []
        assert all(topic.is_lent for topic in log.topics)


def test_an_installed_ros_comes_first(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    write_packages(one / "share", ("std_msgs", "builtin_interfaces"))
    write_packages(other / "share", ("geometry_msgs",))
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(["", str(one), str(tmp_path / "missing"), str(other)]))
    with recordings.open(bag) as log:
        check_poses(log)
        text = "1 topic has no definition in the recording; 1 taken from"
        assert log.notes == [
            f"{text} the ROS of AMENT_PREFIX_PATH, which has them",  # it has no String
            f"{text} the table 'ros2_humble' of rosbags, which has them",
        ]


def test_an_installed_definition_that_does_not_fit_is_not_used(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = write_packages(tmp_path / "ros/share")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    for text in ("float64 x\n", "what is this", "Missing x\n", "Pose pose\nPoseStamped self\n"):
        (share / "geometry_msgs/msg/PoseStamped.msg").write_text(text)
        with recordings.open(bag) as log:
            check_poses(log)
            assert not any("AMENT" in note for note in log.notes)


@pytest.mark.usefixtures("no_rosbags")
@pytest.mark.parametrize("below", ["", "share"])
def test_a_folder_has_them(bag: Path, tmp_path: Path, below: str) -> None:
    folder = tmp_path / "packages"
    write_packages(folder / below)
    with recordings.open(bag, folder) as log:
        check_poses(log)
        assert log.notes[0] == (f"2 topics have no definitions in the recording; 1 taken from {folder}, as asked for")
        assert log.notes[1].startswith(
            f"/chatter has no definition: that of std_msgs/msg/String in {folder} is not there"
        )


def test_packages_and_firmwares_are_no_folders_of_packages(tmp_path: Path) -> None:
    folder = write_packages(tmp_path / "packages")
    assert types_in(str(folder)) is not None
    assert types_in(str(folder / "std_msgs")) is None
    assert types_in(str(tmp_path / "missing")) is None
    assert types_in("v1.16") is None


@pytest.mark.usefixtures("no_rosbags")
def test_what_could_have_them_is_told(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with recordings.open(bag) as log:
        assert log.notes == [
            f"{LACKING}, and no embedded release fits",
            "for the types of geometry_msgs, std_msgs, source the setup of an installed ROS 2, or pip install rosbags",
        ]
    assert main(["log", "info", str(bag)]) == 0
    assert "definitions for the types of geometry_msgs, std_msgs, source the setup" in capsys.readouterr().out


@pytest.mark.usefixtures("no_rosbags")
def test_a_topic_without_a_type_has_no_such_note(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", [Written("/unknown", "", "", [(START, START, b"\0\1\0\0")])])
    with recordings.open(path) as log:
        assert log.notes == ["1 topic has no definition in the recording, and no embedded release fits"]


def test_topics_of_px4_have_a_release_beside_them(tmp_path: Path) -> None:
    package = package_of("v1.16")
    info = package.VehicleStatus.__msg__
    topic = Stored(7, "/fmu/out/vehicle_status", info.ros_type)
    path = write_bag(tmp_path / "x.db3", topic, samples=((7, b"\0\1\0\0" + bytes(info.cdr_size)),))
    for definitions in (None, package, "v1.16"):
        with recordings.open(path, definitions) as log:
            check_poses(log)
            assert len(log["vehicle_status"]) == 1
            assert len(log.notes) == 2
            assert log.notes[0].startswith("1 topic has no definition in the recording; 1 taken from ")
            assert "rosbags" in log.notes[1]


def test_a_package_of_the_user_comes_before_the_standard_types(tmp_path: Path) -> None:
    folder = write_packages(tmp_path / "packages")
    path = write_database(
        tmp_path / "x.db3",
        [Stored(1, "/twist", "geometry_msgs/msg/Twist")],
        [(1, START, b"\0\1\0\0" + struct.pack("<6d", *range(6)))],
        version=1,
    )
    with recordings.open(path, folder) as log:
        assert log.columns("/twist")["angular.z"].tolist() == [5.0]
        assert "as asked for" in log.notes[0]


@pytest.mark.parametrize("name", ["../../secret/msg/X", "std_msgs/msg/../../X", "/etc/msg/X", "a\0/msg/X", "std_msgs"])
def test_types_do_not_lead_out_of_the_folders(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = tmp_path / "secret" / "msg"
    secret.mkdir(parents=True)
    (secret / "X.msg").write_text("uint8 x\n")
    write_packages(tmp_path / "ros/share")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    assert [find("", name) for _, find in standard_types()] == [[]] * len([*standard_types()])


@pytest.mark.parametrize("release", ros_types._RELEASES)
def test_every_type_of_rosbags_can_be_read(release: str) -> None:
    find = ros_types._of_rosbags(release)
    assert find is not None
    names = [name for name in get_typestore(Stores(release)).fielddefs if "/msg/" in name]
    assert len(names) > 100
    for name in names:
        (text,) = find("", name)
        assert read_schema(name, text).message.name == name.rpartition("/")[2]


def test_values_are_those_of_rosbags(tmp_path: Path) -> None:
    types = STORE.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "imu")
    vector = types["geometry_msgs/msg/Vector3"](1.0, -2.0, 0.5)
    covariance = np.arange(9, dtype=np.float64)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    imu = types["sensor_msgs/msg/Imu"](header, turn, covariance, vector, covariance, vector, covariance)
    payload = bytes(STORE.serialize_cdr(imu, "sensor_msgs/msg/Imu"))
    topic = Stored(9, "/imu", "sensor_msgs/msg/Imu")
    with recordings.open(write_bag(tmp_path / "x.db3", topic, samples=((9, payload),))) as log:
        (row,) = log["/imu"]
        assert row["header"]["frame_id"] == "imu"
        assert row["angular_velocity"]["y"] == -2.0
        assert row["linear_acceleration_covariance"].tolist() == covariance.tolist()


def test_type_hashes_decide(tmp_path: Path) -> None:
    for hash_, is_found in (("RIHS01_" + "1" * 64, False), ("", True)):
        path = write_database(
            tmp_path / f"{is_found}.db3",
            [Stored(1, "/chatter", "std_msgs/msg/String", type_hash=hash_)],
            [(1, START, payload_of("std_msgs/msg/String", data="x"))],
            version=4,
        )
        with recordings.open(path) as log:
            assert bool(log.topics[0].definition) == is_found


def test_recordings_with_definitions_do_not_look_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        pytest.fail("looked for types")

    monkeypatch.setattr(lent, "standard_types", refuse)
    topic = Stored(1, "/wind", "px4_msgs/msg/Wind", "float32 speed\n")
    with recordings.open(write_database(tmp_path / "x.db3", [topic], [(1, START, b"\0\1\0\0\0\0\x80?")])) as log:
        assert log["wind"]["speed"].tolist() == [1]
