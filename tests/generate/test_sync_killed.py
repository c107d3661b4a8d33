"""Tests that `msggen sync` may be killed at any moment: the package is old or new, and the next run finishes.

One test kills it before every call that changes the disk, another at random moments with some forty definitions. If
both `msg/` and `srv/` change, two swaps follow each other directly: a kill between them, within about ten microseconds,
leaves one folder entirely new and the other entirely old.
"""

from __future__ import annotations

import errno
import multiprocessing
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msggen.base.disk import staging, swap
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.examples import some
from support.packages import (
    PACKAGE,
    age,
    content,
    definition,
    definitions,
    firmware,
    identity,
    package,
    plain_package,
    sync,
)
from support.repository import ROOT

CHANGING = {
    f"os.{call}" for call in ("chmod", "link", "mkdir", "remove", "rename", "rmdir", "symlink", "truncate", "utime")
}
KILLED = 9
HAND_MADE = {"msg/Wheel.msg": definition("Rpm"), "msg/more/notes.txt": "mine", "src/node.cpp": "mine"}
NEWER = ("--px4", "newer", "px4_msgs")

pytestmark = [
    pytest.mark.usefixtures("working_folder"),
    pytest.mark.skipif(not hasattr(os, "fork") or sys.platform != "linux", reason="folders are swapped on Linux"),
]


def newer_firmware(*, srv: bool) -> None:
    """Make a tree with one new, one changed and one removed message; with `srv`, also rename the service."""
    newer = firmware("newer")
    (newer / "msg" / "Rpm.msg").unlink()
    write_definitions(newer, {"msg/DebugVect.msg": definition("DebugVect")})
    write_definitions(newer, {"msg/EscReport.msg": definition("EscReport") + "uint8 newer\n"})
    if srv:
        (newer / "srv" / "VehicleCommand.srv").rename(newer / "srv" / "Command.srv")


