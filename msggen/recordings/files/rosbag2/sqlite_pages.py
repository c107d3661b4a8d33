"""Tables of an SQLite database straight from its pages (https://www.sqlite.org/fileformat2.html).

Rows of a batch of pages are found in a few steps of numpy, in contrast to the rows of a statement, each of which is an
object of Python. A page or row that is damaged is left out and reported; sqlite3 would end at it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from msggen.base.recording_formats import FORMATS
from msggen.recordings.source.gather import at
from msggen.recordings.source.memory import drop_pages
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets, Places

MAGIC = FORMATS["db3"].front
_HEADER = 100
"""The size of the header of the file, which page 1 begins with."""
_INTERIOR, _LEAF = 5, 13
"""The kinds of the pages of a table."""
_DEEPEST = 20
"""The most levels of a table. SQLite allows as many."""
_BATCH = 8 << 20
"""The bytes of pages that are read at a time."""
_JOINED = 16 << 20
"""The bytes of rows with overflow pages that are joined at a time, unless one row is larger."""
_ENCODINGS = {2: "utf-16-le", 3: "utf-16-be"}
_SIZES = np.array([0, 1, 2, 3, 4, 6, 8, 8, 0, 0, 0, 0], np.int64)
"""The sizes of values by their serial types below 12."""
_BLOB = 12
"""Serial types from here on are blobs (even) and texts (odd)."""
_UNEVEN = {3: (">i1", 1, ">u2", 16), 5: (">i2", 2, ">u4", 32)}
"""Integers of 24 and 48 bits by serial type: the upper part with its size, and the lower part with its bits."""
_VARINT = 9
"""The most bytes of a number of variable length. The last of nine has eight bits, the others have seven."""
_PAYLOAD = 127
"""The bits of a byte of such a number. The upper bit says that there are further ones."""
_WORD = 8
_LARGEST = (1 << 63) - 1
_SMALLEST = -(1 << 63)


class Report(Protocol):
    """Takes what is wrong."""

    def __call__(self, text: str, offset: int, samples: int = 0) -> None:
        """`offset` is in the file. `samples` is how many rows are left out."""


class Rows(NamedTuple):
    """Rows of a table. All arrays have an element for each."""

    ids: NDArray[np.int64]
    """The rowids."""
    starts: Places
    """The offsets of the records in the file."""
    sizes: Places
    """The sizes of the records in bytes."""
    inside: Places
    """How many bytes of each are in its page. The others are on overflow pages."""

    def take(self, chosen: NDArray[Any]) -> Rows:
        """Return some rows, by their indices or by a mask."""
        return Rows(*(each[chosen] for each in self))


class Joined(NamedTuple):
    """Values of rows in one buffer."""

    rows: NDArray[np.intp]
    """The indices of the rows, without those whose overflow pages are damaged."""
    buffer: Octets
    starts: Places


class Pages:
    """The pages of a database. Raises RecordingError if it is none.

    `report` is called for each damage.
    """

    def __init__(self, file: Octets, report: Report) -> None:
        self._file = file
        self._report = report
        header = bytes(file[:_HEADER])
        if len(header) < _HEADER or not header.startswith(MAGIC):
            raise RecordingError("not a database of SQLite")
        size = int.from_bytes(header[16:18], "big")
        self.size = 1 << 16 if size == 1 else size
        self.usable = self.size - header[20]
        if self.size < 512 or self.size & (self.size - 1) or self.usable < 480:  # noqa: PLR2004 - limits of the format
            raise RecordingError(f"a database of SQLite with pages of {self.size} bytes")
        self.count = file.size // self.size
        self.encoding = _ENCODINGS.get(int.from_bytes(header[56:60], "big"), "utf-8")
        promised = int.from_bytes(header[28:32], "big")
        if header[24:28] == header[92:96] and promised > self.count:
            end = self.count * self.size
            self._report(f"the file is cut off: {promised - self.count} of {promised} pages are missing", end)
        self._u2, self._u4 = at(file, ">u2"), at(file, ">u4")

    # tables

    def rows(self, root: int, low: int = _SMALLEST, high: int = _LARGEST) -> Iterator[Rows]:
        """Yield the rows of the table with this root page, batch by batch.

        Rows with ids outside of `low` and `high` are left out as far as whole pages of them can be skipped.
        """
        leaves = self._leaves(root, low, high)
        step = max(_BATCH // self.size, 1)
        room = self._file.size
        for start in range(0, len(leaves), step):
            rows = self._of_leaves(leaves[start : start + step])
            room -= int(rows.sizes.sum())
            if room < 0:
                self._report("pages of a table overlap: the rest of it is not read", int(leaves[start]))
                return
            if len(rows.ids):
                yield rows
            drop_pages(self._file)

    def records(self, root: int) -> list[tuple[int, list[object]]]:
        """Return the rows of a small table: their ids and values."""
        found: list[tuple[int, list[object]]] = []
        for rows in self.rows(root):
            for joined in self.joined(rows, rows.starts, rows.sizes):
                for row, start in zip(joined.rows.tolist(), joined.starts.tolist(), strict=True):
                    record = bytes(joined.buffer[start : start + int(rows.sizes[row])])
                    try:
                        found.append((int(rows.ids[row]), _values(record, self.encoding)))
                    except (IndexError, ValueError):
                        self._report("a row is damaged", int(rows.starts[row]))
        return found

    def joined(self, rows: Rows, places: Places, sizes: Places) -> Iterator[Joined]:
        """Yield the last `sizes` bytes of rows, which begin at `places` in their pages, with their overflow pages."""
        inside = rows.inside - (places - rows.starts)
        step = self.usable - 4
        widest = int(inside.max()) if len(inside) else 0
        counts = (sizes - inside + step - 1) // step
        room = widest + counts * step
        ends = np.cumsum(room)
        start = 0
        while start < len(places):
            limit = (int(ends[start - 1]) if start else 0) + _JOINED
            stop = max(int(np.searchsorted(ends, limit, "right")), start + 1)
            chosen = slice(start, stop)
            bases = ends[chosen] - room[chosen] - (int(ends[start - 1]) if start else 0)
            yield self._join(np.arange(start, stop), places[chosen], inside[chosen], counts[chosen], bases, widest)
            start = stop

    def _join(  # noqa: PLR0913, PLR0917 - columns of a table of rows
        self,
        rows: NDArray[np.intp],
        places: Places,
        inside: Places,
        counts: Places,
        bases: Places,
        widest: int,
    ) -> Joined:
        """Write the part in the page so that it ends where the overflow pages begin, at the same place in all rows."""
        step = self.usable - 4
        buffer = np.empty(int(bases[-1]) + widest + int(counts[-1]) * step, np.uint8)
        if widest:
            at(buffer, f"V{widest}")[bases] = at(self._file, f"V{widest}")[places + inside - widest]
        is_whole = np.ones(len(rows), bool)
        active = np.flatnonzero(counts)
        following = self._u4[places[active] + inside[active]].astype(np.int64)
        for number in range(int(counts.max())):
            known = (following > 0) & (following <= self.count) & is_whole[active]
            is_whole[active[~known]] = False
            active, pages = active[known], (following[known] - 1) * self.size
            at(buffer, f"V{step}")[bases[active] + widest + number * step] = at(self._file, f"V{step}")[pages + 4]
            further = counts[active] > number + 1
            active, following = active[further], self._u4[pages[further]].astype(np.int64)
        if not is_whole.all():
            lost = np.flatnonzero(~is_whole)
            self._report("overflow pages of rows are damaged", int(places[lost[0]]), len(lost))
        return Joined(rows[is_whole], buffer, (bases + widest - inside)[is_whole])

    # pages

    def _leaves(self, root: int, low: int, high: int) -> Places:
        """Return the offsets of the leaf pages of a table, in the order of their rows."""
        pages = np.array([root], np.int64)
        is_seen = np.zeros(self.count + 1, bool)
        found: list[Places] = []
        for _ in range(_DEEPEST):
            offsets = self._new(pages, is_seen)
            kinds = self._kinds(offsets)
            found.append(offsets[kinds == _LEAF])
            others = (kinds != _LEAF) & (kinds != _INTERIOR)
            if others.any():
                self._report(f"{others.sum()} pages of a table are damaged", int(offsets[others][0]))
            offsets = offsets[kinds == _INTERIOR]
            if not len(offsets):
                break
            pages = self._children(offsets, low, high)
        return np.concatenate(found)

    def _kinds(self, offsets: Places) -> Octets:
        """Return the kinds of pages."""
        step = max(_BATCH // self.size, 1)
        found = np.empty(len(offsets), np.uint8)
        for start in range(0, len(offsets), step):
            found[start : start + step] = self._file[_head(offsets[start : start + step])]
            drop_pages(self._file)
        return found

    def _new(self, pages: Places, is_seen: NDArray[np.bool_]) -> Places:
        """Return the offsets of pages that are there and were not seen before."""
        is_there = (pages > 0) & (pages <= self.count)
        if not is_there.all():
            count = int((~is_there).sum())
            self._report(f"{count} pages of a table are missing", self.count * self.size)
            pages = pages[is_there]
        first = np.zeros(len(pages), bool)
        first[np.unique(pages, return_index=True)[1]] = True
        first &= ~is_seen[pages]
        if not first.all():
            self._report("pages of a table refer to each other", int(pages[~first][0] - 1) * self.size)
            pages = pages[first]
        is_seen[pages] = True
        return (pages - 1) * self.size

    def _cells(self, pages: Places, front: int) -> tuple[Places, Places]:
        """Return how many cells each page has, whose header has `front` bytes, and their offsets."""
        heads = _head(pages)
        counts = self._u2[heads + 3].astype(np.int64)
        is_sane = heads - pages + front + 2 * counts <= self.usable
        if not is_sane.all():
            self._report(f"{(~is_sane).sum()} pages of a table are damaged", int(pages[~is_sane][0]))
            counts[~is_sane] = 0
        nth = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        pointers = self._u2[np.repeat(heads + front, counts) + 2 * nth].astype(np.int64)
        return counts, np.repeat(pages, counts) + pointers

    def _children(self, pages: Places, low: int, high: int) -> Places:
        """Return the numbers of the pages that interior pages name, as far as they may have rows in a range."""
        counts, cells = self._cells(pages, 12)
        ends = np.cumsum(counts)
        children = self._u4[np.minimum(cells, self._file.size - 4)].astype(np.int64)
        children = np.insert(children, ends, self._u4[_head(pages) + 8].astype(np.int64))
        if low == _SMALLEST and high == _LARGEST:
            return children
        keys, _ = self._varints(cells + 4)
        keys = np.insert(keys, ends, _LARGEST)
        before = np.append(_SMALLEST, keys[:-1])
        before[before == _LARGEST] = _SMALLEST  # the first child of a page
        return children[(keys >= low) & (before < high)]

    def _of_leaves(self, pages: Places) -> Rows:
        counts, cells = self._cells(pages, 8)
        page = np.repeat(pages, counts)
        sizes, places = self._varints(cells)
        ids, places = self._varints(places)
        inside = sizes
        is_long = sizes > self.usable - 35
        if is_long.any():
            least = (self.usable - 12) * 32 // 255 - 23
            most = least + (sizes - least) % (self.usable - 4)
            inside = np.where(is_long, np.where(most > self.usable - 35, least, most), sizes)
        ends = places + inside + np.where(is_long, 4, 0)
        fits = (cells > page) & (sizes > 0) & (sizes <= self._file.size) & (ends <= page + self.usable)
        rows = Rows(ids, places, sizes, inside)
        return rows if fits.all() else self.left_out(rows, fits)

    def left_out(self, rows: Rows, fits: NDArray[np.bool_]) -> Rows:
        """Return the rows that fit, and report the others as damaged."""
        self._report("rows are damaged", int(rows.starts[~fits][0]), int((~fits).sum()))
        return rows.take(fits)

    # values

    def columns(self, rows: Rows, count: int) -> tuple[list[Places], list[Places], NDArray[np.bool_]]:
        """Return the serial types and the offsets of `count` columns, and which rows have as many and end with them."""
        fronts, kinds, is_sane = self._short_headers(rows, count) or self._headers(rows, count)
        is_sane &= (fronts > 0) & (fronts <= rows.inside)
        largest = np.uint64(2 * self._file.size + _BLOB + 1)
        ends = rows.starts + fronts
        starts = []
        for kind in kinds:
            starts.append(ends)
            is_sane &= kind.view(np.uint64) <= largest  # negative ones are larger, too
            ends = ends + sizes_of(kind)
        is_sane &= ends == rows.starts + rows.sizes
        return kinds, starts, is_sane

    def _headers(self, rows: Rows, count: int) -> tuple[Places, list[Places], NDArray[np.bool_]]:
        """Return the sizes of the headers of records, the serial types in them, and which have no further ones."""
        fronts, places = self._varints(rows.starts)
        kinds = []
        for _ in range(count):
            kind, places = self._varints(places)
            kinds.append(kind)
        return fronts, kinds, places == rows.starts + fronts

    def _short_headers(self, rows: Rows, count: int) -> tuple[Places, list[Places], NDArray[np.bool_]] | None:
        """Return what `_headers` does, by reading each header at once, or None if one is longer than a word.

        Only the last serial type, that of the payload, may have several bytes.
        """
        if not len(rows.ids) or int(rows.starts.max()) + _WORD > self._file.size:
            return None
        words = at(self._file, f"V{_WORD}")[rows.starts].view(np.uint8).reshape(-1, _WORD)
        fronts = words[:, 0]
        longest = int(fronts.max())
        if longest > _WORD or int(fronts.min()) <= count or (words[:, 1:count] > _PAYLOAD).any():
            return None
        last = np.zeros(len(words), np.int64)
        for place in range(count, longest):
            octets = words[:, place]
            is_inside = place < fronts
            if (is_inside & ((octets > _PAYLOAD) != (place + 1 < fronts))).any():
                return None
            last = np.where(is_inside, last << 7 | (octets & _PAYLOAD), last)
        kinds = [words[:, place].astype(np.int64) for place in range(1, count)]
        return fronts.astype(np.int64), [*kinds, last], np.ones(len(words), bool)

    def integers(self, kinds: Places, places: Places) -> NDArray[np.int64]:
        """Return the integers at some places. Their serial types must be those of integers (`is_integer`)."""
        counts = np.bincount(kinds, minlength=10)
        if counts.max() == len(kinds):
            return self._integers(int(kinds[0]), places) if len(kinds) else np.zeros(0, np.int64)
        found = np.empty(len(kinds), np.int64)
        for kind in np.flatnonzero(counts).tolist():
            chosen = kinds == kind
            found[chosen] = self._integers(kind, places[chosen])
        return found

    def _integers(self, kind: int, places: Places) -> NDArray[np.int64]:
        if kind in (8, 9):
            return np.full(len(places), kind - 8, np.int64)
        if kind in _UNEVEN:
            code, size, low, bits = _UNEVEN[kind]
            top = at(self._file, code)[places].astype(np.int64)
            return (top << bits) | at(self._file, low)[places + size].astype(np.int64)
        code = {1: ">i1", 2: ">i2", 4: ">i4", 6: ">i8"}[kind]
        return at(self._file, code)[places].astype(np.int64)

    def _varints(self, places: Places) -> tuple[NDArray[np.int64], Places]:
        """Return the numbers of variable length at some places, and where they end."""
        octets = self._file.take(places, mode="clip")
        more = octets > _PAYLOAD
        value, places = (octets & _PAYLOAD).astype(np.int64), places + 1
        for number in range(1, _VARINT):
            if not more.any():
                break
            octets = self._file.take(places, mode="clip").astype(np.int64)
            longer = (value << 8 | octets) if number == _VARINT - 1 else (value << 7 | octets & _PAYLOAD)
            value = np.where(more, longer, value)
            places = places + more
            more &= octets > _PAYLOAD
        return value, places


def is_integer(kinds: Places) -> NDArray[np.bool_]:
    """Whether serial types are those of integers."""
    found: NDArray[np.bool_] = (kinds > 0) & (kinds < 10) & (kinds != 7)  # noqa: PLR2004 - 7 is a float
    return found


def sizes_of(kinds: Places) -> Places:
    """Return the sizes of values by their serial types."""
    is_long = kinds >= _BLOB
    if is_long.all():
        return (kinds - _BLOB) >> 1
    sizes = _SIZES.take(kinds, mode="clip")
    return np.where(is_long, (kinds - _BLOB) >> 1, sizes) if is_long.any() else sizes


def _head(pages: Places) -> Places:
    """Return where the headers of pages are: in page 1 behind that of the file."""
    return pages + np.where(pages == 0, _HEADER, 0)


def _values(record: bytes, encoding: str) -> list[object]:
    """Return the values of a record. Raises IndexError, and ValueError."""
    end, place = _varint(record, 0)
    found: list[object] = []
    start = end
    while place < end:
        kind, place = _varint(record, place)
        size = (kind - _BLOB) // 2 if kind >= _BLOB else int(_SIZES[kind])
        data = record[start : start + size]
        if len(data) != size:
            raise ValueError(size)
        start += size
        if kind >= _BLOB:
            found.append(data.decode(encoding, "replace") if kind % 2 else data)
        elif kind == 0:
            found.append(None)
        elif kind in (8, 9):
            found.append(kind - 8)
        else:
            found.append(int.from_bytes(data, "big", signed=True))
    return found


def _varint(record: Sequence[int], place: int) -> tuple[int, int]:
    value = 0
    for number in range(_VARINT - 1):
        octet = record[place + number]
        value = value << 7 | octet & _PAYLOAD
        if octet <= _PAYLOAD:
            return value, place + number + 1
    return value << 8 | record[place + _VARINT - 1], place + _VARINT
