"""Tests of `frames.to_ros`, `from_ros` and `batch_to_ros`: which fields are converted, from and to which frames."""

from __future__ import annotations

import copy
import importlib
import math
import pickle
import re
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.sources.inferred import with_inferred
from support.catalogs import catalog_of, import_package
from support.examples import by_day
from support.repository import ROOT, shared

NAN = math.nan
LISTED = (ROOT / "tests" / "package" / "quantities.txt").read_text().splitlines()
"""All quantities of the embedded definitions with kind and tag, and the refused fields with the reason after a `-`."""


@pytest.fixture(scope="module")
def frames(px4_types: Any) -> Any:
    return px4_types.frames


def odometry(px4_types: Any, **values: Any) -> Any:
    cls = px4_types.VehicleOdometry
    given = {"pose_frame": cls.POSE_FRAME_NED, "velocity_frame": cls.VELOCITY_FRAME_NED, "q": (1.0, 0.0, 0.0, 0.0)}
    return cls(position=(1.0, 2.0, -3.0), velocity=(4.0, 5.0, -6.0), **{**given, **values})


# --- The rules


def quantities(package: Any) -> list[str]:
    """Return the lines of LISTED for a package."""
    rules = importlib.import_module(f"{package.__name__}.quantities")
    lines = []
    for name in dir(package):
        cls = getattr(package, name)
        if hasattr(cls, "__msg__"):
            parts = rules.parts_of(cls)
            lines += [f"{name} {part.name} {part.kind} {part.tag}" for part in parts.known.values()]
            lines += [f"{name} {field} - {reason}" for field, reason in parts.refused.items()]
    return lines


def test_every_quantity_of_the_embedded_definitions_is_listed(px4_types: Any) -> None:
    assert sorted(quantities(px4_types)) == sorted(LISTED)


OLD = {
    "TrajectoryBezier position vector NED",
    "TrajectoryWaypoint acceleration vector NED",
    "TrajectoryWaypoint position vector NED",
    "TrajectoryWaypoint velocity vector NED",
    "VehicleAngularAccelerationSetpoint xyz vector FRD",
}
"""Quantities of earlier releases that v1.18 does not have."""


@by_day("release", ["v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03"], 6)
def test_every_quantity_of_the_releases_is_listed(release: str, tmp_path: Path) -> None:
    sources = find_sources(str(shared(f"firmware/{release}")))
    package = import_package(with_inferred(read_catalog(sources), sources), tmp_path)
    found = {line for line in quantities(package) if " - " not in line}
    assert found <= {*LISTED, *OLD}
    for name in (
        "VehicleAttitude q",
        "VehicleOdometry position",
        "SensorCombined gyro_rad",
        "VehicleLocalPosition vxyz",
    ):
        assert any(line.startswith(f"{name} ") for line in found)


TAGS = {
    "NED": ("ENU", (2.0, 1.0, -3.0)),
    " ned ": ("ENU", (2.0, 1.0, -3.0)),
    "ENU": ("ENU", (1.0, 2.0, 3.0)),
    "FRD": ("FLU", (1.0, -2.0, -3.0)),
    "Body": ("FLU", (1.0, -2.0, -3.0)),
    "body FRD": ("FLU", (1.0, -2.0, -3.0)),
    "body  frame FRD": ("FLU", (1.0, -2.0, -3.0)),
    "FLU": ("FLU", (1.0, 2.0, 3.0)),
    "body FLU": ("FLU", (1.0, 2.0, 3.0)),
    "@KEEP_FRAME_BODY_FRD": ("FLU", (1.0, -2.0, -3.0)),
    "@kind_frame": ("ENU", (2.0, 1.0, -3.0)),
    "local frame": "'local frame' can be any, and there is no field 'pose_frame' that tells which",
    "Sensor": "the axes of the sensor are not known",
    "MSL": "an altitude has no axes",
    "WGS84": "an altitude has no axes",
    "ECEF": "the frame 'ECEF' is not known",
    "@other": "the frame '@other' is neither a field nor a constant of the message",
    "@timestamp": "timestamp is 0",
}


