"""The flight controller's processor and memory."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

_HIGH = 95.0
"""The share of the processor or the memory in % that PX4 takes for too much by default."""


def _used(field: str, name: str, parameter: str, least: float, flight: Flight) -> Iterator[Seen]:
    column = flight.recorded.column("cpuload", field)
    told = flight.parameter(parameter, _HIGH)
    limit = (told if told > 0 else _HIGH) / 100  # PX4's check can be off
    stretch = flight.above(column, limit, flight.whole)
    if column and stretch and stretch.seconds >= least:
        values = {field: column.largest, "limit": limit, "above_s": stretch.seconds}
        yield Seen(f"{name} reached {column.largest * 100:.0f} %", stretch.begin, stretch.end, values)


RULES = (
    FlightRule(
        "CPU_LOAD_HIGH",
        "the processor of the flight controller was nearly full",
        partial(_used, "load", "the load of the CPU", "COM_CPU_MAX", 2.0),
        needs=(("cpuload.load",),),
        fix="Stop modules that are not needed, lower IMU_GYRO_RATEMAX or the rates of telemetry and logging.",
        source="COM_CPU_MAX, 95 % by default, for 2 s, over which PX4 averages",
        example="the load of the CPU reached 98 %",
    ),
    FlightRule(
        "MEMORY_LOW",
        "the memory of the flight controller was nearly full",
        partial(_used, "ram_usage", "the used memory", "COM_RAM_MAX", 0.0),
        needs=(("cpuload.ram_usage",),),
        fix="Stop modules that are not needed: PX4 ends with an error where memory is missing.",
        source="COM_RAM_MAX, 95 % by default",
        example="the used memory reached 98 %",
    ),
)
"""The rules."""
