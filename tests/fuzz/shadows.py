"""The current folder as an enemy: modules with the names of others, packages, programs and settings that lie in wait.

Nothing of the folder is executed, except for a package that the settings or `--types` name by path, and that only by a
command for a vehicle. Commands run here, as the program, with `python -m`, and as TAB runs them.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import NamedTuple

from support.commands import COMMANDS, Outcome, check_outcome, run
from support.ports import free_port
from support.repository import ROOT
from support.scratch import inside, scratch_folder
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

COUNT = 80

IMPORTING = frozenset(("call", "command", "doctor", "record", "relay", "sim", "top", "view"))
"""The commands that import the package of the settings, with all of `topic`."""

WORDS = {
    "breaking": "--against v1.17",
    "build": "-o out",
    "bump": "VehicleStatus --against HEAD",
    "call": "{}",
    "check": ".",
    "command": "--list",
    "completion": "bash",
    "docs": "-o out",
    "doctor": "--for 0.01",
    "explain": "M101",
    "log compact": "fleet",
    "log compare": "flight.ulg flight.ulg",
    "log convert": "flight.ulg -o made",
    "log cut": "flight.ulg -o made.mcap",
    "log findings": "flight.ulg",
    "log info": "flight.ulg",
    "log merge": "flight.ulg flight.ulg -o made.mcap",
    "log plot": "flight.ulg sensor_gps.fix_type -o a.png",
    "log repair": "flight.ulg -o made.mcap",
    "log report": "flight.ulg -o made.html",
    "log show": "flight.ulg sensor_gps",
    "play": "flight.ulg",
    "px4-generate": "-y dds_topics.yaml -t a.em -o a.h",
    "record": "-o made.mcap",
    "render": "--template a.j2 -o out",
    "link serve": "--link dds://0",
    "sim": "--for 0.01 --count 1",
    "sync": "px4_msgs",
    "top": "--once",
    "topic echo": "vehicle_status",
    "topic find": "VehicleStatus",
    "topic info": "vehicle_status",
    "topic plot": "vehicle_status.nav_state --for 0.01",
    "topic pub": "vehicle_command {}",
    "topic type": "vehicle_status",
    "view": "--for 0.01 --port 0",
}
"""Arguments with which a command does something, and ends."""

LINES = (
    *("msggen ", "msggen bre", "msggen build --px4 ", "msggen build --board ", "msggen breaking --against ma"),
    *(
        "msggen bump ",
        "msggen lint ",
        "msggen topic echo ",
        "msggen topic echo vehicle_status --field ",
        "msggen sync ",
    ),
    *(
        "msggen topic echo vehicle_status 'arming_state == ",
        "msggen topic pub vehicle_command '{",
        "msggen command NAV",
    ),
    *("msggen command NAV_TAKEOFF ", "msggen call ", "msggen call vehicle_command '{", "msggen top ", "msggen record "),
    *("msggen log show flight.ulg ", "msggen log plot flight.ulg ", "msggen explain ", "msggen check ", "msggen view "),
    *("msggen topic echo --types my_types ", "msggen topic echo --types ./my_types ", "msggen doctor --types numpy "),
    *("msggen topic echo --types my_types.msg ", "msggen topic list --px4 . ", "msggen topic echo --px4 v1.17 "),
)
"""Command lines at whose end TAB is pressed."""

TYPES = (
    "",
    "",
    "./my_types",
    "my_types",
    "../work/my_types",
    "my_types/",
    "px4_types",
    "json",
    "./json",
    "my_types.msg",
)
"""What `types` in the settings and `--types` name. Those with a separator are paths."""

FILES = {
    "a.pth": "import os; {code}",
    "matplotlibrc": "backend: module://my_types\ntext.usetex: True\ntext.latex.preamble: \\input{{x}}\n",
    "pyvenv.cfg": "home = .\ninclude-system-site-packages = false\n",
    "conftest.py": "{code}",
    "setup.py": "{code}",
    "__main__.py": "{code}",
    "__init__.py": "{code}",
    "px4_types/topics.py": "{code}",
    "my_types.py": "{code}",
    ".venv/bin/activate_this.py": "{code}",
    ".netrc": "machine x\n",
    "dask.yaml": "distributed: {{scheduler: {{preload: my_types}}}}\n",
    "tox.ini": "[tox]\n",
    "package.xml": "<package><name>my_msgs</name></package>",
    "msg/Lamp.msg": "uint64 timestamp\n",
    ".cache/msggen/x": "",
}
"""Files beside the modules. {code} leaves a mark."""

PROGRAMS = ("git", "python", "python3", "latex", "dvipng", "bash", "sh", "stty", "ld", "gcc", "msggen", "xdg-open")
"""Programs of the folder, which leave a mark when they are started."""

GIT = ("fsmonitor = {program}", "hooksPath = .", "sshCommand = {program}", "pager = {program}")
WAYS = ("here", "here", "here", "here", "here", "program", "module", "tab", "tab")


class Case(NamedTuple):
    """What lies in the folder, and what is run there."""

    way: str
    words: str
    """The command with its arguments or, for TAB, the line."""
    types: str
    option: str
    """The values of the setting and of the option `--types`."""
    shadows: tuple[str, ...]
    files: tuple[str, ...]
    programs: tuple[str, ...]
    git: str


def case(chance: Random) -> Case:
    way = chance.choice(WAYS)
    command = chance.choice((*COMMANDS, *(name for name in COMMANDS if name.startswith("topic")), "sim", "log convert"))
    words = " ".join([command, WORDS.get(command, ""), *(["--wait 0.01"] if "--wait" in _options(command) else [])])
    if way != "here" and chance.random() < 0.2:
        words = "log convert . -o ../fleet --jobs 2"
    every = (*STANDARD, *FURTHER)
    return Case(
        way,
        chance.choice(LINES) if way == "tab" else words,
        chance.choice(TYPES),
        chance.choice(TYPES) if chance.random() < 0.4 and "--types" in _options(command) else "",
        every if chance.random() < 0.3 else tuple(chance.sample(every, chance.choice((0, 5, 50)))),
        tuple(chance.sample(sorted(FILES), chance.choice((0, 1, 3, 8)))),
        PROGRAMS if chance.random() < 0.3 else (),
        chance.choice(("", "", *GIT)),
    )


@cache
def _options(command: str) -> frozenset[str]:
    return frozenset(COMMANDS[command]._option_string_actions)


def check(case: Case) -> None:
    with scratch_folder() as folder:
        marks, work = folder / "marks", folder / "work"
        write(case, work, marks)
        with inside(work):
            before = dict(os.environ)
            os.environ["XDG_CACHE_HOME"] = str(_cache())
            try:
                _run(case, folder)
            finally:
                os.environ.clear()
                os.environ.update(before)
                for name in [name for name in sys.modules if name.partition(".")[0] == "my_types"]:
                    del sys.modules[name]
        allowed = {name for name in marked(marks) if name.startswith("my_types: ")} if _imports(case) else set()
        executed = set(marked(marks)) - allowed
        assert not executed, f"executed: {sorted(executed)}"


@cache
def _cache() -> str:
    """Return the cache of this user: each case would build its packages anew."""
    from msggen.generate.cache import cache_folder

    return os.path.dirname(cache_folder())


def _imports(case: Case) -> bool:
    """Whether the command may import the package in the folder: it is named as a path."""
    command = case.words.split()[0]
    named = case.option or (case.types if command in IMPORTING or command == "topic" else "")
    return case.way != "tab" and "/" in named and "my_types" in named


def _run(case: Case, folder: Path) -> None:
    program, work = write_program(folder), folder / "work"
    if case.way == "tab":
        completed(program, case.words, work, folder / "answer")
        return
    words = [*case.words.split(), *(["--types", case.option] if case.option else [])]
    if case.way == "here":
        check_outcome(run(words))
        return
    further = {}
    if case.way == "module":
        program, further = [sys.executable, "-m", "msggen"], {"PYTHONPATH": str(ROOT)}
        for name in needed_by_m():
            remove_shadow(work, name)
    done = subprocess.run(
        [*program, *words], cwd=work, env=environment(**further), stdin=subprocess.DEVNULL, capture_output=True,
        text=True, check=False, timeout=25,
    )  # fmt: skip
    check_outcome(Outcome(done.returncode, done.stdout, done.stderr))


def write(case: Case, work: Path, marks: Path) -> None:
    """Write what lies in the folder."""
    write_shadows(work, marks, case.shadows)
    write_ulog(work / "flight.ulg")
    for name, text in _files(case, marks):
        path = work / name
        if not path.parent.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    for name in case.programs:
        if not (work / name).is_dir():
            (work / name).write_text(f"#!/bin/sh\necho '{name} started' >> {marks}\n")
            (work / name).chmod(0o755)
    if case.git:
        subprocess.run(["git", "init", "-q"], cwd=work, check=True)
        (work / "hook").write_text(f"#!/bin/sh\necho hook >> {marks}\n")
        (work / "hook").chmod(0o755)
        for name in ("post-checkout", "pre-commit", "reference-transaction", "post-index-change"):
            shutil.copy(work / "hook", work / name)
        with (work / ".git" / "config").open("a", encoding="utf-8") as config:
            config.write(f"[core]\n\t{case.git.format(program=work / 'hook')}\n")


def _files(case: Case, marks: Path) -> Iterator[tuple[str, str]]:
    yield "my_types/__init__.py", code_that_marks(marks, "my_types: __init__")
    yield "my_types/topics.py", code_that_marks(marks, "my_types: topics")
    yield "my_types/names.json", (ROOT / "generated" / "px4_types" / "names.json").read_text(encoding="utf-8")
    for name in case.files:
        yield name, FILES[name].format(code=code_that_marks(marks, name))
    link = f'link = "udp://127.0.0.1:{free_port()}"\n'
    types = f"types = {json.dumps(case.types)}\n" if case.types else ""
    yield "pyproject.toml", f"[tool.msggen]\n{link}{types}"
