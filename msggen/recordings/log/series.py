"""Fields of a recording over time: numbers with their unit, values with names as spans, and flight modes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.base.diagnostics import few, printable, shortened, suggestion
from msggen.messages.nav_states import HOLD, MODE_CONSTANTS, mode_title
from msggen.recordings.columns.annotations import Annotation, annotation_of
from msggen.recordings.columns.arrays import names_of
from msggen.recordings.columns.ordered import distinct, median
from msggen.recordings.source.source import RecordingError
from msggen.recordings.topics.choice import listed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

MODES = "vehicle_status", "nav_state"
"""The topic and the field with the flight modes."""
LONGEST, LONGEST_VALUE = 60, 40
"""The most characters of a text that are drawn, and of the name of a value."""
PIXELS = 2000
"""The number of points on the time axis that are told apart: two for each pixel of a PNG."""
_MOST_BANDS = 64
"""The rows that bands have at most: a field with more values is drawn as a line."""
_PATH = re.compile(r"(?P<topic>[^.\[\]]+)(?:\[(?P<instance>\d{1,3})\])?\.(?P<field>.+)")


class NoSamplesError(RecordingError):
    """Fields whose topics have no samples in the time that was asked for."""

    def __init__(self, paths: Sequence[str], text: str) -> None:
        super().__init__(text)
        self.paths = paths


@dataclass(frozen=True)
class Band:
    """The times in s at which a field has a value."""

    name: str
    spans: tuple[tuple[float, float], ...]
    """Begin and end of each stretch, without those that follow closer than a pixel."""


@dataclass(frozen=True)
class Series:
    """A field over time, as it is drawn."""

    label: str
    times: NDArray[np.float64]
    """In s after the start of the recording."""
    values: NDArray[Any]
    annotation: Annotation
    end: float
    """The time in s at which it ends: its last sample, or if the values have names, the usual interval later."""

    @property
    def unit(self) -> str:
        """The unit, "" for a number without one and for a field whose unit is not known."""
        return "" if self.annotation.unit == "-" else self.annotation.unit

    @property
    def is_named(self) -> bool:
        """Whether the values have names, and are few."""
        if self.values.dtype == bool or self.annotation.is_flags:
            return True
        return bool(self.annotation.members) and len(distinct(self.values)) <= _MOST_BANDS

    @property
    def name_in_legend(self) -> str:
        """The label, with a note on a line that cannot be seen."""
        is_seen = self.is_held or bool(np.isfinite(self.values).any())
        return shown(self.label) + ("" if is_seen else " (never a finite number)")

    @property
    def is_held(self) -> bool:
        """Whether a value lasts until the next sample: all but floats."""
        return self.values.dtype.kind != "f"

    def since(self, begin: float) -> Series:
        """Return the same field without the samples before a time in s.

        The last of these is moved to this time, if its value lasts until then or there is no later sample.
        """
        first = int(np.searchsorted(self.times, begin))
        if first == len(self.times) or (first and self.is_held and self.times[first] > begin):
            first -= 1
        times = np.maximum(self.times[first:], begin)
        return replace(self, times=times, values=self.values[first:], end=max(self.end, begin))

    @property
    def bands(self) -> tuple[Band, ...]:
        """The bands of a field whose values have names, in the order of the values; only of those that occur."""
        names = self.annotation.members
        if self.values.dtype == bool:
            found: list[tuple[str, NDArray[np.bool_]]] = [("false", ~self.values), ("true", self.values)]
        elif self.annotation.is_flags:
            flags = _unsigned(self.values)
            found = [(name, flags & bit == bit) for bit, name in self._bits.items()]
            found.append((names.get(0, "none"), self.values == 0))
        else:
            found = [(names.get(int(each), str(each)), self.values == each) for each in distinct(self.values)]
        return tuple(Band(name, self._spans(mask)) for name, mask in found if mask.any())

    @property
    def _bits(self) -> dict[int, str]:
        """The flags that occur and their names, `bit 29` for a bit without a name."""
        every = int(np.bitwise_or.reduce(_unsigned(self.values)))
        bits = {1 << bit: f"bit {bit}" for bit in range(every.bit_length())}
        named = {**bits, **self.annotation.members}
        return {flag: named[flag] for flag in sorted(named) if flag > 0 and flag & every == flag}

    def _spans(self, mask: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
        """Return begin and end of each stretch in which `mask` is set; those without a pixel between them are one."""
        edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
        ends = np.append(self.times, self.end)
        begin, stop = ends[np.flatnonzero(edges == 1)], ends[np.flatnonzero(edges == -1)]
        apart = begin[1:] - stop[:-1] > (self.end - self.times[0]) / PIXELS
        begin, stop = begin[np.append(True, apart)], stop[np.append(apart, True)]
        return tuple(zip(begin.tolist(), stop.tolist(), strict=True))


def read_series(
    log: Log, paths: Iterable[str], *, start: float | None = None, stop: float | None = None
) -> list[Series]:
    """Return fields of a recording by paths such as `vehicle_status.nav_state` and `sensor_gps[1].eph`.

    The topic ends at the first `.`, and has the number of its instance in brackets. A field that is an array or a
    message stands for all of its numbers. Raises RecordingError for a path that there is not, and for text, and
    NoSamplesError for all paths without samples.
    """
    wanted = {path: parse_path(log, path) for path in listed(paths)}
    loaded = log.load({topic.label: topic for topic, _ in wanted.values()}.values(), start=start, stop=stop)
    chosen = {path: loaded[topic.key].choose([name]) for path, (topic, name) in wanted.items()}
    empty = [path for path, samples in chosen.items() if not len(samples)]
    if empty:
        names = few(list(dict.fromkeys(chosen[path].topic.label for path in empty)))
        time = "" if start is None and stop is None else " in this time"
        raise NoSamplesError(empty, f"there are no samples of {names}{time}")
    found = []
    for path, samples in chosen.items():
        topic, _ = wanted[path]
        times = (samples.log_times - log.start) / 1e9
        front = topic.uorb + (f"[{topic.instance}]" if topic.instance else "")
        for column, values in samples.columns().items():
            if values.dtype == object:
                raise RecordingError(f"{front}.{column} has no fixed size, and is not drawn")
            about = drawn(annotation_of(topic, column))
            series = Series(f"{front}.{column}", times, values, about, float(times[-1]))
            if stop is not None and topic.last > samples.log_times[-1]:  # the last value lasts until a later sample
                series = replace(series, end=stop)
            elif series.is_named:
                series = replace(series, end=_end_of(series, stop))
            found.append(series)
    return found


def drawn(about: Annotation) -> Annotation:
    """Return what values mean, with the names of flight modes for people: `Hold` for `AUTO_LOITER`."""
    if about.members.get(HOLD) != MODE_CONSTANTS[HOLD]:
        return about
    return about._replace(members={value: mode_title(name) for value, name in about.members.items()})


def _end_of(series: Series, stop: float | None) -> float:
    """Return until when the last value lasts: for the median interval. Samples long before the start do not count."""
    times = series.times if series.end < 0 else series.since(0.0).times
    usual = median(np.diff(times)) if len(times) > 1 else 0.0
    return min(float(times[-1]) + usual, inf if stop is None else stop)


def read_modes(log: Log, *, start: float | None = None, stop: float | None = None) -> Series | None:
    """Return the flight modes of a recording, None if it does not have them. Those without a name have a number."""
    try:
        modes = read_series(log, [".".join(MODES)], start=start, stop=stop)[0]
    except RecordingError:
        return None
    numbered = {value: mode_title(str(value)) for value in distinct(modes.values).tolist()}
    about = modes.annotation._replace(members={**numbered, **modes.annotation.members})
    return replace(modes, annotation=about, end=max(modes.end, _end_of(modes, stop)))


def _near(log: Log, name: str) -> str:
    """Return a suggestion for a name that is no topic: the topic, or the path that `topic/field` may mean."""
    topic, _, field = name.rpartition("/")
    if topic in log:
        return f", did you mean '{topic}.{field}'?"
    return suggestion(name, [each.uorb for each in log.topics])


def parse_path(log: Log, path: str) -> tuple[Topic, str]:
    """Return the topic and the field of a path. Raises RecordingError."""
    found = _PATH.fullmatch(path)
    if found is None:
        name = path.partition("[")[0]
        if "." in path or name not in log:
            near = "" if "." in path else _near(log, name)
            raise RecordingError(f"expected TOPIC.FIELD or TOPIC[INSTANCE].FIELD, found '{path}'{near}")
        columns = sorted(names_of(log.dtype(name)), key=lambda each: "timestamp" in each)  # the times last
        raise RecordingError(f"'{path}' is a topic: name one of its fields, such as {few(columns)}")
    instance = found["instance"]
    return log.topic(found["topic"], None if instance is None else int(instance)), found["field"]


def _unsigned(values: NDArray[Any]) -> NDArray[Any]:
    return values.view(values.dtype.str.replace("i", "u"))


def shown(text: str, longest: int = LONGEST) -> str:
    """Return a text of a recording as it is drawn."""
    return shortened(printable(text), longest, longest // 2)
