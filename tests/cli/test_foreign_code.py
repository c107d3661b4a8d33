"""Tests that no code of the current folder is executed: a stranger may have written what lies in it."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from msggen.base.interpreter import command_of
from msggen.definitions.model import snake_case
from support.catalogs import write_definitions
from support.commands import COMMANDS, run
from support.examples import by_day
from support.fleet_recordings import parquet_in, write_flight
from support.ports import free_port
from support.repository import ROOT, SOME
from support.shadows import (
    FURTHER,
    STANDARD,
    code_that_marks,
    completed,
    environment,
    marked,
    needed_by_m,
    remove_shadow,
    write_program,
    write_shadows,
)
from support.ulog import write_ulog

WORKERS = ("msggen.base.worker", "msggen.vehicle.owner.process")


@pytest.fixture
def marks(tmp_path: Path) -> Path:
    return tmp_path / "marks"


@pytest.fixture
def hostile(tmp_path: Path, marks: Path) -> Path:
    """A folder with modules of all names that Python or msggen may import."""
    write_shadows(tmp_path / "hostile", marks, [*STANDARD, *FURTHER])
    return tmp_path / "hostile"


def done_in(folder: Path, command: Sequence[str], **further: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end in a folder."""
    return subprocess.run(
        command, cwd=folder, env=environment(**further), stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False, timeout=120,
    )  # fmt: skip


