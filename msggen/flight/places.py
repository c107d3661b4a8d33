"""Places and directions that a program names: in NED as in PX4, in ENU as in ROS, or on earth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

from msggen.flight.errors import NoAnswerError
from msggen.flight.feeds import Feeds
from msggen.flight.setpoints import finite
from msggen.flight.usage import LOCAL, ON_EARTH, named
from msggen.messages import earth

_TURNS = 2 * math.tau
"""The largest angle in rad: programs that fly around something sum them up."""

Frame: TypeAlias = Literal["ned", "enu"]
"""Axes: north, east, down; or east, north, up."""


def check_frame(frame: Frame) -> Frame:
    """Return a frame. Raises ValueError for another word."""
    if frame not in get_args(Frame):
        raise ValueError(f"expected the frame {' or '.join(map(repr, get_args(Frame)))}, got {frame!r}")
    return frame


class Vector(NamedTuple):
    """A place in m or a velocity in m/s, in the frame of the program."""

    x: float
    y: float
    z: float

    def shifted(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Vector:
        """Return the place that is shifted along the axes, in m."""
        return Vector(self.x + x, self.y + y, self.z + z)

    def distance(self, other: Vector) -> float:
        """Return the distance to another place in m."""
        return math.dist(self, other)


def turned(vector: tuple[float, float, float], frame: Frame) -> Vector:
    """Convert a vector from NED to a frame, or from a frame to NED: both are the same computation."""
    x, y, z = vector
    return Vector(x, y, z) if frame == "ned" else Vector(y, x, -z)


def turned_heading(heading: float, frame: Frame) -> float:
    """Convert a heading in rad from NED (clockwise from north) to ENU (counter-clockwise from east), or back."""
    return heading if frame == "ned" else wrapped(math.pi / 2 - heading)


def heading_of(heading: float | None, heading_deg: float | None, frame: Frame) -> float | None:
    """Return a heading in a frame, in rad or in degrees, as one in NED in rad.

    Raises ValueError if both are given, for one that is not finite, and for radians beyond two turns.
    """
    if heading is not None and heading_deg is not None:
        raise ValueError("expected heading or heading_deg, got both")
    found = math.radians(heading_deg) if heading_deg is not None else heading
    if found is not None and not math.isfinite(found):
        raise ValueError(f"expected finite numbers for a heading, got {(found,)}")
    if heading is not None:
        check_radians(heading, "heading")
    return None if found is None else turned_heading(found, frame)


def check_radians(angle: float, name: str) -> None:
    """Raise ValueError for an angle beyond two turns, which is probably in degrees. `name` is its argument."""
    if abs(angle) > _TURNS:
        raise ValueError(
            f"expected `{name}` in rad, from -4 pi to 4 pi, got {angle:g}: did you mean `{name}_deg={angle:g}`?"
        )


def three(values: Sequence[float]) -> tuple[float, float, float]:
    """Return three numbers. Raises ValueError for another count."""
    found = tuple(map(float, values))
    if len(found) != 3:  # noqa: PLR2004 - x, y, z
        raise ValueError(f"expected three numbers, got {found}")
    return found


def wrapped(angle: float) -> float:
    """Return an angle in rad as one from -pi to pi."""
    return math.remainder(angle, math.tau)


_KNOWN = 1.0
"""The time in s within which the vehicle shows where it is on earth."""


@dataclass(frozen=True)
class GlobalPlace:
    """A place on earth."""

    latitude: float
    """In degrees."""
    longitude: float
    """In degrees."""
    altitude: float
    """In m above mean sea level."""

    def __post_init__(self) -> None:
        """Raise ValueError for what is no place on earth."""
        latitude, longitude, _ = finite([self.latitude, self.longitude, self.altitude], "a place")
        if abs(latitude) > 90.0 or abs(longitude) > 180.0:  # noqa: PLR2004 - degrees
            raise ValueError(
                f"expected a latitude from -90 to 90 and a longitude from -180 to 180, got {latitude}, {longitude}"
            )


async def local_place(feeds: Feeds, place: Sequence[float] | GlobalPlace, frame: Frame) -> Vector:
    """Return a place in the local frame in NED. Raises ValueError for three numbers that are not finite.

    Raises TypeError for a single number, and NoAnswerError for a place on earth if the vehicle does not know where it
    is.
    """
    if not isinstance(place, GlobalPlace):
        if not isinstance(place, Iterable):
            raise TypeError(named("goto", LOCAL))
        return turned(finite(three(place), "a place"), frame)
    origin = await _origin(feeds, lambda each: bool(each.xy_global and each.z_global), "where on earth it is")
    north, east = earth.local((origin.ref_lat, origin.ref_lon), place.latitude, place.longitude)
    return Vector(north, east, origin.ref_alt - place.altitude)


class OnEarth(NamedTuple):
    """A place as a call names it: as a GlobalPlace, or by numbers."""

    place: GlobalPlace | None
    latitude: float | None
    longitude: float | None
    altitude: float | None

    def numbers(self, function: str) -> tuple[float, float, float | None]:
        """Return the latitude, the longitude and the altitude for a function.

        Raises TypeError, which shows both ways, and ValueError for what is no place on earth.
        """
        place, latitude, longitude, altitude = self
        if isinstance(place, GlobalPlace) and self[1:] == (None, None, None):
            return place.latitude, place.longitude, place.altitude
        if place is not None or latitude is None or longitude is None:
            raise TypeError(named(function, ON_EARTH))
        GlobalPlace(latitude, longitude, 0.0 if altitude is None else altitude)
        return latitude, longitude, altitude

    def whole(self, function: str) -> tuple[float, float, float]:
        """Return the same with an altitude. Raises TypeError without one, too."""
        latitude, longitude, altitude = self.numbers(function)
        if altitude is None:
            raise TypeError(named(function, ON_EARTH))
        return latitude, longitude, altitude


def check_within(within: float) -> None:
    """Raise ValueError unless a distance at which a place is reached is above 0."""
    if not within > 0.0:
        raise ValueError(f"expected `within` above 0 m, got {within:g}")


async def sea_level(feeds: Feeds) -> float:
    """Return the altitude of the origin of the local frame above mean sea level in m. Raises NoAnswerError."""
    origin = await _origin(feeds, lambda each: bool(each.z_global), "its altitude above sea level")
    return float(origin.ref_alt)


async def _origin(feeds: Feeds, is_known: Callable[[Any], bool], what: str) -> Any:
    try:
        return await feeds["vehicle_local_position"].wait(is_known, _KNOWN)
    except TimeoutError:
        raise NoAnswerError(f"the vehicle does not know {what}") from None
