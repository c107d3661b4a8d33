"""The fields of the messages that a simulated vehicle publishes, by the name of the message.

Releases differ in their fields. `Filler` takes those that a message has, and leaves the others at zero. Messages that
are not listed have only their times.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

from msggen.messages.nav_states import (
    ALTITUDE,
    ARMED,
    DESCEND,
    DISARMED,
    EXTERNAL,
    HOLD,
    LAND,
    MANUAL,
    OFFBOARD,
    POSITION,
    RETURN,
    STABILIZED,
    TAKEOFF,
    TERMINATION,
)
from msggen.messages.refusals import REQUIREMENTS
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, VtolState
from msggen.sim.battery import Battery
from msggen.sim.commander.setpoint_types import ALL, Controls
from msggen.sim.disturbances import Noise
from msggen.sim.external import EPV, EVH, EVV, HEADING_VARIANCE
from msggen.sim.flight import NAN, Target, wrapped
from msggen.sim.parts import POWER_MODULE
from msggen.sim.wings import Wings
from msggen.sim.world import World

Values: TypeAlias = Mapping[str, Any]

_PILOTED = {MANUAL, ALTITUDE, POSITION, STABILIZED}
_AUTOMATIC = {HOLD, RETURN, TAKEOFF, LAND, DESCEND}
_VALID_MODES = 0x7FFEE5FF
"""The modes that PX4 v1.18 has on a multicopter, with those of programs, as bits."""
_WIND_LIMITED = 0x280098
"""Those that end in too much wind or at the end of the flight time, as bits."""
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
_MOVING, _DESCENT, _TURNING = 0.1, 0.33, 0.35
"""The speeds in m/s and the rate in rad/s above which the land detector reports movement, a descent and a rotation."""
_START = 636_000
"""When the estimator found its origin, in us since boot."""
_UNAIDED = 0.05
"""How far the heading without a magnetometer is off, in rad."""
_PLACE, _SPEED, _PULL, _TURN, _HEADING = 0.001, 0.015, 0.06, 0.006, 0.0005
"""The noise of estimates, as standard deviations in m, m/s, m/s^2, rad/s and rad: those of PX4's simulator at rest."""
_GYRO, _FORCE = 0.007, 0.07
"""That of the sensors, in rad/s and m/s^2."""
_WIND, _AIRSPEED, _LEAST_AIRSPEED = 0.03, 0.2, 0.1
"""That of the wind and of the airspeed in m/s, and the least airspeed that a sensor tells."""
_CRUISE, _CLIMB = 0.6, 0.06
"""The throttle of level forward flight, and that for a height rate of 1 m/s: as captured from PX4's simulator."""
_GPS_PLACE, _GPS_HEIGHT, _GPS_SPEED = 2e-7, 0.03, 0.025
"""That of GPS, in degrees, m and m/s."""
_XY_RESETS, _Z_RESETS, _VXY_RESETS, _VZ_RESETS, _HEADING_RESETS = 4, 2, 3, 1, 1
"""How often the estimator has been reset since boot, before the vehicle can fly."""


class Clocks(NamedTuple):
    """The last exchange of the time synchronisation, in us. PX4 reports the offset of its clock to the agent's."""

    remote: int = 0
    observed: int = 0
    estimated: int = 0
    round_trip: int = 0


class Scene(NamedTuple):
    """All that messages tell."""

    world: World
    noise: Noise
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
        self._has_others = False
        """Whether there have been values of fields that only other releases have."""
        self._values = VALUES.get(message.__name__)

    def make(self, scene: Scene, time: int) -> Any:
        """Return a message of a time, in us, or None if there is nothing to tell yet."""
        values = self._values(scene) if self._values else {}
        return None if values is None else self.filled(values, time)

    def filled(self, values: Values, time: int) -> Any:
        """Return a message with those of some values that it has, of a time in us."""
        if self._has_others:
            values = {name: value for name, value in values.items() if name in self._names}
        try:
            made = self.message(**values)
        except TypeError:
            if self._has_others:
                raise
            self._has_others = True
            return self.filled(values, time)
        made.timestamp = time
        if self.is_sampled:
            made.timestamp_sample = time
        return made


