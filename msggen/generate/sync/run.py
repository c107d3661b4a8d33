"""One sync of a ROS 2 package, or its plan."""

from __future__ import annotations

import os

from msggen.base.diagnostics import InputError
from msggen.base.disk.record import read_record
from msggen.base.disk.staging import locked, make_folder
from msggen.generate.sync.contents import PackageContents
from msggen.generate.sync.guard import find_errors
from msggen.generate.sync.plan import SyncPlan, make_plan
from msggen.generate.sync.scaffold import plan_scaffold
from msggen.generate.sync.target import Request, Target, open_target
from msggen.generate.sync.write import create_package, update_package
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
