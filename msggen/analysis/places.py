"""Where receivers of satellites say that a vehicle is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from msggen.messages.earth import RADIUS
from msggen.messages.gps import HAS_FIX

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column

_SCALES = (("latitude_deg", "longitude_deg", 1.0), ("lat", "lon", 1e-7))


def jumps_of(flight: Flight, topic: str, instance: int, longest: float) -> Column | None:
    """Return how many m each position is away from the one before, less the way at the speed that is told.

    NaN where there is no fix, and for positions more than `longest` s apart. None without positions.
    """
    for names in _SCALES:
        latitude, longitude = (flight.recorded.column(topic, name, instance) for name in names[:2])
        if latitude is None or longitude is None:
            continue
        fix, speed = (flight.recorded.column(topic, name, instance) for name in ("fix_type", "vel_m_s"))
        latitude = latitude.where(fix._replace(values=fix.values - (HAS_FIX - 1)) if fix else None)
        north, east = (np.radians(each.values * names[2]) for each in (latitude, longitude))
        turn = (np.diff(east) + np.pi) % (2 * np.pi) - np.pi  # across the date line, too
        ways = RADIUS * np.hypot(np.diff(north), turn * np.cos(north[:-1]))
        steps = np.diff(latitude.times)
        told = np.nan_to_num(speed.at(latitude.times)) if speed is not None else np.zeros(len(latitude.times))
        rest = np.where(steps <= longest, ways - np.maximum(told[1:], told[:-1]) * steps, np.nan)
        return latitude._replace(values=np.concatenate(([np.nan], rest)), is_held=False)
    return None
