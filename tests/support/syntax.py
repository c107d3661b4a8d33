"""The modules of msggen as text and as syntax trees, which several tests read."""

from __future__ import annotations

import ast
from functools import cache

from support.repository import ROOT

MODULES = {
    path.relative_to(ROOT / "msggen").as_posix(): path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "msggen").rglob("*.py"))
}
"""The text of each module, by its path, such as `link/link.py`."""


@cache
def nodes_of(source: str) -> tuple[ast.AST, ...]:
    """Return all nodes of the syntax tree of a module, those of outer statements first."""
    return (*ast.walk(ast.parse(source)),)
