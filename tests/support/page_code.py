"""The Python code on a page, and the places in it at which an editor should complete a name of msggen."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import NamedTuple

from support.repository import ROOT

PAGES = {path.name: path for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))}

OWN = ("msggen", "px4_types")
"""The packages whose names are public on the pages."""

_BLOCK = re.compile(r"^ *```(python|pycon)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
_ROOT = re.compile(r"\W")
_PROMPT = re.compile(r"^(?:>>>|\.\.\.) ?(.*)$", re.MULTILINE)


class Place(NamedTuple):
    """The start of a name, as editors count: lines from 1, columns in characters from 0."""

    line: int
    column: int
    name: str
    expression: str
    """What is to be completed, up to the end of the name: `vehicle.subscribe`."""


@cache
def code_of(page: str) -> str:
    """Return the Python code on a page, the blocks in their order, without the output in sessions."""
    blocks = [(kind, textwrap.dedent(block)) for kind, block in _BLOCK.findall(PAGES[page].read_text())]
    return "\n".join("\n".join(_PROMPT.findall(code)) + "\n" if kind == "pycon" else code for kind, code in blocks)


def places_of(page: str) -> list[Place]:
    """Return the places on a page at which a name of msggen or of a generated package stands, each expression once."""
    code = code_of(page)
    tree = ast.parse(code)
    foreign = set(_foreign(tree))
    found = [each for node in ast.walk(tree) for each in _places(node, code.splitlines())]
    own = [each for each in found if each.name in _names() and _ROOT.split(each.expression)[0] not in foreign]
    return sorted({each.expression: each for each in reversed(own)}.values())


def cut_code(page: str, place: Place) -> str:
    """Return the code on a page up to a place: what there is while someone writes it."""
    lines = code_of(page).splitlines()[: place.line]
    return "\n".join([*lines[:-1], lines[-1][: place.column]])


def _places(node: ast.AST, lines: list[str]) -> Iterator[Place]:
    if isinstance(node, ast.Attribute):
        line, end = node.end_lineno or 0, node.end_col_offset or 0
        column = len(lines[line - 1].encode()[:end].decode()) - len(node.attr)
        yield Place(line, column, node.attr, ast.unparse(node))
    if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in OWN:
        for alias in filter(lambda each: _exists(node.module, each.name), node.names):
            yield Place(alias.lineno, alias.col_offset, alias.name, f"from {node.module} import {alias.name}")


def _foreign(tree: ast.AST) -> Iterator[str]:
    """Yield the names that are imported from other packages, or that the committed package does not have."""
    for node in ast.walk(tree):
        module = node.module if isinstance(node, ast.ImportFrom) else None
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            for alias in node.names:
                if (module or alias.name).partition(".")[0] not in OWN or not _exists(module, alias.name):
                    yield (alias.asname or alias.name).partition(".")[0]


def _exists(module: str | None, name: str) -> bool:
    """Return whether a name can be imported, from a module if there is one."""
    if module is None:
        return find_spec(name) is not None
    try:
        return hasattr(import_module(module), name) or find_spec(f"{module}.{name}") is not None
    except ModuleNotFoundError:
        return False


@cache
def _names() -> frozenset[str]:
    """Return the names that msggen and the generated package define: modules, classes, functions and attributes."""
    found = set(OWN)
    for path in (*(ROOT / "msggen").rglob("*.py"), *(ROOT / "generated").rglob("*.py")):
        found.add(path.parent.name if path.stem == "__init__" else path.stem)
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                found.add(node.name)
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(node.target.id)
    return frozenset(found)
