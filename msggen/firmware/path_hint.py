"""What was perhaps meant by a path that leads nowhere."""

from __future__ import annotations

import os
from collections.abc import Callable

from msggen.diagnostics import suggestion


def path_hint(path: str, is_meant: Callable[[str], bool] = os.path.isdir) -> str:
    """Return ", did you mean 'x'?" with what lies beside the first part of `path` that is not there, or ""."""
    parent, name = os.path.split(path.rstrip("/"))
    while parent and not os.path.exists(parent):
        parent, name = os.path.split(parent)
    prefix = os.path.join(parent, "")
    try:
        others = [other for other in os.listdir(parent or os.curdir) if is_meant(prefix + other)]
    except (OSError, ValueError):  # not to be read, or no path at all
        return ""
    return suggestion(name, others).replace("mean '", f"mean '{prefix}", 1)
