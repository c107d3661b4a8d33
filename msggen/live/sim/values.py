"""The fields of the messages that a simulated vehicle publishes, by the name of the message.

Releases differ in their fields. `Filler` takes those that a message has, and leaves the others at zero. Messages that
are not listed have only their times.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

from msggen.live.messages.nav_states import (
    ALTITUDE,
    DESCEND,
    EXTERNAL,
    HOLD,
    LAND,
    MANUAL,
    MODE_NAMES,
    OFFBOARD,
    RETURN,
    STABILIZED,
    TAKEOFF,
    TERMINATION,
)
from msggen.live.sim.commander.setpoint_types import ALL, Controls
from msggen.live.sim.commander.states import PILOTED
from msggen.live.sim.flight import NAN, Target
from msggen.live.sim.world import World

Values: TypeAlias = Mapping[str, Any]

_AUTOMATIC = {HOLD, RETURN, TAKEOFF, LAND, DESCEND}
_OWN_MODES = sum(1 << mode for mode in MODE_NAMES if mode not in EXTERNAL)
_EXTERNAL_MODES = sum(1 << mode for mode in EXTERNAL)
_RATES: Controls = frozenset({"allocation", "rates"})
_LEVELS: Mapping[int, Controls] = {
    MANUAL: _RATES | {"attitude"},
    STABILIZED: _RATES | {"attitude"},
    ALTITUDE: _RATES | {"attitude", "altitude", "climb_rate"},
    DESCEND: _RATES | {"attitude", "climb_rate"},
    TERMINATION: frozenset(),
}
"""What is controlled in the modes of PX4 that do not control the position."""
_HOVER = 0.5
"""The share of the full thrust that holds the vehicle: MPC_THR_HOVER."""
_MOTORS = 4
_LOW = 1.0
"""The height in m below which the vehicle is close to the ground."""
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
        return self.filled(values, time)

    def filled(self, values: Values, time: int) -> Any:
        """Return a message with those of some values that it has, of a time in us."""
        made = self.message(**{name: value for name, value in values.items() if name in self._names})
        made.timestamp = time
        if self.is_sampled:
            made.timestamp_sample = time
        return made


def _vehicle_status(scene: Scene) -> Values:
    commander, battery = scene.world.commander, scene.world.battery
    failsafe = commander.failsafe
    return {
        "armed_time": commander.armed_time,
        "takeoff_time": commander.takeoff_time,
        "arming_state": 2 if commander.is_armed else 1,
        "latest_arming_reason": commander.arming_reason,
        "latest_disarming_reason": commander.disarming_reason,
        "nav_state_timestamp": commander.mode_time,
        "nav_state_user_intention": commander.intention,
        "nav_state": commander.mode,
        "nav_state_display": commander.displayed,
        "executor_in_charge": commander.executor_in_charge,
        "accepts_offboard_setpoints": commander.mode == OFFBOARD,
        "valid_nav_states_mask": _OWN_MODES | _EXTERNAL_MODES,
        "can_set_nav_states_mask": commander.selectable,
        "vehicle_type": 1,
        "failsafe": failsafe.is_active,
        "failsafe_and_user_took_over": failsafe.user_took_over,
        "failsafe_defer_state": failsafe.defer_state,
        "gcs_connection_lost": not scene.world.has_ground_station,
        "battery_warning": battery.warning,
        "system_type": 2,
        "system_id": scene.world.system_id,
        "component_id": 1,
        "safety_off": True,
        "power_input_valid": True,
        "pre_flight_checks_pass": commander.is_ready,
    }


def _vehicle_local_position(scene: Scene) -> Values:
    flight, origin, valid = scene.world.flight, scene.world.origin, scene.world.has_position
    x, y, z = flight.position
    vx, vy, vz = flight.velocity
    ax, ay, az = flight.acceleration
    return {
        "xy_valid": valid, "z_valid": True, "v_xy_valid": valid, "v_z_valid": True,
        "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz, "z_deriv": vz, "ax": ax, "ay": ay, "az": az,
        "heading": flight.heading, "heading_var": 0.001, "unaided_heading": NAN, "heading_good_for_control": True,
        "xy_global": valid, "z_global": True, "ref_lat": origin.latitude, "ref_lon": origin.longitude,
        "ref_alt": origin.altitude, "dist_bottom": max(0.0, flight.ground - z),
        "eph": 0.3, "epv": 0.4, "evh": 0.1, "evv": 0.1,
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
    landing = world.landing
    landed, is_low = landing.landed, flight.ground - flight.position[2] < _LOW
    return {
        "freefall": not world.is_armed and not landed,
        "ground_contact": landing.ground_contact,
        "maybe_landed": landing.maybe_landed,
        "landed": landed,
        "in_ground_effect": not landed and is_low,
        "in_descend": down > _MOVING,
        "has_low_throttle": landed,
        "vertical_movement": abs(down) > _MOVING,
        "horizontal_movement": math.hypot(north, east) > _MOVING,
        "rotational_movement": max(map(abs, flight.rates)) > _MOVING,
        "close_to_ground_or_skipped_check": is_low,
        "at_rest": landed,
    }


def _vehicle_control_mode(scene: Scene) -> Values:
    commander = scene.world.commander
    mode = commander.mode
    controls = commander.controls if mode in EXTERNAL else _LEVELS.get(mode, ALL)
    return {
        "source_id": mode,
        "flag_armed": commander.is_armed,
        "flag_multicopter_position_control_enabled": "velocity" in controls or "climb_rate" in controls,
        "flag_control_manual_enabled": mode in PILOTED,
        "flag_control_auto_enabled": mode in _AUTOMATIC,
        "flag_control_offboard_enabled": mode == OFFBOARD,
        **{f"flag_control_{name}_enabled": True for name in controls},
    }


def _failsafe_flags(scene: Scene) -> Values:
    commander = scene.world.commander
    senses = commander.senses
    return {
        **{f"mode_req_{name}": mask for name, mask in commander.requirements.masks.items()},
        "angular_velocity_invalid": not senses.angular_velocity,
        "attitude_invalid": not senses.attitude,
        "local_altitude_invalid": not senses.local_alt,
        "local_position_invalid": not senses.local_position,
        "local_position_invalid_relaxed": not senses.local_position_relaxed,
        "local_velocity_invalid": not senses.local_position,
        "global_position_invalid": not senses.global_position,
        "global_position_invalid_relaxed": not senses.global_position_relaxed,
        "home_position_invalid": not senses.home_position,
        "auto_mission_missing": not senses.mission,
        "offboard_control_signal_lost": not senses.offboard_signal,
        "manual_control_signal_lost": not senses.manual_control,
        "gcs_connection_lost": not senses.ground_station,
        "battery_warning": senses.battery,
    }


def _home_position(scene: Scene) -> Values:
    home, valid = scene.world.home, scene.world.has_home
    x, y, z = scene.world.origin.local(home)
    place = {"lat": home.latitude, "lon": home.longitude, "alt": home.altitude, "x": x, "y": y, "z": z}
    return {**place, "valid_alt": valid, "valid_hpos": valid, "valid_lpos": valid, "update_count": 1}


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
