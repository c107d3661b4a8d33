"""Step responses: how a vehicle follows a step of a setpoint, from flights in which nobody flew steps.

The response to an impulse is the Wiener filter from the setpoint to what was measured: the least squares solution, with
regularization, over windows of a second or two that are weighted with a Hann window. What is constant in a window, such
as a wrong trim, does not count. The sum of the filter is the response to a step.

The setpoint depends on what is measured, too: noise of the sensor that the controller feeds back makes the first
samples too small. The spread between parts of the flight tells how much can be said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.recorded import Column, Recorded, angle_of
from msggen.analysis.sampling import flown, runs, usual_interval
from msggen.analysis.spans import Spans, common

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_WINDOWS, _FEWEST_WINDOWS = 100, 5
"""The windows that are used at most, those with the largest changes; and those that are needed."""
_AT_ONCE = 25
"""The rows of a matrix that are multiplied at once: more run on several threads, which wait for each other for long."""
_PARTS = 8
"""The parts of a flight whose responses make the spread."""
_NOISE, _LEAST_NOISE = 1e-2, 1e-3
"""The share of noise that is expected before it is known, and the least one."""
_GAP = 5
"""The number of usual intervals from which a time without samples is a gap."""
_COARSEST = 10
"""The samples that a response has at least."""
_LEAST_FIT = 0.3
"""The share of the movement that must follow from the setpoint."""
_LARGEST_SPREAD = 0.2
"""The mean spread, in parts of the step, up to which the mean tells something. Real flights have 0.02 to 0.15."""
_LARGEST = 1e6
"""Values beyond it are damaged."""
_SETTLED, _TAIL = 0.05, 0.2
"""How near a response that has settled is to its final value, and the part at the end whose mean this is."""


class Loop(NamedTuple):
    """A control loop: what was measured, and its setpoint."""

    name: str
    unit: str
    measured: tuple[str, ...]
    """Topic and field, `vehicle_attitude.roll` for an angle of its quaternion: the first that the recording has."""
    setpoint: tuple[str, ...]
    seconds: float
    """The length of the response."""
    window: float
    """The length of a window in s."""
    rate: float
    """The samples per second at most: further ones would not change the response."""
    least: float
    """The change of the setpoint within a window, in `unit`, from which the window is used."""


def _angle(name: str) -> Loop:
    measured = f"vehicle_attitude.{name}", f"vehicle_odometry.{name}"
    setpoint = f"vehicle_attitude_setpoint.{name}", f"vehicle_attitude_setpoint.{name}_body"
    return Loop(name, "deg", measured, setpoint, seconds=2.0, window=2.0, rate=45.0, least=5.0)


def _rate(name: str, place: int) -> Loop:
    measured = (
        f"vehicle_angular_velocity.xyz[{place}]",
        f"vehicle_attitude.{name}speed",
        f"sensor_combined.gyro_rad[{place}]",
        f"vehicle_odometry.angular_velocity[{place}]",
    )
    setpoint = (f"vehicle_rates_setpoint.{name}",)
    return Loop(f"{name} rate", "deg/s", measured, setpoint, seconds=0.6, window=1.0, rate=125.0, least=20.0)


_AXES = ("roll", "pitch", "yaw")
LOOPS = (*map(_angle, _AXES), *(_rate(name, place) for place, name in enumerate(_AXES)))
"""The loops whose responses are computed."""
TOPICS = frozenset(path.partition(".")[0] for loop in LOOPS for path in (*loop.measured, *loop.setpoint))
"""The topics that they are from."""

_NOTHING: NDArray[np.float64] = np.zeros(0)


class Response(NamedTuple):
    """The response of a loop to a step of its setpoint, or why there is none."""

    loop: Loop
    verdict: str = ""
    """Why the recording does not tell it, "" if it does."""
    times: NDArray[np.float64] = _NOTHING
    """Of shape (n,), in s after the step."""
    mean: NDArray[np.float64] = _NOTHING
    """Of shape (n,), in parts of the step: 1 is the setpoint."""
    spread: NDArray[np.float64] = _NOTHING
    """Of shape (n,): the standard deviation between parts of the flight."""
    windows: int = 0
    """How many windows it is from."""
    excitation: float = 0.0
    """The largest change of the setpoint within a window, in the unit of the loop."""
    fit: float = 0.0
    """The share of the movement that follows from the setpoint, up to 1."""

    @property
    def final(self) -> float:
        """The value at the end, in parts of the step; NaN without a response."""
        return float(self.mean[-max(int(len(self.mean) * _TAIL), 1) :].mean()) if len(self.mean) else np.nan

    @property
    def delay(self) -> float:
        """The time in s after which half of the final value is reached, NaN if it is not."""
        return self._reached(0.5)

    @property
    def rise(self) -> float:
        """The time in s from a tenth to nine tenths of the final value, NaN if they are not reached."""
        return self._reached(0.9) - self._reached(0.1)

    @property
    def overshoot(self) -> float:
        """By how much the largest value is beyond the final one, in parts of the final one; NaN without a response."""
        return max(float(self.mean.max()) / self.final - 1, 0.0) if len(self.mean) else np.nan

    @property
    def settling(self) -> float:
        """The time in s after which the response stays within 5 % of its final value, NaN without a response."""
        if not len(self.mean):
            return np.nan
        outside = np.flatnonzero(np.abs(self.mean / self.final - 1) > _SETTLED)
        return float(self.times[min(outside[-1] + 1, len(self.times) - 1)]) if len(outside) else 0.0

    def _reached(self, share: float) -> float:
        after = np.flatnonzero(self.mean >= share * self.final)
        if not len(after):
            return np.nan
        index = int(after[0])
        if not index:
            return 0.0
        low, high = self.mean[index - 1], self.mean[index]
        part = (share * self.final - low) / (high - low)
        return float(self.times[index - 1] + part * (self.times[index] - self.times[index - 1]))

    @property
    def text(self) -> str:
        """The response in one line."""
        if self.verdict:
            return f"{self.loop.name}: {self.verdict}"
        return (
            f"{self.loop.name}: delay {self.delay * 1000:.0f} ms, overshoot {self.overshoot * 100:.0f} %, settles in "
            f"{self.settling:.2f} s, spread {float(self.spread.mean()):.2f}, from {self.windows} windows"
        )


def responses_of(recorded: Recorded, start: float | None = None, stop: float | None = None) -> list[Response]:
    """Return the response of each loop, of the time armed between two times in s."""
    spans = flown(recorded, start, stop)
    return [_of_loop(recorded, loop, spans) for loop in LOOPS]


def _of_loop(recorded: Recorded, loop: Loop, spans: Spans) -> Response:
    measured, setpoint = (_first(recorded, paths, loop.unit) for paths in (loop.measured, loop.setpoint))
    if measured is not None and setpoint is not None:
        return response_of(loop, setpoint, measured, spans)
    missing = loop.measured if measured is None else loop.setpoint
    return Response(loop, f"the recording has no {missing[0].partition('.')[0]}")


def _first(recorded: Recorded, paths: Sequence[str], unit: str) -> Column | None:
    """Return the first field that has a number, in deg or deg/s, at the times at which it was taken."""
    for path in paths:
        topic, _, field = path.partition(".")
        column = recorded.column(topic, field) or angle_of(recorded, topic, field)
        if column is not None and len(column.finite):
            values = column.values if column.unit == "deg" else np.degrees(column.values)
            return recorded.taken(column._replace(values=values, unit=unit), topic)
    return None


def response_of(loop: Loop, setpoint: Column, measured: Column, spans: Spans) -> Response:
    """Return the response of a loop. Samples can have any times, gaps, and values that are no numbers."""
    setpoint, measured = _usable(setpoint), _usable(measured)
    intervals = [usual_interval(column.times) for column in (setpoint, measured)]
    slowest = max(intervals)
    if slowest > loop.seconds / _COARSEST:
        path = (setpoint if intervals[0] > intervals[1] else measured).path.partition(".")[0]
        return Response(
            loop,
            f"too few samples: {1 / slowest:.2g} Hz of {path}, at least {_COARSEST / loop.seconds:.0f} Hz are needed",
        )
    rate = min(loop.rate, 1 / intervals[1])
    taps, rows = round(loop.seconds * rate), round(loop.window * rate)
    stretches = [_stretches(*each) for each in zip((setpoint, measured), intervals, strict=True)]
    shared = common(common(*stretches), spans)
    found = list(_windows(setpoint, measured, shared, (rate, taps, rows)))
    if not found:
        return Response(loop, f"no {loop.window:.0f} s of flight without a gap has samples of both")
    changes = np.array([float(np.ptp(inputs)) for inputs, _ in found])
    largest = float(changes.max())
    used = np.flatnonzero(changes >= loop.least)
    if len(used) < _FEWEST_WINDOWS:
        return Response(
            loop,
            f"too little excitation: the setpoint changed by up to {largest:.1f} {loop.unit} in {loop.window:.0f} s; "
            f"{_FEWEST_WINDOWS} changes of {loop.least:.0f} {loop.unit} or more are needed, found {len(used)}",
            windows=len(used),
            excitation=largest,
        )
    used = np.sort(used[np.argsort(changes[used])[-_MOST_WINDOWS:]])
    return _solved(loop, [found[index] for index in used], (rate, taps, rows), largest)


def _usable(column: Column) -> Column:
    """Return the samples with usable values, without those that have the time of the one before."""
    mask = np.abs(column.values) < _LARGEST
    mask[1:] &= np.diff(column.times) > 0
    return column._replace(times=column.times[mask], values=column.values[mask])


def _stretches(column: Column, interval: float) -> Spans:
    found = runs(column.times, _GAP * interval, 2)
    return tuple((float(column.times[begin]), float(column.times[end - 1])) for begin, end in found)


_Window = tuple["NDArray[np.float64]", "NDArray[np.float64]"]
"""The setpoint, beginning one response before the window, and what was measured in it."""


def _windows(setpoint: Column, measured: Column, spans: Spans, shape: tuple[float, int, int]) -> Iterator[_Window]:
    """Yield windows that overlap by half, with samples at equal intervals."""
    rate, taps, rows = shape
    for begin, end in spans:
        count = int((end - begin) * rate) + 1
        if count < taps + rows:
            continue
        times = begin + np.arange(count) / rate
        inputs, outputs = _resampled(setpoint, times), _resampled(measured, times)
        for first in range(taps - 1, count - rows + 1, rows // 2):
            yield inputs[first - taps + 1 : first + rows], outputs[first : first + rows]


def _resampled(column: Column, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values at some times within a stretch without gaps."""
    first, last = np.searchsorted(column.times, times[[0, -1]])
    part = slice(max(int(first) - 1, 0), int(last) + 1)
    values = column.values[part]
    if column.unit == "deg":
        values = np.unwrap(values, period=360)
    return np.interp(times, column.times[part], values)


