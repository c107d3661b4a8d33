"""The other ROS packages that definitions nest: beside their package in the workspace, or installed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

from msggen.base.diagnostics import InputError
from msggen.sources.file import File, read_file
from msggen.sources.finding import join_package
from msggen.sources.installed import PREFIX, find_installed
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import find_definitions

_NESTED = re.compile(rb"^[ \t]*([a-z][a-z0-9_]*)/\w", re.MULTILINE)
_MOST = 50
"""Maximum number of packages that are looked for."""


def nested_packages(files: Iterable[File], workspace: str) -> tuple[str, ...]:
    """Return the packages that `files` and these packages nest, as `PKG=DIR`, those that are found."""
    found: dict[str, str] = {}
    waiting = _named(files)
    while waiting and len(found) < _MOST:
        name = waiting.pop()
        found[name] = _folder(name, workspace)
        if found[name]:
            waiting |= _named(find_definitions(Folder(found[name]), "msg", ".msg", name, is_flat=True)) - found.keys()
    return tuple(join_package(name, folder) for name, folder in sorted(found.items()) if folder)


def _named(files: Iterable[File]) -> set[str]:
    names: set[str] = set()
    for file in files:
        try:
            names |= {name.decode() for name in _NESTED.findall(read_file(file))}
        except InputError:  # shown where the sources are read
            continue
    return names


def _folder(name: str, workspace: str) -> str:
    """Return the folder of a package, "" if it is not found."""
    beside = os.path.join(workspace, name)
    if os.path.isfile(os.path.join(beside, "package.xml")):
        return beside
    try:
        return find_installed(f"{PREFIX}{name}").path
    except InputError:
        return ""
