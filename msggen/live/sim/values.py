"""The fields of the messages that a simulated vehicle publishes, by the name of the message.

Releases differ in their fields. `Filler` takes those that a message has, and leaves the others at zero. Messages that
are not listed have only their times.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

from msggen.live.sim.flight import NAN, Target
from msggen.live.sim.world import (
    ALTITUDE,
    HOLD,
    LANDING,
    MANUAL,
    MODES,
    OFFBOARD,
    PLACED,
    POSITION,
    STABILIZED,
    TAKING_OFF,
    World,
)

Values: TypeAlias = Mapping[str, Any]

_PILOTED = {MANUAL, ALTITUDE, POSITION, STABILIZED}
_AUTOMATIC = {HOLD, TAKING_OFF, LANDING}
_HOVER = 0.5
"""The share of the full thrust that holds the vehicle: MPC_THR_HOVER."""
_MOTORS = 4
_MOVING = 0.1
"""The speed in m/s above which the land detector reports movement."""


class Clocks(NamedTuple):
    """The last exchange of the time synchronisation, in us. PX4 reports the offset of its clock to the agent's."""

    remote: int = 0
    observed: int = 0
    estimated: int = 0
    round_trip: int = 0


class Scene(NamedTuple):
    """All that messages tell."""

    world: World
    noise: random.Random
    clocks: Clocks = Clocks()


class Filler:
    """Makes messages of a class."""

    def __init__(self, message: Any) -> None:
        """Take the class of a message in a generated package."""
        names = frozenset(field.name for field in message.__msg__.fields)
        self.message = message
        self.is_sampled = "timestamp_sample" in names
        """Whether messages have a second time, of the sensors."""
        self._names = names
        self._values = VALUES.get(message.__name__)

    def make(self, scene: Scene, time: int) -> Any:
        """Return a message of a time, in us."""
        values = self._values(scene) if self._values else {}
        made = self.message(**{name: value for name, value in values.items() if name in self._names})
        made.timestamp = time
        if self.is_sampled:
            made.timestamp_sample = time
        return made


def _vehicle_status(scene: Scene) -> Values:
    world = scene.world
    modes = sum(1 << mode for mode in MODES)
    return {
        "armed_time": world.armed_time,
        "takeoff_time": world.takeoff_time,
        "arming_state": 2 if world.is_armed else 1,
        "latest_arming_reason": world.arming_reason,
        "latest_disarming_reason": world.disarming_reason,
        "nav_state_timestamp": world.mode_time,
        "nav_state_user_intention": world.intention,
        "nav_state": world.mode,
        "nav_state_display": world.mode,
        "accepts_offboard_setpoints": world.mode == OFFBOARD,
        "valid_nav_states_mask": modes,
        "can_set_nav_states_mask": modes,
        "vehicle_type": 1,
        "failsafe": world.failsafe,
        "gcs_connection_lost": True,
        "system_type": 2,
        "system_id": world.system_id,
        "component_id": 1,
        "safety_off": True,
        "power_input_valid": True,
        "pre_flight_checks_pass": not world.why_unarmable,
    }


def _vehicle_local_position(scene: Scene) -> Values:
    flight, home, valid = scene.world.flight, scene.world.home, scene.world.has_position
    x, y, z = flight.position
    vx, vy, vz = flight.velocity
    ax, ay, az = flight.acceleration
    return {
        "xy_valid": valid, "z_valid": True, "v_xy_valid": valid, "v_z_valid": True,
        "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz, "z_deriv": vz, "ax": ax, "ay": ay, "az": az,
        "heading": flight.heading, "heading_var": 0.001, "unaided_heading": NAN, "heading_good_for_control": True,
        "xy_global": valid, "z_global": True, "ref_lat": home.latitude, "ref_lon": home.longitude,
        "ref_alt": home.altitude, "dist_bottom": max(0.0, -z), "eph": 0.3, "epv": 0.4, "evh": 0.1, "evv": 0.1,
        "vxy_max": math.inf, "vz_max": math.inf, "hagl_min": math.inf, "hagl_max": math.inf, "hagl_max_z": math.inf,
        "hagl_max_xy": math.inf,
    }  # fmt: skip


def _vehicle_odometry(scene: Scene) -> Values:
    flight = scene.world.flight
    return {
        "pose_frame": 1,  # POSE_FRAME_NED
        "position": flight.position,
        "q": flight.quaternion,
        "velocity_frame": 1,  # VELOCITY_FRAME_NED
        "velocity": flight.velocity,
        "angular_velocity": flight.rates,
        "position_variance": (0.01, 0.01, 0.02),
        "orientation_variance": (0.0001, 0.0001, 0.001),
        "velocity_variance": (0.01, 0.01, 0.01),
    }


def _vehicle_attitude(scene: Scene) -> Values:
    return {"q": scene.world.flight.quaternion, "delta_q_reset": (1.0, 0.0, 0.0, 0.0)}


