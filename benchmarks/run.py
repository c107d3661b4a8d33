"""Measure msggen's generated types and its builds side by side with other packages.

    python benchmarks/run.py            everything; writes docs/benchmarks.md and its charts
    python benchmarks/run.py --quick    checks in a minute that it works; writes nothing

Needs only Python and the package index: environment.py sets up the rest, and measure.py runs in that environment.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from environment import FOLDER, HERE, environment


def main() -> int:
    """Set up the environment, measure in it, and return the exit code of the measurement."""
    parser = argparse.ArgumentParser(description="Measure msggen side by side with other packages.")
    parser.add_argument("--quick", action="store_true", help="few rounds over two messages; writes nothing")
    options = parser.parse_args()
    command = [str(environment()), str(HERE / "measure.py"), *(["--quick"] if options.quick else [])]
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    variables["CYDR_CACHE_DIR"] = str(FOLDER / "cydr")  # keep compiled codecs with the environment
    return subprocess.run(command, check=False, env=variables).returncode


if __name__ == "__main__":
    sys.exit(main())
