"""What the estimator rejected, and where its estimates jumped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.base.diagnostics import counted
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

LONGEST = 1.0
"""The time in s for which measurements may be rejected."""
_TESTED: Mapping[str, str] = MappingProxyType(
    {"vel": "velocity", "pos": "position", "hgt": "height", "hdg": "heading", "mag": "magnetic field"}
)
"""What the estimator tests, by the fronts of its ratios."""
_RESET: Mapping[str, str] = MappingProxyType({"xy": "horizontal position", "z": "height", "heading": "heading"})
"""The estimates that jump, by the fronts of their counters."""


def _rejected(flight: Flight) -> Iterator[Seen]:
    for name, word in _TESTED.items():
        stretch = flight.above(flight.recorded.column("estimator_status", f"{name}_test_ratio"), 1.0)
        if stretch and stretch.seconds >= LONGEST:
            text = f"the estimator rejected the {word} for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, {"rejected_s": stretch.seconds})


def _resets(flight: Flight) -> Iterator[Seen]:
    for name, word in _RESET.items():
        jumps = flight.changes(flight.recorded.column("vehicle_local_position", f"{name}_reset_counter"))
        if jumps:
            text = f"the estimate of the {word} jumped {counted(len(jumps), 'time')} while armed"
            yield Seen(text, jumps[0], jumps[-1], {"resets": len(jumps)}, "info")


RULES = (
    FlightRule(
        "INNOVATIONS_REJECTED",
        "the estimator rejected measurements of a sensor for a second or more",
        Category.FLIGHT,
        _rejected,
        severity=Severity.WARNING,
        needs=(("estimator_status",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Look at the innovations in the report. Check the sensor: a compass near power lines, a GPS antenna "
        "without a view of the sky, vibration.",
        source="a test ratio above 1 is beyond the gate of EKF2",
        example="the estimator rejected the height for 4.9 s",
    ),
    FlightRule(
        "ESTIMATE_RESET",
        "an estimate jumped in flight",
        Category.FLIGHT,
        _resets,
        severity=Severity.WARNING,
        needs=(("vehicle_local_position",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Nothing for a single reset after takeoff. Repeated ones follow rejected measurements, or a sensor that "
        "comes and goes.",
        source="the reset counters of vehicle_local_position",
        example="the estimate of the heading jumped 2 times while armed",
    ),
)
"""The rules."""
