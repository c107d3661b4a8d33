"""Tests that docs/doctor.md shows what the commands print."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from support.examples import by_day
from support.installed import install_release
from support.ports import free_port
from support.repository import ROOT

PAGE = (ROOT / "docs" / "doctor.md").read_text(encoding="utf-8")
DEFAULT = "udp://127.0.0.1:8888"
SESSIONS = re.findall(r"```console\n\$ (msggen sim .*) &\n\$ (msggen .*)\n((?:.*\n)*?)```", PAGE)
PACKAGE = str(ROOT / "generated" / "px4_types")


def plain(text: str, url: str) -> str:
    """Return an output without the numbers that differ from run to run."""
    text = text.replace(url, DEFAULT)
    text = re.sub(r"(the vehicle at 127\.0\.0\.1):\d+", r"\1:PORT", text)
    return re.sub(r"\d+ samples in [\d.]+ s", "N samples in T s", text)


@pytest.fixture
def ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A folder in the place of /opt/ros, with px4_msgs."""
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr("msggen.sources.installed._SYSTEM", str(tmp_path))
    install_release(tmp_path / "kilted/share", "v1.18")
    return str(tmp_path)


NAMES = ["findings", "healthy", "check", "installed"]


@by_day("session", SESSIONS, 3, ids=NAMES)
def test_the_commands_print_what_the_page_shows(
    session: tuple[str, str, str], ros: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """For less time, and with a package that was built already."""
    simulation, command, shown = session
    monkeypatch.setattr("msggen.cli.commands.doctor._SECONDS", 2.5)
    url = f"udp://127.0.0.1:{free_port()}"
    words = [*shlex.split(simulation)[1:], url, "--types", PACKAGE]
    with subprocess.Popen(
        [sys.executable, "-m", "msggen", *words], env={**os.environ, "PYTHONPATH": str(ROOT)}
    ) as program:
        try:
            code = main([*shlex.split(command)[1:], "--link", url])
        finally:
            program.kill()
    printed = capsys.readouterr()
    notes = [line.replace(ros, "/opt/ros") for line in printed.err.splitlines(keepends=True) if " note: " in line]
    assert plain("".join([*notes, printed.out]), url) == plain(shown, url)
    assert code == (1 if "problems found" in shown else 0)


def test_the_sessions_are_all_that_the_page_has() -> None:
    assert len(SESSIONS) == PAGE.count("```console") == len(NAMES)


def test_the_program_of_the_page_runs(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from msggen.sim import Options, Simulator

    url = f"udp://127.0.0.1:{free_port()}"
    (source,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    with Simulator(px4_types, url, [Options(sync="short")]):
        exec(source.replace(DEFAULT, url), {})  # noqa: S102 - our own text
    assert capsys.readouterr().out == "[]\n"
