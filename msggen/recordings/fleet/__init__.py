"""Many recordings as one data set: Parquet files in folders that engines understand, made once each (docs/fleet.md).

`update` converts all recordings below a folder; `convert_one` is the work for one of them, which any pool of processes
can do. The files of a recording are below

    fleet/<topic>/vehicle=<id>/date=<day>/log=<name>/namespace=<name>/instance=<number>/<topic>.parquet

`fleet/_msggen/logs/` has a record of each recording that is done, and `fleet/_logs.parquet` a row for queries.
"""

from __future__ import annotations

from msggen.recordings.fleet.layout import KEYS, UNKNOWN
from msggen.recordings.fleet.run import Progress, Summary, update
from msggen.recordings.fleet.single import Outcome, Task, convert_one

__all__ = ["KEYS", "UNKNOWN", "Outcome", "Progress", "Summary", "Task", "convert_one", "update"]
