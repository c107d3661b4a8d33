"""Tests of the module `ros`, which a package has if it was generated with geometry_msgs."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from msggen.definitions.model import Catalog
from msggen.generate.python.package import list_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions
from support.checkers import mypy
from support.repository import ROOT
from support.ros_packages import DEFINITIONS

WITH_COVARIANCE = {
    "msg/PoseWithCovariance.msg": "Pose pose\nfloat64[36] covariance\n",
    "msg/TwistWithCovariance.msg": "Twist twist\nfloat64[36] covariance\n",
}
ODOMETRY = (
    "std_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
)
ROS = {
    "builtin_interfaces": DEFINITIONS["builtin_interfaces"],
    "std_msgs": DEFINITIONS["std_msgs"],
    "geometry_msgs": {**DEFINITIONS["geometry_msgs"], **WITH_COVARIANCE},
    "nav_msgs": {"msg/Odometry.msg": ODOMETRY},
}
PX4 = ("msg/versioned/VehicleOdometry.msg", "msg/versioned/TrajectorySetpoint.msg", "msg/versioned/VehicleAttitude.msg")
SAMPLED = 1_790_000_000_246_000


def catalog_with(folder: Path, *names: str) -> Catalog:
    """Return some messages of PX4 with these packages of ROS."""
    files = {path.replace("versioned/", ""): (ROOT / path).read_text() for path in PX4}
    write_definitions(folder / "px4", files)
    options = [f"{name}={write_definitions(folder / name, ROS[name])}" for name in names]
    return read_catalog(find_sources(str(folder / "px4"), tuple(options)))


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("ros")
    return import_package(catalog_with(folder, *ROS), folder)


def odometry(package: Any, random: np.random.Generator, **values: Any) -> Any:
    cls = package.VehicleOdometry
    attitude = Rotation.random(random_state=random).as_quat()[[3, 0, 1, 2]]
    names = (
        "position",
        "velocity",
        "angular_velocity",
        "position_variance",
        "orientation_variance",
        "velocity_variance",
    )
    given: dict[str, Any] = {name: tuple(random.uniform(0.1, 3, 3).tolist()) for name in names}
    given |= {"pose_frame": cls.POSE_FRAME_NED, "velocity_frame": cls.VELOCITY_FRAME_NED, "timestamp_sample": SAMPLED}
    return cls(q=tuple(attitude.tolist()), **{**given, **values})


def components(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def test_values_and_messages_of_ros(package: Any) -> None:
    ros, msg = package.ros, package.geometry_msgs.msg
    assert ros.vector3((1.0, 2.0, 3.0)) == msg.Vector3(1.0, 2.0, 3.0)
    assert ros.point((1.0, 2.0, 3.0)) == msg.Point(1.0, 2.0, 3.0)
    assert ros.quaternion((0.1, 0.2, 0.3, 0.4)) == msg.Quaternion(x=0.2, y=0.3, z=0.4, w=0.1)
    assert ros.xyz(ros.vector3((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
    assert ros.wxyz(ros.quaternion((0.1, 0.2, 0.3, 0.4))) == (0.1, 0.2, 0.3, 0.4)
    assert ros.wxyz(SimpleNamespace(x=1.0, y=2.0, z=3.0, w=4.0)) == (4.0, 1.0, 2.0, 3.0)
    assert ros.time(SAMPLED) == package.builtin_interfaces.msg.Time(1_790_000_000, 246_000_000)
    assert package.clock.from_ros(ros.time(SAMPLED)) == SAMPLED


def test_a_setpoint_from_a_message_of_ros(package: Any) -> None:
    point = package.geometry_msgs.msg.Point(2.0, 10.0, 5.0)
    setpoint = package.frames.from_ros(package.TrajectorySetpoint, position=package.ros.xyz(point))
    assert setpoint.position == (10.0, 2.0, -5.0)


@pytest.mark.parametrize("in_body", [False, True])
def test_odometry_is_in_the_frames_that_ros_requires(package: Any, *, in_body: bool) -> None:
    """The velocity of nav_msgs/Odometry has the axes of the body, and the covariance of the pose the local ones."""
    random = np.random.default_rng(14)
    for _ in range(50):
        message = odometry(package, random, velocity_frame=3 if in_body else 1)
        result = package.ros.odometry(message, "map", "drone")
        attitude = Rotation.from_quat([*components(result.pose.pose.orientation), result.pose.pose.orientation.w])
        found = package.frames.to_ros(message)
        matrix = attitude.as_matrix()
        to_body = np.eye(3) if in_body else matrix.T
        assert components(result.pose.pose.position) == list(found["position"].value)
        assert components(result.twist.twist.angular) == list(found["angular_velocity"].value)
        assert components(result.twist.twist.linear) == pytest.approx(to_body @ found["velocity"].value)
        pose, twist = (np.reshape(each.covariance, (6, 6)) for each in (result.pose, result.twist))
        assert pose[:3, :3] == pytest.approx(np.diag(found["position_variance"].value))
        assert pose[3:, 3:] == pytest.approx(matrix @ np.diag(found["orientation_variance"].value) @ matrix.T)
        assert twist[:3, :3] == pytest.approx(to_body @ np.diag(found["velocity_variance"].value) @ to_body.T)
        assert not pose[:3, 3:].any()
        assert not twist[3:].any()
        assert (result.header.frame_id, result.child_frame_id) == ("map", "drone")
        assert result.header.stamp == package.ros.time(SAMPLED)
        assert package.nav_msgs.msg.Odometry.decode(result.encode()) == result
        assert package.frames.to_triangle(pose.tolist()) == pytest.approx(tuple(pose[np.triu_indices(6)]))


def test_both_frames_of_odometry_must_fit(package: Any) -> None:
    random = np.random.default_rng(14)
    with pytest.raises(package.frames.FrameError, match=r"^the position is in ENU, and the velocity in local FLU$"):
        package.ros.odometry(odometry(package, random, velocity_frame=2))
    local = package.ros.odometry(odometry(package, random, pose_frame=2, velocity_frame=2))
    assert math.isfinite(local.twist.twist.linear.x)
    with pytest.raises(package.frames.FrameError, match=r"^VehicleOdometry\.q: pose_frame is POSE_FRAME_UNKNOWN$"):
        package.ros.odometry(odometry(package, random, pose_frame=0))
    with pytest.raises(package.frames.FrameError, match=r"^VehicleAttitude\.q: the quaternion is no rotation"):
        package.ros.pose(package.VehicleAttitude())


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ((), None),
        (("builtin_interfaces",), None),
        (("geometry_msgs", "std_msgs", "builtin_interfaces"), {"time"}),
        (tuple(ROS), {"time", "odometry"}),
    ],
)
def test_a_package_has_what_its_types_allow(names: tuple[str, ...], expected: set[str] | None, tmp_path: Path) -> None:
    catalog = catalog_with(tmp_path, *names)
    assert ("ros.py" in list_package(catalog)) == (expected is not None)
    if expected is not None:
        package = import_package(catalog, tmp_path)
        assert {*package.ros.__all__} & {"time", "odometry"} == expected


def test_the_example_of_the_page_runs(package: Any) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "frames.md").read_text(), re.DOTALL)
    names: dict[str, Any] = {"odometry": odometry(package, np.random.default_rng(14))}
    exec(block.replace("px4_types", package.__name__), names)  # noqa: S102 - our own text
    assert names["setpoint"].position == pytest.approx(names["odometry"].position)
    assert names["message"].pose.pose == names["pose"]


APPLICATION = """
import numpy
from numpy.typing import NDArray
from {name} import TrajectorySetpoint, VehicleOdometry, clock, frames, ros
from {name}.geometry_msgs.msg import Point, Pose
from {name}.nav_msgs.msg import Odometry

