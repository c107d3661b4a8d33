"""Carries out what a bump takes: each file whole or not at all, in the order of the plan."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import nullcontext, suppress

from msggen.bump.edits import Change, Edits, plan_bump
from msggen.diagnostics import Diagnostic, InputError, fault
from msggen.disk.record import locked
from msggen.firmware.tree import Folder
from msggen.location import Location

_ASIDE = ".msggen-new"
"""Ends the name of a file that is being written: nothing that the firmware builds is called so."""


_WRITABLE = 0o222


def bump(firmware: str, name: str, against: str | None) -> Edits:
    """Edits a new version of the message `name` and write it; return the plan.

    Runs on the same tree wait for each other. Raises InputError, or OSError where a file cannot be written: nothing is
    changed then.
    """
    with locked(firmware) if os.path.isdir(firmware) else nullcontext():
        plan = plan_bump(firmware, name, against)
        changes = {_target(plan.firmware, change): change for change in plan.changes}
        faults = [*_read_only(plan.firmware, changes)]
        if faults:
            raise InputError(faults)
        _write(changes)
        return plan


def _target(firmware: str, change: Change) -> str:
    """Return the file to write, behind all links. Raises InputError for one outside of the firmware."""
    path = Folder(firmware).place(change.name)
    target, root = os.path.realpath(path), os.path.realpath(firmware)
    if os.path.commonpath([target, root]) != root:
        raise fault(path, "B106", f"leads to {target}, outside of the firmware: nothing is written there", 0)
    return target


def _read_only(firmware: str, targets: Collection[str]) -> Iterator[Diagnostic]:
    """What has no write bit is not to be written, even by a user who could all the same."""
    root = os.path.realpath(firmware)
    for path in {*filter(os.path.lexists, targets), *map(_existing_folder, targets)}:
        what, needed = ("folder", os.W_OK | os.X_OK) if os.path.isdir(path) else ("file", os.W_OK)
        if not (os.stat(path).st_mode & _WRITABLE and os.access(path, needed)):
            name = os.path.normpath(Folder(firmware).place(os.path.relpath(path, root)))
            text = f"the {what} is read-only, and is to be changed: make it writable"
            yield Diagnostic(Location(name, 0), "S114", text)


def _existing_folder(path: str) -> str:
    folder = os.path.dirname(path)
    return folder if os.path.lexists(folder) else _existing_folder(folder)


def _write(changes: dict[str, Change]) -> None:
    """Write all files aside, then move them into place one after the other."""
    for folder in sorted({os.path.dirname(target) for target in changes}):
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
