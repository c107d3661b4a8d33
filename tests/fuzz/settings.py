"""Random and hostile files pyproject.toml in a folder and those above it, of this user and of others.

Only the settings of this user are used: a package that a file of another one names is never executed, and TAB executes
none at all. Commands end with 0, 1 or 2, without a trace.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from msggen.base.diagnostics import InputError
from msggen.cli import parser_for
from msggen.cli.commands.completion import _live, topics
from msggen.sources.settings import read_settings
from support.commands import check_outcome, run
from support.mutations import Mutator
from support.owners import give
from support.ports import free_port
from support.repository import ROOT
from support.scratch import inside, scratch_folder
from support.shadows import code_that_marks, marked

COUNT = 100

FOLDERS = ("above", "above/middle", "above/middle/here")
"""The folders of a case; commands run in the last one."""

COMMANDS = (
    *(
        "topic list --wait 0.01",
        "topic echo vehicle_status --once --wait 0.01",
        "command --list",
        "doctor --for 0.01 --wait 0.01",
    ),
    *("topic info vehicle_status --wait 0.01", "topic pub vehicle_command {} --wait 0.01", "call {} --wait 0.01"),
    "sim --for 0.01",
    *(
        "record -o made.mcap --wait 0.01",
        "top --once --wait 0.01",
        "build --check",
        "build -q",
        "lint",
        "sync px4_msgs",
    ),
    *("breaking --against v1.17", "check .", "docs -o docs", "tab", "tab", "read", "read"),
    *("settings", "settings --json"),
)
PLAIN = "[tool.msggen]\ntypes = {types}\nlink = {link}\n"
TEXTS = (
    *(PLAIN, PLAIN, PLAIN, "[project]\nname = 'x'\n\n" + PLAIN, "tool.msggen = {{types = {types}, link = {link}}}\n"),
    *("[tool]\nmsggen.types = {types}\nmsggen.link = {link}\n", "[tool.'msggen']\ntypes = {types}\nlink = {link}\n"),
    *(PLAIN + "output = '../..'\n", PLAIN + "px4 = '../../{package}'\n", PLAIN + "package = '../../x'\n"),
    *(PLAIN + "msg-dir = ['{package}']\n", PLAIN + "[tool.msggen.per-message-ignores]\n'*' = ['WIRE']\n", "", "["),
    *(
        "# msggen]\n",
        PLAIN + "px4 = 'installed'\n",
        PLAIN + "select = 'NOTHING'\n",
        PLAIN + "board = 'x'\nstrict = true\narchived = true\n",
    ),
)
"""Texts of a file. {types} names the package in the folder of the file."""

TYPES = ("./{0}", "./{0}", "{0}", "deep/../{0}", "{0}/", "./{0}/../{0}", "../middle/{0}", "{0}.topics", "~/{0}", ".")
KINDS = ("file", "file", "file", "file", "link", "fifo", "folder", "dangling", "none")
MUTATOR = Mutator(
    (b"msggen", b"types", b"tool", b"link", b"[tool.msggen]", b"=", b'"', b"./", b"output", b"px4", b"'''", b"."),
    [PLAIN.encode(), b'[tool.msggen]\nmsg-dir = ["a"]\narchived = true\n'],
)


class File(NamedTuple):
    """A pyproject.toml: what it is, who owns it, and its contents."""

    kind: str
    user: str
    data: bytes


class Case(NamedTuple):
    """The files of the folders, and what is run in the last one."""

    files: tuple[File, ...]
    command: str


def case(chance: Random) -> Case:
    return Case(tuple(_file(chance, folder) for folder in FOLDERS), chance.choice(COMMANDS))


def _file(chance: Random, folder: str) -> File:
    package = package_of(folder)
    types = chance.choice(TYPES).format(package)
    text = chance.choice(TEXTS).format(types=repr(types), link="'udp://127.0.0.1:PORT'", package=package)
    data = text.encode() if chance.random() < 0.7 else MUTATOR.mutated(chance, text.encode())
    return File(chance.choice(KINDS), chance.choice(("me", "other")), data)


def package_of(folder: str) -> str:
    """Return the name of the package in a folder. Each leaves a mark of its own when it is executed."""
    return f"types_{folder.rpartition('/')[2]}"


def check(case: Case) -> None:
    with scratch_folder() as folder, pytest.MonkeyPatch.context() as patched:
        for name in FOLDERS:
            _write_package(folder / name / package_of(name), folder / "marks")
        (folder / "own").mkdir()
        others = list(_write(case, folder))
        if others:
            give(patched, *others)
        patched.setenv("HOME", str(folder / FOLDERS[0]))
        patched.setenv("GIT_CONFIG_NOSYSTEM", "1")
        patched.setenv("XDG_CACHE_HOME", _CACHE)
        with inside(folder / FOLDERS[-1]):
            try:
                _run(case)
            finally:
                for name in [name for name in sys.modules if name.partition(".")[0] in _PACKAGES]:
                    del sys.modules[name]
        executed = set(marked(folder / "marks"))
        mine = {package_of(name) for name in FOLDERS if folder / name / "pyproject.toml" not in others}
        assert executed <= (set() if case.command in ("tab", "read") else mine), f"executed: {sorted(executed)}"


_PACKAGES = frozenset(map(package_of, FOLDERS))
_CACHE = os.environ.get("XDG_CACHE_HOME", "") or os.path.expanduser("~/.cache")


def _run(case: Case) -> None:
    if case.command == "read":
        with suppress(InputError):
            assert all(str(note) for note in read_settings(".").notices)
    elif case.command == "tab":
        words = ["topic", "echo", "x"]
        proposed = _live(topics)("vehicle_st", parsed_args=parser_for(words).parse_args(words))
        assert set(proposed) <= {"vehicle_status"}
    else:
        check_outcome(run(case.command.split()))


def _write_package(package: Path, marks: Path) -> None:
    package.mkdir(parents=True)
    for name in ("__init__.py", "topics.py"):
        (package / name).write_text(code_that_marks(marks, package.name), encoding="utf-8")
    (package / "names.json").write_bytes((ROOT / "generated" / "px4_types" / "names.json").read_bytes())


def _write(case: Case, folder: Path) -> Iterator[Path]:
    """Write the files. Yield those of another user."""
    for name, file in zip(FOLDERS, case.files, strict=True):
        path = folder / name / "pyproject.toml"
        data = file.data.replace(b"PORT", str(free_port()).encode())
        if file.kind == "file":
            path.write_bytes(data)
        elif file.kind == "link":  # to a file of this user
            (folder / "own" / path.parent.name).write_bytes(data)
            path.symlink_to(folder / "own" / path.parent.name)
        elif file.kind == "fifo":
            os.mkfifo(path)
        elif file.kind == "folder":
            path.mkdir()
        elif file.kind == "dangling":
            path.symlink_to("nothing")
        if file.user == "other" and os.path.lexists(path):
            yield path
