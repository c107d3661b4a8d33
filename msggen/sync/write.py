"""The writing of a plan: all changes are made, or none.

The new folders `msg` and `srv` are built in a staging folder, and each is swapped with the old one in a single step. A
new package is built next to its place and then renamed. On systems that cannot swap folders, files are replaced one by
one.
"""

from __future__ import annotations

import os
from contextlib import suppress

from msggen.disk.record import write_record
from msggen.disk.staging import STAGE, clear, staging_folder, write_file
from msggen.disk.swap import mirror, swap_folders
from msggen.sync.plan import SyncPlan


def create_package(plan: SyncPlan) -> None:
    """Write a whole new package, which appears in one step. Raises OSError."""
    folder = plan.target.folder
    parent, base = os.path.split(folder)
    stage = os.path.join(parent, f".{base}{STAGE}")
    with staging_folder(stage):
        for name, data in {**plan.files, **plan.scaffold}.items():
            os.makedirs(os.path.dirname(os.path.join(stage, name)), exist_ok=True)
            write_file(os.path.join(stage, name), data)
        write_record(stage, plan.record)
        if os.name == "nt" and os.path.isdir(folder):  # other systems replace an empty folder
            os.rmdir(folder)
        os.rename(stage, folder)


def update_package(plan: SyncPlan) -> None:
    """Update an existing package. Write nothing if it is up to date.

    Before any file is replaced, a record with the old and the new digest of each file is written. If the run is killed,
    the next one recognises the files. Raises OSError; all definitions are then old, or all are new.
    """
    folder = plan.target.folder
    stage = os.path.join(folder, STAGE)
    if plan.is_stale:
        with staging_folder(stage):
            for kind in plan.folders:
                _build(plan, kind, stage)
            for name, data in plan.scaffold.items():
                write_file(os.path.join(stage, name), data)
            write_record(folder, plan.during)
            _move_into_place(plan, stage)
    else:
        clear(stage)
    if plan.is_stale or plan.is_unfinished:
        write_record(folder, plan.record)


def _build(plan: SyncPlan, kind: str, stage: str) -> None:
    """Build the new folder `kind` in `stage`, with hard links to the files that do not change."""
    current, built = os.path.join(plan.target.folder, kind), os.path.join(stage, kind)
    replaced = {name.removeprefix(f"{kind}/") for name in (*plan.changed, *plan.removed)}
    if os.path.isdir(current):
        mirror(os.path.realpath(current), built, replaced)
    else:
        os.mkdir(built)
    for name in (*plan.added, *plan.changed):
        if name.startswith(f"{kind}/"):
            write_file(os.path.join(stage, name), plan.files[name])
    for name in plan.changed:
        if name.startswith(f"{kind}/") and plan.before[name] is not None:
            os.chmod(os.path.join(stage, name), os.stat(os.path.join(plan.target.folder, name)).st_mode)


def _move_into_place(plan: SyncPlan, stage: str) -> None:
    folder = plan.target.folder
    kinds = {os.path.join(folder, kind): kind for kind in plan.folders}
    for current in swap_folders({current: os.path.join(stage, kind) for current, kind in kinds.items()}):
        _replace_files(plan, kinds[current], stage)
    for name in plan.scaffold:
        os.replace(os.path.join(stage, name), os.path.join(folder, name))


def _replace_files(plan: SyncPlan, kind: str, stage: str) -> None:
    """Replace the added and changed files one by one, then remove the others, on systems that cannot swap folders."""
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
