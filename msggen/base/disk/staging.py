"""Atomic writing: files are written under other names and then renamed, so that none is ever replaced in part.

Temporary names are removed at the end of a run or, after a kill, by the next run. Nothing is written or removed through
a symbolic link that has such a name, and nothing that msggen did not create is removed.
"""

import errno
import os
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial

from msggen.base.diagnostics import InputError, input_error
from msggen.base.disk.files import create_file, flush
from msggen.base.disk.reading import read_bytes

STAGE = ".msggen-stage"
"""The name of a staging folder, in which files are written first."""

_ASIDE = ".msggen-new"
"""The suffix of a temporary file next to its place. No build system picks up files with it."""

_CONTENT = "new"
_MARK = ".gitignore"
_MARKED = b"# msggen created this folder and removes it\n*\n"
"""The content of the file that marks a staging folder of msggen. Everything else in the folder is below `_CONTENT`."""

_WRITE_BITS = 0o222


@contextmanager
def written_aside(
    files: Mapping[str, bytes], stage: str = "", *, keep_modes: bool = False, flushed: bool = True
) -> Iterator[Callable[[], None]]:
    """Write `files`, bytes by path, to temporary files, and yield a function that moves them into place in this order.

    The temporary files are in a staging folder at `stage` or, if it is empty, next to their places. With `keep_modes`,
    a file keeps the permissions of the one that it replaces. With `flushed`, all are on the disk before the first one
    is moved, so that a power loss tears no file.

    Raises InputError if a temporary name is taken, or if a path is a device or a pipe, which a rename would replace;
    OSError, and PermissionError if a file cannot be created in its folder.
    """
    _check_replaceable(files)
    for folder in sorted({os.path.dirname(path) for path in files}):
        make_folder(folder)
    with _numbered(files, stage) if stage else _next_to(files) as asides:
        for path, aside in asides.items():
            create_file(aside, files[path])
            if keep_modes and os.path.exists(path):
                os.chmod(aside, os.stat(path).st_mode & 0o7777)
        if flushed:
            flush(asides.values())
        yield partial(_move, asides, flushed=flushed)


def _check_replaceable(paths: Iterable[str]) -> None:
    for path in paths:
        with suppress(OSError):
            mode = os.lstat(path).st_mode
            if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode) or stat.S_ISDIR(mode)):
                raise input_error(path, "S104", "not a regular file: move it, or choose another output", 0)


def write_if_changed(path: str, content: str | bytes, *, flushed: bool = True) -> None:
    """Write a text or bytes to `path` if the file differs. `flushed` is as for `written_aside`.

    Raises InputError if a temporary name is taken, and OSError.
    """
    data = os.fsencode(content)
    with suppress(OSError):
        if read_bytes(path, follow=False) == data:
            return
    with written_aside({path: data}, flushed=flushed) as move_into_place:
        move_into_place()


def stage_beside(folder: str) -> str:
    """Return the path of a staging folder next to `folder`, in which a new folder is built that replaces it."""
    parent, name = os.path.split(folder)
    return os.path.join(parent, f".{name}{STAGE}")


@contextmanager
def staging_folder(path: str) -> Iterator[str]:
    """Create a staging folder at `path`, yield an empty folder in it, and remove both at the end.

    What a killed run left at `path` is removed first. Raises InputError if something else is there, and OSError.
    """
    clear(path)
    try:
        yield make_stage(path)
    finally:
        clear(path)


def make_stage(path: str) -> str:
    """Create a staging folder at `path`, and return the path of an empty folder in it. Both stay until `clear`.

    Raises InputError if something is there, and OSError.
    """
    try:
        os.mkdir(path)
    except FileExistsError:
        raise _taken(path) from None
    create_file(os.path.join(path, _MARK), _MARKED)
    content = os.path.join(path, _CONTENT)
    os.mkdir(content)
    return content


