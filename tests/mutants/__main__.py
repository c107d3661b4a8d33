"""The command `python -m tests.mutants`: break single lines, and name those whose break no test notices."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from random import Random
from typing import NamedTuple

sys.path[0:0] = [str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "")]

from msggen.base.diagnostics import counted  # noqa: E402
from mutants.changes import Change, changes_of  # noqa: E402
from support.repository import ROOT  # noqa: E402

ROOMS = {
    "msggen/flight": ("tests/flight",),
    "msggen/doctor": ("tests/doctor",),
    "msggen/vehicle/owner": ("tests/vehicle/owner",),
    "msggen/link": ("tests/link",),
    "msggen/vehicle": ("tests/vehicle",),
    "msggen/link/xrce": ("tests/link/xrce", "tests/link"),
}
"""The rooms that fly, and the folders of their tests."""
_PATIENCE = 60.0
"""The longest time in s for the tests of one change: a change can make them wait."""
_LEFT_OUT = shutil.ignore_patterns(".venv", ".git", ".*_cache", "__pycache__")


class Mutant(NamedTuple):
    """A module with a change."""

    module: str
    change: Change

    def told(self, source: bytes) -> str:
        """Return the place and the change in one line."""
        was = " ".join(source[self.change.start : self.change.stop].decode().split())
        return f"{self.module}:{self.change.line}: {was or 'nothing'} -> {self.change.text or 'nothing'}"


def sample(root: Path, rooms: Iterable[str], seed: int) -> list[Mutant]:
    """Return all changes of the rooms, folders or modules, in an order that follows from the seed."""
    places = [root / room for room in rooms]
    modules = sorted(path for place in places for path in ([place] if place.is_file() else place.rglob("*.py")))
    found = [Mutant(str(path.relative_to(root)), each) for path in modules for each in changes_of(path.read_bytes())]
    Random(seed).shuffle(found)  # noqa: S311 - a sample, not a secret
    return found


def pytest_of(root: Path, *words: str, seconds: float, **more: str) -> int | None:
    """Run tests in a copy of the repository. Return their exit code, None if the time is over."""
    variables = {**os.environ, "PYTHONPATH": str(root / "tests"), "PYTEST_ADDOPTS": "", **more}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:randomly", "-p", "no:cacheprovider", *words]
    process = subprocess.Popen(command, cwd=root, env=variables, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.terminate()
        process.wait()
        return None


def tests_of(root: Path, modules: set[str], folders: Iterable[str], seconds: float) -> Mapping[str, dict[str, object]]:
    """Return the tests that ran in this time, each with its duration, and the lines of the modules that it ran."""
    found = root / "lines.json"
    found.write_text("{}")
    more = {"MUTANTS_MODULES": json.dumps([str(root / each) for each in modules]), "MUTANTS_LINES": str(found)}
    files = sorted({path for folder in folders for path in (root / folder).rglob("test_*.py")})
    stems = [Path(each).stem for each in modules]
    files.sort(key=lambda path: not any(stem in path.stem for stem in stems))  # those of the modules first
    options = ("-p", "mutants.lines", "-m", "not slow and not night")
    pytest_of(root, *options, *map(str, files), seconds=seconds, **more)
    rows: dict[str, dict[str, object]] = json.loads(found.read_text())
    return rows


def survivors(root: Path, mutants: Iterable[Mutant], folders: Iterable[str], until: float) -> Iterator[str]:
    """Yield the changes that no test has noticed, among those that some test runs. Others are not judged."""
    modules = {each.module for each in mutants}
    tests = tests_of(root, modules, folders, (until - time.monotonic()) / 3)
    for mutant in mutants:
        name = str(root / mutant.module)
        its = [each for each, row in tests.items() if mutant.change.line in row["lines"].get(name, ())]  # type: ignore[attr-defined]
        its.sort(key=lambda each: tests[each]["seconds"])  # type: ignore[arg-type, return-value]
        if its and time.monotonic() < until:
            yield from _survivor(root, mutant, its[:20])


def _survivor(root: Path, mutant: Mutant, tests: list[str]) -> Iterator[str]:
    path = root / mutant.module
    source = path.read_bytes()
    path.write_bytes(mutant.change.applied(source))
    try:
        code = pytest_of(root, "-x", *tests, seconds=_PATIENCE)
    finally:
        path.write_bytes(source)
    told = f"{mutant.told(source)}, with {counted(len(tests), 'test')}"
    print("survived" if code == 0 else "noticed ", told, flush=True)
    if code == 0:
        yield told


def main() -> int:
    """Report the changes of a sample that no test has noticed. The exit code is 0: a change can be harmless."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument(
        "rooms", nargs="*", default=list(ROOMS), help=f"folders or modules (default: {' '.join(ROOMS)})"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample (default: 1)")
    parser.add_argument("--minutes", type=float, default=10, help="time for all (default: 10)")
    options = parser.parse_args()
    until = time.monotonic() + options.minutes * 60
    folders = [
        each for room, its in ROOMS.items() if any(name.startswith(room) for name in options.rooms) for each in its
    ]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        root = Path(folder) / "copy"
        shutil.copytree(ROOT, root, ignore=_LEFT_OUT, symlinks=True)
        found = list(survivors(root, sample(root, options.rooms, options.seed), folders, until))
    print(f"{len(found)} changes that no test noticed, seed {options.seed}", *found, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
