"""One sync: a ROS 2 package is brought in step with the firmware, or it is only said what that would take."""

from __future__ import annotations

import os

from msggen.diagnostics import InputError
from msggen.firmware.source import Sources
from msggen.package.definitions import Definitions
from msggen.package.guard import find_faults
from msggen.package.plan import Plan, make_plan
from msggen.package.scaffold import plan_scaffold
from msggen.package.target import Request, Target, open_target
from msggen.package.write import create_package, update_package
from msggen.record import locked, read_record


def sync(sources: Sources, definitions: Definitions, request: Request, *, write: bool) -> Plan:
    """Make a package hold `definitions`, or with `write` False only return what that would take.

    Runs on the same package wait for each other. Raises InputError for everything that stands against it, and OSError
    where the package cannot be written.
    """
    target = open_target(request, sources)
    if target.is_new:
        plan = _plan(target, sources, definitions)
        if not write:
            return plan
        parent = os.path.dirname(target.folder)
        os.makedirs(parent, exist_ok=True)
        with locked(parent):
            target = open_target(request, sources)
            if target.is_new:
                create_package(plan)
                return plan
    with locked(target.folder):
        plan = _plan(target, sources, definitions)
        if write:
            update_package(plan)
    return plan


def _plan(target: Target, sources: Sources, definitions: Definitions) -> Plan:
    known = read_record(target.folder)
    scaffold = plan_scaffold(target, sources, known, definitions)
    plan = make_plan(target, definitions.files, known, scaffold)
    faults = find_faults(plan, definitions.dependencies)
    if faults:
        raise InputError(faults)
    return plan
