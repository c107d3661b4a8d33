"""Places on the earth, and in the local position of a simulated vehicle. Distances are in m."""

from __future__ import annotations

import math
from typing import NamedTuple

from msggen.live.sim.attitude import Vector

_EARTH_RADIUS = 6_371_000.0
_HIGHEST = 1e5


class Home(NamedTuple):
    """A place: that of the start, which is home until a command sets another."""

    latitude: float = 47.397742
    longitude: float = 8.545594
    altitude: float = 488.0
    """Above mean sea level in m."""

    @property
    def is_possible(self) -> bool:
        """Whether there is such a place."""
        return abs(self.latitude) < 90 and abs(self.longitude) <= 180 and abs(self.altitude) < _HIGHEST  # noqa: PLR2004

    def local(self, place: Home) -> Vector:
        """Return the local position of another place, of which this one is the origin. NaN stays."""
        north = math.radians(place.latitude - self.latitude) * _EARTH_RADIUS
        east = math.radians(place.longitude - self.longitude) * self._radius
        return north, east, self.altitude - place.altitude

    def place(self, position: Vector) -> Home:
        """Return the place of a local position."""
        north, east, down = position
        latitude = self.latitude + math.degrees(north / _EARTH_RADIUS)
        return Home(latitude, self.longitude + math.degrees(east / self._radius), self.altitude - down)

    @property
    def _radius(self) -> float:
        """The radius of the parallel."""
        return _EARTH_RADIUS * math.cos(math.radians(self.latitude))
