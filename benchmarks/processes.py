"""How long whole processes take: builds, syncs, checks, and the import of one type and of all.

    python benchmarks/processes.py

Rounds alternate between the commands, and minima are compared: differences to a bare interpreter of the same
round hold on any machine. Nothing here asserts a time.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROUNDS = 15
ROOT = Path(__file__).resolve().parent.parent
GENERATED = ROOT / "generated"


def main() -> None:
    """Run all rounds and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        msggen = [sys.executable, "-m", "msggen"]
        build = [*msggen, "build", "--quiet", "--output"]
        source = ["--px4", str(ROOT)]
        importing = f"import sys; sys.path.insert(0, {str(GENERATED)!r}); "
        commands = {
            "bare interpreter": [sys.executable, "-c", "pass"],
            "build, all of v1.17": [*build, f"{folder}/ROUND"],
            "build, nothing to do": [*build, f"{folder}/same"],
            "sync, a whole new package": [*msggen, "sync", "-q", *source, "--create", f"{folder}/px4_msgs_ROUND"],
            "sync, nothing to do": [*msggen, "sync", "-q", *source, "--create", f"{folder}/px4_msgs"],
            "check, a package against its firmware": [*msggen, "check", *source, f"{folder}/px4_msgs"],
            "from px4_types import SensorCombined": [
                sys.executable,
                "-c",
                f"{importing}from px4_types import SensorCombined",
            ],
            "from px4_types import *": [sys.executable, "-c", f"{importing}from px4_types import *"],
            "from px4_types import topics": [sys.executable, "-c", f"{importing}from px4_types import topics"],
        }
        best = dict.fromkeys(commands, float("inf"))
        for number in range(ROUNDS + 1):
            for name, command in commands.items():
                took = seconds([part.replace("ROUND", str(number)) for part in command])
                best[name] = min(best[name], took) if number else best[name]
    bare = best["bare interpreter"]
    print(f"{'':40}{'ms':>8}{'above bare':>12}   ({ROUNDS} rounds, minima; Python {sys.version.split()[0]})")
    for name, took in best.items():
        print(f"{name:40}{took * 1e3:8.1f}{(took - bare) * 1e3:12.1f}")


def seconds(command: list[str]) -> float:
    """Run a command, with bytecode cached, and return the wall-clock time it took."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    started = time.perf_counter()
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