def _vehicle_global_position(scene: Scene) -> Values:
    world = scene.world
    return {
        "lat": world.latitude,
        "lon": world.longitude,
        "alt": world.altitude,
        "alt_ellipsoid": world.altitude + 47.0,
        "lat_lon_valid": world.has_position,
        "alt_valid": True,
        "eph": 0.3,
        "epv": 0.4,
        "terrain_alt": world.home.altitude,
        "terrain_alt_valid": True,
    }


def _sensor_gps(scene: Scene) -> Values:
    world = scene.world
    north, east, down = world.flight.velocity
    speed = math.hypot(north, east)
    millimetres = round(world.altitude * 1e3)
    return {
        "device_id": 11468804,
        "latitude_deg": world.latitude,
        "longitude_deg": world.longitude,
        "altitude_msl_m": world.altitude,
        "altitude_ellipsoid_m": world.altitude + 47.0,
        "lat": round(world.latitude * 1e7),
        "lon": round(world.longitude * 1e7),
        "alt": millimetres,
        "alt_ellipsoid": millimetres + 47_000,
        "s_variance_m_s": 0.1,
        "c_variance_rad": 0.1,
        "fix_type": 3,  # FIX_TYPE_3D
        "eph": 0.8,
        "epv": 1.2,
        "hdop": 0.7,
        "vdop": 1.1,
        "jamming_state": 1,  # JAMMING_STATE_OK
        "spoofing_state": 1,  # SPOOFING_STATE_OK
        "vel_m_s": speed,
        "vel_n_m_s": north,
        "vel_e_m_s": east,
        "vel_d_m_s": down,
        "cog_rad": math.atan2(east, north),
        "vel_ned_valid": True,
        "time_utc_usec": scene.clocks.remote,
        "satellites_used": 14,
        "heading": NAN,
        "heading_offset": NAN,
    }


def _sensor_combined(scene: Scene) -> Values:
    flight, noise = scene.world.flight, scene.noise.gauss
    turn, force = flight.rates, flight.specific_force
    return {
        "gyro_rad": (turn[0] + noise(0.0, 0.001), turn[1] + noise(0.0, 0.001), turn[2] + noise(0.0, 0.001)),
        "gyro_integral_dt": 4000,
        "accelerometer_m_s2": (force[0] + noise(0.0, 0.02), force[1] + noise(0.0, 0.02), force[2] + noise(0.0, 0.02)),
        "accelerometer_integral_dt": 4000,
    }


def _battery_status(scene: Scene) -> Values:
    battery = scene.world.battery
    voltage, cells = battery.voltage, battery.cells
    left = battery.remaining * battery.capacity
    return {
        "connected": True,
        "voltage_v": voltage,
        "voltage_filtered_v": voltage,
        "current_a": battery.current,
        "current_filtered_a": battery.current,
        "current_average_a": battery.current,
        "discharged_mah": battery.discharged,
        "remaining": battery.remaining,
        "scale": 1.0,
        "time_remaining_s": left * 3.6 / battery.current,
        "temperature": battery.temperature,
        "cell_count": cells,
        "capacity": round(battery.capacity),
        "id": 1,
        "voltage_cell_v": (voltage / cells,) * cells + (0.0,) * (14 - cells),
        "is_required": True,
        "warning": battery.warning,
        "nominal_voltage": 3.7 * cells,
    }


def _vehicle_land_detected(scene: Scene) -> Values:
    world, flight = scene.world, scene.world.flight
    north, east, down = flight.velocity
    landed = world.is_landed
    return {
        "freefall": not world.is_armed and not landed,
        "ground_contact": landed,
        "maybe_landed": landed,
        "landed": landed,
        "in_ground_effect": not landed and flight.position[2] > -1.0,
        "in_descend": down > _MOVING,
        "has_low_throttle": landed,
        "vertical_movement": abs(down) > _MOVING,
        "horizontal_movement": math.hypot(north, east) > _MOVING,
        "rotational_movement": max(map(abs, flight.rates)) > _MOVING,
        "close_to_ground_or_skipped_check": flight.position[2] > -1.0,
        "at_rest": landed,
    }


def _vehicle_control_mode(scene: Scene) -> Values:
    world = scene.world
    stabilized = world.mode != MANUAL
    height = stabilized and world.mode != STABILIZED
    place = height and world.mode != ALTITUDE
    return {
        "flag_armed": world.is_armed,
        "flag_multicopter_position_control_enabled": place,
        "flag_control_manual_enabled": world.mode in _PILOTED,
        "flag_control_auto_enabled": world.mode in _AUTOMATIC,
        "flag_control_offboard_enabled": world.mode == OFFBOARD,
        "flag_control_rates_enabled": True,
        "flag_control_attitude_enabled": True,
        "flag_control_velocity_enabled": place,
        "flag_control_position_enabled": place,
        "flag_control_altitude_enabled": height,
        "flag_control_climb_rate_enabled": height,
        "flag_control_allocation_enabled": True,
    }


