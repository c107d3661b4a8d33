"""Bringing the files in a folder up to date: only those that differ, and none that msggen did not write."""

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import NamedTuple

from msggen.disk.record import Record, digest, digest_of, read_record, write_record
from msggen.disk.staging import STAGE, clear, locked, make_folder, written_aside


class OutputPlan(NamedTuple):
    """The changes that a run would make in a folder. `edited` are obsolete files that someone edited: they stay."""

    folder: str
    files: Mapping[str, str]
    written: tuple[str, ...]
    removed: tuple[str, ...]
    edited: tuple[str, ...]

    @property
    def is_stale(self) -> bool:
        """Whether a file is to be written or removed."""
        return bool(self.written or self.removed)


class ForeignFileError(Exception):
    """A file that msggen did not write is in the place of one that it is to write."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


def plan_output(folder: str, files: Mapping[str, str], record: Record) -> OutputPlan:
    """Compare `files`, texts by name, with those in `folder`.

    Raises ForeignFileError if a file to be replaced is not in `record`.
    """
    stale = stale_files(folder, files)
    for name in stale:
        if name not in record.files and os.path.lexists(os.path.join(folder, name)):
            raise ForeignFileError(os.path.join(folder, name))
    found = {name: digest_of(folder, name) for name in _obsolete(folder, files, record)}
    removed = tuple(name for name, value in found.items() if value == record.files[name])
    edited = tuple(name for name, value in found.items() if value and name not in removed)
    return OutputPlan(folder, files, stale, removed, edited)


def write_output(folder: str, files: Mapping[str, str]) -> tuple[OutputPlan, Record]:
    """Write `files`, and remove those that only an earlier run wrote. Return what was done, and the new record.

    All files are written aside first, then a record of old and new files, then they are moved into place: a run that
    is killed leaves only whole files, and the next one recognises them and finishes. Runs on the same folder wait for
    each other. Raises ForeignFileError, or OSError if the folder cannot be written; nothing is changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with locked(folder):
        before = read_record(folder)
        plan = plan_output(folder, files, before)
        after = Record({name: digest(text.encode()) for name, text in files.items()})
        obsolete = [name for name in _obsolete(folder, files, before) if name not in plan.edited]
        if plan.is_stale:
            for parent in _parents(plan.removed):
                make_folder(os.path.join(folder, parent))
            known = {name: before.files[name] for name in obsolete}
            _write(folder, {name: files[name] for name in plan.written}, Record({**known, **after.files}))
        else:
            clear(os.path.join(folder, STAGE))
        _remove(folder, obsolete)
        write_record(folder, after)
        return plan, after


def stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of those `files`, texts by name, that are missing in `folder` or differ there."""
    return tuple(name for name, text in files.items() if digest_of(folder, name) != digest(text.encode()))


def write_stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Write those `files` that are missing in `folder` or differ there, whoever wrote them. Return their names.

    All are written aside before the first is moved into place. Runs on the same folder wait for each other.
    Raises OSError if the folder cannot be written; nothing is changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with locked(folder):
        stale = stale_files(folder, files)
        if stale:
            _write(folder, {name: files[name] for name in stale})
        return stale


def _write(folder: str, texts: Mapping[str, str], during: Record | None = None) -> None:
    """Write files aside, then the record `during`, then move the files into place."""
    files = {os.path.join(folder, name): text.encode() for name, text in texts.items()}
    with written_aside(files, os.path.join(folder, STAGE)) as move_into_place:
        if during:
            write_record(folder, during)
        move_into_place()


def _obsolete(folder: str, files: Collection[str], record: Record) -> list[str]:
    """Return the names of the recorded files that are none of `files`, without those in folders that are links."""
    root = os.path.realpath(folder)
    homes = {name: os.path.dirname(os.path.join(root, name)) for name in record.files if name not in files}
    return [name for name, home in homes.items() if os.path.realpath(home) == home]


def _remove(folder: str, names: Collection[str]) -> None:
    """Remove files, including those that a killed run has removed already, and folders that become empty."""
    for name in names:
        with suppress(FileNotFoundError):
            os.unlink(os.path.join(folder, name))
    for parent in reversed(_parents(names)):  # inner folders first
        with suppress(OSError):
            os.rmdir(os.path.join(folder, parent))


def _parents(names: Collection[str]) -> list[str]:
    return sorted({os.path.dirname(name) for name in names} - {""})
