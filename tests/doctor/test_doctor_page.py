"""Tests that docs/doctor.md shows what the commands print."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from typing import TYPE_CHECKING, Any

from msggen.cli import main
from support.examples import by_day
from support.ports import free_port
from support.repository import ROOT

if TYPE_CHECKING:
    import pytest

PAGE = (ROOT / "docs" / "doctor.md").read_text(encoding="utf-8")
DEFAULT = "udp://127.0.0.1:8888"
SESSIONS = re.findall(r"```console\n\$ (msggen sim .*) &\n\$ (msggen .*)\n((?:.*\n)*?)```", PAGE)
PACKAGE = str(ROOT / "generated" / "px4_types")


def plain(text: str, url: str) -> str:
    """Return an output without the numbers that differ from run to run."""
    text = text.replace(url, DEFAULT)
    text = re.sub(r"(the vehicle at 127\.0\.0\.1):\d+", r"\1:PORT", text)
    return re.sub(r"\d+ samples in [\d.]+ s", "N samples in T s", text)


@by_day(("simulation", "command", "shown"), SESSIONS, 3, ids=["findings", "healthy", "check"])
def test_the_commands_print_what_the_page_shows(
    simulation: str, command: str, shown: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """For less time, and with a package that was built already."""
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
    assert plain(capsys.readouterr().out, url) == plain(shown, url)
    assert code == (1 if "problems found" in shown else 0)


def test_there_are_three_sessions() -> None:
    assert len(SESSIONS) == PAGE.count("```console") == 3


def test_the_program_of_the_page_runs(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from msggen.sim import Options, Simulator

    url = f"udp://127.0.0.1:{free_port()}"
    (source,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    with Simulator(px4_types, url, [Options(sync="short")]):
        exec(source.replace(DEFAULT, url), {})  # noqa: S102 - our own text
    assert capsys.readouterr().out == "[]\n"
