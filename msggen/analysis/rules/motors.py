"""Motors and servos."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

SATURATED = 0.99
_MOST = 0.05
"""The share of the time armed in which a motor may be at its limit."""
_LONGEST = 1.0
"""The same in s."""


def _saturated(flight: Flight) -> Iterator[Seen]:
    recorded, armed = flight.recorded, flight.seconds_armed
    for index in range(recorded.width("actuator_motors", "control")):
        stretch = flight.above(recorded.column("actuator_motors", f"control[{index}]"), SATURATED)
        if stretch and armed > 0 and stretch.seconds > max(_MOST * armed, _LONGEST):
            share = stretch.seconds / armed
            at = f"{stretch.seconds:.1f} s, {100 * share:.0f} % of the time armed"
            values = {"motor": index + 1, "saturated_s": stretch.seconds, "share": share, "limit": SATURATED}
            yield Seen(f"motor {index + 1} was at its limit for {at}", stretch.begin, stretch.end, values)


RULES = (
    FlightRule(
        "MOTOR_SATURATED",
        "a motor was at its limit for long, so the vehicle could not be controlled",
        Category.FLIGHT,
        _saturated,
        severity=Severity.WARNING,
        needs=(("actuator_motors",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="The vehicle is too heavy, its battery too weak, a propeller or motor is damaged, or its gains are too "
        "high. If it is one motor only, look at that one and the one opposite.",
        source="99 % of the range for 5 % of the time armed, and for a second",
        example="motor 1 was at its limit for 4.9 s, 100 % of the time armed",
    ),
)
"""The rules."""
