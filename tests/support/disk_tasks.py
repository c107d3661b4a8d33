"""Small runs of msggen that write, for the campaigns that kill them and let calls fail."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from support.catalogs import write_definitions
from support.commands import run
from support.disk_calls import hooked
from support.packages import committed, content, definition
from support.scratch import inside

OLD = {
    "msg/Rpm.msg": definition("Rpm"),
    "msg/EscReport.msg": definition("EscReport"),
    "msg/Wind.msg": definition("Wind"),
}
NEW = {
    "msg/Rpm.msg": f"{definition('Rpm')}uint8 newer\n",
    "msg/EscReport.msg": f"{definition('EscReport')}uint8 newer\n",
    "msg/DebugVect.msg": definition("DebugVect"),
}
VERSIONED = "msg/versioned/VehicleStatus.msg"
TEMPLATE = {"a.hpp.j2": "{{ message.name }}{% for field in message.fields %}{{ field.name }}\n{% endfor %}"}

TASKS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "build": ("build", "-q", "--px4", "new", "-o", "out"),
        "build anew": ("build", "-q", "--px4", "new", "-o", "fresh"),
        "sync": ("sync", "-q", "--px4", "new", "px4_msgs"),
        "sync anew": ("sync", "-q", "--px4", "new", "--create", "fresh"),
        "render": ("render", "-q", "--px4", "new", "--template", "a.hpp.j2", "-o", "rendered"),
        "bump": ("bump", "-q", "--px4", "tree", "--against", "HEAD", "VehicleStatus"),
    }
)
"""The arguments of each run. Its inputs are `new`, `tree` and `a.hpp.j2`, everything else is output."""

OUTPUTS = {
    "build": "out",
    "build anew": "fresh",
    "sync": "px4_msgs",
    "sync anew": "fresh",
    "render": "rendered",
    "bump": "tree",
}
"""The folder that each run changes."""

TEMPORARY = (".msggen-stage", ".msggen-new", ".tmp", ".new", ".old", ".msggen_cache")
"""Parts of the names of temporary files, and of the cache, which a run may leave out."""

State = dict[str, "bytes | str | None"]

KILLED = 9
"""The exit code of a process that is killed."""


class Ends(NamedTuple):
    """The output of a task before and after it ran, and the number of calls that it made."""

    before: State
    after: State


@cache
def start() -> Path:
    """Return the folder that the tasks start in, to be copied for each."""
    folder = Path(tempfile.mkdtemp())
    write_definitions(folder / "old", OLD)
    write_definitions(folder / "new", NEW)
    write_definitions(folder, TEMPLATE)
    committed(write_definitions(folder / "tree", {VERSIONED: definition("VehicleStatus"), **OLD}))
    write_definitions(folder / "tree", {VERSIONED: f"{definition('VehicleStatus')}uint8 newer\n"})
    with inside(folder):
        for arguments in (
            ("build", "-q", "--px4", "old", "-o", "out"),
            ("sync", "-q", "--px4", "old", "--create", "px4_msgs"),
            ("render", "-q", "--px4", "old", "--template", "a.hpp.j2", "-o", "rendered"),
        ):
            assert run(arguments).code == 0
    committed(folder / "px4_msgs")
    return folder


def copy_start(folder: Path) -> None:
    """Copy the folder that the tasks start in to `folder`."""
    shutil.copytree(start(), folder, symlinks=True)


@cache
def ends(task: str) -> Ends:
    """Return the output of a task before and after a run without errors."""
    folder = Path(tempfile.mkdtemp(), "work")
    copy_start(folder)
    with inside(folder):
        before = output(task)
        outcome = run(TASKS[task])
        assert outcome.code == 0, outcome
        after = output(task)
    shutil.rmtree(folder.parent)
    return Ends(before, after)


def output(task: str) -> State:
    """Return the files of the output of a task, without temporary ones."""
    return {name: data for name, data in content(Path(OUTPUTS[task])).items() if not is_temporary(name)}


def is_temporary(name: str) -> bool:
    """Whether a file is temporary, or in the cache."""
    return any(mark in part for part in Path(name).parts for mark in TEMPORARY)


def leftovers() -> list[str]:
    """Return the temporary files in the current folder."""
    names = [str(path) for path in Path().rglob("*") if ".git" not in path.parts and is_temporary(str(path))]
    return [name for name in names if ".msggen_cache" not in name]


def in_child(work: Callable[[], int]) -> int:
    """Run `work` in a process of its own, which ends without cleaning up, and return its exit code."""
    child = os.fork()
    if child == 0:
        code = 99
        try:
            code = work()
        finally:
            os._exit(code)
    try:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    except BaseException:
        os.kill(child, 9)
        raise


def killed_before(work: Callable[[], object], number: int) -> int:
    """Run `work` in a process of its own, which ends before this call that changes the disk. Return its exit code.

    That is `KILLED`, or 0 if there are not so many calls.
    """

    def counted() -> int:
        remaining = number

        def count(_: str) -> None:
            nonlocal remaining
            if remaining == 0:
                os._exit(KILLED)
            remaining -= 1

        with hooked(count):
            work()
        return 0

    return in_child(counted)
