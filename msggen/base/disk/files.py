"""Single files: creating them without following a symbolic link, and flushing them to the disk."""

import os
import sys
from collections.abc import Iterable
from contextlib import suppress

_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN

_MANY = 16
"""The number of files above which the whole file system is flushed."""


def create_file(path: str, data: bytes) -> None:
    """Write `data` to the new file `path`. Raises FileExistsError if the name is taken, even by a symbolic link."""
    try:
        with open(os.open(path, _CREATE, 0o666), "wb") as stream:
            stream.write(data)
    except OSError as error:
        error.filename = path  # a full disk has no name
        raise


def flush(paths: Iterable[str]) -> None:
    """Wait until these files and folders are on the disk, if the system can tell. Raises OSError if one is not.

    Call this once, after all files are written. If they are many, the whole file system is flushed in one call: each
    call that flushes a single file waits for the journal.
    """
    each = [*paths]
    if len(each) > _MANY and _flush_file_system(each[0]):
        return
    for path in each:
        _flush(path)


def _flush_file_system(path: str) -> bool:
    """Flush the file system that has `path`. Return False if the system cannot."""
    if sys.platform != "linux":
        return False
    import ctypes

    syncfs = getattr(ctypes.CDLL(None, use_errno=True), "syncfs", None)
    handle = os.open(path, os.O_RDONLY | _PLAIN)
    try:
        return syncfs is not None and syncfs(handle) == 0
    finally:
        os.close(handle)


def _flush(path: str) -> None:
    is_folder = os.path.isdir(path)
    with suppress(*([OSError] if is_folder else [])):  # not every system can open and flush a folder
        handle = os.open(path, (os.O_RDWR if os.name == "nt" else os.O_RDONLY) | _PLAIN)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
