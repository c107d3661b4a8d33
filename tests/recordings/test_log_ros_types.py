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
from msggen.base.diagnostics import InputError
from msggen.cli import main
from msggen.generate.cache import package_of
from msggen.recordings.decode.schemas import read_schema, type_hash_of
from msggen.recordings.definitions import lent, ros_types
from msggen.recordings.definitions.ros_types import standard_types, types_in
from support.catalogs import write_definitions
from support.databases import Stored, write_database
from support.log_files import Written, write_log
from support.recordings import START
from support.ros_packages import DEFINITIONS, TYPE_HASHES

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


@pytest.mark.usefixtures("no_rosbags")
def test_the_standard_types_are_known(bag: Path) -> None:
    with recordings.open(bag) as log:
        check_poses(log)
        assert log.columns("/chatter")["data"].tolist() == [f"text {index}" for index in range(5)]
        assert log.notes == [f"{LACKING}; 2 taken from msggen's table of ROS 2 Humble, which has them"]
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
            f"{text} msggen's table of ROS 2 Humble, which has them",
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
        text = "1 topic has no definition in the recording; 1 taken from"
        assert log.notes == [
            f"{text} {folder}, as asked for",
            f"{text} msggen's table of ROS 2 Humble, which has them",  # the folder has no String
        ]


def test_firmwares_and_missing_folders_are_no_packages(tmp_path: Path) -> None:
    folder = write_packages(tmp_path / "packages")
    tree = write_definitions(tmp_path / "px4", {"src/modules/x": "", "msg/Rpm.msg": "uint64 timestamp\n"})
    other = write_definitions(
        tmp_path / "other", {"package.xml": MANIFEST.format("px4_msgs"), "msg/Rpm.msg": "uint64 timestamp\n"}
    )
    assert types_in(str(folder)) is not None
    assert types_in(str(folder / "std_msgs")) is not None
    for path in (tree, other, tmp_path / "missing", "v1.16"):
        assert types_in(str(path)) is None


# --- Packages of one's own

MANIFEST = "<package format='3'><name>{}</name></package>"
OWN = {"msg/Grip.msg": "std_msgs/Header header\nFinger[2] fingers\n", "msg/Finger.msg": "float32 force\nstring name\n"}


def grip() -> bytes:
    text = struct.pack("<I4s", 4, b"map\0")
    fingers = b"".join(struct.pack("<fI2s2x", force, 2, b"a\0") for force in (1.5, 2.5))
    return b"\0\1\0\0" + struct.pack("<iI", 1, 2) + text + fingers


def write_own(path: Path) -> Path:
    topics = [Stored(1, "/grip", "my_msgs/msg/Grip"), Stored(2, "/chatter", STRING)]
    return write_database(path, topics, [(1, START, grip()), (2, START, payload_of(STRING, data="x"))], version=2)


@pytest.mark.usefixtures("no_rosbags")
@pytest.mark.parametrize("manifest", [True, False])
def test_a_package_of_ones_own_needs_no_ros_and_no_manifest(tmp_path: Path, manifest: bool) -> None:  # noqa: FBT001
    """It is no firmware: its messages have no timestamp, but strings. What they nest of std_msgs is known."""
    folder = "grippers" if manifest else "my_msgs"
    more = {"package.xml": MANIFEST.format("my_msgs")} if manifest else {}
    write_definitions(tmp_path / folder, {**OWN, **more})
    with recordings.open(write_own(tmp_path / "x.db3"), tmp_path / folder) as log:
        (row,) = log["/grip"]
        assert row["header"]["stamp"]["sec"] == 1
        assert [finger["force"] for finger in row["fingers"]] == [1.5, 2.5]
        assert len(log["/chatter"]) == 1


@pytest.mark.usefixtures("no_rosbags")
def test_a_package_can_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(tmp_path / "grippers", OWN)
    bag = write_own(tmp_path / "x.db3")
    named = f"my_msgs={tmp_path / 'grippers'}"
    with recordings.open(bag, ["v1.16", named]) as log:
        assert len(log["/grip"]) == 1
    assert main(["log", "show", str(bag), "/grip", "--msg-dir", named]) == 0
    assert "1.5" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["log", "show", str(bag), "/grip", "--msg-dir", str(tmp_path / "grippers")])
    assert "/grip cannot be decoded" in capsys.readouterr().err


def test_packages_beside_px4_leave_its_types_to_the_releases(tmp_path: Path) -> None:
    write_definitions(tmp_path / "my_msgs", OWN)
    info = package_of("v1.16").VehicleStatus.__msg__
    topics = [Stored(1, "/grip", "my_msgs/msg/Grip"), Stored(7, "/fmu/out/vehicle_status", info.ros_type)]
    rows = [(1, START, grip()), (7, START, b"\0\1\0\0" + bytes(info.cdr_size))]
    with recordings.open(write_database(tmp_path / "x.db3", topics, rows, version=2), tmp_path / "my_msgs") as log:
        assert (len(log["/grip"]), len(log["vehicle_status"])) == (1, 1)
        assert [("as asked for" in note, "that fits best" in note) for note in log.notes] == [
            (True, False),
            (False, True),
        ]


def test_a_firmwares_error_in_an_unnamed_folder_is_told(tmp_path: Path) -> None:
    write_definitions(tmp_path / "my_msgs", {"msg/Grip.msg": "float32\n"})
    with pytest.raises(InputError, match="M101"):
        recordings.open(write_own(tmp_path / "x.db3"), tmp_path / "my_msgs")


def test_what_could_have_them_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An installed rosbags has standard types only, so that it cannot help."""
    bag = write_own(tmp_path / "x.db3")
    hint = "for the types of my_msgs, name the folder of their package, --msg-dir my_msgs=DIR, or source the setup of"
    with recordings.open(bag) as log:
        assert len(log["/chatter"]) == 1
        assert log.notes[-1] == f"{hint} a ROS 2 that has them"
    assert main(["log", "info", str(bag)]) == 0
    assert hint in capsys.readouterr().out


def test_the_table_has_the_types_of_humble() -> None:
    """Their type hashes are those of rosbags, which computes them of its own table."""
    (find,) = [find for name, find in standard_types() if "msggen" in name]
    names = [name for name in STORE.fielddefs if "/msg/" in name]
    known = [name for name in names if find("", name)]
    assert {name.partition("/")[0] for name in names if name not in known} == {"rmw_dds_common", "rosbag2_interfaces"}
    assert len(known) > 140
    for name in known:
        (text,) = find("", name)
        if name != "std_msgs/msg/Char":  # rosidl hashes a char as a uint8, rosbags does not
            assert type_hash_of(name, text) == STORE.hash_rihs01(name)
        constants = [(each.name, str(each.type), each.value) for each in read_schema(name, text).message.constants]
        assert constants == [(*of, value) for *of, value in STORE.fielddefs[name][0]]


def test_the_table_has_the_hashes_of_rosidl() -> None:
    (find,) = [find for name, find in standard_types() if "msggen" in name]
    for name, value in TYPE_HASHES.items():
        assert [type_hash_of(name, text) for text in find("", name)] == [value] * ("/msg/" in name)


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
            assert "Humble" in log.notes[1]


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
