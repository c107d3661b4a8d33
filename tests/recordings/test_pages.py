"""Tests of the pages on recordings: a reader who copies their commands and code gets what they show.

Each page runs from an empty folder: one in each run, and at night all, also with only the packages that they name.
"""

from __future__ import annotations

import ast
import json
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.interpreters import build, environment
from support.network import isolated
from support.pages import INSTALL, Step, check_outputs, matches, normalised, outputs_of, reading, steps_of, variables_of
from support.ports import free_port
from support.programs import required
from support.repository import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_SITE = runpy.run_path(str(ROOT / "docs" / "product" / "site_pages.py"))
PAGES = [page.removeprefix("docs/") for page in _SITE["GROUPS"]["Recordings"]]
LIVE = {"recordings": "Record a vehicle"}
"""The sections of pages with a running vehicle, whose numbers differ from run to run."""
TOOLS = {"stores": ("curl",)}
"""Programs that pages need and not every system has."""
BY_DAY = {"reading"}
"""The page for each run; the others are for the night: by day, tests of their own run the same commands."""
ELSEWHERE = {"assistants", "plots"}
"""The pages that tests of their own run: they need a program of the page, or a recording of a real flight."""
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]


@pytest.fixture
def home() -> Iterator[Path]:
    """A home whose path is short, because it has sockets."""
    with TemporaryDirectory(prefix="home-") as folder:
        yield Path(folder)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[] if page in BY_DAY else pytest.mark.night) for page in PAGES if page not in ELSEWHERE],
)
def test_a_reader_gets_what_the_page_shows(page: str, tmp_path: Path, home: Path) -> None:
    for program in TOOLS.get(page, ()):
        required(program, is_there=shutil.which(program) is not None)
    ports = free_port(), free_port()
    if page in LIVE:
        (tmp_path / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "udp://127.0.0.1:{ports[0]}"\n')
    variables = {**variables_of(Path(sys.executable).parent, home), "PYTHONPATH": str(ROOT)}
    with reading(tmp_path, variables, ports) as reader:
        try:
            _check(page, outputs_of(steps_of(page), reader))
        finally:
            reader.run(Step("console", "msggen link stop", ""))


def _check(page: str, outputs: Iterable[tuple[Step, str]]) -> None:
    live = steps_of(page, LIVE[page]) if page in LIVE else []
    for step, output in outputs:
        check_outputs([(step, output)], is_live=step in live)


def requirements(page: str) -> list[str]:
    """Return what the commands of a page install."""
    commands = (step.code.removeprefix(INSTALL) for step in steps_of(page) if step.code.startswith(INSTALL))
    return [each for command in commands for each in shlex.split(command, comments=True)]


@pytest.mark.parametrize("page", PAGES)
def test_a_page_begins_with_the_command_that_installs_what_it_imports(page: str) -> None:
    steps = steps_of(page)
    assert steps[0].code.startswith(f"{INSTALL}'msggen["), steps[0]
    named = requirements(page)
    extras = {extra for each in named if each.startswith("msggen[") for extra in re.split(r"[\[\],]", each)[1:-1]}
    names = {re.split(r"[^\w-]", each)[0] for each in (*named, *(each for extra in extras for each in EXTRAS[extra]))}
    names |= {"distributed"} & {
        name for each in EXTRAS["dask"] if "dask" in extras for name in re.findall(r"\w+", each)
    }
    trees = (ast.parse(step.code) for step in steps if step.kind == "python")
    imported = {name for tree in trees for node in ast.walk(tree) for name in _imports(node)}
    assert imported - names - set(sys.stdlib_module_names) <= {"px4_types"}


def _imports(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name.partition(".")[0] for alias in node.names)
    if isinstance(node, ast.ImportFrom):
        yield (node.module or "").partition(".")[0]


# --- at night


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.mark.night  # installs, and starts the servers of Ray
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("page", [page for page in PAGES if page not in ELSEWHERE])
def test_a_page_needs_only_what_it_names(page: str, wheel: Path, tmp_path: Path, home: Path) -> None:
    """In a network of its own, because Ray listens on all interfaces, and the ports are those of the page."""
    command = isolated(sys.executable, "-m", "support.pages", page, str(tmp_path / "empty"), "ray")
    (tmp_path / "empty").mkdir()
    programs = environment(sys.executable, tmp_path / "environment", wheel)
    wanted = [each.replace("msggen[", f"{wheel}[", 1) for each in requirements(page)]
    pip = [sys.executable, "-m", "pip", f"--python={programs / 'python'}", "install", "--quiet", "--no-compile"]
    subprocess.run([*pip, *wanted], check=True)
    variables = {
        **variables_of(programs, home),
        "PYTHONPATH": "",
        "TMPDIR": str(home),
        "RAY_USAGE_STATS_ENABLED": "0",
        "RAY_raylet_start_wait_time_s": "200",  # the usual 30 s are too short on a machine under load
    }
    done = subprocess.run(
        command, cwd=ROOT / "tests", env=variables, capture_output=True, text=True, check=False, timeout=1500
    )
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rows) > 1
    _check(page, ((Step(*step), output) for *step, output in rows))


