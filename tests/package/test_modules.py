"""Tests of the modules of a generated package: their imports, their copies, and the members of the base class."""

from __future__ import annotations

import ast
import importlib
import keyword
import sys
from typing import Any

import pytest

from msggen.definitions.primitives import FLOATS, PRIMITIVES
from msggen.generate.python.names import reserved_attributes
from msggen.generate.python.package import FILES
from support.repository import ROOT

PACKAGE = ROOT / "generated" / "px4_types"
SUPPORT = ROOT / "templates" / "python" / "support"
MODULES = {path.stem: path for folder in (PACKAGE, SUPPORT) for path in folder.glob("*.py") if path.stem != "__init__"}

METHODS = {"decode", "decode_batch", "dtype", "encode", "encode_batch", "from_row", "lazy"}
"""The public methods of a message. The list is fixed, because a further method could take the name of a field."""


def imported(tree: ast.AST) -> set[str]:
    """Return the modules of the package that the import statements in `tree` name."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            found |= {node.module} if node.module else {alias.name for alias in node.names}
    return {name.partition(".")[0] for name in found} & set(MODULES)


def eager(tree: ast.Module) -> set[str]:
    """Return the modules that are imported when a module is imported."""
    return {name for node in tree.body if isinstance(node, ast.ImportFrom) for name in imported(node)}


def late(tree: ast.Module) -> set[str]:
    """Return the modules that are imported inside functions."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return {name for function in functions for name in imported(function)}


TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def reached(start: str) -> set[str]:
    """Return the modules that importing `start` imports, directly or indirectly."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = eager(TREES[waiting.pop()]) - found
        found |= new
        waiting += new
    return found


@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_module_imports_itself(name: str) -> None:
    assert name not in reached(name)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_an_import_that_closes_a_circle_says_so(name: str) -> None:
    lines = MODULES[name].read_text(encoding="utf-8").splitlines()
    functions = [node for node in ast.walk(TREES[name]) if isinstance(node, ast.FunctionDef)]
    inside = [node for function in functions for node in ast.walk(function) if isinstance(node, ast.ImportFrom)]
    closing = [lines[node.lineno - 1] for node in inside if any(name in reached(other) for other in imported(node))]
    assert [line for line in closing if not line.endswith("# here, because it imports this module")] == []


def test_only_the_base_class_imports_what_imports_it() -> None:
    closing = {name for name, tree in TREES.items() if any(name in reached(other) for other in late(tree))}
    assert closing == {"cdr"}


def test_the_methods_of_a_message_are_final(px4_types: Any) -> None:
    public = {name for name in dir(px4_types.cdr.Message) if not name.startswith("_")}
    assert public == METHODS, "write a function that takes a message: a method could take the name of a field"


def test_no_name_of_the_base_class_is_left_to_a_field(px4_types: Any) -> None:
    assert {*METHODS, *keyword.kwlist} < reserved_attributes()
    for name in px4_types.__all__:
        cls = getattr(px4_types, name)
        if hasattr(cls, "__msg__"):
            own = {field.attribute for field in cls.__msg__.fields} | {*vars(cls)} - METHODS
            assert not {attribute for attribute in own if attribute in reserved_attributes()}


def test_the_table_of_primitives_is_that_of_msggen(px4_types: Any) -> None:
    copied = importlib.import_module(f"{px4_types.__name__}.primitives")
    sized = {name: row for name, row in PRIMITIVES.items() if row.size}
    assert {name: row.code for name, row in copied.PRIMITIVES.items()} == {
        name: row.code for name, row in sized.items()
    }
    for name, row in copied.PRIMITIVES.items():
        expected = (sized[name].smallest, sized[name].largest)
        if name in FLOATS:
            assert (row.lowest, row.highest) == pytest.approx(expected, rel=1e-15)
        else:
            assert (row.lowest, row.highest) == expected
    assert tuple(name for name, row in PRIMITIVES.items() if row.is_string) == copied.STRINGS
    assert tuple(name for name, row in PRIMITIVES.items() if row.is_octet) == copied.OCTETS


def test_support_modules_are_copied_as_they_are() -> None:
    for path in SUPPORT.glob("*.py"):
        if (PACKAGE / path.name).is_file():
            assert (PACKAGE / path.name).read_bytes() == path.read_bytes()


def test_the_package_has_every_support_module() -> None:
    assert {path.name for path in SUPPORT.glob("*.py")} <= {file.path for file in FILES}


def test_a_definition_does_not_need_what_sys_modules_has(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runners of tests forget what was imported in a test, such as pytest's own `pytester`."""
    message = px4_types.EscStatus
    expected = message.__msg__.definition
    monkeypatch.delitem(sys.modules, message.__module__)
    assert message.__msg__.definition == expected
