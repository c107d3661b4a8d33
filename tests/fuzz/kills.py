"""Commands that are killed before a call that changes the disk, in the middle of a write, or at a random moment.

The output is as before the command or as after it, as a whole, and the next run finishes.
"""

from __future__ import annotations

import multiprocessing
import sys
import time
from functools import cache
from random import Random
from typing import NamedTuple

from fuzz.faults import calls_of
from support.commands import run
from support.disk_tasks import KILLED, TASKS, State, copy_start, ends, in_child, killed_before, leftovers, output
from support.scratch import inside, scratch_folder

COUNT = 50

WHOLE = ("build", "build anew", "sync", "sync anew")
"""Tasks whose output is never a mixture. `render` and `bump` change one file after the other."""


class Case(NamedTuple):
    """A moment of a task, as a part of its calls or of its time."""

    task: str
    moment: float
    is_call: bool


def case(chance: Random) -> Case:
    return Case(chance.choice(list(TASKS)), chance.random(), chance.random() < 0.8)


def check(case: Case) -> None:
    before, after = ends(case.task)
    old, new = (files_of(case.task, state) for state in (before, after))
    with scratch_folder() as folder:
        copy_start(folder / "work")
        with inside(folder / "work"):
            if case.is_call:
                _kill_at_call(case.task, int(case.moment * calls_of(case.task)))
            else:
                _kill_at_time(case.task, case.moment)
            found = files_of(case.task, output(case.task))
            if case.task in WHOLE and sys.platform == "linux":
                assert found in (old, new), _difference(found, old, new)
            for name, data in found.items():
                assert data in (old.get(name), new.get(name)), f"{name} is torn"
            outcome = run(TASKS[case.task])
            assert outcome.code == 0, outcome
            assert output(case.task) == after
            assert not leftovers(), leftovers()


def files_of(task: str, state: State) -> State:
    """Return the files of a package that change together: of a ROS package, those that README.md is not among.

    The record is left out, because it lists the old and the new files for a time.
    """
    files = {name: data for name, data in state.items() if data is not None and not name.endswith(".msggen.json")}
    return {name: data for name, data in files.items() if task != "sync" or name.startswith(("msg/", "srv/"))}


def _difference(found: State, before: State, after: State) -> str:
    old = [name for name in found if found[name] != after.get(name)]
    new = [name for name in found if found[name] != before.get(name)]
    return f"a mixture: old {old}, new {new}, missing {sorted((before.keys() & after.keys()) - found.keys())}"


def _kill_at_call(task: str, number: int) -> None:
    assert killed_before(lambda: run(TASKS[task]), number) in (0, KILLED)


@cache
def duration_of(task: str) -> float:
    """Return the time that a task takes, in seconds."""
    with scratch_folder() as folder:
        copy_start(folder / "work")
        with inside(folder / "work"):
            started = time.perf_counter()
            in_child(lambda: int(str(run(TASKS[task]).code)))
            return time.perf_counter() - started


def _kill_at_time(task: str, part: float) -> None:
    longest = duration_of(task)
    process = multiprocessing.get_context("fork").Process(target=run, args=(TASKS[task],))
    process.start()
    process.join(part * longest)
    process.kill()
    process.join()