# --- what checks them


def test_only_dates_sizes_and_times_may_differ() -> None:
    one = "a.mcap: 12 samples, 2.0 MB, in 0.5 s\nstart  2026-11-27 04:01:15 UTC\nlog-0123abcd  1795752197465881000\n"
    other = "a.mcap: 12 samples, 13.1 kB, in 1.5 s\nstart 2027-01-02 14:11:15.5 UTC\nlog-ff23abcd 1805752197465881000\n"
    assert normalised(one) == normalised(other)
    assert normalised(one) != normalised(one.replace("12", "13"))
    assert normalised("x 1.5\n") != normalised("x 1.6\n")
    assert normalised("x 1.5\n", is_live=True) == normalised("x 16\n", is_live=True)
    assert normalised("x a\n", is_live=True) != normalised("x b\n", is_live=True)


def test_dots_stand_for_lines() -> None:
    assert matches("a\n...\nz\n", "a\nb\nc\nz\n")
    assert matches("a\n...\n", "a\n")
    assert not matches("a\n...\nz\n", "a\nb\n")
    assert not matches("a\nz\n", "a\nb\nz\n")


def test_a_wrong_output_and_a_failed_command_are_found(tmp_path: Path, home: Path) -> None:
    with reading(tmp_path, variables_of(Path(sys.executable).parent, home)) as reader:
        for step in (
            Step("console", "export WORD=here", ""),
            Step("console", "echo $WORD >&2", "here\n"),
            Step("python", "import os\nprint(os.environ['WORD'])\n", "here\n"),
            Step("pycon", ">>> 1 / 0\n", ">>> 1 / 0\nZeroDivisionError: division by zero\n"),
            Step("console", "echo 1; echo 2", "...\n2\n"),
            Step("python", "1 / 0\n", "...\nZeroDivisionError: division by zero\n"),
        ):
            check_outputs([(step, reader.run(step))])
            wrong = step._replace(shown=step.shown + "more\n")
            with pytest.raises(AssertionError, match="more"):
                check_outputs([(wrong, reader.run(wrong))])


def test_an_isolated_program_has_only_the_loopback_interface_and_leaves_no_process(tmp_path: Path) -> None:
    """What it started keeps its output open, so `run` would wait for it."""
    program = (
        "import socket, subprocess\n"
        "print([name for _, name in socket.if_nameindex()])\n"
        "socket.create_server(('127.0.0.1', 0)).close()\n"
        "subprocess.Popen(['sleep', '1000'])\n"
    )
    command = isolated(sys.executable, "-c", program)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert (done.stdout, done.stderr) == ("['lo']\n", "")
