"""The Parquet files of a topic: the rows of many recordings, sorted by recording.

A file consists of runs, rows of one topic of one recording. They come from a recording that was just converted, or from
other files of a fleet. A row group has whole runs until it is large enough, and a large run has several row groups. So
engines find the rows of a recording by the statistics of the columns of `Keys`.
"""

from __future__ import annotations

import os
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import chain, pairwise
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

from msggen.exports.fleet.layout import Keys, order_of
from msggen.exports.fleet.records import FleetError

if TYPE_CHECKING:
    import pyarrow as pa

_T = TypeVar("_T")
LARGE = 32 << 20
"""The bytes of a file that stays as it is when a fleet is compacted."""
FULL = 160 << 20
"""The bytes after which a file ends."""
_GROUP = 1 << 20
"""The bytes of values in memory after which a row group ends with its run."""
_MOST = 8 << 20
"""The bytes of values in memory after which a row group ends within a run."""


class Run(NamedTuple):
    """Rows of a topic of a recording."""

    keys: Keys
    schema: pa.Schema
    """Its columns without those of `Keys`."""
    tables: Callable[[], Iterator[Any]]
    """Reads them piece by piece."""


class File(NamedTuple):
    """A file of a topic."""

    place: str
    """Its path in the fleet when it is part of it: `<topic>/000012-9f3a5c01.parquet`."""
    size: int
    """In bytes."""
    logs: Collection[str] = ()
    """The names of the recordings that it has, if it was just written."""


def write_files(runs: Iterable[tuple[str, Iterable[Run]]], folder: str, token: str, by: Sequence[str]) -> list[File]:
    """Write runs by topic to new files below a folder, sorted, to several ones if columns conflict or a file is full.

    The first one of a topic is `<topic>/<token>.parquet`, and the names of the further ones end with `-2` and so on.
    Raises OSError.
    """
    counts: Counter[str] = Counter()
    names = order_of(by)
    written = []
    for topic, members in runs:
        ordered = sorted(members, key=lambda run: tuple(getattr(run.keys, name) for name in names))
        for shape, own in shapes_of((run.schema, run) for run in ordered):
            waiting = iter(own)
            for first in waiting:
                counts[topic] += 1
                end = f"-{counts[topic]}" if counts[topic] > 1 else ""
                written.append(
                    _write_file(chain([first], waiting), shape, folder, f"{topic}/{token}{end}.parquet", names)
                )
    return written


def _write_file(runs: Iterator[Run], shape: pa.Schema, folder: str, place: str, order: Sequence[str]) -> File:
    """Write runs to a new file until it is full. `shape` is the schema of all without `Keys`. Raises OSError."""
    import pyarrow as pa
    from pyarrow import parquet

    from msggen.exports.convert.tables import is_time

    path = os.path.join(folder, *place.split("/"))
    with suppress(FileExistsError):
        os.mkdir(os.path.dirname(path))  # of the topic; the folder of a run that was overtaken is not made anew
    keys = [pa.field(name, pa.int32() if name == "instance" else pa.string()) for name in Keys._fields]
    schema = pa.schema([*keys, *shape], shape.metadata)
    texts = [field.name for field in shape if pa.types.is_string(field.type)]
    logs: dict[str, None] = {}
    try:
        with (
            open(path, "xb") as file,
            parquet.ParquetWriter(
                file,
                schema,
                compression="zstd",
                use_dictionary=[*Keys._fields, *texts],  # as for single recordings: measured values have none
                column_encoding={field.name: "DELTA_BINARY_PACKED" for field in shape if is_time(field)},
                sorting_columns=[parquet.SortingColumn(Keys._fields.index(name)) for name in order],
            ) as writer,
        ):
            for group in _groups(runs, logs, lambda: file.tell() >= FULL):
                table = pa.concat_tables([_whole(keys, piece, schema) for keys, piece in group])
                writer.write_table(table, row_group_size=len(table))
    except OSError as failed:
        failed.filename = failed.filename or path  # a full disk has no name
        raise
    return File(place, os.path.getsize(path), list(logs))