def clear(stage: str) -> None:
    """Remove a staging folder, of this run or of one that was killed. Leave anything else of that name alone."""
    if _is_stage(stage):
        remove_tree(os.path.join(stage, _CONTENT))
        with suppress(FileNotFoundError):
            os.unlink(os.path.join(stage, _MARK))
        os.rmdir(stage)


def _is_stage(path: str) -> bool:
    """Whether msggen created the folder `path` and everything in it. A killed run may not have completed the mark."""
    if os.path.islink(path) or not os.path.isdir(path):
        return False
    names = {*os.listdir(path)}
    try:
        return not names or (
            names <= {_MARK, _CONTENT} and _MARKED.startswith(read_bytes(os.path.join(path, _MARK), follow=False))
        )
    except OSError:
        return False


def remove_tree(path: str) -> None:
    """Remove a folder of any depth and everything in it, or nothing if it is missing. Links are not followed."""
    if os.path.islink(path) or not os.path.isdir(path):
        return
    folders = [path]
    for folder in folders:
        os.chmod(folder, 0o700)  # a copy of a read-only folder is read-only too
        for entry in os.scandir(folder):
            if entry.is_dir(follow_symlinks=False):
                folders.append(entry.path)
            else:
                os.unlink(entry.path)
    for folder in reversed(folders):
        os.rmdir(folder)


def make_folder(path: str) -> None:
    """Create the folder `path` if it is missing.

    Raises InputError if a file has its name or that of a parent, PermissionError if no file can be created in it.
    """
    path = path or os.curdir
    missing = []
    while path and not os.path.isdir(path):
        missing.append(path)
        path = os.path.dirname(path)
    for folder in reversed(missing):
        try:
            os.mkdir(folder)
        except FileExistsError:
            if not os.path.isdir(folder):  # else another run created it
                text = "this is not a folder, and the output needs one here: move it, or choose another output with -o"
                raise input_error(folder, "S129", text, 0) from None
        path = folder
    check_writable(path or os.curdir)


def check_writable(folder: str) -> None:
    """Raise PermissionError if no file can be created in `folder`."""
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), folder)


def is_writable(path: str) -> bool:
    """Whether the file or folder may be changed. Without a write bit it may not, even by root."""
    needed = os.W_OK | os.X_OK if os.path.isdir(path) else os.W_OK
    return bool(os.stat(path).st_mode & _WRITE_BITS) and os.access(path, needed)


@contextmanager
def locked(folder: str, waiting: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Hold an exclusive lock on the folder if the system has `flock`. The lock ends with the process.

    If another process has the lock, `waiting` is called once, before this one waits.
    """
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            flock(handle, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            waiting()
            with suppress(OSError):
                flock(handle, LOCK_EX)
        except OSError:
            pass  # a file system without locks
        yield
    finally:
        os.close(handle)


def _move(asides: Mapping[str, str], *, flushed: bool) -> None:
    for path, aside in asides.items():
        os.replace(aside, path)
    if flushed:
        flush(sorted({os.path.dirname(path) or os.curdir for path in asides}))


@contextmanager
def _numbered(paths: Collection[str], stage: str) -> Iterator[dict[str, str]]:
    """Yield a name in a staging folder for each of `paths`."""
    with staging_folder(stage) as content:
        yield {path: os.path.join(content, str(index)) for index, path in enumerate(paths)}


@contextmanager
def _next_to(paths: Collection[str]) -> Iterator[dict[str, str]]:
    """Yield a name next to each of `paths`. Files that a killed run left there are removed."""
    asides = {path: path + _ASIDE for path in paths}
    for aside in filter(os.path.lexists, asides.values()):
        if not stat.S_ISREG(os.lstat(aside).st_mode):
            raise _taken(aside)
        os.unlink(aside)
    try:
        yield asides
    finally:
        for aside in asides.values():
            with suppress(FileNotFoundError):
                os.unlink(aside)


def _taken(path: str) -> InputError:
    return input_error(path, "S104", "msggen did not create this, and needs the name for temporary files: move it", 0)
