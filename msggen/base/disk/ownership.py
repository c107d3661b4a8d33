"""Owners of files and folders: whether another user can have written what this one would execute."""

from __future__ import annotations

import os
import stat

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def is_own(path: str) -> bool:
    """Whether a file, and a symbolic link to it, belong to this user, to root, or to the user of sudo.

    Windows does not tell owners, so there every file is. A file that cannot be found is nobody's.
    """
    try:
        return not hasattr(os, "geteuid") or {os.lstat(path).st_uid, os.stat(path).st_uid} <= _trusted()
    except OSError:
        return False


def problem_of(folder: str) -> str:
    """Return why others can change what lies in a folder, with what to do about it, or "" if they cannot.

    Nobody but this user and root may own the folder or one above it, or write to it, as for the keys of ssh. One above
    it may be like /tmp, where others can write, but can neither rename nor remove what is not theirs.
    """
    if not hasattr(os, "geteuid"):
        return ""
    here, is_last = os.path.realpath(folder), True
    while True:
        status = os.stat(here)
        if status.st_uid not in (0, os.geteuid()):
            return f"'{here}' belongs to another user"
        if status.st_mode & _BY_OTHERS and (is_last or not status.st_mode & stat.S_ISVTX):
            return f"others can write to '{here}': run `chmod go-w {here}`"
        above = os.path.dirname(here)
        if above == here:
            return ""
        here, is_last = above, False


def has_others(folder: str) -> bool:
    """Whether a folder or anything in it belongs to another user than this one and root."""
    if not hasattr(os, "geteuid"):
        return False
    inside = (os.path.join(place, name) for place, folders, files in os.walk(folder) for name in (*folders, *files))
    return any(os.lstat(path).st_uid not in (0, os.geteuid()) for path in (folder, *inside))


def _trusted() -> set[int]:
    """Return this user and root and, for root, the user who has called sudo, as git does."""
    sudo = os.environ.get("SUDO_UID", "")
    return {0, os.geteuid(), *([int(sudo)] if os.geteuid() == 0 and sudo.isdecimal() else [])}
