"""The command line of a process of Python: the only place where msggen makes one.

With `-c` and `-m`, Python imports from the current folder first. A `struct.py` there, whoever wrote it, would take the
place of that of the standard library.
"""

from __future__ import annotations

import os
import sys

from msggen.base.disk.resources import PACKAGE


def command_of(module: str) -> list[str]:
    """Return the command that calls `main` of a module of msggen, which imports nothing from the current folder.

    With `-I`, Python itself takes no folder from the environment or from where it is started. Then the process imports
    from where this one does, and from the folder of msggen, except for relative folders and the current one.
    """
    own = os.path.dirname(PACKAGE)
    path = [each for each in sys.path if os.path.isabs(each) and not _is_here(each)]
    program = f"import sys; sys.path = {[*path, own]!r}; from {module} import main; main()"
    return [sys.executable, "-I", *(["-B"] if sys.dont_write_bytecode else []), "-c", program]


def _is_here(folder: str) -> bool:
    """Whether this is the current folder, by any of its names."""
    try:
        return os.path.samefile(folder, os.curdir)
    except OSError:  # one of them is gone
        return False