def _failsafe_flags(scene: Scene) -> Values:
    world = scene.world
    placed = (*PLACED, OFFBOARD) if world.controls_position else PLACED
    return {
        "mode_req_angular_velocity": 0xFFFFFFFF,
        "mode_req_attitude": 0xFFFFFFFF & ~(1 << MANUAL),
        "mode_req_local_position": sum(1 << mode for mode in placed),
        "mode_req_offboard_signal": 1 << OFFBOARD,
        "mode_req_manual_control": sum(1 << mode for mode in _PILOTED),
        "local_position_invalid": not world.has_position,
        "global_position_invalid": not world.has_position,
        "auto_mission_missing": True,
        "offboard_control_signal_lost": not world.has_offboard_signal(world.time),
        "manual_control_signal_lost": True,
        "gcs_connection_lost": True,
        "battery_warning": world.battery.warning,
    }


def _home_position(scene: Scene) -> Values:
    home = scene.world.home
    place = {"lat": home.latitude, "lon": home.longitude, "alt": home.altitude}
    return {**place, "valid_alt": True, "valid_hpos": True, "valid_lpos": True, "update_count": 1}


def _estimator_status_flags(scene: Scene) -> Values:
    landed = scene.world.is_landed
    steady = ("cs_tilt_align", "cs_yaw_align", "cs_mag_hdg", "cs_mag", "cs_baro_hgt", "cs_gps_hgt", "cs_gps")
    satellites = ("cs_gnss_pos", "cs_gnss_vel")
    flags = dict.fromkeys((*steady, *satellites), True)
    return {**flags, "cs_in_air": not landed, "cs_vehicle_at_rest": landed}


def _timesync_status(scene: Scene) -> Values:
    clocks = scene.clocks
    return {
        "source_protocol": 2,  # SOURCE_PROTOCOL_DDS
        "remote_timestamp": clocks.remote,
        "observed_offset": clocks.observed,
        "estimated_offset": clocks.estimated,
        "round_trip_time": clocks.round_trip,
    }


def _vehicle_local_position_setpoint(scene: Scene) -> Values:
    target = scene.world.target or Target()
    names = ("x", "y", "z", "vx", "vy", "vz")
    return {
        **dict(zip(names, (*target.position, *target.velocity), strict=True)),
        "acceleration": target.acceleration,
        "thrust": (0.0, 0.0, -_HOVER * scene.world.thrust),
        "yaw": target.yaw,
        "yawspeed": target.yaw_rate,
    }


def _actuator_motors(scene: Scene) -> Values:
    each, noise = _HOVER * scene.world.thrust, scene.noise.gauss
    motors = tuple(max(0.0, each + noise(0.0, 0.01)) if each else NAN for _ in range(_MOTORS))
    return {"control": motors + (NAN,) * (12 - _MOTORS)}


def _wind(_: Scene) -> Values:
    return {"windspeed_north": 1.5, "windspeed_east": -0.8, "variance_north": 0.3, "variance_east": 0.3}


def _airspeed_validated(_: Scene) -> Values:
    names = ("indicated", "calibrated", "true")
    return {**{f"{name}_airspeed_m_s": NAN for name in names}, "airspeed_source": -1, "selected_airspeed_index": -1}


def _gimbal_device_attitude_status(scene: Scene) -> Values:
    return {"q": (1.0, 0.0, 0.0, 0.0), "target_system": scene.world.system_id, "gimbal_device_id": 1}


def _input_rc(_: Scene) -> Values:
    return {"rc_lost": True, "rssi": -1, "link_quality": -1, "rssi_dbm": NAN}


VALUES: Mapping[str, Callable[[Scene], Values]] = {
    "ActuatorMotors": _actuator_motors,
    "AirspeedValidated": _airspeed_validated,
    "BatteryStatus": _battery_status,
    "EstimatorStatusFlags": _estimator_status_flags,
    "FailsafeFlags": _failsafe_flags,
    "GimbalDeviceAttitudeStatus": _gimbal_device_attitude_status,
    "HomePosition": _home_position,
    "InputRc": _input_rc,
    "SensorCombined": _sensor_combined,
    "SensorGps": _sensor_gps,
    "TimesyncStatus": _timesync_status,
    "VehicleAttitude": _vehicle_attitude,
    "VehicleControlMode": _vehicle_control_mode,
    "VehicleGlobalPosition": _vehicle_global_position,
    "VehicleLandDetected": _vehicle_land_detected,
    "VehicleLocalPosition": _vehicle_local_position,
    "VehicleLocalPositionSetpoint": _vehicle_local_position_setpoint,
    "VehicleOdometry": _vehicle_odometry,
    "VehicleStatus": _vehicle_status,
    "Wind": _wind,
}