def dies_at(number: int, run: Callable[[], object], error: OSError | None = None) -> bool:
    """Run `run` in a process that exits abruptly before its call number `number` that changes the disk.

    With `error`, that call raises it instead and the process continues. Return False if there are fewer such calls.
    """
    child = os.fork()
    if child == 0:
        remaining = number

        def count(event: str, arguments: tuple[Any, ...]) -> None:
            nonlocal remaining
            writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
            remaining -= event in CHANGING or event == "swap" or bool(writes)
            if remaining == 0 and error:
                remaining -= 1
                raise error
            if remaining == 0:
                os._exit(KILLED)

        exchange = swap._exchange

        def counted_exchange(*arguments: Any) -> None:
            sys.audit("swap")
            exchange(*arguments)

        swap._exchange = counted_exchange  # type: ignore[assignment]
        sys.addaudithook(count)
        try:
            run()
        finally:
            os._exit(KILLED if error and remaining < 0 else 0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == KILLED


def folder_states(old: dict[str, bytes], new: dict[str, bytes]) -> set[str]:
    """Return the states of `msg` and `srv`, each entirely old or entirely new; fail for a mixture."""
    found = definitions(PACKAGE)
    states = set()
    for kind in ("msg/", "srv/"):
        now, before, after = ({n: d for n, d in files.items() if n.startswith(kind)} for files in (found, old, new))
        assert now in (before, after), f"{kind} is a mixture: {sorted(now)}"
        if before != after:
            states.add("old" if now == before else "new")
    return states


def hand_made() -> None:
    """Put files into the package that do not belong to msggen."""
    write_definitions(PACKAGE, HAND_MADE)
    age(PACKAGE)


def kill_everywhere(start: Callable[[], object], *arguments: str) -> list[set[str]]:
    """Kill a sync before each of its calls in turn; check the result, and that the next run finishes."""
    start()
    old = definitions(PACKAGE)
    sync("-q", *arguments)
    new, final = definitions(PACKAGE), content(PACKAGE)
    seen: list[set[str]] = []
    while True:
        shutil.rmtree(PACKAGE)
        start()
        before = identity(PACKAGE)
        if not dies_at(len(seen) + 1, lambda: sync("-q", *arguments)):
            break
        seen.append(folder_states(old, new))
        read_catalog(find_sources(str(PACKAGE)))
        assert sync("-q", *arguments) == 0
        assert content(PACKAGE) == final
        after = identity(PACKAGE)
        assert [name for name in HAND_MADE if after[name] != before[name]] == []
    return seen


def started() -> None:
    package()
    hand_made()


@pytest.mark.night
def test_killed_before_any_call_a_package_is_wholly_old_or_wholly_new() -> None:
    firmware()
    newer_firmware(srv=False)
    states = kill_everywhere(started, *NEWER)
    assert {"old"} in states
    assert {"new"} in states
    assert all(len(state) == 1 for state in states)


@pytest.mark.night
def test_with_services_too_there_is_only_the_moment_between_the_two_swaps() -> None:
    firmware()
    newer_firmware(srv=True)
    states = kill_everywhere(started, *NEWER)
    assert states.count({"old", "new"}) == 1


@pytest.mark.night
def test_where_a_call_fails_all_definitions_are_old_or_all_new_and_the_next_run_finishes() -> None:
    firmware()
    newer_firmware(srv=True)
    started()
    old = definitions(PACKAGE)
    sync("-q", *NEWER)
    new, final = definitions(PACKAGE), content(PACKAGE)
    calls = 0
    while True:
        shutil.rmtree(PACKAGE)
        started()
        if not dies_at(calls := calls + 1, lambda: sync("-q", *NEWER), OSError(errno.EIO, "cannot")):
            break
        assert len(folder_states(old, new)) == 1
        assert sync("-q", *NEWER) == 0
        assert content(PACKAGE) == final


@pytest.mark.night
def test_killed_while_it_is_adopted_a_plain_package_is_wholly_old_or_wholly_new() -> None:
    def adoptable() -> None:
        plain_package()
        write_definitions(PACKAGE, {"msg/Safety.msg": definition("Rpm")})
        hand_made()

    firmware()
    newer_firmware(srv=False)
    states = kill_everywhere(adoptable, *NEWER)
    assert all(len(state) == 1 for state in states)


@pytest.mark.night
def test_killed_before_any_call_a_new_package_is_there_as_a_whole_or_not_at_all() -> None:
    firmware()
    final = content(package("expected"))
    calls = 0
    while dies_at(calls := calls + 1, package):
        if PACKAGE.exists():
            assert content(PACKAGE) == final
        assert content(package()) == final
        assert sorted(os.listdir()) == ["expected", "firmware", "px4_msgs"]
        shutil.rmtree(PACKAGE)
    assert calls > len(final)


@pytest.mark.night
def test_without_a_swap_every_file_is_whole_and_the_next_run_finishes(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware()
    newer_firmware(srv=True)
    monkeypatch.setattr(swap, "_renameat2", lambda: None)
    started()
    old = definitions(PACKAGE)
    sync("-q", *NEWER)
    new, final = definitions(PACKAGE), content(PACKAGE)
    calls = 0
    while True:
        shutil.rmtree(PACKAGE)
        started()
        if not dies_at(calls := calls + 1, lambda: sync("-q", *NEWER)):
            break
        for name, data in definitions(PACKAGE).items():
            assert data in (old.get(name), new.get(name))
        assert sync("-q", *NEWER) == 0
        assert content(PACKAGE) == final
    assert calls > len(new)


def test_every_new_file_and_folder_is_on_the_disk_before_the_swap(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware()
    newer_firmware(srv=True)
    package()
    calls: list[str] = []
    fsync, exchange = os.fsync, swap._exchange

    def flushed(handle: int) -> None:
        calls.append(os.path.relpath(os.readlink(f"/proc/self/fd/{handle}"), PACKAGE))
        fsync(handle)

    def exchanged(*arguments: Any) -> None:
        calls.append("swap")
        exchange(*arguments)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(swap, "_exchange", exchanged)
    assert sync("-q", *NEWER) == 0
    before = calls[: calls.index("swap")]
    built = f"{staging.STAGE}/new"
    new = ["msg/DebugVect.msg", "msg/EscReport.msg", "srv/Command.srv", "README.md"]
    assert {f"{built}/{name}" for name in new} < {*before}
    assert {f"{built}/msg", f"{built}/srv", ".msggen.json.msggen-new"} < {*before}
    assert calls[calls.index("swap") :][:2] == ["swap", "swap"]


def versioned_firmware(name: str) -> Path:
    """Return a tree with all versioned messages and the service."""
    for kind in ("msg/versioned", "srv"):
        shutil.copytree(ROOT / kind, Path(name, kind))
    return Path(name)


@pytest.mark.slow
@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.night)])
def test_killed_at_random_moments_a_package_is_wholly_old_or_wholly_new(count: int) -> None:
    seed = time.time_ns()
    moments = random.Random(seed)  # noqa: S311
    older, newer = versioned_firmware("older"), versioned_firmware("newer")
    for index, path in enumerate(sorted((newer / "msg" / "versioned").glob("*.msg"))):
        if index % 3 == 0:
            path.write_text(f"{path.read_text()}uint8 NEWER = 1\n")
        elif index % 9 == 1 and path.stem != "VehicleCommand":  # the service nests it
            path.rename(path.with_name(f"Newer{path.name}"))
    shutil.copy(newer / "srv" / "VehicleCommand.srv", newer / "srv" / "Command.srv")
    states = {tree: definitions(package(f"from-{tree.name}", str(tree))) for tree in (older, newer)}
    for tree in (older, newer):
        read_catalog(find_sources(f"from-{tree.name}"))  # checks both once: a package equal to either loads too
    package(source="older")
    started = time.perf_counter()
    sync("-q", "--px4", "newer", PACKAGE)
    longest = time.perf_counter() - started
    kills = between = 0
    while kills < count:
        found = definitions(PACKAGE)
        aim = older if found == states[newer] else newer
        process = multiprocessing.get_context("fork").Process(target=sync, args=("-q", "--px4", aim, PACKAGE))
        process.start()
        process.join(moments.uniform(0, longest))
        kills += process.is_alive()
        process.kill()
        process.join()
        is_mixed = len(folder_states(states[older], states[newer])) == 2
        between += is_mixed and definitions(PACKAGE) != found  # else an earlier kill left it so
    assert between <= 1, f"{between} of {count} between two swaps, seed {seed}"
    assert sync("-q", "--px4", "newer", PACKAGE) == 0
    assert content(PACKAGE) == content(package("fresh", "newer"))


@pytest.mark.slow
def test_two_runs_at_once_wait_for_each_other() -> None:
    firmware()
    newer_firmware(srv=True)
    package()
    expected = [definitions(PACKAGE), definitions(package("fresh", "newer"))]
    for _ in some(range(5), 5):
        command = [sys.executable, "-m", "msggen", "sync", "-q", "px4_msgs", "--px4"]
        runs = [subprocess.Popen([*command, source]) for source in ("newer", "firmware", "newer", "firmware")]
        assert [run.wait() for run in runs] == [0, 0, 0, 0]
        assert definitions(PACKAGE) in expected
        assert not (PACKAGE / staging.STAGE).exists()


@pytest.mark.slow
def test_two_runs_at_once_make_one_package() -> None:
    firmware()
    command = [sys.executable, "-m", "msggen", "sync", "-q", "--px4", "firmware", "--create", "px4_msgs"]
    runs = [subprocess.Popen(command) for _ in range(4)]
    assert [run.wait() for run in runs] == [0, 0, 0, 0]
    assert content(PACKAGE) == content(package("fresh"))
    assert sorted(os.listdir()) == ["firmware", "fresh", "px4_msgs"]
