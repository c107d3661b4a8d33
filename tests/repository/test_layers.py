"""Tests that the modules of msggen import only from the layers below their own, as docs/design.md lists them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from support.repository import ROOT

TABLE = (ROOT / "docs/design.md").read_text(encoding="utf-8")
LAYERS = {room: int(layer) for layer, room in re.findall(r"^\| (\d) \| `(\w+)(?:\.py|\/)` \|", TABLE, re.MULTILINE)}
"""The layer of each module and folder of msggen."""

MODULES = sorted((ROOT / "msggen").rglob("*.py"))


def rooms_of_imports(path: Path) -> set[str]:
    """Return the modules and folders of msggen that a module imports from, also inside of functions."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    names = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.split(".")[1] for name in names if name.startswith("msggen.")}


def room_of(path: Path) -> str:
    return path.relative_to(ROOT / "msggen").parts[0].removesuffix(".py")


def test_the_table_of_layers_has_every_module_and_folder() -> None:
    assert LAYERS.keys() == {room_of(path) for path in MODULES} - {"__main__"}


@pytest.mark.parametrize("room", LAYERS)
def test_imports_go_to_lower_layers(room: str) -> None:
    imported = {other: path for path in MODULES if room_of(path) == room for other in rooms_of_imports(path)}
    wrong = {other: path for other, path in imported.items() if other != room and LAYERS[other] >= LAYERS[room]}
    assert wrong == {}
