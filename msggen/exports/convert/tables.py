"""Tables of a recording, a file for each topic: Parquet, Arrow (its IPC format) and CSV."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from contextlib import ExitStack
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import few, suggestion
from msggen.base.foreign import csv_text, safe_json
from msggen.definitions.nesting import MAX_TOTAL
from msggen.exports.convert.facts import fact_tables
from msggen.exports.convert.names import file_names
from msggen.exports.convert.selection import Converted, Selection, Share
from msggen.recordings.columns.arrays import count_of, has_field, names_of
from msggen.recordings.columns.arrow import table_of
from msggen.recordings.columns.collector import Collector
from msggen.recordings.columns.sql_names import renamed_for_sql
from msggen.recordings.columns.text import json_value
from msggen.recordings.log.decoded_events import is_decoded
from msggen.recordings.log.events import has_events
from msggen.recordings.source.source import Problem, RecordingError, UnknownFieldError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
    from typing import IO

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

_TIME = "timestamp"
_WAITING = 64 << 20
"""The bytes of all samples that wait for their row groups."""
_OBJECTS = 4
"""How many times the bytes of its column in Arrow an object of Python has."""
_CSV_ROWS, _CSV_VALUES = 1 << 10, 1 << 20
"""The most rows, and values in them, that are written to CSV at a time."""


class Format(NamedTuple):
    """A format of tables."""

    name: str
    """`parquet`, `arrow` or `csv`, which is the suffix of files too."""
    quotes_formulas: bool = False
    """Whether `'` precedes text in CSV that a spreadsheet would evaluate."""
    packing: str = "zstd"
    """The compression of Arrow."""
    is_file: bool = False
    """Whether a file with one topic is written, and no folder."""
    sql_names: bool = False
    """Whether SQL takes the names of columns without quotes."""

    def table(self, table: Any) -> Any:
        """Return a table as the format has it."""
        made = _flat(table, quotes_formulas=self.quotes_formulas) if self.name == "csv" else table
        return renamed_for_sql(made) if self.sql_names else made


def write_tables(
    log: Log, target: str, format_: Format, selection: Selection, progress: Callable[[float], None]
) -> Converted:
    """Write a new folder with a file for each topic that has samples, or a file of a topic. See `convert`."""
    topics = _chosen(log, selection)
    if format_.is_file:
        topics = [_only(log, topics, target, format_)]
    else:
        os.mkdir(target)
    chosen, wide = _within_limits(log, topics)
    columns = _columns(log, chosen, selection.fields)
    paths = {
        key: target if format_.is_file else os.path.join(target, f"{name}.{format_.name}")
        for key, name in file_names(chosen).items()
    }
    # in a ULog without a time of day, log times are no times in UTC
    utc_offset = log.utc_offset if log.has_facts else 0
    tables = _Tables(paths, format_, columns, utc_offset)
    share = Share(log.start, log.end, selection, progress)
    wanted = [topic for topic in chosen if (topic.name, topic.instance) in columns]
    try:
        for samples in log.batches(wanted, start=selection.start, stop=selection.stop):
            tables.add(samples)
            share.reach(samples.log_times)
        tables.flush()
    finally:
        tables.close()
    has_facts = bool(tables.rows) and not format_.is_file
    facts = list(_written_facts(log, target, format_, selection)) if has_facts else []
    files = sorted([*tables.files, *facts])
    share.end()
    notes = [*(log.notes if any(topic.is_lent for topic in wanted) else ()), *(log.event_notes if facts else ())]
    return Converted(files, tables.rows, [*log.problems, *wide], notes)


def _chosen(log: Log, selection: Selection) -> list[Topic]:
    """Return the topics to write, without decoded events if they are also samples that become a table of events."""
    chosen = log.chosen(selection.topics)
    if not (log.has_facts and _has_facts(selection) and log.events):
        return chosen
    has_samples = any(has_events(topic) and topic.count for topic in chosen)
    return [topic for topic in chosen if not (has_samples and is_decoded(topic))]


def _has_facts(selection: Selection) -> bool:
    """Whether there are tables of what a ULog has beside its topics: unless topics or fields were chosen."""
    return selection.topics is None and selection.fields is None


def _only(log: Log, topics: Sequence[Topic], target: str, format_: Format) -> Topic:
    """Return the topic that is written to a file. Raises RecordingError if there are several with samples, or none."""
    found = [topic for topic in topics if topic.count] or list(topics)
    if len(found) == 1:
        return found[0]
    name, folder = os.path.basename(target), os.path.splitext(os.path.basename(target))[0]
    if not found:
        raise RecordingError(f"{log.path} has no topic that can be decoded, and so no table for {name}")
    names = few([topic.label for topic in found])
    text = f"name one of {names}, or write a folder '{folder}' in the format {format_.name}"
    raise RecordingError(f"{name} is a file for one topic, and there are {len(found)}: {text}")


def _within_limits(log: Log, topics: Sequence[Topic]) -> tuple[list[Topic], list[Problem]]:
    """Return topics that have up to MAX_TOTAL together, and what is left out."""
    kept: list[Topic] = []
    wide: list[Problem] = []
    total = 0
    for topic in topics:
        count = count_of(log.dtype(topic))
        if total + count <= MAX_TOTAL:
            kept.append(topic)
            total += count
        else:
            text = f"{topic.label} is left out: {count} columns, tables have up to {MAX_TOTAL} together"
            wide.append(Problem(text, samples=topic.count, topic=topic.name, instance=topic.instance))
    return kept, wide


def _written_facts(log: Log, folder: str, format_: Format, selection: Selection) -> Iterator[str]:
    """Write what a ULog has beside its topics, and yield the paths."""
    if not _has_facts(selection):
        return
    for name, table in fact_tables(log, *selection.limits(log.start)):
        path, shown = os.path.join(folder, f"{name}.{format_.name}"), format_.table(table)
        with open(path, "xb") as file, _writer(file, format_, shown.schema) as writer:
            writer.write_table(shown)
        yield path


def _columns(
    log: Log, topics: Sequence[Topic], fields: Collection[str] | None
) -> Mapping[tuple[str, int], tuple[str, ...] | None]:
    """Return the fields of each topic that are written, None for all. Topics without any are left out.

    `timestamp` is always written.

    Raises RecordingError for a name that no topic has.
    """
    if fields is None:
        return {(topic.name, topic.instance): None for topic in topics}
    known = {(topic.name, topic.instance): log.dtype(topic) for topic in topics}
    for field in fields:
        if not any(has_field(dtype, field) for dtype in known.values()):
            near = sorted({name for dtype in known.values() for name in names_of(dtype)})
            raise UnknownFieldError(f"no field is called '{field}'{suggestion(field, near)}")
    found = {key: tuple(field for field in fields if has_field(dtype, field)) for key, dtype in known.items()}
    return {
        key: tuple(dict.fromkeys([_TIME, *names])) if has_field(known[key], _TIME) else names
        for key, names in found.items()
        if names
    }


class _Tables:
    """The files of the topics, and the samples that wait for a row group."""

    def __init__(
        self,
        paths: Mapping[tuple[str, int], str],
        format_: Format,
        columns: Mapping[tuple[str, int], tuple[str, ...] | None],
        utc_offset: int | None,
    ) -> None:
        self._paths, self._format, self._columns, self._utc_offset = paths, format_, columns, utc_offset
        self._waiting: dict[tuple[str, int], list[Samples]] = defaultdict(list)
        self._sizes: dict[tuple[str, int], int] = defaultdict(int)
        self._total = 0
        self._writers: dict[tuple[str, int], Any] = {}
        self._ends: dict[tuple[str, int], ExitStack] = defaultdict(ExitStack)
        """What ends each file."""
        self.rows = 0

    @property
    def files(self) -> list[str]:
        """The files that were begun."""
        return [self._paths[key] for key in self._writers]

    def add(self, samples: Samples) -> None:
        """Add samples of a topic, and write the topic with the most bytes if too many wait."""
        key = samples.topic.name, samples.topic.instance
        size = samples.array.nbytes
        if samples.array.dtype.hasobject:
            size += _OBJECTS * table_of(samples.topic, samples.columns()).nbytes
        self._waiting[key].append(samples)
        self._sizes[key] += size
        self._total += size
        while self._total > _WAITING:
            self._write(max(self._sizes, key=self._sizes.__getitem__))

    def flush(self) -> None:
        """Write what waits, and end each file: there can be more topics than files that may be open."""
        for key in list(self._waiting):
            self._write(key)
            self._ends[key].close()

    def close(self) -> None:
        """End the files."""
        with ExitStack() as ends:
            for end in self._ends.values():
                ends.push(end)

    def _write(self, key: tuple[str, int]) -> None:
        waiting = self._waiting.pop(key)
        self._total -= self._sizes.pop(key)
        first = waiting[0]
        collector = Collector(first.topic, first.array.dtype, sum(map(len, waiting)))
        for samples in waiting:
            collector.add(samples.array, samples.log_times, samples.publish_times)
        chosen = collector.samples().choose(self._columns[key])
        clocks = chosen.log_times, chosen.publish_times
        table = self._format.table(table_of(chosen.topic, chosen.columns(), clocks, self._utc_offset))
        if key not in self._writers:
            # pyarrow itself only opens files whose names are UTF-8
            file = self._ends[key].enter_context(open(self._paths[key], "wb"))  # noqa: SIM115 - the stack closes it
            self._writers[key] = self._ends[key].enter_context(_writer(file, self._format, table.schema))
        self._writers[key].write_table(table)
        self.rows += len(table)


def _writer(file: IO[bytes], format_: Format, schema: Any) -> Any:
    """Return a writer of pyarrow. All have `write_table`, and end the content at the end of their context."""
    return WRITERS[format_.name](file, format_, schema)


def _parquet(file: IO[bytes], _: Format, schema: Any) -> Any:
    from pyarrow.parquet import ParquetWriter

    # dictionaries make files of measured values larger and writing slower; differences of times are small
    times = {field.name: "DELTA_BINARY_PACKED" for field in schema if is_time(field)}
    return ParquetWriter(file, schema, compression="zstd", use_dictionary=False, column_encoding=times)


def _arrow(file: IO[bytes], format_: Format, schema: Any) -> Any:
    from pyarrow import ipc

    return ipc.new_file(file, schema, options=ipc.IpcWriteOptions(compression=format_.packing))


def _csv(file: IO[bytes], _: Format, schema: Any) -> Any:
    from pyarrow.csv import CSVWriter, WriteOptions

    # pyarrow takes 8 bytes for each value of a batch in advance: for the usual 1,024 rows of 65,535 columns, 512 MiB
    rows = max(1, min(_CSV_ROWS, _CSV_VALUES // max(len(schema), 1)))
    return CSVWriter(file, schema, write_options=WriteOptions(batch_size=rows))


WRITERS: Mapping[str, Callable[[IO[bytes], Format, Any], Any]] = MappingProxyType(
    {"parquet": _parquet, "arrow": _arrow, "csv": _csv}
)
"""What writes each format of `TABLES`."""


def is_time(field: Any) -> bool:
    """Whether a column has times in 64 bits."""
    import pyarrow as pa

    return bool(pa.types.is_timestamp(field.type) or (field.name == _TIME and field.type == pa.uint64()))


def _flat(table: Any, *, quotes_formulas: bool) -> Any:
    """Return a table for CSV, which has no lists and structs: they are JSON, with null for NaN. Text is escaped."""
    import pyarrow as pa
    from pyarrow import compute

    for index, field in enumerate(table.schema):
        column = table.column(index)
        if pa.types.is_nested(field.type):
            change: Callable[[Any], str] = _json_of
        elif pa.types.is_string(field.type) and (
            quotes_formulas or compute.all(compute.utf8_is_printable(column)).as_py() is False
        ):
            change = partial(csv_text, quotes_formulas=quotes_formulas)
        else:
            continue
        texts = [None if value is None else change(value) for value in column.to_pylist()]
        table = table.set_column(index, pa.field(field.name, pa.string()), pa.array(texts, pa.string()))
    return table


def _json_of(value: Any) -> str:
    return safe_json(json.dumps(json_value(value), allow_nan=False))