def test_the_frames_of_tags(tmp_path: Path) -> None:
    kinds = "uint8 KEEP_FRAME_BODY_FRD = 1\nuint8 KIND_FRAME_NED = 0\nuint8 kind_frame # [@enum KIND_FRAME]\n"
    fields = "".join(f"float32[3] a{n} # [m] [@frame {tag}]\n" for n, tag in enumerate(TAGS))
    package = import_package(catalog_of(tmp_path, {"msg/Tags.msg": f"uint64 timestamp\n{kinds}{fields}"}), tmp_path)
    frames = package.frames
    message = package.Tags(**{f"a{n}": (1.0, 2.0, 3.0) for n in range(len(TAGS))})
    for n, expected in enumerate(TAGS.values()):
        if isinstance(expected, str):
            with pytest.raises(frames.FrameError) as caught:
                frames.to_ros(message, f"a{n}")
            assert str(caught.value) == f"Tags.a{n}: {expected}"
        else:
            quantity = frames.to_ros(message, f"a{n}")
            assert (quantity.frame, quantity.value) == expected


RULES = {
    "float32[4] q # [@frame FRD]": "orientation with body axes: its local frame is not known",
    "float32 heading # [rad] [@frame FRD]": "heading with body axes: its local frame is not known",
    "float32 yaw_rate # [rad/s] [@frame @KEEP_FRAME_FRD]": "yaw rate in local FRD: its zero is not known",
    "float32 yaw # [rad]": "it has no frame",
    "float32 yaw # [deg] [@frame NED]": "a value in NED that is no vector of three components",
    "float32 yaw_error # [rad] [@frame NED]": "a value in NED that is no vector of three components",
    "float32[2] position # [m] [@frame NED]": "a value in NED that is no vector of three components",
    "int16[3] position # [m] [@frame NED]": "a value in NED that is no vector of three components",
    "float32[3] gains # [-] [@frame FRD]": "it is dimensionless: it can be a vector, or a factor for each axis",
    "float32[3] position # [m]": "its definition does not say its frame: its comment has no [@frame ...]",
    "float32[3] position # [@frame NED]": "vector",
    "float64[3] position # [m] [@frame NED]": "vector",
    "float32[3] torque # [-] [@frame FRD]": "vector",
    "float32[3] gains # [-] [@range -1, 1] [@frame FRD]": "vector",
    "float32[3] position_std # [m] [@frame NED]": "variances",
    "float32[4] attitude # [@frame NED]": "orientation",
    "float32 course # [rad] [@frame NED]": "heading",
    "float64 yawspeed # [rad/s] [@frame NED]": "yaw rate",
}


