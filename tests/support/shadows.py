"""A folder that tries to have its own code run: modules with the names of others, which leave marks when imported."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from support.repository import ROOT

STANDARD = sorted(sys.stdlib_module_names - set(sys.builtin_module_names))
"""The modules of the standard library that are files."""

FURTHER = (
    *("argcomplete", "cyclonedds", "distributed", "em", "foxglove", "genmsg", "google", "jinja2", "lz4", "markupsafe"),
    *("matplotlib", "mcap", "msggen", "numpy", "pandas", "polars", "px4_msgs", "px4_types", "pyarrow", "pygments"),
    *(
        "rclpy",
        "rich",
        "rosbags",
        "serial",
        "sitecustomize",
        "tomli",
        "typing_extensions",
        "usercustomize",
        "yaml",
        "zstandard",
    ),
)
"""Modules that msggen or Python would import, of packages that are installed or not."""


def code_that_marks(marks: Path, name: str) -> str:
    """Return code that writes a name to the file `marks`. It needs no module."""
    return f"with open({str(marks)!r}, 'a', encoding='utf-8') as marks:\n    marks.write({name!r} + '\\n')\n"


def write_shadows(folder: Path, marks: Path, names: Iterable[str]) -> None:
    """Write modules and packages with these names into a folder. Each leaves its name in `marks` when imported."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names):
        path = folder / (f"{name}.py" if number % 2 else f"{name}/__init__.py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code_that_marks(marks, name), encoding="utf-8")


def remove_shadow(folder: Path, name: str) -> None:
    """Remove a module that `write_shadows` has written."""
    (folder / f"{name}.py").unlink(missing_ok=True)
    shutil.rmtree(folder / name, ignore_errors=True)


def marked(marks: Path) -> list[str]:
    """Return the names that are in `marks`."""
    return marks.read_text(encoding="utf-8").splitlines() if marks.exists() else []


def write_program(folder: Path) -> list[str]:
    """Write a script as pip writes the program `msggen` into a folder. Return the command that runs it."""
    path = folder / "msggen-program"
    start = f"import sys\n\nsys.path.insert(1, {str(ROOT)!r})\nfrom msggen.__main__ import main\n\n"
    path.write_text(f"{start}sys.exit(main())\n", encoding="utf-8")
    return [sys.executable, str(path)]


def environment(**further: str) -> dict[str, str]:
    """Return the environment of a command of msggen, in which only further variables concern Python."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "_ARGCOMPLETE"))}
    return {**kept, "PYTHONDONTWRITEBYTECODE": "1", **further}


@cache
def needed_by_m() -> tuple[str, ...]:
    """Return what `python -m msggen` imports from the current folder before msggen can do anything about it."""
    command = [sys.executable, "-I", "-c", "import runpy, sys; print(*sys.modules)"]
    return ("msggen", *subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())


def completed(command: list[str], line: str, folder: Path, answer: Path, **further: str) -> list[str]:
    """Return what TAB proposes at the end of a command line that begins with `msggen`."""
    asked = {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "",
    }
    done = subprocess.run(
        command, cwd=folder, env=environment(**asked, **further), capture_output=True, check=False, timeout=60
    )
    assert (done.stdout, done.stderr) == (b"", b"")
    return answer.read_text(encoding="utf-8").split("\n")
