"""Batteries."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

LOW = 0.15
"""The share of a battery below which it is low: the default of BAT_LOW_THR."""


def _low(flight: Flight) -> Iterator[Seen]:
    for instance in flight.recorded.batteries():
        share = flight.recorded.column("battery_status", "remaining", instance)
        known = share.known(0.0) if share else None
        stretch = flight.below(known, LOW, armed=False)
        if known and stretch:
            values = {"battery": instance, "remaining": known.smallest, "limit": LOW}
            yield Seen(f"the battery fell to {known.smallest * 100:.0f} %", stretch.begin, stretch.end, values)


RULES = (
    FlightRule(
        "BATTERY_LOW",
        "a battery was nearly empty",
        Category.FLIGHT,
        _low,
        severity=Severity.WARNING,
        needs=(("battery_status.remaining",),),
        fix="Land earlier, or set COM_LOW_BAT_ACT, the failsafe that does so. Check BAT1_CAPACITY and the calibration "
        "of voltage and current if the battery was not empty.",
        source="BAT_LOW_THR, 15 % by default",
        example="the battery fell to 10 %",
    ),
)
"""The rules."""
