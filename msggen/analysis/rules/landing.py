"""How a vehicle touches the ground."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.messages.vehicle_types import FIXED_WING

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column
    from msggen.analysis.spans import Spans

_BEFORE = 1.0
"""The time in s before the touch in which the speed and the shock are those of the landing."""
_LATE = 10.0
"""The longest time in s from the touch until PX4 tells it: the throttle falls first."""
_NEAR = 0.1
"""The distance in m by which a distance sensor that is on the ground varies."""
_SLOW = 0.25
"""The speed in m/s up to which PX4 takes a vehicle for one that stands: LNDMC_Z_VEL_MAX by default."""
_SHOCK = 0.02
"""The shortest time in s of a shock. A soft landing of PX4's simulation has a peak of 8 ms."""
_FEWEST = 2
"""The samples of a shock."""
_SPEED, _CRASH = 1.5, 3.0
"""The vertical speeds in m/s from which a landing is hard, and from which it is a crash."""
_UNFLARED = 1.25
"""By how much more than its sink rate a plane can touch down."""
_ACCELERATION = 39.2
"""4 times that of the earth, in m/s²."""
_SENSORS = ("sensor_combined", "accelerometer_m_s2"), ("vehicle_acceleration", "xyz")


def _hard(flight: Flight) -> Iterator[Seen]:
    touches = tuple((_touch(flight, *each) - _BEFORE, each[1]) for each in flight.landings)
    limit = _limit(flight)
    down = _valid(flight, "vz", "v_z_valid")
    found = flight.above(down, limit, touches)
    if down and found:
        speed = down.within(touches).largest
        level = "error" if speed >= _CRASH else ""
        text = f"the vehicle touched down at {speed:.1f} m/s"
        yield Seen(text, found.begin, found.end, {"speed_m_s": speed, "limit_m_s": limit}, level)
        return
    shock = next(filter(None, (flight.length(*each) for each in _SENSORS)), None)
    if shock:
        yield from _shocks(flight, shock, touches)


def _limit(flight: Flight) -> float:
    """Return the vertical speed in m/s from which a landing is hard. Planes without a flare keep their sink rate."""
    kind = flight.recorded.column("vehicle_status", "vehicle_type")
    if kind and flight.landings and kind.value_at(flight.landings[-1][1]) == FIXED_WING:
        return max(_UNFLARED * flight.parameter("FW_T_SINK_R_SP", 2.0), _SPEED)
    return max(2 * flight.parameter("MPC_LAND_SPEED", 0.7), _SPEED)


def _shocks(flight: Flight, shock: Column, touches: Spans) -> Iterator[Seen]:
    beyond = flight.when(shock, (shock.values > _ACCELERATION) & shock.is_within(touches))
    long = (each for each in beyond if each[1] - each[0] >= _SHOCK)
    found = tuple(each for each in long if len(shock.within((each,)).times) > _FEWEST)  # with the one at its end
    if found:
        size = shock.within(found).largest
        values = {"acceleration_m_s2": size, "limit_m_s2": _ACCELERATION}
        yield Seen(f"the vehicle touched down with a shock of {size:.0f} m/s²", found[0][0], found[-1][1], values)


def _touch(flight: Flight, begin: float, end: float) -> float:
    """Return when the vehicle touched the ground, of which PX4 told at the end of a time in the air.

    The distance to the ground tells it, or else the last time at which the vehicle descended.
    """
    last = ((max(begin, end - _LATE), end),)
    distance, down = _valid(flight, "dist_bottom", "dist_bottom_valid"), _valid(flight, "vz", "v_z_valid")
    if distance and isfinite(ground := distance.value_at(end)):
        found = flight.above(distance, ground + _NEAR, last)
    else:
        found = flight.above(down, max(flight.parameter("MPC_LAND_SPEED", 0.7) / 2, _SLOW), last)
    return min(found.end, end) if found else end


def _valid(flight: Flight, name: str, flag: str) -> Column | None:
    column = flight.recorded.column("vehicle_local_position", name)
    return column and column.where(flight.recorded.column("vehicle_local_position", flag))


RULES = (
    FlightRule(
        "LANDING_HARD",
        "the vehicle touched the ground fast or with a shock",
        _hard,
        needs=(("vehicle_land_detected.landed",), ("vehicle_local_position.vz",)),
        uses=("vehicle_status", "actuator_armed", "vehicle_local_position", *(topic for topic, _ in _SENSORS)),
        fix="Look for damage. Lower MPC_LAND_SPEED, add a distance sensor, or check the height estimate if the vehicle "
        "took the ground for lower than it was.",
        source="twice MPC_LAND_SPEED, or 1.25 times FW_T_SINK_R_SP of a plane, 1.5 m/s at least, and 3 m/s for an "
        "error; or more than 4 times the earth's acceleration for 20 ms",
        example="the vehicle touched down at 2.4 m/s",
    ),
)
"""The rules."""
