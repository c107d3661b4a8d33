"""Carries out a plan, all or nothing.

The new `msg` folder is built aside, with hard links to the files that stay, and swapped with the old one in a single
step; `srv` likewise. A new package is built beside its place and moved there. Where a system cannot swap folders,
files are replaced one by one, each whole.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

from msggen.disk.record import write_record
from msggen.sync.plan import SyncPlan

STAGE = ".msggen-stage"
"""Where a package is built aside: in the package, or with the name of a new one, beside it."""

_CANNOT_SWAP = {errno.EINVAL, errno.ENOSYS, errno.EXDEV, errno.EOPNOTSUPP, errno.EBUSY}
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def create_package(plan: SyncPlan) -> None:
    """Write a whole new package, which appears in one step. Raises OSError."""
    folder = plan.target.folder
    parent, base = os.path.split(folder)
    stage = os.path.join(parent, f".{base}{STAGE}")
    clear(stage)
    os.mkdir(stage)
    try:
        for name, data in {**plan.files, **plan.scaffold}.items():
            os.makedirs(os.path.dirname(os.path.join(stage, name)), exist_ok=True)
            _write(os.path.join(stage, name), data)
        write_record(stage, plan.record)
        if os.name == "nt" and os.path.isdir(folder):  # elsewhere an empty folder is replaced
            os.rmdir(folder)
        os.rename(stage, folder)
    finally:
        clear(stage)


def update_package(plan: SyncPlan) -> None:
    """Bring an existing package in step; where there is nothing to do, nothing is written.

    Before anything moves, the record names each file as it was and as it becomes: a run that is killed leaves files
    that the next one knows as msggen's. Raises OSError; the definitions are all as they were then, or all new.
    """
    folder = plan.target.folder
    stage = os.path.join(folder, STAGE)
    clear(stage)
    if plan.is_stale:
        os.mkdir(stage)
        try:
            for kind in plan.folders:
                _build(plan, kind, stage)
            for name, data in plan.scaffold.items():
                _write(os.path.join(stage, name), data)
            write_record(folder, plan.during)
            _move_into_place(plan, stage)
        finally:
            clear(stage)
    if plan.is_stale or plan.is_unfinished:
        write_record(folder, plan.record)


def clear(stage: str) -> None:
    """Remove what was built aside, by this run or by one that was killed."""
    if os.path.isdir(stage) and not os.path.islink(stage):
        import shutil

        for folder, _, _ in os.walk(stage):
            os.chmod(folder, 0o700)  # a folder of the user's may be read-only; these are copies of it
        shutil.rmtree(stage)


def _build(plan: SyncPlan, kind: str, stage: str) -> None:
    """Build the new folder `kind` in `stage`: what is written by this run, and links to all the rest."""
    current, built = os.path.join(plan.target.folder, kind), os.path.join(stage, kind)
    replaced = {name.removeprefix(f"{kind}/") for name in (*plan.changed, *plan.removed)}
    if os.path.isdir(current):
        _mirror(os.path.realpath(current), built, replaced)
    else:
        os.mkdir(built)
    for name in (*plan.added, *plan.changed):
        if name.startswith(f"{kind}/"):
            _write(os.path.join(stage, name), plan.files[name])
    for name in plan.changed:
        if name.startswith(f"{kind}/") and plan.before[name] is not None:
            os.chmod(os.path.join(stage, name), os.stat(os.path.join(plan.target.folder, name)).st_mode)


def _mirror(source: str, copy: str, without: set[str]) -> None:
    """Make `copy` the same as the folder `source`, without some of its files; they share what is in the others."""
    import shutil

    os.mkdir(copy)
    for entry in os.scandir(source):
        path = os.path.join(copy, entry.name)
        if entry.name in without:
            continue
        if entry.is_symlink():
            os.symlink(os.readlink(entry.path), path)
        elif entry.is_dir():
            _mirror(entry.path, path, set())
        else:
            _link(entry.path, path)
    shutil.copymode(source, copy)


def _link(source: str, path: str) -> None:
    try:
        os.link(source, path)
    except OSError:
        import shutil

        shutil.copy2(source, path)


def _move_into_place(plan: SyncPlan, stage: str) -> None:
    for kind in _swap(plan, stage):
        _replace_files(plan, kind, stage)
    for name in plan.scaffold:
        os.replace(os.path.join(stage, name), os.path.join(plan.target.folder, name))


def _swap(plan: SyncPlan, stage: str) -> list[str]:
    """Put the new folders in the place of the old ones, both or none; return those that the system cannot swap.

    Nothing is done between two swaps: a run that is killed right there leaves the second to the next run.
    """
    steps = {kind: _step(os.path.join(stage, kind), os.path.join(plan.target.folder, kind)) for kind in plan.folders}
    remaining = list(steps)
    try:
        for kind, step in steps.items():
            if _try(step):
                remaining.remove(kind)
    except BaseException:
        for kind in steps.keys() - remaining:
            steps[kind].undo()
        raise
    return remaining


class _FolderSwap(NamedTuple):
    """What changes a folder in one call, and what changes it back."""

    do: Callable[[], None]
    undo: Callable[[], None]


def _step(built: str, current: str) -> _FolderSwap:
    """Return what puts the folder `built` in the place of `current`; an empty one is not kept."""
    if not os.listdir(built):
        return _FolderSwap(partial(os.rename, current, f"{built}.old"), partial(os.rename, f"{built}.old", current))
    if not os.path.lexists(current):
        return _FolderSwap(partial(os.rename, built, current), partial(os.rename, current, built))
    swap = partial(_exchange, _renameat2(), os.fsencode(built), os.fsencode(os.path.realpath(current)))
    return _FolderSwap(swap, swap)


def _try(step: _FolderSwap) -> bool:
    """Take `step`; return False where the system cannot."""
    try:
        step.do()
    except OSError as error:
        if error.errno not in _CANNOT_SWAP:
            raise
        return False
    return True


def _exchange(renameat2: Any, one: bytes, other: bytes) -> None:
    """Swap two folders in a single step (renameat2(2)). Raises OSError."""
    if renameat2 is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if renameat2(_AT_FDCWD, one, _AT_FDCWD, other, _RENAME_EXCHANGE):
        import ctypes

        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), os.fsdecode(other))


def _renameat2() -> Any:
    """Return the C library's function; None on systems without it."""
    if sys.platform != "linux":
        return None
    import ctypes

    return getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)


def _replace_files(plan: SyncPlan, kind: str, stage: str) -> None:
    """Do without a swap: files one by one, first those that come, then those that go."""
    folder = plan.target.folder
    os.makedirs(os.path.join(folder, kind), exist_ok=True)
    for name in (*plan.added, *plan.changed):
        if name.startswith(f"{kind}/"):
            os.replace(os.path.join(stage, name), os.path.join(folder, name))
    for name in plan.removed:
        if name.startswith(f"{kind}/"):
            os.unlink(os.path.join(folder, name))
    with suppress(OSError):
        os.rmdir(os.path.join(folder, kind))


def _write(path: str, data: bytes) -> None:
    with open(path, "wb") as stream:
        stream.write(data)
