"""Suggestions for a path that does not exist."""

from __future__ import annotations

import os
from collections.abc import Callable

from msggen.diagnostics import suggestion


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
