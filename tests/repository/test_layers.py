"""Tests that the modules of msggen import only what the table of rooms allows, and that none imports itself."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from msggen.base.rooms import ROOMS, below
from support.repository import ROOT

LONGEST = 400
"""The lines of a file that is not among `LONG`."""

LONG = {
    "msggen/definitions/model.py": "the model: what a message, a field, a topic, a service and a catalog are",
    "msggen/definitions/parse/statements.py": "one parser, for the bodies of translation functions",
    "msggen/generate/python/message.py": "what the templates of a message see",
    "msggen/generate/python/package.py": "what the templates of a package see",
    "msggen/generate/python/translation.py": "an interpreter of translation statements, whose cases share state",
    "msggen/generate/render/views.py": "the documented model that templates see",
    "msggen/link/xrce/agent.py": "a state machine: the agent",
    "msggen/link/xrce/session.py": "a state machine: a session of the agent",
    "msggen/link/xrce/wire.py": "the submessages of DDS-XRCE, each packed and parsed in a few lines",
    "msggen/recordings/files/rosbag2/sqlite_pages.py": "a format: its parts, and what damage does to them",
    "msggen/recordings/log/log.py": "the methods that users call on a recording, on one class",
    "msggen/sim/values.py": "what a simulated vehicle publishes: a function for each message",
    "msggen/vehicle/vehicle.py": "the methods that users call on a vehicle, on one class",
    "templates/python/support/cdr.py": "the module that each message imports: a second one would make imports slower",
    "templates/python/support/meaning.py": "the values of fields: members of enums, and invalid ones",
    "templates/python/support/stream.py": "the only module that messages with strings or sequences import",
}
"""The long files, and why each is one file."""

MODULES = {
    path.relative_to(ROOT / "msggen").with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__"): path
    for path in (ROOT / "msggen").rglob("*.py")
}
"""The files of all modules, by names such as `base.disk.git`."""


def room_of(name: str) -> str:
    """Return the room that a module, such as `base.disk.git`, is in; "" for a module outside of all rooms."""
    while name not in ROOMS and name:
        name = name.rpartition(".")[0]
    return name


def imports_of(path: Path) -> Iterator[str]:
    """Yield the modules of msggen that a module imports, also inside of functions and for type checkers only."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.removeprefix("msggen.") for alias in node.names if alias.name.startswith("msggen."))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("msggen."):
            assert node.module is not None
            module = node.module.removeprefix("msggen.")
            names = [f"{module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else module for name in names)
        elif isinstance(node, ast.ImportFrom) and node.module == "msggen":
            yield from (alias.name for alias in node.names if alias.name in MODULES)


@cache
def imports() -> Mapping[str, set[str]]:
    """Return what each module imports. It takes seconds, so it is not done where tests are collected only."""
    return {name: {*imports_of(path)} - {name} for name, path in MODULES.items() if not name.startswith("cmake")}


def is_allowed(room: str, other: str) -> bool:
    """Whether a room may import another one: its row names that, or the room is a folder that has the other one."""
    row = ROOMS[room]
    return any(other == each or other.startswith(f"{each}.") for each in (*row, room))


def test_every_module_is_in_a_room() -> None:
    assert {name for name in MODULES if not room_of(name)} == {"__init__", "__main__"}
    assert {room_of(name) for name in MODULES} - {""} == ROOMS.keys()


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_what_its_row_allows(room: str) -> None:
    imported = {
        (name, other)
        for name, others in imports().items()
        if room_of(name) == room
        for other in others
        if room_of(other) != room
    }
    assert {(name, other) for name, other in imported if not is_allowed(room, room_of(other))} == set()


@pytest.mark.parametrize("room", ROOMS)
def test_a_row_names_what_the_room_imports_and_no_more(room: str) -> None:
    imported = {room_of(other) for name, others in imports().items() if room_of(name) == room for other in others}
    unused = [
        each for each in ROOMS[room] if not any(other == each or other.startswith(f"{each}.") for other in imported)
    ]
    assert not unused


def test_no_rooms_import_each_other() -> None:
    rows = {
        room: [
            each
            for row in others
            for each in ROOMS
            if each == row or (each.startswith(f"{row}.") and each != room)  # which may import what is beside it
        ]
        for room, others in ROOMS.items()
    }
    TopologicalSorter(rows).prepare()


def test_no_modules_import_each_other() -> None:
    TopologicalSorter({name: others & MODULES.keys() for name, others in imports().items()}).prepare()


def test_a_circle_is_found() -> None:
    with pytest.raises(CycleError):
        TopologicalSorter({"a": ["b"], "b": ["a"]}).prepare()


def test_all_that_a_room_imports_is_below_it() -> None:
    assert below("base") == {"base"}
    assert below("generate") == {"base", "definitions", "sources", "generate.text", "generate.python", "generate"}
    assert {"check", "generate.render"} <= below("generate.site")


def test_the_page_has_all_rooms_and_what_they_import() -> None:
    page = (ROOT / "docs/design.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)/` \|.*\| ([^|]*) \|$", page, re.MULTILINE))
    tops = {room.partition(".")[0] for room in ROOMS}
    assert rows.keys() == tops
    for room, listed in rows.items():
        inner = {each.partition(".")[0] for name in ROOMS if name.partition(".")[0] == room for each in ROOMS[name]}
        assert set(re.findall(r"`(\w+)`", listed)) == inner - {room}


def test_each_long_file_has_a_reason() -> None:
    files = [path for folder in ("msggen", "templates") for path in (ROOT / folder).rglob("*.py")]
    long = {
        path.relative_to(ROOT).as_posix()
        for path in files
        if path.read_text(encoding="utf-8").count("\n") > LONGEST and "examples" not in path.parts
    }
    assert {*LONG} == long
