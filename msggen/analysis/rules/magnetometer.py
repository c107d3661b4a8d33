"""The magnetic field: what disturbs it, and whether the motors do."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

_LONGEST = 1.0
"""The time in s for which the field may be disturbed."""
_CORRELATION, _CHANGE = 0.7, 0.03
"""How closely the field follows the thrust, and the standard deviation of a thrust that changes."""


def _disturbed(flight: Flight) -> Iterator[Seen]:
    yield from list(_off(flight)) or _flagged(flight)


def _off(flight: Flight) -> Iterator[Seen]:
    limit = flight.parameter("EKF2_MAG_CHK_STR", 0.2)
    for name, (found, expected) in flight.estimated("estimator_status", "mag_strength_gs", "mag_strength_ref_gs"):
        off = found._replace(values=abs(found.values - expected.known(1e-3).values))
        stretch = flight.above(off, limit, flight.in_air)
        if stretch and stretch.seconds >= _LONGEST:
            worst = off.within(flight.in_air).largest
            values = {"off_ga": worst, "expected_ga": expected.largest, "limit_ga": limit, "off_s": stretch.seconds}
            of = "" if name == "the estimator" else f" of {name}"
            text = f"the magnetic field{of} was off by up to {worst:.2f} Ga for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, values)


def _flagged(flight: Flight) -> Iterator[Seen]:
    for name, (flag,) in flight.estimated("estimator_status_flags", "cs_mag_field_disturbed"):
        stretch = flight.above(flag, 0.0, flight.in_air)
        if stretch and stretch.seconds >= _LONGEST:
            text = f"{name} found the magnetic field disturbed for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, {"disturbed_s": stretch.seconds})


def _follows(flight: Flight) -> Iterator[Seen | Unsaid]:
    instances = flight.recorded.instances("vehicle_magnetometer")
    found = [
        each
        for instance in instances
        for each in _one_follows(flight, instance, f" of magnetometer {instance}" if instances[1:] else "")
    ]
    yield from [each for each in found if isinstance(each, Seen)] or found[:1]


def _one_follows(flight: Flight, instance: int, of: str) -> Iterator[Seen | Unsaid]:
    field = flight.length("vehicle_magnetometer", "magnetometer_ga", instance)
    thrust = flight.length("vehicle_thrust_setpoint", "xyz")
    found = field.within(flight.in_air).fit(thrust) if field and thrust else None
    if not found or not thrust or found.spread < _CHANGE:
        yield Unsaid("the thrust hardly changed in flight")
        return
    flown = thrust.within(flight.in_air)
    change, limit = abs(found.slope) * (flown.largest - flown.smallest), flight.parameter("EKF2_MAG_NOISE", 0.05)
    if abs(found.correlation) >= _CORRELATION and change > limit:
        values = {"change_ga": change, "limit_ga": limit, "correlation": found.correlation}
        at = f"{change:.2f} Ga with the thrust (correlation {found.correlation:.2f})"
        text = f"the magnetic field{of} changes by {at}"
        yield Seen(text, values=values)


RULES = (
    FlightRule(
        "MAG_DISTURBED",
        "the strength of the magnetic field was not that of the place",
        _disturbed,
        needs=(("estimator_status.mag_strength_ref_gs", "estimator_status_flags.cs_mag_field_disturbed"),),
        uses=(
            "vehicle_status",
            "actuator_armed",
            "vehicle_land_detected",
            "estimator_status",
            "estimator_selector_status",
        ),
        fix="Keep away from steel, power lines and reinforced concrete, mount the compass away from cables with high "
        "currents, and calibrate it.",
        source="EKF2_MAG_CHK_STR, 0.2 Ga by default, for a second; or the estimator's own flag",
        example="the magnetic field was off by up to 0.31 Ga for 4.0 s",
    ),
    FlightRule(
        "MAG_FOLLOWS_THRUST",
        "the magnetic field follows the thrust: the currents of the motors disturb the compass",
        _follows,
        needs=(("vehicle_magnetometer.magnetometer_ga[0]",), ("vehicle_thrust_setpoint.xyz[0]",)),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected"),
        fix="Mount the compass away from the cables of battery and motors, twist them, or set "
        "CAL_MAG_COMP_TYP and compensate.",
        source="a correlation of 0.7, and a change larger than EKF2_MAG_NOISE, 0.05 Ga by default",
        example="the magnetic field changes by 0.12 Ga with the thrust (correlation 0.94)",
    ),
)
"""The rules."""
