"""Measure msggen side by side with other packages.

    python benchmarks/run.py               types and builds; writes docs/benchmarks.md and its charts
    python benchmarks/run.py recordings    reading of recordings; prints tables
    python benchmarks/run.py --quick       checks in a minute that it works; writes nothing

Needs only Python and the package index: environment.py sets up the rest, and a program runs in that environment.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from environment import FOLDER, HERE, environment

PROGRAMS = {"types": "measure.py", "recordings": "recordings.py"}


def main() -> int:
    """Set up the environment, measure in it, and return the exit code of the measurement."""
    parser = argparse.ArgumentParser(description="Measure msggen side by side with other packages.")
    parser.add_argument("what", nargs="?", choices=PROGRAMS, default="types", help="what to measure (default: types)")
    parser.add_argument("--quick", action="store_true", help="little, to see that it works; writes nothing")
    options = parser.parse_args()
    command = [str(environment()), str(HERE / PROGRAMS[options.what]), *(["--quick"] if options.quick else [])]
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    variables["CYDR_CACHE_DIR"] = str(FOLDER / "cydr")  # keep compiled codecs with the environment
    return subprocess.run(command, check=False, env=variables).returncode


if __name__ == "__main__":
    sys.exit(main())
