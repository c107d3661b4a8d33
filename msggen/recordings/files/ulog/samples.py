"""The samples of a ULog by channel, with their offsets and times. Those that do not fit their topic are counted.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.ulog.formats import FRONT, PAYLOAD
from msggen.recordings.files.ulog.notes import LARGEST_TIME
from msggen.recordings.source.gather import at, grouped
from msggen.recordings.source.source import Part, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from msggen.recordings.files.ulog.heads import Heads
    from msggen.recordings.files.ulog.topics import Subscribed, Topics
    from msggen.recordings.source.memory import Octets, Places

    Spans = Mapping[int, tuple[int, int]]
    Times = NDArray[np.int64]

_LONGEST = 1 << 32
"""The us that do not fit in 32 bits."""
_TIME = 8
"""The size of a time."""
_DAY = 86400 * 10**6
_FAR = 30 * _DAY
"""How far in us the time of a sample can be from those of most others."""


class Window(NamedTuple):
    """The samples in a stretch of the file, by channel, and in the order of the file for each."""

    first: int
    last: int
    """The smallest and the largest log time in us."""
    time_at_end: int
    """The log time of the last sample in the file in us."""
    base: int
    """The offset of the first sample."""
    spans: Mapping[int, tuple[int, int]]
    """From where to where the samples of each channel are in `places` and `times`."""
    places: NDArray[np.uint32]
    """The offsets of the samples, after `base`. A log of some GB has so many that their size counts."""
    times: NDArray[np.uint32 | np.int64]
    """The log times of the samples after `first`, in us."""

    def chosen(self, channels: Iterable[int]) -> list[tuple[int, int, int]]:
        """Return those of some channels that have samples, and from where to where these are."""
        return [(number, *self.spans[number]) for number in sorted({*channels} & self.spans.keys())]

    def times_of(self, low: int, high: int) -> Times:
        """Return some of the log times in ns."""
        times = self.times[low:high].astype(np.int64)
        times += self.first
        times *= 1000
        return times


class Samples:
    """The samples of a ULog, which are taken from one stretch of the file after the other. `start` is in us."""

    def __init__(self, topics: Topics, start: int) -> None:
        self.windows: list[Window] = []
        self.counts: Counter[int] = Counter()
        """How many samples each channel has."""
        self.unset: Counter[int] = Counter()
        """How many samples of each channel have no time of their own."""
        self.last = 0
        """The latest time in us of all samples so far."""
        self._topics = topics
        self._start = start
        self._sizes: dict[int, int] = {}
        """The size of all messages with samples of a channel without their fronts, 0 if not all have the same."""
        self._left_out: dict[tuple[str, int, str], Problem] = {}
        """What was left out of each topic, by its name and instance, and why."""

    @property
    def problems(self) -> list[Problem]:
        """What was left out of each topic, and why."""
        return [*self._left_out.values()]

    def parts(self, file: Octets, window: Window, channels: Iterable[int], start: int, stop: int) -> Iterator[Part]:
        """Yield the samples of channels in a window whose log times are from `start` up to `stop`, in ns."""
        chosen = window.chosen(channels)
        if not chosen or window.last * 1000 < start or window.first * 1000 >= stop:
            return
        begin, end = min(low for _, low, _ in chosen), max(high for _, _, high in chosen)
        all_times = window.times_of(begin, end)
        all_starts = window.places[begin:end].astype(np.int64)
        all_starts += window.base + PAYLOAD
        is_whole = window.first * 1000 >= start and window.last * 1000 < stop
        for number, low, high in chosen:
            starts, times = all_starts[low - begin : high - begin], all_times[low - begin : high - begin]
            if not is_whole:
                within = (times >= start) & (times < stop)
                starts, times = starts[within], times[within]
            if len(starts):
                yield Part(number, file, starts, self._sizes_at(file, starts, number), times)

    def _sizes_at(self, file: Octets, starts: Places, number: int) -> Places:
        """Return the sizes of the samples of a channel, which begin at `starts`."""
        size = self._sizes[number] - (PAYLOAD - FRONT)
        if size >= 0:
            return np.ndarray((len(starts),), "<i8", size.to_bytes(8, "little"), 0, (0,))  # the same for each
        sizes: Places = at(file, "<u2")[starts - PAYLOAD].astype(np.int64) - (PAYLOAD - FRONT)
        return sizes

    def take(self, heads: Heads, file: Octets) -> Times:
        """Take samples, which are in the order of the file.

        Return the time in us of each, 0 for those that are left out or have none.
        """
        found = self._by_channel(heads)
        clocks = self._topics.clocks
        with_time = {channel: indices for channel, indices in found.items() if clocks[channel] is not None}
        usual = _usual_times(file, heads.starts)
        in_order = np.zeros(len(heads.starts), np.int64)
        spans, indices = _together(with_time)
        times = usual[indices]
        for channel, (low, high) in spans.items():
            clock = clocks[channel]
            if clock is not None and clock != PAYLOAD:
                times[low:high] = _times_at(file, heads.starts[indices[low:high]], clock)
        spans, indices, times = self._in_time(heads, spans, indices, times)
        self._set_unset(spans, indices, times)
        in_order[indices] = times
        if len(with_time) < len(found):
            spans, indices, times = self._with_others(found, spans, indices, times)
        if len(indices):
            window = self._window(heads.starts[indices], times, spans)
            self.windows.append(window)
            self.last = max(self.last, window.last)
            self.counts.update({channel: high - low for channel, (low, high) in spans.items()})
        return in_order

    def _by_channel(self, heads: Heads) -> dict[int, Places]:
        """Return the indices of the samples of each channel, in order. Those of a wrong size are left out."""
        found: dict[int, list[Places]] = defaultdict(list)
        order, numbers, bounds = grouped(heads.numbers)
        if not numbers:
            return {}
        sizes = heads.sizes[order]
        least, most = (each.reduceat(sizes, bounds[:-1]).tolist() for each in (np.minimum, np.maximum))
        for number, (begin, end), low, high in zip(numbers, pairwise(bounds), least, most, strict=True):
            for topic, of_topic in self._topics.of(number, heads.starts, order[begin:end]):
                chosen = of_topic
                if low < topic.smallest or high > topic.largest:
                    chosen = self._fitting(topic, of_topic, heads)
                if not self._sizes.setdefault(topic.number, low) == low == high:
                    self._sizes[topic.number] = 0
                if len(chosen):
                    found[topic.number].append(chosen)
        return {
            channel: each[0] if len(each) == 1 else np.sort(np.concatenate(each)) for channel, each in found.items()
        }

    def _in_time(self, heads: Heads, spans: Spans, indices: Places, times: Times) -> tuple[Spans, Places, Times]:
        """Leave out samples whose times are damaged: far later than most of them, and than all before."""
        known = max(self._start, self.last) + _FAR
        if not len(times) or int(times.max()) <= max(known, int(times.min()) + _FAR):
            return spans, indices, times
        latest = max(known, int(np.median(times)) + _FAR)
        is_kept = times <= latest
        kept: dict[int, Places] = {}
        for channel, (low, high) in spans.items():
            wrong = low + np.flatnonzero(~is_kept[low:high])
            if len(wrong):
                text = f"times more than {_FAR // _DAY} days after the other samples"
                place = int(heads.starts[indices[wrong[0]]])
                self._leave_out(Problem(text, place, 0, len(wrong), *self._topics.name_of(channel)))
            if len(wrong) < high - low:
                kept[channel] = indices[low:high][is_kept[low:high]]
        return *_together(kept), times[is_kept]

    def _with_others(
        self, found: Mapping[int, Places], spans: Spans, indices: Places, times: Times
    ) -> tuple[Spans, Places, Times]:
        """Add the samples of channels without a time. They have the time of the sample before them in the file."""
        others = {channel: each for channel, each in found.items() if self._topics.clocks[channel] is None}
        own_spans, own = _together(others)
        own_times = self._times_before(own, indices, times)
        moved = {channel: (low + len(indices), high + len(indices)) for channel, (low, high) in own_spans.items()}
        return {**spans, **moved}, np.append(indices, own), np.append(times, own_times)

    def _set_unset(self, spans: Spans, indices: Places, times: Times) -> None:
        """Give samples with the time 0 that of the sample before them in the file, and count them.

        A program has published them without a time. At the start of a log, 0 can be right.
        """
        is_unset = times == 0
        if not is_unset.any():
            return
        times[is_unset] = self._times_before(indices[is_unset], indices[~is_unset], times[~is_unset])
        for channel, (low, high) in spans.items():
            count = int(np.count_nonzero(is_unset[low:high] & (times[low:high] > 0)))
            if count:
                self.unset[channel] += count

    def _times_before(self, wanted: Places, indices: Places, times: Times) -> Times:
        """Return the times of the samples before those at `wanted` in the file.

        Before the first one, it is 0, or its time if the log starts later than with 0.
        """
        order = np.argsort(indices)
        first = self.windows[-1].time_at_end if self.windows else int(times[order[0]]) if len(order) else 0
        if not self.windows and not 0 < self._start <= first:
            first = 0
        found: Times = np.append(first, times[order])[np.searchsorted(indices[order], wanted)]
        return found

    @staticmethod
    def _window(starts: Places, times: Times, spans: Spans) -> Window:
        base, first, last = int(starts.min()), int(times.min()), int(times.max())
        return Window(
            first=first,
            last=last,
            time_at_end=int(times[starts.argmax()]),
            base=base,
            spans=spans,
            places=(starts - base).astype(np.uint32),
            times=(times - first).astype(np.uint32 if last - first < _LONGEST else np.int64),
        )

    def _fitting(self, topic: Subscribed, indices: Places, heads: Heads) -> Places:
        """Return the indices of the samples that have a size of their topic, and count the others."""
        given = heads.sizes[indices]
        fits = (given >= topic.smallest) & (given <= topic.largest)
        if topic.wrong:
            text = f"{topic.name} is not read: {topic.wrong}"
            self._leave_out(Problem(text, samples=len(indices), topic=topic.name, instance=topic.instance))
        elif not fits.all():
            expected = topic.smallest - PAYLOAD + FRONT
            others = given[~fits].astype(np.int64) - PAYLOAD + FRONT
            places = heads.starts[indices[~fits]]
            for size, first, count in zip(*np.unique(others, return_index=True, return_counts=True), strict=True):
                text = f"{size} bytes, expected {expected}: not samples of this definition"
                self._leave_out(Problem(text, int(places[first]), 0, int(count), topic.name, topic.instance))
        return indices[fits]

    def _leave_out(self, problem: Problem) -> None:
        """Count samples that are left out. The offset is that of the first one."""
        key = problem.topic, problem.instance, problem.text
        known = self._left_out.get(key)
        self._left_out[key] = known._replace(samples=known.samples + problem.samples) if known else problem


def _together(indices: Mapping[int, Places]) -> tuple[Spans, Places]:
    """Return the indices of several channels as one array, and from where to where those of each are in it."""
    ends = accumulate(map(len, indices.values()), initial=0)
    spans = dict(zip(indices, pairwise(ends), strict=True))
    return spans, np.concatenate([*indices.values()]) if indices else np.zeros(0, np.int64)


def _usual_times(file: Octets, samples: Places) -> Times:
    """Return what the times of samples are in us if they begin with them, all together: memory is read in order.

    The last sample of a file may be too short to have one.
    """
    last = file.size - PAYLOAD - _TIME
    return _times_at(file, np.minimum(samples, last), PAYLOAD) if last >= 0 else np.zeros(len(samples), np.int64)


def _times_at(file: Octets, starts: Places, offset: int) -> Times:
    """Return the log times in us of samples whose messages have their time at an offset."""
    times: NDArray[np.uint64] = at(file, "<u8", offset)[starts]
    return np.minimum(times, np.uint64(LARGEST_TIME), out=times).view(np.int64)
