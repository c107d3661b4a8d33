"""The offset between the clocks of two recordings of one flight, by the samples that both have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.base.diagnostics import counted
from msggen.recordings.columns.arrays import columns_of
from msggen.recordings.columns.ordered import median
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log.align import Times
    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.find import Key
    from msggen.recordings.topics.topic import Topic

_TRIED = 8
"""How many topics are tried, those with the most samples first."""
_FEWEST = 5
"""Fewer samples than this show no offset."""
_NEAR = 200_000_000
"""The offsets of samples that agree are within this many ns: clocks drift, and samples are delayed."""
_SHARE = 1 / 3
"""The share of the common samples that must agree. Others are equal by chance, or from before or after a jump."""
_WITHIN = 0.95
"""The share of the samples that agree whose offsets are within the error."""
_TIMES = "timestamp"
"""The front of the names of fields with times, which PX4 changes on the way to DDS."""
_ALIKE = 0.8
"""The smallest correlation of signals that belong together."""
_CLEARER = 0.1
"""By how much it must be larger than at any other offset."""
_APART = 2_000_000_000
"""Offsets in ns that are farther apart are others."""
_OVERLAP = 100
"""The fewest steps that two signals must have in common, and at least a fifth of the shorter one."""
_MOST_STEPS = 1 << 20
_SIGNALS = 6
"""How many columns are correlated, those with the most values first."""


class Offset(NamedTuple):
    """The offset between two recordings: log time in the second recording = log time in the first + `offset`."""

    offset: int
    """In ns: the median of the samples that agree. It includes the usual delay from the vehicle to the recorder."""
    error: int
    """In ns: the offsets of 95 % of the samples that agree are within the offset and this, more and less."""
    topic: str
    """The topic by which it was found."""
    agreeing: int
    """How many samples of both recordings agree."""
    common: int
    """How many samples both recordings have. Those that do not agree are equal by chance, or a clock has jumped."""
    correlation: float | None = None
    """How alike the signals of both recordings are, up to 1.0, if they have no equal samples. Otherwise None."""

    def __str__(self) -> str:
        """Return one line for a user."""
        front = f"{self.offset / 1e9:.6f} s, within {self.error / 1e9:.6f} s, by"
        if self.correlation is not None:
            return f"{front} the signals of {self.topic}, which correlate by {self.correlation:.2f}"
        return f"{front} {self.agreeing} of {counted(self.common, 'sample')} of {self.topic}"


def offset_between(first: Log, second: Log, topic: Key | None = None) -> Offset:
    """Return the offset between two recordings of one flight: second log time = first log time + offset.

    Both have some samples of one topic whose values are equal, apart from times. The topic is `topic`, or the one with
    the most samples that agree. Recordings can begin at different times, lose samples and limit rates. Without such
    samples, the signals of a topic are correlated. Raises RecordingError if that shows no offset either.
    """
    pairs = _shared(first, second) if topic is None else [(first.topic(topic), second.topic(topic))]
    if not pairs:
        raise RecordingError("the recordings have no topic in common")
    found = []
    for find in (_by_samples, _by_signals):
        for one, other in pairs[:_TRIED]:
            try:
                offset = find(first.samples(one), second.samples(other))
            except RecordingError:
                if topic is not None:
                    raise
                continue
            if offset is not None:
                found.append(offset)
        if found:
            return max(found, key=lambda offset: (offset.agreeing, offset.correlation or 0))
    names = ", ".join(one.label for one, _ in pairs[:_TRIED])
    raise RecordingError(f"no offset was found: too few equal samples of {names}, and no signals that are alike")


def _shared(first: Log, second: Log) -> list[tuple[Topic, Topic]]:
    """Return the topics that both recordings have, those with the most samples first."""

    def by_name(log: Log) -> dict[tuple[str, str, int], Topic]:
        return {(topic.uorb, topic.ros_type.rpartition("/")[2], topic.instance): topic for topic in log.topics}

    ones, others = by_name(first), by_name(second)
    pairs = [(ones[name], others[name]) for name in ones.keys() & others]
    return sorted(pairs, key=lambda pair: (-min(each.count for each in pair), pair[0].label))


def _deltas(first: Samples, second: Samples) -> Times:
    """Return the differences of the log times of samples whose values occur exactly once in each recording."""
    names = _compared(first) & _compared(second)
    if not names:
        return np.empty(0, np.int64)
    keys, others = _keys(first, sorted(names)), _keys(second, sorted(names))
    one, one_index, one_count = np.unique(keys, return_index=True, return_counts=True)
    other, other_index, other_count = np.unique(others, return_index=True, return_counts=True)
    _, here, there = np.intersect1d(one, other, assume_unique=True, return_indices=True)
    is_single = (one_count[here] == 1) & (other_count[there] == 1)
    times = second.log_times[other_index[there[is_single]]] - first.log_times[one_index[here[is_single]]]
    found: Times = times
    return found


def _compared(samples: Samples) -> set[str]:
    """Return the names of the columns that are compared: all but times and values without a fixed size."""
    columns = columns_of(samples.array[:0])
    return {name for name, values in columns.items() if values.dtype != object and not name.startswith(_TIMES)}


def _keys(samples: Samples, names: list[str]) -> NDArray[np.uint64]:
    """Return a number for each sample, the same for samples with the same bytes."""
    columns = columns_of(samples.array)
    chance = np.random.default_rng(0)
    keys = np.zeros(len(samples), np.uint64)
    for name in names:
        column = np.ascontiguousarray(columns[name])
        bits: Any = column.view(f"u{column.dtype.itemsize}").astype(np.uint64)
        # sums of products with random numbers collide as seldom as other hashes of 64 bits
        factor = chance.integers(1 << 63, dtype=np.uint64) * np.uint64(2) + np.uint64(1)
        mixed = bits * factor
        keys += mixed ^ (mixed >> np.uint64(32))
    return keys


def _by_samples(first: Samples, second: Samples) -> Offset | None:
    """Return the offset on which the most samples agree, None if too few do."""
    ordered = np.sort(_deltas(first, second))
    behind = np.searchsorted(ordered, ordered + _NEAR, side="right")
    if not len(ordered):
        return None
    counts = behind - np.arange(len(ordered))
    begin = int(np.argmax(counts))
    agreeing = ordered[begin : int(behind[begin])]
    if len(agreeing) < max(_FEWEST, _SHARE * len(ordered)):
        return None
    middle = int(agreeing[len(agreeing) // 2])
    distances = np.sort(np.abs(agreeing - middle))
    error = int(distances[min(int(_WITHIN * len(distances)), len(distances) - 1)])
    return Offset(middle, error, first.topic.label, len(agreeing), len(ordered))


# signals


def _by_signals(first: Samples, second: Samples) -> Offset | None:
    """Return the offset at which the columns of floats are most alike, None if they are not clearly so."""
    if min(len(first), len(second)) < _OVERLAP:
        return None
    step = _step_of(first, second)
    columns, others = columns_of(first.array), columns_of(second.array)
    names = [name for name in columns.keys() & others.keys() if columns[name].dtype.kind == "f"]
    names.sort(key=lambda name: (-len(np.unique(columns[name])), name))
    sums: Any = 0.0
    used = 0
    for name in names[:_SIGNALS]:
        one, other = _signal(columns[name], first.log_times, step), _signal(others[name], second.log_times, step)
        if one.any() and other.any():
            sums, used = sums + _correlations(one, other), used + 1
    if not used:
        return None
    alike = sums / used
    count = len(_signal(columns[names[0]], first.log_times, step))
    best = int(np.argmax(alike))
    apart = max(_APART // step, 1)
    rest = np.concatenate([alike[: max(best - apart, 0)], alike[best + apart :]])
    if alike[best] < _ALIKE or (len(rest) and alike[best] - rest.max() < _CLEARER):
        return None
    offset = int(second.log_times[0] - first.log_times[0]) + (best - count + 1) * step
    return Offset(offset, step, first.topic.label, 0, 0, round(float(alike[best]), 3))


def _step_of(first: Samples, second: Samples) -> int:
    """Return the interval of signals in ns: that of the faster recording, or longer for long recordings."""
    intervals = [median(np.diff(each.log_times)) for each in (first, second)]
    length = max(int(each.log_times[-1] - each.log_times[0]) for each in (first, second))
    return max(round(min(intervals)), length // _MOST_STEPS, 1)


def _signal(values: NDArray[Any], times: Times, step: int) -> NDArray[np.float64]:
    """Return the values at equal intervals, with mean 0. A sample that is no number is left out."""
    is_known = np.isfinite(values)
    places = np.arange(0, int(times[-1] - times[0]) + 1, step)
    if not is_known.any():
        return np.zeros(len(places))
    found = np.interp(places, (times - times[0])[is_known], values[is_known].astype(np.float64))
    centred: NDArray[np.float64] = found - found.mean()
    return centred


def _correlations(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the correlation for each offset in steps, from `1 - len(one)` up to `len(other) - 1`.

    It is that of the part that both have, and -1 where it is too short.
    """
    offsets = np.arange(1 - len(one), len(other))
    size = 1 << (len(offsets)).bit_length()
    products = np.fft.irfft(np.fft.rfft(other, size) * np.conj(np.fft.rfft(one, size)), size)[offsets]
    begin, end = np.maximum(-offsets, 0), np.minimum(len(one), len(other) - offsets)
    squares, other_squares = (np.concatenate([[0.0], np.cumsum(each * each)]) for each in (one, other))
    energy = (squares[end] - squares[begin]) * (other_squares[end + offsets] - other_squares[begin + offsets])
    is_long = end - begin >= max(_OVERLAP, min(len(one), len(other)) // 5)
    found: NDArray[np.float64] = products / np.sqrt(np.where(energy > 0, energy, 1.0))
    found[~is_long | (energy <= 0)] = -1.0
    return found
