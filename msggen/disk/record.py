"""What msggen wrote into a folder, recorded there in `.msggen.json`: so that a later run knows its own files.

A file is recognised by its digest. The record is sealed: one that was merged or edited by hand still tells whose the
files are, but no longer that they are current.
"""

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from typing import NamedTuple

MANIFEST = ".msggen.json"

_SAFE_NAME = re.compile(r"(?:[A-Za-z0-9_]+/)*[A-Za-z0-9_.]*[A-Za-z0-9_]")


class Record(NamedTuple):
    """What a run wrote: digests by file name, the fingerprint of what they were made from, and what it said.

    `has_warnings` tells a later run that there are some to repeat.
    """

    fingerprint: str
    summary: str
    files: Mapping[str, str]
    has_warnings: bool = False


NOTHING = Record("", "", {})


def digest(data: bytes) -> str:
    """Return what a file is recognised by."""
    return sha256(data).hexdigest()


def digest_of(folder: str, name: str) -> str | None:
    """Return the digest of a file, or None where none can be read."""
    try:
        with open(os.path.join(folder, name), "rb", buffering=0) as stream:
            return digest(stream.read())
    except OSError:
        return None


def read_record(folder: str) -> Record:
    """Return what was recorded in `folder`; an empty record where there is none that can be read."""
    try:
        with open(os.path.join(folder, MANIFEST), "rb") as stream:
            return parse_record(stream.read())
    except OSError:
        return NOTHING


def parse_record(data: bytes) -> Record:
    """Return what the bytes of a record say; an empty record where they cannot be read."""
    try:
        stored = json.loads(data)
        files = {name: str(value) for name, value in stored["files"].items() if _SAFE_NAME.fullmatch(name)}
        warnings = stored.get("has_warnings") is True
        record = Record(str(stored["fingerprint"]), str(stored["summary"]), files, warnings)
        return record if stored["seal"] == _seal(record) else record._replace(fingerprint="")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return NOTHING


def _seal(record: Record) -> str:
    """Return what tells a record as it was written from one that was merged or edited."""
    return digest(json.dumps([record.fingerprint, record.summary, sorted(record.files.items())]).encode())


def write_record(folder: str, record: Record) -> None:
    """Replace the record of `folder`, whole or not at all."""
    stored = {**record._asdict(), "files": dict(sorted(record.files.items())), "seal": _seal(record)}
    if not record.has_warnings:
        del stored["has_warnings"]
    staged = os.path.join(folder, f"{MANIFEST}.new")
    try:
        write_text(staged, json.dumps(stored, indent=1) + "\n")
        os.replace(staged, os.path.join(folder, MANIFEST))
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(staged)
        raise


@contextmanager
def locked(folder: str) -> Iterator[None]:
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


def write_text(path: str, text: str) -> None:
    """Write `text` as UTF-8, line ends as they are."""
    with open(path, "wb") as stream:
        stream.write(text.encode())