@pytest.fixture(scope="module")
def by_rule(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("rules")
    start = "uint64 timestamp\nuint8 KEEP_FRAME_FRD = 1\n"
    files = {f"msg/Rule{n}.msg": f"{start}{text}\n" for n, text in enumerate(RULES)}
    return import_package(catalog_of(folder, files), folder)


@pytest.mark.parametrize("text", RULES)
def test_the_rules_of_single_fields(by_rule: Any, text: str) -> None:
    cls = getattr(by_rule, f"Rule{list(RULES).index(text)}")
    name = cls.__msg__.fields[1].name
    values = {"attitude": (1.0, 0.0, 0.0, 0.0), "q": (1.0, 0.0, 0.0, 0.0)}
    message = cls(**{name: values[name]} if name in values else {})
    try:
        found = by_rule.frames.to_ros(message, name).kind
    except by_rule.frames.FrameError as error:
        found = str(error).removeprefix(f"{cls.__msg__.name}.{name}: ")
    assert found == RULES[text]


TRIPLES = {
    "float32 x # [m] [@frame NED]\nfloat32 y # [m] [@frame NED]\nfloat32 z # [m] [@frame NED]": ["xyz"],
    "float32 vy # [m/s] [@frame NED]\nfloat32 vx # [m/s] [@frame NED]\nfloat32 vz # [m/s] [@frame NED]": ["vxyz"],
    "float32 x # [m] [@frame NED]\nfloat32 y # [m] [@frame NED]\nfloat32 z # [cm] [@frame NED]": [],
    "float32 x # [m] [@frame NED]\nfloat32 y # [m] [@frame NED]\nfloat64 z # [m] [@frame NED]": [],
    "float32 x # [m] [@frame NED]\nfloat32 y # [m] [@frame NED]\nfloat32 z # [m] [@frame ENU]": [],
    "float32 x # [m] [@frame NED]\nfloat32 y # [m] [@frame NED]": [],
    "float32 x # [m]\nfloat32 y # [m]\nfloat32 z # [m]": [],
    "float32 roll # [rad] [@frame FRD]\nfloat32 pitch # [rad] [@frame FRD]\nfloat32 yaw # [rad] [@frame FRD]": [],
    "float32 var_x # [m^2] [@frame NED]\nfloat32 var_y # [m^2] [@frame NED]\nfloat32 var_z # [m^2] [@frame NED]": [
        "var_xyz"
    ],
}


def test_the_rules_of_three_fields(tmp_path: Path) -> None:
    files = {f"msg/Rule{n}.msg": f"uint64 timestamp\n{text}\n" for n, text in enumerate(TRIPLES)}
    package = import_package(catalog_of(tmp_path, files), tmp_path)
    for n, (text, names) in enumerate(TRIPLES.items()):
        message = getattr(package, f"Rule{n}")()
        try:
            found = package.frames.to_ros(message)
        except package.frames.FrameError:
            found = {}
        assert [*found] == names, text
    assert found["var_xyz"].kind == "variances"


# --- to_ros


def test_what_users_convert_first(px4_types: Any, frames: Any) -> None:
    found = frames.to_ros(odometry(px4_types, angular_velocity=(0.1, 0.2, 0.3)))
    half = math.sqrt(0.5)
    assert found["position"] == frames.Quantity((2.0, 1.0, 3.0), "ENU", "vector")
    assert found["velocity"] == frames.Quantity((5.0, 4.0, 6.0), "ENU", "vector")
    assert found["angular_velocity"] == frames.Quantity((0.1, -0.2, -0.3), "FLU", "vector")
    assert found["q"].value == pytest.approx((half, 0, 0, half))
    assert (found["q"].frame, found["q"].kind) == ("ENU", "orientation")
    local = px4_types.VehicleLocalPosition(x=1.0, y=2.0, z=-3.0, vx=4.0, vy=5.0, vz=-6.0, heading=math.pi / 2)
    found = frames.to_ros(local)
    assert found["xyz"].value == (2.0, 1.0, 3.0)
    assert found["vxyz"].value == (5.0, 4.0, 6.0)
    assert found["heading"] == frames.Quantity(0.0, "ENU", "heading")
    assert frames.to_ros(px4_types.VehicleAttitude(q=(1.0, 0.0, 0.0, 0.0)))["q"].value == pytest.approx(
        (half, 0, 0, half)
    )
    assert frames.to_ros(px4_types.SensorCombined(gyro_rad=(1.0, 2.0, 3.0)), "gyro_rad").value == (1.0, -2.0, -3.0)
    rates = px4_types.VehicleRatesSetpoint(roll=0.1, pitch=0.2, yaw=0.3)
    assert frames.to_ros(rates, "roll_pitch_yaw").value == (0.1, -0.2, -0.3)
    gps = px4_types.SensorGps(vel_n_m_s=1.0, vel_e_m_s=2.0, vel_d_m_s=3.0)
    assert frames.to_ros(gps, "vel_ned_m_s").value == (2.0, 1.0, -3.0)


def test_variances_keep_their_signs(px4_types: Any, frames: Any) -> None:
    message = odometry(px4_types, position_variance=(1.0, 2.0, 3.0), orientation_variance=(4.0, 5.0, 6.0))
    found = frames.to_ros(message)
    assert found["position_variance"] == frames.Quantity((2.0, 1.0, 3.0), "ENU", "variances")
    assert found["orientation_variance"] == frames.Quantity((4.0, 5.0, 6.0), "FLU", "variances")


def test_the_frame_of_a_field_can_be_the_value_of_another(px4_types: Any, frames: Any) -> None:
    cls = px4_types.VehicleOdometry
    message = odometry(px4_types, pose_frame=cls.POSE_FRAME_FRD, velocity_frame=cls.VELOCITY_FRAME_BODY_FRD)
    found = frames.to_ros(message)
    assert found["position"] == frames.Quantity((1.0, -2.0, 3.0), "local FLU", "vector")
    assert found["q"] == frames.Quantity((1.0, 0.0, 0.0, 0.0), "local FLU", "orientation")
    assert found["velocity"] == frames.Quantity((4.0, -5.0, 6.0), "FLU", "vector")
    message.velocity_frame = cls.VELOCITY_FRAME_FRD
    assert frames.to_ros(message, "velocity").frame == "local FLU"


@pytest.mark.parametrize(("value", "shown"), [(0, "POSE_FRAME_UNKNOWN"), (9, "9")])
def test_an_unknown_frame_is_an_error(px4_types: Any, frames: Any, value: int, shown: str) -> None:
    message = odometry(px4_types, pose_frame=value)
    found = frames.to_ros(message)
    text = f"VehicleOdometry.position: pose_frame is {shown}"
    assert "position" not in found
    assert found.refused["position"] == f"pose_frame is {shown}"
    assert found["velocity"].value == (5.0, 4.0, 6.0)
    attempts: list[Callable[[], Any]] = [lambda: found["position"], lambda: frames.to_ros(message, "position")]
    for convert in attempts:
        with pytest.raises(frames.FrameError) as caught:
            convert()
        assert str(caught.value) == text
    with pytest.raises(frames.FrameError, match=text):
        frames.from_ros(message, position=(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("message", "name", "text"),
    [
        ("GimbalDeviceAttitudeStatus", "q", "its definition does not say its frame: its comment has no [@frame ...]"),
        (
            "TrajectorySetpoint6dof",
            "angular_velocity",
            "its definition does not say its frame: its comment has no [@frame ...]",
        ),
        ("VehicleOdometry", "timestamp", "it has no frame"),
        ("VehicleLocalPosition", "x", "it is a part of 'xyz'"),
        ("VehicleLocalPosition", "delta_xy", "a value in NED that is no vector of three components"),
        ("VehicleAttitude", "q", "the quaternion is no rotation: its norm is 0, expected 1"),
        ("VehicleAirData", "baro_alt_meter", "an altitude has no axes"),
        ("GainCompression", "compression_gains", "it is dimensionless: it can be a vector, or a factor for each axis"),
    ],
)
def test_what_is_not_declared_is_an_error(px4_types: Any, frames: Any, message: str, name: str, text: str) -> None:
    cls = getattr(px4_types, message)
    with pytest.raises(frames.FrameError) as caught:
        frames.to_ros(cls(), name)
    assert str(caught.value) == f"{message}.{name}: {text}"
    if (message, name) not in (("VehicleAttitude", "q"), ("VehicleOdometry", "timestamp")):
        with pytest.raises(frames.FrameError) as caught:
            frames.from_ros(cls(), **{name: (1.0, 2.0, 3.0)})
        assert str(caught.value) == f"{message}.{name}: {text}"


def test_a_message_without_frames_is_an_error(px4_types: Any, frames: Any) -> None:
    with pytest.raises(frames.FrameError, match=r"^VehicleStatus: no field has a frame$"):
        frames.to_ros(px4_types.VehicleStatus())
    with pytest.raises(frames.FrameError, match=r"^VehicleAttitude\.q: the quaternion is no rotation"):
        frames.to_ros(px4_types.VehicleAttitude())


def test_an_unknown_name_suggests_the_nearest(px4_types: Any, frames: Any) -> None:
    message = px4_types.VehicleLocalPosition()
    attempts: list[Callable[[], Any]] = [
        lambda: frames.to_ros(message)["vxy"],
        lambda: frames.to_ros(message, "vxy"),
        lambda: frames.from_ros(message, vxy=(1, 2, 3)),
    ]
    for convert in attempts:
        with pytest.raises(KeyError) as caught:
            convert()
        assert str(caught.value) == "VehicleLocalPosition has no field 'vxy', did you mean 'vxyz'?"
    with pytest.raises(TypeError):
        frames.to_ros(message)[0]


def test_nan_is_not_valid(px4_types: Any, frames: Any) -> None:
    message = odometry(px4_types, q=(NAN, 0.0, 0.0, 0.0), angular_velocity=(0.0, NAN, 0.0))
    found = frames.to_ros(message)
    assert [found[name].is_valid for name in ("position", "q", "angular_velocity")] == [True, False, False]
    assert math.isnan(found["q"].value[0])
    assert not frames.to_ros(px4_types.TrajectorySetpoint(yaw=NAN), "yaw").is_valid


def test_results_can_be_copied_and_pickled(px4_types: Any, frames: Any) -> None:
    found = frames.to_ros(odometry(px4_types))
    for twin in (copy.deepcopy(found), pickle.loads(pickle.dumps(found))):  # noqa: S301
        assert twin == found
        with pytest.raises(frames.FrameError):
            twin["timestamp"]
    with pytest.raises(AttributeError):
        found["position"].frame = "NED"


def test_views_and_subclasses_are_messages(px4_types: Any, frames: Any) -> None:
    class Mine(px4_types.VehicleOdometry):  # type: ignore[misc]
        pass

    expected = frames.to_ros(odometry(px4_types))
    sample = odometry(px4_types).encode()
    assert frames.to_ros(px4_types.VehicleOdometry.lazy(sample)) == expected
    assert frames.to_ros(Mine.decode(sample)) == expected


# --- from_ros


def test_a_setpoint_in_frames_of_ros(px4_types: Any, frames: Any) -> None:
    """What is not given is not controlled."""
    setpoint = frames.from_ros(px4_types.TrajectorySetpoint, position=(1.0, 2.0, 3.0), yaw=0.0)
    nans = (NAN, NAN, NAN)
    expected = px4_types.TrajectorySetpoint(
        position=(2.0, 1.0, -3.0), velocity=nans, acceleration=nans, jerk=nans, yaw=math.pi / 2, yawspeed=NAN
    )
    assert setpoint == expected
    turning = frames.from_ros(px4_types.TrajectorySetpoint, velocity=np.array([1, 0, 0]), yawspeed=0.5)
    assert repr(turning.velocity) == "(0.0, 1.0, 0.0)"
    assert turning.yawspeed == -0.5
    assert px4_types.TrajectorySetpoint.decode(turning.encode()) == turning


def test_the_fields_that_are_frames_can_be_given(px4_types: Any, frames: Any) -> None:
    odometry = frames.from_ros(
        px4_types.VehicleOdometry, position=(1.0, 2.0, 3.0), pose_frame=1, q=(1.0, 0.0, 0.0, 0.0), velocity_frame=3
    )
    assert (odometry.pose_frame, odometry.velocity_frame) == (1, 3)
    assert odometry.position == (2.0, 1.0, -3.0)
    assert frames.to_ros(odometry, "q").value == pytest.approx((1.0, 0.0, 0.0, 0.0))
    assert not frames.to_ros(odometry, "velocity").is_valid


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({}, "position: pose_frame is POSE_FRAME_UNKNOWN"),
        ({"pose_frame": 9}, "position: pose_frame is 9"),
        ({"pose_frame": "NED"}, "pose_frame: expected uint8, 0 to 255, got 'NED'"),
        ({"pose_frame": []}, "pose_frame: expected uint8, 0 to 255, got a list of 0"),
    ],
)
def test_an_error_names_the_values_that_are_frames(
    px4_types: Any, frames: Any, values: dict[str, Any], text: str
) -> None:
    with pytest.raises(frames.FrameError) as caught:
        frames.from_ros(px4_types.VehicleOdometry, position=(1.0, 2.0, 3.0), **values)
    hint = "give pose_frame=1 (POSE_FRAME_NED) or 2 (POSE_FRAME_FRD)"
    assert str(caught.value) == f"VehicleOdometry.{text}: {hint}"


