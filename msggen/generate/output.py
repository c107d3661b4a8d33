"""Careful writing: only what changed, each file whole or not at all, and nothing that is not ours.

What msggen wrote into a folder is recorded there, in `.msggen.json`: the files with their digests, and the
fingerprint of what they were made from. A run that finds both unchanged has nothing to do.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from hashlib import sha256
from typing import NamedTuple

MANIFEST = ".msggen.json"

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
        files = {name: value for name, value in stored["files"].items() if _SAFE_NAME.fullmatch(name)}
        return Record(str(stored["fingerprint"]), str(stored["summary"]), files)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return Record("", "", {})


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


def write_output(plan: Plan, record: Record, fingerprint: str, summary: str) -> None:
    """Carry out `plan`. Raises OSError, with nothing changed, where the folder cannot be written.

    All files are written aside first, then the record, then they are moved into place: a run that is killed
    leaves only whole files, all of which the next run knows as its own.
    """
    digests = {name: digest(text.encode()) for name, text in plan.files.items()}
    during = {**{name: record.files[name] for name in plan.removed}, **digests}
    stage = os.path.join(plan.folder, f".msggen-{os.getpid()}")
    os.makedirs(stage)
    try:
        for index, name in enumerate(plan.written):
            _write(os.path.join(stage, str(index)), plan.files[name])
        for folder in sorted({os.path.dirname(name) for name in plan.written}):
            os.makedirs(os.path.join(plan.folder, folder), exist_ok=True)
        _write_record(plan.folder, stage, Record(fingerprint, summary, during))
        for index, name in enumerate(plan.written):
            os.replace(os.path.join(stage, str(index)), os.path.join(plan.folder, name))
        _remove(plan.folder, plan.removed)
        if during != digests:
            _write_record(plan.folder, stage, Record(fingerprint, summary, digests))
    finally:
        for leftover in os.listdir(stage):
            os.unlink(os.path.join(stage, leftover))
        os.rmdir(stage)


def _remove(folder: str, names: Iterable[str]) -> None:
    for name in names:
        os.unlink(os.path.join(folder, name))
        parent = os.path.dirname(name)
        while parent and not os.listdir(os.path.join(folder, parent)):
            os.rmdir(os.path.join(folder, parent))
            parent = os.path.dirname(parent)


def _write_record(folder: str, stage: str, record: Record) -> None:
    stored = {**record._asdict(), "files": dict(sorted(record.files.items()))}
    staged = os.path.join(stage, "record")
    _write(staged, json.dumps(stored, indent=1) + "\n")
    os.replace(staged, os.path.join(folder, MANIFEST))


def _write(path: str, text: str) -> None:
    with open(path, "wb") as stream:
        stream.write(text.encode())


def _digest_of(folder: str, name: str) -> str | None:
    try:
        with open(os.path.join(folder, name), "rb") as stream:
            return digest(stream.read())
    except OSError:
        return None
