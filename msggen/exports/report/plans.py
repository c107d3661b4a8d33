"""The charts of a report, as a table: what each one shows, and from which topics."""

from __future__ import annotations

from typing import Any, NamedTuple

from msggen.analysis.motion import TOPICS as MOTION
from msggen.analysis.response import LOOPS


class Field(NamedTuple):
    """A line of a chart. `paths` are where it can be from: the first that the recording has."""

    label: str
    paths: tuple[str, ...]
    is_setpoint: bool = False
    valid: str = ""
    """The field of the same topic that is true where the values can be used."""
    is_each: bool = False
    """Whether there is a line for each instance of the topic, and each element of an array."""
    scale: float = 1.0
    unknown: float | None = None
    """The value that stands for an unknown one."""


class Plan(NamedTuple):
    """A chart."""

    title: str
    unit: str
    fields: tuple[Field, ...]
    instead_of: tuple[str, ...] = ()
    """The charts of the group without which it is drawn. Default: it always is."""


class Group(NamedTuple):
    """Charts below one heading."""

    title: str
    plans: tuple[Plan, ...]


_LOCAL, _ODOMETRY = "vehicle_local_position", "vehicle_odometry"
_POSITION_SETPOINT, _TRAJECTORY = "vehicle_local_position_setpoint", "trajectory_setpoint"


def _plan(title: str, unit: str, *fields: Field, instead_of: tuple[str, ...] = ()) -> Plan:
    return Plan(title, unit, fields, instead_of)


def _line(label: str, *paths: str, **more: Any) -> Field:
    return Field(label, paths, **more)


def _each(label: str, *paths: str, **more: Any) -> Field:
    """Return the lines of each instance of a topic, and of each element of an array."""
    return Field(label, paths, is_each=True, **more)


def _tracked(own: tuple[str, ...], setpoint: tuple[str, ...], valid: str = "", scale: float = 1.0) -> tuple[Field, ...]:
    """Return the lines of an estimate and its setpoint."""
    return Field("estimate", own, valid=valid, scale=scale), Field("setpoint", setpoint, is_setpoint=True, scale=scale)


def _position(axis: str, place: int) -> tuple[Field, ...]:
    own = f"{_LOCAL}.{axis}", f"{_ODOMETRY}.position[{place}]", f"{_ODOMETRY}.{axis}"
    setpoint = f"{_POSITION_SETPOINT}.{axis}", f"{_TRAJECTORY}.position[{place}]", f"{_TRAJECTORY}.{axis}"
    valid = "z_valid" if axis == "z" else "xy_valid"
    return _tracked(own, setpoint, valid, -1.0 if axis == "z" else 1.0)


def _velocity(axis: str, place: int) -> tuple[Field, ...]:
    own = f"{_LOCAL}.{axis}", f"{_ODOMETRY}.velocity[{place}]", f"{_ODOMETRY}.{axis}"
    setpoint = f"{_POSITION_SETPOINT}.{axis}", f"{_TRAJECTORY}.velocity[{place}]", f"{_TRAJECTORY}.{axis}"
    return _tracked(own, setpoint, "v_z_valid" if axis == "vz" else "v_xy_valid")


def _ratio(label: str, *names: str) -> Field:
    return Field(label, tuple(f"estimator_status.{name}_test_ratio" for name in names))


_GPS = ("sensor_gps", "vehicle_gps_position")


def _gps(label: str, name: str) -> Field:
    return _each(label, *(f"{topic}.{name}" for topic in _GPS))


def _battery(*names: str, **more: Any) -> Field:
    return _each("battery", *(f"battery_status.{name}" for name in names), **more)


def _stick(name: str, old: str) -> Field:
    return _line(name, f"manual_control_setpoint.{name}", f"manual_control_setpoint.{old}")


def _axes(topic: str, field: str) -> tuple[Field, ...]:
    return tuple(Field(axis, (f"{topic}.{field}[{place}]",)) for place, axis in enumerate("xyz"))


_STICKS = (("roll", "y"), ("pitch", "x"), ("yaw", "r"), ("throttle", "z"))

