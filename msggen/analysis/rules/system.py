"""The flight controller's processor and memory."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

HIGH = 0.9
"""The share of the processor or the memory."""


def _used(field: str, name: str, flight: Flight) -> Iterator[Seen]:
    column = flight.recorded.column("cpuload", field)
    stretch = flight.above(column, HIGH, armed=False)
    if column and stretch:
        values = {field: column.largest, "limit": HIGH}
        yield Seen(f"{name} reached {column.largest * 100:.0f} %", stretch.begin, stretch.end, values)


RULES = (
    FlightRule(
        "CPU_LOAD_HIGH",
        "the processor of the flight controller was nearly full",
        Category.FLIGHT,
        partial(_used, "load", "the load of the CPU"),
        severity=Severity.WARNING,
        needs=(("cpuload.load",),),
        fix="Stop modules that are not needed, lower IMU_GYRO_RATEMAX or the rates of telemetry and logging.",
        source="90 %",
        example="the load of the CPU reached 95 %",
    ),
    FlightRule(
        "MEMORY_LOW",
        "the memory of the flight controller was nearly full",
        Category.FLIGHT,
        partial(_used, "ram_usage", "the used memory"),
        severity=Severity.WARNING,
        needs=(("cpuload.ram_usage",),),
        fix="Stop modules that are not needed: PX4 ends with an error where memory is missing.",
        source="90 %",
        example="the used memory reached 95 %",
    ),
)
"""The rules."""
