"""Checks that outputs are apart from the sources."""

from __future__ import annotations

import os

from msggen.base.diagnostics import input_error
from msggen.sources.finding import Sources
from msggen.sources.tree import Folder

KINDS = ("msg", "srv")
"""The folders of definitions in a tree or a package. Each is also the suffix of the definitions in it."""


def check_apart(folder: str, sources: Sources, options: str) -> None:
    """Raise InputError if the output `folder`, chosen by `options`, has a folder of a source or is inside one."""
    real = os.path.realpath(folder)
    for home, where in ((source_in(real, sources), "has"), (source_around(real, sources), "is inside")):
        if home:
            text = f"this folder {where} {home}, a folder of a source: choose another {options}"
            raise input_error(folder, "S124", text, 0)


def source_in(folder: str, sources: Sources) -> str:
    """Return the folder or archive of a source that is in `folder`, a path without symbolic links, or ""."""
    inside = os.path.join(folder, "")
    homes = dict.fromkeys(os.path.dirname(path) or os.curdir for path in sources.dependencies())
    return next((home for home in homes if os.path.join(os.path.realpath(home), "").startswith(inside)), "")


def source_around(folder: str, sources: Sources) -> str:
    """Return the folder `msg` or `srv` of a source that `folder` is inside, a path without symbolic links, or ""."""
    files = [file for file in (*sources.messages, *sources.services) if isinstance(file.tree, Folder)]
    for home in dict.fromkeys(os.path.dirname(file.path) for file in files):
        top = os.path.dirname(home) if os.path.basename(home) == "versioned" else home
        real = os.path.realpath(top)
        if os.path.basename(real) in KINDS and folder.startswith(os.path.join(real, "")):
            return top or os.curdir
    return ""
