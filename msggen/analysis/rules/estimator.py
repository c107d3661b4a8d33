"""What the estimator rejected, and where its estimates jumped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees, isfinite, nan
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.analysis.finding import FlightRule, Seen
from msggen.base.diagnostics import counted

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

_LOCAL = "vehicle_local_position"
LONGEST = 1.0
"""The time in s for which measurements may be rejected."""
_TESTED: Mapping[str, str] = MappingProxyType(
    {
        "vel": "velocity",
        "pos": "position",
        "hgt": "height",
        "hdg": "heading",
        "mag": "magnetic field",
        "tas": "airspeed",
        "hagl": "height above ground",
    }
)
"""What the estimator tests, by the fronts of its ratios."""


class _Reset(NamedTuple):
    """An estimate that can jump."""

    name: str
    counter: str
    sizes: tuple[str, ...]
    """The fields with the size of the last jump, in each direction."""
    scale: float
    unit: str
    limit: float
    """The size from which a jump is a warning."""
    parameter: str = ""
    """The parameter that has this limit."""


_RESETS = (
    _Reset("horizontal position", "xy_reset_counter", ("delta_xy[0]", "delta_xy[1]"), 1, "m", 5.0, "COM_POS_FS_EPH"),
    _Reset("height", "z_reset_counter", ("delta_z",), 1, "m", 5.0),
    _Reset(
        "horizontal velocity", "vxy_reset_counter", ("delta_vxy[0]", "delta_vxy[1]"), 1, "m/s", 1.0, "COM_VEL_FS_EVH"
    ),
    _Reset("vertical velocity", "vz_reset_counter", ("delta_vz",), 1, "m/s", 1.0),
    _Reset("heading", "heading_reset_counter", ("delta_heading",), degrees(1), "deg", 30.0),
)


def _rejected(flight: Flight) -> Iterator[Seen]:
    for name, word in _TESTED.items():
        for estimator, (ratio,) in flight.estimated("estimator_status", f"{name}_test_ratio"):
            stretch = flight.above(ratio, 1.0)
            if stretch and stretch.seconds >= LONGEST:
                worst = ratio.within(flight.recorded.armed).largest
                at = f"{stretch.seconds:.1f} s, with a test ratio of up to {worst:.1f}"
                values = {"rejected_s": stretch.seconds, "test_ratio": worst}
                yield Seen(f"{estimator} rejected the {word} for {at}", stretch.begin, stretch.end, values)


def _resets(flight: Flight) -> Iterator[Seen]:
    for reset in _RESETS:
        jumps = flight.changes(flight.recorded.column(_LOCAL, reset.counter))
        if not len(jumps):
            continue
        sizes = [column for each in reset.sizes if (column := flight.recorded.column(_LOCAL, each))]
        squares: Any = sum(each.at(jumps) ** 2 for each in sizes)
        worst = float(max(squares)) ** 0.5 * reset.scale if sizes else nan
        told = flight.parameter(reset.parameter, reset.limit)
        limit = told if told > 0 else reset.limit  # PX4's check can be off
        by = f" by up to {worst:.1f} {reset.unit}" if isfinite(worst) else ""
        text = f"the estimate of the {reset.name} jumped {counted(len(jumps), 'time')}{by} while armed"
        unit = reset.unit.replace("/", "_")
        values = {"resets": len(jumps), f"size_{unit}": worst, f"limit_{unit}": limit}
        yield Seen(text, float(jumps[0]), float(jumps[-1]), values, "warning" if worst > limit else "info")


RULES = (
    FlightRule(
        "INNOVATIONS_REJECTED",
        "the estimator rejected measurements of a sensor for a second or more",
        _rejected,
        needs=(tuple(f"estimator_status.{name}_test_ratio" for name in _TESTED),),
        uses=("vehicle_status", "actuator_armed", "estimator_selector_status"),
        fix="Look at the innovations in the report. Check the sensor: a compass near power lines, a GPS antenna "
        "without a view of the sky, vibration.",
        source="a test ratio above 1 is beyond the gate of EKF2, of the instance in estimator_selector_status",
        example="the estimator rejected the height for 4.9 s, with a test ratio of up to 2.3",
    ),
    FlightRule(
        "ESTIMATE_RESET",
        "an estimate jumped in flight",
        _resets,
        needs=(tuple(f"{_LOCAL}.{reset.counter}" for reset in _RESETS),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Nothing for a single reset after takeoff. Repeated ones follow rejected measurements, or a sensor that "
        "comes and goes.",
        source="the reset counters of vehicle_local_position. A warning for jumps of more than COM_POS_FS_EPH, 5 m by "
        "default, COM_VEL_FS_EVH, 1 m/s, or 30° of the heading; smaller ones are notes",
        example="the estimate of the heading jumped 2 times by up to 41.0 deg while armed",
    ),
)
"""The rules."""
