"""Tests of docs/link.md: its table of errors has texts that exist, and its variables and commands are real."""

from __future__ import annotations

import re

from msggen.live.links.opening import DIRECT
from msggen.live.owner.process import IDLE, IDLE_S, IDLE_WITH_VEHICLE_S
from support.commands import COMMANDS
from support.repository import ROOT

PAGE = (ROOT / "docs" / "link.md").read_text(encoding="utf-8")


def test_the_errors_of_the_table_exist() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "msggen" / "live").rglob("*.py")))
    texts = re.findall(r"^\| `(.*?)` \|", PAGE.partition("## Errors")[2], re.MULTILINE)
    assert len(texts) == 7
    assert [text for text in texts if text not in source] == []


def test_the_variables_are_those_that_are_read() -> None:
    assert {*re.findall(r"MSGGEN_\w+", PAGE)} == {DIRECT, IDLE, "MSGGEN_RUNTIME"}
    assert f"{IDLE_S:g} s after its last program, or {IDLE_WITH_VEHICLE_S:g} s if a vehicle is connected" in PAGE


def test_the_commands_are_those_of_the_command_line() -> None:
    commands = {f"link {name}" for name in re.findall(r"^\| `msggen link (\w+)", PAGE, re.MULTILINE)}
    assert commands == {name for name in COMMANDS if name.startswith("link ")}
