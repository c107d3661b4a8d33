"""Tests of the names that msggen offers to programs: those that its pages and examples import."""

from __future__ import annotations

import importlib
import re
from collections import defaultdict
from pathlib import Path

import pytest
from site_library import FACADES, PUBLIC
from site_tables import with_tables

from support.repository import ROOT

IMPORT = re.compile(r"from (msggen(?:\.\w+)*) import ([\w, ]+)")


def programs() -> list[Path]:
    """Return the pages, the examples, and the package of ROS 2."""
    folders = ("docs", "examples", "ros2")
    found = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in (".md", ".ipynb")]
    found += [path for folder in folders[1:] for path in (ROOT / folder).rglob("*.py")]
    return [ROOT / "README.md", *found]


def test_pages_and_examples_import_public_names_only() -> None:
    used: defaultdict[str, set[str]] = defaultdict(set)
    for path in programs():
        for module, names in IMPORT.findall(with_tables(path.read_text(encoding="utf-8"))):
            used[module] |= {name.split()[0] for name in names.split(",") if name.strip()}
    for facade in FACADES:
        offered = {*importlib.import_module(facade).__all__, "analysis", "live", "recordings"}
        assert used.pop(facade, set()) <= offered
    assert used == PUBLIC


@pytest.mark.parametrize("module", PUBLIC)
def test_public_names_exist(module: str) -> None:
    found = importlib.import_module(module)
    for name in PUBLIC[module]:
        assert hasattr(found, name) or importlib.import_module(f"{module}.{name}")


@pytest.mark.parametrize("facade", FACADES)
def test_the_modules_of_the_names_are_those_that_type_checkers_see(facade: str) -> None:
    package = importlib.import_module(facade)
    packages = {"msggen.live": "msggen"}
    text = Path(str(package.__file__)).read_text(encoding="utf-8")
    block = text.partition("\nif TYPE_CHECKING")[2].partition("\nif not TYPE_CHECKING")[0]
    imports = re.findall(r"^    from (\S+) import (?:\(([^)]*)\)|([^#\n]*))", block, re.MULTILINE)
    typed = {
        module: {each.split()[0] for each in (several or line).split(",") if each.strip()}
        for module, several, line in imports
    }
    assert {f"{packages.get(facade, facade)}.{module}": {*names} for module, names in package._MODULES.items()} == typed
    assert {name for names in typed.values() for name in names} - {"__version__"} == {*package.__all__}
    for name in package.__all__:
        assert getattr(package, name) is not None
    assert {*package.__all__} <= {*dir(package)}