def test_integers_and_booleans_without_a_frame_can_be_given(px4_types: Any, frames: Any) -> None:
    setpoint = frames.from_ros(px4_types.TrajectorySetpoint, position=(1.0, 2.0, 3.0), timestamp=np.uint64(5))
    assert setpoint.timestamp == 5
    assert math.isnan(setpoint.velocity[0])
    goto = frames.from_ros(px4_types.GotoSetpoint, heading=0.0, flag_control_heading=True)
    assert (goto.flag_control_heading, goto.heading) == (True, math.pi / 2)
    for text, values in (
        ("timestamp: expected uint64, 0 to 18446744073709551615, got -1", {"timestamp": -1}),
        ("timestamp: expected an integer, got the float 1.5", {"timestamp": 1.5}),
    ):
        with pytest.raises(frames.FrameError, match=text):
            frames.from_ros(px4_types.TrajectorySetpoint, **values)
    for cls, name in (("VehicleLocalPosition", "eph"), ("SensorGyroFifo", "x"), ("FigureEightStatus", "x")):
        with pytest.raises(frames.FrameError, match=f"{cls}.{name}: "):
            frames.from_ros(getattr(px4_types, cls), **{name: 1})


def test_an_unknown_name_without_a_near_one_lists_all(px4_types: Any, frames: Any) -> None:
    with pytest.raises(KeyError) as caught:
        frames.from_ros(px4_types.TrajectorySetpoint, pos=(1.0, 2.0, 3.0))
    names = "'position', 'velocity', 'acceleration', 'jerk', 'yaw', 'yawspeed'"
    assert str(caught.value) == f"TrajectorySetpoint has no field 'pos': there are {names}"


