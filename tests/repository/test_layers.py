"""Tests that the modules of msggen import only from the layers below their own, as docs/design.md lists them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from support.repository import ROOT

TABLE = (ROOT / "docs/design.md").read_text(encoding="utf-8")
LAYERS = {room: int(layer) for layer, room in re.findall(r"^\| (\d) \| `([\w/]+?)(?:\.py|/)` \|", TABLE, re.MULTILINE)}
"""The layer of each module and folder of msggen. A folder may have further rows for what is in it."""

MODULES = {
    path.relative_to(ROOT / "msggen").with_suffix("").as_posix(): path for path in (ROOT / "msggen").rglob("*.py")
}
"""The files of all modules, by names such as `disk/git`."""


def room_of(module: str) -> str:
    """Return the row of a module, or of the nearest folder that has one; "" if there is none."""
    parts = module.split("/")
    rooms = ("/".join(parts[:end]) for end in range(len(parts), 0, -1))
    return next((room for room in rooms if room in LAYERS), "")


def rooms_of_imports(path: Path) -> set[str]:
    """Return the rooms that a module imports from, also inside of functions."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    names = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {room_of(name.removeprefix("msggen.").replace(".", "/")) for name in names if name.startswith("msggen.")}


def test_every_module_is_in_the_table_of_layers() -> None:
    unknown = {module for module in MODULES if not room_of(module) and not module.endswith("/__init__")}
    assert unknown == {"__main__"}
    assert LAYERS.keys() == set(map(room_of, MODULES)) - {""}


@pytest.mark.parametrize("room", LAYERS)
def test_imports_go_to_lower_layers(room: str) -> None:
    imported = {
        other for module, path in MODULES.items() if room_of(module) == room for other in rooms_of_imports(path)
    }
    assert {other for other in imported - {room} if LAYERS.get(other, LAYERS[room]) >= LAYERS[room]} == set()
