"""The samples of gyroscopes and accelerometers: of the sensor's FIFO, or of the topic with the most per second."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.analysis.finding import Unsaid
from msggen.analysis.recorded import Recorded
from msggen.analysis.sampling import flown, runs, usual_interval
from msggen.analysis.spans import Spans

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SLOWEST = 20.0
"""The samples per second from which a spectrum tells something."""
_JITTER = 1.5
"""The number of usual intervals from which a time without samples is a gap."""
LARGEST = 1e6
"""Values beyond it are damaged."""


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
    usable = (step > 0) & (step < 1 / _SLOWEST) & (count > 0) & (np.abs(scale.values) < LARGEST)
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