def test_errors_have_one_traceback(px4_types: Any, frames: Any) -> None:
    zeros, cls = px4_types.VehicleAttitude(), px4_types.VehicleOdometry
    calls: list[Callable[[], Any]] = [
        lambda: frames.to_ros(zeros),
        lambda: frames.to_ros(zeros, "q"),
        lambda: frames.from_ros(zeros, q=(0.0, 0.0, 0.0, 0.0)),
        lambda: frames.from_ros(cls, position=(1.0, 2.0, 3.0)),
        lambda: frames.batch_from_ros(cls, position=[(1.0, 2.0, 3.0), (1.0, 2.0)]),
    ]
    for call in calls:
        with pytest.raises(frames.FrameError) as caught:
            call()
        assert "During handling" not in "".join(traceback.format_exception(caught.value))


def test_objects_that_are_no_messages_are_errors(px4_types: Any, frames: Any) -> None:
    setpoint = px4_types.TrajectorySetpoint
    array = setpoint.decode_batch([setpoint().encode()])
    for function in (frames.to_ros, px4_types.show, px4_types.clock.age, px4_types.meaning.problems):
        with pytest.raises(TypeError, match=r"^expected a message, got the class TrajectorySetpoint: call it"):
            function(setpoint)
        with pytest.raises(TypeError, match=r"^expected a message, got values of numpy: use the from_row of the class"):
            function(array[0])
        with pytest.raises(TypeError, match=r"^expected a message, got None$"):
            function(None)
    calls: tuple[tuple[Callable[[], object], str], ...] = (
        (lambda: frames.from_ros(3), "expected a message, got 3"),
        (lambda: frames.from_ros(int), "expected the class of a message, got <class 'int'>"),
        (lambda: frames.batch_to_ros(setpoint(), array), "expected the class of a message, got TrajectorySetpoint("),
        (lambda: frames.batch_to_ros(setpoint, setpoint()), "expected an array from TrajectorySetpoint.decode_batch"),
        (lambda: px4_types.units.of(3, "x"), "expected the class of a message, got 3"),
    )
    for call, text in calls:
        with pytest.raises(TypeError, match=f"^{re.escape(text)}"):
            call()


