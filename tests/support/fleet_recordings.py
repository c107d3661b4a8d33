"""A folder of three small recordings for a fleet, and what there is in a fleet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from support.written import write_recording


def write_folder(root: Path, types: Any) -> Path:
    """Write a folder with three recordings, of which two have the same name. Return its path."""
    for number, name in enumerate(("a/flight.mcap", "b/flight.mcap", "b/2024-05-06_x.mcap")):
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_flight(path, types, number)
    return root


def write_flight(path: Path, types: Any, seed: int, *, gps: int = 0, count: int = 50) -> Path:
    """Write a recording of a few topics."""
    samples: list[tuple[str, float, Any]] = []
    for step in range(count):
        stamp = step * 10_000
        local = types.VehicleLocalPosition(timestamp=stamp, x=float(seed), z=float(-step))
        samples.append(("/fmu/out/vehicle_local_position_v1", step / 100, local))
        fix = types.SensorGps(timestamp=stamp, time_utc_usec=gps * (step > 5))
        samples.append(("/fmu/out/vehicle_gps_position", step / 100, fix))
    return write_recording(path, samples)


def parquet_in(fleet: Path) -> dict[str, int]:
    """Return the Parquet files of a fleet, with their times of change."""
    found = sorted(
        path for path in fleet.glob("[!_.]*/*.parquet") if not path.is_symlink() and not path.parent.is_symlink()
    )
    return {path.relative_to(fleet).as_posix(): path.stat().st_mtime_ns for path in found}


def rows_in(fleet: Path) -> int:
    """Return the number of rows in all Parquet files of a fleet."""
    return sum(pq.read_metadata(fleet / name).num_rows for name in parquet_in(fleet))


def rows_of(fleet: Path) -> dict[str, list[dict[str, Any]]]:
    """Return all rows of each topic of a fleet, the same for all files that can have them.

    Columns that a file lacks are None, and rows and columns have an order of their own.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for name in parquet_in(fleet):
        found.setdefault(name.partition("/")[0], []).extend(pq.ParquetFile(fleet / name).read().to_pylist())
    names = {topic: sorted({name for row in rows for name in row}) for topic, rows in found.items()}
    whole = {topic: [{name: row.get(name) for name in names[topic]} for row in rows] for topic, rows in found.items()}
    return {topic: sorted(rows, key=repr) for topic, rows in whole.items()}


def logs_in(fleet: Path) -> set[str]:
    """Return the names of the recordings whose rows a fleet has."""
    return {log for name in parquet_in(fleet) for log in pq.ParquetFile(fleet / name).read(["log"])["log"].to_pylist()}


def state_names(fleet: Path) -> list[str]:
    """Return the names of what a fleet has beside its data."""
    return sorted(path.name for path in (fleet / "_msggen").iterdir())
