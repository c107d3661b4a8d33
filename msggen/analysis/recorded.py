"""The samples of one vehicle that a report needs, by the names of topics in uORB: `vehicle_status`.

Names in the recording can be any: `/fmu/out/vehicle_status_v4`, `/px4_1/fmu/out/vehicle_status`, `vehicle_status`.
Angles come from the quaternions that PX4 sends.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.definitions.unit import normalized_unit
from msggen.messages.nav_states import ARMED
from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.columns.ordered import percentiles
from msggen.recordings.log.series import Series
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic


_NAMESPACE = re.compile(r"(?P<namespace>.*?)/fmu/(?:in|out)/")
_INDEX = re.compile(r"\[(\d+)\]")


_LATENCY = 5
"""The percentile of the time that samples are under way which is taken for none."""


_LEAST = 30
"""The samples without which a fit says nothing."""


class Fit(NamedTuple):
    """How a value changes with another one. A trend over time is taken out of both, such as the discharge."""

    slope: float
    correlation: float
    """From -1 to 1, 0 if one of them does not change."""
    spread: float
    """The standard deviation of the other value."""


class Column(NamedTuple):
    """The values of a field over time."""

    times: NDArray[np.float64]
    """In s after the start of the recording, none before it."""
    values: NDArray[np.float64]
    unit: str
    """The unit in the definition, "" if it is not known."""
    is_held: bool
    """Whether a value lasts until the next sample: all but floats."""
    path: str = ""
    """Where it is from: `sensor_gps[1].eph`."""

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the latest value at each of some times, NaN before the first one."""
        index = np.searchsorted(self.times, times, side="right") - 1
        return np.where(index >= 0, self.values[np.maximum(index, 0)], np.nan)

    def value_at(self, time: float) -> float:
        """Return the latest value at a time, the first one before it, NaN without values."""
        index = max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)
        return float(self.values[index]) if len(self.values) else np.nan

    def where(self, flag: Column | None) -> Column:
        """Return the column with NaN where a flag is not set, if there is such a flag."""
        if flag is None:
            return self
        return self._replace(values=np.where(flag.at(self.times) > 0, self.values, np.nan))

    def is_within(self, spans: Collection[tuple[float, float]]) -> NDArray[np.bool_]:
        """Return which samples are in some spans of time, which do not overlap."""
        if not spans:
            return np.zeros(len(self.times), np.bool_)
        begins, ends = np.array(sorted(spans), np.float64).T
        index = np.searchsorted(begins, self.times, side="right") - 1
        within: NDArray[np.bool_] = (index >= 0) & (self.times <= ends[np.maximum(index, 0)])
        return within

    def within(self, spans: Collection[tuple[float, float]]) -> Column:
        """Return the samples in some spans of time."""
        mask = self.is_within(spans)
        return self._replace(times=self.times[mask], values=self.values[mask])

    @property
    def finite(self) -> NDArray[np.float64]:
        """The values that are finite."""
        return self.values[np.isfinite(self.values)]

    @property
    def largest(self) -> float:
        """The largest value that is finite, NaN if there is none."""
        return float(self.finite.max()) if len(self.finite) else np.nan

    @property
    def smallest(self) -> float:
        """The smallest value that is finite, NaN if there is none."""
        return float(self.finite.min()) if len(self.finite) else np.nan

    @property
    def growth(self) -> float:
        """By how much the last value is larger than the first one, 0 without values."""
        return float(self.finite[-1] - self.finite[0]) if len(self.finite) else 0.0

    def since_above(self, limit: float) -> Column:
        """Return the column from the first value above a limit on."""
        above = np.flatnonzero(self.values > limit)
        first = int(above[0]) if len(above) else len(self.values)
        return self._replace(times=self.times[first:], values=self.values[first:])

    def known(self, least: float) -> Column:
        """Return the column with NaN for values below `least`, which stand for unknown ones."""
        return self._replace(values=np.where(self.values >= least, self.values, np.nan))

    def fit(self, other: Column) -> Fit | None:
        """Return how the column follows another one, None for fewer than 30 samples with both values."""
        causes = other.at(self.times)
        both = np.isfinite(causes) & np.isfinite(self.values)
        if both.sum() < _LEAST:
            return None
        effect, cause = (_without_trend(each[both], self.times[both]) for each in (self.values, causes))
        product, square = float(cause @ effect), float(cause @ cause)
        norm = np.sqrt(square * float(effect @ effect))
        slope, correlation = product / square if square > 0 else 0.0, float(product / norm) if norm > 0 else 0.0
        return Fit(slope, correlation, float(cause.std()))


