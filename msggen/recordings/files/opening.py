"""A recording on the disk: the format of each of its files, by its first bytes."""

from __future__ import annotations

import os
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from msggen.base.diagnostics import either
from msggen.base.recording_formats import FORMATS, foreign, packing_of
from msggen.recordings.source.source import VERIFIED, RecordingError, Verification

if TYPE_CHECKING:
    from collections.abc import Callable

    from msggen.recordings.files.compression import Room
    from msggen.recordings.source.source import Source


def open_sources(path: str, verification: Verification = VERIFIED) -> list[Source]:
    """Return the files of a recording, by their contents. Raises RecordingError, and OSError."""
    from msggen.recordings.files.bag import open_compressed, open_folder

    open_file = partial(_open_file, verification)
    if os.path.isdir(path):
        return open_folder(path, open_file)
    if os.path.exists(path) and not os.path.isfile(path):
        cure = "open it, and pass the file object; `msggen log` reads - from stdin"
        raise RecordingError(f"{path} is not a recording: this is a pipe or a device: {cure}")
    return [open_compressed(path, open_file)]


def _open_file(verification: Verification, path: str, room: Room) -> Source:
    """Return a file that is not compressed, with the room for its chunks. Raises RecordingError, and OSError."""
    with open(path, "rb") as file:
        name = _format_of(path, file.read(16))
    module = import_module(f"msggen.recordings.files.{name}")
    reader: Callable[[str, Room, Verification], Source] = getattr(module, FORMATS[name].reader)
    return reader(path, room, verification)


def check_front(path: str, front: bytes) -> None:
    """Raise RecordingError if a file does not begin as a recording does, compressed or not."""
    if packing_of(front) is None:
        _format_of(path, front)


def _format_of(path: str, front: bytes) -> str:
    """Return the key of the format of a file by its first bytes. Raises RecordingError."""
    for name, each in FORMATS.items():
        if front.startswith(each.front):
            return name
    if not front:
        raise RecordingError(f"{path} is empty")
    other = foreign(path, front)
    if other:
        raise RecordingError(f"{path} is {other}")
    expected = either([each.noun for each in FORMATS.values()])
    raise RecordingError(f"{path} is not a recording: expected {expected}")
