"""The record of the files that msggen wrote into a folder: `.msggen.json`, with a digest of each file.

A later run uses it to recognise msggen's files. It is committed with the files, so it holds nothing that conflicts when
two branches are merged: only digests, each on its own line between the names of files. Further keys, as in records of
earlier releases of msggen, are ignored.
"""

import json
import os
import re
from collections.abc import Mapping
from hashlib import sha256
from typing import NamedTuple

from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import write_if_changed

RECORD_NAME = ".msggen.json"

_SAFE_NAME = re.compile(r"(?:[A-Za-z0-9_]+/)*[A-Za-z0-9_.]*[A-Za-z0-9_]")
_CONFLICT = b"\n<<<<<<< "
_LAYOUT = (",", ":\n   ")
"""Separators that put each digest on its own line, so that changes of neighbouring files do not conflict in a merge."""


class Record(NamedTuple):
    """Digests by file name. While files are being replaced, a name may have two, separated by a space.

    `scaffold` is a digest of the inputs of package.xml, CMakeLists.txt and README.md in a ROS package. It changes only
    with the README, which names the firmware's commit. `topics_only` is the option with which `sync` wrote the package.
    """

    files: Mapping[str, str]
    scaffold: str = ""
    topics_only: bool = False


NO_RECORD = Record({})


def digest(data: bytes) -> str:
    """Return the digest of a file's content."""
    return sha256(data).hexdigest()


def digest_of(folder: str, name: str) -> str | None:
    """Return the digest of a regular file, or None if it is anything else or cannot be read."""
    try:
        return digest(read_bytes(os.path.join(folder, name), follow=False))
    except OSError:
        return None


def read_record(folder: str) -> Record:
    """Return the record in `folder`, or an empty one if it is missing or invalid."""
    try:
        return parse_record(read_bytes(os.path.join(folder, RECORD_NAME), follow=False))
    except OSError:
        return NO_RECORD


def parse_record(data: bytes) -> Record:
    """Return the record in `data`, or an empty one if it is invalid."""
    try:
        stored = json.loads(_first_side(data) if _CONFLICT in data else data)
        files = {name: str(value) for name, value in stored["files"].items() if _SAFE_NAME.fullmatch(name)}
        return Record(files, str(stored.get("scaffold", "")), stored.get("topics_only") is True)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return NO_RECORD


def _first_side(data: bytes) -> bytes:
    """Return the text with each conflict that git marked resolved to its first side."""
    return re.sub(rb"(?ms)^<{7} .*?\n|^(?:\|{7}|={7}).*?(?:^>{7} .*?\n|\Z)", b"", data)


def write_record(folder: str, record: Record) -> None:
    """Write the record into `folder` if it differs. Raises InputError if a temporary name is taken, and OSError."""
    write_if_changed(os.path.join(folder, RECORD_NAME), record_text(record))


def record_text(record: Record) -> str:
    """Return the content of the file of a record."""
    scaffold = {"scaffold": record.scaffold} if record.scaffold else {}
    options = {"topics_only": True} if record.topics_only else {}
    stored = {**scaffold, **options, "files": dict(sorted(record.files.items()))}
    return json.dumps(stored, indent=1, separators=_LAYOUT) + "\n"
