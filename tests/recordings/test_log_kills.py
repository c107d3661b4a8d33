"""Tests of actions of `msggen log` that are killed before calls that change the disk."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest

from fuzz.conversions import samples_in
from support.commands import run
from support.disk_calls import hooked
from support.disk_tasks import KILLED, killed_before
from support.examples import by_day, examples
from support.flights import write_flight
from support.scratch import inside
from support.ulog import write_ulog

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")]

MOMENTS = examples(15, by_day=3)
ACTIONS = (
    "convert flight.mcap -o made",
    "convert flight.ulg -o made.mcap",
    "convert flight.ulg esc_status -o made.csv",
    "convert flight.mcap --format rosbag2 --storage sqlite3 -o made",
    "cut flight.mcap --stop 0.2 -o made.mcap",
    "merge flight.mcap flight.ulg -o made.mcap",
    "repair cut.mcap -o made.mcap",
    "report flight.ulg -o made.html",
)
OLD = b"old"


@pytest.fixture
def folder(tmp_path: Path, px4_types: Any) -> Path:
    work = tmp_path / "work"
    work.mkdir()
    write_ulog(work / "flight.ulg", count=40)
    data = write_flight(work / "flight.mcap", px4_types, 40).read_bytes()
    (work / "cut.mcap").write_bytes(data[: len(data) * 3 // 4])
    return work


def content(target: Path) -> object:
    """Return what a target has, None if there is none. Raises an error if it is not whole."""
    if not target.exists():
        return None
    if target.suffix == ".html":
        return target.read_bytes()
    files = sorted(target.iterdir()) if target.is_dir() else [target]
    return [path.name for path in files], samples_in(path for path in files if path.suffix != ".yaml")


@by_day("action", ACTIONS, 2)
def test_a_kill_leaves_a_whole_target_or_none(action: str, folder: Path) -> None:
    words = ["log", *action.split(), "-q"]
    target = folder / words[words.index("-o") + 1]
    before = None
    with inside(folder):
        names: list[str] = []
        with hooked(names.append):
            assert run(words).code in (0, 1)
        whole = content(target)
        assert whole is not None
        given = sorted(os.listdir(folder))
        found = set()
        for number in range(0, len(names), max(len(names) // MOMENTS, 1)):
            _remove(target)
            if target.suffix == ".html":  # a report replaces the one before it
                target.write_bytes(OLD)
                before = OLD
            assert killed_before(lambda: run(words), number) == KILLED
            after = content(target)
            assert after in (before, whole), f"call {number}, {names[number]}"
            found.add(after == whole)
            if after == whole and target.suffix != ".html":
                _remove(target)
            assert run(words).code in (0, 1)
            assert content(target) == whole
            assert sorted(os.listdir(folder)) == given, f"call {number}, {names[number]}"
        assert False in found


def _remove(target: Path) -> None:
    for path in target.iterdir() if target.is_dir() else ():
        path.unlink()
    if target.is_dir():
        target.rmdir()
    target.unlink(missing_ok=True)
