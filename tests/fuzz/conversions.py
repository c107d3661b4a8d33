"""Damaged recordings for the actions of `msggen log`: convert, cut, merge, repair, report, info, show, and a fleet.

The exit code is 0, 1 or 2 as documented, errors have a code or are of usage, and the target is whole or missing.
Nothing else is in the folder, also no decompressed copy, and no recording changes.
"""

from __future__ import annotations

import bz2
import gzip
import importlib
import io
import json
import lzma
import os
import re
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import zstandard

from fuzz.payloads import targets
from msggen.exports.convert import TABLES
from msggen.exports.convert.names import FACT_TABLES, FINDINGS
from msggen.recordings.log import opening
from support.commands import Outcome, check_outcome, run
from support.databases import Stored, write_database
from support.flights import TEXTS, write_flight
from support.recordings import START, read_mcap
from support.scratch import remove, scratch_folder
from support.tables import read_table
from support.ulog import write_ulog

COUNT = 160

KINDS = (
    *("flight.mcap", "flight.ulg", "flight.db3", "old.db3", "bag"),
    *("flight.mcap.gz", "flight.ulg.xz", "old.db3.bz2", "flight.ulg.zst"),
)
STDIN = "-"
ACTIONS = (
    "convert {} -o made",
    *(f"convert {{}} --format {name} -o made" for name in TABLES[1:]),
    "convert {} -o made.mcap",
    "convert {} --format rosbag2 -o made",
    "convert {} --format rosbag2 --storage sqlite3 -o made",
    "convert {} --sql-names -o made",
    "convert {} *status* -o made.csv",
    "convert {} *status* --start 0.02 -o made",
    "cut {} --start 0.02 --stop 0.08 -o made.mcap",
    "cut {} *s* --stop 0.05 -o made.mcap",
    "merge {} other.mcap -o made.mcap",
    "repair {} -o made.mcap",
    "convert . -o made --jobs 1",
    f"convert {STDIN} -o made.mcap",
    f"info {STDIN}",
    "info {}",
    "info {} --verify --gaps",
    "show {} vehicle_status",
    "show {} --texts",
    "findings {}",
    f"findings {STDIN}",
    "report {} -o made.html",
    "report {} other.mcap -o made.html",
    "report other.mcap {} -o made.html",
    "compare {} other.mcap",
    "compare other.mcap {}",
    "compare {} {}",
    f"report {STDIN} -o made.html",
)
WITHOUT_JSON = ("report",)
"""The actions that print no JSON."""
NAMED = re.compile(r"([^\n]+: [A-Z]\d{3} |msggen log \w+: error: )[^\n]+\n")
"""How an error begins."""
COMPRESS: Mapping[str, Callable[[bytes], bytes]] = {
    ".gz": partial(gzip.compress, mtime=0),
    ".xz": lzma.compress,
    ".bz2": bz2.compress,
    ".zst": zstandard.ZstdCompressor(write_checksum=True).compress,
}
"""What makes a compressed file, by its suffix."""
_SAMPLES = 12
_LARGEST = 64


class Case(NamedTuple):
    """A recording of a kind of which a file is damaged, and what is done with it."""

    kind: str
    file: str
    action: str
    seed: int


def case(chance: Random) -> Case:
    kind = chance.choice(KINDS)
    return Case(kind, chance.choice(sorted(files_of(kind))), chance.choice(ACTIONS), chance.randrange(1 << 32))


def check(case: Case) -> None:
    files = {**files_of(case.kind), "other.mcap": files_of("flight.mcap")["flight.mcap"]}
    files[case.file] = damaged(Random(case.seed), files[case.file])  # noqa: S311 - no secret
    words = ["log", *case.action.replace("{}", case.kind).split()]
    if words[1] not in WITHOUT_JSON:
        words.append("--json")
    with scratch_folder() as folder, _given(files[case.file]), _temporary(folder.with_name(f"{folder.name}-temporary")):
        for name, data in files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
        outcome = run(words)
        check_outcome(outcome)
        if "-o" in words:
            target = folder / words[words.index("-o") + 1]
            if target.suffix == ".html":
                check_page(outcome, target)
            else:
                check_target(outcome, target, is_fleet=". -o" in case.action)
        elif outcome.code == 2:
            assert NAMED.match(outcome.stderr), outcome
        found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
        assert {name for name in found if not name.startswith("made")} == files.keys()
        assert not [name for name in os.listdir(folder) if name.startswith(".")]
        for name, data in files.items():
            assert (folder / name).read_bytes() == data, f"{name} has changed"


@contextmanager
def _given(data: bytes) -> Iterator[None]:
    """Let stdin have data."""
    before = sys.stdin
    sys.stdin = io.TextIOWrapper(io.BytesIO(data))
    try:
        yield
    finally:
        sys.stdin = before


@contextmanager
def _temporary(folder: Path) -> Iterator[None]:
    """Let temporary files be made in a folder, in which none may be left."""
    before = tempfile.tempdir
    folder.mkdir()
    tempfile.tempdir = str(folder)
    try:
        yield
        assert not os.listdir(folder), "temporary files stay"
    finally:
        tempfile.tempdir = before
        remove(folder)


