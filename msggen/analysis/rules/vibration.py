"""Vibration of the sensors of acceleration and rotation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.base.diagnostics import counted

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

HIGH, SEVERE = 4.9, 9.8
"""Half of the earth's acceleration, and all of it, in m/s²."""


def _high(flight: Flight) -> Iterator[Seen]:
    for instance in flight.recorded.instances("vehicle_imu_status"):
        metric = flight.recorded.while_armed("vehicle_imu_status", "accel_vibration_metric", instance)
        worst = metric.largest if metric else 0.0
        if metric and worst >= HIGH:
            level, word, limit = ("error", "severe", SEVERE) if worst >= SEVERE else ("warning", "high", HIGH)
            stretch = flight.above(metric, HIGH)
            begin, end = (stretch.begin, stretch.end) if stretch else (None, None)
            values = {"imu": instance, "vibration_m_s2": worst, "limit_m_s2": limit}
            yield Seen(f"{word} vibration of IMU {instance}: up to {worst:.1f} m/s²", begin, end, values, level)


def _clipped(flight: Flight) -> Iterator[Seen]:
    recorded = flight.recorded
    for instance in recorded.instances("vehicle_imu_status"):
        clips = [recorded.column("vehicle_imu_status", f"accel_clipping[{axis}]", instance) for axis in range(3)]
        rises = [found for each in clips if each and len((found := flight.rises(each)).finite)]
        if rises:
            grown = sum(float(each.finite.sum()) for each in rises)
            begin, end = min(float(each.times[0]) for each in rises), max(float(each.times[-1]) for each in rises)
            text = f"the accelerometer of IMU {instance} reached its limit {counted(int(grown), 'time')} while armed"
            yield Seen(text, begin, end, {"imu": instance, "clips": grown})


RULES = (
    FlightRule(
        "VIBRATION_HIGH",
        "an accelerometer vibrates so much that the estimate suffers",
        _high,
        needs=(("vehicle_imu_status.accel_vibration_metric",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Balance propellers and motors, look for loose parts and cables, and mount the flight controller softly.",
        source="half of the earth's acceleration is high, all of it is severe",
        example="high vibration of IMU 0: up to 6.0 m/s²",
    ),
    FlightRule(
        "ACCEL_CLIPPED",
        "an accelerometer reached the end of its range",
        _clipped,
        needs=(("vehicle_imu_status.accel_clipping[0]",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Treat it as severe vibration: the estimate of velocity and height is wrong where values are cut off.",
        source="`accel_clipping` of vehicle_imu_status counts values at the limit",
        example="the accelerometer of IMU 0 reached its limit 12 times while armed",
    ),
)
"""The rules."""
