"""The runs in files: of a recording that was just converted, and of a fleet."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from msggen.exports.fleet.layout import Keys
from msggen.exports.fleet.parts import Run, without_keys
from msggen.exports.fleet.records import FleetError

if TYPE_CHECKING:
    import pyarrow as pa

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
            yield _renamed(pa.Table.from_batches([reader.get_batch(index)]))


def _renamed(table: Any) -> Any:
    return table.rename_columns(without_keys(table.schema).names)


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
