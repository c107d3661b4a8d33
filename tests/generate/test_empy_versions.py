"""Tests that templates come out the same under EmPy 3.3 and under EmPy 4.

The version that is not installed comes from the package index.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import em
import pytest

from msggen.sources.embedded import EMBEDDED
from support.programs import required
from support.repository import ROOT

IS_EMPY_3 = em.__version__.startswith("3.")
OTHER, START = ("empy>=4,<5", "4.") if IS_EMPY_3 else ("empy>=3.3,<4", "3.3")
FILES = ["test_empy.py", "test_px4_generate.py", "test_render.py"]


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the version of EmPy that is not installed. A Python that has it in PYTHONPATH imports this one."""
    folder = tmp_path_factory.mktemp("empy")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--no-deps", "--target", str(folder)]
    required(f"{OTHER} of the package index", is_there=subprocess.run([*pip, OTHER], check=False).returncode == 0)
    return folder


def run(*arguments: str, paths: tuple[Path, ...], cwd: Path = ROOT) -> str:
    """Run Python with further folders to import from, and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*paths, ROOT / "tests")))}
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def contents(folder: Path) -> dict[str, bytes]:
    """Return the content of each file."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.night
@pytest.mark.parametrize("release", EMBEDDED)
def test_all_templates_come_out_the_same_under_the_other_version(release: str, other: Path, tmp_path: Path) -> None:
    made = []
    for paths, start in (((), em.__version__), ((other,), START)):
        folder = tmp_path / start
        folder.mkdir()
        printed = run("-m", "support.empy_templates", release, paths=paths, cwd=folder)
        assert printed.splitlines()[-1].startswith(start)
        made.append(contents(folder / "out"))
    installed, others = made
    assert len(installed) > 900
    assert installed == others


@pytest.mark.night
@pytest.mark.parametrize("file", FILES)
def test_the_tests_of_templates_pass_under_the_other_version(file: str, other: Path) -> None:
    arguments = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not night", f"tests/generate/{file}"]
    run(*arguments, paths=(other,))
