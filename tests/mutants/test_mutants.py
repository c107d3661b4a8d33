"""Tests of the run that breaks single lines: it names a line that no test guards, and no guarded one."""

from __future__ import annotations

import ast
import time
from pathlib import Path

import pytest

from mutants.__main__ import ROOMS, sample, survivors
from mutants.changes import changes_of
from support.catalogs import write_definitions
from support.repository import ROOT

MODULE = """
def late(age: float, limit: float) -> bool:
    return age > limit


def all_set(values: list[bool]) -> bool:
    return all(values)
"""
TEST = """
from limits import all_set, late


def test_late():
    assert late(2.0, 1.0)
    assert not late(1.0, 1.0)


def test_all_set():
    assert all_set([True])


def test_that_fails_anyway():
    assert not all_set([True])
"""


@pytest.mark.parametrize(
    ("code", "changed"),
    [
        ("a > b", ["a >= b"]),
        ("a == b != c", ["a != b != c"]),
        ("é(a) is not b", ["é(a) is b"]),
        ("x = a and not (b or c)", ["x = a and not (b and c)", "x = a and  (b or c)", "x = a or not (b or c)"]),
        ("x = any(y)", ["x = all(y)"]),
        ("async def f():\n    await g(\n        1)", ["async def f():\n    pass"]),
        ("log.warning('late')\n'text'\nx = f(1)", []),
    ],
)
def test_one_part_of_a_module_is_changed(code: str, changed: list[str]) -> None:
    assert sorted(each.applied(code.encode()).decode() for each in changes_of(code.encode())) == sorted(changed)


@pytest.mark.parametrize("step", [10, pytest.param(1, marks=pytest.mark.night)], ids=["some", "all"])
def test_every_change_of_the_rooms_can_be_parsed(step: int) -> None:
    modules = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    assert len(modules) > 100
    for source in (path.read_bytes() for path in modules[::step]):
        changes = changes_of(source)
        for change in changes[:: len(changes) // 5 + 1]:
            ast.parse(change.applied(source))


@pytest.mark.night  # a process for each change
def test_a_line_that_no_test_guards_is_found_and_a_guarded_one_is_not(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"limits.py": MODULE, "test_limits.py": TEST, "pytest.ini": "[pytest]\n"})
    (tmp_path / "tests").symlink_to(ROOT / "tests")  # with the plugin
    mutants = sample(tmp_path, ["limits.py"], seed=7)
    assert {each.change.line for each in mutants} == {3, 7}
    found = list(survivors(tmp_path, mutants, ["."], time.monotonic() + 250))
    assert found == ["limits.py:7: all -> any, with 1 test"]


def test_a_sample_follows_from_its_seed() -> None:
    rooms = ["msggen/flight/limits.py"]
    assert sample(ROOT, rooms, 1) == sample(ROOT, rooms, 1) != sample(ROOT, rooms, 2)
