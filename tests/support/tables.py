"""Tables that were written, read with pyarrow."""

from __future__ import annotations

from typing import Any

import pyarrow as pa
from pyarrow import csv, ipc, parquet


def read_table(path: str, types: Any = None) -> Any:
    """Return a table (pyarrow.Table) of a file of any format. `types` are those of the columns of CSV."""
    if path.endswith(".parquet"):
        return parquet.read_table(path)
    if path.endswith(".arrow"):
        with pa.memory_map(path) as file:
            return ipc.open_file(file).read_all()
    return csv.read_csv(path, convert_options=csv.ConvertOptions(column_types=types))
