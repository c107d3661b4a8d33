"""Files of rosbag2's storage `sqlite3`, as the releases of ROS 2 from Dashing to Rolling write them."""

from __future__ import annotations

import os
from collections import defaultdict
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.recordings.files.compression import Room
from msggen.recordings.files.frames import Frames
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.files.mcap.channels import definition_in, ros_type_of, type_hash_in
from msggen.recordings.files.rosbag2.sqlite import ERRORS, Column, Statements, columns_of, has_log, settle
from msggen.recordings.files.rosbag2.sqlite_pages import Pages, Rows, is_integer, sizes_of
from msggen.recordings.source.gather import groups
from msggen.recordings.source.source import FOREVER, Channel, Part, Problem, RecordingError, Source

if TYPE_CHECKING:
    import tempfile
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray


_TIMES = ("timestamp", "recv_timestamp")
"""The names of the column of log times."""
_SENT = "send_timestamp"
_LARGEST = (1 << 63) - 1


class _Table(NamedTuple):
    """A table, as the schema describes it."""

    root: int
    columns: list[Column] | None
    """Its columns, None if its statement is unusual."""


class _Found(NamedTuple):
    """Rows of `messages`, with what is in their records before the payload."""

    rows: Rows
    which: NDArray[Any]
    """The indices of the channels in `Db3File._known`."""
    times: NDArray[np.int64]
    published: NDArray[np.int64] | None
    places: NDArray[np.int64]
    """The offsets of the payloads, which overflow pages may continue."""
    sizes: NDArray[np.int64]

    def take(self, chosen: NDArray[np.bool_]) -> _Found:
        """Return some of the rows."""
        rows, which, times, published, places, sizes = self
        sent = None if published is None else published[chosen]
        return _Found(rows.take(chosen), which[chosen], times[chosen], sent, places[chosen], sizes[chosen])