def test_a_message_keeps_its_other_fields(px4_types: Any, frames: Any) -> None:
    given = odometry(px4_types, timestamp=7)
    given.pose_frame = given.POSE_FRAME_FRD
    changed = frames.from_ros(given, position=(1.0, 2.0, 3.0))
    assert changed.position == (1.0, -2.0, -3.0)
    assert (changed.timestamp, changed.velocity) == (7, given.velocity)
    assert given.position == (1.0, 2.0, -3.0)


def test_three_fields_are_set_together(px4_types: Any, frames: Any) -> None:
    rates = frames.from_ros(px4_types.VehicleRatesSetpoint, roll_pitch_yaw=(0.1, 0.2, 0.3), thrust_body=(0.0, 0.0, 0.5))
    assert (rates.roll, rates.pitch, rates.yaw) == (0.1, -0.2, -0.3)
    assert rates.thrust_body == (0.0, 0.0, -0.5)


def test_a_quantity_must_have_the_expected_frame(px4_types: Any, frames: Any) -> None:
    position = frames.to_ros(odometry(px4_types), "position")
    assert frames.from_ros(px4_types.TrajectorySetpoint, position=position).position == (1.0, 2.0, -3.0)
    with pytest.raises(frames.FrameError) as caught:
        frames.from_ros(px4_types.VehicleThrustSetpoint, xyz=position)
    assert str(caught.value) == "VehicleThrustSetpoint.xyz: expected a value in FLU, got one in ENU"


@pytest.mark.parametrize(
    ("message", "values", "text"),
    [
        ("TrajectorySetpoint", {"position": (1.0, 2.0)}, "position: expected 3 numbers, got 2"),
        ("TrajectorySetpoint", {"velocity": 1.0}, "velocity: expected 3 numbers, got an object of type float"),
        ("TrajectorySetpoint", {"yaw": (1.0,)}, "yaw: expected one number, got 1"),
        ("TrajectorySetpoint", {"yawspeed": "fast"}, "yawspeed: expected one number, got an object of type str"),
        (
            "VehicleAttitudeSetpoint",
            {"q_d": (2.0, 0, 0, 0)},
            "q_d: the quaternion is no rotation: its norm is 2, expected 1",
        ),
        (
            "TrajectorySetpoint",
            {"yaw": np.zeros(2)},
            "yaw: expected the value of one message, got an array of shape (2,): batch_from_ros takes many",
        ),
        (
            "TrajectorySetpoint",
            {"position": np.zeros((2, 3))},
            "position: expected the value of one message, got an array of shape (2, 3): batch_from_ros takes many",
        ),
        (
            "TrajectorySetpoint",
            {"position": [(1.0, 2.0, 3.0)] * 2},
            "position: expected the value of one message, got 2 x 3: batch_from_ros takes many",
        ),
        ("RaptorInput", {"position": (1.0,)}, "position: expected 3 numbers, got 1"),
        ("VehicleOdometry", {"orientation_variance": ()}, "orientation_variance: expected 3 numbers, got 0"),
    ],
)
def test_a_value_of_another_kind_is_an_error(
    px4_types: Any, frames: Any, message: str, values: dict[str, Any], text: str
) -> None:
    with pytest.raises(frames.FrameError) as caught:
        frames.from_ros(getattr(px4_types, message), **values)
    assert str(caught.value) == f"{message}.{text}"