def check_page(outcome: Outcome, target: Path) -> None:
    """Check a report by the exit code, which is 1 if something is missing."""
    if outcome.code == 2:
        assert NAMED.match(outcome.stderr), outcome
        assert not os.path.lexists(target), outcome
        return
    page = target.read_text()
    assert page.startswith("<!DOCTYPE html>")
    assert page.rstrip().endswith("</html>")
    assert bool(outcome.code) == ("<h3>Problems</h3>" in page), outcome


def check_target(outcome: Outcome, target: Path, *, is_fleet: bool) -> None:
    """Check the target of a run by its exit code and by what it prints."""
    document = json.loads(outcome.stdout)
    if outcome.code == 2:
        assert NAMED.match(outcome.stderr), outcome
        assert document["errors"], outcome
        assert not os.path.lexists(target), outcome
        return
    if is_fleet:
        names = sorted(path.name for path in (target / "_msggen").iterdir())
        assert names == ["report.json"]
        assert not [each for each in document["failed"] if "unexpected" in each["error"]], outcome
        topics = (
            path for path in target.iterdir() if path.name[0] != "_" and path.name not in {*FACT_TABLES, FINDINGS}
        )
        count = samples_in(path for topic in topics for path in topic.iterdir())
        assert (outcome.code == 1) == bool(document["failed"] or document["incomplete"]), outcome
        assert document["rows"] == count
        return
    assert target.exists() == bool(document["samples"]), outcome
    if target.exists():
        files = [target] if target.is_file() else files_in(target)
        assert document["samples"] == samples_in(files), outcome
    if "repair" in outcome.stdout or target.suffix == ".mcap":
        assert outcome.code == 0 or not document["samples"] or document["problems"], outcome
    else:
        assert (outcome.code == 0) == bool(document["samples"] and not document["problems"]), outcome


def files_in(folder: Path) -> Iterator[Path]:
    """Yield the files with samples in a folder that was written."""
    metadata = folder / "metadata.yaml"
    if metadata.exists():
        with opening.open(folder) as log:
            log.load()
            assert not [each for each in log.problems if each.offset is not None or "metadata" in each.text]
    yield from (path for path in folder.iterdir() if path != metadata)


def samples_in(files: Iterable[Path]) -> int:
    """Return how many samples files have. All are read, also those of what a ULog has beside its topics."""
    return sum(rows_of(path) * (path.stem not in FACT_TABLES) for path in files)


def rows_of(path: Path) -> int:
    """Return how many samples a file has, by readers other than ours. Each of them fails if the file is not whole."""
    if path.suffix[1:] in TABLES:
        return int(read_table(str(path)).num_rows)
    if path.suffix == ".db3":
        with closing(sqlite3.connect(path)) as base:
            assert base.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
            return int(base.execute("SELECT count(*) FROM messages WHERE length(data) >= 0").fetchone()[0])
    assert path.suffix == ".mcap"
    return len(read_mcap(path))


@cache
def files_of(kind: str) -> dict[str, bytes]:
    """Return the files of a whole recording by name."""
    suffix = os.path.splitext(kind)[1]
    if suffix in COMPRESS:
        ((name, data),) = files_of(kind.removesuffix(suffix)).items()
        return {f"{name}{suffix}": COMPRESS[suffix](data)}
    targets()  # imports the package
    px4_types: Any = importlib.import_module("px4_types")
    with scratch_folder() as folder:
        path = folder / kind
        if kind == "flight.ulg":
            write_ulog(path, count=30)
        elif kind == "flight.mcap":
            write_flight(path, px4_types, _SAMPLES)
        elif kind == "bag":
            write_flight(folder / "flight.mcap", px4_types, _SAMPLES)
            assert run(["log", "convert", "flight.mcap", "--format", "rosbag2", "-o", "bag"]).code in (0, 1)
        else:
            is_old = kind == "old.db3"
            info = px4_types.VehicleStatus.__msg__
            status = Stored(1, "/fmu/out/vehicle_status_v4", info.ros_type, "" if is_old else info.definition)
            topics = [status] if is_old else [status, Stored(2, *TEXTS)]
            rows = [
                (1, START + index * 10**7, px4_types.VehicleStatus(timestamp=index).encode()) for index in range(40)
            ]
            write_database(path, topics, rows, page_size=512, version=2 if is_old else 4)
        places = path.rglob("*") if path.is_dir() else [path]
        return {each.relative_to(folder).as_posix(): each.read_bytes() for each in places}


def damaged(chance: Random, data: bytes) -> bytes:
    """Return a file that is cut, overwritten, or has too much or too little in some places; sometimes as it is."""
    for _ in range(chance.choice((0, 1, 1, 1, 2, 4, 12))):
        start = chance.randrange(len(data) + 1)
        end = min(start + chance.choice((1, 1, 4, 8, _LARGEST, 2000)), len(data))
        size = end - start
        part = chance.choice(
            (
                b"",
                bytes(size),
                b"\xff" * size,
                chance.randbytes(size),
                data[start:end] * 2,
                bytes(byte ^ 1 << chance.randrange(8) for byte in data[start:end][:8]) + data[start:end][8:],
            )
        )
        data = data[:start] if chance.random() < 0.1 else data[:start] + part + data[end:]
    return data
