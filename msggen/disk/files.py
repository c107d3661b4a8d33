"""Single files: creating them without following a symbolic link, and flushing them to the disk."""

import os
from collections.abc import Iterable
from contextlib import suppress

_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN


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

    Flush after all files are written: this takes less time than flushing each after it was written.
    """
    for path in paths:
        _flush(path)


def _flush(path: str) -> None:
    is_folder = os.path.isdir(path)
    with suppress(*([OSError] if is_folder else [])):  # not every system can open and flush a folder
        handle = os.open(path, (os.O_RDWR if os.name == "nt" else os.O_RDONLY) | _PLAIN)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
