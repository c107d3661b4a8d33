"""Definitions written for one test, their catalog, and the package generated from it."""

from __future__ import annotations

import importlib
import itertools
import sys
from collections.abc import Collection
from pathlib import Path
from types import ModuleType

from msggen.definitions.model import Catalog
from msggen.generate.python.package import render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources

_numbers = itertools.count()


def import_package(catalog: Catalog, folder: Path) -> ModuleType:
    """Render a package of `catalog` into `folder`, under a name that no other test uses, and import it."""
    name = f"generated_{next(_numbers)}"
    for path, text in render_package(catalog, name).items():
        target = folder / name / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    sys.path.insert(0, str(folder))
    try:
        importlib.invalidate_caches()
        module = importlib.import_module(name)
        importlib.import_module(f"{name}.msg")
    finally:
        sys.path.remove(str(folder))
    return module


def write_definitions(folder: Path, files: dict[str, str]) -> Path:
    """Write `files`, texts by relative path, into `folder`."""
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(text.encode())
    return folder


def catalog_of(folder: Path, files: dict[str, str], tolerated: Collection[str] = ()) -> Catalog:
    """Return the catalog of `files`, written into `folder`."""
    return read_catalog(find_sources(str(write_definitions(folder, files))), tolerated=tolerated)
