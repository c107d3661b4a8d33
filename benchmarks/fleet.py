"""Measure data sets of many recordings: what they take on the disk, how long queries take, and how the costs grow.

    python benchmarks/fleet.py             about ten minutes; docs/fleet.md shows the tables
    python benchmarks/fleet.py --quick     checks in a few seconds that it works
    python benchmarks/fleet.py --logs DIR  takes the recordings below this folder, in place of generated ones

The generated logs have 80 topics of few samples each, as PX4's. Those whose costs are followed up to 10,000 are tiny,
with three topics: what grows is the work per recording, not per sample. Needs the packages of the extra
`test`, for DuckDB.
"""

from __future__ import annotations

import argparse
import os
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import log
from pathlib import Path
from typing import Any

from flight import START
from msggen.exports.fleet import compact, files, update
from msggen.exports.fleet.records import TABLE, Listed, decoded
from msggen.exports.fleet.run import pool_of
from msggen.exports.fleet.storage import Disk
from tables import Table
from ulogs import write_vehicle_log

LOGS, SAMPLES = 300, 5000
STEPS = (1_000, 3_000, 10_000)
RUNS = 10
"""How many runs add the logs of a step."""
TOPICS = ("battery_status", "vehicle_status", "wind")
QUERIES = {
    "rows of each recording": "select log, count(*) from {topic} group by log",
    "mean, minimum and maximum of a column": "select avg({column}), min({column}), max({column}) from {topic}",
    "one recording": "select * from {topic} where log = '{log}'",
}
STEEPEST = 1.3
"""The power of the number of recordings from which a cost counts as not linear."""


