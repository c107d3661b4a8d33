"""Tests that the commands of docs/topic.md print what it shows, with a simulated vehicle."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.sim import Options, Simulator
from support.commands import run
from support.pages import matches
from support.ports import free_port
from support.repository import ROOT

PAGE = (ROOT / "docs" / "topic.md").read_text().partition("\n## Publish\n")[0]
"""The page up to the commands that send, which `test_live_commands.py` runs."""
SESSIONS = re.findall(r"```console\n\$ (msggen topic .*)\n((?:.*\n)*?)```", PAGE)


@pytest.fixture(scope="module")
def folder(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the settings of the page, and a vehicle on their link."""
    made = tmp_path_factory.mktemp("topic")
    url = f"udp://127.0.0.1:{free_port()}"
    types = ROOT / "generated" / "px4_types"
    (made / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "{types}"\n')
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0)]):
        yield made


def comparable(text: str) -> str:
    """Return a text with all numbers and widths of columns alike."""
    return re.sub(r"[ \t]+", " ", re.sub(r"(?<!\w)-?(?:\d+(?:\.\d+)?(?:e[-+]\d+)?|\.nan)", "1", text))


@pytest.mark.parametrize(("command", "shown"), SESSIONS, ids=[command for command, _ in SESSIONS])
def test_a_command_prints_what_the_page_shows(
    command: str, shown: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    outcome = run(shlex.split(command)[1:])
    notices = ("the vehicle has disconnected", "the vehicle is connected")  # of a session that ends between commands
    told = [line for line in outcome.stderr.splitlines(keepends=True) if not line.startswith(notices)]
    printed = "".join([*told, outcome.stdout])
    if " -v " in command:  # under load, a slow topic is silent for the time
        assert " Hz " in printed
        printed, shown = (re.sub(r"(?m)^(\S+ +out +\w+).*", r"\1", text) for text in (printed, shown))
    assert matches(comparable(shown), comparable(printed)), printed


def test_the_page_has_commands_of_all_actions() -> None:
    assert {command.split()[2] for command, _ in SESSIONS} >= {
        "list",
        "info",
        "find",
        "echo",
        "plot",
        "hz",
        "bw",
        "delay",
    }