GROUPS: tuple[Group, ...] = (
    Group(
        "Position and velocity",
        (
            _plan(
                "Altitude above the origin",
                "m",
                *_position("z", 2),
                _line("above ground", f"{_LOCAL}.dist_bottom", valid="dist_bottom_valid"),
            ),
            _plan(
                "Altitude above sea level",
                "m",
                _line("estimate", "vehicle_global_position.alt"),
                instead_of=("Altitude above the origin",),
            ),
            _plan("Position north", "m", *_position("x", 0)),
            _plan("Position east", "m", *_position("y", 1)),
            _plan("Velocity north", "m/s", *_velocity("vx", 0)),
            _plan("Velocity east", "m/s", *_velocity("vy", 1)),
            _plan("Velocity down", "m/s", *_velocity("vz", 2)),
            _plan(
                "Airspeed",
                "m/s",
                _line("true", "airspeed_validated.true_airspeed_m_s", "airspeed.true_airspeed_m_s"),
                _line("setpoint", "tecs_status.true_airspeed_sp", is_setpoint=True),
            ),
        ),
    ),
    Group(
        "Attitude and rates",
        tuple(_plan(loop.name.capitalize(), loop.unit, *_tracked(loop.measured, loop.setpoint)) for loop in LOOPS),
    ),
    Group(
        "Actuators and sticks",
        (
            _plan("Motors", "", _each("motor", "actuator_motors.control")),
            _plan("Servos", "", _each("servo", "actuator_servos.control")),
            _plan("Actuator outputs", "", _each("output", "actuator_outputs.output"), instead_of=("Motors", "Servos")),
            _plan("Speed of motors", "rpm", _each("motor", "esc_status.esc")),
            _plan(
                "Thrust setpoint",
                "",
                *_axes("vehicle_thrust_setpoint", "xyz"),
                _line("z to hover", "hover_thrust_estimate.hover_thrust", valid="valid", scale=-1.0, is_setpoint=True),
            ),
            _plan("Torque setpoint", "", *_axes("vehicle_torque_setpoint", "xyz")),
            _plan("Sticks", "", *(_stick(name, old) for name, old in _STICKS)),
        ),
    ),
    Group(
        "Power and system",
        (
            _plan("Battery voltage", "V", _battery("voltage_v", "voltage_filtered_v")),
            _plan("Battery current", "A", _battery("current_a", "current_filtered_a", unknown=-1.0)),
            _plan("Battery remaining", "%", _battery("remaining", scale=100, unknown=-1.0)),
            _plan(
                "Load of the autopilot",
                "%",
                _line("CPU", "cpuload.load", scale=100),
                _line("RAM", "cpuload.ram_usage", scale=100),
            ),
        ),
    ),
    Group(
        "Vibration and sensors",
        (
            _plan("Vibration of the accelerometers", "m/s²", _each("IMU", "vehicle_imu_status.accel_vibration_metric")),
            _plan("Vibration of the gyroscopes", "deg/s", _each("IMU", "vehicle_imu_status.gyro_vibration_metric")),
            _plan("Raw acceleration", "m/s²", *_axes("sensor_combined", "accelerometer_m_s2")),
            _plan("Magnetic field", "Ga", *_axes("vehicle_magnetometer", "magnetometer_ga")),
        ),
    ),
    Group(
        "GPS",
        (
            _plan("Satellites and fix", "", _gps("satellites", "satellites_used"), _gps("fix type", "fix_type")),
            _plan("Accuracy of position", "m", _gps("horizontal", "eph"), _gps("vertical", "epv")),
            _plan("Noise and jamming", "", _gps("noise per ms", "noise_per_ms"), _gps("jamming", "jamming_indicator")),
        ),
    ),
    Group(
        "Estimator",
        (
            _plan(
                "Innovation test ratios",
                "",
                _ratio("heading", "hdg", "mag"),
                _ratio("velocity", "vel"),
                _ratio("position", "pos"),
                _ratio("height", "hgt"),
                _ratio("airspeed", "tas"),
                _ratio("above ground", "hagl"),
            ),
            _plan(
                "Error of the position",
                "m",
                _line("horizontal", f"{_LOCAL}.eph", "estimator_status.pos_horiz_accuracy"),
                _line("vertical", f"{_LOCAL}.epv", "estimator_status.pos_vert_accuracy"),
            ),
        ),
    ),
)
"""The charts, in the order of the report."""


class Lanes(NamedTuple):
    """A chart of flags, each a row: the fields of topics that are true or false."""

    title: str
    group: str
    topics: tuple[str, ...]
    """The names of topics, or what they begin with."""
    flags: tuple[str, ...] = ()
    """What the names of the fields begin with. Default: all."""
    is_changing: bool = False
    """Whether flags that never change are left out. Those that are never true always are."""


AID_SOURCES = "estimator_aid_src_"
"""What the names of topics about the estimator's sources begin with."""

LANES: tuple[Lanes, ...] = (
    Lanes(
        "State of the vehicle",
        "Position and velocity",
        ("vehicle_land_detected",),
        ("landed", "maybe_landed", "freefall"),
    ),
    Lanes("Flags of failsafes", "Power and system", ("failsafe_flags", "failure_detector_status")),
    Lanes(
        "Rejected innovations",
        "Estimator",
        (AID_SOURCES, "estimator_innovation_flags", "estimator_status_flags"),
        ("innovation_rejected", "reject_"),
    ),
    Lanes("State of the estimator", "Estimator", ("estimator_status_flags",), ("cs_", "fs_"), is_changing=True),
)

_NAMES = frozenset(
    {
        *("vehicle_status", "actuator_armed", "vehicle_global_position"),
        *MOTION,
        *(
            path.partition(".")[0]
            for group in GROUPS
            for plan in group.plans
            for field in plan.fields
            for path in field.paths
        ),
        *(topic for lanes in LANES for topic in lanes.topics),
    }
)


def is_needed(name: str) -> bool:
    """Whether a report reads the topic with a name in uORB."""
    return name in _NAMES or name.startswith(AID_SOURCES)