def _vehicle_status(scene: Scene) -> Values:
    commander, battery = scene.world.commander, scene.world.battery
    failsafe, airframe, state = commander.failsafe, commander.airframe, commander.vtol_state
    return {
        "armed_time": commander.armed_time,
        "takeoff_time": commander.takeoff_time,
        "arming_state": ARMED if commander.is_armed else DISARMED,
        "latest_arming_reason": commander.arming_reason,
        "latest_disarming_reason": commander.disarming_reason,
        "nav_state_timestamp": commander.mode_time,
        "nav_state_user_intention": commander.intention,
        "nav_state": commander.mode,
        "nav_state_display": commander.displayed,
        "executor_in_charge": commander.executor_in_charge,
        "accepts_offboard_setpoints": commander.mode == OFFBOARD,
        "valid_nav_states_mask": _VALID_MODES,
        "can_set_nav_states_mask": commander.components.selectable,
        "vehicle_type": commander.vehicle_type,
        "is_vtol": airframe.is_vtol,
        "is_vtol_tailsitter": airframe.is_tailsitter,
        "in_transition_mode": state is not None and state.is_transition,
        "in_transition_to_fw": state is VtolState.TO_FORWARD,
        "failsafe": failsafe.is_active,
        "failsafe_and_user_took_over": failsafe.user_took_over,
        "failsafe_defer_state": failsafe.defer_state,
        "gcs_connection_lost": not scene.world.has_ground_station,
        "battery_warning": battery.warning,
        "system_type": airframe.system_type,
        "system_id": scene.world.system_id,
        "component_id": 1,
        "safety_button_available": True,
        "safety_off": True,
        "power_input_valid": True,
        "pre_flight_checks_pass": commander.is_ready,
    }


def _vehicle_local_position(scene: Scene) -> Values:
    world, noise = scene.world, scene.noise
    flight, origin, valid, resets = world.flight, world.origin, world.has_position, world.position_resets
    external = world.external
    x, y, z = flight.position
    vx, vy, vz = flight.velocity
    ax, ay, az = flight.acceleration
    north, east = flight.gust
    heading = flight.yaw + _HEADING * noise()
    return {
        "xy_valid": valid, "z_valid": True, "v_xy_valid": valid, "v_z_valid": True,
        "x": x + _PLACE * noise(), "y": y + _PLACE * noise(), "z": z + _PLACE * noise(),
        "xy_reset_counter": (_XY_RESETS + resets + external.position_resets) & 0xFF, "delta_xy": external.move,
        "delta_z": -origin.altitude if external.drop is None else external.drop,
        "z_reset_counter": (_Z_RESETS + external.height_resets) & 0xFF,
        "vx": vx + _SPEED * noise(), "vy": vy + _SPEED * noise(), "vz": vz + _SPEED * noise(), "z_deriv": vz,
        "delta_vxy": (0.0106, 0.0052), "vxy_reset_counter": _VXY_RESETS + resets, "delta_vz": 0.0003,
        "vz_reset_counter": _VZ_RESETS,
        "ax": ax + north + _PULL * noise(), "ay": ay + east + _PULL * noise(), "az": az + _PULL * noise(),
        "heading": wrapped(heading), "heading_var": HEADING_VARIANCE, "heading_good_for_control": True,
        "unaided_heading": wrapped(heading - _UNAIDED), "delta_heading": -0.0123,
        "heading_reset_counter": (_HEADING_RESETS + external.heading_resets) & 0xFF, "tilt_var": 0.00007,
        "xy_global": world.has_global, "z_global": True, "ref_timestamp": _START,
        "ref_lat": origin.latitude if flight.has_origin else NAN,
        "ref_lon": origin.longitude if flight.has_origin else NAN, "ref_alt": origin.altitude,
        "dead_reckoning": not external.is_aided,
        "dist_bottom_valid": True, "dist_bottom": max(0.0, flight.ground - z), "dist_bottom_var": 0.0008,
        "delta_dist_bottom": -origin.altitude, "dist_bottom_reset_counter": _Z_RESETS, "dist_bottom_sensor_bitfield": 1,
        "eph": external.accuracy, "epv": EPV, "evh": EVH, "evv": EVV,
        "vxy_max": math.inf, "vz_max": math.inf, "hagl_min": math.inf, "hagl_max": math.inf, "hagl_max_z": math.inf,
        "hagl_max_xy": math.inf,
    }  # fmt: skip