def _without_trend(values: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    values, times = values - values.mean(), times - times.mean()
    square = float(times @ times)
    return values - times * (float(times @ values) / square) if square > 0 else values


_KEPT = 50_000
"""The samples of a column that is kept: 0.8 MB."""


class Recorded:
    """The topics of one vehicle, and the samples of those whose names `is_needed` takes."""

    def __init__(self, log: Log, is_needed: Callable[[str], bool]) -> None:
        self.log = log
        self.duration = max(log.duration, 0.0)
        self._start = log.start  # once: it looks at all topics
        self.namespace, self.others = _vehicles(log.topics)
        self.topics = _of_vehicle(log, self.namespace, is_needed)
        chosen = [topic for instances in self.topics.values() for topic in instances.values()]
        self._loaded: Mapping[Any, Samples] = log.load(chosen) if chosen else {}
        self._clocks: dict[tuple[str, int], NDArray[np.float64] | None] = {}
        self._columns: dict[tuple[str, str, int], Column | None] = {}
        """Those that are short enough to be kept: rules and charts ask for most of them again."""

    def __contains__(self, name: str) -> bool:
        """Whether a topic has samples that were read."""
        return bool(self.instances(name))

    def instances(self, name: str) -> list[int]:
        """Return the numbers of the instances of a topic that have samples."""
        return sorted(each for each in self.topics.get(name, ()) if self.samples(name, each) is not None)

    def samples(self, name: str, instance: int = 0) -> Samples | None:
        """Return the samples of a topic, None if there are none."""
        topic = self.topics.get(name, {}).get(instance)
        found = None if topic is None else self._loaded[topic.key]
        return found if found is not None and len(found) else None

    def column(self, name: str, field: str, instance: int = 0) -> Column | None:
        """Return a field such as `control[0]` or `esc[1].esc_rpm`, None if the recording does not have it."""
        key = name, field, instance
        if key in self._columns:
            return self._columns[key]
        found = self._column(*key)
        if found is None or len(found.times) <= _KEPT:
            self._columns[key] = found
        return found

    def _column(self, name: str, field: str, instance: int) -> Column | None:
        samples = self.samples(name, instance)
        found = None if samples is None else _values(samples.array, field)
        if samples is None or found is None:
            return None
        seconds = self._seconds(samples)
        first = int(np.searchsorted(seconds, 0.0))
        is_held = found.dtype.kind != "f"
        if is_held and first and (first == len(seconds) or seconds[first] > 0):
            first -= 1  # it lasts until the start
        number = f"[{instance}]" if instance else ""
        unit = annotation_of(samples.topic, field).unit
        with np.errstate(invalid="ignore"):  # bits that are no number
            values = found[first:].astype(np.float64)
        return Column(
            np.maximum(seconds[first:], 0.0),
            values,
            "" if unit == "-" else normalized_unit(unit),
            is_held,
            f"{name}{number}.{field}",
        )

    def taken(self, column: Column, name: str, instance: int = 0) -> Column:
        """Return a column of a topic with the times at which its samples were taken, as the vehicle's clock has them.

        Without such times in the samples, or if they are not in order, they are those of the recording.
        """
        if (name, instance) not in self._clocks:
            self._clocks[name, instance] = self._clock(name, instance)
        times = self._clocks[name, instance]
        return column if times is None else column._replace(times=times[len(times) - len(column.times) :])

    def _clock(self, name: str, instance: int) -> NDArray[np.float64] | None:
        samples = self.samples(name, instance)
        stamps = [] if samples is None else [_values(samples.array, name) for name in ("timestamp_sample", "timestamp")]
        own = [each / 1e6 for each in stamps if each is not None and _is_clock(each)]
        if samples is None or not own:
            return None
        return own[0] + float(percentiles(self._seconds(samples) - own[-1], [_LATENCY])[0])

    def while_armed(self, name: str, field: str, instance: int = 0, valid: str = "") -> Column | None:
        """Return a field while the vehicle was armed, NaN where the flag `valid` is not set. None without a number."""
        found = self.column(name, field, instance)
        if found is None:
            return None
        found = found.where(self.column(name, valid, instance)).within(self.armed)
        return found if len(found.finite) else None

    def width(self, name: str, field: str, instance: int = 0) -> int:
        """Return the number of elements of an array, 0 if there is no such one."""
        samples = self.samples(name, instance)
        names = () if samples is None else samples.array.dtype.names or ()
        if samples is None or field not in names or samples.array[field].ndim < 2:  # noqa: PLR2004 - an array of arrays
            return 0
        return int(samples.array[field].shape[1])

    def flags(self, name: str, instance: int = 0) -> list[str]:
        """Return the names of the fields that are true or false."""
        samples = self.samples(name, instance)
        dtype = None if samples is None else samples.array.dtype
        return [] if dtype is None else [each for each in dtype.names or () if dtype[each] == np.bool_]

    def series(self, name: str, field: str) -> Series | None:
        """Return a field whose values have names, from the start to the end of the recording."""
        samples = self.samples(name)
        values = None if samples is None else _values(samples.array, field)
        if samples is None or values is None or values.dtype.kind not in "biu":
            return None
        about = annotation_of(samples.topic, field)
        last = max(self.duration, float(self._seconds(samples)[-1]))
        return Series(field, self._seconds(samples), values, about, last).since(0.0)

    def batteries(self) -> Iterator[int]:
        """Yield the instances of `battery_status` that are not known to be without a battery."""
        for instance in self.instances("battery_status"):
            connected = self.column("battery_status", "connected", instance)
            if connected is None or connected.values.any():
                yield instance

    @cached_property
    def all_topics(self) -> Mapping[str, Topic]:
        """All topics of the vehicle that have samples, also those that were not read, by names as `sensor_gps[1]`."""
        topics = _of_vehicle(self.log, self.namespace, lambda _: True)
        return {
            name + (f"[{number}]" if number else ""): instances[number]
            for name, instances in sorted(topics.items())
            for number in sorted(instances)
            if instances[number].count
        }

    def _seconds(self, samples: Samples) -> NDArray[np.float64]:
        return (samples.log_times - self._start) / 1e9

    @cached_property
    def armed(self) -> tuple[tuple[float, float], ...]:
        """The times from arming to disarming, all of the recording if it does not tell them."""
        for name, field, value in (("vehicle_status", "arming_state", ARMED), ("actuator_armed", "armed", 1)):
            found = self.column(name, field)
            if found is not None:
                return spans(found, found.values == value, self.duration)
        return ((0.0, self.duration),)


def spans(column: Column, mask: NDArray[np.bool_], end: float) -> tuple[tuple[float, float], ...]:
    """Return the stretches of time in which `mask` is set, each until the next sample, the last one until `end`."""
    edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    times = np.append(column.times, max(end, float(column.times[-1]) if len(column.times) else end))
    begins, ends = times[np.flatnonzero(edges == 1)], times[np.flatnonzero(edges == -1)]
    return tuple(zip(begins.tolist(), ends.tolist(), strict=True))


def _is_clock(stamps: NDArray[Any]) -> bool:
    """Whether times are in order, and not all the same."""
    return len(stamps) > 1 and bool((stamps[1:] >= stamps[:-1]).all()) and bool(stamps[0] < stamps[-1])


def _values(rows: NDArray[Any], path: str) -> NDArray[Any] | None:
    """Return the numbers of a field such as `esc[1].esc_rpm`, None if there are none."""
    found = rows
    for part in path.split("."):
        name, _, _ = part.partition("[")
        if name not in (found.dtype.names or ()):
            return None
        found = found[name]
        for index in map(int, _INDEX.findall(part)):
            if found.ndim < 2 or index >= found.shape[1]:  # noqa: PLR2004 - samples and elements
                return None
            found = found[:, index]
    return found if found.ndim == 1 and found.dtype.kind in "biuf" else None


def _vehicles(topics: Collection[Topic]) -> tuple[str, tuple[str, ...]]:
    """Return the namespace of the vehicle with the most topics, and those of the others."""
    counts = Counter(namespace_of(topic) for topic in topics if topic.known_count != 0)
    ordered = [name for name, _ in counts.most_common()]
    found = [name for name in ordered if name is not None]
    return (found[0], tuple(sorted(found[1:]))) if found else ("", ())


def namespace_of(topic: Topic) -> str | None:
    """Return the namespace of the vehicle that a topic of PX4 is from: `/px4_1`. None for a topic of others."""
    found = _NAMESPACE.match(topic.name)
    return found["namespace"] if found else None if topic.name.startswith("/") else ""


def _of_vehicle(log: Log, namespace: str, is_needed: Callable[[str], bool]) -> dict[str, dict[int, Topic]]:
    """Return the topics that are needed, by their names in uORB and their instances.

    Of several topics of a name, as after a change of its definition, it is the one with the most samples.
    """
    found: dict[str, dict[int, Topic]] = {}
    for topic in _candidates(log, namespace):
        name = topic.uorb.partition("#")[0]
        if is_needed(name):
            instances = found.setdefault(name, {})
            other = instances.get(topic.instance)
            if other is None or topic.count > other.count:
                instances[topic.instance] = topic
    return found


def _candidates(log: Log, namespace: str) -> Iterator[Topic]:
    """Yield the topics of a vehicle that can be decoded, and those without a namespace."""
    for topic in log.topics:
        if namespace_of(topic) not in (namespace, None):
            continue
        try:
            log.dtype(topic)
        except RecordingError:
            continue
        yield topic


_QUATERNIONS = ("q", "q_d")


def angle_of(recorded: Recorded, topic: str, name: str) -> Column | None:
    """Return `roll`, `pitch` or `yaw` in deg from the quaternion of a topic, None if it does not have one."""
    for field in _QUATERNIONS if name in ("roll", "pitch", "yaw") else ():
        parts = [recorded.column(topic, f"{field}[{index}]") for index in range(4)]
        found = [part for part in parts if part is not None]
        if len(found) == len(parts):
            values = _angle(name, [part.values for part in found])
            return found[0]._replace(values=values, unit="deg", path=found[0].path.replace("[0]", ""))
    return None


def _angle(name: str, quaternion: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return an angle of rotations from FRD to NED: yaw, then pitch, then roll."""
    w, x, y, z = quaternion
    norm = w * w + x * x + y * y + z * z
    with np.errstate(all="ignore"):
        w, x, y, z = (each / np.sqrt(norm) for each in (w, x, y, z))
        if name == "roll":
            found = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        elif name == "pitch":
            found = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
        else:
            found = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(np.where(norm > 0, found, np.nan))


def tilt_of(recorded: Recorded) -> Column | None:
    """Return the angle in deg between down in the body and down, None if the recording does not tell it."""
    for topic in ("vehicle_attitude", "vehicle_odometry"):
        roll, pitch = (angle_of(recorded, topic, name) for name in ("roll", "pitch"))
        if roll is not None and pitch is not None:
            cosine = np.cos(np.radians(roll.values)) * np.cos(np.radians(pitch.values))
            return roll._replace(values=np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return None
