"""Careful writing: only what changed, each file whole or not at all, and nothing that is not ours.

What msggen wrote into a folder is recorded there, in `.msggen.json`: the files with their digests, and the
fingerprint of what they were made from. A run that finds both unchanged has nothing to do.
"""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from typing import NamedTuple

MANIFEST = ".msggen.json"

STAGE = ".msggen-stage"
"""Where files are written aside."""

_SAFE_NAME = re.compile(r"(?:[A-Za-z0-9_]+/)*[A-Za-z0-9_.]*[A-Za-z0-9_]")


class Record(NamedTuple):
    """What a run wrote: digests by file name, the fingerprint of what they were made from, and what it said."""

    fingerprint: str
    summary: str
    files: Mapping[str, str]


class Plan(NamedTuple):
    """What a run would do to a folder. `edited` are files to remove that someone changed: they stay."""

    folder: str
    files: Mapping[str, str]
    written: tuple[str, ...]
    removed: tuple[str, ...]
    edited: tuple[str, ...]

    @property
    def is_stale(self) -> bool:
        """Whether anything would change."""
        return bool(self.written or self.removed)


class ForeignFileError(Exception):
    """A file stands where one is to be written, and msggen did not write it."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


def digest(data: bytes) -> str:
    """Return what a file is recognised by."""
    return sha256(data).hexdigest()


def read_record(folder: str) -> Record:
    """Return what was recorded in `folder`; an empty record where there is none that can be read."""
    try:
        with open(os.path.join(folder, MANIFEST), encoding="utf-8") as stream:
            stored = json.load(stream)
        files = {name: str(value) for name, value in stored["files"].items() if _SAFE_NAME.fullmatch(name)}
        record = Record(str(stored["fingerprint"]), str(stored["summary"]), files)
        return record if stored["seal"] == _seal(record) else record._replace(fingerprint="")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Record("", "", {})


def _seal(record: Record) -> str:
    """Return what tells a record as it was written from one that was merged or edited."""
    return digest(json.dumps([record.fingerprint, record.summary, sorted(record.files.items())]).encode())


def is_current(folder: str, record: Record, fingerprint: str) -> bool:
    """Whether `folder` holds what was made from `fingerprint`, untouched since."""
    if not record.files or record.fingerprint != fingerprint:
        return False
    return all(_digest_of(folder, name) == expected for name, expected in record.files.items())


def plan_output(folder: str, files: Mapping[str, str], record: Record) -> Plan:
    """Compare `files`, texts by name, with what is in `folder`.

    Raises ForeignFileError rather than plan to replace a file that is not in `record`.
    """
    written = []
    for name, text in files.items():
        found = _digest_of(folder, name)
        if found == digest(text.encode()):
            continue
        if name not in record.files and os.path.lexists(os.path.join(folder, name)):
            raise ForeignFileError(os.path.join(folder, name))
        written.append(name)
    obsolete = [name for name in record.files if name not in files and _digest_of(folder, name)]
    removed = tuple(name for name in obsolete if _digest_of(folder, name) == record.files[name])
    edited = tuple(name for name in obsolete if name not in removed)
    return Plan(folder, files, tuple(written), removed, edited)


def write_output(folder: str, files: Mapping[str, str], fingerprint: str, summary: str) -> Plan:
    """Write `files`, and remove what an earlier run made and this one would not; return what was done.

    All files are written aside first, then a record of old and new, then they are moved into place: a run that
    is killed leaves only whole files, and the next one knows them as its own and what is left to do. Runs on
    the same folder wait for each other. Raises ForeignFileError, or OSError where the folder cannot be written;
    nothing is changed then.
    """
    os.makedirs(folder, exist_ok=True)
    with _locked(folder):
        record = read_record(folder)
        plan = plan_output(folder, files, record)
        digests = {name: digest(text.encode()) for name, text in files.items()}
        obsolete = {name: value for name, value in record.files.items() if name not in {*files, *plan.edited}}
        stage = os.path.join(folder, STAGE)
        _clear(stage)
        os.makedirs(stage)
        try:
            _move_into_place(plan, stage, Record("", summary, {**obsolete, **digests}))
            _remove(folder, obsolete)
        finally:
            _clear(stage)
        _write_record(folder, Record(fingerprint, summary, digests))
        return plan


def _move_into_place(plan: Plan, stage: str, during: Record) -> None:
    for index, name in enumerate(plan.written):
        _write(os.path.join(stage, str(index)), plan.files[name])
    for folder in sorted({os.path.dirname(name) for name in (*plan.written, *plan.removed)}):
        os.makedirs(os.path.join(plan.folder, folder), exist_ok=True)
        if not os.access(os.path.join(plan.folder, folder), os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.path.join(plan.folder, folder))
    _write_record(plan.folder, during)
    for index, name in enumerate(plan.written):
        os.replace(os.path.join(stage, str(index)), os.path.join(plan.folder, name))


@contextmanager
def _locked(folder: str) -> Iterator[None]:
    """Hold the folder against other runs, as far as the system can; the lock ends with the process."""
    try:
        from fcntl import LOCK_EX, flock
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            flock(handle, LOCK_EX)
        yield
    finally:
        os.close(handle)


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
    for parent in {os.path.dirname(name) for name in names} - {""}:
        with suppress(OSError):
            os.rmdir(os.path.join(folder, parent))


def _write_record(folder: str, record: Record) -> None:
    stored = {**record._asdict(), "files": dict(sorted(record.files.items())), "seal": _seal(record)}
    staged = os.path.join(folder, f"{MANIFEST}.new")
    try:
        _write(staged, json.dumps(stored, indent=1) + "\n")
        os.replace(staged, os.path.join(folder, MANIFEST))
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(staged)
        raise


def _write(path: str, text: str) -> None:
    with open(path, "wb") as stream:
        stream.write(text.encode())


def _digest_of(folder: str, name: str) -> str | None:
    try:
        with open(os.path.join(folder, name), "rb") as stream:
            return digest(stream.read())
    except OSError:
        return None
