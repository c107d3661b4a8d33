"""Measure `msggen lsp` in relation to `msggen build`: until a tree is ready, and after each key.

    python benchmarks/editor.py            half a minute; docs/editor.md shows the figures
    python benchmarks/editor.py --quick    checks in a few seconds that it works

The tree has the definitions of PX4 v1.18. Both run in turns, in processes of their own, and the medians are compared.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from environment import ROOT
from tables import Table

sys.path.insert(0, str(ROOT / "tests"))

from support.editor import editor
from support.firmware_trees import write_tree

KEYS = 20


def seconds_of_build(tree: Path) -> float:
    """Return the time of a build of all types, from nothing, with the start of Python."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        command = [sys.executable, "-m", "msggen", "build", "--px4", str(tree), "-o", folder, "-q"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def seconds_of_editor(tree: Path) -> tuple[float, float, float]:
    """Return the time of the start, from the opened file to an answer, and from a key to an answer."""
    path = tree / "msg" / "versioned" / "VehicleStatus.msg"
    text = path.read_text(encoding="utf-8")
    start = time.perf_counter()
    with editor() as session:
        started = time.perf_counter()
        session.open(path)
        session.hover(path, 0, 0)
        ready = time.perf_counter()
        keys = []
        for number in range(KEYS):
            before = time.perf_counter()
            session.type(path, f"{text}uint8 added_{number}\n")
            session.hover(path, 0, 0)
            keys.append(time.perf_counter() - before)
        return started - start, ready - started, median(keys)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one round")
    rounds = 1 if parser.parse_args().quick else 9
    with tempfile.TemporaryDirectory() as folder:
        tree = write_tree(Path(folder) / "px4", "v1.18")
        measured = [(seconds_of_build(tree), *seconds_of_editor(tree)) for _ in range(rounds)]
    build, *others = (median(column) for column in zip(*measured, strict=True))
    names = ("start of the server", "until the tree is ready", "until a key is answered", "`msggen build`")
    rows = [
        (name, f"{seconds:.3f} s", f"{seconds / build:.2f}")
        for name, seconds in zip(names, (*others, build), strict=True)
    ]
    Table("Time", ("", "time", "of a build"), rows).print()


if __name__ == "__main__":
    main()