def test_both_directions_cancel_for_every_message(px4_types: Any, frames: Any) -> None:
    random = np.random.default_rng(14)
    tried = 0
    for name in dir(px4_types):
        cls = getattr(px4_types, name)
        if not any(line.startswith(f"{name} ") and " - " not in line for line in LISTED):
            continue
        message = cls()
        for field in cls.__msg__.fields:
            if field.base in ("float32", "float64"):
                values = tuple(random.uniform(-3, 3, field.length or 1).tolist())
                norm = math.hypot(*values) if field.length == 4 else 1.0
                values = tuple(value / norm for value in values)
                setattr(message, field.attribute, values if field.length else values[0])
            elif field.name in ("pose_frame", "velocity_frame"):
                setattr(message, field.attribute, 1)
        found = frames.to_ros(message) if name != "SensorCorrection" else {}
        back = frames.from_ros(message, **found)
        for field in cls.__msg__.fields:
            one, other = getattr(message, field.attribute), getattr(back, field.attribute)
            assert one == other or one == pytest.approx(other, abs=1e-12)
        tried += len(found)
    assert tried > 100


# --- Batches


def test_a_batch_is_converted_as_its_messages(px4_types: Any, frames: Any) -> None:
    random = np.random.default_rng(14)
    cls = px4_types.VehicleOdometry
    messages = []
    for values in random.normal(size=(100, 13)).tolist():
        norm = math.hypot(*values[9:])
        quaternion = tuple(value / norm for value in values[9:])
        given = {"position": values[:3], "velocity": values[3:6], "position_variance": values[6:9], "q": quaternion}
        messages.append(cls(pose_frame=1, velocity_frame=3, **given))
    array = cls.decode_batch([message.encode() for message in messages])
    found = frames.batch_to_ros(cls, array)
    for index, message in enumerate(map(cls.from_row, array)):
        single = frames.to_ros(message)
        assert list(single) == list(found)
        for name, quantity in single.items():
            assert tuple(found[name].value[index].tolist()) == quantity.value
            assert (found[name].frame, found[name].kind) == (quantity.frame, quantity.kind)


def test_three_fields_of_a_batch_are_one_array(px4_types: Any, frames: Any) -> None:
    cls = px4_types.VehicleLocalPosition
    array = cls.decode_batch([cls(x=float(n), y=2.0, z=NAN if n else 1.0, heading=0.0).encode() for n in range(3)])
    found = frames.batch_to_ros(cls, array)
    assert found["xyz"].value.shape == (3, 3)
    assert found["xyz"].value[0].tolist() == [2.0, 0.0, -1.0]
    assert found["xyz"].is_valid.tolist() == [True, False, False]
    assert found["heading"].is_valid.tolist() == [True, True, True]
    assert found["heading"].value.tolist() == [math.pi / 2] * 3


def test_a_batch_has_one_frame(px4_types: Any, frames: Any) -> None:
    cls = px4_types.VehicleOdometry
    array = cls.decode_batch([odometry(px4_types, pose_frame=1 + n % 2).encode() for n in range(4)])
    found = frames.batch_to_ros(cls, array)
    with pytest.raises(frames.FrameError) as caught:
        found["position"]
    text = "VehicleOdometry.position: pose_frame differs among the samples: select those with one value"
    assert str(caught.value) == text
    assert found["velocity"].value.shape == (4, 3)
    assert frames.batch_to_ros(cls, array[array["pose_frame"] == 1])["position"].frame == "ENU"
    with pytest.raises(frames.FrameError, match="there are no samples"):
        frames.batch_to_ros(cls, array[:0])["position"]


def test_a_broken_quaternion_of_a_batch_is_named(px4_types: Any, frames: Any) -> None:
    cls = px4_types.VehicleAttitude
    array = cls.decode_batch([cls(q=(1.0, 0, 0, 0)).encode(), cls().encode()])
    with pytest.raises(frames.FrameError, match=r"^VehicleAttitude\.q: quaternion 1 is no rotation: its norm is 0"):
        frames.batch_to_ros(cls, array)


