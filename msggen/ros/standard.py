"""Messages of PX4 as standard messages of ROS: nested mappings of their fields, in the frames of ROS.

Nothing here imports ROS: `filled` makes messages of any classes with the fields of ROS's. The conversions of frames are
those of the generated package (docs/frames.md). Each function returns None for a message that has no valid values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from math import isfinite
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

from msggen.messages.packages import Message, package_of_class
from msggen.vehicle.refusals import Refusals

Values: TypeAlias = Mapping[str, Any]
"""The fields of a message of ROS by name. A nested message is a mapping, too."""

UNKNOWN = (0.0,) * 9
"""A covariance that is not known, as sensor_msgs defines it."""
WITHOUT = (-1.0, *UNKNOWN[1:])
"""The covariance of a value that a sensor_msgs/Imu does not have."""

_NO_FIX, _FIX, _GBAS_FIX = -1, 0, 2
_STATUS = {2: _FIX, 3: _FIX, 4: _GBAS_FIX, 5: _GBAS_FIX, 6: _GBAS_FIX, 8: _FIX}
"""STATUS_... of sensor_msgs/NavSatStatus for `fix_type` of SensorGps. Others have no position."""
_DIAGONAL_KNOWN = 2
_DEGREES, _METERS = 1e-7, 1e-3
"""The units of SensorGps in v1.14, whose fields `lat`, `lon` and `alt_ellipsoid` are integers."""


class Frames(NamedTuple):
    """The names of frames, as in REP 105: `map` and `odom` have z up, and `base_link` is fixed to the vehicle."""

    map: str = "map"
    odom: str = "odom"
    base_link: str = "base_link"

    def inside(self, namespace: str) -> Frames:
        """Return the names for a vehicle with a namespace: `uav_1/base_link`."""
        return Frames(*(f"{namespace}/{name}" for name in self)) if namespace else self


class Clock(NamedTuple):
    """The time of a message: its own if it counts from 1970, or else that of its arrival in ns."""

    arrival: int
    calendar: int
    """Times in us before this one count from the boot of the vehicle: `clock.CALENDAR` of the package."""

    def stamp(self, microseconds: int) -> Values:
        """Return a time of PX4 as builtin_interfaces/Time."""
        nanoseconds = microseconds * 1000 if microseconds >= self.calendar else self.arrival
        sec, nanosec = divmod(nanoseconds, 1_000_000_000)
        return {"sec": sec, "nanosec": nanosec}


def odometry(message: Message, clock: Clock, frames: Frames) -> Values | None:
    """Return a VehicleOdometry as nav_msgs/Odometry: the pose in `odom`, the velocities in `base_link`.

    Unknown variances are 0. Raises FrameError of the package if a frame is not known.
    """
    found = _tool(message, "odometry").pose_and_twist(message)
    if not _are_finite(*found.position, *found.orientation, *found.velocity, *found.angular_velocity):
        return None
    return {
        "header": _header(message, clock, frames.odom),
        "child_frame_id": frames.base_link,
        "pose": {
            "pose": {"position": _xyz(found.position), "orientation": _xyzw(found.orientation)},
            "covariance": _known(found.pose_covariance),
        },
        "twist": {
            "twist": {"linear": _xyz(found.velocity), "angular": _xyz(found.angular_velocity)},
            "covariance": _known(found.twist_covariance),
        },
    }


def pose(message: Message, clock: Clock, frames: Frames) -> Values | None:
    """Return the pose of a VehicleOdometry as geometry_msgs/PoseStamped, in `map`."""
    found = _pose(message)
    if found is None:
        return None
    position, orientation = found
    return {
        "header": _header(message, clock, frames.map),
        "pose": {"position": _xyz(position), "orientation": _xyzw(orientation)},
    }


def transform(message: Message, clock: Clock, frames: Frames) -> Values | None:
    """Return the pose of a VehicleOdometry as geometry_msgs/TransformStamped, from `odom` to `base_link`."""
    found = _pose(message)
    if found is None:
        return None
    position, orientation = found
    return {
        "header": _header(message, clock, frames.odom),
        "child_frame_id": frames.base_link,
        "transform": {"translation": _xyz(position), "rotation": _xyzw(orientation)},
    }


def identity(clock: Clock, frames: Frames) -> Values:
    """Return the transform from `map` to `odom`: they are the same, because PX4 has one local frame."""
    return {
        "header": {"stamp": clock.stamp(0), "frame_id": frames.map},
        "child_frame_id": frames.odom,
        "transform": {"translation": _xyz((0.0, 0.0, 0.0)), "rotation": _xyzw((1.0, 0.0, 0.0, 0.0))},
    }


def imu(message: Message, orientation: Sequence[float] | None, clock: Clock, frames: Frames) -> Values | None:
    """Return a SensorCombined as sensor_msgs/Imu in FLU, with an orientation from `orientation_of` if it is known."""
    rates, acceleration = _in_ros(message, "gyro_rad"), _in_ros(message, "accelerometer_m_s2")
    if not _are_finite(*rates, *acceleration):
        return None
    return {
        "header": _header(message, clock, frames.base_link),
        "orientation": _xyzw(orientation or (1.0, 0.0, 0.0, 0.0)),
        "orientation_covariance": UNKNOWN if orientation else WITHOUT,
        "angular_velocity": _xyz(rates),
        "angular_velocity_covariance": UNKNOWN,
        "linear_acceleration": _xyz(acceleration),
        "linear_acceleration_covariance": UNKNOWN,
    }


def orientation_of(attitude: Message) -> Sequence[float] | None:
    """Return the orientation of a VehicleAttitude in ENU: w, x, y, z; None if it is not known."""
    found: Sequence[float] = _in_ros(attitude, "q")
    return found if _are_finite(*found) else None


def fix(message: Message, clock: Clock, frames: Frames) -> Values | None:
    """Return a SensorGps as sensor_msgs/NavSatFix. The altitude is that above the ellipsoid WGS84."""
    values: Any = message
    if hasattr(values, "latitude_deg"):
        position = values.latitude_deg, values.longitude_deg, values.altitude_ellipsoid_m
    else:
        position = values.lat * _DEGREES, values.lon * _DEGREES, values.alt_ellipsoid * _METERS
    if not _are_finite(*position):
        return None
    east = north = values.eph**2
    is_known = _are_finite(east, values.epv)
    return {
        "header": _header(message, clock, frames.base_link),
        "status": {"status": _STATUS.get(values.fix_type, _NO_FIX), "service": 0},
        "latitude": position[0],
        "longitude": position[1],
        "altitude": position[2],
        "position_covariance": (east, 0.0, 0.0, 0.0, north, 0.0, 0.0, 0.0, values.epv**2) if is_known else UNKNOWN,
        "position_covariance_type": _DIAGONAL_KNOWN if is_known else 0,
    }


class Output(NamedTuple):
    """A message for ROS."""

    topic: str
    values: Values


TYPES = {
    "odom": "nav_msgs/msg/Odometry",
    "pose": "geometry_msgs/msg/PoseStamped",
    "imu": "sensor_msgs/msg/Imu",
    "fix": "sensor_msgs/msg/NavSatFix",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
"""The topics with standard messages, relative to the namespace of the vehicle, and their types."""

SOURCES = {
    "vehicle_odometry": ("odom", "pose", "/tf"),
    "sensor_combined": ("imu",),
    "vehicle_attitude": ("imu",),
    "vehicle_gps_position": ("fix",),
}
"""The topics of PX4 that they are made from."""


class Converter:
    """Makes standard messages from the samples of a vehicle. It keeps the newest orientation, for `imu`."""

    def __init__(self, package: ModuleType, frames: Frames, refusals: Refusals) -> None:
        self._calendar: int = import_module(f"{package.__name__}.clock").CALENDAR
        self._frames = frames
        self._orientation: Sequence[float] | None = None
        self._refusals = refusals

    def convert(self, source: str, message: Message, arrival: int) -> list[Output]:
        """Return the messages for ROS of a message of one of SOURCES that arrived at a time in ns."""
        clock, outputs = Clock(arrival, self._calendar), []
        for topic in SOURCES[source]:
            try:
                values = self._values(source, topic, message, clock)
            except ValueError as error:  # FrameError of the package
                self._refusals.add(topic if source != "vehicle_attitude" else source, error)
            else:
                outputs += [] if values is None else [Output(topic, values)]
        return outputs

    def static(self, arrival: int) -> Output:
        """Return the transforms that do not change."""
        return Output("/tf_static", {"transforms": [identity(Clock(arrival, self._calendar), self._frames)]})

    def _values(self, source: str, topic: str, message: Message, clock: Clock) -> Values | None:
        if source == "vehicle_attitude":
            self._orientation = None  # if the attitude is no rotation
            self._orientation = orientation_of(message)
            return None
        if topic == "imu":
            return imu(message, self._orientation, clock, self._frames)
        values = _MAKERS[topic](message, clock, self._frames)
        return {"transforms": [values]} if topic == "/tf" and values is not None else values


_MAKERS: Mapping[str, Callable[[Message, Clock, Frames], Values | None]] = {
    "odom": odometry,
    "pose": pose,
    "/tf": transform,
    "fix": fix,
}


def filled(cls: Any, values: Values, find: Callable[[str], Any]) -> Any:
    """Return a message of a class of ROS with these values. `find` returns the class of a type of ROS."""
    message = cls()
    _fill(message, values, find)
    return message


def _fill(message: Any, values: Values, find: Callable[[str], Any]) -> None:
    """Set the values of a new message. Its nested messages are new, too."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            _fill(getattr(message, name), value, find)
        elif isinstance(value, list):
            item = find(_item(message.get_fields_and_field_types()[name]))
            setattr(message, name, [filled(item, each, find) for each in value])
        else:
            setattr(message, name, value)


