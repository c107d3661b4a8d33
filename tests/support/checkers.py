"""mypy, as tests run it on generated packages and on programs that use them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from support.repository import ROOT

GENERATED = ROOT / "generated"

_CACHE = ROOT / ".mypy_cache" / "tests" / os.environ.get("PYTEST_XDIST_WORKER", "all")
"""Shared by the runs of one process, so that only the first reads the standard library, numpy and px4_types."""


def mypy(folder: Path, *arguments: str, path: Path | str = "") -> subprocess.CompletedProcess[str]:
    """Run mypy in `folder`, which need not be in this checkout. Modules are also found in `path`.

    All runs have the same options, which the cache depends on.
    """
    options = ["--strict", "--python-version=3.10", "--config-file=", "--no-error-summary"]
    command = [sys.executable, "-m", "mypy", *options, *arguments]
    environment = {**os.environ, "MYPYPATH": str(path), "MYPY_CACHE_DIR": str(_CACHE)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
