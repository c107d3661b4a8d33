"""Where a vehicle is: from its messages to poses in the frames of ROS, which Foxglove draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from math import isnan
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

ODOMETRY, POSITION, ATTITUDE, GLOBAL = (
    "px4_msgs/msg/VehicleOdometry",
    "px4_msgs/msg/VehicleLocalPosition",
    "px4_msgs/msg/VehicleAttitude",
    "px4_msgs/msg/VehicleGlobalPosition",
)

KINDS = frozenset((ODOMETRY, POSITION, ATTITUDE, GLOBAL))
"""The types of the messages that tell where a vehicle is."""

_ABSENT_NS = 1_000_000_000
"""The time without odometry after which local position and attitude are used instead."""

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


class Pose(NamedTuple):
    """A pose in ENU, of a body with the axes FLU (docs/frames.md)."""

    position: Vector
    """East, north and up from the origin of PX4's estimator, in m."""
    orientation: Quaternion
    """The rotation from FLU to ENU: Hamilton, w first."""


class Location(NamedTuple):
    """A place on the earth: degrees, and the altitude above mean sea level in m."""

    latitude: float
    longitude: float
    altitude: float


class Scene:
    """Follows a vehicle. `feed` returns what a message tells of its place.

    The pose is that of VehicleOdometry. If there is none, it is put together from VehicleLocalPosition and
    VehicleAttitude. Frames that are unknown, and values that are NaN, give no pose.
    """

    def __init__(self, package: ModuleType) -> None:
        self._to_ros: Callable[..., Any] = import_module(f"{package.__name__}.frames").to_ros
        self._position: Vector = (0.0, 0.0, 0.0)
        self._odometry = -_ABSENT_NS
        self._kinds: Mapping[str, Callable[[Any, int], Pose | Location | None]] = {
            ODOMETRY: self._from_odometry,
            POSITION: self._from_position,
            ATTITUDE: self._from_attitude,
            GLOBAL: self._from_global,
        }

    def feed(self, ros_type: str, message: Any, time: int) -> Pose | Location | None:
        """Return the pose or the location that a message gives. `time` is in ns, of any clock."""
        take = self._kinds.get(ros_type)
        return take(message, time) if take else None

    def _from_odometry(self, message: Any, time: int) -> Pose | None:
        values = self._converted(message)
        if not ("position" in values and "q" in values and values["position"].frame == "ENU"):
            return None
        self._odometry = time
        return _pose(values["position"].value, values["q"].value)

    def _from_position(self, message: Any, _: int) -> None:
        value = self._converted(message).get("xyz")
        if value is not None and value.is_valid:
            self._position = tuple(value.value)

    def _from_attitude(self, message: Any, time: int) -> Pose | None:
        if 0 <= time - self._odometry < _ABSENT_NS:
            return None
        value = self._converted(message).get("q")
        return _pose(self._position, value.value) if value is not None else None

    def _from_global(self, message: Any, _: int) -> Location | None:
        location = Location(message.lat, message.lon, message.alt)
        return None if any(map(isnan, location)) else location

    def _converted(self, message: Any) -> Mapping[str, Any]:
        try:
            found: Mapping[str, Any] = self._to_ros(message)
        except ValueError:  # no value has a known frame, or one is no rotation
            return {}
        return found


def _pose(position: Vector, orientation: Quaternion) -> Pose | None:
    return None if any(map(isnan, (*position, *orientation))) else Pose(position, orientation)
