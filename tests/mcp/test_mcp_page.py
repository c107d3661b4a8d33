"""Tests that the page for assistants shows what there is."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.cli.parser import parser_for
from support.commands import run
from support.lazy import Lazy
from support.repository import ROOT

made = Lazy("msggen.mcp.server")

PAGE = (ROOT / "docs" / "assistants.md").read_text(encoding="utf-8")


def test_the_page_lists_all_tools() -> None:
    table = PAGE.partition("| tool | answers |")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)`", table, re.MULTILINE) == [each.__name__ for each in made.TOOLS]


def test_the_configuration_starts_the_command() -> None:
    (text,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    (server,) = json.loads(text)["mcpServers"].values()
    assert server["command"] == "msggen"
    assert parser_for(server["args"]).parse_args(server["args"]).places == server["args"][1:]


@pytest.mark.night
@pytest.mark.slow  # a flight, and two processes
def test_the_first_session_is_real(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=":")
    _, simulated, shown, asked, answer = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)[0].splitlines()
    assert run(simulated.split()[2:]).stdout == f"{shown}\n"
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / asked.split()[2]).write_text(program)
    done = subprocess.run([sys.executable, "ask.py"], capture_output=True, text=True, check=False, timeout=120)
    assert done.stdout == f"{answer}\n", done.stderr
