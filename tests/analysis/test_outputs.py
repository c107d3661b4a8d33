"""Tests of actuator outputs, thrust against hover, and innovations with their gates."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen import analysis, recordings
from msggen.analysis.outputs import unit_of
from msggen.recordings import Log, RecordingError
from msggen.sources.embedded import EMBEDDED
from msggen.sources.read import read
from support.written import write_recording


def opened(path: Path, samples: Iterable[tuple[str, float, Any]]) -> Log:
    return recordings.open(str(write_recording(path / "flight.mcap", samples)))


def test_outputs_have_the_time_in_each_bin(tmp_path: Path, px4_types: Any) -> None:
    """Motor 1 is at 0.2 for a quarter of the time, and at 0.6 for the rest. The others are off, or never change."""
    motors, nan = px4_types.ActuatorMotors, math.nan
    samples = [
        ("/fmu/out/actuator_motors", step / 10, motors(control=(0.2 if step < 50 else 0.6, 0.5, *[nan] * 10)))
        for step in range(201)
    ]
    with opened(tmp_path, samples) as log:
        (found,) = analysis.actuator_outputs(log)
    assert (found.path, found.indices, found.labels) == ("actuator_motors.control", (0,), ("motor 1",))
    assert found.values.shape == (1, 201)
    assert (found.edges[0], found.edges[-1]) == (0, 1)
    shares = {round(float(edge), 2): float(share) for edge, share in zip(found.edges, found.shares[0], strict=False)}
    assert {edge: share for edge, share in shares.items() if share} == pytest.approx({0.2: 0.25, 0.6: 0.75}, abs=0.01)


def test_without_motors_and_servos_outputs_are_those_of_the_drivers(tmp_path: Path, px4_types: Any) -> None:
    made = px4_types.ActuatorOutputs
    samples = [
        ("/fmu/out/actuator_outputs", step / 10, made(noutputs=2, output=(1000.0 + step, 1500.0 - step, *range(14))))
        for step in range(100)
    ]
    with opened(tmp_path, samples) as log:
        (found,) = analysis.actuator_outputs(log)
    assert found.labels == ("output 1", "output 2")
    assert (found.edges[0], found.edges[-1]) == (1000, 1500)
    assert found.shares.sum(axis=1) == pytest.approx([1, 1])


def test_thrust_is_told_against_the_estimate_in_flight(tmp_path: Path, px4_types: Any) -> None:
    """The vehicle hovers with 0.4: a fifth of the flight has 0.6, and half has 0.3. On the ground it does not count."""
    samples: list[tuple[str, float, Any]] = []
    for step in range(200):
        time, landed = step / 10, step < 100
        thrust = 0.1 if landed else 0.6 if step < 120 else 0.3
        samples += [
            ("/fmu/out/vehicle_thrust_setpoint", time, px4_types.VehicleThrustSetpoint(xyz=(0.0, 0.0, -thrust))),
            ("/fmu/out/vehicle_land_detected", time, px4_types.VehicleLandDetected(landed=landed)),
            (
                "/fmu/out/hover_thrust_estimate",
                time,
                px4_types.HoverThrustEstimate(hover_thrust=0.9 if landed else 0.4, valid=not landed),
            ),
        ]
    with opened(tmp_path, samples) as log:
        found = analysis.hover_thrust(log)
    assert found.hover == pytest.approx(0.4)
    assert found.share_above == pytest.approx(0.2, abs=0.01)
    assert math.isnan(found.parameter)
    assert found.text == "the vehicle hovers with 0.40 by the estimate; more than 0.40 for 20 % of the flight"


def test_a_plane_does_not_hover(tmp_path: Path, px4_types: Any) -> None:
    made = px4_types.VehicleThrustSetpoint
    samples = [("/fmu/out/vehicle_thrust_setpoint", step / 10, made(xyz=(0.5, 0.0, 0.0))) for step in range(20)]
    with opened(tmp_path, samples) as log, pytest.raises(RecordingError, match="has no thrust upwards"):
        analysis.hover_thrust(log)


def test_gates_are_those_of_the_test_ratios(tmp_path: Path, px4_types: Any) -> None:
    source = px4_types.EstimatorAidSource1d
    samples = [
        ("/fmu/out/estimator_aid_src_baro_hgt", step / 10, source(innovation=step - 2, test_ratio=(step - 2) ** 2 / 9))
        for step in range(8)
    ]
    with opened(tmp_path, samples) as log:
        (found,) = analysis.innovations(log)
    assert found.label == "baro_hgt"
    assert np.array_equal(np.isnan(found.gate), found.values == 0)
    assert found.gate[found.values != 0] == pytest.approx(3)
    assert found.shares[0] == pytest.approx(-2 / 3)
    assert found.text == "baro_hgt: up to 5 m, 25 % beyond the gate"


def test_innovations_of_one_topic_have_gates_too(tmp_path: Path, px4_types: Any) -> None:
    made = px4_types.EstimatorInnovations
    samples = []
    for step in range(20):
        samples.append(("/fmu/out/estimator_innovations", step / 10, made(gps_hpos=(1.0, 0.0), hagl=2.0)))
        ratios = made(gps_hpos=(0.25, 0.0), hagl=4.0)
        samples.append(("/fmu/out/estimator_innovation_test_ratios", step / 10, ratios))
    with opened(tmp_path, samples) as log:
        found = {each.label: each for each in analysis.innovations(log)}
    assert set(found) == {"gps_hpos[0]", "hagl"}
    assert found["gps_hpos[0]"].gate[-1] == pytest.approx(2)
    assert found["hagl"].gate[-1] == pytest.approx(1)


def test_what_is_not_recorded_is_said(tmp_path: Path, px4_types: Any) -> None:
    samples = [("/fmu/out/vehicle_status", step / 10, px4_types.VehicleStatus()) for step in range(10)]
    with opened(tmp_path, samples) as log:
        assert analysis.actuator_outputs(log) == []
        assert analysis.innovations(log) == []
        for name in ("hover_thrust", "sensor_spectrum", "sensor_spectrogram"):
            with pytest.raises(RecordingError, match="the recording has no "):
                getattr(analysis, name)(log)
        assert all(each.verdict for each in analysis.step_responses(log))
        with pytest.raises(
            RecordingError, match=r"no topic of a gyroscope .* 'sensor_gyr', did you mean 'sensor_gyro'"
        ):
            analysis.sensor_spectrum(log, "sensor_gyr")


def test_innovations_of_all_sources_of_all_releases_have_units() -> None:
    for release in EMBEDDED:
        topics = (topic for message in read(release).uorb_messages for topic in message.topic_names)
        sources = [
            topic.removeprefix("estimator_aid_src_") for topic in topics if topic.startswith("estimator_aid_src_")
        ]
        assert len(sources) > 10
        assert [each for each in sources if not unit_of(each)] == []
