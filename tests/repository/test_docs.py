"""Tests of the documentation: links resolve, examples show the real output, and the picture is current."""

from __future__ import annotations

import doctest
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.cli import main
from support.catalogs import write_definitions
from support.repository import ROOT
from support.ros_packages import DEFINITIONS

README = (ROOT / "README.md").read_text()
IDENTITY = ["-c", "user.name=somebody", "-c", "user.email=somebody@example.com"]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_page_is_listed_in_the_readme() -> None:
    assert [page.name for page in PAGES[1:] if f"docs/{page.name}" not in README] == []


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "install.md"], ids=lambda page: page.name)
def test_a_page_that_installs_from_the_index_says_how_to_install_from_a_clone(page: Path) -> None:
    """An extra in the text has its name only, and docs/install.md, which compares both, says how to install it."""
    for line in page.read_text(encoding="utf-8").splitlines():
        if extras := re.search(r"pip install '?msggen\[([\w,]+)\]", line):
            command = f"  # in a clone: '.[{extras[1]}]'"
            assert line.endswith(command), f"{line}{command}"


def test_ci_runs_the_test_command_of_the_readme() -> None:
    command = next(line for line in README.splitlines() if line.startswith("$ ") and "-m pytest" in line)
    assert command.removeprefix("$ ") in (ROOT / ".ci" / "run").read_text().splitlines()


