"""Places on earth as positions north and east of another place, on a sphere.

The projection is azimuthal and equidistant, as that of PX4's local frame (`lib/geo`): distances and directions from the
origin are true.
"""

from __future__ import annotations

import math

HAS_FIX = 3
"""The smallest `fix_type` of a receiver of satellites with a position in three dimensions."""
RADIUS = 6_371_000.0
"""The radius of the earth in m, as in PX4."""


def local(origin: tuple[float, float], latitude: float, longitude: float) -> tuple[float, float]:
    """Return how far north and east of an origin a place is, in m. Latitudes and longitudes are in degrees.

    Both are NaN if a number is not finite.
    """
    if not all(map(math.isfinite, (*origin, latitude, longitude))):
        return math.nan, math.nan
    here, there = math.radians(origin[0]), math.radians(latitude)
    turn = math.radians(longitude - origin[1])
    haversine = math.sin((there - here) / 2) ** 2 + math.cos(here) * math.cos(there) * math.sin(turn / 2) ** 2
    distance = 2.0 * RADIUS * math.asin(math.sqrt(min(1.0, max(0.0, haversine))))  # below 0 beyond a pole
    bearing = math.atan2(
        math.sin(turn) * math.cos(there),
        math.cos(here) * math.sin(there) - math.sin(here) * math.cos(there) * math.cos(turn),
    )
    return distance * math.cos(bearing), distance * math.sin(bearing)


def placed(origin: tuple[float, float], north: float, east: float) -> tuple[float, float]:
    """Return the latitude and longitude in degrees of a position in m from an origin: the inverse of `local`."""
    here, bearing, arc = math.radians(origin[0]), math.atan2(east, north), math.hypot(north, east) / RADIUS
    there = math.asin(math.sin(here) * math.cos(arc) + math.cos(here) * math.sin(arc) * math.cos(bearing))
    turn = math.atan2(
        math.sin(bearing) * math.sin(arc) * math.cos(here), math.cos(arc) - math.sin(here) * math.sin(there)
    )
    return math.degrees(there), math.remainder(origin[1] + math.degrees(turn), 360.0)
