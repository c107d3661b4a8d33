"""Tests of the rules about flights: each finds its fault, nothing without it, and says why it cannot say."""

from __future__ import annotations

import lzma
import math
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from msggen import recordings
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import Flight, flight_of
from msggen.analysis.recorded import Recorded
from msggen.analysis.rules.table import FLIGHT
from msggen.cli import main
from msggen.sim.airframes import AIRFRAMES
from support.examined_flights import Values, findings_in, samples_of, write_flight
from support.examples import by_day
from support.repository import shared
from support.written import write_recording

AIR = (4.0, 16.0)
"""When the vehicle is in the air. It is armed from 2 s to 18 s."""
Fields = Mapping[str, Any]


def when(begin: float, end: float, then: Fields, otherwise: Fields) -> Values:
    """Return values that are others for a time."""
    return lambda time: then if begin <= time < end else otherwise


FLOWN: Mapping[str, Values] = {
    "vehicle_status": lambda time: {
        "arming_state": 1 + (2 <= time < 18),
        "vehicle_type": 1,
        "nav_state": 14,
        "nav_state_user_intention": 14,
    },
    "vehicle_land_detected": lambda time: {"landed": not AIR[0] <= time < AIR[1]},
}
"""The topics that tell when a vehicle flies."""


class Case(NamedTuple):
    """A recording with a fault, and one without."""

    rule: str
    bad: Mapping[str, Values]
    text: str
    good: Mapping[str, Values]
    parameters: Mapping[str, float] | None = None
    level: str = "warning"


def flags(name: str, begin: float = 8, end: float = 11, topic: str = "failsafe_flags") -> dict[str, Values]:
    """Return a flag that is set for a time."""
    return {topic: when(begin, end, {name: True}, {name: False})}


def status(**more: Any) -> dict[str, Values]:
    """Return the status of a vehicle that flies, with other values."""
    return {"vehicle_status": lambda time: {**(FLOWN["vehicle_status"](time) or {}), **more}}


def motors(*control: float) -> Fields:
    return {"control": (*control, *[math.nan] * (12 - len(control)))}


def escs(px4_types: Any, online: int = 15, **second: Any) -> Fields:
    each = [px4_types.EscReport(actuator_function=101 + index, esc_rpm=5000) for index in range(12)]
    each[1] = px4_types.EscReport(**{"actuator_function": 102, "esc_rpm": 5000, **second})
    return {"esc_count": 4, "esc_online_flags": online, "esc": tuple(each)}


def place(latitude: float, speed: float = 0.0, eph: float = 0.9) -> Fields:
    return {"latitude_deg": latitude, "longitude_deg": 8.0, "fix_type": 3, "vel_m_s": speed, "eph": eph}


def cell(volts: float, amps: float = 10.0) -> Fields:
    return {"connected": True, "voltage_v": volts * 4, "current_a": amps, "cell_count": 4, "remaining": 0.8}


def local(**more: Any) -> Fields:
    return {"v_z_valid": True, "xy_valid": True, **more}


def sensed(distance: float, speed: float) -> Fields:
    return local(dist_bottom_valid=True, dist_bottom=float(distance), vz=speed)


def failsafe(begin: float, end: float) -> Values:
    """Return the status of a vehicle that flies in Offboard mode, with a failsafe."""
    return lambda time: {
        **(FLOWN["vehicle_status"](time) or {}),
        "nav_state": 4 if begin <= time < end else 14,
        "failsafe": begin <= time < end,
    }


