"""What PX4's list for Zenoh, `src/modules/zenoh/dds_topics.yaml`, does not have of that for DDS. v1.17 and v1.18."""

from __future__ import annotations

from typing import Final

ABSENT: Final = frozenset(
    {
        "/fmu/in/fixed_wing_lateral_setpoint",
        "/fmu/in/fixed_wing_longitudinal_setpoint",
        "/fmu/in/landing_gear",
        "/fmu/in/lateral_control_configuration",
        "/fmu/in/longitudinal_control_configuration",
        "/fmu/in/message_format_request",
        "/fmu/in/rover_attitude_setpoint",
        "/fmu/in/rover_position_setpoint",
        "/fmu/in/rover_rate_setpoint",
        "/fmu/in/rover_speed_setpoint",
        "/fmu/in/rover_steering_setpoint",
        "/fmu/in/rover_throttle_setpoint",
        "/fmu/out/gimbal_device_attitude_status",
        "/fmu/out/home_position",
        "/fmu/out/input_rc",
        "/fmu/out/message_format_response",
        "/fmu/out/transponder_report",
        "/fmu/out/vtol_vehicle_status",
        "/fmu/out/vtx",
        "/fmu/out/wind",
    }
)
"""The names without namespace and version. All others of DDS are there, and no further ones."""

SMALL_STACK: Final = (
    "PX4's module zenoh has a stack that is too small for large messages to it, such as ArmingCheckReply of flight "
    "modes (PX4 28306): try on the ground whether the vehicle survives a registration, or use its uxrce_dds_client"
)
"""What everybody should know who lets modes fly over Zenoh."""
