"""Spectra of gyroscopes and accelerometers, with the frequencies of filters and motors.

The samples are those of the sensor's FIFO where the recording has them, or else of the topic with the most samples per
second. Spectra are averages over windows (Welch's method). A window with a gap is left out; no sample is made up.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.analysis.finding import Unsaid
from msggen.analysis.recorded import Recorded
from msggen.analysis.sampling import Spans, flown, runs, usual_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_WINDOWS, _MOST_COLUMNS = 1200, 300
"""The windows of a recording at most, and the columns of a spectrogram."""
_WINDOW, _SHORTEST, _LONGEST = 0.8, 64, 2048
"""About how long a window is, in s, and how many samples it has: a power of two."""
_SLOWEST = 20.0
"""The samples per second from which a spectrum tells something."""
_JITTER = 1.5
"""The number of usual intervals from which a time without samples is a gap."""
_LARGEST = 1e6
"""Values beyond it are damaged."""
_AT_ONCE = 64
_FLYING = 20.0
"""The frequency in Hz up to which a vehicle moves because it flies, and not because it vibrates."""
_WIDTH = 2
"""The bins on both sides of a peak that belong to it: the main lobe of a Hann window."""
_AROUND, _TONE = 16, 6.0
"""The bins on both sides of a tone whose median is the noise, and by how much the tone is stronger."""
_QUIETEST, _LOUDEST = 5.0, 99.9
"""The percentiles of a spectrogram between which colours differ."""
_FLOOR = 1e-20
"""The density that stands for none."""


class Sensor(NamedTuple):
    """What can be measured, and where the samples can be from."""

    name: str
    title: str
    unit: str
    scale: float
    """The factor from the unit in the recording."""
    fifo: str
    topics: tuple[tuple[str, tuple[str, ...]], ...]
    """Topics and their fields of the axes x, y and z."""
    filters: tuple[tuple[str, str], ...]
    """The names of the filters, and the parameters with their frequencies."""

    @property
    def names(self) -> tuple[str, ...]:
        """The topics, the one with the most samples per second first."""
        return self.fifo, *(topic for topic, _ in self.topics)


def _array(field: str) -> tuple[str, ...]:
    return tuple(f"{field}[{place}]" for place in range(3))


SENSORS = (
    Sensor(
        "gyro",
        "Angular rate",
        "deg/s",
        180 / np.pi,
        "sensor_gyro_fifo",
        (
            ("sensor_gyro", ("x", "y", "z")),
            ("sensor_combined", _array("gyro_rad")),
            ("vehicle_angular_velocity", _array("xyz")),
        ),
        (
            ("gyro cutoff", "IMU_GYRO_CUTOFF"),
            ("D-term cutoff", "IMU_DGYRO_CUTOFF"),
            ("notch 0", "IMU_GYRO_NF0_FRQ"),
            ("notch 1", "IMU_GYRO_NF1_FRQ"),
        ),
    ),
    Sensor(
        "accel",
        "Acceleration",
        "m/s²",
        1.0,
        "sensor_accel_fifo",
        (
            ("sensor_accel", ("x", "y", "z")),
            ("sensor_combined", _array("accelerometer_m_s2")),
            ("vehicle_acceleration", _array("xyz")),
        ),
        (("accel cutoff", "IMU_ACCEL_CUTOFF"),),
    ),
)
"""The sensors."""
GYRO, ACCEL = SENSORS
TOPICS = frozenset({*(name for sensor in SENSORS for name in sensor.names), "esc_status"})
"""The topics that spectra and their marks are from."""


class _Samples(NamedTuple):
    """Samples of a topic, each with its time."""

    when: NDArray[np.float64]
    columns: NDArray[np.float64]

    def times(self, places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return when samples were taken, in s."""
        return self.when[places]

    def values(self, places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the values of samples, with the axes as the last dimension."""
        return self.columns[places]


class _Fifo(NamedTuple):
    """Messages with up to 32 samples. Only those are unpacked that are asked for: there can be 8,000 in a second."""

    rows: NDArray[Any]
    last: NDArray[np.float64]
    """When the last sample of each message was taken, in s."""
    step: NDArray[np.float64]
    factor: NDArray[np.float64]
    ends: NDArray[np.intp]
    """The places of the samples at which messages begin, and the end of the last one."""

    def times(self, places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return when samples were taken, in s."""
        message = np.searchsorted(self.ends, places, side="right") - 1
        return self.last[message] - (self.ends[message + 1] - 1 - places) * self.step[message]

    def values(self, places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the values of samples, with the axes as the last dimension."""
        message = np.searchsorted(self.ends, places, side="right") - 1
        inside = places - self.ends[message]
        return np.stack([self.rows[axis][message, inside] * self.factor[message] for axis in "xyz"], axis=-1)


class Motion(NamedTuple):
    """The samples of a sensor, at equal intervals within each run."""

    sensor: Sensor
    path: str
    """The topic: `sensor_gyro_fifo[1]`."""
    rate: float
    """In Hz."""
    samples: _Samples | _Fifo
    """In the unit of the sensor."""
    runs: list[tuple[int, int]]
    """The places of the samples at which stretches without gaps begin and end."""


class Mark(NamedTuple):
    """Frequencies that belong to a filter or to the motors, in Hz."""

    label: str
    low: float
    high: float


class Spectrum(NamedTuple):
    """How strongly a sensor moves at each frequency."""

    sensor: Sensor
    path: str
    rate: float
    """The samples per second. Nothing can be said of frequencies above the half of it."""
    windows: int
    frequencies: NDArray[np.float64]
    """Of shape (n,), in Hz."""
    density: NDArray[np.float64]
    """Of shape (3, n), for x, y and z: the power spectral density, in the square of the sensor's unit per Hz."""
    marks: tuple[Mark, ...] = ()

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Of shape (3, n): the amplitude of a sine that has the density, in the unit of the sensor."""
        found: NDArray[np.float64] = np.sqrt(2 * self.density * _NOISE_BANDWIDTH * self.frequencies[1])
        return found

    @property
    def decibels(self) -> NDArray[np.float64]:
        """Of shape (3, n): the density in dB."""
        return decibels(self.density)

    def peak(self, axis: int) -> tuple[float, float]:
        """Return the strongest tone above 20 Hz of an axis, in Hz, and its amplitude. NaN without one."""
        power = self.density[axis] * self.frequencies[1]
        top = int(np.argmax(np.where(self.frequencies >= _FLYING, power, 0.0)))
        around = power[max(top - _AROUND, 0) : top + _AROUND + 1]
        if not power[top] > _TONE * float(np.median(around)):
            return np.nan, np.nan
        lobe = slice(max(top - _WIDTH, 0), top + _WIDTH + 1)
        whole = float(power[lobe].sum())
        return float(self.frequencies[lobe] @ power[lobe]) / whole, float(np.sqrt(2 * whole))

    @property
    def text(self) -> str:
        """Where the spectrum is from, and its strongest frequencies, in one line."""
        peaks = [(name, *self.peak(axis)) for axis, name in enumerate("xyz")]
        found = [f"{name} {where:.0f} Hz ({how:.2g} {self.sensor.unit})" for name, where, how in peaks if how > 0]
        told = f"strongest tone of {', '.join(found)}" if found else f"no tone above {_FLYING:.0f} Hz"
        return f"{self.path}, {self.rate:.0f} Hz: {told}; nothing above {self.rate / 2:.0f} Hz is known"


class Spectrogram(NamedTuple):
    """How strongly a sensor moves at each frequency and time: the sum of its axes."""

    sensor: Sensor
    path: str
    rate: float
    edges: NDArray[np.float64]
    """Of shape (m + 1,): where columns begin and end, in s after the start of the recording."""
    frequencies: NDArray[np.float64]
    """Of shape (n,), in Hz."""
    density: NDArray[np.float64]
    """Of shape (n, m): the power spectral density, NaN where there are no samples."""
    marks: tuple[Mark, ...] = ()

    @property
    def decibels(self) -> NDArray[np.float64]:
        """Of shape (n, m): the density in dB, NaN where there are no samples."""
        return decibels(self.density)

    @property
    def range(self) -> tuple[float, float]:
        """The densities in dB between which colours differ."""
        low, high = np.nanpercentile(self.decibels, (_QUIETEST, _LOUDEST)).tolist()
        return low, max(high, low + 1.0)


_NOISE_BANDWIDTH = 1.5
"""The bandwidth of the noise in a bin of a Hann window, in bins."""


def decibels(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return densities in dB."""
    return 10 * np.log10(np.maximum(density, _FLOOR))


def motion_of(
    recorded: Recorded, sensor: Sensor, topic: str = "", instance: int = 0, *, spans: Spans | None = None
) -> Motion | Unsaid:
    """Return the samples of a sensor in some spans of time, all while armed by default.

    Without the name of a topic, they are of the one with the most samples per second.
    """
    spans = flown(recorded) if spans is None else spans
    found = []
    for name in (topic,) if topic else sensor.names:
        motion = _from_fifo(recorded, sensor, instance) if name == sensor.fifo else None
        motion = motion or _from_topic(recorded, sensor, name, instance)
        if motion is not None:
            found.append(motion)
    if not found:
        return Unsaid(f"the recording has no {topic or ', '.join(sensor.names)}")
    best = max(found, key=lambda each: each.rate)
    if best.rate < _SLOWEST:
        return Unsaid(f"too few samples: {best.rate:.2g} Hz of {best.path}, a spectrum needs {_SLOWEST:.0f} Hz")
    return best._replace(runs=list(_within(best, spans)))


def _within(motion: Motion, spans: Spans) -> Iterator[tuple[int, int]]:
    """Yield the parts of runs that are in some spans of time."""
    for begin, end in motion.runs:
        first = float(motion.samples.times(np.array([begin]))[0])
        for low, high in spans:
            inner = [round(float(np.clip((time - first) * motion.rate, 0, end - begin))) for time in (low, high)]
            if inner[0] < inner[1]:
                yield begin + inner[0], begin + inner[1]


def _path(name: str, instance: int) -> str:
    return f"{name}[{instance}]" if instance else name


def _from_topic(recorded: Recorded, sensor: Sensor, name: str, instance: int) -> Motion | None:
    fields = dict(sensor.topics).get(name, ())
    columns = [column for field in fields if (column := recorded.column(name, field, instance)) is not None]
    if len(columns) < 3 or len(columns[0].values) < 2:  # noqa: PLR2004 - axes, and samples with an interval
        return None
    times = recorded.taken(columns[0], name, instance).times
    found = runs(times, _JITTER * usual_interval(times), 2)
    spent = sum(float(times[end - 1] - times[begin]) for begin, end in found)
    rate = sum(end - begin - 1 for begin, end in found) / spent if spent > 0 else 0.0
    values = np.stack([column.values for column in columns], axis=1) * sensor.scale
    return Motion(sensor, _path(name, instance), rate, _Samples(times, values), found)


def _from_fifo(recorded: Recorded, sensor: Sensor, instance: int) -> Motion | None:
    """Return the samples in messages with up to 32 of them."""
    scale = recorded.column(sensor.fifo, "scale", instance)
    samples = recorded.samples(sensor.fifo, instance)
    if scale is None or samples is None or not {"dt", "samples", "x", "y", "z"} <= {*(samples.array.dtype.names or ())}:
        return None
    last = recorded.taken(scale, sensor.fifo, instance).times
    rows = samples.array[len(samples.array) - len(last) :]
    step, count = rows["dt"] / 1e6, np.minimum(rows["samples"], rows["x"].shape[1]).astype(np.intp)
    usable = (step > 0) & (step < 1 / _SLOWEST) & (count > 0) & (np.abs(scale.values) < _LARGEST)
    factor = scale.values * sensor.scale
    if not usable.all():
        rows, step, count, last, factor = (each[usable] for each in (rows, step, count, last, factor))
    if not len(rows):
        return None
    # A message follows the one before if it has as many samples as there was time for.
    lengths = (np.diff(last) / (step * count)[1:]) if len(rows) > 1 else np.zeros(0)
    edges = np.flatnonzero(~((lengths > 1 / _JITTER) & (lengths < _JITTER))) + 1
    bounds = [*np.append(0, edges).tolist(), len(rows)]
    pairs = list(pairwise(bounds))
    spent = sum(float(last[end - 1] - last[begin]) for begin, end in pairs)
    rate = sum(int(count[begin + 1 : end].sum()) for begin, end in pairs) / spent if spent > 0 else 0.0
    ends = np.append(0, np.cumsum(count))
    found = [(int(ends[begin]), int(ends[end])) for begin, end in pairs]
    return Motion(sensor, _path(sensor.fifo, instance), rate, _Fifo(rows, last, step, factor, ends), found)


class Windows(NamedTuple):
    """Windows that overlap by half: when each begins, how long they are in s, and their densities."""

    motion: Motion
    begins: NDArray[np.float64]
    seconds: float
    frequencies: NDArray[np.float64]
    density: NDArray[np.float64]
    """Of shape (windows, 3, frequencies)."""


def windows_of(motion: Motion) -> Windows | Unsaid:
    """Return the densities of a sensor in windows without a gap. A long recording has some of them only."""
    length = int(np.clip(2 ** round(np.log2(motion.rate * _WINDOW)), _SHORTEST, _LONGEST))
    firsts = [np.arange(begin, end - length + 1, length // 2) for begin, end in motion.runs if end - begin >= length]
    starts = np.concatenate(firsts) if firsts else np.zeros(0, np.intp)
    if len(starts) > _MOST_WINDOWS:
        starts = starts[np.linspace(0, len(starts) - 1, _MOST_WINDOWS).astype(np.intp)]
    taper = np.hanning(length + 1)[:-1]
    scale = np.full(length // 2 + 1, 2 / (motion.rate * float(taper @ taper)))
    scale[[0, -1]] /= 2
    begins, found = [], []
    for chosen in np.split(starts, range(_AT_ONCE, len(starts), _AT_ONCE)):
        values = motion.samples.values(chosen[:, None] + np.arange(length))
        is_usable = (np.abs(values) < _LARGEST).all(axis=(1, 2))
        values = values[is_usable]
        values -= values.mean(axis=1, keepdims=True)
        powers = np.abs(np.fft.rfft(values * taper[:, None], axis=1)) ** 2 * scale[:, None]
        begins.append(motion.samples.times(chosen[is_usable]))
        found.append(powers.transpose(0, 2, 1))
    density = np.concatenate(found)
    if not len(density):
        seconds = length / motion.rate
        return Unsaid(f"no {seconds:.1f} s of {motion.path} without a gap in flight")
    frequencies = np.linspace(0, motion.rate / 2, length // 2 + 1)
    return Windows(motion, np.concatenate(begins), length / motion.rate, frequencies, density)


def spectrum_of(recorded: Recorded, found: Windows) -> Spectrum:
    """Return the spectrum of a sensor."""
    motion, density = found.motion, found.density.mean(axis=0)
    marks = tuple(_marks(recorded, motion))
    return Spectrum(motion.sensor, motion.path, motion.rate, len(found.begins), found.frequencies, density, marks)


def spectrogram_of(recorded: Recorded, found: Windows, start: float = 0.0, stop: float | None = None) -> Spectrogram:
    """Return the spectrogram of a sensor between two times in s."""
    motion = found.motion
    stop = recorded.duration if stop is None else stop
    span = max(stop - start, found.seconds)
    columns = int(np.clip(2 * span / found.seconds, 1, _MOST_COLUMNS))
    width = span / columns
    middles = (found.begins + found.seconds / 2 - start) / width
    reach = found.seconds / 4 / width  # as far as the windows beside it
    inside = np.floor(middles).astype(np.intp)
    first = np.minimum(np.ceil(middles - reach - 0.5).astype(np.intp), inside)
    last = np.maximum(np.floor(middles + reach - 0.5).astype(np.intp), inside)
    density = found.density.sum(axis=1)
    sums, counts = np.zeros((columns, density.shape[1])), np.zeros(columns)
    for step in range(int((last - first).max()) + 1):
        mask = (first + step <= last) & (first + step >= 0) & (first + step < columns)
        np.add.at(sums, first[mask] + step, density[mask])
        np.add.at(counts, first[mask] + step, 1)
    counts[counts == 0] = np.nan
    edges = np.linspace(start, start + span, columns + 1)
    density = (sums / counts[:, None]).T
    marks = tuple(_marks(recorded, motion))
    return Spectrogram(motion.sensor, motion.path, motion.rate, edges, found.frequencies, density, marks)


def _marks(recorded: Recorded, motion: Motion) -> Iterator[Mark]:
    """Yield the frequencies of filters and motors that the spectrum reaches."""
    parameters: Any = recorded.log.parameters
    for label, name in motion.sensor.filters:
        value = float(parameters.get(name, 0))
        if 0 < value < motion.rate / 2:
            yield Mark(label, value, value)
    turns = _turns(recorded)
    if turns is None:
        return
    is_notched = motion.sensor is GYRO and int(parameters.get("IMU_GYRO_DNF_EN", 0)) & 1
    for factor in (1, 2, 3):  # propellers have two or three blades
        low, high = turns[0] * factor, turns[1] * factor
        if high < motion.rate / 2:
            notched = ", notched" if is_notched and factor <= int(parameters.get("IMU_GYRO_DNF_HMC", 0)) else ""
            yield Mark(f"motors{f', {factor} per turn' if factor > 1 else ''}{notched}", low, high)


def _turns(recorded: Recorded) -> tuple[float, float] | None:
    """Return how often motors turn in a second: the 5th and the 95th percentile in flight; None if it is not known."""
    spans = flown(recorded)
    found = []
    for index in range(recorded.width("esc_status", "esc")):
        column = recorded.column("esc_status", f"esc[{index}].esc_rpm")
        if column is not None:
            speeds = np.abs(column.within(spans).finite) / 60
            found.append(speeds[speeds > 0])
    every = np.concatenate(found) if found else np.zeros(0)
    if not len(every):
        return None
    low, high = np.percentile(every, (5, 95)).tolist()
    return low, high
