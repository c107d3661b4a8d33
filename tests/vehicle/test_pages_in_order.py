"""Tests that the commands of the pages work in the order in which a reader tries them, on one simulated vehicle."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest

from msggen.sim import Options, Simulator
from msggen.sim.world import World
from support.commands import run
from support.page_code import PAGES
from support.ports import free_port
from support.repository import ROOT

ORDER = ("README.md", "first-flight.md", "vehicle.md", "topic.md", "flight.md")
"""The pages, as README.md and first-flight.md lead through them."""
_BLOCK = re.compile(r"^```(console|sh)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"(?:PYTHONPATH=\S+ )?(msggen (?:topic|command|call|record|doctor)\b.*|python \S*examples/.+)")
_ENDLESS = re.compile(r"msggen (?:topic plot|topic echo (?!.*(?:--once|-n |--for|esc_status)))")
_LONGEST = 120.0
"""How long a program may fly, and a vehicle until it stands disarmed again, in s."""


class Step(NamedTuple):
    """A command on a page, and what the page shows below it."""

    page: str
    command: str
    shown: str

    @property
    def is_program(self) -> bool:
        """Whether it runs an example."""
        return self.command.startswith("python ")

    @property
    def is_refused(self) -> bool:
        """Whether the page shows that the command fails."""
        failed = r"^msggen .*: error: |^\d+ errors$|: (?:UNSUPPORTED|DENIED|TEMPORARILY_REJECTED)\b"
        return bool(re.search(failed, self.shown, re.MULTILINE))


def steps_of(page: str) -> list[Step]:
    """Return the commands on a page that need a vehicle, in their order."""
    found: list[Step] = []
    for kind, block in _BLOCK.findall(PAGES[page].read_text(encoding="utf-8")):
        prompt = "$ " if kind == "console" else ""
        for line in block.splitlines():
            if line.startswith(prompt):
                command = _COMMAND.match(line.removeprefix(prompt))
                found.append(Step(page, command[1].partition("  #")[0].strip() if command else "", ""))
            else:
                found[-1] = found[-1]._replace(shown=f"{found[-1].shown}{line}\n")
    return [each for each in found if each.command and not _ENDLESS.match(each.command)]


@pytest.mark.night  # it flies in real time; by day, other tests run each page and program
@pytest.mark.timeout(600)
def test_a_reader_can_follow_the_pages_with_one_vehicle(
    px4_types: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    types = ROOT / "generated" / "px4_types"
    (tmp_path / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "{types}"\n')
    monkeypatch.chdir(tmp_path)
    with Simulator(px4_types, url, [Options(sync="short")]) as simulator:
        for page in ORDER:
            for step in steps_of(page):
                _follow(step, url)
            _wait_until_disarmed(simulator.vehicles[0].world)


def _follow(step: Step, url: str) -> None:
    """Run a command, which must do what its page shows: the result of a command to the vehicle, or an error."""
    _, *arguments = shlex.split(step.command)
    if step.is_program:
        _run_example(step, arguments, url)
        return
    outcome = run(arguments)
    assert bool(outcome.code) is step.is_refused, (step, outcome)
    if arguments[0] == "command" and "--list" not in arguments:
        printed = (outcome.stdout + outcome.stderr).splitlines()
        assert [line for line in step.shown.splitlines() if line not in printed] == [], (step, outcome)


def _run_example(step: Step, arguments: list[str], url: str) -> None:
    path = ROOT / arguments[0].removeprefix("msggen/")
    program = subprocess.run(
        [sys.executable, str(path), url],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "generated")])},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=_LONGEST,
        check=False,
    )
    assert program.returncode == 0, (step, program.stdout, program.stderr)


def _wait_until_disarmed(world: World) -> None:
    """Wait until the vehicle stands there as a reader of the next page finds it."""
    end = time.monotonic() + _LONGEST
    while world.is_armed:
        assert time.monotonic() < end, world.state(was_armed=False)
        time.sleep(0.1)


def test_the_pages_have_the_commands_of_a_reader() -> None:
    commands = [step.command for page in ORDER for step in steps_of(page)]
    assert "msggen command arm" in commands
    offboard, square = (
        next(place for place, command in enumerate(commands) if command.endswith(f"examples/{name}.py"))
        for name in ("offboard", "flight/square")
    )
    assert offboard < square
    assert len(commands) > 30
