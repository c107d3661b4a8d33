"""The findings of logs: their cost beside reading all topics of one, and the cost of each of many in a pool."""

from __future__ import annotations

import os
import struct
import time
from pathlib import Path
from statistics import median

from msggen import recordings
from msggen.analysis.document import document_of, examined
from msggen.exports.fleet.examining import examine_all, work_in
from tables import Table

MOST = 2
"""How many times as long as reading all topics findings may take."""


def findings(path: str) -> None:
    """Find what a flight shows."""
    with recordings.open(path) as log:
        document_of(*examined(log))


def load(path: str) -> None:
    """Read all topics."""
    with recordings.open(path) as log:
        log.load()


def findings_table(paths: dict[str, str], rounds: int) -> Table:
    """Return the median CPU times of findings and of reading all topics, which take turns. The first one warms up."""
    rows = []
    for name, path in paths.items():
        times: dict[str, list[float]] = {"load": [], "findings": []}
        for number in range(rounds + 1):
            for key, read in (("load", load), ("findings", findings)):
                before = time.process_time()
                read(path)
                if number:
                    times[key].append((time.process_time() - before) * 1e3)
        base, found = median(times["load"]), median(times["findings"])
        size = os.path.getsize(path) / 1e6
        rows.append([name, f"{size:.1f}", f"{base:.1f}", f"{found:.1f}", f"{found / base:.2f}", f"{MOST}"])
    head = ["ULog", "MB", "all topics, CPU ms", "findings, CPU ms", "findings / all topics", "goal, at most"]
    return Table("findings", head, rows)


def pool_table(folder: str, log: str, counts: tuple[int, ...]) -> Table:
    """Return the time of the findings in some numbers of logs, each with one more text than `log`, in a pool."""
    rows, content, jobs = [], Path(log).read_bytes(), os.cpu_count() or 1
    for count in counts:
        logs = Path(folder, str(count))
        logs.mkdir()
        for number in range(count):
            text = f"log {number} of {count}".encode()
            message = struct.pack("<BQ", ord("6"), 10_000_000) + text
            (logs / f"{number}.ulg").write_bytes(content + struct.pack("<HB", len(message), ord("L")) + message)
        before = time.perf_counter()
        done = sum(1 for _ in examine_all(work_in(str(logs), []), jobs))
        seconds = time.perf_counter() - before
        rows.append([f"{done:,}", f"{seconds:.1f}", f"{seconds / done * 1e3:.1f}"])
        for path in logs.iterdir():
            path.unlink()
    return Table(
        f"findings in many logs of {len(content) / 1e6:.1f} MB, {jobs} processes", ["logs", "s", "ms a log"], rows
    )


def write_flight_log(path: str) -> None:
    """Write the log of a simulated flight."""
    from msggen.cli import main

    main(["sim", "--log", path, "--quiet"])