@pytest.mark.parametrize("way", ["", ".", "relative", "here", "link"])
@pytest.mark.parametrize("module", WORKERS)
def test_a_process_imports_nothing_from_the_current_folder(
    module: str, way: str, hostile: Path, marks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path = hostile.parent
    (tmp_path / "link").symlink_to(hostile)
    (tmp_path / "relative").symlink_to(hostile)
    monkeypatch.chdir(tmp_path)
    entry = {"here": str(hostile), "link": str(tmp_path / "link")}.get(way, way)
    monkeypatch.setattr(sys, "path", [entry, *sys.path])
    if way != "relative":
        monkeypatch.chdir(hostile)
    done_in(hostile, command_of(module))
    assert marked(marks) == []


def test_a_process_imports_from_where_its_parent_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "further.py").write_text(
        "def main():\n    import sys, msggen\n    print(sys.flags.isolated, sys.path)\n"
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.chdir(ROOT)
    done = done_in(ROOT, command_of("further"))
    assert done.stdout.startswith(f"1 ['{tmp_path}', "), done.stderr
    assert ast.literal_eval(done.stdout[2:])[-1] == str(ROOT), "the current folder has msggen, and comes last"


@pytest.mark.slow  # processes that import much
@by_day(("way", "jobs"), [(way, jobs) for jobs in ([], ["--jobs", "2"]) for way in ("module", "program")], 4)
def test_the_processes_of_a_fleet_execute_no_code_of_the_recordings(
    way: str, jobs: list[str], hostile: Path, marks: Path, px4_types: Any
) -> None:
    (hostile.parent / "bin").mkdir()
    start = write_program(hostile.parent / "bin")
    if way == "module":
        start = [sys.executable, "-m", "msggen"]
        for name in needed_by_m():
            remove_shadow(hostile, name)
    write_flight(hostile / "flight.mcap", px4_types, 1)
    done = done_in(hostile, [*start, "log", "convert", ".", "-o", "../fleet", *jobs], PYTHONPATH=str(ROOT))
    assert (done.returncode, marked(marks)) == (0, []), done.stderr
    assert len(parquet_in(hostile.parent / "fleet")) == 2


PARENT = """
import sys
sys.path.insert(0, {root!r})
from msggen.live import LinkError, Vehicle
from msggen.vehicle import opening
from msggen.vehicle.owned import joining
sys.path.insert(0, "")  # as in a notebook, and with python -c
try:
    with Vehicle({url!r}) as vehicle:
        print("open")
except LinkError as error:
    print(error)
"""


@pytest.mark.slow
def test_the_process_of_a_link_executes_no_code_of_the_current_folder(hostile: Path, marks: Path) -> None:
    program = PARENT.format(root=str(ROOT), url=f"udp://127.0.0.1:{free_port()}")
    done = done_in(hostile, [sys.executable, "-I", "-c", program])
    assert (done.stdout, marked(marks)) == ("open\n", []), done.stderr


# matplotlib


STYLES = {
    "a module": b"backend: module://stranger\n",
    "LaTeX": b"text.usetex: True\ntext.latex.preamble: \\input{secret}\nfont.size: 1e9\n",
    "a server": b"backend: webagg\nwebagg.address: 0.0.0.0\nwebagg.open_in_browser: False\n",
    "no text": b"\xff\xfe\0",
    "a pipe": None,
}


@pytest.mark.slow
@by_day("style", STYLES.values(), 5, ids=STYLES)
def test_the_style_of_the_current_folder_is_not_used(style: bytes | None, tmp_path: Path, marks: Path) -> None:
    """It can have text typeset by LaTeX, listen on a port and import modules."""
    write_ulog(tmp_path / "flight.ulg")
    (tmp_path / "stranger.py").write_text(code_that_marks(marks, "stranger"))
    if style is None:
        os.mkfifo(tmp_path / "matplotlibrc")
    else:
        (tmp_path / "matplotlibrc").write_bytes(style)
    words = [*write_program(tmp_path), "log", "plot", "flight.ulg", "sensor_gps.fix_type"]
    done = done_in(tmp_path, [*words, "-o", "a.svg"])
    assert (done.returncode, done.stderr) == (0, "")
    assert "fix_type" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    done = done_in(tmp_path, words, DISPLAY=":9", PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert "error: no window can be shown here" in done.stderr
    assert not marked(marks)


# TAB


@pytest.fixture
def project(hostile: Path, marks: Path) -> Path:
    """A folder of a stranger with a generated package, and settings that name it. Its code leaves marks."""
    package = hostile / "my_types"
    committed = ROOT / "generated" / "px4_types"
    some = {committed / "msg" / f"_{snake_case(name)}.py" for name in SOME}
    modules = [path for path in committed.rglob("*.py") if not path.match("msg/_[!_]*.py") or path in some]
    code = {path.relative_to(committed).as_posix() for path in modules}
    write_definitions(package, {name: code_that_marks(marks, f"my_types: {name}") for name in code})
    names = json.loads((committed / "names.json").read_text())
    names["endpoints"].append({**names["endpoints"][0], "uorb_topic": "topic_of_mine"})
    (package / "names.json").write_text(json.dumps(names))
    (hostile / "pyproject.toml").write_text('[tool.msggen]\ntypes = "./my_types"\n')
    return hostile


LINES = {
    "msggen topic echo topic_of": ["topic_of_mine"],
    "msggen topic echo --types ./my_types topic_of": ["topic_of_mine"],
    "msggen topic echo --types my_types/ topic_of": ["topic_of_mine"],
    "msggen topic echo --types my_types topic_of": [],
    "msggen topic echo vehicle_status --field armi": ["arming_state"],
    "msggen command NAV_TAKEO": ["NAV_TAKEOFF"],
    "msggen call vehicle_command '{requ": ["{request:"],
    "msggen sim --types ./my_t": ["./my_types/"],
}


@pytest.mark.slow
@by_day("line", LINES, 2)
def test_tab_completes_names_of_a_package_and_executes_nothing(line: str, project: Path, marks: Path) -> None:
    command = write_program(project.parent)
    found = completed(command, line, project, project.parent / "answer")
    assert ([name for name in found if name and not name.startswith("--")], marked(marks)) == (LINES[line], [])


@pytest.mark.slow
def test_tab_imports_no_package_without_names(project: Path, marks: Path) -> None:
    (project / "my_types" / "names.json").unlink()
    command = write_program(project.parent)
    found = completed(command, "msggen topic echo vehicle_st", project, project.parent / "answer")
    assert ([name for name in found if name and not name.startswith("--")], marked(marks)) == ([], [])


# Commands that import the package of the settings

IMPORTING = {
    *("call", "command", "doctor", "record", "relay", "sim", "top", "view"),
    *("topic bw", "topic delay", "topic echo", "topic find", "topic hz", "topic info", "topic list"),
    *("topic plot", "topic pub", "topic type"),
}
"""The commands that import the package that `types` in the settings names. SECURITY.md lists them."""

WORDS = {
    "breaking": ["--against", "v1.17"],
    "build": ["--msg-dir", "definitions"],
    "bump": ["VehicleStatus", "--against", "HEAD"],
    "call": ["{}", "--wait", "0.01"],
    "check": ["."],
    "command": ["--list"],
    "completion": ["bash"],
    "docs": ["--msg-dir", "definitions"],
    "explain": ["M101"],
    "log compact": ["fleet"],
    "log compare": ["a.ulg", "b.ulg"],
    "log convert": ["a.ulg"],
    "log cut": ["a.ulg"],
    "log findings": ["a.ulg"],
    "log info": ["a.ulg"],
    "log merge": ["a.ulg", "b.ulg", "-o", "c.mcap"],
    "log plot": ["a.ulg", "b.c"],
    "log repair": ["a.ulg"],
    "log report": ["a.ulg"],
    "log show": ["a.ulg", "b"],
    "mission check": ["a.json"],
    "play": ["a.ulg"],
    "px4-generate": ["-y", "dds_topics.yaml", "-t", "a.em", "-o", "a.h"],
    "render": ["--template", "a.j2", "-o", "out"],
    "mcp": ["none"],
    "sim": ["--for", "0.01", "--count", "1"],
    "sync": ["px4_msgs"],
    "topic plot": ["vehicle_status.nav_state", "--wait", "0.01"],
    "topic pub": ["vehicle_command", "{}"],
    "topic find": ["VehicleStatus"],
    "topic info": ["vehicle_status"],
    "topic type": ["vehicle_status"],
    "topic echo": ["vehicle_status"],
    "record": ["-o", "flight.mcap"],
}
"""Arguments with which a command gets beyond its arguments."""


@pytest.mark.parametrize("command", COMMANDS)
def test_only_commands_for_a_vehicle_import_the_package_of_the_settings(
    command: str, project: Path, marks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    write_definitions(project, {"definitions/Lamp.msg": "uint64 timestamp\n"})
    url = f"udp://127.0.0.1:{free_port()}"
    (project / "pyproject.toml").write_text(f'[tool.msggen]\ntypes = "./my_types"\nlink = "{url}"\n')
    monkeypatch.setattr("msggen.cli.commands.relay._check_ros", lambda **_: None)
    monkeypatch.setattr("msggen.vehicle.owner.server.Server.serve", lambda *_: None)
    try:
        outcome = run([*command.split(), *WORDS.get(command, [])])
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == "my_types"]:
            del sys.modules[name]
    assert "Traceback" not in outcome.stderr
    assert "following arguments are required" not in outcome.stderr
    assert bool(marked(marks)) is (command in IMPORTING), outcome
    assert set(marked(marks)) <= {"my_types: __init__.py", "my_types: topics.py"}


# Every place that starts a process

STARTS = {"multiprocessing", "subprocess", "pty", "webbrowser", "runpy"}
"""Modules that start processes or programs."""

STARTING = {
    "base/disk/git.py": "the program git",
    "vehicle/owned/joining.py": "the command of `command_of`",
    "exports/fleet/pools.py": "the command of `command_of`",
}
"""The modules of msggen that may start processes, and what they start."""


OF_OS = r"system|popen|fork|posix_spawn|startfile|exec[lv]|spawn"
NAMED = re.compile(rf"\b({'|'.join(STARTS)}|executable|futures|{OF_OS})")
"""What a module has in its text if it uses any name that the test below looks for: others need not be parsed."""


@cache
def names_by_module() -> dict[str, set[str]]:
    """Return what each such module imports, and the attributes that it uses, such as `sys.executable`."""
    folder = ROOT / "msggen"
    texts = {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in folder.rglob("*.py")}
    return {name: set(names_in(text)) for name, text in texts.items() if NAMED.search(text)}


def names_in(text: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield f"{node.value.id}.{node.attr}"


def modules_with(pattern: str) -> set[str]:
    """Return the modules of msggen that use a name."""
    return {module for module, names in names_by_module().items() if any(re.match(pattern, name) for name in names)}


def test_one_module_makes_the_command_of_a_process_of_python() -> None:
    assert modules_with(r"sys\.executable") == {"base/interpreter.py"}
    assert modules_with(rf"({'|'.join(STARTS)})\b") == STARTING.keys()
    assert not modules_with(r"concurrent\.futures\.(process|ProcessPoolExecutor)\b")
    assert modules_with(rf"os\.({OF_OS})") == {"vehicle/owner/process.py"}