def _groups(
    runs: Iterator[Run], logs: dict[str, None], is_full: Callable[[], bool]
) -> Iterator[list[tuple[Keys, Any]]]:
    """Yield the pieces of each row group, and note the recordings. Ends with the run after which a file is full."""
    group, size = list[tuple[Keys, Any]](), 0
    for run in runs:
        logs[run.keys.log] = None
        for table in run.tables():
            step = max(1, _MOST * len(table) // max(table.nbytes, 1))
            for piece in (table.slice(begin, step) for begin in range(0, len(table), step)):
                group.append((run.keys, piece))
                size += piece.nbytes
                if size >= _MOST:
                    yield group
                    group, size = [], 0
        if size > _GROUP:
            yield group
            group, size = [], 0
        if is_full():
            break
    if group:
        yield group


def _whole(keys: Keys, table: Any, schema: pa.Schema) -> Any:
    """Return a table with the columns of a file. Those that it lacks are NULL."""
    import pyarrow as pa

    told, own = keys._asdict(), {*table.schema.names}
    return pa.Table.from_arrays(
        [
            table.column(field.name)
            if field.name in own
            else pa.repeat(pa.scalar(told.get(field.name), field.type), len(table))
            for field in schema
        ],
        schema=schema,
    )


def shapes_of(items: Iterable[tuple[pa.Schema, _T]]) -> list[tuple[pa.Schema, list[_T]]]:
    """Group items whose columns agree, each with the columns of all. Columns conflict if their type or unit differs."""
    shapes: list[tuple[pa.Schema, list[_T]]] = []
    known: dict[bytes, int] = {}
    for schema, item in items:
        text = schema.serialize().to_pybytes()
        if text not in known:
            fits = ((number, _united(shape, schema)) for number, (shape, _) in enumerate(shapes))
            number, united = next((each for each in fits if each[1] is not None), (len(shapes), schema))
            if number == len(shapes):
                shapes.append((united, []))
            shapes[number] = (united, shapes[number][1])
            known[text] = number
        shapes[known[text]][1].append(item)
    return shapes


def _united(one: pa.Schema, other: pa.Schema) -> pa.Schema | None:
    """Return the columns of both, None if they conflict. The metadata of a later one completes that of the first."""
    import pyarrow as pa

    fields = {field.name: field for field in one}
    for field in other:
        known = fields.setdefault(field.name, field)
        told, also = known.metadata or {}, field.metadata or {}
        if known.type != field.type or len({told.get(b"unit"), also.get(b"unit")} - {None, b""}) > 1:
            return None
        fields[field.name] = known.with_metadata({**told, **also}) if also else known
    told, also = one.metadata or {}, other.metadata or {}
    return pa.schema(fields.values(), {key: value for key, value in told.items() if also.get(key) == value})


def without_keys(schema: pa.Schema) -> pa.Schema:
    """Return the columns of a recording as a fleet has them: a field with the name of a key has `_` behind it."""
    import pyarrow as pa

    taken: Collection[str] = {*schema.names, *Keys._fields}
    fields = [field.with_name(_free(field.name, taken)) if field.name in Keys._fields else field for field in schema]
    return pa.schema(fields, {key: value for key, value in (schema.metadata or {}).items() if key != b"instance"})


def _free(name: str, taken: Collection[str]) -> str:
    while name in taken:
        name += "_"
    return name


_KEPT = 32 << 20
"""The bytes of row groups that are kept, because another run of them may be next."""


def run_of_arrow(path: str, keys: Keys) -> Run:
    """Return the run in an Arrow file of one topic of one recording."""
    import pyarrow as pa

    with open(path, "rb") as file:
        found = pa.ipc.open_file(file).schema
    return Run(keys, without_keys(found), partial(_tables_of_arrow, path))


def _tables_of_arrow(path: str) -> Iterator[Any]:
    import pyarrow as pa

    with open(path, "rb") as file:
        reader = pa.ipc.open_file(file)
        for index in range(reader.num_record_batches):
            table = pa.Table.from_batches([reader.get_batch(index)])
            yield table.rename_columns(without_keys(table.schema).names)


_Group: TypeAlias = tuple[str, int]
"""A row group: the name of a file, and the number in it."""


class Files:
    """Parquet files of a fleet, whose row groups are read when they are needed. Memory is bounded."""

    def __init__(self, opening: Callable[[str], IO[bytes]]) -> None:
        self._opening = opening
        self._heads: dict[str, tuple[Any, pa.Schema]] = {}
        self._groups: OrderedDict[_Group, Any] = OrderedDict()
        self._bytes = 0

    def schema(self, name: str) -> pa.Schema:
        """Return the columns of a file, without those of `Keys`. Raises FleetError for a damaged file, OSError."""
        import pyarrow as pa

        _, found = self._head(name)
        if found.names[: len(Keys._fields)] != list(Keys._fields):
            raise FleetError(f"{name}: this is not a file of a fleet: it lacks the columns {', '.join(Keys._fields)}")
        return pa.schema(list(found)[len(Keys._fields) :], found.metadata)

    def runs(self, name: str) -> list[Run]:
        """Return the runs of a file of this layout. Raises FleetError for a damaged file, and OSError."""
        schema = self.schema(name)
        return [
            Run(keys, schema, partial(self._piece, (name, index), begin, end))
            for index in range(self._head(name)[0].num_row_groups)
            for keys, begin, end in self._spans((name, index))
        ]

    def _piece(self, group: _Group, begin: int, end: int) -> Iterator[Any]:
        if group in self._groups:
            self._groups.move_to_end(group)
        else:
            self._groups[group] = table = self._read(group)
            self._bytes += table.nbytes
            while self._bytes > _KEPT and len(self._groups) > 1:
                self._bytes -= self._groups.popitem(last=False)[1].nbytes
        yield self._groups[group].slice(begin, end - begin).select(self.schema(group[0]).names)

    def _spans(self, group: _Group) -> Iterator[tuple[Keys, int, int]]:
        """Yield the keys of the runs in a row group, and the rows from which to which they are."""
        import numpy as np

        table = self._read(group, list(Keys._fields)).combine_chunks()
        changes = np.zeros(max(len(table) - 1, 0), bool)
        for column in table.columns:
            codes = column.combine_chunks().dictionary_encode().indices.to_numpy()
            changes |= codes[1:] != codes[:-1]
        for begin, end in pairwise([0, *(np.flatnonzero(changes) + 1).tolist(), len(table)]):
            yield Keys(*(column[begin].as_py() for column in table.columns)), begin, end

    def _head(self, name: str) -> tuple[Any, pa.Schema]:
        """Return the metadata and the columns of a file."""
        from pyarrow import parquet

        if name not in self._heads:
            with self._opening(name) as file, _told(name):
                found = parquet.ParquetFile(file)
                self._heads[name] = found.metadata, found.schema_arrow
        return self._heads[name]

    def _read(self, group: _Group, columns: list[str] | None = None) -> Any:
        from pyarrow import parquet

        name, number = group
        with self._opening(name) as file, _told(name):
            return parquet.ParquetFile(file, metadata=self._heads[name][0]).read_row_group(number, columns)


@contextmanager
def _told(name: str) -> Iterator[None]:
    """Tell the name of a file that is damaged."""
    try:
        yield
    except (ValueError, OSError, KeyError) as error:  # pyarrow raises them for what it does not understand
        if isinstance(error, FleetError) or getattr(error, "filename", None):
            raise
        text = str(error).partition("\n")[0]
        raise FleetError(
            f"{name}: the file is damaged ({text}): remove it, and `msggen log convert` converts its recordings again"
        ) from None
