"""The wind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight


def _high(flight: Flight) -> Iterator[Seen | Unsaid]:
    north, east = (flight.recorded.column("wind", f"windspeed_{axis}") for axis in ("north", "east"))
    limits = {name: flight.parameter(name, -1.0) for name in ("COM_WIND_MAX", "COM_WIND_WARN")}
    set_ = {name: value for name, value in limits.items() if value > 0}
    if not set_:
        yield Unsaid("no limit is set: COM_WIND_WARN and COM_WIND_MAX are off, or the recording lacks them")
    if not north or not east:
        return
    speed = north._replace(values=(north.values**2 + east.values**2) ** 0.5)
    for name, limit in set_.items():
        stretch = flight.above(speed, limit)
        if stretch:
            worst = speed.within(flight.recorded.armed).largest
            values: dict[str, float | str] = {
                "wind_m_s": worst,
                "limit_m_s": limit,
                "parameter": name,
                "above_s": stretch.seconds,
            }
            level = "error" if name == "COM_WIND_MAX" else ""
            text = f"the wind reached {worst:.1f} m/s, above {limit:.1f} m/s for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, values, level)
            return


RULES = (
    FlightRule(
        "WIND_HIGH",
        "the wind was stronger than its limit",
        _high,
        needs=(("wind.windspeed_north",), ("wind.windspeed_east",)),
        uses=("vehicle_status", "actuator_armed"),
        fix="Land earlier. COM_WIND_MAX_ACT is the failsafe that does so.",
        source="COM_WIND_WARN, and COM_WIND_MAX for an error. Both are off by default",
        example="the wind reached 13.2 m/s, above 12.0 m/s for 8.0 s",
    ),
)
"""The rules."""
