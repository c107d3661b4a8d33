"""Tests that the first screen of README.md has what a newcomer needs, and that all of it works."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from msggen.cli import main
from msggen.sim import Options, Simulator
from support.doctor_pages import DEFAULT, run_session, sessions
from support.ports import free_port
from support.repository import ROOT

LINES = 60
SCREEN = "\n".join((ROOT / "README.md").read_text(encoding="utf-8").splitlines()[:LINES])
PROGRAMS = re.findall(r"```python\n(.*?)```", SCREEN, re.DOTALL)
NEEDED = {
    "what it is": r"\A# msggen\n\nmsggen generates Python types",
    "install": r"^\$ .*pip install",
    "build": r"^\$ .*msggen build",
    "import": "^from px4_types import",
    "one vehicle": r"^with Vehicle\(",
    "one recording": r"^with recordings\.open\(",
    "one picture": r"!\[.+\]\(docs/[\w/]+\.(svg|png)\)",
}


class _EnoughError(Exception):
    """Ends a program that would go on for ever."""


@pytest.mark.parametrize("name", NEEDED)
def test_the_first_screen_has(name: str) -> None:
    assert re.search(NEEDED[name], SCREEN, re.MULTILINE)


def test_the_first_screen_cuts_no_block() -> None:
    assert SCREEN.count("```") % 2 == 0
    assert len(PROGRAMS) == 3


def test_the_message_of_the_first_screen_is_encoded_and_decoded(px4_types: ModuleType) -> None:
    names: dict[str, Any] = {}
    exec(PROGRAMS[0], names)  # noqa: S102 - code of our own page
    assert names["message"].encode() == names["data"]
    assert names["endpoint"].message is px4_types.SensorCombined


def test_the_vehicle_of_the_first_screen_answers(capsys: pytest.CaptureFixture[str]) -> None:
    [session] = sessions(SCREEN)
    code, _ = run_session(session)
    assert capsys.readouterr().out == session.shown
    assert code == 0


def test_the_program_of_the_first_screen_prints_positions(px4_types: ModuleType) -> None:
    printed: list[tuple[float, ...]] = []

    def show(*values: float) -> None:
        printed.append(values)
        if len(printed) == 3:
            raise _EnoughError

    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short")]), pytest.raises(_EnoughError):
        exec(PROGRAMS[1].replace(DEFAULT, url), {"print": show})  # noqa: S102 - code of our own page
    assert all(len(values) == 3 for values in printed)


def test_the_recording_of_the_first_screen_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sizes vary a little with the date."""
    monkeypatch.chdir(tmp_path)
    steps = re.findall(r"^\$ msggen ((?:sim|log) (?!.*&$).*)\n((?:(?!\$ |```).*\n)*)", SCREEN, re.MULTILINE)
    assert len(steps) == 2
    for command, shown in steps:
        assert main(shlex.split(command)) == 0
        assert _rough(capsys.readouterr().out) == _rough(shown)
    exec(PROGRAMS[2], {})  # noqa: S102 - code of our own page
    assert len(re.findall(r"-?[\d.]+", capsys.readouterr().out)) == 3


def _rough(text: str) -> str:
    """Return an output without the digits after the point, of which a report has more or fewer."""
    return re.sub(r"[\d.]+ kB", "N kB", text)