def _vehicle_odometry(scene: Scene) -> Values:
    world, noise = scene.world, scene.noise
    flight, external = world.flight, world.external
    (x, y, z), (vx, vy, vz), (p, q, r) = flight.position, flight.velocity, flight.rates
    counters = _XY_RESETS, _Z_RESETS, _VXY_RESETS, _VZ_RESETS, _HEADING_RESETS
    return {
        "pose_frame": 1,  # POSE_FRAME_NED
        "position": (x + _PLACE * noise(), y + _PLACE * noise(), z + _PLACE * noise()),
        "q": flight.quaternion,
        "velocity_frame": 1,  # VELOCITY_FRAME_NED
        "velocity": (vx + _SPEED * noise(), vy + _SPEED * noise(), vz + _SPEED * noise()),
        "angular_velocity": (p + _TURN * noise(), q + _TURN * noise(), r + _TURN * noise()),
        "position_variance": (0.04, 0.04, 0.003),
        "orientation_variance": (0.00003, 0.00005, 0.0006),
        "velocity_variance": (0.009, 0.009, 0.001),
        "reset_counter": (
            sum(counters)
            + 2 * world.position_resets
            + external.position_resets
            + external.height_resets
            + external.heading_resets
        )
        & 0xFF,
    }


def _vehicle_attitude(scene: Scene) -> Values:
    return {
        "q": scene.world.flight.quaternion,
        "delta_q_reset": (1.0, 0.0, 0.0, 0.0),
        "quat_reset_counter": _HEADING_RESETS,
    }


def _vehicle_global_position(scene: Scene) -> Values:
    world = scene.world
    place, origin = world.place, world.origin
    return {
        "lat": place.latitude,
        "lon": place.longitude,
        "alt": place.altitude,
        "alt_ellipsoid": place.altitude + 47.0,
        "lat_lon_valid": world.has_global,
        "alt_valid": True,
        "delta_alt": origin.altitude,
        "delta_terrain": origin.altitude,
        "lat_lon_reset_counter": (_XY_RESETS + world.position_resets + world.external.position_resets) & 0xFF,
        "alt_reset_counter": _Z_RESETS,
        "terrain_reset_counter": _Z_RESETS,
        "eph": world.external.accuracy,
        "epv": EPV,
        "terrain_alt": origin.altitude - world.flight.ground,
        "terrain_alt_valid": True,
    }


def _sensor_gps(scene: Scene) -> Values:
    world, noise = scene.world, scene.noise
    place = world.place
    latitude, longitude = place.latitude + _GPS_PLACE * noise(), place.longitude + _GPS_PLACE * noise()
    altitude = place.altitude + _GPS_HEIGHT * noise()
    north, east, down = (speed + _GPS_SPEED * noise() for speed in world.flight.velocity)
    millimetres = round(altitude * 1e3)
    return {
        "device_id": 11468804,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "altitude_msl_m": altitude,
        "altitude_ellipsoid_m": altitude + 47.0,
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "alt": millimetres,
        "alt_ellipsoid": millimetres + 47_000,
        "s_variance_m_s": 0.4,
        "c_variance_rad": 0.1,
        "fix_type": 3 if world.has_gps else 1,  # FIX_TYPE_3D, FIX_TYPE_NONE
        "eph": 0.9,
        "epv": 1.78,
        "hdop": 0.7,
        "vdop": 1.1,
        "vel_m_s": math.hypot(north, east),
        "vel_n_m_s": north,
        "vel_e_m_s": east,
        "vel_d_m_s": down,
        "cog_rad": math.atan2(east, north),
        "vel_ned_valid": True,
        "time_utc_usec": scene.clocks.remote,
        "satellites_used": 10 if world.has_gps else 0,
        "heading": NAN,
        "heading_offset": NAN,
    }


def _sensor_combined(scene: Scene) -> Values:
    flight, noise = scene.world.flight, scene.noise
    (p, q, r), (x, y, z) = flight.rates, flight.specific_force
    return {
        "gyro_rad": (p + _GYRO * noise(), q + _GYRO * noise(), r + _GYRO * noise()),
        "gyro_integral_dt": 4000,
        "accelerometer_m_s2": (x + _FORCE * noise(), y + _FORCE * noise(), z + _FORCE * noise()),
        "accelerometer_integral_dt": 4000,
        "gyro_calibration_count": 1,
    }


def _battery_status(scene: Scene) -> Values:
    battery = scene.world.battery
    found = {
        "connected": True,
        "voltage_v": battery.voltage,
        "voltage_filtered_v": battery.voltage,
        "current_a": -1.0,
        "current_filtered_a": -1.0,
        "current_average_a": -1.0,
        "remaining": battery.remaining,
        "scale": 1.0,
        "time_remaining_s": NAN,
        "temperature": NAN,
        "cell_count": battery.cells,
        "id": 1,
        "warning": battery.warning,
        "remaining_capacity_wh": NAN,
        "nominal_voltage": NAN,
        "internal_resistance_estimate": 0.005,
        "ocv_estimate": battery.voltage,
        "ocv_estimate_filtered": 16.18,
        "volt_based_soc_estimate": 0.989,
        "estimation_covariance_norm": 6.013,
    }
    return {**found, **_measured(battery)} if POWER_MODULE in scene.world.parts else found


