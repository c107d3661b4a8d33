"""Atomic writing: a file is written under another name and then renamed, so that it is never replaced in part.

Temporary files and folders are always removed; after a kill, the next run removes them.
"""

import errno
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial

STAGE = ".msggen-stage"
"""The name of a staging folder, in which files are written first."""

_ASIDE = ".msggen-new"
"""The suffix of a temporary file next to its place. No build system picks up files with it."""

_WRITE_BITS = 0o222


@contextmanager
def written_aside(
    files: Mapping[str, bytes], stage: str = "", *, keep_modes: bool = False
) -> Iterator[Callable[[], None]]:
    """Write `files`, bytes by path, to temporary files, and yield a function that moves them into place in this order.

    The temporary files are in the folder `stage` or, if it is empty, next to their places. After a kill they remain,
    and the next run with the same `stage` removes them. With `keep_modes`, a file keeps the permissions of the one that
    it replaces.

    Raises OSError, and PermissionError if a file cannot be created in its folder.
    """
    for folder in sorted({os.path.dirname(path) for path in files}):
        make_folder(folder)
    asides = {path: os.path.join(stage, str(index)) if stage else path + _ASIDE for index, path in enumerate(files)}
    with staging_folder(stage) if stage else _removed_at_end(asides.values()):
        for path, aside in asides.items():
            write_file(aside, files[path])
            if keep_modes and os.path.exists(path):
                os.chmod(aside, os.stat(path).st_mode & 0o7777)
        yield partial(_move, asides)


def write_if_changed(path: str, text: str) -> None:
    """Write `text` to `path` if the file differs. Raises OSError."""
    data = os.fsencode(text)
    with suppress(OSError), open(path, "rb") as stream:
        if stream.read() == data:
            return
    with written_aside({path: data}) as move_into_place:
        move_into_place()


@contextmanager
def staging_folder(path: str) -> Iterator[None]:
    """Create an empty staging folder at `path`, and remove it at the end."""
    clear(path)
    os.mkdir(path)
    try:
        yield
    finally:
        clear(path)


def clear(stage: str) -> None:
    """Remove a staging folder, of this run or of one that was killed."""
    if os.path.isdir(stage) and not os.path.islink(stage):
        import shutil

        for folder, _, _ in os.walk(stage):
            os.chmod(folder, 0o700)  # a copy of a read-only folder is read-only too
        shutil.rmtree(stage)


def write_file(path: str, data: bytes) -> None:
    """Write `data` to the temporary file `path`."""
    with open(path, "wb") as stream:
        stream.write(data)


def make_folder(path: str) -> None:
    """Create the folder `path` if it is missing. Raises PermissionError if no file can be created in it."""
    path = path or os.curdir
    os.makedirs(path, exist_ok=True)
    if not os.access(path, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)


def is_writable(path: str) -> bool:
    """Whether the file or folder may be changed. Without a write bit it may not, even by root."""
    needed = os.W_OK | os.X_OK if os.path.isdir(path) else os.W_OK
    return bool(os.stat(path).st_mode & _WRITE_BITS) and os.access(path, needed)


@contextmanager
def locked(folder: str) -> Iterator[None]:
    """Hold an exclusive lock on the folder if the system has `flock`. The lock ends with the process."""
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


def _move(asides: Mapping[str, str]) -> None:
    for path, aside in asides.items():
        os.replace(aside, path)


@contextmanager
def _removed_at_end(paths: Collection[str]) -> Iterator[None]:
    try:
        yield
    finally:
        for path in paths:
            with suppress(FileNotFoundError):
                os.unlink(path)