FORWARD: Mapping[str, Values] = {
    "vehicle_status": lambda time: {
        "arming_state": 1 + (2 <= time < 18),
        "vehicle_type": 1 + (9 <= time < 12),
        "is_vtol": True,
        "in_transition_mode": 8 <= time < 9,
    }
}
"""A VTOL that flies forward for a time."""
PLANE: Mapping[str, Values] = {"vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 18), "vehicle_type": 2}}
HOVER = motors(0.5, 0.5, 0.5, 0.5)
ROUGH = {"sensor_combined": lambda time: {"accelerometer_m_s2": (0, 0, -50.0 if 15.35 < time < 15.75 else -9.8)}}
TAP = {"sensor_combined": lambda time: {"accelerometer_m_s2": (0, 0, -80.0 if 15.5 < time < 15.7 else -9.8)}}
IN_AIR = {"vehicle_land_detected": lambda time: {"landed": time < AIR[0]}}
STILL_ARMED = {"vehicle_status": lambda time: {"arming_state": 1 + (time >= 2), "vehicle_type": 1, "nav_state": 14}}


def swing(time: float) -> float:
    """Return a current."""
    return 10 + 8 * math.sin(3 * time)


def cases(px4_types: Any) -> list[Case]:
    """Return a case for each rule that reads topics."""
    healthy = escs(px4_types)
    steady = {"offboard_control_mode": lambda _: {"position": True}}
    high = when(8, 11, {"hgt_test_ratio": 2.5}, {"hgt_test_ratio": 0.2})
    quiet_mag = {"mag_strength_gs": 0.5, "mag_strength_ref_gs": 0.48}
    return [
        Case(
            "LOG_ENDS_IN_AIR",
            {**IN_AIR, **STILL_ARMED},
            "the recording ends in the air",
            {},
            {},
        ),
        Case(
            "IN_FAILSAFE",
            {
                "vehicle_status": lambda time: {"arming_state": 2, "failsafe": 8 <= time < 11, "nav_state": 4},
                **flags("gnss_lost", 7),
            },
            "failsafe for 3.0 s, in mode Hold, because of gnss_lost",
            flags("gnss_lost", 7),
        ),
        Case(  # a recording that begins in a failsafe
            "IN_FAILSAFE",
            {"vehicle_status": failsafe(0, 11), **flags("gnss_lost", 0)},
            "failsafe for 9.0 s, in mode Hold, with gnss_lost set",
            flags("gnss_lost", 0),
        ),
        Case(
            "IN_FAILSAFE",
            {"vehicle_status": failsafe(0, 1)},
            "failsafe for 1.0 s while disarmed",
            {},
            level="info",
        ),
        Case(
            "FLIGHT_STOPPED",
            {"actuator_armed": when(8, 9, {"armed": True, "kill": True}, {"armed": True})},
            "the kill switch stopped the motors in the air",
            {"actuator_armed": lambda time: {"armed": 2 <= time < 18}},
            level="error",
        ),
        Case(
            "FLIGHT_STOPPED",
            {"vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 10), "vehicle_type": 1}},
            "the vehicle was disarmed in the air",
            {},
            level="error",
        ),
        Case(  # a rover always has ground contact, and `landed` follows its disarming
            "FLIGHT_STOPPED",
            {
                "vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 10), "vehicle_type": 2},
                "vehicle_land_detected": lambda time: {"landed": not 4 <= time < 10.5},
            },
            "the vehicle was disarmed in the air",
            {
                "vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 10), "vehicle_type": 3},
                "vehicle_land_detected": lambda time: {"landed": not 2 <= time < 10.5, "ground_contact": time < 4},
            },
            level="error",
        ),
        Case(  # it touches the ground, and disarms before the land detector is certain
            "FLIGHT_STOPPED",
            {"vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 10)}},
            "the vehicle was disarmed in the air",
            {
                "vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 10), "vehicle_type": 1},
                "vehicle_land_detected": lambda time: {"landed": not 2 <= time < 10.5, "ground_contact": time > 9},
            },
            level="error",
        ),
        Case(
            "FAILURE_DETECTED",
            flags("fd_roll", topic="failure_detector_status"),
            "the failure detector reports fd_roll",
            flags("fd_roll", 0, 1, "failure_detector_status"),
            level="error",
        ),
        Case(
            "MANUAL_CONTROL_LOST",
            flags("manual_control_signal_lost"),
            "the remote control was lost for 3.0 s",
            flags("manual_control_signal_lost", 0, 30),
        ),
        Case(
            "GROUND_STATION_LOST",
            flags("gcs_connection_lost"),
            "the ground station was lost for 3.0 s",
            flags("gcs_connection_lost", 0, 30),
            {"NAV_DLL_ACT": 2},
        ),
        Case(
            "GROUND_STATION_LOST",
            flags("gcs_connection_lost"),
            "the ground station was lost for 3.0 s",
            flags("gcs_connection_lost", 18.5, 30),
            level="info",
        ),
        Case(
            "OFFBOARD_LOST",
            flags("offboard_control_signal_lost"),
            "Offboard mode had no setpoints to follow for 3.0 s",
            flags("offboard_control_signal_lost", 0, 1),
        ),
        Case(  # the program stops because the remote control was lost
            "OFFBOARD_LOST",
            {**flags("offboard_control_signal_lost"), "vehicle_status": failsafe(5, 13)},
            "Offboard mode had no setpoints to follow for 3.0 s, after another failsafe began",
            {**flags("offboard_control_signal_lost", 0, 1), "vehicle_status": failsafe(5, 13)},
            level="info",
        ),
        Case(
            "OFFBOARD_LOST",
            {**flags("offboard_control_signal_lost"), "vehicle_status": failsafe(8.5, 13)},
            "Offboard mode had no setpoints to follow for 3.0 s",
            {**flags("offboard_control_signal_lost", 0, 1), "vehicle_status": failsafe(8.5, 13)},
        ),
        Case(
            "SETPOINTS_RARE",
            {"offboard_control_mode": lambda time: None if 8 < time < 9.35 else {"position": True}},
            "the setpoints of a program came late 1 time, by up to 1.4 s",
            steady,
        ),
        Case(
            "VIBRATION_HIGH",
            {"vehicle_imu_status": lambda _: {"accel_vibration_metric": 6.0}},
            "high vibration of IMU 0: up to 6.0 m/s²",
            {"vehicle_imu_status": lambda _: {"accel_vibration_metric": 4.0}},
        ),
        Case(
            "ACCEL_CLIPPED",
            {"vehicle_imu_status": lambda time: {"accel_clipping": (0, 0, int(time > 9) * 12)}},
            "the accelerometer of IMU 0 reached its limit 12 times while armed",
            {"vehicle_imu_status": lambda _: {"accel_clipping": (5, 5, 5)}},
        ),
        Case(
            "INNOVATIONS_REJECTED",
            {"estimator_status": when(8, 11, {"hgt_test_ratio": 2.5}, {"hgt_test_ratio": 0.2})},
            "the estimator rejected the height for 3.0 s, with a test ratio of up to 2.5",
            {"estimator_status": when(8, 8.5, {"hgt_test_ratio": 2.5}, {"hgt_test_ratio": 0.2})},
        ),
        Case(
            "ESTIMATE_RESET",
            {
                "vehicle_local_position": lambda time: local(
                    xy_reset_counter=time > 9, delta_xy=(6.0, 8.0) if time > 9 else (0.0, 0.0)
                )
            },
            "the estimate of the horizontal position jumped 1 time by up to 10.0 m while armed",
            {"vehicle_local_position": lambda time: local(xy_reset_counter=time > 1, delta_xy=(9.0, 9.0))},
        ),
        Case(
            "ESTIMATE_RESET",
            {"vehicle_local_position": lambda time: local(heading_reset_counter=time > 9, delta_heading=0.1)},
            "the estimate of the heading jumped 1 time by up to 5.7 deg while armed",
            {"vehicle_local_position": lambda _: local(heading_reset_counter=3, delta_heading=0.1)},
            level="info",
        ),
        Case(
            "GPS_FIX_LOST",
            {"sensor_gps": when(8, 11, {"fix_type": 1}, {"fix_type": 3})},
            "the GPS had no fix for 3.0 s",
            {"sensor_gps": lambda _: {"fix_type": 0}},
        ),
        Case(
            "GPS_JAMMED",
            {"sensor_gps": when(8, 11, {"fix_type": 3, "jamming_state": 3}, {"fix_type": 3, "jamming_state": 1})},
            "the GPS reports jamming for 3.0 s",
            {"sensor_gps": lambda _: {"fix_type": 3, "jamming_state": 1}},
        ),
        Case(
            "GPS_SPOOFED",
            {"sensor_gps": when(8, 11, {"fix_type": 3, "spoofing_state": 2}, {"fix_type": 3})},
            "the GPS reports spoofing for 3.0 s",
            {"sensor_gps": lambda _: {"fix_type": 3, "spoofing_state": 1}},
            level="error",
        ),
        Case(
            "GPS_JUMPED",
            {"sensor_gps": when(8, 11, place(47.001), place(47.0))},
            "the position of the GPS jumped 2 times, by up to 111 m",
            {"sensor_gps": lambda time: place(47 + time * 9e-5, 10.0)},
        ),
        Case(
            "MAG_DISTURBED",
            {"estimator_status": when(8, 11, {**quiet_mag, "mag_strength_gs": 0.8}, quiet_mag)},
            "the magnetic field was off by up to 0.32 Ga for 3.0 s",
            {"estimator_status": when(1, 3, {**quiet_mag, "mag_strength_gs": 0.8}, quiet_mag)},
        ),
        Case(
            "MAG_DISTURBED",
            flags("cs_mag_field_disturbed", topic="estimator_status_flags"),
            "the estimator found the magnetic field disturbed for 3.0 s",
            flags("cs_mag_field_disturbed", 0, 3, "estimator_status_flags"),
        ),
        Case(
            "MAG_FOLLOWS_THRUST",
            {
                "vehicle_thrust_setpoint": lambda time: {"xyz": (0, 0, -swing(time) / 20)},
                "vehicle_magnetometer": lambda time: {"magnetometer_ga": (0.2, 0, 0.4 + swing(time) / 100)},
            },
            "the magnetic field changes by 0.15 Ga with the thrust (correlation 1.00)",
            {
                "vehicle_thrust_setpoint": lambda time: {"xyz": (0, 0, -swing(time) / 20)},
                "vehicle_magnetometer": lambda time: {"magnetometer_ga": (0.2, 0, 0.4 + swing(time) / 1000)},
            },
        ),
        Case(
            "MOTOR_SATURATED",
            {"actuator_motors": when(8, 11, motors(1, 0.5, 0.5, 0.5), HOVER)},
            "motor 1 was at its limit for 3.0 s, 19 % of the time armed",
            {"actuator_motors": when(8, 8.5, motors(1, 0.5, 0.5, 0.5), HOVER)},
        ),
        Case(
            "MOTOR_STOPPED",
            {"actuator_motors": when(8, 9, motors(0.5, math.nan, 0.5, 0.5), HOVER)},
            "motor 2 was stopped in flight for 1.0 s while others turned",
            {"actuator_motors": when(*AIR, HOVER, motors(0, 0, 0, 0))},
            level="error",
        ),
        Case(
            "ESC_FAILED",
            {"esc_status": when(8, 9, escs(px4_types, failures=1 << 5), healthy)},
            "the ESC of motor 2 reports motor stuck",
            {"esc_status": lambda _: healthy},
            level="error",
        ),
        Case(
            "ESC_FAILED",
            {"esc_status": when(8, 9, escs(px4_types, 13), healthy)},
            "the ESC of motor 2 was offline for 1.0 s",
            {"esc_status": when(0, 30, escs(px4_types, 13), healthy)},
            level="error",
        ),
        Case(
            "ESC_FAILED",
            {"esc_status": when(8, 9, escs(px4_types, esc_rpm=0), healthy), "actuator_motors": lambda _: HOVER},
            "motor 2 stood for 1.0 s in flight, although it was to turn",
            {"esc_status": when(2, 4, escs(px4_types, esc_rpm=0), healthy), "actuator_motors": lambda _: HOVER},
            level="error",
        ),
        Case(
            "BATTERY_LOW",
            {"battery_status": lambda _: {"connected": True, "remaining": 0.25}},
            "the battery fell to 25 %",
            {"battery_status": lambda _: {"connected": True, "remaining": 0.35}},
            {"BAT_LOW_THR": 0.3},
        ),
        Case(
            "BATTERY_SAG",
            {"battery_status": when(8, 11, cell(3.2), cell(3.9))},
            "the voltage of the battery sagged to 3.20 V a cell, below 3.50 V for 3.0 s",
            {"battery_status": when(8, 8.5, cell(3.2), cell(3.9))},
        ),
        Case(
            "BATTERY_RESISTANCE",
            {"battery_status": lambda time: cell(4.1 - 0.03 * swing(time), swing(time))},
            "the battery has 30 mΩ a cell, more than 20 mΩ",
            {"battery_status": lambda time: cell(4.1 - 0.006 * swing(time) - time / 100, swing(time))},
        ),
        Case(
            "SUPPLY_VOLTAGE",
            {"system_power": when(8, 11, {"voltage5v_v": 4.6}, {"voltage5v_v": 5.0})},
            "the rail of 5 V fell to 4.60 V",
            {"system_power": lambda time: {"voltage5v_v": 4.6, "usb_connected": 1} if time < 5 else {"voltage5v_v": 5}},
        ),
        Case(
            "SUPPLY_VOLTAGE",
            {"system_power": when(8, 11, {"voltage5v_v": 5.6}, {"voltage5v_v": 5.0})},
            "the rail of 5 V rose to 5.60 V",
            {"system_power": lambda _: {"voltage5v_v": 0.0}},
        ),
        Case(
            "POWER_LOST",
            {**IN_AIR, **STILL_ARMED, "battery_status": when(19, 30, cell(2.2), cell(3.8))},
            "the recording ends in the air while the battery falls from 15.20 to 8.80 V",
            {**IN_AIR, **STILL_ARMED, "battery_status": lambda _: cell(3.8)},
            level="error",
        ),
        Case(
            "LANDING_HARD",
            {"vehicle_local_position": when(14, 15.7, local(vz=2.4), local(vz=0.1))},
            "the vehicle touched down at 2.4 m/s",
            {"vehicle_local_position": when(6, 13, local(vz=2.4), local(vz=0.7))},
        ),
        Case(
            "LANDING_HARD",
            {"vehicle_local_position": lambda _: local(vz=0.1), **ROUGH},
            "the vehicle touched down with a shock of 50 m/s²",
            {"vehicle_local_position": when(14, 15.7, local(vz=2.4), local(vz=0.1))},
            {"MPC_LAND_SPEED": 1.5},
        ),
        Case(  # PX4 tells the contact 6 s after the touch; one sample of a shock is none
            "LANDING_HARD",
            {"vehicle_local_position": when(7, 10, local(vz=2.4), local(vz=0.1))},
            "the vehicle touched down at 2.4 m/s",
            {"vehicle_local_position": lambda _: local(vz=0.1), **TAP},
        ),
        Case(
            "LANDING_HARD",
            {"vehicle_local_position": lambda time: sensed(max(10 - time, 0), 2.4 if time < 10 else 0.6)},
            "the vehicle touched down at 2.4 m/s",
            {"vehicle_local_position": lambda time: sensed(max(14 - time, 0), 2.4 if time < 12 else 0.6)},
        ),
        Case(  # a plane without a flare
            "LANDING_HARD",
            {"vehicle_local_position": when(14, 15.7, local(vz=2.7), local(vz=0.1)), **PLANE},
            "the vehicle touched down at 2.7 m/s",
            {"vehicle_local_position": when(14, 15.7, local(vz=2.03), local(vz=0.1)), **PLANE},
        ),
        Case(  # disarmed while it descends, and a contact in flight
            "LANDING_HARD",
            {"vehicle_local_position": lambda _: local(vz=2.4)},
            "the vehicle touched down at 2.4 m/s",
            {
                "vehicle_local_position": lambda _: local(vz=2.4),
                "vehicle_status": lambda time: {"arming_state": 1 + (2 <= time < 12), "vehicle_type": 1},
                "vehicle_land_detected": lambda time: {"ground_contact": 8 <= time < 9, "landed": time < 4},
            },
        ),
        Case(
            "WIND_HIGH",
            {"wind": when(8, 11, {"windspeed_north": 9.0, "windspeed_east": 12.0}, {})},
            "the wind reached 15.0 m/s, above 12.0 m/s for 3.0 s",
            {"wind": lambda _: {"windspeed_north": 9.0}},
            {"COM_WIND_WARN": 12.0},
        ),
        Case(
            "CPU_LOAD_HIGH",
            {"cpuload": when(8, 11, {"load": 0.85}, {"load": 0.4})},
            "the load of the CPU reached 85 %",
            {"cpuload": when(8, 9, {"load": 0.85}, {"load": 0.4})},
            {"COM_CPU_MAX": 80.0},
        ),
        Case(
            "MEMORY_LOW",
            {"cpuload": lambda _: {"ram_usage": 0.97}},
            "the used memory reached 97 %",
            {"cpuload": lambda _: {"ram_usage": 0.93}},
            {"COM_RAM_MAX": -1.0},
        ),
        Case(
            "MOTOR_SATURATED",
            {"actuator_motors": when(4, 12, motors(1, 0.5, 0.5, 0.5), HOVER)},
            "motor 1 was at its limit for 8.0 s, 50 % of the time armed",
            {"actuator_motors": lambda _: motors(1, 0.5, 0.5, 0.5), **status(vehicle_type=2)},
        ),
        Case(
            "MOTOR_SATURATED",
            {"actuator_motors": when(4, 7, motors(1, 0.5, 0.5, 0.5, 1), motors(0.5, 0.5, 0.5, 0.5, 1)), **FORWARD},
            "motor 1 was at its limit for 3.0 s, 25 % of the time armed",
            {"actuator_motors": when(8, 12, motors(1, 0.5, 0.5, 0.5, 1), motors(0.5, 0.5, 0.5, 0.5, 1)), **FORWARD},
            {"CA_ROTOR4_AX": 1.0, "CA_ROTOR4_AZ": 0.0},
        ),
        Case(
            "MOTOR_STOPPED",
            {"actuator_motors": when(8, 9, motors(-0.5, 0, -0.5, -0.5), motors(-0.5, -0.5, -0.5, -0.5))},
            "motor 2 was stopped in flight for 1.0 s while others turned",
            {"actuator_motors": when(8, 9, motors(0.5, -1, 0.5, 0.5), HOVER)},
            level="error",
        ),
        Case(
            "ESC_FAILED",
            {"esc_status": when(3, 5, escs(px4_types, failures=1 << 5), healthy)},
            "the ESC of motor 2 reports motor stuck",
            {"esc_status": when(3, 4, escs(px4_types, 13, failures=1), healthy)},
            level="error",
        ),
        Case(
            "ACCEL_CLIPPED",
            {"vehicle_imu_status": lambda time: {"accel_clipping": (9 * (time < 6) + 3 * (time > 9), 0, time > 19)}},
            "the accelerometer of IMU 0 reached its limit 3 times while armed",
            {"vehicle_imu_status": lambda time: {"accel_clipping": (time > 1, 0, time > 19)}},
        ),
        Case(
            "BATTERY_LOW",
            {
                "battery_status": lambda time: {"connected": time >= 1, "remaining": 0.1 * (time >= 1)},
                "battery_status[1]": lambda _: {"connected": True, "remaining": 0.8},
            },
            "battery 1 fell to 10 %",
            {"battery_status": lambda time: {"connected": time >= 1, "remaining": 0.8 * (time >= 1)}},
            {},
        ),
        Case(
            "GPS_FIX_LOST",
            {"sensor_gps": lambda time: None if 8 < time < 11 else {"fix_type": 3}},
            "the GPS sent nothing for 3.0 s",
            {"sensor_gps": lambda time: None if 8 < time < 9.5 or time > 18 else {"fix_type": 3}},
        ),
        Case(
            "GPS_JUMPED",
            {"sensor_gps": lambda time: place(47.001 if 1 <= time < 9 else 47.0, eph=90.0 if time < 6 else 1.0)},
            "the position of the GPS jumped 1 time, by up to 111 m",
            {"sensor_gps": lambda time: place(47.001 if 1 <= time < 9 else 47.0, eph=90.0 if time < 9 else 1.0)},
        ),
        Case(
            "INNOVATIONS_REJECTED",
            {"estimator_status": lambda _: {"hgt_test_ratio": 0.2}, "estimator_status[1]": high},
            "estimator 1 rejected the height for 3.0 s, with a test ratio of up to 2.5",
            {
                "estimator_status": high,
                "estimator_status[1]": lambda _: {"hgt_test_ratio": 0.2},
                "estimator_selector_status": lambda _: {"primary_instance": 1},
            },
            {},
        ),
        Case(
            "MAG_DISTURBED",
            {
                "estimator_status": lambda _: quiet_mag,
                "estimator_status[1]": when(8, 11, {**quiet_mag, "mag_strength_gs": 0.8}, quiet_mag),
                "estimator_selector_status": lambda time: {"primary_instance": time > 6},
            },
            "the magnetic field was off by up to 0.32 Ga for 3.0 s",
            {
                "estimator_status": lambda _: quiet_mag,
                "estimator_status[1]": when(8, 11, {**quiet_mag, "mag_strength_gs": 0.8}, quiet_mag),
                "estimator_selector_status": lambda time: {"primary_instance": time > 12},
            },
            {},
        ),
        Case(
            "ESTIMATE_RESET",
            {
                "vehicle_local_position": lambda time: local(
                    xy_reset_counter=time > 9, delta_xy=(6.0, 8.0) if time > 9 else (0.0, 0.0)
                )
            },
            "the estimate of the horizontal position jumped 1 time by up to 10.0 m while armed",
            {},
            {"COM_POS_FS_EPH": -1.0},
        ),
        Case(
            "MAG_FOLLOWS_THRUST",
            {
                "vehicle_thrust_setpoint": lambda time: {"xyz": (0, 0, -swing(time) / 20)},
                "vehicle_magnetometer": lambda _: {"magnetometer_ga": (0.2, 0, 0.4)},
                "vehicle_magnetometer[1]": lambda time: {"magnetometer_ga": (0.2, 0, 0.4 + swing(time) / 100)},
            },
            "the magnetic field of magnetometer 1 changes by 0.15 Ga with the thrust (correlation 1.00)",
            {},
            {},
        ),
    ]


RULES = {rule.id: rule for rule in FLIGHT}
CASES = 60
"""The number of cases."""


@pytest.mark.parametrize("number", range(CASES))
def test_a_rule_finds_its_fault_and_nothing_without_it(number: int, tmp_path: Path, px4_types: Any) -> None:
    case = cases(px4_types)[number]
    found = findings_in(write_flight(tmp_path / "bad", px4_types, {**FLOWN, **case.bad}, case.parameters))
    (seen,) = [each for each in found.findings if each.rule.id == case.rule]
    assert (seen.text, seen.level) == (case.text, case.level)
    assert seen.time is None or 0 <= seen.time <= 20
    assert all(isinstance(value, str) or math.isfinite(value) for value in seen.values.values())
    found = findings_in(write_flight(tmp_path / "good", px4_types, {**FLOWN, **case.good}, case.parameters))
    assert case.rule not in {each.rule.id for each in found.findings}


def test_there_is_a_case_for_each_rule_about_topics(px4_types: Any) -> None:
    found = cases(px4_types)
    assert len(found) == CASES
    assert {case.rule for case in found} == {rule.id for rule in FLIGHT if rule.needs}


# what cannot be trusted, or is missing


@pytest.fixture(scope="module")
def everything(px4_types: Any) -> dict[str, Values]:
    """Return all topics of the cases. Of several values for a topic, the last ones."""
    found = {topic: values for case in cases(px4_types) for topic, values in case.bad.items() if "[" not in topic}
    return {**FLOWN, **found}


def test_a_rule_without_one_of_its_needs_says_so(tmp_path: Path, px4_types: Any, everything: dict[str, Values]) -> None:
    path = write_flight(tmp_path / "all", px4_types, everything)
    with recordings.open(str(path)) as log:
        for rule in FLIGHT:
            for paths in rule.needs:
                shown = rule.topics - {each.partition(".")[0] for each in paths}
                found = findings_of(Flight(Recorded(log, shown.__contains__)), [rule])
                assert not found.findings
                (silence,) = found.silences
                assert silence.reason.startswith("the recording has no "), rule.id


def test_topics_that_a_rule_reads_are_those_that_it_names(
    tmp_path: Path, px4_types: Any, everything: dict[str, Values]
) -> None:
    """A rule that reads a topic without naming it would not see it where only the topics of the rules are read."""
    path = write_flight(tmp_path / "all", px4_types, everything)
    with recordings.open(str(path)) as log:
        whole = flight_of(log, lambda _: True)
        for rule in FLIGHT:
            assert findings_of(flight_of(log, rule.topics.__contains__), [rule]) == findings_of(whole, [rule]), rule.id


def test_a_vehicle_that_was_never_armed_is_not_said_to_have_flown_well(
    tmp_path: Path, px4_types: Any, everything: dict[str, Values]
) -> None:
    resting: dict[str, Values] = {
        "vehicle_status": lambda _: {"arming_state": 1},
        "actuator_armed": lambda _: {"armed": False},
    }
    found = findings_in(write_flight(tmp_path / "resting", px4_types, {**everything, **resting}))
    unsaid = {each.rule.id for each in found.silences if each.reason == "the vehicle was never armed"}
    told = {rule.id for rule in FLIGHT if rule.needs} - unsaid
    assert told == {"IN_FAILSAFE", "BATTERY_LOW", "CPU_LOAD_HIGH", "MEMORY_LOW"}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38, 0.0])
def test_values_that_are_no_numbers_or_too_large_are_survived(
    value: float, tmp_path: Path, px4_types: Any, everything: dict[str, Values]
) -> None:
    def broken(values: Values) -> Values:
        def made(time: float) -> Any:
            fields = values(time)
            return fields and {name: _broken(each, value) for name, each in fields.items()}

        return made

    path = write_flight(tmp_path / "odd", px4_types, {topic: broken(values) for topic, values in everything.items()})
    check_whole(path)


def _broken(field: Any, value: float) -> Any:
    if isinstance(field, float):
        return value
    is_floats = isinstance(field, tuple) and all(isinstance(each, float) for each in field)
    return tuple(value for _ in field) if is_floats else field


def check_whole(path: Path) -> None:
    """Check that all rules say something, and that their texts are lines."""
    found = findings_in(path)
    told = [*(each.rule for each in found.findings), *(each.rule for each in found.silences), *found.clear]
    assert {rule.id for rule in told} == {rule.id for rule in FLIGHT}
    for each in found.findings:
        assert "\n" not in each.text
        assert each.time is None or math.isfinite(each.time)


def test_a_recording_of_a_fifth_of_a_second_is_examined(
    tmp_path: Path, px4_types: Any, everything: dict[str, Values]
) -> None:
    check_whole(write_flight(tmp_path / "short", px4_types, everything, end=0.2))
    check_whole(write_flight(tmp_path / "one", px4_types, everything, end=0.0))


def test_times_that_jump_are_survived(tmp_path: Path, px4_types: Any, everything: dict[str, Values]) -> None:
    moved = [
        (f"/fmu/out/{topic}", time + (1e8 if time > 10 else -3.0 if 5 < time < 6 else 0.0), message)
        for topic, time, message in samples_of(px4_types, everything)
    ]
    check_whole(write_recording(tmp_path / "moved.mcap", moved))


def test_of_two_vehicles_only_one_is_examined(tmp_path: Path, px4_types: Any) -> None:
    load = [
        (f"/px4_{number}/fmu/out/cpuload", step / 10, px4_types.Cpuload(load=0.99 if number == 2 else 0.1))
        for step in range(100)
        for number in (1, 2)
    ]
    status = [("/px4_1/fmu/out/vehicle_status", 0.5, px4_types.VehicleStatus())]
    found = findings_in(write_recording(tmp_path / "two.mcap", [*load, *status]))
    assert not found.findings


def test_many_short_times_in_the_air_are_examined_at_once(tmp_path: Path, px4_types: Any) -> None:
    hops = {
        "vehicle_status": lambda time: {
            "arming_state": 1 + round(time * 10) % 3 % 2,
            "failsafe": bool(round(time * 10) % 2),
        },
        "vehicle_land_detected": lambda time: {"landed": round(time * 10) % 5 == 0},
        "vehicle_local_position": lambda time: local(vz=5.0, xy_reset_counter=round(time * 10) % 256),
    }
    check_whole(write_flight(tmp_path / "hops", px4_types, hops, end=200.0))


# quiet flights


@by_day("vehicle", AIRFRAMES, 3)
def test_nothing_is_found_in_a_quiet_flight(vehicle: str, tmp_path: Path) -> None:
    assert main(["sim", "--vehicle", vehicle, "--log", str(tmp_path / "a.ulg"), "--quiet"]) == 0
    assert [each for each in findings_in(tmp_path / "a.ulg").findings if each.level != "info"] == []


def test_nothing_is_found_in_a_quiet_flight_of_px4(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(lzma.decompress(shared("oracles/flight/flight.ulg.xz").read_bytes()))
    assert findings_in(path).findings == ()


@by_day(
    ("fault", "rules"),
    [
        ("20:no-gps", {"GPS_FIX_LOST", "IN_FAILSAFE", "OFFBOARD_LOST"}),
        ("20:disturbed-compass", {"MAG_DISTURBED"}),
        ("20:battery=0.04", {"BATTERY_LOW", "BATTERY_SAG"}),
        ("20:weak-battery", {"BATTERY_SAG"}),
    ],
    2,
)
def test_faults_of_a_simulated_vehicle_are_found(fault: str, rules: set[str], tmp_path: Path) -> None:
    assert main(["sim", "--log", str(tmp_path / "a.ulg"), "--quiet", "--fault", fault]) == 0
    assert {each.rule.id for each in findings_in(tmp_path / "a.ulg").findings if each.level != "info"} == rules


def test_jumps_between_two_flights_are_not_told(tmp_path: Path, px4_types: Any) -> None:
    status, local = px4_types.VehicleStatus, px4_types.VehicleLocalPosition
    samples = [
        ("/fmu/out/vehicle_status", float(step), status(arming_state=1 + (step < 5 or step >= 15)))
        for step in range(20)
    ]
    samples += [
        ("/fmu/out/vehicle_local_position", step + 0.5, local(heading_reset_counter=int(step >= 10)))
        for step in range(20)
    ]
    found = findings_in(write_recording(tmp_path / "turned.mcap", samples)).findings
    assert not found


def test_vibration_is_told_from_when_the_vehicle_was_armed(tmp_path: Path, px4_types: Any) -> None:
    shaken, status = px4_types.VehicleImuStatus(accel_vibration_metric=6.0), px4_types.VehicleStatus
    samples = [("/fmu/out/vehicle_imu_status", step / 10, shaken) for step in range(50)]
    samples += [("/fmu/out/vehicle_status", step, status(arming_state=1 + (step > 2))) for step in range(5)]
    found = findings_in(write_recording(tmp_path / "shaken.mcap", samples)).findings
    (seen,) = [each for each in found if "vibration" in each.text]
    assert (seen.level, seen.time) == ("warning", 3.0)


def test_the_time_between_two_flights_does_not_count(tmp_path: Path, px4_types: Any) -> None:
    status, motors = px4_types.VehicleStatus, px4_types.ActuatorMotors
    armed = [2 <= step < 6 or 20 <= step < 24 for step in range(30)]
    samples = [
        ("/fmu/out/vehicle_status", float(step), status(arming_state=1 + each, vehicle_type=1))
        for step, each in enumerate(armed)
    ]
    samples += [
        ("/fmu/out/actuator_motors", step + 0.5, motors(control=(1.0 if each else math.nan, *[math.nan] * 11)))
        for step, each in enumerate(armed)
    ]
    found = findings_in(write_recording(tmp_path / "two.mcap", samples)).findings
    (seen,) = found
    assert (seen.text, seen.time) == ("motor 1 was at its limit for 8.0 s, 100 % of the time armed", 2.5)


def test_a_battery_that_sends_nothing_is_not_said_to_be_full(tmp_path: Path, px4_types: Any) -> None:
    silent: Values = lambda time: cell(3.9) if time < 9 else None  # noqa: E731
    found = findings_in(write_flight(tmp_path / "silent", px4_types, {**FLOWN, "battery_status": silent}))
    reasons = {each.rule.id: each.reason for each in found.silences}
    assert reasons["BATTERY_LOW"] == "the battery was silent for 9.1 s in flight"


def test_a_recording_that_pauses_is_no_gps_that_is_silent(tmp_path: Path, px4_types: Any) -> None:
    def paused(values: Values) -> Values:
        return lambda time: None if 8 < time < 12 else values(time)

    topics = {name: paused(values) for name, values in {**FLOWN, "sensor_gps": lambda _: {"fix_type": 3}}.items()}
    assert not findings_in(write_flight(tmp_path / "paused", px4_types, topics)).findings


def test_a_lost_fix_is_a_finding(tmp_path: Path, px4_types: Any) -> None:
    fix = [0, 0, 3, 3, 2, 2, 3, 3]
    samples = [("/fmu/out/sensor_gps", time, px4_types.SensorGps(fix_type=each)) for time, each in enumerate(fix)]
    found = findings_in(write_recording(tmp_path / "fix.mcap", samples)).findings
    (seen,) = found
    assert (seen.text, seen.time) == ("the GPS had no fix for 2.0 s", 4.0)


def test_a_failsafe_that_begins_with_the_last_sample_counts_if_armed(tmp_path: Path, px4_types: Any) -> None:
    for state, expected in ((2, ("failsafe for 0.0 s", "warning")), (1, ("failsafe for 0.0 s while disarmed", "info"))):
        samples = [
            ("/fmu/out/vehicle_status", float(step), px4_types.VehicleStatus(arming_state=state, failsafe=step == 9))
            for step in range(10)
        ]
        (seen,) = findings_in(write_recording(tmp_path / f"{state}.mcap", samples)).findings
        assert (seen.text.partition(",")[0], seen.level) == expected


@pytest.mark.parametrize(("milliseconds", "level"), [((30,), "info"), ((30, 30, 50), "warning"), ((100,), "warning")])
def test_a_short_dropout_is_a_note(milliseconds: tuple[int, ...], level: str, tmp_path: Path, px4_types: Any) -> None:
    path = write_flight(tmp_path / "short", px4_types, FLOWN, {})
    path.write_bytes(path.read_bytes() + b"".join(struct.pack("<HBH", 2, ord("O"), each) for each in milliseconds))
    (seen,) = [each for each in findings_in(path).findings if each.rule.id == "LOG_DROPOUTS"]
    assert (seen.level, seen.values["limit_s"]) == (level, 0.1)


def moved(by: Callable[[float], float], path: Path, px4_types: Any, skipped: tuple[float, float] = (0, 0)) -> list[str]:
    """Return what is said about times that a function moves, without the samples of a time."""
    samples = [
        (f"/fmu/out/{topic}", time + by(time), message)
        for topic, time, message in samples_of(px4_types, FLOWN)
        if not skipped[0] <= time < skipped[1]
    ]
    path.unlink(missing_ok=True)
    found = findings_in(write_recording(path, samples)).findings
    assert {each.level for each in found if each.rule.id == "LOG_TIME_JUMPS"} <= {"warning"}
    return [each.text for each in found if each.rule.id == "LOG_TIME_JUMPS"]


BACK = "the log times step back 1 time, by up to 4.9 s"


def test_times_that_jump_are_a_finding(tmp_path: Path, px4_types: Any) -> None:
    path = tmp_path / "moved.mcap"
    assert moved(lambda time: -5.0 * (time >= 8), path, px4_types) == [BACK]
    assert moved(lambda time: -5.0 * (8 <= time < 12) + 3600 * (time >= 12), path, px4_types) == [
        BACK,
        "no topic has a sample for up to 3604.1 s, 1 time",
    ]
    assert moved(lambda _: 0.0, path, px4_types, (4, 13)) == []
    assert moved(lambda _: 0.0, path, px4_types, (4, 15)) == ["no topic has a sample for up to 11.1 s, 1 time"]
    assert moved(lambda time: -0.5 * (time >= 8), path, px4_types) == []


def test_a_gap_in_which_another_topic_goes_on_is_none(tmp_path: Path, px4_types: Any) -> None:
    samples = [
        ("/fmu/out/vehicle_status", step / 10, px4_types.VehicleStatus()) for step in range(400) if not 50 < step < 300
    ]
    other = [("/fmu/out/cpuload", float(step), px4_types.Cpuload()) for step in range(0, 40, 8)]
    rare = [("/fmu/out/cpuload", step * 60.0, px4_types.Cpuload()) for step in range(9)]
    for name, each in (("other", [*samples, *other]), ("rare", rare), ("one", rare[:1])):
        found = findings_in(write_recording(tmp_path / f"{name}.mcap", each)).findings
        assert "LOG_TIME_JUMPS" not in {each.rule.id for each in found}


def test_a_closed_recording_does_not_tell_its_times(tmp_path: Path, px4_types: Any) -> None:
    path = write_flight(tmp_path / "closed", px4_types, FLOWN)
    with recordings.open(str(path)) as log:
        flight = flight_of(log, lambda _: True)
    found = findings_of(flight, [RULES["LOG_TIME_JUMPS"]])
    assert [each.reason for each in found.silences] == [f"the times cannot be read: {path} is closed"]
