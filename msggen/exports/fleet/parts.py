"""The Parquet files of a topic: the rows of many recordings, sorted by recording.

A file consists of runs, rows of one topic of one recording. They come from a recording that was just converted, or from
other files of a fleet. A row group has whole runs until it is large enough, and a large run has several row groups. So
engines find the rows of a recording by the statistics of the columns of `Keys`.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import pairwise
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeVar

from msggen.exports.fleet.layout import Keys, order_of
from msggen.exports.fleet.records import FleetError

if TYPE_CHECKING:
    import pyarrow as pa
    from typing_extensions import Self

_T = TypeVar("_T")
LARGE = 32 << 20
"""The bytes of a file that stays as it is when a fleet is compacted."""
FULL = 160 << 20
"""The bytes after which a file ends."""
_GROUP = 1 << 20
"""The bytes of values in memory after which a row group ends with its run."""
_MOST = 8 << 20
"""The bytes of values in memory after which a row group ends within a run."""
_ROWS = 1 << 20
"""The rows after which it does."""


class Run(NamedTuple):
    """Rows of a topic of a recording."""

    keys: Keys
    schema: pa.Schema
    """Its columns without those of `Keys`."""
    tables: Callable[[], Iterator[Any]]
    """Reads them piece by piece."""


class Part(NamedTuple):
    """A file that was written."""

    path: str
    rows: int
    size: int
    logs: Sequence[str]
    """The names of the recordings in it."""


def write_parts(runs: Iterable[Run], path: str, by: Sequence[str]) -> Iterator[Part]:
    """Write runs to a file, sorted, or to several ones if columns conflict or a file is full. Yield them.

    `path` ends with `.parquet`, and the paths of the further files with `-2.parquet` and so on. Raises OSError.
    """
    names = order_of(by)
    ordered = sorted(runs, key=lambda run: tuple(getattr(run.keys, name) for name in names))
    stem, suffix = os.path.splitext(path)
    number = 1
    for shape, members in shapes_of((run.schema, run) for run in ordered):
        waiting = iter(members)
        while (first := next(waiting, None)) is not None:
            with _Writer(f"{stem}-{number}{suffix}" if number > 1 else path, shape, names) as writer:
                writer.add(first)
                while writer.size < FULL and (run := next(waiting, None)) is not None:
                    writer.add(run)
            yield writer.part()
            number += 1


def shapes_of(items: Iterable[tuple[pa.Schema, _T]]) -> list[tuple[pa.Schema, list[_T]]]:
    """Group items whose columns agree, each with the columns of all. Columns conflict if their type or unit differs."""
    shapes: list[tuple[pa.Schema, list[_T]]] = []
    known: dict[bytes, int] = {}
    for schema, item in items:
        text = schema.serialize().to_pybytes()
        if text not in known:
            fits = (number for number, (shape, _) in enumerate(shapes) if agrees(shape, schema))
            known[text] = number = next(fits, len(shapes))
            if number == len(shapes):
                shapes.append((schema, []))
            else:
                shapes[number] = (_united(shapes[number][0], schema), shapes[number][1])
        shapes[known[text]][1].append(item)
    return shapes


def agrees(one: pa.Schema, other: pa.Schema) -> bool:
    """Whether the columns that both have are of the same type and unit."""
    for field in other:
        index = one.get_field_index(field.name)
        if index >= 0:
            known = one.field(index)
            units = {(each.metadata or {}).get(b"unit", b"") for each in (known, field)} - {b""}
            if known.type != field.type or len(units) > 1:
                return False
    return True


def _united(one: pa.Schema, other: pa.Schema) -> pa.Schema:
    """Return the columns of both. The metadata of a later one completes that of the first."""
    import pyarrow as pa

    fields = []
    for field in one:
        index = other.get_field_index(field.name)
        more = other.field(index).metadata if index >= 0 else None
        fields.append(field.with_metadata({**(field.metadata or {}), **more}) if more else field)
    fields += [field for field in other if one.get_field_index(field.name) < 0]
    told, also = one.metadata or {}, other.metadata or {}
    return pa.schema(fields, {key: value for key, value in told.items() if also.get(key) == value})


class _Writer:
    """A file that is being written."""

    def __init__(self, path: str, shape: pa.Schema, order: Sequence[str]) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        from msggen.exports.convert.tables import is_time

        self._path, self._shape = path, shape
        types = [pa.int32() if name == "instance" else pa.string() for name in Keys._fields]
        keys = [pa.field(name, kind) for name, kind in zip(Keys._fields, types, strict=True)]
        self._schema = pa.schema([*keys, *shape], shape.metadata)
        times = {field.name: "DELTA_BINARY_PACKED" for field in shape if is_time(field)}
        texts = [field.name for field in shape if pa.types.is_string(field.type)]
        with ExitStack() as end:
            self._file = end.enter_context(open(path, "xb"))
            self._writer = end.enter_context(
                parquet.ParquetWriter(
                    self._file,
                    self._schema,
                    compression="zstd",
                    use_dictionary=[*Keys._fields, *texts],  # as for single recordings: measured values have none
                    column_encoding=times,
                    sorting_columns=[parquet.SortingColumn(Keys._fields.index(name)) for name in order],
                )
            )
            self._end = end.pop_all()
        self._waiting: list[Any] = []
        self._bytes = self._count = self._rows = 0
        self._logs: dict[str, None] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        try:
            if error[0] is None:
                self._flush()
            self._end.close()
        except OSError as failed:
            failed.filename = failed.filename or self._path  # a full disk has no name
            raise

    @property
    def size(self) -> int:
        """How many bytes were written."""
        return self._file.tell()

    def add(self, run: Run) -> None:
        """Write a run. Raises OSError."""
        try:
            for table in run.tables():
                self._add(run.keys, table)
            if self._bytes > _GROUP:
                self._flush()
        except OSError as failed:
            failed.filename = failed.filename or self._path
            raise
        self._logs[run.keys.log] = None

    def part(self) -> Part:
        """Return what was written, after its end."""
        return Part(self._path, self._rows, os.path.getsize(self._path), list(self._logs))

    def _add(self, keys: Keys, table: Any) -> None:
        step = max(1, min(_ROWS, _MOST * len(table) // max(table.nbytes, 1)))
        for begin in range(0, len(table), step):
            piece = table.slice(begin, step)
            self._waiting.append(self._whole(keys, piece))
            self._bytes += piece.nbytes
            self._count += len(piece)
            if self._bytes >= _MOST or self._count >= _ROWS:
                self._flush()

    def _whole(self, keys: Keys, table: Any) -> Any:
        """Return a table with the columns of the file. Those that it lacks are NULL."""
        import pyarrow as pa

        count = len(table)
        columns = [
            pa.repeat(pa.scalar(value, field.type), count) for value, field in zip(keys, self._schema, strict=False)
        ]
        for field in self._shape:
            index = table.schema.get_field_index(field.name)
            columns.append(table.column(index) if index >= 0 else pa.nulls(count, field.type))
        return pa.Table.from_arrays(columns, schema=self._schema)

    def _flush(self) -> None:
        import pyarrow as pa

        if self._waiting:
            table = pa.concat_tables(self._waiting)
            self._writer.write_table(table, row_group_size=len(table))
            self._rows += len(table)
        self._waiting, self._bytes, self._count = [], 0, 0


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


class _Group(NamedTuple):
    """A row group of a file."""

    name: str
    number: int


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
            Run(keys, schema, partial(self._piece, _Group(name, index), begin, end))
            for index in range(self._head(name)[0].num_row_groups)
            for keys, begin, end in self._spans(_Group(name, index))
        ]

    def _piece(self, group: _Group, begin: int, end: int) -> Iterator[Any]:
        if group in self._groups:
            self._groups.move_to_end(group)
        else:
            self._groups[group] = table = self._read(group)
            self._bytes += table.nbytes
            while self._bytes > _KEPT and len(self._groups) > 1:
                self._bytes -= self._groups.popitem(last=False)[1].nbytes
        yield self._groups[group].slice(begin, end - begin).select(self.schema(group.name).names)

    def _spans(self, group: _Group) -> Iterator[tuple[Keys, int, int]]:
        """Yield the keys of the runs in a row group, and the rows from which to which they are."""
        import numpy as np

        metadata = self._head(group.name)[0].row_group(group.number)
        told = [metadata.column(number).statistics for number in range(len(Keys._fields))]
        if all(each is not None and each.has_min_max and each.min == each.max for each in told):
            yield Keys(*(each.min for each in told)), 0, metadata.num_rows
            return
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

        with self._opening(group.name) as file, _told(group.name):
            return parquet.ParquetFile(file, metadata=self._heads[group.name][0]).read_row_group(group.number, columns)


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
