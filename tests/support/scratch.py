"""Folders for single cases: made empty, made the current folder, and removed."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_MEMORY = "/dev/shm"  # noqa: S108 - where Linux keeps files in memory


def scratch_root() -> str:
    """Make and return a folder for scratch folders, in memory if possible, because waiting for the disk takes long."""
    return tempfile.mkdtemp(prefix="fuzz-", dir=_MEMORY if os.access(_MEMORY, os.W_OK) else None)


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Make `folder` the current folder (contextlib.chdir is in Python 3.11 and later)."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make an empty folder, the current one until it is removed."""
    folder = Path(tempfile.mkdtemp(prefix="case-"))
    try:
        with inside(folder):
            yield folder
    finally:
        remove(folder)


def remove(folder: Path) -> None:
    """Remove a folder, read-only folders inside it too."""
    for place, _, _ in os.walk(folder):
        if not os.lstat(place).st_mode & stat.S_IWUSR:
            os.chmod(place, stat.S_IRWXU)
    shutil.rmtree(folder)


@contextmanager
def deep_folder(folder: Path, depth: int, name: str = "a") -> Iterator[None]:
    """Make folders of one name in each other below `folder`, and remove them at the end."""
    with inside(folder):
        for _ in range(depth):
            os.mkdir(name)
            os.chdir(name)
    try:
        yield
    finally:
        with inside(folder):
            for _ in range(depth):
                os.chdir(name)
            for _ in range(depth):
                os.chdir("..")
                shutil.rmtree(name)
