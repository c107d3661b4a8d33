"""Careful writing: only what changed, each file whole or not at all, and nothing that is not ours.

A run that finds the fingerprint of its inputs and the digests of its outputs as recorded has nothing to do.
"""

import errno
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import NamedTuple

from msggen.disk.record import Record, digest, digest_of, locked, read_record, write_record, write_text

STAGE = ".msggen-stage"
"""Where files are written aside."""


class OutputPlan(NamedTuple):
    """What a run would do to a folder. `edited` are files to remove that someone changed: they stay."""

    folder: str
    files: Mapping[str, str]
    written: tuple[str, ...]
    removed: tuple[str, ...]
    edited: tuple[str, ...]

    @property
    def texts(self) -> Mapping[str, str]:
        """What is to be written."""
        return {name: self.files[name] for name in self.written}

    @property
    def is_stale(self) -> bool:
        """Whether anything would change."""
        return bool(self.written or self.removed)


class ForeignFileError(Exception):
    """A file stands where one is to be written, and msggen did not write it."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


def is_current(folder: str, record: Record, fingerprint: str) -> bool:
    """Whether `folder` holds what was made from `fingerprint`, untouched since."""
    if not record.files or record.fingerprint != fingerprint:
        return False
    return all(digest_of(folder, name) == expected for name, expected in record.files.items())


def plan_output(folder: str, files: Mapping[str, str], record: Record) -> OutputPlan:
    """Compare `files`, texts by name, with what is in `folder`.

    Raises ForeignFileError rather than plan to replace a file that is not in `record`.
    """
    written = []
    for name, text in files.items():
        found = digest_of(folder, name)
        if found is not None and found == digest(text.encode()):
            continue
        if name not in record.files and os.path.lexists(os.path.join(folder, name)):
            raise ForeignFileError(os.path.join(folder, name))
        written.append(name)
    obsolete = [name for name in record.files if name not in files and digest_of(folder, name)]
    removed = tuple(name for name in obsolete if digest_of(folder, name) == record.files[name])
    edited = tuple(name for name in obsolete if name not in removed)
    return OutputPlan(folder, files, tuple(written), removed, edited)


def write_output(folder: str, files: Mapping[str, str], made_of: Record) -> OutputPlan:
    """Write `files`, and remove what an earlier run made and this one would not; return what was done.

    `made_of` is the record to leave, with no files in it yet.

    All files are written aside first, then a record of old and new, then they are moved into place: a run that
    is killed leaves only whole files, and the next one knows them as its own and what is left to do. Runs on
    the same folder wait for each other. Raises ForeignFileError, or OSError where the folder cannot be written;
    nothing is changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with locked(folder):
        record = read_record(folder)
        plan = plan_output(folder, files, record)
        digests = {name: digest(text.encode()) for name, text in files.items()}
        obsolete = {name: value for name, value in record.files.items() if name not in {*files, *plan.edited}}
        during = made_of._replace(fingerprint="", files={**obsolete, **digests})
        _write(folder, plan.texts, plan.removed, during)
        _remove(folder, obsolete)
        write_record(folder, made_of._replace(files=digests))
        return plan


def stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of those `files`, texts by name, that stand in `folder` otherwise or not at all."""
    return tuple(name for name, text in files.items() if digest_of(folder, name) != digest(text.encode()))


def write_stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Write those `files` that are not in `folder` already, whosever they were; return their names.

    All are written aside before the first is moved into place. Runs on the same folder wait for each other.
    Raises OSError where the folder cannot be written; nothing is changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with locked(folder):
        stale = stale_files(folder, files)
        if stale:
            _write(folder, {name: files[name] for name in stale})
        return stale


def _write(folder: str, texts: Mapping[str, str], removed: tuple[str, ...] = (), during: Record | None = None) -> None:
    """Write files aside, then the record `during`, then move the files into place."""
    stage = os.path.join(folder, STAGE)
    _clear(stage)
    os.makedirs(stage)
    try:
        for index, text in enumerate(texts.values()):
            write_text(os.path.join(stage, str(index)), text)
        for parent in sorted({os.path.dirname(name) for name in (*texts, *removed)}):
            place = os.path.join(folder, parent)
            os.makedirs(place, exist_ok=True)
            if not os.access(place, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), place)
        if during:
            write_record(folder, during)
        for index, name in enumerate(texts):
            os.replace(os.path.join(stage, str(index)), os.path.join(folder, name))
    finally:
        _clear(stage)


def _clear(stage: str) -> None:
    """Remove the files written aside, this run's or those of one that was killed."""
    if os.path.isdir(stage) and not os.path.islink(stage):
        for leftover in os.listdir(stage):
            os.unlink(os.path.join(stage, leftover))
        os.rmdir(stage)


def _remove(folder: str, names: Collection[str]) -> None:
    """Remove files, those that a killed run has removed already included, and the folders that this empties."""
    for name in names:
        with suppress(FileNotFoundError):
            os.unlink(os.path.join(folder, name))
    for parent in sorted({os.path.dirname(name) for name in names} - {""}, reverse=True):  # inner folders first
        with suppress(OSError):
            os.rmdir(os.path.join(folder, parent))
