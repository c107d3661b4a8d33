"""What several test files need: the shared material if it is there, catalogs, and packages built for one test."""

from __future__ import annotations

import importlib
import itertools
import sys
from collections.abc import Collection
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from msggen.firmware.catalog import read_catalog
from msggen.firmware.sources import find_sources
from msggen.generate.python.package import render_package
from msggen.model import Catalog

ROOT = Path(__file__).resolve().parent.parent
VECTORS = Path(__file__).resolve().parent / "vectors"
SHARED = ROOT.parent / "shared"

DEFINITIONS = sorted(path for folder in ("msg", "msg/versioned") for path in (ROOT / folder).glob("*.msg"))
"""The files of the newest embedded release, without the archived versions."""

NAMES = sorted(path.stem for path in DEFINITIONS)
"""Its messages."""

_numbers = itertools.count()


@pytest.fixture(scope="session")
def embedded() -> Catalog:
    """The catalog of the embedded set."""
    return read_catalog(find_sources(None))


@pytest.fixture(scope="session")
def px4_types() -> Any:
    """The committed package, `generated/px4_types`."""
    sys.path.insert(0, str(ROOT / "generated"))
    return importlib.import_module("px4_types")


def shared(path: str) -> Path:
    """Return a path below `../shared`, or skip the test where there is none."""
    found = SHARED / path
    if not found.exists():
        pytest.skip(f"needs ../shared/{path}, which this checkout does not have")
    return found


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
