"""Logs in the form of PX4's, with many topics of few samples each: reading all topics side by side with pyulog."""

from __future__ import annotations

import importlib
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

from flight import START
from tables import NONE, Table

HEAD = ["ULog", "MB", "arrays, CPU ms", "columns, CPU ms", "pyulog, CPU ms", "pyulog / arrays", "goal"]
TOPICS = 80
PARAMETERS = 900
_SMALL = 1_000_000
"""The bytes from which on a process with msggen is to be as fast as one with pyulog."""
_LARGE = 3_000_000
"""The bytes from which on the higher goal applies."""
Reader = Callable[[str], None]


def write_vehicle_log(path: str, samples: int, seed: int = 4) -> None:
    """Write a log of `TOPICS` topics with random values, and as many parameters as PX4 has."""
    from support.ulog import UlogWriter, content_of, formats_of, size_of, snake

    package: Any = importlib.import_module("px4_types")
    infos = [getattr(package, name).__msg__ for name in package.msg.__all__]
    infos = [info for info in infos if info.definition.count("uint64 timestamp")][:TOPICS]
    writer = UlogWriter()
    formats: dict[str, str] = {}
    for info in infos:
        formats |= formats_of(info.ros_type, info.definition)
    for name, fields in formats.items():
        writer.format(name, fields)
    for number in range(PARAMETERS):
        writer.parameter(f"PARAMETER_{number}", number / 7)
    names = [snake(info.ros_type.rpartition("/")[2]) for info in infos]
    for number, name in enumerate(names):
        writer.subscribe(number, name)
    sizes = [size_of(formats, name, with_end=False) for name in names]
    random = Random(seed)  # noqa: S311 - no secret
    for index in range(samples):
        number = index % len(names)
        writer.sample(number, content_of(random, sizes[number], START + index * 100))
    writer.write(Path(path))


def ulog_table(paths: dict[str, str], arrays: Reader, columns: Reader, pyulog: Reader, rounds: int) -> Table:
    """Return the median CPU times of reading all topics of logs. Readers take turns; the first one does not count."""
    rows = []
    for name, path in paths.items():
        times = [_median_ms(each) for each in _turns([arrays, columns, pyulog], path, rounds)]
        size = Path(path).stat().st_size
        ratio = f"{times[2] / times[0]:.1f}" if times[2] and times[0] else NONE
        cells = [NONE if each is None else f"{each:.1f}" for each in times]
        rows.append([name, f"{size / 1e6:.1f}", *cells, ratio, "5" if size >= _LARGE else "3"])
    return Table("ULogs with many topics", HEAD, rows, notes=["goal: pyulog / arrays is at least this"])


FIRST = {
    "msggen": "import sys\nfrom msggen import recordings\nwith recordings.open(sys.argv[1]) as log: log.load()",
    "pyulog": "import sys\nfrom pyulog import ULog\nULog(sys.argv[1])",
    "numpy": "import numpy",
}
"""Programs that read all topics of a log, and what both import."""


def first_table(paths: dict[str, str], rounds: int) -> Table:
    """Return the least CPU times of whole processes that read a log once. Programs take turns."""
    rows = []
    for name, path in paths.items():
        least = dict.fromkeys(FIRST, float("inf"))
        for _ in range(rounds):
            for program, code in FIRST.items():
                least[program] = min(least[program], _process_seconds(code, path))
        own, other, numpy = least.values()
        ratio = f"{own / other:.2f}" if other < float("inf") else NONE
        size = Path(path).stat().st_size
        cells = [f"{each * 1e3:.0f}" if each < float("inf") else NONE for each in (own, other, numpy)]
        rows.append([name, f"{size / 1e6:.1f}", *cells, ratio, "1.0" if size >= _SMALL else "1.3"])
    head = ["ULog", "MB", "msggen, CPU ms", "pyulog, CPU ms", "import numpy", "msggen / pyulog", "goal"]
    return Table("whole processes that read one ULog", head, rows, notes=["goal: msggen / pyulog is at most this"])


def _process_seconds(code: str, path: str) -> float:
    """Return the CPU time in s of a process that runs a program, infinity if it fails: a package is missing."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-c", code, path], check=False, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return float("inf") if done.returncode else seconds


def _turns(readers: list[Reader], path: str, rounds: int) -> list[list[float]]:
    """Return the CPU times in s of readers that take turns, none for one that is not installed."""
    found: list[list[float]] = [[] for _ in readers]
    for number in range(rounds + 1):
        for read, times in zip(readers, found, strict=True):
            with suppress(ModuleNotFoundError):
                before = time.process_time()
                read(path)
                if number:
                    times.append(time.process_time() - before)
    return found


def _median_ms(times: list[float]) -> float | None:
    return median(times) * 1e3 if times else None