def _measured(battery: Battery) -> Values:
    """Return what a power module adds."""
    cells, left = battery.cells, battery.remaining * battery.capacity
    return {
        "current_a": battery.current,
        "current_filtered_a": battery.current,
        "current_average_a": battery.current,
        "discharged_mah": battery.discharged,
        "time_remaining_s": left * 3.6 / battery.current,
        "temperature": battery.temperature,
        "capacity": round(battery.capacity),
        "voltage_cell_v": (battery.voltage / cells,) * cells + (0.0,) * (14 - cells),
        "is_required": True,
        "nominal_voltage": 3.7 * cells,
    }


def _vehicle_land_detected(scene: Scene) -> Values:
    world, landing = scene.world, scene.world.landing
    found = {
        "freefall": not world.is_armed and not landing.landed,
        "ground_contact": landing.ground_contact,
        "maybe_landed": landing.maybe_landed,
        "landed": landing.landed,
        "at_rest": landing.landed and not world.is_armed,
    }
    return {**found, **_rotors_land(world)} if world.airframe.vehicle_type == ROTARY_WING else found


def _rotors_land(world: World) -> Values:
    """Return what the land detector of a multicopter and of a VTOL tells beside."""
    flight, contact = world.flight, world.landing.ground_contact
    north, east, down = flight.velocity
    is_low, is_forward = flight.ground - flight.position[2] < _LOW, world.vtol_state is VtolState.FORWARD
    return {
        "in_ground_effect": not world.is_landed and is_low,
        "in_descend": world.is_landed or (down > _DESCENT and not is_forward),
        "has_low_throttle": contact or is_forward,
        "vertical_movement": abs(down) > _MOVING,
        "horizontal_movement": math.hypot(north, east) > _MOVING,
        "rotational_movement": max(map(abs, flight.rates)) > _TURNING and not is_forward,
        "close_to_ground_or_skipped_check": is_low,
    }


def _vehicle_control_mode(scene: Scene) -> Values:
    commander = scene.world.commander
    mode = commander.mode
    controls = commander.controls if mode in EXTERNAL else _LEVELS.get(mode, ALL)
    return {
        "source_id": mode,
        "flag_armed": commander.is_armed,
        "flag_multicopter_position_control_enabled": (
            commander.vehicle_type == ROTARY_WING and not controls.isdisjoint({"velocity", "climb_rate"})
        ),
        "flag_control_manual_enabled": mode in _PILOTED,
        "flag_control_auto_enabled": mode in _AUTOMATIC,
        "flag_control_offboard_enabled": mode == OFFBOARD,
        **{f"flag_control_{name}_enabled": True for name in controls},
    }


def _failsafe_flags(scene: Scene) -> Values:
    commander = scene.world.commander
    senses = commander.senses
    return {
        **{f"mode_req_{name}": mask for name, mask in commander.requirements.masks.items()},
        **{flag: not getattr(senses, name) for name, (flag, _) in REQUIREMENTS.items()},
        "local_velocity_invalid": not senses.local_position,
        "gcs_connection_lost": not senses.ground_station,
        "battery_warning": senses.battery,
        "fd_critical_failure": senses.has_fallen,
        "mode_req_wind_and_flight_time_compliance": _WIND_LIMITED,
        "remote_id_unhealthy": True,  # as of every vehicle without a remote id
    }


def _home_position(scene: Scene) -> Values | None:
    home, valid = scene.world.home, scene.world.has_home
    if not valid:
        return None
    x, y, z = scene.world.origin.local(home)
    place = {"lat": home.latitude, "lon": home.longitude, "alt": home.altitude, "x": x, "y": y, "z": z}
    return {
        **place,
        "valid_alt": True,
        "valid_hpos": True,
        "valid_lpos": True,
        "update_count": scene.world.home_changes,
    }


_CONTROL_CHANGES = 44
"""How often the flags have changed before the vehicle can fly."""
_STEADY = (
    *("cs_tilt_align", "cs_yaw_align", "cs_mag_3d", "cs_mag", "cs_mag_heading_consistent", "cs_heading_observable"),
    *("cs_baro_hgt", "cs_rng_kin_consistent", "cs_rng_terrain"),
)
_BY_GPS = ("cs_gps_hgt", "cs_gnss_pos", "cs_gnss_vel", "cs_gps")
"""The flags that need GPS. The last one is the name of two of them before v1.17."""


