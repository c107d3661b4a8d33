"""Files of other users, for Python at least: only root can give files away."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

OTHER = 12_345
"""A user who is neither root nor the one who runs the tests."""

needs_owners = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows tells no owners")


def give(monkeypatch: pytest.MonkeyPatch, *paths: Path, user: int = OTHER) -> None:
    """Make files belong to a user; of a symbolic link, the link alone."""
    given = {os.path.abspath(path) for path in paths}

    def with_owner(look: Callable[..., os.stat_result]) -> Callable[..., Any]:
        def found(path: Any, *further: Any, **options: Any) -> Any:
            status = look(path, *further, **options)
            if isinstance(path, int) or os.path.abspath(os.fsdecode(path)) not in given:
                return status
            return os.stat_result((*status[:4], user, *status[5:]))

        return found

    names = ("lstat",) if any(path.is_symlink() for path in paths) else ("stat", "lstat")
    for name in names:
        monkeypatch.setattr(os, name, with_owner(getattr(os, name)))