def main() -> int:
    """Measure, print the tables, and return 1 if a cost is not linear."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few and small logs")
    parser.add_argument("--logs", metavar="DIR", help="folder of recordings, in place of generated ones")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        size_table(Path(folder), options.logs, quick=options.quick).print()
    with tempfile.TemporaryDirectory() as folder:
        steps = (20, 60) if options.quick else STEPS
        found = list(growth(Path(folder), steps))
        growth_table(found).print()
    return int(not options.quick and any(power(found, name) > STEEPEST for name in COSTS))


# on the disk


def size_table(folder: Path, logs: str | None, *, quick: bool) -> Table:
    """Return what a fleet takes on the disk, and how long queries take, before and after a compaction."""
    if logs is None:
        logs = str(folder / "logs")
        os.mkdir(logs)
        for number in range(6 if quick else LOGS):
            write_vehicle_log(f"{logs}/{number}.ulg", 200 if quick else SAMPLES, seed=number)
    fleet = str(folder / "fleet")
    seconds, summary = timed(lambda: update(logs, fleet, pool=pool_of(os.cpu_count() or 1)))
    rows = [size_row(fleet, f"converted in {seconds:.1f} s")]
    seconds, _ = timed(lambda: compact(fleet))
    rows.append(size_row(fleet, f"compacted in {seconds:.1f} s"))
    head = ["", "files", "content, MB", "on the disk, MB", "disk / content", *(f"{name}, ms" for name in QUERIES)]
    return Table(f"{len(summary.records)} recordings, {summary.document()['rows']:,} samples", head, rows)


def size_row(fleet: str, name: str) -> list[str]:
    """Return the files of a fleet, the bytes of its column chunks and those on the disk, and the times of queries."""
    paths = [path for path in Path(fleet).rglob("*.parquet") if path.parent != Path(fleet)]
    content = sum(content_of(str(path)) for path in paths)
    disk = sum(os.stat(os.path.join(place, name)).st_blocks * 512 for place, names, files in os.walk(fleet)
               for name in (*names, *files))  # fmt: skip
    queries = [f"{1e3 * each:.0f}" for each in query_times(max(paths, key=lambda path: path.stat().st_size))]
    return [name, f"{len(paths):,}", f"{content / 1e6:.1f}", f"{disk / 1e6:.1f}", f"{disk / content:.2f}", *queries]


def content_of(path: str) -> int:
    """Return the bytes of the column chunks of a file."""
    from pyarrow import parquet

    metadata = parquet.read_metadata(path)
    groups = [metadata.row_group(index) for index in range(metadata.num_row_groups)]
    return sum(group.column(index).total_compressed_size for group in groups for index in range(group.num_columns))


def query_times(largest: Path) -> Iterator[float]:
    """Yield the best of some times of each query, in the topic of the largest file."""
    import duckdb
    from pyarrow import parquet

    topic = f"read_parquet('{largest.parent}/*.parquet', union_by_name = true)"
    schema = parquet.read_schema(largest)
    column = next(field.name for field in schema if str(field.type) in {"float", "double"})
    database = duckdb.connect()
    name = database.execute(f"select min(log) from {topic}").fetchall()[0][0]  # noqa: S608 - of this program
    for query in QUERIES.values():
        text = query.format(topic=topic, column=f'"{column}"', log=name)
        yield min(timed(partial(database.execute, text))[0] for _ in range(5))


# growth


COSTS = {
    "list, kB": "list",
    "read the list, ms": "read",
    "list the files, ms": "listing",
    "a run that finds nothing new, ms": "again",
    "compaction, ms": "compaction",
}


def growth(folder: Path, steps: Sequence[int]) -> Iterator[dict[str, float]]:
    """Add tiny recordings in runs, and yield the costs at each step: times of the processor in s, sizes in bytes."""
    logs, fleet = folder / "logs", str(folder / "fleet")
    done = 0
    for step in steps:
        for run in range(RUNS):
            end = done + (step - done) * (run + 1) // RUNS
            for number in range(done, end):
                write_tiny(logs / f"{number // 100:04}" / f"{number:06}.ulg", number)
            done = end
            update(str(logs), fleet)
        found: dict[str, float] = {"logs": done, "files": len(files(fleet))}
        found["compaction"] = spent(lambda: compact(fleet))
        found["files after"] = len(files(fleet))
        found["list"] = os.path.getsize(f"{fleet}/{TABLE}")
        found["read"] = spent(lambda: read(fleet))
        found["listing"] = spent(lambda: Disk(fleet).names())
        found["again"] = spent(lambda: update(str(logs), fleet))
        yield found


def growth_table(found: Sequence[dict[str, float]]) -> Table:
    """Return the costs, and by which power of the number of recordings they grow."""
    scale = {name: 1e-3 if name.endswith("kB") else 1e3 for name in COSTS}
    head = ["recordings", "files before and after", *COSTS]
    rows = [
        [f"{each['logs']:,.0f}", f"{each['files']:.0f}, {each['files after']:.0f}",
         *(f"{each[key] * scale[name]:,.0f}" for name, key in COSTS.items())]
        for each in found
    ]  # fmt: skip
    powers = ["grows with the power", "", *(f"{power(found, name):.2f}" for name in COSTS)]
    return Table("growth of a fleet", head, rows, [powers], ["times of the processor"])


def power(found: Sequence[dict[str, float]], name: str) -> float:
    """Return the power of the number of recordings by which a cost grows, from the first step to the last."""
    first, last = found[0], found[-1]
    key = COSTS[name]
    return log(max(last[key], 1e-9) / max(first[key], 1e-9)) / log(last["logs"] / first["logs"])


def read(fleet: str) -> Listed:
    """Read the list of a fleet, as each run does."""
    return decoded(Path(fleet, TABLE).read_bytes())


def write_tiny(path: Path, number: int) -> None:
    """Write a log of three topics with five samples each."""
    from support.ulog import UlogWriter

    writer = UlogWriter()
    for topic in TOPICS:
        writer.format(topic, "uint64_t timestamp;float value")
    vehicle = f"{number % 50:026}".encode()
    writer.information(f"char[{len(vehicle)}] sys_uuid", vehicle)
    for index, topic in enumerate(TOPICS):
        writer.subscribe(index, topic)
    for sample in range(15):
        writer.sample(sample % 3, struct.pack("<Qf", START + sample * 1000, number + sample / 7))
    path.parent.mkdir(parents=True, exist_ok=True)
    writer.write(path)


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the time that a call takes in s, and its result."""
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result


def spent(call: Callable[[], Any]) -> float:
    """Return the time of the processor that a call takes in s."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


if __name__ == "__main__":
    sys.exit(main())
