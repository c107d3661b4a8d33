"""The writing of a bump: the files of the plan in its order. No file is written in part."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import nullcontext

from msggen.base.diagnostics import Diagnostic, InputError, input_error
from msggen.base.disk.staging import is_writable, locked, written_aside
from msggen.base.location import Location
from msggen.generate.bump.edits import Change, Edits, plan_bump
from msggen.sources.tree import Folder


def bump(firmware: str, name: str, against: str | None) -> Edits:
    """Bump the version of the message `name` in the tree `firmware`. Return the edits that were made.

    `against` is as for `plan_bump`. Runs on the same tree wait for each other. Raises InputError, or OSError if a file
    cannot be written; nothing is changed then.
    """
    with locked(firmware) if os.path.isdir(firmware) else nullcontext():
        plan = plan_bump(firmware, name, against)
        files = {_target(plan.firmware, change): change.after for change in plan.changes}
        errors = [*_read_only(plan.firmware, files)]
        if errors:
            raise InputError(errors)
        with written_aside(files, keep_modes=True) as move_into_place:
            move_into_place()
        return plan


def _target(firmware: str, change: Change) -> str:
    """Return the path to write to, with symbolic links resolved. Raises InputError if it is outside the firmware."""
    path = Folder(firmware).place(change.name)
    target, root = os.path.realpath(path), os.path.realpath(firmware)
    if os.path.commonpath([target, root]) != root:
        raise input_error(path, "B106", f"leads to {target}, outside of the firmware: replace the symbolic link", 0)
    return target


def _read_only(firmware: str, targets: Collection[str]) -> Iterator[Diagnostic]:
    """Yield an error for each read-only file or folder that would be changed, even for root."""
    root = os.path.realpath(firmware)
    for path in {*filter(os.path.lexists, targets), *map(_existing_folder, targets)}:
        if not is_writable(path):
            kind = "folder" if os.path.isdir(path) else "file"
            name = os.path.normpath(Folder(firmware).place(os.path.relpath(path, root)))
            yield Diagnostic(Location(name, 0), "S114", f"the {kind} is read-only: make it writable")


def _existing_folder(path: str) -> str:
    folder = os.path.dirname(path)
    return folder if os.path.lexists(folder) else _existing_folder(folder)