def _estimator_status_flags(scene: Scene) -> Values:
    world = scene.world
    landed, has_wings = world.is_landed, isinstance(world.flight, Wings) and world.flight.is_flying_by_wings
    flags = dict.fromkeys(_STEADY, True) | dict.fromkeys(_BY_GPS, world.has_gps and world.external.uses_gps)
    return {
        **flags,
        **world.external.flags,
        "control_status_changes": _CONTROL_CHANGES + world.control_changes + world.external.changes,
        "cs_mag_field_disturbed": world.is_compass_disturbed,
        "cs_fixed_wing": world.commander.vehicle_type == FIXED_WING,
        "cs_in_transition": world.vtol_state is not None and world.vtol_state.is_transition,
        "cs_wind": world.has_flown_by_wings,
        "cs_fuse_beta": has_wings and not landed,
        "cs_fuse_aspd": has_wings and not landed,
        "cs_rng_hgt": world.uses_range,
        "cs_mag_dec": landed,
        "cs_mag_aligned_in_flight": not landed,
        "cs_in_air": not landed,
        "cs_gnd_effect": not landed and world.flight.ground - world.flight.position[2] < _LOW,
        "cs_vehicle_at_rest": landed and not world.is_armed,
    }


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
    each, noise = _HOVER * scene.world.thrust, scene.noise
    motors = tuple(max(0.0, each + 0.01 * noise()) if each else NAN for _ in range(_MOTORS))
    return {"control": motors + (NAN,) * (12 - _MOTORS)}


def _wind(scene: Scene) -> Values | None:
    flight = scene.world.flight
    if not isinstance(flight, Wings):
        return {"windspeed_north": 1.5, "windspeed_east": -0.8, "variance_north": 0.3, "variance_east": 0.3}
    if not scene.world.has_flown_by_wings:
        return None
    (north, east), noise = flight.wind, scene.noise
    speeds = {"windspeed_north": north + _WIND * noise(), "windspeed_east": east + _WIND * noise()}
    return {**speeds, "variance_north": 0.1, "variance_east": 0.1}


def _airspeed_validated(scene: Scene) -> Values:
    flight, names = scene.world.flight, ("indicated", "calibrated", "true")
    if not isinstance(flight, Wings):
        return {**{f"{name}_airspeed_m_s": NAN for name in names}, "airspeed_source": -1, "selected_airspeed_index": -1}
    speed = max(_LEAST_AIRSPEED, flight.airspeed + _AIRSPEED * scene.noise())
    return {
        **{f"{name}_airspeed_m_s": speed for name in names},
        "airspeed_source": 1,  # SOURCE_SENSOR_1
        "selected_airspeed_index": 1,
        "airspeed_sensor_measurement_valid": True,
        "calibrated_ground_minus_wind_m_s": speed if scene.world.has_flown_by_wings else NAN,
        "calibraded_airspeed_synth_m_s": flight.trim,
        "throttle_filtered": _throttle(flight),
    }


def _throttle(flight: Wings) -> float:
    """Return the throttle of forward flight."""
    climb = -flight.velocity[2]
    return max(0.0, min(1.0, _CRUISE + _CLIMB * climb)) if flight.is_flying_by_wings else 0.0


def _vtol_vehicle_status(scene: Scene) -> Values:
    world = scene.world
    return {"vehicle_vtol_state": world.vtol_state or 0, "fixed_wing_system_failure": world.wings_failed}


def _gimbal_device_attitude_status(scene: Scene) -> Values:
    return {"q": (1.0, 0.0, 0.0, 0.0), "target_system": scene.world.system_id, "gimbal_device_id": 1}


def _input_rc(scene: Scene) -> Values:
    return {"rc_lost": not scene.world.has_sticks, "rssi": -1, "link_quality": -1, "rssi_dbm": NAN}


def _manual_control_setpoint(scene: Scene) -> Values:
    return {"valid": scene.world.has_sticks, "data_source": int(scene.world.has_sticks)}  # SOURCE_RC


VALUES: Mapping[str, Callable[[Scene], Values | None]] = {
    "ActuatorMotors": _actuator_motors,
    "AirspeedValidated": _airspeed_validated,
    "BatteryStatus": _battery_status,
    "EstimatorStatusFlags": _estimator_status_flags,
    "FailsafeFlags": _failsafe_flags,
    "GimbalDeviceAttitudeStatus": _gimbal_device_attitude_status,
    "HomePosition": _home_position,
    "InputRc": _input_rc,
    "ManualControlSetpoint": _manual_control_setpoint,
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
    "VtolVehicleStatus": _vtol_vehicle_status,
    "Wind": _wind,
}
