"""Tests of runs that are killed, or run out of disk, at each of their calls that change the disk."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

import pyarrow.parquet as pq
import pytest

from msggen.base.diagnostics import InputError
from msggen.recordings.fleet import compact, update
from support.disk_calls import hooked
from support.disk_tasks import KILLED, killed_before
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import parquet_in, rows_of, state_names
from support.fleet_version3 import write_version3

pytestmark = [
    pytest.mark.slow,  # hundreds of processes
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform == "win32", reason="there is no fork"),
]

SOME = 12
"""How many moments each run tries at least."""
KEPT = ["changes", "layout.json", "ledger.jsonl", "report.json"]

Rows = Counter[tuple[str, str]]


class Task(NamedTuple):
    """A run, and what is there before it."""

    prepare: Callable[[Path], None]
    run: Callable[[Path], None]


def write(folder: Path, number: int, name: str) -> None:
    """Write a small recording."""
    (folder / "logs").mkdir(exist_ok=True)
    flight(number, VEHICLES[number % 3], 0, is_new=number > 1).write(folder / "logs" / name)


def several_runs(folder: Path) -> None:
    for number, name in enumerate(("a.ulg", "b.ulg", "c.ulg")):
        write(folder, number, name)
        convert(folder)


def then_changes(folder: Path) -> None:
    """One recording is new, one is changed, and one is a copy; of a further one, a file is missing."""
    several_runs(folder)
    write(folder, 3, "d.ulg")
    write(folder, 4, "b.ulg")
    shutil.copy(folder / "logs" / "a.ulg", folder / "logs" / "copy.ulg")
    max((folder / "fleet" / "vehicle_status").iterdir()).unlink()


def old_fleet(folder: Path) -> None:
    for number, name in enumerate(("a.ulg", "b.ulg")):
        write(folder, number, name)
    write_version3(folder / "logs", folder / "fleet")
    write(folder, 3, "d.ulg")


def merge(folder: Path) -> None:
    compact(str(folder / "fleet"))


def convert(folder: Path) -> None:
    update(str(folder / "logs"), str(folder / "fleet"))


TASKS = {
    "new": Task(lambda folder: write(folder, 0, "a.ulg"), convert),
    "changed": Task(then_changes, convert),
    "compact": Task(several_runs, merge),
    "version 3": Task(old_fleet, convert),
}


@cache
def start(task: str) -> Path:
    folder = Path(mkdtemp())
    TASKS[task].prepare(folder)
    return folder


@pytest.fixture(params=TASKS)
def task(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def copy_of(task: str, folder: Path) -> Path:
    """Return a copy of what is there before a task. It has the same path each time, as the ledger has the paths."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(start(task), folder)
    for path in sorted((folder / "fleet").rglob("*.json*")) if (folder / "fleet").exists() else []:
        path.write_text(path.read_text().replace(str(start(task)), str(folder)))
    return folder


def counts(fleet: Path) -> Rows:
    """Return how many rows each recording has in each topic, as an engine sees them, also in folders of version 3."""
    found: Rows = Counter()
    for path in fleet.glob("[!_.]*/**/*.parquet") if fleet.exists() else ():
        topic, name = path.relative_to(fleet).parts[0], path.parts
        logs = [part[4:] for part in name if part.startswith("log=")]
        rows = logs * pq.read_metadata(path).num_rows or pq.ParquetFile(path).read(["log"])["log"].to_pylist()
        found.update((topic, log) for log in rows)
    return found


def by_name(rows: Rows) -> dict[tuple[str, str], list[int]]:
    """Return the numbers of rows by topic and name of the recording, which is the same for all its contents."""
    found: dict[tuple[str, str], list[int]] = {}
    for (topic, log), count in sorted(rows.items()):
        found.setdefault((topic, log.rpartition("-")[0]), []).append(count)
    return found


def check_visible(found: Rows, before: Rows, after: Rows) -> None:
    """Check that each recording is there as before or as afterwards in each topic, never twice, and never in part."""
    for key, several in by_name(found).items():
        assert len(several) == 1, f"{key}: earlier and new rows"
    for key in found.keys() | before.keys():
        topic, name = key[0], key[1].rpartition("-")[0]
        allowed = {before[key], after[key]}
        assert found[key] in allowed, f"{topic}, {name}: {found[key]} rows, expected one of {allowed}"


