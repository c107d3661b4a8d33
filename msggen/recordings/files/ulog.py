"""ULogs, the logs that PX4 writes on a vehicle: whole, cut off, or damaged.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import mmap
import struct
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.base.recording_formats import FORMATS
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.files.ulog_formats import FRONT, NUMBERS, PAYLOAD, is_format, parse_fields
from msggen.recordings.files.ulog_messages import DATA, HEAD, SMALLEST, Messages, kinds_of, sizes_of
from msggen.recordings.files.ulog_notes import LARGEST_TIME, Notes
from msggen.recordings.files.ulog_topics import Subscribed, Topics
from msggen.recordings.source.facts import Facts
from msggen.recordings.source.gather import at, groups
from msggen.recordings.source.memory import Octets, Places, drop_pages
from msggen.recordings.source.source import (
    FOREVER,
    Channel,
    Part,
    Problem,
    RecordingError,
    Source,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


MAGIC = FORMATS["ulog"].front
_HEADER = 16
_FLAGS = struct.Struct("<8s8s3Q")
_SUBSCRIPTION = struct.Struct("<BH")
_FORMAT, _ADD, _REMOVE, _SYNC, _PARAMETER = b"FARSP"
_FIRST = frozenset(b"BFIMPQALC")
"""The kinds of messages before the first sample."""
_TEXTS = frozenset(b"LC")
_LONGEST = 1000 << 32
"""The ns whose us fit in 32 bits."""
_TIME = 8
"""The size of a time."""
_DAY = 86400 * 10**9
_FAR = 30 * _DAY
"""How far in ns the time of a sample can be from those of most others."""
_SHOWN = 5
_LONGEST_NAME = 80
"""How much of a name is reported."""
_MOST_UNKNOWN = 1000
"""How many messages of unknown kinds are reported one by one."""


Timed = tuple[Places, "NDArray[np.int64]"]
"""The offsets of samples and their log times in ns."""


class _Window(NamedTuple):
    """The samples in a stretch of the file."""

    first: int
    last: int
    """The smallest and the largest log time in ns."""
    time_at_end: int
    """The log time of the last sample in the file."""
    base: int
    """The offset of the first sample."""
    places: Mapping[int, NDArray[np.uint32]]
    """The offsets of the samples of each channel, after `base`. A log of some GB has so many that their size counts."""
    times: Mapping[int, NDArray[np.uint32 | np.int64]]
    """The log times of the samples of each channel after `first`, in us."""

    def times_of(self, channel: int) -> NDArray[np.int64]:
        """Return the log times of the samples of a channel in ns."""
        times = self.times[channel].astype(np.int64)
        times *= 1000
        times += self.first
        return times


class UlogFile(Source):
    """A ULog. Raises RecordingError for other files, and for unknown flags, and OSError."""

    kind = "ulog"

    def __init__(self, path: str, *_: object, **__: object) -> None:
        super().__init__(path)
        self._topics = Topics()
        self._notes = Notes()
        self._channels: dict[int, Channel] = {}
        self._windows: list[_Window] = []
        self._counts: Counter[int] = Counter()
        self._sizes: dict[int, int] = {}
        """The size of all messages with samples of a channel without their fronts, 0 if not all have the same."""
        self._left_out: dict[tuple[str, int, str], Problem] = {}
        """What was left out of each topic, by its name and instance, and why."""
        self._unknown = 0
        """How many messages are of kinds that the format does not have."""
        self._data_start: int | None = None
        """Where the definitions end."""
        self._last_time = 0
        """The latest time in ns of all samples so far."""
        self._mapped = MappedFile(path)
        self.close_with(self._mapped.close)
        header = self._map[:_HEADER]
        if not header.startswith(MAGIC):
            raise RecordingError(f"{path} is not a ULog")
        if len(header) < _HEADER:
            raise RecordingError(f"{path} is cut off within its header")
        self._start = int.from_bytes(header[8:_HEADER], "little") * 1000
        if header[7] > 1:
            self._report(f"version {header[7]} of the format is not known, read as version 1", 7)
        self._read()

    @property
    def _map(self) -> mmap.mmap:
        return self._mapped.map

    @property
    def _file(self) -> Octets:
        return self._mapped.octets

    @property
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""
        return self._channels

    @property
    def facts(self) -> Facts:
        """Parameters, information, texts and dropouts."""
        return self._notes.facts._replace(start=self._start)

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""
        if not self._windows:
            return None
        return min(each.first for each in self._windows), max(each.last for each in self._windows)

    # samples

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """See Source.parts."""
        self._mapped.check()
        file = self._file
        for window in self._windows:
            if window.last < start or window.first >= stop:
                continue
            for number in window.places.keys() & set(channels):
                starts, times = window.places[number] + np.int64(window.base), window.times_of(number)
                if window.first < start or window.last >= stop:
                    chosen = (times >= start) & (times < stop)
                    starts, times = starts[chosen], times[chosen]
                if len(starts):
                    yield Part(number, file, starts + PAYLOAD, self._sizes_at(starts, number), times)
            drop_pages(file)

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        found: dict[int, list[NDArray[np.int64]]] = {number: [] for number in channels}
        for window in self._windows:
            for number in window.places.keys() & found.keys():
                found[number].append(window.times_of(number))
        return {number: np.concatenate([np.zeros(0, np.int64), *each]) for number, each in found.items()}

    def _sizes_at(self, starts: Places, number: int) -> Places:
        """Return the sizes of the samples of a channel, whose messages begin at `starts`."""
        if self._sizes[number]:
            return np.full(len(starts), self._sizes[number] - (PAYLOAD - FRONT), np.int64)
        sizes: Places = at(self._file, "<u2")[starts].astype(np.int64) - (PAYLOAD - FRONT)
        return sizes

    def _usual_times(self, samples: Places) -> NDArray[np.int64]:
        """Return what the times of samples are if they begin with them, all together: memory is read in order.

        The last sample of a file may be too short to have one.
        """
        last = self._file.size - PAYLOAD - _TIME
        return self._times_at(np.minimum(samples, last), PAYLOAD) if last >= 0 else np.zeros(len(samples), np.int64)

    def _times_at(self, starts: Places, offset: int) -> NDArray[np.int64]:
        """Return the log times of samples whose messages have their time at an offset."""
        times: Places = np.minimum(at(self._file, "<u8", offset)[starts], np.uint64(LARGEST_TIME)).astype(np.int64)
        return np.multiply(times, 1000, out=times)

    # the file

    def _read(self) -> None:
        """Find all messages."""
        messages = Messages(self._map, self._topics, self.problems)
        start = _HEADER
        for stop in [*self._appended(), self._file.size]:
            start = self._read_front(messages, start, stop)
            for starts, heads in messages.stretches(start, stop):
                self._take(starts, heads)
            start = stop
        counts = self._counts
        self._channels = {n: each._replace(sample_count=counts[n]) for n, each in self._topics.channels.items()}
        self.problems += self._left_out.values()
        unknown = self._topics.unknown
        if unknown:
            numbers = ", ".join(map(str, sorted(unknown)[:_SHOWN])) + ", ..." * (len(unknown) > _SHOWN)
            text = f"samples of topics that were never named (numbers {numbers})"
            self.problems.append(Problem(text, samples=sum(unknown.values())))
        if self._unknown > _MOST_UNKNOWN:
            self.problems.append(Problem(f"{self._unknown - _MOST_UNKNOWN} further messages of unknown kinds"))
        if self._notes.left_out:
            self.problems.append(Problem(f"{self._notes.left_out} texts, dropouts or parameters too many"))

    def _appended(self) -> list[int]:
        """Return where data was appended. Raises RecordingError for unknown flags."""
        if self._map[_HEADER + 2 : _HEADER + 3] != b"B" or self._file.size < _HEADER + FRONT + _FLAGS.size:
            return []
        _, flags, *offsets = _FLAGS.unpack_from(self._map, _HEADER + FRONT)
        if flags[0] & ~1 or any(flags[1:]):
            raise RecordingError(f"{self.path} has flags that this version cannot read ({flags.hex(' ')})")
        found: list[int] = []
        for offset in offsets:
            if offset and not (found or [_HEADER])[-1] < offset <= self._file.size:
                self._report(f"data should be appended at {offset}, which is not in the file", _HEADER)
            elif offset:
                found.append(offset)
        return found

    def _read_front(self, messages: Messages, start: int, stop: int) -> int:
        """Take the messages before the first sample one by one, and return where that is. Damage is skipped."""
        last = start
        while start < stop:
            start, last = self._take_parameters(start, last, stop)
            size = messages.size_at(start, stop)
            if size and self._takes_front(messages, start, size):
                start, last = start + size, start
                continue
            if self._data_start is not None or messages.is_sound(start, stop):
                break
            following = messages.resume(start + 1, stop)
            if not following < min(start + NUMBERS, stop) or self._map[following + 2] not in _FIRST:
                break
            for place in {last, start}:  # the size of the last message may be wrong
                self._take_format(place, following)
            self._report("the definitions are damaged", start, following - start)
            start = last = following
        return start

    def _take_parameters(self, start: int, last: int, stop: int) -> tuple[int, int]:
        """Take the parameters from an offset on, as most messages before the first sample are some.

        Return the offsets behind them, and of the last one, or `last` if there is none that can be read.
        """
        while self._data_start is None and start + FRONT < stop:
            size, kind = HEAD.unpack_from(self._map, start)
            end = start + FRONT + size
            if kind != _PARAMETER or size < SMALLEST["P"] or end > stop:
                break
            try:
                self._notes.take("P", self._map[start + FRONT : end], None)
            except (ValueError, struct.error):
                break
            start, last = end, start
        return start, last

    def _takes_front(self, messages: Messages, start: int, size: int) -> bool:
        """Take a message if it is one before the first sample that can be read, or that a message follows."""
        kind = self._map[start + 2]
        if kind not in _FIRST or (kind in _TEXTS and messages.hidden(start, start + size)):
            return False
        try:
            self._take_or_raise(start, 0)
        except (ValueError, struct.error):
            return False
        end = start + size
        is_whole = kind != _FORMAT or is_format(self._map[start + FRONT : end])
        return is_whole or messages.is_sound(end, self._file.size)

    def _take_format(self, start: int, stop: int) -> None:
        """Take a format that ends elsewhere than its size says, if it is one."""
        if self._map[start + 2] == _FORMAT and is_format(self._map[start + FRONT : stop]):
            self._take_definition("F", self._map[start + FRONT : stop], start)

    # messages

    def _take(self, starts: Places, heads: NDArray[np.uint64]) -> None:
        """Take messages in the order of the file."""
        if not len(starts):
            return
        kinds = kinds_of(heads)
        is_sample = kinds == DATA
        samples, others, kinds = starts[is_sample], starts[~is_sample], kinds[~is_sample]
        if self._data_start is None and len(samples):
            self._data_start = int(samples[0])
        for place in [*others[kinds == _FORMAT], *others[(kinds == _ADD) | (kinds == _REMOVE)]]:
            self._take_message(int(place))
        timed, in_order = self._samples(samples, heads[is_sample])
        is_sync = (kinds == _SYNC) & (sizes_of(heads[~is_sample]) == SMALLEST["S"])
        others = others[(kinds != _FORMAT) & (kinds != _ADD) & (kinds != _REMOVE) & ~is_sync]
        if len(others):
            latest = np.maximum.accumulate(np.append(self._last_time, in_order))
            for place, time in zip(others.tolist(), latest[np.searchsorted(samples, others)].tolist(), strict=True):
                self._take_message(place, time)
        if timed:
            self._windows.append(self._window(timed))
            self._last_time = max(self._last_time, self._windows[-1].last)

    def _take_message(self, place: int, time: int = 0) -> None:
        """Take a message that is no sample. `time` is that of the samples before it in ns."""
        try:
            self._take_or_raise(place, time)
        except (ValueError, struct.error):
            size, kind = HEAD.unpack_from(self._map, place)
            self._report(f"a message of the kind {chr(kind)!r} cannot be read", place, FRONT + size)

    def _take_or_raise(self, place: int, time: int) -> None:
        """Take a message that is no sample. Raises ValueError, and struct.error."""
        size, code = HEAD.unpack_from(self._map, place)
        kind, data = chr(code), self._map[place + FRONT : place + FRONT + size]
        if self._data_start is None and kind in "ARLCSO":
            self._data_start = place
        if kind in "RSO" and size != SMALLEST[kind]:
            raise ValueError(size)
        if kind in "BFAR":
            self._take_definition(kind, data, place)
        elif kind in "IMPQLCO":
            is_initial = self._data_start is None or place < self._data_start
            self._notes.take(kind, data, None if is_initial else time)
        elif kind not in SMALLEST:
            self._take_unknown(kind, place, size + FRONT)

    def _take_definition(self, kind: str, data: bytes, place: int) -> None:
        """Take a format or a subscription, or its end. Raises ValueError, also for samples that seem to be one."""
        if kind == "F":
            is_sample = self._data_start is not None  # the kind of a sample may be damaged
            # among the definitions, a damaged name of a field does not matter to the other fields
            text = data.decode(errors="strict" if is_sample else "replace")
            if is_sample and not parse_fields(text.partition(":")[2]):
                raise ValueError(text)
            self._topics.formats.add(text)
            if "\ufffd" in text:
                self._report(f"the format of {text.partition(':')[0][:_LONGEST_NAME]!r} is damaged", place)
        elif kind == "A":
            instance, number = _SUBSCRIPTION.unpack_from(data)
            name = data[_SUBSCRIPTION.size :].decode()
            if not name.isprintable():
                raise ValueError(name)
            self._topics.subscribe(place, number, name, instance)
        elif kind == "R":
            self._topics.remove(place, int.from_bytes(data[:2], "little"))
        elif place != _HEADER:
            raise ValueError(place)

    def _take_unknown(self, kind: str, place: int, size: int) -> None:
        """Report a message of a kind that the format does not have."""
        self._unknown += 1
        if self._unknown <= _MOST_UNKNOWN:
            self._report(f"a message of the unknown kind {kind!r}", place, size)

    def _samples(self, samples: Places, heads: NDArray[np.uint64]) -> tuple[dict[int, Timed], NDArray[np.int64]]:
        """Return samples, which are in the order of the file, by channel. Those of a wrong size are left out.

        Return also the time of each sample in that order, 0 for those that are left out or have none.
        """
        sizes = sizes_of(heads)
        found: dict[int, list[Places]] = defaultdict(list)
        for number, of_number in groups((heads >> np.uint64(24)).astype(np.uint16)):
            for topic, of_topic in self._topics.of(number, samples, of_number):
                chosen = self._fitting(topic, of_topic, samples, sizes)
                if len(chosen):
                    found[topic.number].append(chosen)
        timed: dict[int, Timed] = {}
        without: dict[int, Places] = {}
        usual = self._usual_times(samples)
        in_order = np.zeros(len(samples), np.int64)
        for channel, each in found.items():
            indices = each[0] if len(each) == 1 else np.sort(np.concatenate(each))
            starts = samples[indices]
            if self._topics.clocks.get(channel) == PAYLOAD:
                timed[channel] = starts, usual[indices]
            elif channel in self._topics.clocks:
                timed[channel] = starts, self._times_at(starts, self._topics.clocks[channel])
            else:
                without[channel] = starts
            if channel in timed:
                in_order[indices] = timed[channel][1]
        timed = self._in_time(timed)
        in_order[in_order > max((int(times.max()) for _, times in timed.values()), default=0)] = 0
        if without:
            places, times = _merged(timed.values())
            times = np.append(self._windows[-1].time_at_end if self._windows else 0, times)
            timed |= {channel: (starts, times[np.searchsorted(places, starts)]) for channel, starts in without.items()}
        for channel, (starts, _) in timed.items():
            self._counts[channel] += len(starts)
        return timed, in_order

    def _in_time(self, timed: dict[int, Timed]) -> dict[int, Timed]:
        """Return samples without those whose times are damaged: far later than most of them, and than all before."""
        known = max(self._start, self._last_time) + _FAR
        if all(int(times.max()) <= known for _, times in timed.values()):
            return timed
        latest = max(known, int(np.median(np.concatenate([times for _, times in timed.values()]))) + _FAR)
        found: dict[int, Timed] = {}
        for channel, (starts, times) in timed.items():
            kept = times <= latest
            if not kept.all():
                topic = self._topics.channels[channel]
                text = f"times more than {_FAR // _DAY} days after the other samples"
                count = int(np.count_nonzero(~kept))
                self._leave_out(Problem(text, int(starts[~kept][0]), 0, count, topic.topic, topic.instance))
            if kept.any():
                found[channel] = starts[kept], times[kept]
        return found

    @staticmethod
    def _window(timed: Mapping[int, Timed]) -> _Window:
        base = min(int(starts[0]) for starts, _ in timed.values())
        _, time_at_end = max((int(starts[-1]), int(times[-1])) for starts, times in timed.values())
        first = min(int(times.min()) for _, times in timed.values())
        last = max(int(times.max()) for _, times in timed.values())
        kind = np.uint32 if last - first < _LONGEST else np.int64
        return _Window(
            first=first,
            last=last,
            time_at_end=time_at_end,
            base=base,
            places={channel: (starts - base).astype(np.uint32) for channel, (starts, _) in timed.items()},
            times={channel: ((times - first) // 1000).astype(kind) for channel, (_, times) in timed.items()},
        )

    def _fitting(self, topic: Subscribed, indices: Places, samples: Places, sizes: Places) -> Places:
        """Return the indices of the samples that have the size of their topic, and count the others."""
        given = sizes[indices]
        least, most = int(given.min()), int(given.max())
        if not self._sizes.setdefault(topic.number, least) == least == most:
            self._sizes[topic.number] = 0
        if least >= topic.smallest and most <= topic.largest:
            return indices
        fits = (given >= topic.smallest) & (given <= topic.largest)
        if topic.wrong:
            text = f"{topic.name} is not read: {topic.wrong}"
            self._leave_out(Problem(text, samples=len(indices), topic=topic.name, instance=topic.instance))
        else:
            expected = topic.smallest - PAYLOAD + FRONT
            others = given[~fits] - PAYLOAD + FRONT
            places = samples[indices[~fits]]
            for size, first, count in zip(*np.unique(others, return_index=True, return_counts=True), strict=True):
                text = f"{size} bytes, expected {expected}: not samples of this definition"
                self._leave_out(Problem(text, int(places[first]), 0, int(count), topic.name, topic.instance))
        return indices[fits]

    def _leave_out(self, problem: Problem) -> None:
        """Count samples that are left out. The offset is that of the first one."""
        key = problem.topic, problem.instance, problem.text
        known = self._left_out.get(key)
        self._left_out[key] = known._replace(samples=known.samples + problem.samples) if known else problem

    def _report(self, text: str, offset: int, size: int = 0) -> None:
        self.problems.append(Problem(text, offset, size))


def _merged(samples: Collection[Timed]) -> Timed:
    """Return the samples of several channels in the order of the file: their offsets and times."""
    none = np.zeros(0, np.int64)
    places = np.concatenate([none, *(places for places, _ in samples)])
    times = np.concatenate([none, *(times for _, times in samples)])
    order = np.argsort(places)
    return places[order], times[order]
