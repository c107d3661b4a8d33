"""Places that a program names: in the vehicle's local frame, or on earth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from msggen.flight.errors import NoAnswerError
from msggen.flight.feeds import Feeds
from msggen.flight.setpoints import finite
from msggen.flight.space import Frame, Vector, three, turned
from msggen.flight.usage import LOCAL, ON_EARTH, named
from msggen.messages import earth

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