class Db3File(Source):
    """A file. Raises RecordingError if it is not one of rosbag2, and OSError."""

    kind = "db3"

    def __init__(self, path: str, room: Room | None = None, _: object = None, *, is_by_sample: bool = False) -> None:
        super().__init__(path)
        self._reported: set[Problem] = set()
        self._frames = Frames(room or Room(os.path.getsize(path)), self.problems, is_by_sample=is_by_sample)
        self._times: Mapping[int, NDArray[np.int64]] | None = None
        self._span: tuple[int, int] | None = None
        copy = self._settled(path) if has_log(path) else None
        place = os.path.join(copy.name, os.path.basename(path)) if copy else path
        self._mapped = MappedFile(place)
        self.close_with(self._mapped.close)
        if copy:
            self.close_with(copy.cleanup)
        self._statements = Statements(place)
        try:
            self._read_schema()
            self._channels = self._read_channels()
        except RecordingError as error:
            self.close()
            raise RecordingError(f"{path} is {error}") from None
        self._known = np.array(sorted(self._channels), np.int64)
        self._find_span()

    def _settled(self, path: str) -> tempfile.TemporaryDirectory[str] | None:
        """Return a folder with a copy that has the transactions of a log, which is beside the file."""
        try:
            copy = settle(path)
        except ERRORS as error:
            self.problems.append(Problem(f"the log of transactions beside the file cannot be read: {error}"))
            return None
        self.problems.append(Problem("the file was not closed: the log of transactions beside it is read too"))
        return copy

    @property
    def _pages(self) -> Pages:
        return Pages(self._mapped.octets, self._report)

    @property
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""
        return self._channels

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""
        return self._span

    @property
    def message_count(self) -> int | None:
        """The number of messages; if the database is damaged, of those that were found, None if that is not known."""
        try:
            return self._statements.count()
        except ERRORS:
            return super().message_count

    # samples

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """See Source.parts."""
        self._mapped.check()
        return self._frames.unpacked(self._stored(channels, start, stop), self.channels)

    def _stored(self, channels: Collection[int], start: int, stop: int) -> Iterator[Part]:
        """Yield the samples of channels as they are in the file."""
        low = start if start > 0 else -FOREVER
        is_wanted = np.isin(self._known, list(channels))
        for found in self._found(low, stop):
            is_chosen = is_wanted[found.which]
            if low > -FOREVER or stop < FOREVER:
                is_chosen &= (found.times >= low) & (found.times < stop)
            chosen = np.flatnonzero(is_chosen)
            for number, indices in groups(found.which[chosen]):
                yield from self._parts_of(int(self._known[number]), found, chosen[indices])

    def _parts_of(self, number: int, found: _Found, chosen: NDArray[np.intp]) -> Iterator[Part]:
        """Yield rows of a channel."""
        rows, places, sizes = found.rows.take(chosen), found.places[chosen], found.sizes[chosen]
        times, published = found.times[chosen], None if found.published is None else found.published[chosen]
        if (rows.inside == rows.sizes).all():
            yield Part(number, self._mapped.octets, places, sizes, times, published)
            return
        for joined in self._pages.joined(rows, places, sizes):
            each = joined.rows
            sent = None if published is None else published[each]
            if len(each):
                yield Part(number, joined.buffer, joined.starts, sizes[each], times[each], sent)

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        if self._times is None:
            self._mapped.check()
            self._times = self._all_times()
        return {number: self._times.get(number, np.zeros(0, np.int64)) for number in channels}

    def _all_times(self) -> Mapping[int, NDArray[np.int64]]:
        """Return the times of all channels: no index has them by topic."""
        found: dict[int, list[NDArray[np.int64]]] = defaultdict(list)
        for each in self._found(-FOREVER, FOREVER):
            for number, indices in groups(each.which):
                found[int(self._known[number])].append(each.times[indices])
        return {number: np.concatenate(times) for number, times in found.items()}

    # rows

    def _found(self, start: int, stop: int) -> Iterator[_Found]:
        """Yield the rows of `messages` of known topics, with those of a time among them."""
        names = [column.name for column in self._tables["messages"].columns or ()]
        low, high = self._ids_between(start, stop)
        count = 0
        for batch in self._pages.rows(self._tables["messages"].root, low, high):
            rows = batch
            count += len(rows.ids)
            kinds, places, is_sane = self._pages.columns(rows, len(names))
            numbers = [names.index(name) for name in ("topic_id", self._time, _SENT) if name in names]
            data = names.index("data")
            is_sane &= (kinds[data] >= 12) & (places[data] - rows.starts <= rows.inside)  # noqa: PLR2004 - a blob
            for number in numbers:
                is_sane &= is_integer(kinds[number])
            if not is_sane.all():
                rows = self._pages.left_out(batch, is_sane)
                kinds, places = [each[is_sane] for each in kinds], [each[is_sane] for each in places]
            topics, times, *sent = (self._pages.integers(kinds[number], places[number]) for number in numbers)
            which, is_known = self._channels_of(topics)
            found = _Found(rows, which, times, sent[0] if sent else None, places[data], sizes_of(kinds[data]))
            yield found if is_known.all() else found.take(is_known)
        if (start, stop) == (-FOREVER, FOREVER):
            self._check_count(count)

    def _ids_between(self, start: int, stop: int) -> tuple[int, int]:
        """Return the range of the rowids of a time."""
        if (start > -FOREVER or stop < FOREVER) and self._has_index:
            with suppress(*ERRORS):
                return self._statements.ids_between(self._time, start, stop)
        return -_LARGEST - 1, _LARGEST

    def _check_count(self, count: int) -> None:
        """Report if the index has another number of messages than the table, unless a reason was reported."""
        if self.problems:
            return
        try:
            expected = self._statements.count()
        except ERRORS as error:
            self._report(f"sqlite3 finds the database damaged: {error}")
            return
        if expected != count:
            self._report(f"the index has {expected} messages, the table {count}", samples=max(expected - count, 0))

    def _channels_of(self, topics: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the indices of the channels of messages, and which of them have one. The others are reported."""
        is_few = len(self._known) < 1 << 16  # short numbers are sorted faster
        if not len(self._known):
            which, is_known = np.zeros(len(topics), np.intp), np.zeros(len(topics), bool)
        else:
            which = np.minimum(np.searchsorted(self._known, topics), len(self._known) - 1)
            is_known = self._known[which] == topics
        if not is_known.all():
            text = "messages of topics that the table 'topics' does not have"
            self._report(text, samples=int((~is_known).sum()))
        return which.astype(np.uint16) if is_few else which, is_known

    # what there is

    def _read_schema(self) -> None:
        """Read which tables and indexes there are. Raises RecordingError."""
        self._tables: dict[str, _Table] = {}
        self._has_index = False
        for _, values in self._pages.records(1):
            kind, name, table, root, statement = [*values, *[None] * 5][:5]
            if (
                kind == "table"
                and isinstance(name, str)
                and isinstance(root, int)
                and root > 0
                and isinstance(statement, str)
            ):
                self._tables[name.lower()] = _Table(root, columns_of(statement))
            elif kind == "index" and table == "messages" and isinstance(statement, str):
                self._has_index |= any(f"({name}" in statement.replace(" ", "").lower() for name in _TIMES)
        if not {"topics", "messages"} <= self._tables.keys():
            raise RecordingError("a database without the tables 'topics' and 'messages' of rosbag2")
        columns = self._tables["messages"].columns
        if columns is None or not _is_plain(columns):
            raise RecordingError("a database with an unusual table 'messages'")
        self._time = next(column.name for column in columns if column.name in _TIMES)

    def _rows_of(self, name: str) -> list[dict[str, object]]:
        """Return the rows of a small table, none if there is no such table. Raises RecordingError."""
        table = self._tables.get(name)
        if table is None:
            return []
        if table.columns is None:
            raise RecordingError(f"a database with an unusual table '{name}'")
        found = []
        for number, values in self._pages.records(table.root):
            row = {column.name: value for column, value in zip(table.columns, values, strict=False)}
            found.append(row | {column.name: number for column in table.columns if column.is_id})
        return found

    def _read_channels(self) -> dict[int, Channel]:
        """Return the channels. Raises RecordingError."""
        definitions: dict[tuple[str, str], str] = {}
        for row in self._rows_of("message_definitions"):
            of_type, text = str(row.get("topic_type")), str(row.get("encoded_message_definition") or "")
            definition = definition_in(of_type, str(row.get("encoding")), text)
            if definition:
                definitions.setdefault((of_type, str(row.get("type_description_hash") or "")), definition)
                definitions.setdefault((of_type, ""), definition)
        found = {}
        for row in self._rows_of("topics"):
            number, name, ros_type = row.get("id"), row.get("name"), row.get("type")
            if not (isinstance(number, int) and isinstance(name, str) and isinstance(ros_type, str)):
                self._report("a topic has no name or type")
                continue
            type_hash = str(row.get("type_description_hash") or "")
            found[number] = Channel(
                number=number,
                topic=name,
                ros_type=ros_type_of(ros_type),
                definition=definitions.get((ros_type, type_hash)) or definitions.get((ros_type, ""), ""),
                encoding=str(row.get("serialization_format")),
                type_hash=type_hash_in(type_hash),
                qos=str(row.get("offered_qos_profiles") or ""),
            )
        return found

    def _find_span(self) -> None:
        with suppress(*ERRORS):
            self._span = self._statements.span(self._time)
            return
        times = [each for each in self.times(self._channels).values() if len(each)]
        if times:
            self._span = min(int(each.min()) for each in times), max(int(each.max()) for each in times)

    def _report(self, text: str, offset: int | None = None, samples: int = 0) -> None:
        problem = Problem(text, offset, samples=samples)
        if problem not in self._reported:
            self._reported.add(problem)
            self.problems.append(problem)


def _is_plain(columns: list[Column]) -> bool:
    """Whether the payload is behind the other columns of `messages`, and so these are not on overflow pages."""
    names = [column.name for column in columns]
    numbers = {"topic_id", _SENT, *_TIMES}
    return (
        names[-1:] == ["data"]
        and "topic_id" in names
        and any(name in names for name in _TIMES)
        and all(column.is_id or column.name in numbers for column in columns[:-1])
    )
