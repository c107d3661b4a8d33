"""Places on the earth, and in the local position of a simulated vehicle. Distances are in m."""

from __future__ import annotations

from typing import NamedTuple

from msggen.messages import earth
from msggen.sim.attitude import Vector

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
        north, east = earth.local(self[:2], place.latitude, place.longitude)
        return north, east, self.altitude - place.altitude

    def place(self, position: Vector) -> Home:
        """Return the place of a local position."""
        north, east, down = position
        return Home(*earth.placed(self[:2], north, east), self.altitude - down)
