"""Tests of the recognition of renamed fields by names, comments and units, in both directions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.check.compare.renaming import Candidates, is_renamed, nearest_message
from msggen.definitions.model import Field
from msggen.definitions.parse.definition import parse_message


def fields(text: str) -> list[Field]:
    message, errors = parse_message(text, "msg/A.msg", "A", "px4_msgs")
    assert not [error for error in errors if error.code != "M401"]
    return list(message.fields)


def judged(before: str, after: str, kept: str = "") -> bool:
    """Return whether the first new field is the first old one renamed; check that both directions agree."""
    lost, gained, both = fields(before), fields(after), fields(kept) if kept else []
    forwards = is_renamed(lost[0], gained[0], Candidates(lost, gained, both))
    assert is_renamed(gained[0], lost[0], Candidates(gained, lost, both)) == forwards
    return forwards


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("float32 hagl_max", "float32 hagl_max_z"),
        ("float32 hagl_max", "float32 hagl_max_z\nfloat32 hagl_max_xy"),
        ("uint16 sequence", "uint16 event_sequence"),
        ("float32 covariance", "float32 variance"),
        ("bool arming_terminated", "bool arming_termination"),
        ("float32 estimated_accurancy", "float32 estimated_accuracy"),
        ("float32 height_recieved", "float32 height_received"),
        ("float32 body_rate", "float32 bodyrate"),
        ("float32 vel_x", "float32 velocity_x"),
        ("float32 altitude_sp", "float32 altitude_setpoint"),
        ("bool cs_gps_yaw", "bool cs_gnss_yaw"),
        ("uint8 gimbal_device_compid", "uint8 gimbal_device_id"),
        ("bool manual_lockdown  # Motors stop at once", "bool kill  # motors  stop at once."),
        ("# Heading\nfloat32 yaw  # Turned about the vertical", "float32 heading  # Turned about the vertical"),
        ("float32 alt  # [m]", "float32 alt_cm  # [cm]"),
        ("float32 actual_speed  # [m/s] Over ground", "float32 measured_forward_speed  # [m s^-1] Forward"),
    ],
)
def test_these_are_one_field(before: str, after: str) -> None:
    assert judged(before, after)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("float32 x", "float32 roll"),
        ("float32 x", "float32 y"),
        ("float32 gyro_x", "float32 gyro_y"),
        ("float32 aux1", "float32 aux2"),
        ("float32 attitude", "float32 altitude"),
        ("bool allow_weather_vane", "bool disable_weather_vane"),
        ("bool position_valid", "bool position_invalid"),
        ("bool armed", "bool not_armed"),
        ("float32 yaw", "float32 yaw_rate"),
        ("float32 altitude", "float32 altitude_setpoint"),
        ("float32 flow_compensated_integral", "float32 flow_rate_compensated"),
        ("float32 actual_yaw  # [rad] Seen", "float32 measured_rate_of_yaw  # [rad/s] Seen"),
        ("bool weather_vane  # Turns the nose", "bool weather_vane_disabled  # Turns the nose"),
        ("float32 one  # Unused", "float32 other  # Unused"),
        ("float32 one  # [m] Above the ground now", "float32 other  # [cm] Above the ground now"),
    ],
)
def test_these_are_not(before: str, after: str) -> None:
    assert not judged(before, after)


def test_a_word_that_other_fields_have_too_says_nothing() -> None:
    assert judged("uint8 photo_switch", "uint8 camera_switch")
    assert not judged("uint8 photo_switch", "uint8 camera_switch", kept="uint8 gear_switch")


def test_another_field_may_be_nearer() -> None:
    assert judged("bool condition_attitude_valid", "bool attitude_valid")
    assert not judged("bool condition_attitude_valid", "bool local_attitude_valid\nbool attitude_valid_condition")
    assert not judged("bool yaw_valid_flag\nbool yaw_flag", "bool yaw_flag_now")


def test_the_same_comment_outweighs_a_nearer_name() -> None:
    after = "bool kill  # Motors stop at once\nbool manual_lockdown_switch"
    assert judged("bool manual_lockdown  # Motors stop at once", after)


@pytest.mark.parametrize(
    ("name", "others", "expected"),
    [
        ("A", ["AB", "Rpm"], "AB"),
        ("Px4IoStatus", ["Px4ioStatus"], "Px4ioStatus"),
        ("EscReports", ["EscReport", "EscReportsOld"], "EscReport"),
        ("SensorGps", ["SensorGnss"], "SensorGnss"),
        ("Rpm", ["Wind", "Gripper"], None),
        ("VehicleAttitude", ["VehicleAttitudeSetpoint", "VehicleAttitudeRate"], None),
        ("Rpm", ["RpmSensor"], "RpmSensor"),
        ("EstimatorAidSource1d", ["EstimatorAidSource3d"], None),
        ("Rpm", [], None),
    ],
)
def test_a_message_may_be_the_one_with_the_nearest_name(name: str, others: list[str], expected: str | None) -> None:
    assert nearest_message(name, others) == expected


WORDS = (
    "x",
    "y",
    "1",
    "rate",
    "sp",
    "min",
    "gps",
    "gnss",
    "vel",
    "velocity",
    "valid",
    "invalid",
    "terminated",
    "termination",
    "altitude",
    "attitude",
    "roll",
    "yaw",
)
NAMES = st.lists(st.sampled_from(WORDS), min_size=1, max_size=4).map("_".join)
FIELDS = st.lists(
    st.tuples(NAMES, st.sampled_from(["", "  # [m] Above", "  # [rad]", "  # What it says here"])),
    min_size=1,
    max_size=4,
).map(lambda lines: "".join(f"float32 a_{name}{tags}\n" for name, tags in dict(lines).items()))


@pytest.mark.slow
@given(before=FIELDS, after=FIELDS, kept=FIELDS)
def test_any_fields_are_judged_the_same_both_ways(before: str, after: str, kept: str) -> None:
    judged(before, after, kept)
