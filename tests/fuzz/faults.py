"""Commands in which one call of the disk fails: opening, writing, renaming, linking, removing, a full disk.

The command exits with 2 and a message, or with 0 if it can do without the call. No file is torn, no temporary file
stays, and the next run finishes.
"""

from __future__ import annotations

import errno
import os
from functools import cache
from random import Random
from typing import NamedTuple

from support.commands import check_outcome, run
from support.disk_calls import hooked
from support.disk_tasks import TASKS, copy_start, ends, leftovers, output
from support.packages import content
from support.scratch import inside, scratch_folder

COUNT = 80

ERRORS = (errno.ENOSPC, errno.EIO, errno.EACCES, errno.EROFS, errno.EDQUOT, errno.EPERM, errno.EINTR, errno.EXDEV)


REMOVING = ("unlink", "remove", "rmdir", "chmod")
"""Calls that remove temporary files. If one fails, the next run removes them."""


class Case(NamedTuple):
    """A call, by its number among those that the task makes, and the errors from this call on or of it alone."""

    task: str
    call: float
    error: int
    lasts: bool


def case(chance: Random) -> Case:
    return Case(chance.choice(list(TASKS)), chance.random(), chance.choice(ERRORS), chance.random() < 0.3)


def check(case: Case) -> None:
    before, after = ends(case.task)
    number = int(case.call * calls_of(case.task))
    with scratch_folder() as folder:
        copy_start(folder / "work")
        with inside(folder / "work"):
            inputs = content(folder / "work" / "new")
            calls: list[str] = []

            def fail(name: str) -> None:
                calls.append(name)
                if len(calls) == number + 1 or (case.lasts and len(calls) > number):
                    raise OSError(case.error, os.strerror(case.error), name)

            with hooked(fail):
                outcome = run(TASKS[case.task])
            check_outcome(outcome)
            assert outcome.code in (0, 2), outcome
            found = output(case.task)
            for name, data in found.items():
                assert data in (before.get(name), after.get(name)) or name.endswith(".msggen.json"), f"{name} is torn"
            assert outcome.code != 0 or found == after, "it claims to be done"
            if not case.lasts and calls[number] not in REMOVING:
                assert not leftovers(), leftovers()
            outcome = run(TASKS[case.task])
            assert outcome.code == 0, outcome
            assert output(case.task) == after
            assert not leftovers(), leftovers()
            assert content(folder / "work" / "new") == inputs


@cache
def calls_of(task: str) -> int:
    """Return the number of calls that a task makes."""
    names: list[str] = []
    with scratch_folder() as folder:
        copy_start(folder / "work")
        with inside(folder / "work"), hooked(names.append):
            assert run(TASKS[task]).code == 0
    return len(names)
