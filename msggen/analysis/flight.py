"""A flight as the rules see it: the samples of one vehicle, and what happened when."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.figures import Track, track_of
from msggen.analysis.recorded import Column, Recorded, spans
from msggen.analysis.spans import Spans, common
from msggen.analysis.timeline import TOPICS, Timeline, timeline_of
from msggen.recordings.columns.ordered import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

_TOUCHING = "ground_contact", "maybe_landed", "landed"
"""The fields of vehicle_land_detected that are set when a vehicle touches the ground."""
_SILENT, _INTERVALS = 2.0, 5.0
"""The time in s for which a topic sends nothing, and the same in times of its usual interval."""


class Stretch(NamedTuple):
    """The times in which a value was beyond a limit while armed, in s."""

    seconds: float
    """All of them."""
    begin: float
    """Of the first one."""
    end: float
    """Of the last one."""


@dataclass(frozen=True)
class Flight:
    """A recording of one vehicle. What several rules need is computed once."""

    recorded: Recorded

    @property
    def log(self) -> Log:
        """The recording."""
        return self.recorded.log

    @property
    def duration(self) -> float:
        """The time from the first to the last sample, in s."""
        return self.recorded.duration

    @cached_property
    def timeline(self) -> Timeline:
        """The flight modes, failsafes, texts and events."""
        return timeline_of(self.recorded)

    @cached_property
    def track(self) -> Track | None:
        """The track over ground, None if the recording has no positions."""
        return track_of(self.recorded)

    @property
    def whole(self) -> Spans:
        """All of the recording."""
        return ((0.0, self.duration),)

    @cached_property
    def in_air(self) -> Spans:
        """The times in which the vehicle was armed and did not touch the ground; while armed if that is not told."""
        touching = self.touching
        return (
            common(self.recorded.armed, self.when(touching, touching.values == 0)) if touching else self.recorded.armed
        )

    @cached_property
    def touching(self) -> Column | None:
        """Whether a flag of the land detector tells that the vehicle touches the ground, None without such a flag."""
        fields = (self.recorded.column("vehicle_land_detected", each) for each in _TOUCHING)
        found = [column for column in fields if column is not None]
        if not found:
            return None
        values = np.any([column.values > 0 for column in found], axis=0).astype(np.float64)
        return found[0]._replace(values=values, path="vehicle_land_detected")

    @cached_property
    def landings(self) -> Spans:
        """The times in the air that end with a touch of the ground, after which the vehicle has landed.

        Disarming in the air is no landing, nor is a contact after which the vehicle flies on.
        """
        touching, landed = self.touching, self.recorded.column("vehicle_land_detected", "landed")
        if touching is None or landed is None:
            return ()
        follows = [*(begin for begin, _ in self.in_air[1:]), self.duration]
        return tuple(
            (begin, end)
            for (begin, end), following in zip(self.in_air, follows, strict=False)
            if touching.value_at(end) and landed.within(((end, following),)).values.any()
        )

    def without(self, times: Spans) -> Spans:
        """Return the recording without some times, which are in order and do not overlap."""
        begins, ends = (0.0, *(end for _, end in times)), (*(begin for begin, _ in times), self.duration)
        return tuple(each for each in zip(begins, ends, strict=True) if each[0] < each[1])

    def parameter(self, name: str, default: float) -> float:
        """Return the value of a parameter at the start, `default` if the recording does not have a number of it."""
        value = float(self.log.parameters.get(name, default))
        return value if np.isfinite(value) else default

    def first(self, paths: Iterable[str], instance: int = 0) -> Column | None:
        """Return the first of some fields such as `sensor_gps.eph` that the recording has, None if there is none."""
        names = (path.partition(".") for path in paths)
        found = (self.recorded.column(topic, field, instance) for topic, _, field in names)
        return next((column for column in found if column is not None), None)

    def estimated(self, topic: str, *fields: str) -> Iterator[tuple[str, list[Column]]]:
        """Yield the name of an estimator and some of its fields: those of the instance that PX4 followed at each time.

        Without `estimator_selector_status`, they are those of each instance that has all fields.
        """
        found: dict[int, list[Column]] = {}
        for instance in self.recorded.instances(topic):
            columns = [self.recorded.column(topic, field, instance) for field in fields]
            there = [column for column in columns if column is not None]
            if len(there) == len(fields):
                found[instance] = there
        primary = self.recorded.column("estimator_selector_status", "primary_instance")
        if primary is not None:
            chosen = {number: self.when(primary, primary.values == number) for number in found}
            parts = [[column.within(chosen[number]) for column in there] for number, there in found.items()]
            followed = [_joined(column) for column in zip(*parts, strict=True)]
            if followed and len(followed[0].times):
                yield "the estimator", followed
                return
        for instance, each in found.items():
            yield f"estimator {instance}" if len(found) > 1 else "the estimator", each

    def length(self, topic: str, field: str, instance: int = 0) -> Column | None:
        """Return the length of a vector such as `vehicle_magnetometer.magnetometer_ga`, None without one."""
        axes = [self.recorded.column(topic, f"{field}[{axis}]", instance) for axis in range(3)]
        x, y, z = axes
        if x is None or y is None or z is None:
            return None
        return x._replace(values=np.sqrt(x.values**2 + y.values**2 + z.values**2))

    def when(self, column: Column, mask: NDArray[np.bool_]) -> Spans:
        """Return the times in which some samples of a column are the latest ones."""
        return spans(column, mask, self.duration)

    def above(self, column: Column | None, limit: float, within: Spans | None = None) -> Stretch | None:
        """Return when a value is above a limit, each time until the next sample; None if it never is.

        `within` are the times that count: by default those while armed.
        """
        if column is None or not len(column.times):
            return None
        mask = (column.values > limit) & column.is_within(self.recorded.armed if within is None else within)
        found = spans(column, mask, float(column.times[-1]))
        return Stretch(sum(end - begin for begin, end in found), found[0][0], found[-1][1]) if found else None

    def below(self, column: Column | None, limit: float, within: Spans | None = None) -> Stretch | None:
        """Return when a value is below a limit, as `above` does."""
        return None if column is None else self.above(column._replace(values=-column.values), -limit, within)

    def changes(self, column: Column | None) -> NDArray[np.float64]:
        """Return the times at which a counter changed while armed, in s."""
        if column is None:
            return np.zeros(0)
        mask = (np.diff(column.values) != 0) & column.is_within(self.recorded.armed)[1:]
        times: NDArray[np.float64] = column.times[1:][mask]
        return times

    def rises(self, column: Column) -> Column:
        """Return by how much a counter rose while armed, at the times of the rises. A restart is none."""
        steps = np.diff(column.values, prepend=np.nan)
        mask = (steps > 0) & column.is_within(self.recorded.armed)
        return column._replace(times=column.times[mask], values=steps[mask])

    def gaps(self, column: Column, limit: float, within: Spans) -> Spans:
        """Return the times within some spans in which a topic has no sample for longer than a limit in s."""
        times = np.concatenate(([0.0], column.times, [self.duration]))
        long = np.flatnonzero(np.diff(times) > limit)
        candidates = tuple(zip(times[long].tolist(), times[long + 1].tolist(), strict=True))
        return tuple(each for each in common(candidates, within) if each[1] - each[0] > limit)

    def silences(self, column: Column) -> Spans:
        """Return when a topic sent nothing while armed and after its first sample, although vehicle_status went on.

        That is for 2 s and for 5 times its usual interval. Without vehicle_status, there is no such time.
        """
        others = self.recorded.column("vehicle_status", "arming_state")
        if others is None or len(column.times) < 2:  # noqa: PLR2004 - an interval
            return ()
        limit = max(_SILENT, _INTERVALS * median(np.diff(column.times)))
        since = common(((float(column.times[0]), self.duration),), self.recorded.armed)
        return tuple(each for each in self.gaps(column, limit, since) if not self.gaps(others, _SILENT, (each,)))


def _joined(columns: Sequence[Column]) -> Column:
    """Return the samples of some columns in the order of time."""
    times, values = (np.concatenate(each) for each in zip(*(column[:2] for column in columns), strict=True))
    order = np.argsort(times, kind="stable")
    return columns[0]._replace(times=times[order], values=values[order])


def flight_of(log: Log, is_needed: Callable[[str], bool]) -> Flight:
    """Return the flight in a recording, with its modes, and the topics whose names in uORB `is_needed` takes."""
    return Flight(Recorded(log, lambda name: name in TOPICS or is_needed(name)))


# log times

BACK = 1.0
"""The time in s from which log times step back: several threads of a recorder write samples in another order."""
GAP = 10.0
"""The shortest time in s without a sample that is told."""
_USUAL = 10
"""How many times as long as usually the topic with the most samples has to be silent."""


def jumps_of(log: Log) -> tuple[Spans, Spans]:
    """Return where log times step back, and where no topic has a sample for long: the times before and behind.

    The topic with the most samples tells it. Times of others are read only where that one is silent.
    """
    topics = [each for each in log.topics if each.known_count != 0 and each.read_times is not None]
    if not topics:
        return (), ()
    most = max(topics, key=lambda each: each.known_count or 0)
    start = log.start
    return _back(most, start), _silent(topics, most, start)


def _back(topic: Topic, start: int) -> Spans:
    if topic.read_times is None or len({number for number, _ in topic.channels}) < len(topic.channels):
        return ()  # the channels of a file follow each other
    times = _seconds(topic.read_times(), start)
    places = np.flatnonzero(np.diff(times) <= -BACK)
    return tuple((float(times[place]), float(times[place + 1])) for place in places)


def _silent(topics: list[Topic], most: Topic, start: int) -> Spans:
    steps = np.diff(_seconds(most.times, start))
    limit = max(GAP, _USUAL * median(steps)) if len(steps) else GAP
    if not (steps > limit).any():
        return ()
    times = np.sort(np.concatenate([_seconds(each.times, start) for each in topics]))
    return tuple((float(times[place]), float(times[place + 1])) for place in np.flatnonzero(np.diff(times) > limit))


def _seconds(times: NDArray[np.int64], start: int) -> NDArray[np.float64]:
    """Return times in s after the start. A ULog has samples from before it."""
    return np.maximum(times - start, 0) / 1e9
