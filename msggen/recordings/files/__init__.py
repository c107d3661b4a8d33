"""The formats of recordings: a module for each, which finds where the samples are."""

from __future__ import annotations

import builtins
import os
from typing import TYPE_CHECKING

from msggen.recordings.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.definitions.lent import Definitions
    from msggen.recordings.files.compression import Room
    from msggen.recordings.log import Log
    from msggen.recordings.source import Source

_MCAP = b"\x89MCAP0\r\n"
_ULOG = b"ULog\x01\x12\x35"
_SQLITE = b"SQLite format 3\0"
_PARQUET = b"PAR1"


def open_log(path: str | os.PathLike[str], definitions: Definitions | None = None) -> Log:
    """Return the recording at `path`: an MCAP file, a ULog, a db3 file or a folder of rosbag2.

    `definitions` are for topics that have none in the recording: a generated package, an embedded release such as
    "v1.17", or what else `msggen.read` takes. Without them, those of the embedded release that fits best are used.
    `Log.notes` tells which. Raises RecordingError, InputError for `definitions`, and OSError.
    """
    try:
        import numpy  # noqa: F401, ICN001
        import zstandard  # noqa: F401
    except ModuleNotFoundError as error:
        text = f"the package {error.name} is not installed: pip install 'msggen[recordings]'"
        raise ModuleNotFoundError(text, name=error.name) from None
    from msggen.recordings.definitions.lent import lender_of
    from msggen.recordings.log import Log

    lender = None if definitions is None else lender_of(definitions)
    place = os.fsdecode(path)
    return Log(open_sources(place), lender, place)


def open_sources(path: str) -> list[Source]:
    """Return the files of a recording, by their contents. Raises RecordingError, and OSError."""
    from msggen.recordings.files.bag import open_compressed, open_folder

    if os.path.isdir(path):
        return open_folder(path, _open_file)
    if os.path.exists(path) and not os.path.isfile(path):
        raise RecordingError(f"{path} is not a recording: this is a pipe or a device")
    return [open_compressed(path, _open_file)]


def _open_file(path: str, room: Room) -> Source:
    """Return a file that is not compressed, with the room for its chunks. Raises RecordingError, and OSError."""
    with builtins.open(path, "rb") as file:
        front = file.read(16)
    if front.startswith(_MCAP):
        from msggen.recordings.files.mcap import McapFile

        return McapFile(path, room)
    if front.startswith(_SQLITE):
        from msggen.recordings.files.db3 import Db3File

        return Db3File(path)
    if front.startswith(_ULOG):
        from msggen.recordings.files.ulog import UlogFile

        return UlogFile(path)
    if not front:
        raise RecordingError(f"{path} is empty")
    if front.startswith(_PARQUET):
        raise RecordingError(f"{path} is a table in Parquet, not a recording: pyarrow, DuckDB and Polars read it")
    raise RecordingError(f"{path} is not a recording: expected an MCAP file, a ULog or a database of rosbag2")
