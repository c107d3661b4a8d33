"""Tests of the wheel as a user installs it: in an empty environment of every Python, outside the checkout."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from msggen.base.diagnostics import CODES
from msggen.base.version import __version__
from msggen.check.finding import Category
from msggen.show.report.table import RULES
from msggen.sources.embedded import EMBEDDED
from support.interpreters import VERSIONS, build, environment, interpreter
from support.repository import ROOT

OWN = f"{sys.version_info.major}.{sys.version_info.minor}"

EPOCH = 1_800_000_000
"""The time of all files of a build, for all who build it: that of the commit, when a release is built."""

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
    """With the backend of this environment: to install it in one of its own takes as long as both builds."""
    return build(ROOT, tmp_path_factory.mktemp("wheel"), "--sdist", "--no-isolation", SOURCE_DATE_EPOCH=str(EPOCH))


@pytest.fixture(scope="module")
def sdist(wheel: Path) -> Path:
    return next(wheel.parent.glob("msggen-*.tar.gz"))


@pytest.mark.slow
def test_the_wheel_brings_templates_and_the_embedded_set(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {
        "msggen/templates/python/message.py.j2",
        "msggen/embedded/dds_topics.yaml",
        "msggen/embedded/zenoh_topics.yaml",
    } <= names
    assert {"msggen/templates/ros2/package.xml.j2", "msggen/show/report/errors.yaml"} <= names
    messages = [name for name in names if name.startswith("msggen/embedded/msg/") and "px4_msgs_old" not in name]
    assert len([name for name in messages if name.endswith(".msg")]) == 259
    assert {f"msggen/embedded/releases/{release}.msgs" for release in EMBEDDED[1:]} <= names
    assert "msggen/embedded/msg/CMakeLists.txt" in names
    assert any(name.endswith(".data/data/share/cmake/msggen/msggenConfig.cmake") for name in names)
    assert {name.split("/")[0].split("-")[0] for name in names} == {"msggen"}


@pytest.mark.slow
@pytest.mark.tools("git")
def test_the_source_distribution_has_what_git_does_not_ignore(sdist: Path) -> None:
    """Tests, pages and the committed package, too: a distribution builds and tests from it."""
    done = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        pytest.skip("this folder is no clone")
    with tarfile.open(sdist) as file:
        members = {member.name.partition("/")[2]: member for member in file}
    assert members.keys() - {"PKG-INFO"} == {name for name in done.stdout.split("\n") if (ROOT / name).is_file()}
    assert {member.mtime for member in members.values()} == {EPOCH}
    assert members[".ci/run"].mode & 0o100


@pytest.mark.night  # builds once more
def test_another_build_has_the_same_bytes(wheel: Path, sdist: Path, tmp_path: Path) -> None:
    """From the source distribution, in another folder, with other times, by a user with another umask and time zone."""
    source = unpacked(sdist, tmp_path)
    for place, path in enumerate(sorted(source.rglob("*"), reverse=True)):
        path.chmod(path.stat().st_mode & 0o700)
        os.utime(path, (place, place))
    umask = os.umask(0o077)
    try:
        other = build(source, tmp_path / "dist", "--sdist", SOURCE_DATE_EPOCH=str(EPOCH), TZ="Asia/Kathmandu")
    finally:
        os.umask(umask)
    assert other.read_bytes() == wheel.read_bytes()
    assert (other.parent / sdist.name).read_bytes() == sdist.read_bytes()


@pytest.mark.night
def test_tests_pass_in_the_source_distribution(sdist: Path, tmp_path: Path) -> None:
    source = unpacked(sdist, tmp_path)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "0",
        "-m",
        "not slow",
        "tests/definitions",
        "tests/repository/test_repository.py",
    ]
    run(source, *command, PYTHONPATH=str(source))


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
    """With the command of the workflow that releases."""
    (tmp_path / "python3").symlink_to(interpreter(version))
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    run(tmp_path, str(ROOT / ".ci" / "portable"), str(wheel), PATH=path)


INSTALLERS = {
    "uvx": ("uvx --python {python} --from {wheel} msggen", "uvx --from '{wheel}[view]' msggen"),
    "uv tool": ("uv tool install --python {python} {wheel}", "uv tool install '{wheel}[view]'"),
    "pipx": ("pipx install --python {python} {wheel}", "pipx install --force '{wheel}[view]'"),
}
"""How programs that give msggen an environment of its own install it, and what msggen prints to install an extra."""


@pytest.fixture(scope="module")
def installers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return environment(sys.executable, tmp_path_factory.mktemp("installers") / "environment", "pipx", "uv")


@pytest.mark.night
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("installer", INSTALLERS)
def test_it_is_installed_as_a_program_by(
    installer: str, version: str, installers: Path, wheel: Path, tmp_path: Path
) -> None:
    python = interpreter(version)
    install, extra = (text.format(python=python, wheel=wheel) for text in INSTALLERS[installer])
    folders = {name: str(tmp_path / name) for name in FOLDERS} | {"UV_CACHE_DIR": str(installers / "cache")}
    programs = [*(folders[name] for name in FOLDERS if "BIN" in name), str(installers), os.environ["PATH"]]
    variables = {**folders, "PATH": os.pathsep.join(programs)}
    words = shlex.split(install)
    if words[0] != "uvx":
        run(tmp_path, *words, **variables)
        words = ["msggen"]
    empty = tmp_path / "empty"
    empty.mkdir()
    assert run(empty, *words, "--version", **variables) == f"msggen {__version__}\n"
    run(empty, *words, "build", **variables)
    check_package(empty / "generated" / "px4_types")
    run(empty / "generated", python, "-c", "from px4_types import VehicleStatus")
    without = attempt(empty, *words, "view", **variables)
    assert without.returncode == 2
    assert f"L111 this package is not installed: {extra}\n" in without.stderr


FOLDERS = ("UV_TOOL_DIR", "UV_TOOL_BIN_DIR", "PIPX_HOME", "PIPX_BIN_DIR")
"""Variables that keep what uv and pipx write out of the user's folders."""


def unpacked(sdist: Path, folder: Path) -> Path:
    """Unpack a source distribution, and return its folder."""
    shutil.unpack_archive(sdist, folder)
    return folder / sdist.name.removesuffix(".tar.gz")


def check_package(made: Path) -> None:
    """Check that a package has the files of the committed one."""
    committed = ROOT / "generated" / "px4_types"
    for path in committed.rglob("*.py"):
        assert (made / path.relative_to(committed)).read_bytes() == path.read_bytes()


def run(folder: Path, *command: str, **more: str) -> str:
    done = attempt(folder, *command, **more)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def attempt(folder: Path, *command: str, **more: str) -> subprocess.CompletedProcess[str]:
    variables = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "VIRTUAL_ENV"}} | more
    program = shutil.which(command[0], path=variables["PATH"]) or command[0]
    return subprocess.run(
        [program, *command[1:]], cwd=folder, env=variables, capture_output=True, text=True, check=False
    )
