"""Tests that the commands of docs/first-flight.md, in its order, do what the page shows, with a simulated vehicle."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path
from types import ModuleType

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from msggen.sim import Options, Simulator
from support.commands import run
from support.ports import free_port
from support.repository import ROOT

PAGE = (ROOT / "docs" / "first-flight.md").read_text(encoding="utf-8")
STEP = re.compile(r"^\$ (.+)\n((?:(?!\$ |```).*\n)*)", re.MULTILINE)
STEPS = [step for step in STEP.findall(PAGE) if step[0] != "msggen sim --sync short"]
NOTICES = ("waiting for a vehicle", "the vehicle has disconnected", "the vehicle is connected")


def comparable(text: str) -> str:
    """Return a text without numbers."""
    return re.sub(r"-?\d+(?:\.\d+)?", "1", text)


@pytest.mark.slow  # it flies
def test_the_commands_do_what_the_page_shows(
    px4_types: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    (tmp_path / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with Simulator(px4_types, url, [Options(sync="short")]):
        for command, shown in STEPS:
            outcome = run(shlex.split(command)[1:])
            told = [line for line in outcome.stderr.splitlines(keepends=True) if not line.startswith(NOTICES)]
            printed = "".join([*told, outcome.stdout])
            if command.startswith(("msggen record", "msggen doctor")):
                assert outcome.code == 0, printed
                assert comparable(printed).split(" ")[:2] == comparable(shown).split(" ")[:2]
            else:  # `hz` reports each second, as often as there is time for
                lines = comparable(printed).splitlines()[: shown.count("\n")]
                assert lines == comparable(shown).splitlines(), command
    code = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", PAGE, re.DOTALL)
    assert code
    capsys.readouterr()
    exec(compile(code[1], "docs/first-flight.md", "exec"), {})  # noqa: S102 - code of our own page
    assert capsys.readouterr().out == code[2]


def test_the_page_installs_what_its_code_imports() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (chosen,) = re.findall(r"pip install '\.\[([\w,]+)\]'", PAGE)
    installed = {re.split(r"[^\w-]", each)[0] for extra in chosen.split(",") for each in extras[extra]}
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert set(re.findall(r"^(?:import|from) (\w+)", code, re.MULTILINE)) - {"msggen"} <= installed


def test_the_page_covers_the_way_from_looking_to_recording() -> None:
    words = {command.split()[1] for command, _ in STEPS}
    assert words == {"topic", "command", "record", "doctor"}
