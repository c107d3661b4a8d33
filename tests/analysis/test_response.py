"""Tests of step responses: those of systems of second order, whose responses are known."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.analysis.recorded import Column, Recorded
from msggen.analysis.response import LOOPS, TOPICS, Loop, Response, response_of, responses_of
from msggen.analysis.sampling import TOPICS as FLOWN
from support.examples import by_day
from support.lazy import Lazy
from support.written import write_recording

signal = Lazy("scipy.signal")

_RATE, _SECONDS = 1000, 40
"""The samples per second of the systems, and how long they run."""
_ATTITUDE, _RATES = LOOPS[0], LOOPS[3]
_SYSTEMS = ((_RATES, 30.0, 0.5), (_RATES, 60.0, 0.4), (_RATES, 15.0, 0.6), (_ATTITUDE, 8.0, 0.6), (_ATTITUDE, 5.0, 0.8))
_INPUTS = ("noise", "slow", "chirp", "steps")


def moved(kind: str, seed: int = 1) -> np.ndarray[Any, Any]:
    """Return a setpoint in deg or deg/s: filtered noise, steps after random times, or a chirp."""
    chance, count = np.random.default_rng(seed), _RATE * _SECONDS
    if kind == "chirp":
        return np.asarray(30 * signal.chirp(np.arange(count) / _RATE % 20, 0.1, 20, 15))
    if kind == "steps":
        lengths = chance.integers(200, 800, count // 200)
        return np.repeat(30 * chance.normal(size=len(lengths)), lengths)[:count]
    found = signal.lfilter(*signal.butter(2, 8 if kind == "noise" else 2, fs=_RATE), chance.normal(size=count))
    return np.asarray(30 * found / found.std())


def followed(setpoint: np.ndarray[Any, Any], frequency: float, damping: float) -> np.ndarray[Any, Any]:
    """Return what a system of second order makes of a setpoint."""
    system = [frequency**2], [1, 2 * damping * frequency, frequency**2]
    above, below, _ = signal.cont2discrete(system, 1 / _RATE, "foh")
    return np.asarray(signal.lfilter(above[0], below, setpoint))


@cache
def truth(frequency: float, damping: float) -> tuple[float, float]:
    """Return the time in s to half of the step, and the overshoot, as scipy has them."""
    times = np.arange(0, 3, 1e-3)
    _, step = signal.step(([frequency**2], [1, 2 * damping * frequency, frequency**2]), T=times)
    return float(np.interp(0.5, step[: np.argmax(step)], times[: np.argmax(step)])), float(step.max()) - 1


def column(values: np.ndarray[Any, Any], every: int, unit: str = "") -> Column:
    """Return each so manieth value."""
    return Column(np.arange(len(values))[::every] / _RATE, values[::every], unit, is_held=False, path="topic.field")


def found(loop: Loop, setpoint: Column, measured: Column) -> Response:
    return response_of(loop, setpoint, measured, ((0.0, float(_SECONDS)),))


@by_day("kind", _INPUTS, 2)
@pytest.mark.parametrize(("loop", "frequency", "damping"), _SYSTEMS)
def test_delay_and_overshoot_are_those_of_the_system(loop: Loop, frequency: float, damping: float, kind: str) -> None:
    setpoint = moved(kind)
    response = found(loop, column(setpoint, 4), column(followed(setpoint, frequency, damping), 4))
    delay, overshoot = truth(frequency, damping)
    assert response.verdict == ""
    assert response.delay == pytest.approx(delay, rel=0.05, abs=0.002)  # a setpoint is known each 4 ms
    assert response.overshoot == pytest.approx(overshoot, abs=0.05)
    assert response.final == pytest.approx(1, abs=0.05)
    assert len(response.times) == len(response.mean) == len(response.spread)
    assert response.fit > 0.98


def test_noise_grows_the_spread_and_leaves_the_response() -> None:
    setpoint, chance = moved("noise"), np.random.default_rng(2)
    clean = followed(setpoint, 30, 0.5)
    spreads = []
    for share in (0.0, 0.1, 0.3):
        noisy = clean + share * clean.std() * chance.normal(size=len(clean))
        response = found(_RATES, column(setpoint, 10), column(noisy, 5))
        delay, overshoot = truth(30, 0.5)
        assert response.delay == pytest.approx(delay, rel=0.05)
        assert response.overshoot == pytest.approx(overshoot, abs=0.05)
        spreads.append(float(response.spread.mean()))
    assert spreads == sorted(spreads)


def test_gaps_numbers_that_are_none_and_irregular_times_leave_the_response() -> None:
    setpoint, chance = moved("noise"), np.random.default_rng(3)
    measured = column(followed(setpoint, 30, 0.5), 4)
    wanted = column(setpoint, 4)
    expected = truth(30, 0.5)
    kept = ~((measured.times > 10) & (measured.times < 13)) & (chance.random(len(measured.times)) > 0.2)
    values = np.where(chance.random(len(measured.times)) < 0.05, chance.choice([np.nan, np.inf, 1e30]), measured.values)
    broken = measured._replace(times=measured.times[kept], values=values[kept])
    response = found(_RATES, wanted, broken)
    assert response.delay == pytest.approx(expected[0], rel=0.05)
    assert response.overshoot == pytest.approx(expected[1], abs=0.05)
    jumped = broken._replace(times=broken.times + 1e8 * (broken.times > 20))
    assert found(_RATES, wanted, jumped).overshoot == pytest.approx(expected[1], abs=0.05)


def test_a_yaw_that_turns_around_is_no_jump() -> None:
    loop, setpoint = LOOPS[2], moved("slow")
    turned = [(each + 350) % 360 - 180 for each in (setpoint, followed(setpoint, 8, 0.6))]
    response = found(loop, *(column(each, 10, "deg") for each in turned))
    delay, overshoot = truth(8, 0.6)
    assert response.delay == pytest.approx(delay, rel=0.05)
    assert response.overshoot == pytest.approx(overshoot, abs=0.05)


def test_too_little_excitation_is_said_with_what_was_measured() -> None:
    setpoint = moved("noise") / 30
    response = found(_RATES, column(setpoint, 4), column(followed(setpoint, 30, 0.5), 4))
    assert response.verdict.startswith(
        f"too little excitation: the setpoint changed by up to {response.excitation:.1f} deg/s"
    )
    assert 1 < response.excitation < 20
    assert not len(response.mean)
    assert np.isnan(response.delay)
    assert np.isnan(response.overshoot)
    assert np.isnan(response.settling)


@pytest.mark.parametrize(
    ("every", "shift", "verdict"),
    [
        (200, 0.0, "too few samples: 5 Hz of topic, at least 17 Hz are needed"),
        (4, 1e9, "no 1 s of flight without a gap has samples of both"),
    ],
)
def test_samples_that_do_not_suit_are_said(every: int, shift: float, verdict: str) -> None:
    setpoint = moved("noise")
    measured = column(followed(setpoint, 30, 0.5), every)
    response = found(_RATES, column(setpoint, 4), measured._replace(times=measured.times + shift))
    assert response.verdict.startswith(verdict)


def test_what_does_not_follow_has_no_response() -> None:
    response = found(_RATES, column(moved("noise"), 4), column(moved("noise", seed=9), 4))
    assert response.verdict.startswith("the vehicle did not follow the setpoint: ")


def test_a_flight_whose_parts_differ_has_no_response() -> None:
    setpoint = moved("noise")
    gains = np.where(np.arange(len(setpoint)) // (len(setpoint) // 8) % 2, 0.2, 2.5)
    response = found(_RATES, column(setpoint, 4), column(followed(setpoint, 30, 0.5) * gains, 4))
    assert response.verdict.startswith("not known: parts of the flight differ by 0.8 of a step")
    assert not len(response.mean)


def test_a_recording_has_the_response_of_each_loop(tmp_path: Path, px4_types: Any) -> None:
    wanted = np.radians(moved("noise"))
    rates, angles = followed(wanted, 30, 0.5), np.radians(moved("slow"))
    turned = followed(angles, 8, 0.6)
    samples: list[tuple[str, float, Any]] = []
    for index in range(0, len(wanted), 20):
        time, boot = index / _RATE, 1_000_000 + index * 1000
        late = time + 0.003 * (index % 3)  # samples arrive at other times than they were taken
        samples += [
            (
                "/fmu/out/vehicle_rates_setpoint",
                late,
                px4_types.VehicleRatesSetpoint(timestamp=boot, roll=wanted[index]),
            ),
            (
                "/fmu/out/vehicle_angular_velocity",
                time,
                px4_types.VehicleAngularVelocity(timestamp=boot, timestamp_sample=boot, xyz=(rates[index], 0.0, 0.0)),
            ),
            (
                "/fmu/out/vehicle_attitude",
                time,
                px4_types.VehicleAttitude(
                    timestamp=boot, q=(np.cos(turned[index] / 2), np.sin(turned[index] / 2), 0.0, 0.0)
                ),
            ),
            (
                "/fmu/out/vehicle_attitude_setpoint",
                time,
                px4_types.VehicleAttitudeSetpoint(
                    timestamp=boot, q_d=(np.cos(angles[index] / 2), np.sin(angles[index] / 2), 0.0, 0.0)
                ),
            ),
        ]
    path = write_recording(tmp_path / "flight.mcap", sorted(samples, key=lambda sample: sample[1]))
    with recordings.open(str(path)) as log:
        recorded = Recorded(log, lambda name: name in TOPICS or name in FLOWN)
    responses = {each.loop.name: each for each in responses_of(recorded)}
    for name, frequency, damping in (("roll", 8, 0.6), ("roll rate", 30, 0.5)):
        delay, overshoot = truth(frequency, damping)
        assert responses[name].delay == pytest.approx(delay, rel=0.05), responses[name].text
        assert responses[name].overshoot == pytest.approx(overshoot, abs=0.05)
    assert responses["yaw"].verdict.startswith("too little excitation")
    assert responses["pitch rate"].verdict.startswith("too little excitation")


def test_a_recording_without_setpoints_says_which_are_missing(tmp_path: Path, px4_types: Any) -> None:
    local = [("/fmu/out/vehicle_attitude", step / 50, px4_types.VehicleAttitude(q=(1, 0, 0, 0))) for step in range(100)]
    with recordings.open(str(write_recording(tmp_path / "bare.mcap", local))) as log:
        recorded = Recorded(log, lambda name: name in TOPICS)
    texts = [each.text for each in responses_of(recorded)]
    assert texts[0] == "roll: the recording has no vehicle_attitude_setpoint"
    assert texts[3] == "roll rate: the recording has no vehicle_angular_velocity"
