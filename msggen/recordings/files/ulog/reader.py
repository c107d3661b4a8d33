"""ULogs, the logs that PX4 writes on a vehicle: whole, cut off, or damaged.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from msggen.base.diagnostics import counted
from msggen.base.recording_formats import FORMATS
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.files.ulog.formats import FRONT, LONGEST_RUN, NUMBERS, is_format, parse_fields
from msggen.recordings.files.ulog.heads import DATA, HEAD
from msggen.recordings.files.ulog.messages import SMALLEST, Messages
from msggen.recordings.files.ulog.notes import Notes, usual_parameters
from msggen.recordings.files.ulog.samples import Samples
from msggen.recordings.files.ulog.topics import Topics
from msggen.recordings.source.facts import Facts
from msggen.recordings.source.memory import drop_pages
from msggen.recordings.source.source import FOREVER, Channel, Part, Problem, RecordingError, Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.files.ulog.heads import Heads
    from msggen.recordings.source.memory import Octets

MAGIC = FORMATS["ulog"].front
_HEADER = 16
_FLAGS = struct.Struct("<8s8s3Q")
_SUBSCRIPTION = struct.Struct("<BH")
_FORMAT, _ADD, _REMOVE, _SYNC = b"FARS"
_FIRST = frozenset(b"BFIMPQALC")
"""The kinds of messages before the first sample."""
_TEXTS = frozenset(b"LC")
_FEW = 8
_SHOWN = 5
_LONGEST_NAME = 80
"""How much of a name is reported."""
_MOST_UNKNOWN = 1000
"""How many messages of unknown kinds are reported one by one."""


class UlogFile(Source):
    """A ULog. Raises RecordingError for other files, and for unknown flags, and OSError."""

    kind = "ulog"

    def __init__(self, path: str, *_: object, **__: object) -> None:
        super().__init__(path)
        self._topics = Topics()
        self._notes = Notes()
        self._channels: dict[int, Channel] = {}
        self._unknown = 0
        """How many messages are of kinds that the format does not have."""
        self._has_usual_parameters = True
        """Whether the parameters so far are as PX4 writes them."""
        self._data_start: int | None = None
        """Where the definitions end."""
        self._mapped = MappedFile(path)
        self.close_with(self._mapped.close)
        header = self._map[:_HEADER]
        if not header.startswith(MAGIC):
            raise RecordingError(f"{path} is not a ULog")
        if len(header) < _HEADER:
            raise RecordingError(f"{path} is cut off within its header")
        self._start = int.from_bytes(header[8:_HEADER], "little")
        """The time in us at which the log starts."""
        self._samples = Samples(self._topics, self._start)
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
    def information(self) -> Mapping[str, object]:
        """See Source.information."""
        return self._notes.information

    @property
    def facts(self) -> Facts:
        """Parameters, information, texts and dropouts."""
        return self._notes.facts._replace(start=self._start * 1000)

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""
        windows = self._samples.windows
        if not windows:
            return None
        return min(each.first for each in windows) * 1000, max(each.last for each in windows) * 1000

    # samples

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """See Source.parts."""
        self._mapped.check()
        for window in self._samples.windows:
            yield from self._samples.parts(self._file, window, channels, start, stop)
            drop_pages(self._file)

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        found: dict[int, list[NDArray[np.int64]]] = {number: [] for number in channels}
        for window in self._samples.windows:
            for number, low, high in window.chosen(found):
                found[number].append(window.times_of(low, high))
        return {number: np.concatenate([np.zeros(0, np.int64), *each]) for number, each in found.items()}

    # the file

    def _read(self) -> None:
        """Find all messages."""
        messages = Messages(self._map, self._topics, self.problems)
        start = _HEADER
        for stop in [*self._appended(), self._file.size]:
            start = self._read_front(messages, start, stop)
            for heads in messages.stretches(start, stop):
                self._take(heads)
            start = stop
        self._channels = self._topics.channels(self._samples.counts)
        self.problems += self._samples.problems
        counts = {self._topics.name_of(channel): count for channel, count in self._samples.unset.items()}
        self.notes = [_note_on_unset(*key, count) for key, count in sorted(counts.items())]
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
            start, last = self._take_usual(start, last, stop)
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

    def _take_usual(self, start: int, last: int, stop: int) -> tuple[int, int]:
        """Take the messages before the first sample from an offset on, many at a time, as far as they are as usual.

        Return the offsets behind them, and of the last one, or `last` if there is none.
        """
        data = self._map
        while start + FRONT < stop:
            size, code = HEAD.unpack_from(data, start)
            kind, end = chr(code), start + FRONT + size
            if end > stop or size < SMALLEST.get(kind, NUMBERS):
                break
            if kind == "A":
                starts = self._take_topic(start, end)
            elif self._data_start is not None:
                break
            elif kind == "F":
                starts = self._take_formats(start, stop)
            elif kind in "IMPQ":
                starts = self._take_notes(kind, start, end, stop)
            else:
                break
            if len(starts) < 2:  # noqa: PLR2004 - nothing was taken
                break
            *_, last, start = starts
        return start, last

    def _take_topic(self, start: int, end: int) -> list[int]:
        """Take a subscription. Return what `_take_formats` does."""
        try:
            self._take_definition("A", self._map[start + FRONT : end], start)
        except ValueError:
            return [start]
        if self._data_start is None:
            self._data_start = start
        return [start, end]

    def _take_formats(self, start: int, stop: int) -> list[int]:
        """Take the first formats. Return where they begin and the last one ends, only `start` if none was taken."""
        data, starts = self._map, [start]
        longest = LONGEST_RUN if self._topics.formats.is_empty else 0
        while starts[-1] + FRONT < min(start + longest, stop):
            size, kind = HEAD.unpack_from(data, starts[-1])
            end = starts[-1] + FRONT + size
            if kind != _FORMAT or size < SMALLEST["F"] or end > stop:
                break
            starts.append(end)
        return starts if self._topics.formats.begin(data[start : starts[-1]]) else [start]

    def _take_notes(self, kind: str, start: int, end: int, stop: int) -> list[int]:
        """Take a message that is no definition, or many parameters. Return what `_take_formats` does."""
        if kind == "P" and self._has_usual_parameters:
            starts = usual_parameters(self._file, start, stop)
            self._has_usual_parameters = len(starts) > _FEW  # looking for them takes as long for one as for hundreds
            if len(starts) > 1:
                self._notes.keep(self._map[start : starts[-1]], [each - start for each in starts[:-1]])
                return starts
        try:
            self._notes.take(kind, self._map[start + FRONT : end], None)
        except (ValueError, struct.error):
            return [start]
        return [start, end]

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

    def _take(self, heads: Heads) -> None:
        """Take messages in the order of the file."""
        if not len(heads.starts):
            return
        is_sample = heads.kinds == DATA
        samples, others = heads.take(is_sample), heads.take(~is_sample)
        if self._data_start is None and len(samples.starts):
            self._data_start = int(samples.starts[0])
        kinds = others.kinds
        is_topic = (kinds == _ADD) | (kinds == _REMOVE)
        for place in [*others.starts[kinds == _FORMAT].tolist(), *others.starts[is_topic].tolist()]:
            self._take_message(place)
        before = self._samples.last
        times = self._samples.take(samples, self._file)
        is_sync = (kinds == _SYNC) & (others.sizes == SMALLEST["S"])
        rest = others.starts[(kinds != _FORMAT) & ~is_topic & ~is_sync]
        if len(rest):
            latest = np.maximum.accumulate(np.append(before, times))[np.searchsorted(samples.starts, rest)]
            for place, time in zip(rest.tolist(), latest.tolist(), strict=True):
                self._take_message(place, time * 1000)

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

    def _report(self, text: str, offset: int, size: int = 0) -> None:
        self.problems.append(Problem(text, offset, size))


def _note_on_unset(name: str, instance: int, count: int) -> str:
    topic = f"{name} {instance}" if instance else name
    return f"{topic}: {counted(count, 'sample')} with timestamp 0, which got the time of the sample before in the file"
