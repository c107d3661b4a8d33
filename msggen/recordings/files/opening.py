"""A recording on the disk: the format of each of its files, by its first bytes."""

from __future__ import annotations

import os
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from msggen.base.diagnostics import either
from msggen.base.disk.urls import is_address
from msggen.base.recording_formats import FORMATS
from msggen.recordings.source.source import VERIFIED, RecordingError, Verification

if TYPE_CHECKING:
    from collections.abc import Callable

    from msggen.recordings.files.compression import Room
    from msggen.recordings.source.source import Source

_PARQUET = b"PAR1"


def open_sources(path: str, verification: Verification = VERIFIED) -> list[Source]:
    """Return the files of a recording, by their contents. Raises RecordingError, and OSError.

    `path` can be the address of an object in a store, which raises ModuleNotFoundError without the extra.
    """
    if is_address(path):
        from msggen.recordings.files.stored import open_stored

        return open_stored(path, lambda local: open_sources(local, verification))
    from msggen.recordings.files.bag import open_compressed, open_folder

    open_file = partial(_open_file, verification)
    if os.path.isdir(path):
        return open_folder(path, open_file)
    if os.path.exists(path) and not os.path.isfile(path):
        raise RecordingError(f"{path} is not a recording: this is a pipe or a device")
    return [open_compressed(path, open_file)]


def _open_file(verification: Verification, path: str, room: Room) -> Source:
    """Return a file that is not compressed, with the room for its chunks. Raises RecordingError, and OSError."""
    with open(path, "rb") as file:
        front = file.read(16)
    for name, each in FORMATS.items():
        if front.startswith(each.front):
            module = import_module(f"msggen.recordings.files.{name}")
            reader: Callable[[str, Room, Verification], Source] = getattr(module, each.reader)
            return reader(path, room, verification)
    if not front:
        raise RecordingError(f"{path} is empty")
    if front.startswith(_PARQUET):
        raise RecordingError(f"{path} is a table in Parquet, not a recording: pyarrow, DuckDB and Polars read it")
    expected = either([each.noun for each in FORMATS.values()])
    raise RecordingError(f"{path} is not a recording: expected {expected}")
