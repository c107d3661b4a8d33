"""Many recordings as one data set: Parquet files by topic that engines read, made once each (docs/fleet.md).

A fleet is in a folder, or in an object store. `update` converts all recordings below a folder; `convert_batch` is the
work for a few of them, which any pool of processes can do. `update` adds small files, `compact` makes large ones of
them, and `files` lists those of a topic:

    fleet/<topic>/000012-9f3a5c01.parquet

The first columns of each, `Keys`, tell of which recording a row is. `fleet/_logs.parquet` has a row for each recording
that is done, for queries, and lists the files that have its rows.
"""

from __future__ import annotations

from msggen.exports.fleet.batch import Batch, Outcome, Task, convert_batch
from msggen.exports.fleet.fleet import Compacted, compact
from msggen.exports.fleet.layout import KEYS, UNKNOWN, Keys
from msggen.exports.fleet.run import Progress, Summary, update
from msggen.exports.fleet.storage import files

__all__ = [
    "KEYS",
    "UNKNOWN",
    "Batch",
    "Compacted",
    "Keys",
    "Outcome",
    "Progress",
    "Summary",
    "Task",
    "compact",
    "convert_batch",
    "files",
    "update",
]
