"""The list of a fleet, `_logs.parquet`: a row for each recording, with the files that have its rows.

Queries join it with any topic on `log`. Its metadata tells which run has written it, and what rows are sorted by.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.exports.fleet.finding import State
from msggen.exports.fleet.layout import ORIGINS, is_place
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    import pyarrow as pa

TABLE = "_logs.parquet"
"""The list, beside the folders of the topics. Engines that read a whole folder skip names with an underscore."""
VERSION = 5
"""The version of the layout. A fleet has only files of one."""
NOT_A_FLEET = "this is not a fleet: name a folder that `msggen log convert FOLDER -o FLEET` has written"
_DAMAGED = f"{TABLE} is not the list of a fleet, or is damaged: restore it, or convert to a new folder"
_METADATA = b"msggen"
_SURROGATE = re.compile("[\ud800-\udfff]")
_DIGEST = re.compile("[0-9a-f]{64}")
_RUN = re.compile("[0-9a-f]{8}")
_PROCESS = re.compile("[ -~]{0,200}")


class FleetError(RecordingError):
    """A folder that is not the fleet that was asked for, or a file of a fleet that is damaged."""


class Record(NamedTuple):
    """A recording that is done: its row in the list, without its path."""

    log: str
    """Its name in the fleet."""
    vehicle: str
    date: str
    firmware: str | None
    """The release of the firmware, None if a ULog does not tell it."""
    start: int | None
    """The start in ns since 1970 in UTC, None if the recording does not tell it."""
    utc_offset: int | None
    """What to add to log times in ns for UTC, None if it is not known."""
    duration: float
    """In s."""
    samples: int
    """The rows in the files of its topics."""
    problems: Sequence[str]
    """What it has and what is not in the files."""
    notes: Sequence[str]
    """Where definitions are from that are not in the recording."""
    date_from: str
    digest: str
    """That of its contents."""
    paths: Mapping[str, State]
    """Where it is, or was if it is nowhere any more, and its state there. A copy is not converted."""
    files: tuple[str, ...] = ()
    """The places of the files that have its rows."""


class Listed(NamedTuple):
    """What a list tells."""

    run: str
    """The run that has written it."""
    process: str
    """The process of this run, and its machine."""
    by: Sequence[str]
    """What rows are sorted by: of KEYS."""
    records: Sequence[Record]


def original_of(record: Record) -> str:
    """Return the path of a recording of which other ones are copies."""
    return next(iter(record.paths), record.log)


def encoded(listed: Listed) -> bytes:
    """Return a list as the contents of its file."""
    import pyarrow as pa
    from pyarrow import parquet

    told = {"version": VERSION, "run": listed.run, "process": listed.process, "by": list(listed.by)}
    records = sorted(listed.records, key=lambda record: record.log)
    schema = _schema().with_metadata({_METADATA: json.dumps(told)})
    numbers = {files: number for number, files in enumerate(dict.fromkeys(record.files for record in records))}
    lists = pa.array(list(numbers), schema.field("files").type)  # few: the recordings of a batch have the same files
    rows = pa.Table.from_pylist(list(map(_row, records)), schema.remove(len(schema) - 1))
    indices = pa.array([numbers[record.files] for record in records], pa.int64())
    table = rows.append_column(schema.field("files"), lists.take(indices))
    stream = pa.BufferOutputStream()
    parquet.write_table(table, stream, compression="zstd")
    return bytes(stream.getvalue())


def decoded(data: bytes) -> Listed:
    """Return the list in a file. Raises FleetError if it is not sound: anybody can have written it."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        table = parquet.ParquetFile(pa.BufferReader(data)).read(use_threads=False)
        told = json.loads((table.schema.metadata or {})[_METADATA])
        version = told["version"]
        is_sound = version == VERSION and table.schema.equals(_schema())
        listed = Listed(told["run"], told["process"], told["by"], _records(table)) if is_sound else None
    except (pa.ArrowException, ValueError, LookupError, TypeError, RecursionError, OSError):
        raise FleetError(_DAMAGED) from None
    if isinstance(version, int) and version > VERSION:
        raise FleetError("a newer version of msggen wrote this fleet: choose a new folder")
    if listed is None or not _is_sound(listed):
        raise FleetError(_DAMAGED)
    return listed


def _is_sound(listed: Listed) -> bool:
    run, process, by, records = listed
    return (
        all(isinstance(text, str) for text in (run, process))
        and _RUN.fullmatch(run) is not None
        and _PROCESS.fullmatch(process) is not None
        and by in (["vehicle", "date"], ["date", "vehicle"], ["vehicle"], ["date"])
        and len({record.log for record in records}) == len(records) == len({record.digest for record in records})
        and all(_DIGEST.fullmatch(record.digest) and record.date_from in ORIGINS for record in records)
        and all(map(is_place, {place for record in records for place in record.files}))
    )


def _records(table: pa.Table) -> list[Record]:
    import pyarrow as pa

    start = table.schema.get_field_index("start")
    files = _files(table.column("files"))
    rows = table.set_column(start, "start", table.column(start).cast(pa.int64())).drop_columns(["path", "files"])
    return [_record(row, own) for row, own in zip(rows.to_pylist(), files, strict=True)]


def _files(column: Any) -> list[tuple[str, ...]]:
    """Return the files of each recording. Each name is there once: fleets have few files, named many times."""
    lists = column.combine_chunks()
    codes = lists.flatten().dictionary_encode()
    names, indices = codes.dictionary.to_pylist(), codes.indices.to_numpy()
    ends = accumulate(lists.value_lengths().to_pylist(), initial=0)
    known: dict[bytes, tuple[str, ...]] = {}
    found = []
    for begin, end in pairwise(ends):
        own = indices[begin:end]
        if own.tobytes() not in known:
            known[own.tobytes()] = tuple(names[index] for index in own)
        found.append(known[own.tobytes()])
    return found


def _row(record: Record) -> dict[str, Any]:
    return {
        **record._asdict(),
        "path": _whole(original_of(record)),
        "problems": list(map(_whole, record.problems)),
        "notes": list(map(_whole, record.notes)),
        "paths": [
            {"path": path.encode("utf-8", "surrogatepass"), **state._asdict()} for path, state in record.paths.items()
        ],
    }


def _record(row: dict[str, Any], files: tuple[str, ...]) -> Record:
    paths = {each.pop("path").decode("utf-8", "surrogatepass"): State(**each) for each in row.pop("paths")}
    return Record(**row, paths=paths, files=files)


def _whole(text: str) -> str:
    """Return a text with U+FFFD for each byte that is not UTF-8, as names of files can have."""
    return _SURROGATE.sub("\ufffd", text)


def _schema() -> Any:
    import pyarrow as pa

    def has(name: str, kind: pa.DataType, **unit: str) -> pa.Field:
        return pa.field(name, kind, nullable=False, metadata=unit or None)

    def many(kind: pa.DataType) -> pa.DataType:
        return pa.list_(has("element", kind))

    text, number = pa.string(), pa.int64()
    return pa.schema(
        [
            *(has(name, text) for name in ("log", "path", "vehicle", "date")),
            pa.field("firmware", text),
            pa.field("start", pa.timestamp("ns", "UTC")),
            pa.field("utc_offset", number, metadata={"unit": "ns"}),
            has("duration", pa.float64(), unit="s"),
            has("samples", number),
            has("problems", many(text)),
            has("notes", many(text)),
            has("date_from", text),
            has("digest", text),
            has("paths", many(pa.struct([has("path", pa.binary()), has("size", number), has("changed", number)]))),
            has("files", many(text)),
        ]
    )
