"""jedi, as tests complete with it: each process of tests has a cache of its own.

jedi's cache in the user's folder has no lock: a test would read the half of a file that another process is writing,
or that a killed one has left.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import jedi

from support.checkers import GENERATED

_CACHE = TemporaryDirectory(prefix="jedi-")
jedi.settings.cache_directory = _CACHE.name


def script_of(code: str, folder: Path = GENERATED, *, paths: tuple[Path, ...] = ()) -> jedi.Script:
    """Return `code` as a module in `folder`. It imports what is there, and what is in `paths`."""
    project = jedi.Project(folder, added_sys_path=[str(path) for path in (*paths, folder)], smart_sys_path=False)
    return jedi.Script(code, project=project, environment=jedi.InterpreterEnvironment())


def cell_of(code: str, values: dict[str, Any]) -> jedi.Interpreter:
    """Return `code` as a cell of a notebook whose earlier cells have made `values`."""
    return jedi.Interpreter(code, [values])


def names(script: jedi.Script, *place: int) -> set[str]:
    """Return the names that an editor offers at the end of `script`, or at a line and a column."""
    return {found.name for found in script.complete(*place)}
