"""Tests of spectra: those of tones and chirps, whose frequencies are known, against scipy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from msggen.analysis.finding import Unsaid
from msggen.analysis.motion import ACCEL, GYRO, Sensor, motion_of
from msggen.analysis.recorded import Column, Recorded
from msggen.analysis.spectrum import Mark, Spectrogram, Spectrum, Windows, spectrogram_of, spectrum_of, windows_of
from support.lazy import Lazy

signal = Lazy("scipy.signal")

_SECONDS = 20.0


class _Samples(NamedTuple):
    array: Any

    def __len__(self) -> int:
        return len(self.array)


class _Log(NamedTuple):
    parameters: dict[str, float]


class Made(Recorded):
    """A recording of topics in memory: arrays with `timestamp_sample` in us, and parameters."""

    def __init__(self, topics: dict[str, Any], **parameters: float) -> None:
        self._made = {name: _Samples(array) for name, array in topics.items()}
        self.log: Any = _Log(parameters)
        self.topics: Any = {name: {0: None} for name in topics}
        self.duration = _SECONDS
        self._clocks = {}

    def samples(self, name: str, instance: int = 0) -> Any:
        return None if instance else self._made.get(name)

    def _seconds(self, samples: Any) -> Any:
        return samples.array["timestamp_sample"] / 1e6

    def column(self, name: str, field: str, instance: int = 0) -> Column | None:
        samples = self.samples(name, instance)
        front, _, place = field.partition("[")
        if samples is None or front not in (samples.array.dtype.names or ()):
            return None
        values = samples.array[front][:, int(place[0])] if place else samples.array[front]
        return Column(self._seconds(samples), values.astype(float), "", is_held=False, path=f"{name}.{field}")


def combined(times: Any, *axes: Any) -> Any:
    """Return samples of sensor_combined with a movement in deg/s, of the axes x, y and z."""
    found = np.zeros(len(times), [("timestamp_sample", "u8"), ("gyro_rad", "f8", 3), ("accelerometer_m_s2", "f8", 3)])
    found["timestamp_sample"] = np.rint(times * 1e6)
    for place, values in enumerate(axes):
        found["gyro_rad"][:, place] = np.radians(values)
        found["accelerometer_m_s2"][:, place] = values
    return found


def fifo(times: Any, values: Any, size: int = 8, scale: float = 0.01) -> Any:
    """Return messages of `size` samples of one axis in deg/s."""
    count = len(times) // size
    fields = [("timestamp_sample", "u8"), ("dt", "f4"), ("scale", "f4"), ("samples", "u1")]
    found = np.zeros(count, [*fields, *((axis, "i2", 32) for axis in "xyz")])
    found["timestamp_sample"] = np.rint(times[size - 1 : count * size : size] * 1e6)
    found["dt"], found["scale"], found["samples"] = (times[1] - times[0]) * 1e6, scale, size
    found["x"][:, :size] = np.rint(np.radians(values[: count * size]) / scale).reshape(count, size)
    found["x"][:, size:] = 30_000  # what is behind the samples is of earlier messages
    return found


def ticks(rate: float) -> Any:
    return np.arange(0, _SECONDS, 1 / rate)


def windows(recorded: Recorded, sensor: Sensor = GYRO) -> Windows | Unsaid:
    found = motion_of(recorded, sensor, spans=((0.0, _SECONDS),))
    return found if isinstance(found, Unsaid) else windows_of(found)


def spectrum(recorded: Recorded, sensor: Sensor = GYRO) -> Spectrum:
    found = windows(recorded, sensor)
    assert isinstance(found, Windows), found
    return spectrum_of(recorded, found)


def spectrogram(recorded: Recorded) -> Spectrogram:
    found = windows(recorded)
    assert isinstance(found, Windows), found
    return spectrogram_of(recorded, found)


@pytest.mark.parametrize("rate", [250.0, 799.0])
@pytest.mark.parametrize("frequency", [30.0, 61.7, 110.3])
def test_a_tone_has_its_frequency_and_its_amplitude(rate: float, frequency: float) -> None:
    times = ticks(rate)
    noise = np.random.default_rng(1).normal(size=len(times))
    found = spectrum(
        Made({"sensor_combined": combined(times, 3 * np.sin(2 * np.pi * frequency * times) + 0.1 * noise)})
    )
    where, how = found.peak(0)
    assert where == pytest.approx(frequency, rel=0.05)
    assert how == pytest.approx(3, rel=0.05)
    assert found.rate == pytest.approx(rate, rel=1e-3)
    assert found.path == "sensor_combined"


def test_densities_are_those_of_scipy() -> None:
    times = ticks(250)
    values = np.random.default_rng(1).normal(size=len(times)) + np.sin(2 * np.pi * 40 * times)
    found = spectrum(Made({"sensor_combined": combined(times, values)}), ACCEL)
    frequencies, density = signal.welch(values, found.rate, nperseg=2 * (len(found.frequencies) - 1))
    assert np.allclose(found.frequencies, frequencies)
    assert np.allclose(found.density[0], density, rtol=1e-6)
    _, powers = signal.welch(values, found.rate, nperseg=2 * (len(found.frequencies) - 1), scaling="spectrum")
    assert np.allclose(found.amplitude[0][1:-1], np.sqrt(2 * powers[1:-1]), rtol=1e-3)
    assert not found.density[1:].any()
    assert "strongest tone of x 40 Hz" in found.text
    assert (
        "no tone above 20 Hz"
        in spectrum(Made({"sensor_combined": combined(times, np.random.default_rng(1).normal(size=len(times)))})).text
    )


def test_the_fifo_is_read_sample_by_sample_at_its_measured_rate() -> None:
    """Its samples come faster than `dt` says, and values behind the number of samples are none."""
    times = ticks(8000.0)
    messages = fifo(times, 20 * np.sin(2 * np.pi * 1234 * times), scale=0.001)
    messages["dt"] *= 1.03
    low = combined(ticks(250), np.zeros(len(ticks(250))))
    found = spectrum(Made({"sensor_gyro_fifo": messages, "sensor_combined": low}))
    assert found.path == "sensor_gyro_fifo"
    assert found.rate == pytest.approx(8000, rel=1e-3)
    where, how = found.peak(0)
    assert where == pytest.approx(1234, rel=0.005)
    assert how == pytest.approx(20, rel=0.05)
    expected = "sensor_gyro_fifo, 8000 Hz: strongest tone of x 1234 Hz (20 deg/s); nothing above 4000 Hz is known"
    assert found.text == expected


@pytest.mark.parametrize("kind", ["sensor_combined", "sensor_gyro_fifo"])
def test_gaps_are_left_out(kind: str) -> None:
    """Half of the samples are missing, in holes, and where they are not the tone is as before."""
    rate = 250.0 if kind == "sensor_combined" else 2000.0
    times = ticks(rate)
    values = 50 * np.sin(2 * np.pi * 60 * times)
    made = combined(times, values) if kind == "sensor_combined" else fifo(times, values, scale=0.001)
    taken = made["timestamp_sample"] / 1e6
    kept = (taken % 4 < 2) & ((taken > 1.51) | (taken < 1.5))
    found = spectrum(Made({kind: made[kept]}))
    where, how = found.peak(0)
    assert where == pytest.approx(60, rel=0.02)
    assert how == pytest.approx(50, rel=0.05)
    assert found.rate == pytest.approx(rate, rel=0.01)
    gram = spectrogram(Made({kind: made[kept]}))
    middles = (gram.edges[1:] + gram.edges[:-1]) / 2
    assert np.isnan(gram.density[:, (middles % 4 > 2.3) & (middles % 4 < 3.7)]).all()
    assert np.isfinite(gram.density[:, (middles > 4) & (middles % 4 > 0.7) & (middles % 4 < 1.3)]).all()


def test_a_chirp_moves_through_the_spectrogram_as_in_that_of_scipy() -> None:
    times = ticks(500)
    values = signal.chirp(times, 20, _SECONDS, 200)
    found = spectrogram(Made({"sensor_combined": combined(times, values)}))
    middles = (found.edges[1:] + found.edges[:-1]) / 2
    inside = (middles > 1) & (middles < _SECONDS - 1)
    strongest = found.frequencies[np.argmax(found.density[:, inside], axis=0)]
    assert np.allclose(strongest, 20 + 180 * middles[inside] / _SECONDS, rtol=0.05, atol=2)
    length = 2 * (len(found.frequencies) - 1)
    _, when, theirs = signal.spectrogram(values, found.rate, "hann", length, length // 2)
    ours = found.density[:, np.searchsorted(found.edges, when[2:-2]) - 1]
    assert np.median(np.abs(ours.max(axis=0) / theirs[:, 2:-2].max(axis=0) - 1)) < 0.05


def test_a_long_recording_costs_no_more_than_some_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.analysis.spectrum._MOST_WINDOWS", 20)
    monkeypatch.setattr("msggen.analysis.spectrum._MOST_COLUMNS", 10)
    times = ticks(250)
    recorded = Made({"sensor_combined": combined(times, np.sin(2 * np.pi * 50 * times))})
    assert spectrum(recorded).windows == 20
    found = spectrogram(recorded)
    assert found.density.shape == (len(found.frequencies), 10)
    assert np.isfinite(found.density).all()


def test_filters_and_motors_are_marked() -> None:
    times = ticks(250)
    esc = np.zeros(100, [("timestamp_sample", "u8"), ("esc", [("esc_rpm", "i4")], 4)])
    esc["timestamp_sample"] = np.linspace(0, _SECONDS, 100) * 1e6
    esc["esc"]["esc_rpm"] = np.linspace(2400, -2700, 100)[:, None] * 0 + 2400
    recorded = _WithEsc({"sensor_combined": combined(times, times), "esc_status": esc},
                        IMU_GYRO_CUTOFF=40.0, IMU_GYRO_NF0_FRQ=0.0, IMU_GYRO_NF1_FRQ=90.0, IMU_DGYRO_CUTOFF=300.0,
                        IMU_ACCEL_CUTOFF=30.0, IMU_GYRO_DNF_EN=1, IMU_GYRO_DNF_HMC=2)  # fmt: skip
    assert spectrum(recorded).marks == (
        Mark("gyro cutoff", 40, 40),
        Mark("notch 1", 90, 90),
        Mark("motors, notched", 40, 40),
        Mark("motors, 2 per turn, notched", 80, 80),
        Mark("motors, 3 per turn", 120, 120),
    )
    assert [mark.label for mark in spectrum(recorded, ACCEL).marks] == [
        "accel cutoff",
        "motors",
        "motors, 2 per turn",
        "motors, 3 per turn",
    ]


class _WithEsc(Made):
    armed = ((0.0, _SECONDS),)

    def column(self, name: str, field: str, instance: int = 0) -> Column | None:
        if name != "esc_status":
            return super().column(name, field, instance)
        samples = self.samples(name)
        return Column(self._seconds(samples), samples.array["esc"]["esc_rpm"][:, 0].astype(float), "", is_held=True)

    def width(self, name: str, field: str, instance: int = 0) -> int:
        del field, instance
        return 4 if name in self.topics else 0


@pytest.mark.parametrize(
    ("topics", "reason"),
    [
        ({}, "the recording has no sensor_gyro_fifo, sensor_gyro, sensor_combined, vehicle_angular_velocity"),
        (
            {"sensor_combined": combined(ticks(5), ticks(5))},
            "too few samples: 5 Hz of sensor_combined, a spectrum needs",
        ),
        ({"sensor_combined": combined(ticks(250)[:20], ticks(250)[:20])}, "no 1.0 s of sensor_combined without a gap"),
        ({"sensor_combined": combined(ticks(250), ticks(250) * np.nan)}, "no 1.0 s of sensor_combined without a gap"),
        ({"sensor_combined": combined(ticks(250), ticks(250) + 1e30)}, "no 1.0 s of sensor_combined without a gap"),
    ],
)
def test_what_tells_nothing_says_why(topics: dict[str, Any], reason: str) -> None:
    found = windows(Made(topics))
    assert isinstance(found, Unsaid)
    assert found.reason.startswith(reason)
