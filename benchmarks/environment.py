"""The environment of the benchmarks, with the peers from the package index and msggen from this checkout.

It is kept in a folder that git ignores, until requirements.txt or the interpreter changes.
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
    """Return the interpreter of the environment. Set it up first if it is missing or outdated."""
    if not STAMP.is_file() or STAMP.read_text() != wanted():
        print(f"setting up the peers in {FOLDER.relative_to(ROOT)}, which takes about a minute", flush=True)
        create()
        if install("--editable", str(ROOT), "--requirement", str(REQUIREMENTS)) or install_one_by_one():
            STAMP.write_text(wanted())
    return PYTHON


def create() -> None:
    """Create the environment, with only pip in it."""
    try:
        venv.create(FOLDER, clear=True, with_pip=True)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"cannot create an environment, is Python's venv installed (python3-venv)? {error}")


def wanted() -> str:
    """Return the inputs of the environment."""
    return f"# Python {sys.version}\n{REQUIREMENTS.read_text()}"


def install_one_by_one() -> bool:
    """Install each requirement separately. Return whether all of them were installed.

    The tables show a peer that is missing. The next run tries again.
    """
    lines = [line for line in REQUIREMENTS.read_text().splitlines() if line and not line.startswith("#")]
    if not install("--editable", str(ROOT)):
        sys.exit("msggen itself cannot be installed, see above")
    failed = [line for line in lines if not install(line)]
    if failed:
        print(f"not installed: {', '.join(failed)}", flush=True)
    return not failed


def install(*arguments: str) -> bool:
    """Run pip. Return whether it succeeded."""
    command = [str(PYTHON), "-m", "pip", "install", *FEW_WORDS, "--no-compile", *arguments]
    return subprocess.run(command, check=False).returncode == 0
