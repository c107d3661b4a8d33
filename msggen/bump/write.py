"""Carries out what a bump takes: each file whole or not at all, in the order of the plan."""

from __future__ import annotations

import errno
import os
from contextlib import nullcontext, suppress

from msggen.bump.plan import Change, Plan, plan_bump
from msggen.diagnostics import fault
from msggen.firmware.tree import Folder
from msggen.record import locked

_ASIDE = ".msggen-new"
"""Ends the name of a file that is being written: nothing that the firmware builds is called so."""


def bump(firmware: str, name: str, against: str | None) -> Plan:
    """Plan a new version of the message `name` and write it; return the plan.

    Runs on the same tree wait for each other. Raises InputError, or OSError where the tree cannot be written: nothing
    is changed then.
    """
    with locked(firmware) if os.path.isdir(firmware) else nullcontext():
        plan = plan_bump(firmware, name, against)
        _write({_target(plan.firmware, change): change for change in plan.changes})
        return plan


def _target(firmware: str, change: Change) -> str:
    """Return the file to write, behind all links. Raises InputError for one outside of the firmware."""
    path = Folder(firmware).place(change.name)
    target, root = os.path.realpath(path), os.path.realpath(firmware)
    if os.path.commonpath([target, root]) != root:
        raise fault(path, "B106", f"leads to {target}, outside of the firmware: nothing is written there", 0)
    return target


def _write(changes: dict[str, Change]) -> None:
    """Write all files aside, then move them into place one after the other."""
    folders = sorted({os.path.dirname(target) for target in changes})
    for folder in folders:
        _check_writable(folder)
    for folder in folders:
        os.makedirs(folder, exist_ok=True)
    try:
        for target, change in changes.items():
            with open(target + _ASIDE, "wb") as stream:
                stream.write(change.after)
            if change.before is not None:
                os.chmod(target + _ASIDE, os.stat(target).st_mode & 0o7777)
        for target in changes:
            os.replace(target + _ASIDE, target)
    finally:
        for target in changes:
            with suppress(FileNotFoundError):
                os.unlink(target + _ASIDE)


def _check_writable(folder: str) -> None:
    """Raise PermissionError for a folder that no file can be put into, or that cannot be made."""
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), folder)
