"""One sync of a ROS 2 package, or its plan. All changes of a plan are made, or none.

The new folders `msg` and `srv` are built in a staging folder, and each is swapped with the old one in a single step. A
new package is built next to its place and then renamed. On systems that cannot swap folders, files are replaced one by
one.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress

from msggen.base.diagnostics import InputError
from msggen.base.disk.files import create_file, flush
from msggen.base.disk.record import RECORD_NAME, read_record, record_text, write_record
from msggen.base.disk.staging import STAGE, clear, locked, make_folder, stage_beside, staging_folder
from msggen.base.disk.swap import flush_tree, keep_newer, mirror, swap_folders
from msggen.generate.sync.contents import PackageContents
from msggen.generate.sync.guard import find_errors
from msggen.generate.sync.plan import SyncPlan, make_plan
from msggen.generate.sync.scaffold import plan_scaffold
from msggen.generate.sync.target import Request, Target, open_target
from msggen.sources.finding import Sources


def sync(sources: Sources, definitions: PackageContents, request: Request, *, write: bool) -> SyncPlan:
    """Update a package to `definitions`, read from `sources`, and return the plan. If `write` is False, only plan.

    Runs on the same package wait for each other. Raises InputError with all reasons why the package must not be
    changed, and OSError if it cannot be written.
    """
    target = open_target(request, sources)
    if target.is_new:
        plan = _plan(target, sources, definitions, write=write)
        if not write:
            return plan
        parent = os.path.dirname(target.folder)
        if not os.path.isdir(parent):
            make_folder(parent)
        with locked(parent):
            target = open_target(request, sources)
            if target.is_new:
                create_package(plan)
                return plan
    with locked(target.folder):
        plan = _plan(target, sources, definitions, write=write)
        if write:
            update_package(plan)
    return plan


def _plan(target: Target, sources: Sources, definitions: PackageContents, *, write: bool) -> SyncPlan:
    known = read_record(target.folder)
    scaffold = plan_scaffold(target, sources, known, definitions)
    plan = make_plan(target, definitions.files, known, scaffold, topics_only=definitions.topics_only)
    errors = find_errors(plan, definitions.dependencies, write=write)
    if errors:
        raise InputError(errors)
    return plan


def create_package(plan: SyncPlan) -> None:
    """Write a whole new package, which appears in one step. Raises InputError if a temporary name is taken, OSError."""
    folder = plan.target.folder
    parent, base = os.path.split(folder)
    with staging_folder(stage_beside(folder)) as content:
        built = os.path.join(content, base)
        files = {**plan.files, **plan.scaffold, RECORD_NAME: record_text(plan.record).encode()}
        _create_files(built, files)
        flush_tree(built, files)
        if os.name == "nt" and os.path.isdir(folder):  # other systems replace an empty folder
            os.rmdir(folder)
        os.rename(built, folder)
        flush([parent])


def update_package(plan: SyncPlan) -> None:
    """Update an existing package. Write nothing if it is up to date.

    Before any file is replaced, a record with the old and the new digest of each file is written. If the run is killed,
    the next one recognises the files. Raises InputError if a temporary name is taken, and OSError; all definitions are
    then old, or all are new.
    """
    folder = plan.target.folder
    stage = os.path.join(folder, STAGE)
    clear(stage_beside(folder))  # of a run that was killed after it had created the package
    if plan.is_stale:
        with staging_folder(stage) as content:
            for kind in plan.folders:
                _build(plan, kind, content)
            _create_files(content, plan.scaffold)
            flush_tree(content, (*plan.added, *plan.changed, *plan.scaffold))
            write_record(folder, plan.during)
            _move_into_place(plan, content)
    else:
        clear(stage)
    if plan.is_stale or plan.is_unfinished:
        write_record(folder, plan.record)


def _create_files(folder: str, files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        path = os.path.join(folder, name)
        make_folder(os.path.dirname(path))
        create_file(path, data)


def _build(plan: SyncPlan, kind: str, stage: str) -> None:
    """Build the new folder `kind` in `stage`, with hard links to the files that do not change."""
    current, built = os.path.join(plan.target.folder, kind), os.path.join(stage, kind)
    if os.path.isdir(current):
        mirror(os.path.realpath(current), built, _replaced(plan, kind))
    else:
        os.mkdir(built)
    new = [name for name in (*plan.added, *plan.changed) if name.startswith(f"{kind}/")]
    _create_files(stage, {name: plan.files[name] for name in new})
    for name in new:
        if plan.before.get(name) is not None:
            os.chmod(os.path.join(stage, name), os.stat(os.path.join(plan.target.folder, name)).st_mode)


def _replaced(plan: SyncPlan, kind: str) -> set[str]:
    """Return the names in the folder `kind` of the files that are replaced or removed."""
    return {name.removeprefix(f"{kind}/") for name in (*plan.added, *plan.changed, *plan.removed)}


def _move_into_place(plan: SyncPlan, stage: str) -> None:
    folder = plan.target.folder
    kinds = {os.path.join(folder, kind): kind for kind in plan.folders}
    remaining = swap_folders({current: os.path.join(stage, kind) for current, kind in kinds.items()})
    for current, kind in kinds.items():
        old = os.path.join(stage, kind)
        if current in remaining:
            _replace_files(plan, kind, stage)
        elif os.path.isdir(old):
            keep_newer(old, current, _replaced(plan, kind))
    for name in plan.scaffold:
        os.replace(os.path.join(stage, name), os.path.join(folder, name))
    flush([folder])


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
