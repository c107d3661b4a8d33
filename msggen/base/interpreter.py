"""The programs that msggen starts: the command line of a process of Python, and the place of another program.

With `-c` and `-m`, Python imports from the current folder first. A `struct.py` there, whoever wrote it, would take the
place of that of the standard library. For the bare name of a program, Windows looks into the current folder first, and
every system where a relative folder on the PATH says so.
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
    path = [each for each in sys.path if os.path.isabs(each) and not is_here(each)]
    program = f"import sys; sys.path = {[*path, own]!r}; from {module} import main; main()"
    return [sys.executable, "-I", *(["-B"] if sys.dont_write_bytecode else []), "-c", program]


def program_at(name: str) -> str:
    """Return the path of a program in one of the absolute folders on the PATH, except for the current one.

    Raises FileNotFoundError.
    """
    for folder in os.get_exec_path():
        path = os.path.join(folder, f"{name}.exe" if sys.platform == "win32" else name)
        if os.path.isabs(folder) and os.path.isfile(path) and os.access(path, os.X_OK) and not is_here(folder):
            return path
    raise FileNotFoundError(name)


def is_here(folder: str) -> bool:
    """Whether this is the current folder, by any of its names."""
    try:
        return os.path.samefile(folder, os.curdir)
    except OSError:  # one of them is gone
        return False
