"""Modules that are slow to import, and modules that a test imports anew."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

HEAVY = {
    "dataclasses",
    "difflib",
    "inspect",
    "jinja2",
    "msggen.definitions.model",
    "rich",
    "shutil",
    "subprocess",
    "xml",
    "yaml",
}
"""Modules that a build with nothing to do must not import."""

READING = {
    "ast",
    "difflib",
    "json",
    "jinja2",
    "lzma",
    "msggen.definitions.model",
    "msggen.link.link",
    "msggen.recordings.decode.layouts",
    "msggen.recordings.decode.schemas",
    "msggen.recordings.definitions.lent",
    "msggen.recordings.files.rosbag2.bag",
    "msggen.recordings.files.stored",
    "msggen.recordings.log.events",
    "msggen.recordings.log.payloads",
    "numpy.ma",
    "numpy.typing",
    "pyarrow",
    "queue",
    "shutil",
    "subprocess",
    "tempfile",
    "urllib.parse",
    "yaml",
}
"""Modules that reading a ULog must not import, which has its own definitions, unless numpy does."""


def forget(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Let packages be imported anew until the end of a test, when the modules from before are there again.

    A module is also an attribute of its package. Without that, tests that follow would find two modules of one name.
    """
    for name in [name for name in sys.modules if f"{name}.".startswith(tuple(f"{each}." for each in packages))]:
        package, _, child = name.rpartition(".")
        if vars(sys.modules.get(package, sys)).get(child) is sys.modules[name]:
            monkeypatch.delattr(sys.modules[package], child)
        monkeypatch.delitem(sys.modules, name)
