"""Tests of what PX4's list for Zenoh does not have: compared with the lists of the releases."""

from __future__ import annotations

import pytest

from msggen.messages.firmware import releases
from msggen.messages.names import stem_of
from msggen.messages.zenoh_topics import ABSENT

OUT = (
    "register_ext_component_reply arming_check_request mode_completed battery_status collision_constraints "
    "estimator_status_flags failsafe_flags manual_control_setpoint position_setpoint_triplet sensor_combined "
    "timesync_status vehicle_land_detected vehicle_attitude vehicle_control_mode vehicle_command_ack "
    "vehicle_global_position vehicle_gps_position vehicle_local_position vehicle_odometry vehicle_status "
    "airspeed_validated"
)
IN = (
    "register_ext_component_request unregister_ext_component config_overrides_request arming_check_reply "
    "mode_completed distance_sensor manual_control_input offboard_control_mode onboard_computer_status "
    "obstacle_distance sensor_optical_flow goto_setpoint telemetry_status trajectory_setpoint "
    "vehicle_attitude_setpoint vehicle_mocap_odometry vehicle_rates_setpoint vehicle_visual_odometry vehicle_command "
    "vehicle_command_mode_executor vehicle_thrust_setpoint vehicle_torque_setpoint actuator_motors actuator_servos "
    "aux_global_position"
)
"""What both releases have."""
V1_17 = {"/fmu/in/config_control_setpoints"}
V1_18 = {"/fmu/out/setpoint_config_reply", "/fmu/out/config_overrides_confirm", "/fmu/in/setpoint_config"}


@pytest.mark.parametrize(("release", "further", "count"), [("v1.17", V1_17, 47), ("v1.18", V1_18, 49)])
def test_the_list_of_a_release_is_that_of_dds_without_these(release: str, further: set[str], count: int) -> None:
    """`src/modules/zenoh/dds_topics.yaml` of PX4 has these topics."""
    expected = {f"/fmu/out/{name}" for name in OUT.split()} | {f"/fmu/in/{name}" for name in IN.split()} | further
    found = {stem_of(name) for name in releases()[release]} - ABSENT
    assert found == expected
    assert len(found) == count
