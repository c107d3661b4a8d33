"""How a vehicle touches the ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

_BEFORE = 1.0
"""The time in s before PX4 notices the ground in which a vehicle touches it."""
_SPEED, _CRASH = 1.5, 3.0
"""The vertical speeds in m/s from which a landing is hard, and from which it is a crash."""
_ACCELERATION = 39.2
"""4 times that of the earth, in m/s²."""
_SENSORS = ("sensor_combined", "accelerometer_m_s2"), ("vehicle_acceleration", "xyz")


def _hard(flight: Flight) -> Iterator[Seen]:
    touches = tuple((end - _BEFORE, end) for _, end in flight.in_air if end < flight.duration)
    down, valid = (flight.recorded.column("vehicle_local_position", name) for name in ("vz", "v_z_valid"))
    down = down.where(valid) if down else None
    limit = max(2 * flight.parameter("MPC_LAND_SPEED", 0.7), _SPEED)
    found = flight.above(down, limit, touches)
    if down and found:
        speed = down.within(touches).largest
        level = "error" if speed >= _CRASH else ""
        text = f"the vehicle touched down at {speed:.1f} m/s"
        yield Seen(text, found.begin, found.end, {"speed_m_s": speed, "limit_m_s": limit}, level)
        return
    shock = next(filter(None, (flight.length(*each) for each in _SENSORS)), None)
    found = flight.above(shock, _ACCELERATION, touches)
    if shock and found:
        size = shock.within(touches).largest
        values = {"acceleration_m_s2": size, "limit_m_s2": _ACCELERATION}
        yield Seen(f"the vehicle touched down with a shock of {size:.0f} m/s²", found.begin, found.end, values)


RULES = (
    FlightRule(
        "LANDING_HARD",
        "the vehicle touched the ground fast or with a shock",
        Category.FLIGHT,
        _hard,
        severity=Severity.WARNING,
        needs=(("vehicle_land_detected.landed",), ("vehicle_local_position.vz",)),
        uses=("vehicle_status", "actuator_armed", "vehicle_local_position", *(topic for topic, _ in _SENSORS)),
        fix="Look for damage. Lower MPC_LAND_SPEED, add a distance sensor, or check the height estimate if the vehicle "
        "took the ground for lower than it was.",
        source="twice MPC_LAND_SPEED, 1.5 m/s at least, and 3 m/s for an error; or 4 times the earth's acceleration",
        example="the vehicle touched down at 2.4 m/s",
    ),
)
"""The rules."""
