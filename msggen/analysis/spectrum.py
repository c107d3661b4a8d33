"""Spectra of gyroscopes and accelerometers, with the frequencies of filters and motors.

The samples are those of the sensor's FIFO where the recording has them, or else of the topic with the most samples per
second. Spectra are averages over windows (Welch's method). A window with a gap is left out; no sample is made up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.analysis.finding import Unsaid
from msggen.analysis.motion import GYRO, LARGEST, Motion, Sensor
from msggen.analysis.recorded import Recorded
from msggen.analysis.sampling import flown
from msggen.recordings.columns.ordered import median, percentiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_WINDOWS, _MOST_COLUMNS = 1200, 300
"""The windows of a recording at most, and the columns of a spectrogram."""
_WINDOW, _SHORTEST, _LONGEST = 0.8, 64, 2048
"""About how long a window is, in s, and how many samples it has: a power of two."""
_AT_ONCE = 64
"""The windows that are in memory at once."""
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
        if not power[top] > _TONE * median(around):
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
        low, high = percentiles(self.decibels, (_QUIETEST, _LOUDEST)).tolist()
        return low, max(high, low + 1.0)


_NOISE_BANDWIDTH = 1.5
"""The bandwidth of the noise in a bin of a Hann window, in bins."""


def decibels(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return densities in dB."""
    return 10 * np.log10(np.maximum(density, _FLOOR))


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
        is_usable = (np.abs(values) < LARGEST).all(axis=(1, 2))
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
    low, high = percentiles(every, (5, 95)).tolist()
    return low, high
