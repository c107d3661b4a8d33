"""Tests of docs/links.md: its variables, its commands and its unit for systemd are real."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

from msggen.cli import parser_for
from msggen.link.address import parse_address
from msggen.vehicle.opening import DIRECT
from msggen.vehicle.owner.process import IDLE, IDLE_S, IDLE_WITH_VEHICLE_S
from support.commands import COMMANDS
from support.repository import ROOT

PAGE = (ROOT / "docs" / "links.md").read_text(encoding="utf-8")


def test_the_variables_are_those_that_are_read() -> None:
    assert {*re.findall(r"MSGGEN_\w+", PAGE)} == {DIRECT, IDLE, "MSGGEN_RUNTIME"}
    assert f"{IDLE_S:g} s after its last program, or {IDLE_WITH_VEHICLE_S:g} s if a vehicle is connected" in PAGE


def unit() -> tuple[str, ConfigParser]:
    """Return the unit for systemd on the page."""
    (text,) = re.findall(r"^```ini\n(.*?)```", PAGE, re.DOTALL | re.MULTILINE)
    parsed = ConfigParser(interpolation=None)
    parsed.read_string(text)
    return text, parsed


def test_the_unit_starts_a_command_that_is_accepted() -> None:
    service = unit()[1]["Service"]
    program, *words = shlex.split(service["ExecStart"])
    assert program.endswith("/bin/msggen")
    options = parser_for(words).parse_args(words)
    assert (options.background, str(parse_address(options.link))) == (False, "serial:///dev/ttyAMA0?baud=921600")
    assert service["Restart"] == "always"
    assert int(service["RestartSec"]) * 5 > 10, "systemd gives up after 5 starts in 10 s"


@pytest.mark.tools("systemd-analyze")
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    path = tmp_path / "msggen-link.service"
    path.write_text(re.sub(r"ExecStart=\S+", f"ExecStart={sys.executable}", unit()[0]))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--user", path],
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_commands_are_those_of_the_command_line() -> None:
    commands = {f"link {name}" for name in re.findall(r"^\| `msggen link (\w+)", PAGE, re.MULTILINE)}
    assert commands == {name for name in COMMANDS if name.startswith("link ")}
