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

import pyarrow.parquet as pq
import pytest

from msggen.base.diagnostics import InputError
from msggen.exports.fleet import compact, files, update
from support.disk_calls import hooked
from support.disk_tasks import KILLED, killed_before
from support.fleet_logs import write_small
from support.fleet_recordings import rows_of, state_names

pytestmark = [
    pytest.mark.slow,  # hundreds of processes
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform == "win32", reason="there is no fork"),
]

EVERY = pytest.mark.parametrize("step", [24, pytest.param(1, marks=pytest.mark.night)])
"""Every 24th call by day, each one by night; of writes, every 20th of these."""

Rows = Counter[tuple[str, str]]


def write(folder: Path, number: int, name: str) -> None:
    write_small(folder / "logs" / name, number)


def convert(folder: Path) -> None:
    update(str(folder / "logs"), str(folder / "fleet"))


def merge(folder: Path) -> None:
    compact(str(folder / "fleet"))


def nothing(folder: Path) -> None:
    write(folder, 0, "a.ulg")


def fleet_of_three(folder: Path) -> None:
    for number, name in enumerate(("a.ulg", "b.ulg", "c.ulg")):
        write(folder, number, name)
        convert(folder)


def fleet_with_changes(folder: Path) -> None:
    """One recording is new, one is changed, and one is a copy; of a further one, a file is missing."""
    fleet_of_three(folder)
    write(folder, 3, "d.ulg")
    write(folder, 4, "b.ulg")
    shutil.copy(folder / "logs" / "a.ulg", folder / "logs" / "copy.ulg")
    max((folder / "fleet" / "vehicle_status").iterdir()).unlink()


TASKS: dict[str, tuple[Callable[[Path], None], Callable[[Path], None]]] = {
    "new": (nothing, convert),
    "changed": (fleet_with_changes, convert),
    "compact": (fleet_of_three, merge),
}
"""What is there before a run, and the run."""


@cache
def start(task: str) -> Path:
    folder = Path(mkdtemp(), "work")
    folder.mkdir()
    TASKS[task][0](folder)
    return folder.rename(folder.with_name("saved"))


def begin(task: str) -> Path:
    """Return a folder with what is there before a task. It has the same path each time, as the list has paths."""
    folder = start(task).with_name("work")
    shutil.rmtree(folder, ignore_errors=True)
    return Path(shutil.copytree(start(task), folder))


def listed(fleet: Path) -> Rows:
    """Return how many rows each recording has in each topic, by the files of the list, each of which is whole."""
    found: Rows = Counter()
    if (fleet / "_logs.parquet").exists():
        for path in map(Path, files(str(fleet))):
            if path.exists() or path.parent.name != "vehicle_status":  # of which one is missing
                found.update((path.parent.name, log) for log in pq.ParquetFile(path).read(["log"])["log"].to_pylist())
    return found


def check(task: str, before: Rows, after: Rows, folder: Path, whole: object) -> None:
    """Check that each recording is there as before or as afterwards, and that the same run goes on."""
    found = listed(folder / "fleet")
    assert all(found[key] in {before[key], after[key]} for key in {*found, *before})
    names = Counter((topic, log.rpartition("-")[0]) for topic, log in found)
    assert not [each for each, count in names.items() if count > 1], "earlier and new rows"
    TASKS[task][1](folder)
    assert listed(folder / "fleet") == after
    assert rows_of(folder / "fleet") == whole
    assert state_names(folder / "fleet") in (["report.json"], [])


@EVERY
@pytest.mark.parametrize("task", TASKS)
def test_a_run_that_ends_at_any_call_loses_nothing(task: str, step: int) -> None:
    """It is killed, or the disk is full: one of these by day, and both by night."""
    folder = begin(task)
    before, names = listed(folder / "fleet"), list[str]()
    with hooked(names.append):
        TASKS[task][1](folder)
    after, whole = listed(folder / "fleet"), rows_of(folder / "fleet")
    writes = [number for number, name in enumerate(names) if name == "write"][::20]
    numbers = sorted([*(number for number, name in enumerate(names) if name != "write"), *writes])
    decisive = [number for number, name in enumerate(names) if name == "replace"][-1]
    chosen = sorted({*numbers[::step], decisive, decisive + 1})
    ways = [(number, index % 2 == 0) for index, number in enumerate(chosen)]
    failed = 0
    for number, is_killed in ways if step > 1 else [*ways, *((number, not way) for number, way in ways)]:
        begin(task)
        if is_killed:
            failed += killed_before(lambda: TASKS[task][1](folder), number) == KILLED
        else:
            failed += fills(lambda: TASKS[task][1](folder), number)
        check(task, before, after, folder, whole)
    assert failed > 3


def fills(run: Callable[[], None], number: int) -> bool:
    """Let the disk be full from a call on. Return whether the run has failed."""
    calls = 0

    def fill(name: str) -> None:
        nonlocal calls
        calls += 1
        if calls > number and name not in ("unlink", "rmdir", "remove"):  # one can still remove
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    try:
        with hooked(fill):
            run()
    except (OSError, InputError):
        return True
    return False


@EVERY
def test_the_next_action_goes_on_whatever_it_is(step: int) -> None:
    """A run of `update` finishes a compaction that was killed, and the other way round."""
    folder = begin("compact")
    whole = rows_of(folder / "fleet")
    for number in range(5, 100, 3 * step):
        folder = begin("compact")
        killed_before(lambda: merge(folder), number)  # noqa: B023 - called at once
        convert(folder)
        assert rows_of(folder / "fleet") == whole
        folder = begin("changed")
        killed_before(lambda: convert(folder), number)  # noqa: B023 - called at once
        merge(folder)
        assert sum(listed(folder / "fleet").values()) == sum(map(len, rows_of(folder / "fleet").values()))


def test_a_full_disk_names_the_file() -> None:
    folder = begin("compact")

    def fill(name: str) -> None:
        if name == "write":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with hooked(fill), pytest.raises(OSError, match="No space left on device") as caught:
        merge(folder)
    assert str(caught.value.filename).startswith(str(folder / "fleet" / "_msggen"))
