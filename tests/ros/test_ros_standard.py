"""Tests of standard messages of ROS, made from messages of PX4. scipy's rotations are the reference."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from msggen.generate.cache import package_of
from msggen.ros import standard
from msggen.ros.standard import SOURCES, TYPES, Clock, Converter, Frames, filled
from msggen.vehicle.refusals import Refusals
from support.repository import ROOT
from support.ros_types import class_with

SAMPLED = 1_790_000_000_246_000
ARRIVAL = 1_795_000_000_123_456_789
NAN3 = (math.nan,) * 3
NED_TO_ENU = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_euler("x", 180, degrees=True)
FRD_TO_FLU = Rotation.from_euler("x", 180, degrees=True)
"""The steps of docs/frames.md."""


def clock() -> Clock:
    return Clock(ARRIVAL, 1_234_567_890_000_000)


def random_odometry(package: Any, seed: int, **values: Any) -> Any:
    random = np.random.default_rng(seed)
    cls = package.VehicleOdometry
    vectors = ("position", "velocity", "angular_velocity", "position_variance", "orientation_variance")
    given: dict[str, Any] = {
        name: tuple(random.uniform(0.1, 3, 3).tolist()) for name in (*vectors, "velocity_variance")
    }
    given["q"] = tuple(Rotation.random(random_state=seed).as_quat()[[3, 0, 1, 2]].tolist())
    given |= {"timestamp": SAMPLED + 7, "timestamp_sample": SAMPLED}
    given |= {"pose_frame": cls.POSE_FRAME_NED, "velocity_frame": cls.VELOCITY_FRAME_NED}
    return cls(**{**given, **values})


def rotation(message: Any) -> Rotation:
    return Rotation.from_quat([*message.q[1:], message.q[0]])


def vector(values: Any) -> list[float]:
    return [values["x"], values["y"], values["z"]]


def same_rotation(values: Any, expected: Rotation) -> bool:
    found = Rotation.from_quat([*vector(values), values["w"]])
    return bool((found.inv() * expected).magnitude() < 1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_odometry_pose_and_transform(px4_types: Any, seed: int) -> None:
    message = random_odometry(px4_types, seed)
    to_enu = NED_TO_ENU * rotation(message) * FRD_TO_FLU.inv()
    odometry = standard.odometry(message, clock(), Frames())
    pose = standard.pose(message, clock(), Frames())
    transform = standard.transform(message, clock(), Frames())
    assert odometry is not None
    assert pose is not None
    assert transform is not None
    for place in (odometry["pose"]["pose"], pose["pose"]):
        assert vector(place["position"]) == pytest.approx(NED_TO_ENU.apply(message.position))
        assert same_rotation(place["orientation"], to_enu)
    assert transform["transform"]["translation"] == pose["pose"]["position"]
    assert transform["transform"]["rotation"] == pose["pose"]["orientation"]
    twist = odometry["twist"]["twist"]
    assert vector(twist["linear"]) == pytest.approx(to_enu.inv().apply(NED_TO_ENU.apply(message.velocity)))
    assert vector(twist["angular"]) == pytest.approx(FRD_TO_FLU.apply(message.angular_velocity))
    frames = [(each["header"]["frame_id"], each.get("child_frame_id")) for each in (odometry, pose, transform)]
    assert frames == [("odom", "base_link"), ("map", None), ("odom", "base_link")]
    assert odometry["header"]["stamp"] == {"sec": 1_790_000_000, "nanosec": 246_000_000}
    covariance = np.reshape(odometry["pose"]["covariance"], (6, 6))
    matrix = to_enu.as_matrix()
    assert covariance[:3, :3] == pytest.approx(np.diag(np.abs(NED_TO_ENU.apply(message.position_variance))))
    assert covariance[3:, 3:] == pytest.approx(matrix @ np.diag(message.orientation_variance) @ matrix.T)


@pytest.mark.parametrize("release", ["v1.14", "v1.18"])
def test_level_and_north_in_the_first_and_the_last_release(release: str, px4_types: Any) -> None:
    """Level, 10 m north, 2 m east, 5 m up, and heading north: y of ENU, turned by 90 degrees from x."""
    package: Any = px4_types if release == "v1.18" else package_of(release)
    message = package.VehicleOdometry(
        timestamp=SAMPLED, pose_frame=1, velocity_frame=1, position=(10.0, 2.0, -5.0), q=(1.0, 0.0, 0.0, 0.0)
    )
    pose = standard.pose(message, clock(), Frames())
    assert pose is not None
    assert vector(pose["pose"]["position"]) == [2.0, 10.0, 5.0]
    assert pose["pose"]["orientation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": 0.5**0.5, "w": 0.5**0.5})
    assert pose["header"]["stamp"]["sec"] == 1_790_000_000, "there is no timestamp_sample"
    gps: dict[str, Any] = {"lat": 473_977_420, "lon": 85_455_940, "alt_ellipsoid": 535_000}
    if release != "v1.14":
        gps = {"latitude_deg": 47.397742, "longitude_deg": 8.545594, "altitude_ellipsoid_m": 535.0}
    fix = standard.fix(package.SensorGps(fix_type=3, eph=2.0, epv=3.0, **gps), clock(), Frames())
    assert fix is not None
    assert (fix["latitude"], fix["longitude"], fix["altitude"]) == pytest.approx((47.397742, 8.545594, 535.0))
    assert fix["position_covariance"] == (4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0)


def test_imu_has_gravity_up_and_the_newest_orientation(px4_types: Any) -> None:
    sensors = px4_types.SensorCombined(timestamp=SAMPLED, gyro_rad=(0.1, 0.2, 0.3), accelerometer_m_s2=(1.0, 2.0, -9.8))
    attitude = px4_types.VehicleAttitude(
        timestamp=SAMPLED, q=tuple(Rotation.random(random_state=1).as_quat()[[3, 0, 1, 2]])
    )
    without = standard.imu(sensors, None, clock(), Frames())
    found = standard.imu(sensors, standard.orientation_of(attitude), clock(), Frames())
    assert without is not None
    assert found is not None
    assert vector(found["angular_velocity"]) == pytest.approx([0.1, -0.2, -0.3])
    assert vector(found["linear_acceleration"]) == pytest.approx([1.0, -2.0, 9.8])
    assert same_rotation(found["orientation"], NED_TO_ENU * rotation(attitude) * FRD_TO_FLU.inv())
    assert without["orientation_covariance"][0] == -1.0
    assert found["orientation_covariance"] == (0.0,) * 9
    assert found["header"]["frame_id"] == "base_link"


def test_what_is_not_known_is_not_published(px4_types: Any) -> None:
    frames = Frames()
    for values in ({"position": NAN3}, {"q": (math.nan,) * 4}):
        message = random_odometry(px4_types, 1, **values)
        assert standard.odometry(message, clock(), frames) is None
        assert standard.pose(message, clock(), frames) is None
        assert standard.transform(message, clock(), frames) is None
    still = random_odometry(px4_types, 1, velocity=NAN3)
    assert standard.odometry(still, clock(), frames) is None
    assert standard.pose(still, clock(), frames) is not None
    unsure = standard.odometry(random_odometry(px4_types, 1, orientation_variance=NAN3), clock(), frames)
    assert unsure is not None
    assert all(map(math.isfinite, unsure["pose"]["covariance"]))
    assert standard.imu(px4_types.SensorCombined(gyro_rad=NAN3), None, clock(), frames) is None
    assert standard.fix(px4_types.SensorGps(latitude_deg=math.nan), clock(), frames) is None
    unsure = standard.fix(px4_types.SensorGps(eph=math.nan), clock(), frames)
    assert unsure is not None
    assert (unsure["position_covariance_type"], unsure["status"]["status"]) == (0, -1)


@pytest.mark.parametrize(("fix_type", "status"), [(0, -1), (1, -1), (2, 0), (3, 0), (4, 2), (5, 2), (6, 2), (8, 0)])
def test_status_of_a_fix(px4_types: Any, fix_type: int, status: int) -> None:
    fix = standard.fix(px4_types.SensorGps(fix_type=fix_type), clock(), Frames())
    assert fix is not None
    assert fix["status"]["status"] == status


def test_times_since_boot_become_the_time_of_arrival() -> None:
    assert clock().stamp(5_000_000) == {"sec": 1_795_000_000, "nanosec": 123_456_789}
    assert clock().stamp(SAMPLED) == {"sec": 1_790_000_000, "nanosec": 246_000_000}


def test_a_converter_gives_each_topic_its_messages(px4_types: Any) -> None:
    refusals = Refusals()
    converter = Converter(px4_types, Frames().inside("uav_1"), refusals)
    made = {
        "vehicle_odometry": random_odometry(px4_types, 1),
        "vehicle_attitude": px4_types.VehicleAttitude(q=(1.0, 0.0, 0.0, 0.0)),
        "sensor_combined": px4_types.SensorCombined(),
        "vehicle_gps_position": px4_types.SensorGps(),
    }
    assert made.keys() == SOURCES.keys()
    outputs = {name: converter.convert(name, message, ARRIVAL) for name, message in made.items()}
    topics = {name: tuple(output.topic for output in found) for name, found in outputs.items()}
    assert topics == {**SOURCES, "vehicle_attitude": ()}
    assert {topic for found in topics.values() for topic in found} | {"/tf_static"} == TYPES.keys()
    (transform,) = outputs["vehicle_odometry"][2].values["transforms"]
    assert (transform["header"]["frame_id"], transform["child_frame_id"]) == ("uav_1/odom", "uav_1/base_link")
    (still,) = converter.static(ARRIVAL).values["transforms"]
    assert (still["header"]["frame_id"], still["child_frame_id"]) == ("uav_1/map", "uav_1/odom")
    assert not refusals.counts


def test_the_page_lists_all_topics() -> None:
    page = (ROOT / "docs" / "ros2.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `([\w/]+)` \| (\w+_msgs/\w+) \|", page, re.MULTILINE))
    assert rows == {topic: ros_type.replace("/msg/", "/") for topic, ros_type in TYPES.items()}


def test_an_unknown_frame_is_counted(px4_types: Any) -> None:
    refusals = Refusals()
    converter = Converter(px4_types, Frames(), refusals)
    found = converter.convert("vehicle_odometry", random_odometry(px4_types, 1, velocity_frame=0), ARRIVAL)
    assert [output.topic for output in found] == ["pose", "/tf"]
    assert refusals.counts == {"odom": 1}
    assert refusals.reasons == {"odom": "VehicleOdometry.velocity: velocity_frame is VELOCITY_FRAME_UNKNOWN"}


def test_an_attitude_that_is_no_rotation_leaves_the_imu_without_orientation(px4_types: Any) -> None:
    refusals = Refusals()
    converter = Converter(px4_types, Frames(), refusals)
    sensors = px4_types.SensorCombined(timestamp=SAMPLED)
    first = []
    for q in ((1.0, 0.0, 0.0, 0.0), (0.0,) * 4, (math.nan,) * 4):
        assert converter.convert("vehicle_attitude", px4_types.VehicleAttitude(q=q), ARRIVAL) == []
        (output,) = converter.convert("sensor_combined", sensors, ARRIVAL)
        first.append(output.values["orientation_covariance"][0])
    assert first == [0.0, -1.0, -1.0]
    assert refusals.counts == {"vehicle_attitude": 1}


def test_messages_of_any_classes_are_filled() -> None:
    class Inner:
        def __init__(self) -> None:
            self.x = 0.0

    class Outer(class_with({"items": "sequence<a_msgs/Inner>", "one": "a_msgs/Inner", "name": "string"})):  # type: ignore[misc]
        def __init__(self) -> None:
            self.items: list[Inner] = []
            self.one, self.name = Inner(), ""

    values = {"one": {"x": 1.0}, "items": [{"x": 2.0}, {"x": 3.0}], "name": "n"}
    found = filled(Outer, values, {"a_msgs/msg/Inner": Inner}.get)
    assert (found.one.x, [item.x for item in found.items], found.name) == (1.0, [2.0, 3.0], "n")
