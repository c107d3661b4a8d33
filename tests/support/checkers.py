"""mypy, as tests run it on generated packages and on programs that use them."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from support.repository import ROOT

GENERATED = ROOT / "generated"

_CACHE = (ROOT if os.access(ROOT, os.W_OK) else Path(tempfile.gettempdir())) / ".mypy_cache" / "tests"
"""Shared by all runs, so that only the first reads the standard library, numpy and px4_types."""


def mypy(folder: Path, *arguments: str, path: Path | str = "") -> subprocess.CompletedProcess[str]:
    """Run mypy in `folder`, which need not be in this checkout. Modules are also found in `path`.

    All runs have the same options, which the cache depends on. One process at a time uses it, and the next one finds
    it filled.
    """
    options = ["--strict", "--python-version=3.10", "--config-file=", "--no-error-summary"]
    command = [sys.executable, "-m", "mypy", *options, *arguments]
    environment = {**os.environ, "MYPYPATH": str(path), "MYPY_CACHE_DIR": str(_CACHE)}
    _CACHE.mkdir(parents=True, exist_ok=True)
    with (_CACHE / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
