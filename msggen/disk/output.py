"""The update of the files in a folder: only files that differ are written, and only files of msggen are replaced."""

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import NamedTuple

from msggen.disk.record import Record, digest, digest_of, read_record, write_record
from msggen.disk.staging import STAGE, clear, locked, make_folder, written_aside


class OutputPlan(NamedTuple):
    """The changes that a run makes in a folder. `edited` are obsolete files that the user edited, which are kept."""

    folder: str
    files: Mapping[str, str]
    written: tuple[str, ...]
    removed: tuple[str, ...]
    edited: tuple[str, ...]

    @property
    def is_stale(self) -> bool:
        """Whether the plan writes or removes a file."""
        return bool(self.written or self.removed)


class ForeignFileError(Exception):
    """An error: a file to write exists already, and msggen did not write it."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


def plan_output(folder: str, files: Mapping[str, str], record: Record) -> OutputPlan:
    """Return the changes that make `folder` contain `files`, texts by name.

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
    """Write `files`, and remove the other files of earlier runs. Return the changes and the new record.

    All files are written to a staging folder, then a record of old and new files is written, then the files are moved
    into place. After a kill all files are therefore whole, and the next run recognises them and finishes. Runs on the
    same folder wait for each other.

    Raises ForeignFileError, or OSError if the folder cannot be written; nothing is changed then.
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
    """Return the names of the `files`, texts by name, that are missing in `folder` or differ there."""
    return tuple(name for name, text in files.items() if digest_of(folder, name) != digest(text.encode()))


def write_stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Write the `files` that are missing in `folder` or differ there, and return their names.

    Files that msggen did not write are replaced too. All files are first written to a staging folder, then moved into
    place. Runs on the same folder wait for each other. Raises OSError if the folder cannot be written; nothing is
    changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with locked(folder):
        stale = stale_files(folder, files)
        if stale:
            _write(folder, {name: files[name] for name in stale})
        return stale


def _write(folder: str, texts: Mapping[str, str], during: Record | None = None) -> None:
    """Write files to a staging folder, then the record `during`, then move the files into place."""
    files = {os.path.join(folder, name): text.encode() for name, text in texts.items()}
    with written_aside(files, os.path.join(folder, STAGE)) as move_into_place:
        if during:
            write_record(folder, during)
        move_into_place()


def _obsolete(folder: str, files: Collection[str], record: Record) -> list[str]:
    """Return the names of recorded files that are not in `files`, except in folders that are symbolic links."""
    root = os.path.realpath(folder)
    homes = {name: os.path.dirname(os.path.join(root, name)) for name in record.files if name not in files}
    return [name for name, home in homes.items() if os.path.realpath(home) == home]


def _remove(folder: str, names: Collection[str]) -> None:
    """Remove files and the folders that become empty. A killed run may have removed some already."""
    for name in names:
        with suppress(FileNotFoundError):
            os.unlink(os.path.join(folder, name))
    for parent in reversed(_parents(names)):  # inner folders first
        with suppress(OSError):
            os.rmdir(os.path.join(folder, parent))


def _parents(names: Collection[str]) -> list[str]:
    return sorted({os.path.dirname(name) for name in names} - {""})