def test_a_batch_is_made_as_its_messages(px4_types: Any, frames: Any) -> None:
    """Of every message with quantities; integers are given as well."""
    random = np.random.default_rng(15)
    tried = 0
    for cls in (getattr(px4_types, name) for name in dir(px4_types)):
        parts = px4_types.quantities.parts_of(cls) if hasattr(cls, "__msg__") else None
        if parts is None or not parts.known or cls.__msg__.name == "SensorCorrection":
            continue
        values: dict[str, Any] = {name: np.array([1, 1, 1]) for name in parts.plain}
        for name, part in parts.known.items():
            length = part.fields[0].length or len(part.fields)
            numbers = random.uniform(-3, 3, (3, length))
            numbers /= np.linalg.norm(numbers, axis=1, keepdims=True)
            values[name] = numbers[:, 0] if length == 1 else numbers
        array = frames.batch_from_ros(cls, **values)
        samples = cls.encode_batch(array)
        for row, sample in enumerate(samples):
            single = frames.from_ros(cls, **{name: value[row] for name, value in values.items()})
            assert sample == single.encode()
        tried += len(parts.known)
    assert tried > 100


def test_a_value_can_be_that_of_all_samples_of_a_batch(px4_types: Any, frames: Any) -> None:
    cls = px4_types.TrajectorySetpoint
    array = frames.batch_from_ros(cls, position=[(1.0, 2.0, 3.0)] * 2, velocity=(1, 0, 0), yaw=0.0, timestamp=[7, 8])
    assert array.dtype == cls.dtype()
    assert array["position"].tolist() == [[2.0, 1.0, -3.0]] * 2
    assert array["velocity"].tolist() == [[0.0, 1.0, 0.0]] * 2
    assert array["yaw"] == pytest.approx(math.pi / 2)
    assert array["timestamp"].tolist() == [7, 8]
    assert np.isnan(array["jerk"]).all()
    odometry = {"pose_frame": 1, "position": np.zeros((0, 3))}
    assert frames.batch_from_ros(px4_types.VehicleOdometry, **odometry).shape == (0,)


def test_a_batch_and_back(px4_types: Any, frames: Any) -> None:
    cls = px4_types.VehicleLocalPosition
    array = cls.decode_batch([cls(x=float(n), y=2.0, z=1.0, heading=0.5).encode() for n in range(3)])
    found = {name: value for name, value in frames.batch_to_ros(cls, array).items() if value.is_valid.all()}
    again = frames.batch_from_ros(cls, **found)
    for name in ("x", "y", "z", "vx", "heading"):
        assert again[name] == pytest.approx(array[name])


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"position": (1.0, 2.0, 3.0)}, ": expected arrays with a row for each sample: from_ros makes one message"),
        ({}, ": expected arrays with a row for each sample: from_ros makes one message"),
        ({"position": [(1.0, 2.0)]}, ".position: expected 3 numbers, got an array of shape (1, 2)"),
        ({"position": [(1.0, 2.0, 3.0), (1.0,)]}, ".position: expected rows of the same length"),
        (
            {"position": np.zeros((2, 2, 3))},
            ".position: expected a row for each sample, got an array of shape (2, 2, 3)",
        ),
        ({"position": np.zeros((2, 3)), "yaw": [1.0]}, ".yaw: expected 2 rows, got an array of shape (1,)"),
        ({"yaw": ["a"]}, ".yaw: expected numbers, got an array of <U1"),
        ({"yaw": [1.0], "timestamp": [1.5]}, ".timestamp: expected an integer, got the float 1.5"),
        ({"yaw": [1.0], "timestamp": -1}, ".timestamp: expected uint64, 0 to 18446744073709551615, got -1"),
        ({"yaw": [1.0], "timestamp": "a"}, ".timestamp: expected uint64, 0 to 18446744073709551615, got 'a'"),
        ({"timestamp_": [1]}, " has no field 'timestamp_', did you mean 'timestamp'?"),
    ],
)
def test_a_batch_of_another_kind_is_an_error(px4_types: Any, frames: Any, values: dict[str, Any], text: str) -> None:
    with pytest.raises((frames.FrameError, KeyError)) as caught:
        frames.batch_from_ros(px4_types.TrajectorySetpoint, **values)
    assert str(caught.value) == f"TrajectorySetpoint{text}"


def test_the_frame_of_a_batch_must_be_expected(px4_types: Any, frames: Any) -> None:
    rates = frames.Quantity(np.zeros((2, 3)), "FLU", "vector")
    with pytest.raises(frames.FrameError, match="position: expected a value in ENU, got one in FLU"):
        frames.batch_from_ros(px4_types.TrajectorySetpoint, position=rates)
    with pytest.raises(frames.FrameError, match="pose_frame differs among the samples"):
        frames.batch_from_ros(px4_types.VehicleOdometry, position=np.zeros((2, 3)), pose_frame=[1, 2])
    with pytest.raises(TypeError, match="expected the class of a message"):
        frames.batch_from_ros(px4_types.TrajectorySetpoint(), yaw=[1.0])
