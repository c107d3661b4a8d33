"""Tests of the vehicle's place in Foxglove, against the rotations of PX4's guide, built with scipy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from msggen.show.view.scene import ATTITUDE, GLOBAL, ODOMETRY, POSITION, Location, Pose, Scene

NED_TO_ENU = Rotation.from_euler("ZX", [90, 180], degrees=True)
FRD_TO_FLU = Rotation.from_euler("X", 180, degrees=True)
SECOND = 1_000_000_000
numbers = st.floats(-1000, 1000, width=32)
quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: tuple(float(value / math.hypot(*q)) for value in q))
)


def rotation(q: Any) -> Rotation:
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


def check(pose: object, position: Any, q: Any) -> None:
    assert isinstance(pose, Pose)
    np.testing.assert_allclose(pose.position, NED_TO_ENU.apply(position), atol=1e-3)
    expected = NED_TO_ENU * rotation(q) * FRD_TO_FLU
    assert (expected.inv() * rotation(pose.orientation)).magnitude() < 1e-3


@given(st.tuples(numbers, numbers, numbers), quaternions)
def test_odometry_gives_the_pose(px4_types: Any, position: Any, q: Any) -> None:
    cls = px4_types.VehicleOdometry
    message = cls(pose_frame=cls.POSE_FRAME_NED, position=position, q=q)
    check(Scene(px4_types).feed(ODOMETRY, message, 0), position, q)


@given(st.tuples(numbers, numbers, numbers), quaternions)
def test_position_and_attitude_together_give_the_pose(px4_types: Any, position: Any, q: Any) -> None:
    scene = Scene(px4_types)
    x, y, z = position
    assert scene.feed(POSITION, px4_types.VehicleLocalPosition(x=x, y=y, z=z), 0) is None
    check(scene.feed(ATTITUDE, px4_types.VehicleAttitude(q=q), 0), position, q)


def test_attitude_is_used_when_odometry_is_silent(px4_types: Any) -> None:
    scene, attitude = Scene(px4_types), px4_types.VehicleAttitude(q=(1.0, 0.0, 0.0, 0.0))
    cls = px4_types.VehicleOdometry
    odometry = cls(pose_frame=cls.POSE_FRAME_NED, position=(1.0, 2.0, 3.0), q=(1.0, 0.0, 0.0, 0.0))
    assert scene.feed(ODOMETRY, odometry, 10 * SECOND) is not None
    assert scene.feed(ATTITUDE, attitude, 10 * SECOND + 5) is None
    assert scene.feed(ATTITUDE, attitude, 11 * SECOND) is not None
    assert scene.feed(ATTITUDE, attitude, 9 * SECOND) is not None, "the clock was set back"


@pytest.mark.parametrize(
    "bad", [{"position": (math.nan, 0.0, 0.0)}, {"q": (math.nan,) * 4}, {"pose_frame": 2}, {"pose_frame": 0}]
)
def test_what_is_unknown_gives_no_pose(px4_types: Any, bad: dict[str, Any]) -> None:
    given = {"pose_frame": 1, "position": (1.0, 2.0, 3.0), "q": (1.0, 0.0, 0.0, 0.0), **bad}
    assert Scene(px4_types).feed(ODOMETRY, px4_types.VehicleOdometry(**given), 0) is None


def test_locations(px4_types: Any) -> None:
    scene, cls = Scene(px4_types), px4_types.VehicleGlobalPosition
    assert scene.feed(GLOBAL, cls(lat=47.4, lon=8.5, alt=500.0), 0) == Location(47.4, 8.5, 500.0)
    assert scene.feed(GLOBAL, cls(lat=math.nan, lon=8.5, alt=500.0), 0) is None
    assert scene.feed("px4_msgs/msg/VehicleStatus", px4_types.VehicleStatus(), 0) is None
