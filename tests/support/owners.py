"""Files of other users, for Python at least: only root can give files away."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import pytest

OTHER = 12_345
"""A user who is neither root nor the one who runs the tests."""

needs_owners = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows tells no owners")


def give(monkeypatch: pytest.MonkeyPatch, *paths: Path, user: int = OTHER) -> None:
    """Make files belong to a user; of a symbolic link, the link alone."""
    every = {os.path.abspath(path) for path in paths}
    files = {path for path in every if not os.path.islink(path)}

    def with_owner(look: Callable[..., os.stat_result], given: Collection[str]) -> Callable[..., Any]:
        def found(path: Any, *further: Any, **options: Any) -> Any:
            status = look(path, *further, **options)
            if isinstance(path, int) or os.path.abspath(os.fsdecode(path)) not in given:
                return status
            return os.stat_result((*status[:4], user, *status[5:]))

        return found

    monkeypatch.setattr(os, "stat", with_owner(os.stat, files))
    monkeypatch.setattr(os, "lstat", with_owner(os.lstat, every))
