"""Where the messages of a ULog are: they follow one another, also behind a damage.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.files.ulog.formats import FRONT, NUMBERS, PAYLOAD, is_format, parse_fields
from msggen.recordings.files.ulog.heads import DATA, HEAD, SIZE, Heads, chained, heads_at, heads_of
from msggen.recordings.files.ulog.notes import Notes
from msggen.recordings.source.gather import at, walk
from msggen.recordings.source.memory import drop_pages
from msggen.recordings.source.source import Problem

if TYPE_CHECKING:
    import mmap
    from collections.abc import Generator, Iterator

    from numpy.typing import NDArray

    from msggen.recordings.files.ulog.topics import Topics
    from msggen.recordings.source.memory import Octets, Places

WINDOW = 1 << 24
"""The bytes of a file that are read at a time: all of most logs, as each topic takes time in each window."""
SYNC = b"\x08\0S\x2f\x73\x13\x20\x25\x0c\xbb\x12"
"""A message that PX4 writes from time to time, so that readers find into a damaged file."""
_FORMAT, _ADD = b"FA"
_SUBSCRIPTION = 3
"""The offset of the name of a topic in its subscription."""
SMALLEST = {"B": 40, "F": 4, "I": 3, "M": 4, "P": 3, "Q": 4, "A": 4, "R": 2, "D": 3, "L": 9, "C": 11, "S": 8, "O": 2}
"""The kinds of messages, and the size of the smallest message of each without its front."""
_LARGEST_UNKNOWN = 10_000
"""The largest message of a kind that is not known; larger ones are damage."""
_LOWEST, _HIGHEST = np.full(256, 1, np.int64), np.full(256, _LARGEST_UNKNOWN, np.int64)
for _kind, _size in SMALLEST.items():
    _LOWEST[ord(_kind)], _HIGHEST[ord(_kind)] = _size, (1 << 16) - 1
_LOWEST[0] = 1 << 16
_PLAIN = np.zeros(256, np.uint16)
"""The size up to which messages of a kind hide no others."""
_PLAIN[DATA] = (1 << 16) - 1
for _kind in "RSO":
    _PLAIN[ord(_kind)] = SMALLEST[_kind]
_NEVER = 1 << 40
"""The length of what is no message."""
_LENGTHS = np.arange(NUMBERS, dtype=np.int64) + FRONT
_LENGTHS[0] = _NEVER
"""The length of a message by its size."""
_IS_TEXTUAL = re.compile(
    rb"..(?:F\w+:|A...[a-zA-Z_]|[IP].(?:char\[|bool |float |double |u?int\d+_t[ \[])"
    rb"|[MQ]..(?:char\[|bool |float |double |u?int\d+_t[ \[]))",
    re.DOTALL,
)
"""The fronts of messages that can be told from damage by their texts."""
_TEXTUAL = 300
_REACH = 1 << 11
"""The bytes that are walked at first after a damage."""
_TRIES = 64


class Messages:
    """The messages of a ULog. After damaged bytes, only samples of topics known so far are recognized."""

    def __init__(self, data: mmap.mmap, topics: Topics, problems: list[Problem]) -> None:
        """Find messages in `data`, and add where it is damaged to `problems`."""
        self._map = data
        self._file: Octets = np.frombuffer(data, np.uint8)
        self._topics = topics
        self._problems = problems
        self._latest: Heads | None = None
        """The messages before those that are looked for."""

    def size_at(self, place: int, stop: int) -> int:
        """Return the size of the message at an offset, 0 if there is none before `stop`."""
        if place + FRONT > stop:
            return 0
        size, kind = HEAD.unpack_from(self._map, place)
        return size + FRONT if _LOWEST[kind] <= size <= _HIGHEST[kind] and place + FRONT + size <= stop else 0

    def stretches(self, start: int, stop: int) -> Iterator[Heads]:
        """Yield the messages between two offsets in order.

        At `stop` a message ends, unless the file is damaged. The topics that a stretch names have to be known before
        the next is asked for.
        """
        reach = WINDOW
        while start < stop:
            end, following = yield from self._read(start, min(start + reach, stop), stop)
            size = self.size_at(end, stop)
            if following > end:
                is_cut = following == stop == self._file.size and stop - end < NUMBERS + FRONT
                text = f"the file is {'cut off or ' * is_cut}damaged"
                self._problems.append(Problem(text, end, following - end))
                start, reach = following, _REACH
            elif size and stop - end < SIZE:
                yield self._heads_near_end([end])
                start = end + size
            else:
                start, reach = end, min(reach * 2, WINDOW)

    def _read(self, start: int, limit: int, stop: int) -> Generator[Heads, None, tuple[int, int]]:
        """Yield the messages up to `limit`, or to a damage before it.

        Return where they end, and where the next message is: behind the damage if there is one.
        """
        end = start
        for heads, after_all in self._following(start, limit):
            starts, end = heads.starts, after_all
            wrong = _first_wrong(heads)
            if wrong is not None:
                starts, end = starts[:wrong], int(starts[wrong])
            self._learn(heads.take(slice(len(starts))))
            count = len(starts) if end == stop else self._trusted(starts, stop)
            size = self.size_at(end, stop)
            is_whole, is_at_limit = count == len(starts), end == stop or end + size > limit
            following = end
            if not is_whole and count and is_at_limit:  # what follows in the next stretch tells what it is
                end = following = int(starts[count])
            elif not is_whole or not is_at_limit:
                taken, begin, after = self._around_damage(starts, count, end, stop)
                if not size or taken < len(starts):  # otherwise `walk` took a wrong place for a message, and goes on
                    is_whole, count, end, following = False, taken, begin, after
            self._latest = heads.take(slice(count))
            yield self._with_hidden(self._latest)
            if not is_whole:
                return end, following
        return end, end if end == stop or self.size_at(end, stop) else self.resume(end + 1, stop)

    def _following(self, start: int, limit: int) -> Iterator[tuple[Heads, int]]:
        """Yield the messages that follow one another from `start` up to `limit`, and where they end."""
        found = chained(self._map, self._file, self._topics, start, limit)
        if found is None:
            for stretch in walk(self._file, start, limit, _length_of, self._find):
                yield heads_of(stretch.starts, stretch.heads), stretch.end
        elif len(found[0].starts):
            yield found
            drop_pages(self._file)

    def _find(self, low: int, high: int) -> int:
        """Return an offset at which a sample of a known topic seems to begin, or a sync message, or -1."""
        mark = self._mark
        place = self._map.find(mark, low, high + PAYLOAD - 1) if mark else -1
        if place >= 0:
            return place
        place = low + 2
        for _ in range(_TRIES):
            place = self._map.find(b"D", place, high + 2)
            if place < 0 or place + FRONT > self._file.size:
                break
            size, _, number = struct.unpack_from("<HBH", self._map, place - 2)
            if self._topics.smallest[number] <= size <= self._topics.largest[number]:
                return place - 2
            place += 1
        return self._map.find(SYNC, low, high)

    @property
    def _mark(self) -> bytes:
        """The first bytes of the last sample of the most frequent topic, as far as it is known."""
        return b"" if self._latest is None else _mark_of(self._latest)

    def _learn(self, heads: Heads) -> None:
        """Let the samples of topics be recognized that are named between the messages of a stretch."""
        for place in heads.starts[heads.kinds == _FORMAT].tolist():
            content = self._content(place)
            if self.is_sound(place, self._file.size) and is_format(content):
                self._topics.formats.add(content.decode())
        for place in heads.starts[heads.kinds == _ADD].tolist():
            if self.is_sound(place, self._file.size):
                content = self._content(place)
                self._topics.expect(
                    int.from_bytes(content[1:_SUBSCRIPTION], "little"), content[_SUBSCRIPTION:].decode()
                )

    def _content(self, place: int) -> bytes:
        return self._map[place + FRONT : place + self.size_at(place, self._file.size)]

    # damage

    def _trusted(self, starts: Places, stop: int) -> int:
        """Return how many of the messages that seem to follow one another are messages.

        Those up to the last sample of a known topic are, and the following ones as far as their contents make sense.
        """
        count = len(starts)
        while count and not self._is_sure(int(starts[count - 1])):
            count -= 1
        while count < len(starts) and self.is_sound(int(starts[count]), stop):
            count += 1
        return count

    def _around_damage(self, starts: Places, count: int, end: int, stop: int) -> tuple[int, int, int]:
        """Return how many messages before a damage are to be taken, where it begins, and where it ends.

        `count` of those at `starts` are messages. If a further one begins within the last of them, that is damaged.
        """
        if count < len(starts):
            end = int(starts[count])
        last = int(starts[count - 1]) if count else end
        following = self.resume(last + 1, stop)
        return (count - 1, last, following) if count and following < end else (count, end, following)

    def _with_hidden(self, heads: Heads) -> Heads:
        """Replace the messages that are damage by those that they hide."""
        found: list[int] = []
        damaged: list[int] = []
        largest = self._topics.largest[heads.numbers]
        longer = (heads.sizes > largest) & (heads.kinds == DATA)
        suspects = [np.flatnonzero(longer & (largest > 0)), np.flatnonzero(longer & (largest == 0))]
        suspects = [each for each in suspects if len(each) <= _TRIES]  # more have another format, or were never named
        others = np.flatnonzero(heads.kinds != DATA)
        suspects.append(others[heads.sizes[others] > _PLAIN[heads.kinds[others]]])
        for index in sorted(np.concatenate(suspects).tolist()):
            place = int(heads.starts[index])
            hidden = self.hidden(place, place + self.size_at(place, self._file.size))
            if hidden:
                damaged.append(index)
                found += hidden
                self._problems.append(Problem("the file is damaged", place, hidden[0] - place))
        if not found:
            return heads
        is_kept = np.ones(len(heads.starts), np.bool_)
        is_kept[damaged] = False
        return heads.take(is_kept).joined(self._heads_near_end(found))

    def _heads_near_end(self, places: list[int]) -> Heads:
        """Return the heads of messages, of which the last can have less than eight bytes."""
        places = sorted(places)
        begin, rest = places[-1], self._map[places[-1] : places[-1] + SIZE]
        last = heads_at(np.frombuffer(rest.ljust(SIZE, b"\0"), np.uint8), np.zeros(1, np.int64))
        last = last._replace(starts=np.array([begin], np.int64))
        return heads_at(self._file, np.array(places[:-1], np.int64)).joined(last)

    def hidden(self, place: int, stop: int) -> list[int]:
        """Return the offsets of the messages in what seems to be one message.

        Where damage has the size of a message, that can end with any message behind it. The messages in it are those
        that follow a sample of a known topic, one after the other, exactly up to its end.
        """
        if self._map.find(b"D", place + FRONT, stop) < 0:
            return []
        seen: set[int] = set()
        for start in self._samples(place + 1, stop, stop):
            found: list[int] = []
            while start not in seen and (size := self.size_at(start, stop)):
                seen.add(start)
                found.append(start)
                start += size  # noqa: PLW2901 - each message leads to the next
            if start == stop:
                return found
        return []

    def _is_sure(self, place: int) -> bool:
        """Whether there is a sample of a known topic, or a sync message."""
        size, kind = HEAD.unpack_from(self._map, place)
        if kind != DATA:
            return self._map[place : place + len(SYNC)] == SYNC
        (number,) = struct.unpack_from("<H", self._map, place + FRONT)
        return bool(self._topics.smallest[number] <= size <= self._topics.largest[number])

    def is_sound(self, place: int, stop: int) -> bool:
        """Whether the content of the message at an offset makes sense."""
        size = self.size_at(place, stop)
        if not size:
            return False
        kind = chr(self._map[place + 2])
        data = self._map[place + FRONT : place + size]
        try:
            if kind == "F":
                parse_fields(data.decode().partition(":")[2])
            elif kind in "IMPQLC":
                Notes().take(kind, data, 0)
                data[SMALLEST[kind] :].decode() if kind in "LC" else None
        except (ValueError, struct.error):
            return False
        return {
            "A": data[_SUBSCRIPTION:].decode(errors="replace") in self._topics.formats,
            "O": len(data) == SMALLEST["O"],
            "R": len(data) == SMALLEST["R"],
        }.get(kind, kind in "FIMPQLC" or self._is_sure(place))

    def resume(self, low: int, stop: int) -> int:
        """Return the offset of the next message that is sure to be one, `stop` if there is none."""
        reach = _REACH
        while low < stop:
            high = min(low + reach, stop)
            found = [next(self._samples(low, high, stop), -1), self._map.find(SYNC, low, min(high + len(SYNC), stop))]
            nearest = min((each for each in found if each >= 0), default=high)
            for text in _IS_TEXTUAL.finditer(self._map, low, min(nearest + _TEXTUAL, stop)):
                if text.start() >= nearest:
                    break
                if self.is_sound(text.start(), stop):
                    return text.start()
            if nearest < high:
                return nearest
            low, reach = high, min(2 * reach, WINDOW)
        return stop

    def _samples(self, low: int, high: int, stop: int) -> Iterator[int]:
        """Yield the offsets from `low` up to `high` at which samples of known topics seem to begin."""
        high = min(high, stop - PAYLOAD)
        places = low + np.flatnonzero(self._file[low + 2 : max(high, low) + 2] == DATA)
        numbers, sizes = at(self._file, "<u2", FRONT)[places], at(self._file, "<u2")[places]
        places = places[(sizes >= self._topics.smallest[numbers]) & (sizes <= self._topics.largest[numbers])]
        yield from (place for place in places.tolist() if self._is_followed(place, stop))

    def _is_followed(self, place: int, stop: int) -> bool:
        """Whether a message is whole, and another or the end follows."""
        end = place + self.size_at(place, stop)
        return end > place and (stop - end < FRONT or self.size_at(end, self._file.size + NUMBERS) > 0)


def _first_wrong(heads: Heads) -> int | None:
    """Return the index of the first head that no message has."""
    others = np.flatnonzero(heads.kinds != DATA)
    kinds, sizes = heads.kinds[others], heads.sizes[others]
    wrong = np.flatnonzero((sizes < _LOWEST[kinds]) | (sizes > _HIGHEST[kinds]))
    return int(others[wrong[0]]) if wrong.size else None


def _mark_of(heads: Heads) -> bytes:
    """Return what the last sample of the most frequent topic begins with: its size, its kind and its number."""
    samples = np.flatnonzero(heads.kinds == DATA)
    if not samples.size:
        return b""
    numbers = heads.numbers[samples]
    last = samples[numbers == np.bincount(numbers).argmax()][-1]
    return struct.pack("<HBH", heads.sizes[last], DATA, heads.numbers[last])


def _length_of(heads: NDArray[np.uint64]) -> Places:
    """Return the lengths of messages from their first eight bytes. Bytes of 0 are no messages."""
    lengths: Places = _LENGTHS.take(heads.astype(np.uint16))
    return lengths
