"""The supported versions of Python on this machine, environments for them, and the wheel that these get."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

VERSIONS = ["3.10", "3.11", "3.12", "3.13", "3.14"]
"""Those of pyproject.toml."""


def interpreter(version: str) -> str:
    """Return the Python of this version from the PATH or from pyenv, or skip the test."""
    candidates = [shutil.which(f"python{version}"), *Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
    for candidate in candidates:
        if candidate:
            asked = [str(candidate), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
            if done.stdout.strip() == version:
                return str(candidate)
    pytest.skip(f"needs Python {version}")


def build(source: Path, folder: Path, *kinds: str, **variables: str) -> Path:
    """Build the wheel of msggen in `folder`, and return it. `kinds` are options of `build`, such as `--sdist`."""
    command = [sys.executable, "-m", "build", "--wheel", *kinds, "--outdir", str(folder), str(source)]
    done = subprocess.run(command, env={**os.environ, **variables}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = folder.glob("msggen-*.whl")
    return wheel


def environment(python: str, folder: Path, *wanted: Path | str) -> Path:
    """Create an environment with packages and what they need in `folder`, and return the folder of its programs.

    A wheel can have extras: `msggen-1.0.0-py3-none-any.whl[site]`. The pip of this process installs, so
    that the environment needs none.
    """
    subprocess.run([python, "-m", "venv", "--without-pip", folder], check=True)
    pip = [sys.executable, "-m", "pip", f"--python={folder / 'bin' / 'python'}", "install", "--quiet", "--no-compile"]
    subprocess.run([*pip, *wanted], check=True)
    return folder / "bin"
