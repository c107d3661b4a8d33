"""A recording on the disk: the format of each of its files, by its first bytes."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.source.source import Source

_MCAP = b"\x89MCAP0\r\n"
_ULOG = b"ULog\x01\x12\x35"
_SQLITE = b"SQLite format 3\0"
_PARQUET = b"PAR1"


def open_sources(path: str) -> list[Source]:
    """Return the files of a recording, by their contents. Raises RecordingError, and OSError."""
    from msggen.recordings.files.bag import open_compressed, open_folder

    if os.path.isdir(path):
        return open_folder(path, _open_file)
    if os.path.exists(path) and not os.path.isfile(path):
        raise RecordingError(f"{path} is not a recording: this is a pipe or a device")
    return [open_compressed(path, _open_file)]


def _open_file(path: str) -> Source:
    """Return a file that is not compressed. Raises RecordingError, and OSError."""
    with open(path, "rb") as file:
        front = file.read(16)
    if front.startswith(_MCAP):
        from msggen.recordings.files.mcap import McapFile

        return McapFile(path)
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