def _solved(loop: Loop, windows: Sequence[_Window], shape: tuple[float, int, int], largest: float) -> Response:
    rate, taps, rows = shape
    weights = np.hanning(rows + 2)[1:-1]
    parts = min(_PARTS, len(windows))
    powers, products = np.zeros((parts, taps, taps)), np.zeros((parts, taps))
    energy = 0.0
    for number, (inputs, outputs) in enumerate(windows):
        matrix = np.lib.stride_tricks.sliding_window_view(inputs, taps)[:, ::-1]
        matrix = matrix - weights @ matrix / weights.sum()
        moved = outputs - np.average(outputs, weights=weights)
        weighted = matrix.T * weights
        part = number * parts // len(windows)
        for first in range(0, rows, _AT_ONCE):
            block = slice(first, first + _AT_ONCE)
            powers[part] += weighted[:, block] @ matrix[block]
        products[part] += weighted @ moved
        energy += float(weights @ moved**2)
    power, product = powers.sum(axis=0), products.sum(axis=0)
    impulses = _impulses(power, product, _NOISE)
    left = energy - 2 * float(impulses @ product) + float(impulses @ power @ impulses)
    fit = 1 - left / energy if energy > 0 else 0.0
    if fit < _LEAST_FIT:
        return Response(
            loop,
            f"the vehicle did not follow the setpoint: {max(fit, 0) * 100:.0f} % of its movement comes from it",
            windows=len(windows),
            excitation=largest,
            fit=fit,
        )
    noise = max(1 - fit, _LEAST_NOISE)
    without = zip(power - powers, product - products, strict=True)
    spread = (parts - 1) * np.std([_step(_impulses(*each, noise)) for each in without], axis=0)
    if spread.mean() > _LARGEST_SPREAD:
        verdict = f"not known: parts of the flight differ by {spread.mean():.1f} of a step on average"
        return Response(loop, verdict, windows=len(windows), excitation=largest, fit=fit)
    mean = _step(_impulses(power, product, noise))
    return Response(loop, "", np.arange(taps) / rate, mean, spread, len(windows), largest, fit)


def _impulses(power: NDArray[np.float64], product: NDArray[np.float64], noise: float) -> NDArray[np.float64]:
    """Return the response to an impulse. The more noise, the more slowly it changes from sample to sample."""
    changes = 2 * np.eye(len(power)) - np.eye(len(power), k=1) - np.eye(len(power), k=-1)
    changes[-1, -1] = 1  # the sum of the squares of h[0], h[1] - h[0], h[2] - h[1] ...
    noise *= float(np.trace(power)) / len(power)
    return np.asarray(np.linalg.solve(power + noise * changes, product), np.float64)


def _step(impulses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the response to a step: half of an impulse is before its time, and half of it after."""
    return np.cumsum(impulses) - impulses / 2
