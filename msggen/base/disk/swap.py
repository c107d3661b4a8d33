"""The replacement of whole folders, each in a single step, with hard links to the files that do not change."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from msggen.base.disk.files import flush
from msggen.base.disk.staging import make_folder

_CANNOT_SWAP = {errno.EINVAL, errno.ENOSYS, errno.EXDEV, errno.EOPNOTSUPP, errno.EBUSY}
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def can_swap(folder: str) -> bool:
    """Whether the system may be able to replace `folder` in one step.

    A missing folder is created in one step on every system. The current folder of this process is not replaced, because
    the shell that started it would be in a folder that was removed.
    """
    if not os.path.lexists(folder):
        return True
    here, real = os.path.realpath(os.curdir), os.path.realpath(folder)
    return os.path.isdir(folder) and _renameat2() is not None and os.path.commonpath([here, real]) != real


def mirror(source: str, copy: str, without: Collection[str] = ()) -> None:
    """Create the folder `copy` with everything in the folder `source` except the files `without`.

    These are names relative to the folder, with `/` between folders. The files are hard links if the system allows it,
    so they keep their inode and date. Raises OSError, also if a folder would have another owner.
    """
    left_out = {*without}
    device = os.stat(source).st_dev
    folders = [""]
    for folder in folders:
        if os.stat(os.path.join(source, folder)).st_dev != device:  # what is mounted here would move with the folder
            raise OSError(errno.EXDEV, os.strerror(errno.EXDEV), os.path.join(source, folder))
        os.mkdir(os.path.join(copy, folder) if folder else copy)
        for entry in os.scandir(os.path.join(source, folder)):
            name, path = folder + entry.name, os.path.join(copy, folder, entry.name)
            if entry.is_symlink():
                if name not in left_out:
                    os.symlink(os.readlink(entry.path), path)
            elif entry.is_dir():
                folders.append(f"{name}/")
            elif name not in left_out:
                link_or_copy(entry.path, path)
    for folder in reversed(folders):
        _copy_access(os.path.join(source, folder), os.path.join(copy, folder))


def keep_newer(old: str, new: str, replaced: Collection[str]) -> None:
    """Move the files that appeared in `old`, or changed there, since it was mirrored into `new`.

    The files `replaced` are left out.
    """
    left_out = {*replaced}
    for name in _files_in(old):
        before, after = os.path.join(old, name), os.path.join(new, name)
        if name not in left_out and not _is_same(before, after):
            make_folder(os.path.dirname(after))
            os.replace(before, after)


def flush_tree(folder: str, changed: Collection[str]) -> None:
    """Wait until the files `changed` and all folders in `folder` are on the disk."""
    flush([*(os.path.join(folder, name) for name in changed), *_folders_in(folder)])


def swap_folders(folders: Mapping[str, str]) -> list[str]:
    """Replace current folders by new ones, all or none. `folders` has the new folders by the path of the current one.

    Return the current folders that the system cannot swap. A current folder may be missing, and is removed if the new
    one is empty. Raises OSError.

    Two swaps follow each other directly, so that a kill between them is unlikely.
    """
    steps = {current: _step(built, current) for current, built in folders.items()}
    remaining = list(steps)
    try:
        for current, step in steps.items():
            if _try(step):
                remaining.remove(current)
    except BaseException:
        for current in steps.keys() - remaining:
            steps[current].undo()
        raise
    flush({os.path.dirname(os.path.realpath(current)) for current in folders})
    return remaining


class _FolderSwap(NamedTuple):
    """The call that replaces a folder, and the call that reverts it."""

    do: Callable[[], None]
    undo: Callable[[], None]


def _step(built: str, current: str) -> _FolderSwap:
    """Return the step that replaces the folder `current` by `built`."""
    if not os.listdir(built):
        return _FolderSwap(partial(os.rename, current, f"{built}.old"), partial(os.rename, f"{built}.old", current))
    if not os.path.lexists(current):
        return _FolderSwap(partial(os.rename, built, current), partial(os.rename, current, built))
    swap = partial(_exchange, _renameat2(), os.fsencode(built), os.fsencode(os.path.realpath(current)))
    return _FolderSwap(swap, swap)


def _try(step: _FolderSwap) -> bool:
    """Run `step`. Return False if the system cannot swap these folders."""
    try:
        step.do()
    except OSError as error:
        if error.errno not in _CANNOT_SWAP:
            raise
        return False
    return True


def _exchange(renameat2: Any, one: bytes, other: bytes) -> None:
    """Swap two folders in a single step (renameat2(2)). Raises OSError."""
    if renameat2 is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if renameat2(_AT_FDCWD, one, _AT_FDCWD, other, _RENAME_EXCHANGE):
        import ctypes

        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), os.fsdecode(other))


def _renameat2() -> Any:
    """Return the C function renameat2, or None on systems without it."""
    if sys.platform != "linux":
        return None
    import ctypes

    return getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)


def _folders_in(root: str) -> list[str]:
    """Return the folder `root` and all folders in it. The other names in a folder come after it."""
    folders = [root]
    for folder in folders:
        folders += [entry.path for entry in os.scandir(folder) if entry.is_dir(follow_symlinks=False)]
    return folders


def _files_in(root: str) -> Iterator[str]:
    """Yield the name of everything in a folder that is not a folder, relative to it, with `/` between folders."""
    for folder in _folders_in(root):
        prefix = os.path.relpath(folder, root).replace(os.sep, "/") + "/" if folder != root else ""
        for entry in os.scandir(folder):
            if not entry.is_dir(follow_symlinks=False):
                yield prefix + entry.name


def _is_same(path: str, other: str) -> bool:
    """Whether both names exist and are the same file."""
    try:
        return os.path.samestat(os.lstat(path), os.lstat(other))
    except OSError:
        return False


def link_or_copy(source: str, path: str) -> None:
    """Create a hard link to a file, or a copy if the system has none. Raises OSError, also for another file system."""
    try:
        os.link(source, path)
    except OSError as error:
        import shutil

        if error.errno == errno.EXDEV or not os.path.isfile(source):
            raise
        shutil.copy2(source, path)


def _copy_access(source: str, copy: str) -> None:
    """Give a folder the owner and the permissions of another one. Raises OSError if it cannot have that owner."""
    import shutil

    known, found = os.stat(source), os.stat(copy)
    if (known.st_uid, known.st_gid) != (found.st_uid, found.st_gid):
        os.chown(copy, known.st_uid, known.st_gid)
    shutil.copystat(source, copy)
    os.utime(copy)  # a module that was added is not found if its folder keeps its date