def test_the_tour_prints_what_the_readme_shows() -> None:
    done = subprocess.run([sys.executable, "examples/tour.py"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout in README


ERRORS = {
    "CommandError": "parameters.CommandError",
    "ClockError": "timesync.ClockError",
    "FrameError": "rotations.FrameError",
    "KeyError": "hints.UnknownName",
    "NotConverged": "timesync.NotConverged",
    "UnitError": "units.UnitError",
}
"""The modules of errors that are not in `cdr`. The pages show UnknownName by the name of its base class."""


PAGES_OF_CODE = (
    "package.md",
    "frames.md",
    "meaning.md",
    "ros2.md",
    "wire.md",
)


def raised(match: re.Match[str]) -> str:
    """Return the line of an error as doctest expects it."""
    name = ERRORS.get(match[1], f"cdr.{match[1]}")
    return f"Traceback (most recent call last):\npx4_types.{name}: "


@pytest.mark.parametrize("name", PAGES_OF_CODE)
def test_the_interactive_examples_are_real(name: str) -> None:
    page = ROOT / "docs" / name
    sys.path.insert(0, str(ROOT / "generated"))
    blocks = re.findall(r"```pycon\n(.*?)```", page.read_text(), re.DOTALL)
    source = re.sub(r"(?m)^(\w+Error|NotConverged): ", raised, "\n".join(blocks))
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    names = {"SensorCombined": __import__("px4_types").SensorCombined}
    results = runner.run(parser.get_doctest(source, names, page.name, str(page), 0))
    assert (results.failed, results.attempted) == (0, source.count(">>> "))


def test_the_pictures_are_current() -> None:
    draw = runpy.run_path(str(ROOT / "docs" / "draw_layout.py"))["draw"]
    assert draw("SensorCombined") == (ROOT / "docs" / "sensor_combined.svg").read_text()
    draw = runpy.run_path(str(ROOT / "docs" / "draw_timestamps.py"))["draw"]
    assert draw() == (ROOT / "docs" / "timestamps.svg").read_text()


def sessions(page: str) -> list[str]:
    """Return the console sessions of a page that need nothing except msggen and the embedded set."""
    blocks = re.findall(r"```console\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL)
    return [block for block in blocks if "\n$ msggen" in f"\n{block}"]


@pytest.mark.slow
@pytest.mark.tools("git")
@pytest.mark.parametrize("page", ["check.md"])
def test_the_sessions_of_a_page_are_real(page: str, tmp_path: Path) -> None:
    """Each command prints what the page shows below it; all of them run in order in one shell."""
    tree = tmp_path / "PX4-Autopilot"
    bridge = tree / "src" / "modules" / "uxrce_dds_client"
    bridge.mkdir(parents=True)
    for folder in ("msg", "srv"):
        shutil.copytree(ROOT / folder, tree / folder)
    shutil.copy(ROOT / "dds_topics.yaml", bridge)
    for command in (["init", "-q", "-b", "main"], ["add", "."], [*IDENTITY, "commit", "-q", "-m", "as released"]):
        subprocess.run(["git", *command], cwd=tree, check=True)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    shown = "".join(sessions(page))
    commands = [line.removeprefix("$ ") for line in shown.splitlines() if line.startswith("$ ")]
    script = "\n".join(f"echo {shlex.quote(f'$ {command}')}\n{command}" for command in commands)
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PATH": path, "AMENT_PREFIX_PATH": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.stdout == shown


COUNTS = re.compile(
    r"^px4_types from (?P<source>.*?): (?P<messages>\d+) messages?, (?:(?P<archived>\d+) archived versions?, )?"
    r"(?P<services>\d+) services?, \d+ uORB topics?, \d+ endpoints?;"
    r"(?: (?P<more>\d+) messages? of (?P<packages>[^;]+);)?"
    r".*\n(?:\S+ is up to date, (?P<all>\d+) files|"
    r"\S+: (?P<written>\d+) files written, \d+ removed, (?P<unchanged>\d+) unchanged)",
    re.MULTILINE,
)
"""The two lines of a build: the definitions, and the files."""


class Build(NamedTuple):
    """A build: its sources, the kind of its definitions, and the number of files besides those of a definition."""

    source: str
    is_archived: bool
    packages: int
    further: int


def builds(text: str) -> list[Build]:
    """Return the builds in the output of msggen."""
    found = []
    for each in COUNTS.finditer(text):
        defined, files = (
            sum(int(each[key] or 0) for key in keys)
            for keys in (("messages", "archived", "services", "more"), ("all", "written", "unchanged"))
        )
        packages = len(each["packages"].split(",")) if each["packages"] else 0
        found.append(Build(each["source"], bool(each["archived"]), packages, files - defined))
    return found


@pytest.mark.parametrize(
    ("options", "is_archived", "packages"), [("", False, 0), ("--archived", True, 0), ("--msg-dir", False, 3)]
)
def test_the_numbers_of_files_in_the_pages_are_real(
    options: str, *, is_archived: bool, packages: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A build with as many definitions of the same kind writes as many files."""
    words = options.split()
    if packages:
        names = ["builtin_interfaces", "geometry_msgs", "std_msgs"]
        for name in names:
            write_definitions(tmp_path / name, DEFINITIONS[name])
        words = [word for name in names for word in ("--msg-dir", f"{name}={tmp_path / name}")]
    assert main(["build", "--px4", "embedded:v1.18", "-o", str(tmp_path / "made"), *words]) == 0
    [real] = builds(capsys.readouterr().out)
    shown = {
        (page.name, build.further)
        for page in PAGES
        for build in builds(page.read_text())
        if (build.is_archived, build.packages) == (is_archived, packages)
    }
    assert shown == {(name, real.further) for name, _ in shown}
    assert shown


def test_the_numbers_of_definitions_in_the_pages_are_real(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The first line of a build of an embedded release is as msggen prints it."""
    text = "\n".join(page.read_text() for page in PAGES)
    shown = re.findall(r"^px4_types from the embedded PX4 (v[\d.]+): .*", text, re.MULTILINE)
    assert len(shown) > 1
    for release in set(shown):
        assert main(["build", "--px4", f"embedded:{release}", "-o", str(tmp_path)]) == 0
        real = capsys.readouterr().out.splitlines()[0]
        lines = re.findall(rf"^px4_types from the embedded PX4 {re.escape(release)}: .*", text, re.MULTILINE)
        assert set(lines) == {real}