def moments(task: str, folder: Path, *, all_of_them: bool) -> list[int]:
    """Return the numbers of calls that change the disk, of a run of a task: all but most writes, or some of them."""
    copy_of(task, folder)
    names: list[str] = []
    with hooked(names.append):
        TASKS[task].run(folder)
    writes = [number for number, name in enumerate(names) if name == "write"]
    others = [number for number, name in enumerate(names) if name != "write"]
    chosen = sorted([*others, *writes[::20]])
    if all_of_them:
        return chosen
    decisive = [number for number, name in enumerate(names) if name == "_exchange"]
    return sorted({*chosen[:: max(len(chosen) // SOME, 1)], *decisive, *(number + 1 for number in decisive)})


def kill(task: str, folder: Path, number: int) -> None:
    """Run a task, and kill it before a call."""
    copy_of(task, folder)
    assert killed_before(lambda: TASKS[task].run(folder), number) in (0, KILLED)


EVERY = pytest.mark.parametrize("extent", ["some", pytest.param("all", marks=pytest.mark.night)])


@EVERY
def test_a_kill_at_any_call_loses_nothing(task: str, extent: str, tmp_path: Path) -> None:
    folder = copy_of(task, tmp_path / "work")
    before = counts(folder / "fleet")
    TASKS[task].run(folder)
    after, whole = counts(folder / "fleet"), rows_of(folder / "fleet")
    for number in moments(task, folder, all_of_them=extent == "all"):
        kill(task, folder, number)
        check_visible(counts(folder / "fleet"), before, after)
        TASKS[task].run(folder)
        assert counts(folder / "fleet") == after, f"call {number}"
        assert rows_of(folder / "fleet") == whole, f"call {number}"
        assert state_names(folder / "fleet") == KEPT
        assert not os.listdir(folder / "fleet" / "_msggen" / "changes")


@EVERY
def test_a_full_disk_at_any_call_loses_nothing(task: str, extent: str, tmp_path: Path) -> None:
    folder = copy_of(task, tmp_path / "work")
    before = counts(folder / "fleet")
    TASKS[task].run(folder)
    after = counts(folder / "fleet")
    failed = 0
    for number in moments(task, folder, all_of_them=extent == "all"):
        copy_of(task, folder)
        calls = 0

        def fill(name: str, number: int = number) -> None:
            nonlocal calls
            calls += 1
            if calls > number and name not in ("unlink", "rmdir", "remove"):  # one can still remove
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        try:
            with hooked(fill):
                TASKS[task].run(folder)
        except (OSError, InputError):
            failed += 1
        check_visible(counts(folder / "fleet"), before, after)
        TASKS[task].run(folder)
        assert counts(folder / "fleet") == after, f"call {number}"
        assert state_names(folder / "fleet") == KEPT
    assert failed > 3


@EVERY
def test_the_next_action_goes_on_whatever_it_is(extent: str, tmp_path: Path) -> None:
    """A run of `update` finishes a compaction that was killed, and the other way round."""
    folder = copy_of("compact", tmp_path / "work")
    whole = rows_of(folder / "fleet")
    for number in moments("compact", folder, all_of_them=extent == "all"):
        kill("compact", folder, number)
        convert(folder)
        assert rows_of(folder / "fleet") == whole
    for number in moments("changed", folder, all_of_them=extent == "all"):
        kill("changed", folder, number)
        compact(str(folder / "fleet"))
        assert all(len(each) == 1 for each in by_name(counts(folder / "fleet")).values())
        convert(folder)
        assert len(parquet_in(folder / "fleet")) >= 5


def test_full_disk_names_the_file(tmp_path: Path) -> None:
    folder = copy_of("compact", tmp_path / "work")

    def fill(name: str) -> None:
        if name == "write":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with hooked(fill), pytest.raises(OSError, match="No space left on device") as caught:
        compact(str(folder / "fleet"))
    assert str(caught.value.filename).startswith(str(folder / "fleet" / "_msggen"))
