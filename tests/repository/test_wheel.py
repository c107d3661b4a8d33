"""Tests of the wheel as a user installs it: in an empty environment of every Python, outside the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from msggen.base.diagnostics import CODES
from msggen.check.finding import Category
from msggen.show.report.table import RULES
from msggen.sources.embedded import EMBEDDED
from support.interpreters import VERSIONS, environment, interpreter
from support.repository import ROOT

OWN = f"{sys.version_info.major}.{sys.version_info.minor}"

EXPLAINED = [*CODES, *Category.__members__, *(rule.id for rule in RULES)]
"""All names that `msggen explain` knows."""

CMAKE = """
cmake_minimum_required(VERSION 3.20)
project(found LANGUAGES NONE)
find_package(msggen REQUIRED)
msggen_generate(wheel_types PX4 v1.14)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("msggen-*.whl"))


@pytest.mark.slow
def test_the_wheel_brings_templates_and_the_embedded_set(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {"msggen/templates/python/message.py.j2", "msggen/embedded/dds_topics.yaml"} <= names
    assert {"msggen/templates/ros2/package.xml.j2", "msggen/show/report/errors.yaml"} <= names
    messages = [name for name in names if name.startswith("msggen/embedded/msg/") and "px4_msgs_old" not in name]
    assert len([name for name in messages if name.endswith(".msg")]) == 259
    assert {f"msggen/embedded/releases/{release}.msgs" for release in EMBEDDED[1:]} <= names
    assert "msggen/embedded/msg/CMakeLists.txt" in names
    assert any(name.endswith(".data/data/share/cmake/msggen/msggenConfig.cmake") for name in names)
    assert {name.split("/")[0].split("-")[0] for name in names} == {"msggen"}


@pytest.mark.night  # installs; each run looks into the wheel
def test_it_works_in_an_empty_environment(wheel: Path, tmp_path: Path) -> None:
    programs = environment(sys.executable, tmp_path / "environment", wheel)
    python, msggen = str(programs / "python"), str(programs / "msggen")
    run(tmp_path, msggen, "build", "-o", "made")
    run(tmp_path, msggen, "build", "-o", "made", "--check")
    for command in (["sync", "--create", "px4_msgs"], ["check", "px4_msgs"], ["completion", "zsh"], ["releases"]):
        run(tmp_path, msggen, *command)
    explain_all = f"from msggen.cli import main; assert not any([main(['explain', name]) for name in {EXPLAINED}])"
    run(tmp_path, python, "-I", "-c", explain_all)
    assert len(list((tmp_path / "px4_msgs" / "msg").iterdir())) == 259
    program = "from px4_types import SensorCombined as S; assert S.decode(S(timestamp=1).encode()).timestamp == 1"
    run(tmp_path / "made", python, "-I", "-c", f"import sys; sys.path.insert(0, '.'); {program}")
    check_package(tmp_path / "made" / "px4_types")
    shown = f"pip install '{wheel}[dds]'"
    hint = f"from msggen.base.missing import installing; assert installing('dds') == {shown!r}, installing('dds')"
    run(tmp_path, python, "-I", "-c", hint)
    if shutil.which("cmake"):
        (tmp_path / "CMakeLists.txt").write_text(CMAKE)
        path = f"{programs}{os.pathsep}{os.environ['PATH']}"
        run(tmp_path, "cmake", "-S", ".", "-B", "found", PATH=path)
        run(tmp_path, "cmake", "--build", "found")
        assert (tmp_path / "found" / "python" / "wheel_types" / "topics.py").is_file()


@pytest.mark.night
@pytest.mark.tools
@pytest.mark.parametrize("version", [version for version in VERSIONS if version != OWN])
def test_the_tool_works_on(version: str, wheel: Path, tmp_path: Path) -> None:
    programs = environment(interpreter(version), tmp_path / "environment", wheel)
    run(tmp_path, str(programs / "msggen"), "build", "--quiet")
    check_package(tmp_path / "generated" / "px4_types")


def check_package(made: Path) -> None:
    """Check that a package has the files of the committed one."""
    committed = ROOT / "generated" / "px4_types"
    for path in committed.rglob("*.py"):
        assert (made / path.relative_to(committed)).read_bytes() == path.read_bytes()


def run(folder: Path, *command: str, **more: str) -> None:
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=folder, env={**variables, **more}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