vector: tuple[float, float, float] = frames.ned_to_enu((1.0, 2.0, 3.0))
quaternion: tuple[float, float, float, float] = frames.px4_to_ros_orientation([1.0, 0.0, 0.0, 0.0])
array: NDArray[numpy.float64] = frames.frd_to_flu(numpy.zeros((7, 3)))
heading: float = frames.ned_to_enu_heading(0.5)
flat: tuple[float, ...] = frames.ned_to_enu_covariance((1.0,) * 9)
rows: tuple[tuple[float, ...], ...] = frames.from_triangle((1.0,) * 6)
setpoint: TrajectorySetpoint = frames.from_ros(TrajectorySetpoint, position=vector, yaw=heading)
same: VehicleOdometry = frames.from_ros(VehicleOdometry(), position=frames.to_ros(setpoint, "position"))
frame: str = frames.to_ros(setpoint)["position"].frame
seconds: float = clock.age(setpoint)
point: Point = ros.point(ros.xyz(Point()))
message: Odometry = ros.odometry(same)
stamp: int = clock.from_ros(message.header.stamp)
pose: Pose = ros.pose(same)
"""


@pytest.mark.night  # by day, mypy checks other packages
def test_type_checkers_know_the_types(package: Any, tmp_path: Path) -> None:
    (tmp_path / "application.py").write_text(APPLICATION.format(name=package.__name__))
    done = mypy(tmp_path, "application.py", path=Path(package.__file__).parent.parent)
    assert done.returncode == 0, done.stdout + done.stderr
