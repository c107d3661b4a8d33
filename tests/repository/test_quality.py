"""Tests that the linters and type checkers pass and that the committed output is current."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.generate.python.package import render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.checkers import GENERATED
from support.imports import HEAVY
from support.repository import ROOT

PACKAGE = GENERATED / "px4_types"


def run(*command: str, cwd: Path = ROOT) -> None:
    """Run a module of this environment; fail with its output."""
    done = subprocess.run([sys.executable, "-m", *command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_committed_package_is_what_the_tool_makes() -> None:
    expected = render_package(read_catalog(find_sources(None)), "px4_types")
    kept = [path for path in PACKAGE.rglob("*") if path.suffix in (".py", ".typed") or path.name == "names.json"]
    found = {str(path.relative_to(PACKAGE)): path for path in kept}
    assert sorted(found) == sorted(expected)
    stale = [name for name, path in found.items() if path.read_text(encoding="utf-8") != expected[name]]
    assert stale == [], "run `msggen build` and commit what it wrote"


@pytest.mark.parametrize("command", [["check", "."], ["format", "--check", "."]], ids=["check", "format"])
def test_ruff_is_content(command: list[str]) -> None:
    run("ruff", *command, "--no-cache")


def test_ruff_is_content_with_the_generated_package() -> None:
    rules = "E,F,W,B,C4,PLE,SIM,UP"
    run(
        "ruff",
        "check",
        "--isolated",
        "--no-cache",
        "--target-version=py310",
        f"--select={rules}",
        "--ignore=B905,UP007",
        "--line-length=130",
        "generated",
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "paths", [("msggen",), pytest.param((), marks=pytest.mark.night)], ids=["the product", "the tests, too"]
)
def test_mypy_is_content(paths: tuple[str, ...]) -> None:
    """In a fresh clone, which no later run follows, mypy writes no cache: that takes a fifth of its time."""
    is_fresh = not any((ROOT / ".mypy_cache").glob("3.*"))
    run("mypy", *([f"--cache-dir={os.devnull}"] if is_fresh else []), *paths)


@pytest.mark.slow
def test_mypy_is_content_with_generated_packages_and_what_uses_them(errors: list[str]) -> None:
    assert [line for line in errors if not line.startswith("mistakes.py:")] == []


@pytest.mark.slow
def test_the_types_catch_mistakes(errors: list[str]) -> None:
    assert {int(line.split(":")[1]) for line in errors if line.startswith("mistakes.py:")} == {4, 5, 6, 7}


def test_a_build_with_nothing_to_do_imports_nothing_heavy(tmp_path: Path) -> None:
    run("msggen", "build", "-q", "-o", str(tmp_path))
    program = "import sys; from msggen.cli import main; main(['build', '-q', '-o', sys.argv[1]]); print(*sys.modules)"
    command = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & {*done.stdout.split()}
