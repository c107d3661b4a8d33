"""The environment of the benchmarks: one of its own, with the peers from the package index and msggen from here.

It is kept, in a folder that git ignores, for as long as requirements.txt and the interpreter stay the same.
Standard library only: this runs before anything is installed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
FOLDER = HERE / ".venv"
REQUIREMENTS = HERE / "requirements.txt"
STAMP = FOLDER / "requirements.txt"
FEW_WORDS = ("--quiet", "--quiet", "--disable-pip-version-check")
PYTHON = FOLDER / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def environment() -> Path:
    """Return the interpreter of the environment, which is set up first unless it is there and current."""
    if not STAMP.is_file() or STAMP.read_text() != wanted():
        print(f"setting up the peers in {FOLDER.relative_to(ROOT)}, which takes about a minute", flush=True)
        create()
        if install("--editable", str(ROOT), "--requirement", str(REQUIREMENTS)) or install_one_by_one():
            STAMP.write_text(wanted())
    return PYTHON


def create() -> None:
    """Make the environment, empty but for pip."""
    try:
        venv.create(FOLDER, clear=True, with_pip=True)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"no environment can be made, is Python's venv installed (python3-venv)? {error}")


def wanted() -> str:
    """Return what the environment is made from."""
    return f"# Python {sys.version}\n{REQUIREMENTS.read_text()}"


def install_one_by_one() -> bool:
    """Install what can be, each requirement alone; return whether that was everything.

    A peer that is not there is shown as such in the tables. The next run tries again.
    """
    lines = [line for line in REQUIREMENTS.read_text().splitlines() if line and not line.startswith("#")]
    if not install("--editable", str(ROOT)):
        sys.exit("msggen itself cannot be installed, see above")
    failed = [line for line in lines if not install(line)]
    if failed:
        print(f"not installed: {', '.join(failed)}", flush=True)
    return not failed


def install(*arguments: str) -> bool:
    """Run pip; return whether it went well."""
    command = [str(PYTHON), "-m", "pip", "install", *FEW_WORDS, "--no-compile", *arguments]
    return subprocess.run(command, check=False).returncode == 0
