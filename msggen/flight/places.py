"""Places that a program names: in the vehicle's local frame, or on earth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from logging import getLogger
from typing import Any

from msggen.base import earth
from msggen.flight.errors import NoAnswerError
from msggen.flight.feeds import Feeds
from msggen.flight.setpoints import finite
from msggen.flight.space import Frame, Vector, three, turned

LOGGER = getLogger("msggen.flight")
_DEPTH = 1.0
"""The depth in m below home from which on a place is doubtful."""
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

    Raises NoAnswerError for a place on earth if the vehicle does not know where it is.
    """
    if not isinstance(place, GlobalPlace):
        return turned(finite(three(place), "a place"), frame)
    origin = await _origin(feeds, lambda each: bool(each.xy_global and each.z_global), "where on earth it is")
    north, east = earth.local((origin.ref_lat, origin.ref_lon), place.latitude, place.longitude)
    return Vector(north, east, origin.ref_alt - place.altitude)


def check_within(within: float) -> None:
    """Raise ValueError unless a distance at which a place is reached is above 0."""
    if not within > 0.0:
        raise ValueError(f"expected `within` above 0 m, got {within:g}")


def warn_of_depth(depth: float) -> None:
    """Warn of a place that is some m below home: the sign of its altitude may be wrong."""
    if depth > _DEPTH:
        LOGGER.warning(
            "a place %.1f m below home: z points down in NED, and the altitude of a GlobalPlace is above sea level",
            depth,
        )


async def sea_level(feeds: Feeds) -> float:
    """Return the altitude of the origin of the local frame above mean sea level in m. Raises NoAnswerError."""
    origin = await _origin(feeds, lambda each: bool(each.z_global), "its altitude above sea level")
    return float(origin.ref_alt)


async def _origin(feeds: Feeds, is_known: Callable[[Any], bool], what: str) -> Any:
    try:
        return await feeds["vehicle_local_position"].wait(is_known, _KNOWN)
    except TimeoutError:
        raise NoAnswerError(f"the vehicle does not know {what}") from None
