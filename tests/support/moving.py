"""A flight that tells step responses, spectra and the rest: of a rate that follows its setpoint, and tones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

from support.written import write_recording

SECONDS, RATE = 20.0, 100
DELAY = 0.05
"""The time in s after which rates and angles follow their setpoints."""
TONE = 30.0
"""The frequency in Hz of the vibration."""


def messages_of(package: Any) -> Iterator[tuple[str, float, Any]]:
    """Yield the samples of a flight in the order of time: the name in uORB, the time in s, and the message."""
    chance = Random(1)  # noqa: S311 - no secret
    targets = [chance.uniform(-0.8, 0.8) for _ in range(round(SECONDS / 0.4) + 1)]

    def target(time: float) -> float:
        return targets[int(time / 0.4)] if time >= 0 else 0.0

    def turned(angle: float) -> tuple[float, float, float, float]:
        return math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0

    for step in range(round(SECONDS * RATE)):
        time = step / RATE
        stamp: Any = {"timestamp": round(time * 1e6) + 1}
        wanted, followed, shaken = target(time), target(time - DELAY), math.sin(2 * math.pi * TONE * time)
        yield "vehicle_rates_setpoint", time, package.VehicleRatesSetpoint(roll=wanted, **stamp)
        yield "vehicle_angular_velocity", time, package.VehicleAngularVelocity(xyz=(followed, 0.0, 0.0), **stamp)
        yield "vehicle_attitude_setpoint", time, package.VehicleAttitudeSetpoint(q_d=turned(wanted), **stamp)
        yield "vehicle_attitude", time, package.VehicleAttitude(q=turned(followed), **stamp)
        moved = {"gyro_rad": (shaken / 10, 0.0, 0.0), "accelerometer_m_s2": (0.0, shaken, -9.8)}
        yield "sensor_combined", time, package.SensorCombined(**moved, **stamp)
        thrust = 0.5 + 0.1 * wanted
        yield "vehicle_thrust_setpoint", time, package.VehicleThrustSetpoint(xyz=(0.0, 0.0, -thrust), **stamp)
        yield "actuator_motors", time, package.ActuatorMotors(control=(thrust,) * 4 + (math.nan,) * 8, **stamp)
        source = package.EstimatorAidSource1d(innovation=wanted, test_ratio=wanted**2, **stamp)
        yield "estimator_aid_src_baro_hgt", time, source


def write_moving(path: Path, package: Any) -> Path:
    """Write the flight as an MCAP file."""
    return write_recording(path, ((f"/fmu/out/{name}", time, made) for name, time, made in messages_of(package)))