def _item(sequence: str) -> str:
    """Return `geometry_msgs/msg/TransformStamped` of `sequence<geometry_msgs/TransformStamped>`."""
    package, _, name = sequence.removeprefix("sequence<").partition(">")[0].partition("/")
    return f"{package}/msg/{name}"


def _pose(message: Message) -> tuple[Sequence[float], Sequence[float]] | None:
    """Return position and orientation of a message, or None if one of them is not known."""
    position, orientation = _in_ros(message, "position"), _in_ros(message, "q")
    return (position, orientation) if _are_finite(*position, *orientation) else None


def _in_ros(message: Message, name: str) -> Any:
    """Return the value of a field in the frames of ROS. Raises FrameError of the package."""
    return _tool(message, "frames").to_ros(message, name).value


def _tool(message: Message, name: str) -> Any:
    """Return a module of the generated package of a message."""
    return import_module(f"{package_of_class(type(message)).__name__}.{name}")


def _header(message: Any, clock: Clock, frame_id: str) -> Values:
    """Return a std_msgs/Header. The time is that of the measurement, if the message has it."""
    time = getattr(message, "timestamp_sample", 0) or message.timestamp
    return {"stamp": clock.stamp(time), "frame_id": frame_id}


def _xyz(values: Sequence[float]) -> Values:
    x, y, z = values
    return {"x": x, "y": y, "z": z}


def _xyzw(values: Sequence[float]) -> Values:
    w, x, y, z = values
    return {"x": x, "y": y, "z": z, "w": w}


def _known(covariance: Sequence[float]) -> tuple[float, ...]:
    """Return a covariance with 0 for values that are not known."""
    return tuple(value if isfinite(value) else 0.0 for value in covariance)


def _are_finite(*values: float) -> bool:
    return all(map(isfinite, values))
