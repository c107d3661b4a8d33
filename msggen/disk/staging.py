"""Writing files: aside first, then moved into place, so that each file is replaced whole or not at all.

Whatever happens, what was written aside is removed. After a kill, the next run removes it.
"""

import errno
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial

STAGE = ".msggen-stage"
"""The name of a folder in which files are written aside."""

_ASIDE = ".msggen-new"
"""The suffix of a file that is written aside without a folder. No build system picks up files of this name."""

_WRITE_BITS = 0o222


@contextmanager
def written_aside(
    files: Mapping[str, bytes], stage: str = "", *, keep_modes: bool = False
) -> Iterator[Callable[[], None]]:
    """Write `files`, bytes by path, aside, and yield a function that moves them into place in this order.

    They are written into the folder `stage`, or without one next to their places. A killed run leaves them there: the
    next run with the same `stage` removes them. With `keep_modes` a file keeps the permissions of the one it replaces.

    Raises OSError; PermissionError if a file cannot be created in the folder that it belongs to.
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
    """Replace the file at `path`, unless it has this text already. Raises OSError."""
    data = os.fsencode(text)
    with suppress(OSError), open(path, "rb") as stream:
        if stream.read() == data:
            return
    with written_aside({path: data}) as move_into_place:
        move_into_place()


@contextmanager
def staging_folder(path: str) -> Iterator[None]:
    """Create an empty folder at `path` to write aside in, and remove it at the end."""
    clear(path)
    os.mkdir(path)
    try:
        yield
    finally:
        clear(path)


def clear(stage: str) -> None:
    """Remove a folder in which this run, or one that was killed, wrote aside."""
    if os.path.isdir(stage) and not os.path.islink(stage):
        import shutil

        for folder, _, _ in os.walk(stage):
            os.chmod(folder, 0o700)  # a folder built after a read-only one of the user's has its mode
        shutil.rmtree(stage)


def write_file(path: str, data: bytes) -> None:
    """Write `data` to `path`, which is in a staging folder or is itself aside."""
    with open(path, "wb") as stream:
        stream.write(data)


def make_folder(path: str) -> None:
    """Create the folder `path` unless it exists. Raises PermissionError if no file can be created in it."""
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
    """Hold an exclusive lock on the folder, where the system has `flock`. The lock ends with the process."""
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
