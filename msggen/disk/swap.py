"""The replacement of whole folders, each in a single step, with hard links to the files that do not change."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any, NamedTuple

_CANNOT_SWAP = {errno.EINVAL, errno.ENOSYS, errno.EXDEV, errno.EOPNOTSUPP, errno.EBUSY}
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def mirror(source: str, copy: str, without: Collection[str] = ()) -> None:
    """Create the folder `copy` with everything in the folder `source` except the names in `without`.

    The files are hard links if the system allows it, so they keep their inode and date.
    """
    import shutil

    os.mkdir(copy)
    for entry in os.scandir(source):
        path = os.path.join(copy, entry.name)
        if entry.name in without:
            continue
        if entry.is_symlink():
            os.symlink(os.readlink(entry.path), path)
        elif entry.is_dir():
            mirror(entry.path, path)
        else:
            _link(entry.path, path)
    shutil.copymode(source, copy)


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


def _link(source: str, path: str) -> None:
    try:
        os.link(source, path)
    except OSError:
        import shutil

        shutil.copy2(source, path)
