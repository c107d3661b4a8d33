"""The table of the recordings of a fleet, which queries join with any topic on `log`."""

from __future__ import annotations

import re
from io import BytesIO
from typing import TYPE_CHECKING, Any

from msggen.recordings.fleet.records import original_of

if TYPE_CHECKING:
    from msggen.recordings.fleet.ledger import Ledger
    from msggen.recordings.fleet.records import Record

TABLE = "_logs.parquet"
"""The table, beside the folders of the topics. Engines that read a whole folder skip names with an underscore."""
_SURROGATE = re.compile("[\ud800-\udfff]")


def write_table(ledger: Ledger) -> None:
    """Write the table of all recordings that a fleet has, unless it is there. Raises OSError."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = [_row(record) for record in sorted(ledger.records.values(), key=lambda record: record.log)]
    stream = BytesIO()
    parquet.write_table(pa.Table.from_pylist(rows, _schema()), stream, compression="zstd")
    ledger.folder.write(f"/{TABLE}", stream.getvalue())


def _row(record: Record) -> dict[str, Any]:
    return {
        "log": _whole(record.log),
        "path": _whole(original_of(record)),
        **{key: _whole(value) for key, value in record.values.items()},
        "firmware": _whole(record.firmware) or None,
        "start": record.start,
        "utc_offset": record.utc_offset,
        "duration": record.duration,
        "samples": record.rows,
        "problems": list(map(_whole, record.problems)),
    }


def _whole(text: str) -> str:
    """Return a text with U+FFFD for each byte that is not UTF-8, as names of files can have."""
    return _SURROGATE.sub("\ufffd", text)


def _schema() -> Any:
    import pyarrow as pa

    return pa.schema(
        [
            pa.field("log", pa.string()),
            pa.field("path", pa.string()),
            pa.field("vehicle", pa.string()),
            pa.field("date", pa.string()),
            pa.field("firmware", pa.string()),
            pa.field("start", pa.timestamp("ns", "UTC")),
            pa.field("utc_offset", pa.int64(), metadata={"unit": "ns"}),
            pa.field("duration", pa.float64(), metadata={"unit": "s"}),
            pa.field("samples", pa.int64()),
            pa.field("problems", pa.list_(pa.string())),
        ]
    )
