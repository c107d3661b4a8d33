"""The lengths of names and paths that the disk allows, and hints for paths that do not exist."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from msggen.base.diagnostics import shortened, suggestion

_NAME, _PATH = 255, 4095
"""The limits of most systems, in bytes."""

_WIDTH, _END = 40, 10
"""The number of characters of a name that are shown to the user, and of its end."""


def too_long(folder: str, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield those of `names`, files in `folder`, that the disk cannot have, each with a sentence about the limit.

    The name "" stands for `folder`.
    """
    place = _existing(folder)
    longest, whole = _limit(place, "PC_NAME_MAX", _NAME), _limit(place, "PC_PATH_MAX", _PATH + 1) - 1
    start = len(os.fsencode(folder)) + 1
    for name in names:
        parts = name.split("/") if name else folder.split(os.sep)
        part = max(map(os.fsencode, parts), key=len)
        size = start + len(os.fsencode(name))
        if len(part) > longest:
            shown = shortened(os.fsdecode(part), _WIDTH, _END)
            yield name, f"the name '{shown}' has {len(part)} bytes, the limit of the disk is {longest}"
        elif size > whole:
            shown = shortened(folder, _WIDTH, _END)
            yield name, f"the path '{shown}' has {size} bytes, the limit of the system is {whole}"


def _existing(folder: str) -> str:
    while folder and not os.path.isdir(folder):
        folder = os.path.dirname(folder)
    return folder or os.curdir


def _limit(folder: str, key: str, default: int) -> int:
    """Return a limit of the file system, which not every system tells."""
    with suppress(AttributeError, OSError, ValueError):
        return os.pathconf(folder, key)
    return default


def path_hint(path: str, is_meant: Callable[[str], bool] = os.path.isdir) -> str:
    """Return ", did you mean 'x'?" with the existing path most similar to the first missing part of `path`.

    Only paths for which `is_meant` is true are suggested. Return "" if none is similar.
    """
    parent, name = os.path.split(path.rstrip("/"))
    while parent and not os.path.exists(parent):
        parent, name = os.path.split(parent)
    prefix = os.path.join(parent, "")
    try:
        others = [other for other in os.listdir(parent or os.curdir) if is_meant(prefix + other)]
    except (OSError, ValueError):  # the folder cannot be read, or the path has a null character
        return ""
    return suggestion(name, others).replace("mean '", f"mean '{prefix}", 1)
