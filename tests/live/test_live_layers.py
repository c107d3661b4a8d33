"""Tests that `msggen.live` stands on its own."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.repository import ROOT

LIVE = ROOT / "msggen" / "live"
OUTSIDE = {"msggen.diagnostics", "msggen.foreign", "msggen.interpreter"}
"""What `live` imports of msggen besides itself: the nearest right name, escapes, and how to start Python."""


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module or ""


@pytest.mark.parametrize("path", sorted(LIVE.rglob("*.py")), ids=lambda path: str(path.relative_to(LIVE)))
def test_live_imports_nothing_of_the_generator(path: Path) -> None:
    own = {name for name in imported(path) if name.partition(".")[0] == "msggen"}
    assert {name for name in own if not f"{name}.".startswith("msggen.live.")} <= OUTSIDE
    assert not {name for name in imported(path) if name.startswith("px4")}
