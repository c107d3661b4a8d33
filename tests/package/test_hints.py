"""Tests of errors about names: each suggests the right name once, wherever it was misspelt."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import Any

import pytest

from support.catalogs import catalog_of, import_package

NOT_BRIDGED = ": 'esc_status' is a uORB topic that does not cross the bridge: it is not in dds_topics.yaml"


OTHER = "another definition? If so, build a package of it: msggen's docs/package.md, Recordings"


def refused(error: type[Exception], function: Any, *arguments: object) -> str:
    """Return the text of the error that a call raises."""
    with pytest.raises(error) as caught:
        function(*arguments)
    return str(caught.value)


def meant(name: str) -> str:
    return f", did you mean '{name}'?"


@pytest.mark.parametrize(
    ("direction", "name", "hint"),
    [
        ("out", "trajectory_setpoint", meant("in_.trajectory_setpoint")),
        ("in_", "vehicle_status", meant("out.vehicle_status")),
        ("in_", "VehicleStatus", meant("out.vehicle_status")),
        ("out", "VehicleStatus", meant("out.vehicle_status")),
        ("out", "esc_status", NOT_BRIDGED),
        ("out", "EscStatus", NOT_BRIDGED),
        ("out", "vehicle_statuss", meant("out.vehicle_status")),
        ("out", "zzzz", ""),
    ],
)
def test_a_wrong_attribute_names_the_right_one(direction: str, name: str, hint: str, px4_types: Any) -> None:
    side = getattr(px4_types.topics, direction)
    assert refused(AttributeError, getattr, side, name) == f"no endpoint '{direction}.{name}'{hint}"


def test_a_package_without_endpoints_says_why(tmp_path: Path) -> None:
    types = import_package(catalog_of(tmp_path, {"Rpm.msg": "uint64 timestamp\n"}), tmp_path)
    why = ": the package has no endpoints, because it was built without a dds_topics.yaml: name one with --topics"
    for name in ("rpm", "Rpm", "zzzz"):
        assert refused(AttributeError, getattr, types.topics.out, name) == f"no endpoint 'out.{name}'{why}"
        assert refused(KeyError, types.topics.endpoint, f"/fmu/out/{name}") == f"no endpoint '/fmu/out/{name}'{why}"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("wind", meant("/fmu/out/wind")),
        ("VehicleStatus", meant("/fmu/out/vehicle_status_v4")),
        ("vehicle_statuss", meant("/fmu/out/vehicle_status_v4")),
        ("mode_completed", ": there are '/fmu/out/mode_completed', '/fmu/in/mode_completed'"),
        ("esc_status", NOT_BRIDGED),
        ("/uav_1/fmu/out/esc_status", NOT_BRIDGED),
        ("/fmu/in/vehicle_status", meant("/fmu/out/vehicle_status_v4")),
        ("/uav_1/fmu/in/vehicle_status", meant("/uav_1/fmu/out/vehicle_status_v4")),
        ("/uav_1/fmu/out/vehicle_stats_v4", meant("/uav_1/fmu/out/vehicle_status_v4")),
        ("/a/b/fmu/out/vehicle_stats_v4", meant("/a/b/fmu/out/vehicle_status_v4")),
        ("rt/uav_1/fmu/out/vehicle_stats_v4", meant("rt/uav_1/fmu/out/vehicle_status_v4")),
        ("uav_1/fmu/out/vehicle_status_v4", meant("/uav_1/fmu/out/vehicle_status_v4")),
        ("fmu/out/wind", meant("/fmu/out/wind")),
        ("/fmuu/out/wind", meant("/fmu/out/wind")),
        ("/a b/fmu/out/wind", meant("/fmu/out/wind")),
        ("/", ""),
        ("rt/", ""),
        ("fmu", ""),
    ],
)
def test_a_wrong_endpoint_names_the_right_one(name: str, hint: str, px4_types: Any) -> None:
    topics = px4_types.topics
    for find in (topics.endpoint, topics.versions_of):
        assert refused(KeyError, find, name) == f"no endpoint '{name}'{hint}"


def test_a_topic_with_instances_is_found_by_its_name(tmp_path: Path) -> None:
    entry = "  - topic: /fmu/out/gps\n    type: px4_msgs::msg::Gps\n"
    bridge = f"publications:\n{entry}    instance: 0\n{entry}    instance: 1\n"
    package: Any = import_package(
        catalog_of(tmp_path / "in", {"msg/Gps.msg": "uint64 timestamp\n", "dds_topics.yaml": bridge}), tmp_path
    )
    assert refused(AttributeError, getattr, package.topics.out, "gps") == f"no endpoint 'out.gps'{meant('out.gps0')}"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("px4_msgs/msg/esc_status", meant("px4_msgs/msg/EscStatus")),
        ("px4_msgs::msg::EscStatus", meant("px4_msgs/msg/EscStatus")),
        ("SENSORCOMBINED", meant("px4_msgs/msg/SensorCombined")),
        ("EscStatus", meant("px4_msgs/msg/EscStatus")),
        ("VehicleCommand", meant("px4_msgs/msg/VehicleCommand")),
        ("px4_msgs/srv/VehicleCommand", meant("px4_msgs/srv/VehicleCommand_Request")),
        ("px4_msgs/srv/vehicle_command", meant("px4_msgs/srv/VehicleCommand_Request")),
        ("VehicleStatusV3", ": the package has version 4, 'msggen build --archived' adds earlier ones"),
        ("px4_msgs/msg/VehicleStatusV3", ": the package has version 4, 'msggen build --archived' adds earlier ones"),
        ("px4_msgs/msg/VehicleStatusV4", meant("px4_msgs/msg/VehicleStatus")),
        ("px4_msgs/msg/EscStatusV1", meant("px4_msgs/msg/EscStatus")),
        ("px4_msgs/os/path", ""),
    ],
)
def test_a_wrong_type_names_the_right_one(name: str, hint: str, px4_types: Any) -> None:
    assert refused(KeyError, px4_types.by_type, name) == f"no message type '{name}'{hint}"


def test_a_field_is_found_by_its_name(px4_types: Any) -> None:
    info = px4_types.SensorCombined.__msg__
    assert [info.field(field.name) for field in info.fields] == list(info.fields)
    assert refused(KeyError, info.field, "GyroRad") == f"SensorCombined has no field 'GyroRad'{meant('gyro_rad')}"
    assert refused(KeyError, info.field, "zzzz") == "SensorCombined has no field 'zzzz'"


def test_a_name_that_is_not_a_str_is_a_type_error(px4_types: Any) -> None:
    topics = px4_types.topics
    assert refused(TypeError, topics.endpoint, topics.ENDPOINTS[0]).endswith(", got an object of type Endpoint")
    assert refused(TypeError, topics.versions_of, None).startswith("expected a name such as '/fmu/out/")
    assert refused(TypeError, topics.namespaced, 1) == "expected a name such as 'uav_1', got an object of type int"
    expected = "expected a name such as 'px4_msgs/msg/Name', got the class EscStatus"
    assert refused(TypeError, px4_types.by_type, px4_types.EscStatus) == expected
    assert refused(TypeError, px4_types.EscStatus.__msg__.field, 0).startswith("expected a name such as 'timestamp'")


def test_a_direction_says_what_it_is(px4_types: Any) -> None:
    topics = px4_types.topics
    assert repr(topics.out) == f"<topics.out: {len(topics.out)} endpoints, listed by dir()>"
    assert (*topics.out, *topics.in_) == topics.ENDPOINTS
    assert len(topics.out) + len(topics.in_) == len(topics.ENDPOINTS)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("vehicle_statu", meant("vehicle_status")),
        ("VehicleStatus", meant("vehicle_status")),
        ("/fmu/out/vehicle_status", meant("vehicle_status")),
        ("zzzz", ""),
    ],
)
def test_a_wrong_topic_names_the_right_one(name: str, hint: str, px4_types: Any) -> None:
    topics = px4_types.topics
    for table in (topics.UORB, topics.ORB_ID):
        assert refused(KeyError, table.__class__.__getitem__, table, name) == f"no uORB topic '{name}'{hint}"
    assert refused(TypeError, topics.UORB.__getitem__, 5).startswith("expected a name such as 'vehicle_status'")
    assert (topics.UORB.get(name), name in topics.UORB) == (None, False)
    assert topics.ORB_ID["vehicle_status"] is topics.ORB_ID.vehicle_status


@pytest.mark.parametrize(
    ("name", "hint"),
    [("topic", meant("topics")), ("batches", meant("batch")), ("EscStatu", meant("EscStatus")), ("zzzz", "")],
)
def test_a_wrong_name_in_the_package_names_the_right_one(name: str, hint: str, px4_types: Any) -> None:
    text = f"module 'px4_types' has no attribute '{name}'{hint}"
    assert refused(AttributeError, getattr, px4_types, name) == text


def test_a_suffix_is_the_version_of_a_message(px4_types: Any) -> None:
    for name in ("vehicle_status", "vehicle_status_v1", "vehicle_status_v9"):
        text = refused(KeyError, px4_types.topics.endpoint, f"/uav_1/fmu/out/{name}")
        assert text == (
            f"no endpoint '/uav_1/fmu/out/{name}': the suffix is the version of the message, and this package has only "
            "'/uav_1/fmu/out/vehicle_status_v4'; another version needs a package of its release"
        )


def test_columns_of_an_array_are_not_those_of_a_class(px4_types: Any) -> None:
    array_ = px4_types.EscStatus.decode_batch([])
    assert (
        refused(TypeError, px4_types.batch.units, array_) == "expected a message class, got an object of type ndarray"
    )


def test_a_sample_without_a_header_is_told_so(px4_types: Any) -> None:
    data = px4_types.SensorCombined(timestamp=0x1234).encode()[4:]
    expected = "SensorCombined: expected the encapsulation header 00 01, 00 00, 00 07 or 00 06, got 34 12: no header?"
    assert refused(px4_types.DecodeError, px4_types.SensorCombined.decode, data) == expected


@pytest.mark.parametrize("method", ["decode", "lazy"])
def test_what_is_not_bytes_names_the_message(method: str, px4_types: Any) -> None:
    cls = px4_types.SensorCombined
    assert refused(TypeError, getattr(cls, method), "abc") == "SensorCombined: expected a bytes-like object, got str"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"hello", 'expected 127 bytes, got 5: pad it with .ljust(127, b"\\0")'),
        (bytearray(126), 'expected 127 bytes, got 126: pad it with .ljust(127, b"\\0")'),
        (bytes(128), "expected 127 bytes, got 128"),
        ("hello", """expected 127 bytes, got 'hello': use its .encode().ljust(127, b"\\0")"""),
        ("é" * 64, f"expected 127 bytes, got '{'é' * 56}...: use its .encode()"),
        ([0] * 127, "expected 127 bytes, got a list of 127: use bytes([...])"),
        (array("B", [0] * 127), "expected 127 bytes, got an array of 127: use bytes(values.tolist())"),
        (None, "expected 127 bytes, got None"),
    ],
)
def test_text_that_is_too_short_is_told_how_to_pad(text: Any, problem: str, px4_types: Any) -> None:
    assert refused(px4_types.EncodeError, px4_types.LogMessage(text=text).encode) == f"LogMessage.text: {problem}"


def test_a_sample_of_another_size_may_be_of_another_definition(px4_types: Any) -> None:
    data = px4_types.EscStatus().encode()
    short = refused(px4_types.DecodeError, px4_types.EscStatus.decode, data[:335])
    expected = "EscStatus.esc: expected 491 bytes after the header, got 331: truncated, or of " + OTHER
    assert short == expected
    assert refused(px4_types.DecodeError, px4_types.EscStatus.decode_batch, [data[:335]]) == f"sample 0: {expected}"
    assert refused(px4_types.DecodeError, px4_types.EscStatus.decode, data + bytes(9)).endswith(f": {OTHER}")
