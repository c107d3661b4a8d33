"""Tests that docs/doctor.md shows what the commands print."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from support.doctor_pages import DEFAULT, Session, plain, run_session, sessions
from support.examples import by_day
from support.ports import free_port
from support.repository import ROOT

if TYPE_CHECKING:
    import pytest

pytest_plugins = ["support.installed_ros"]
PAGE = (ROOT / "docs" / "doctor.md").read_text(encoding="utf-8").partition("\n## Errors of others\n")[0]
SESSIONS = sessions(PAGE)
NAMES = ["findings", "healthy", "check", "installed"]


@by_day("session", [*SESSIONS], 3, ids=NAMES)
def test_the_commands_print_what_the_page_shows(
    session: Session, ros: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """For less time, and with a package that was built already."""
    monkeypatch.setattr("msggen.cli.commands.doctor._SECONDS", 2.5)
    code, url = run_session(session)
    printed = capsys.readouterr()
    notes = [line.replace(ros, "/opt/ros") for line in printed.err.splitlines(keepends=True) if " note: " in line]
    assert plain("".join([*notes, printed.out]), url) == plain(session.shown)
    assert code == (1 if "problems found" in session.shown else 0)


def test_the_sessions_are_all_that_the_page_has() -> None:
    assert len(SESSIONS) == PAGE.count("```console") == len(NAMES)


def test_the_program_of_the_page_runs(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from msggen.sim import Options, Simulator

    url = f"udp://127.0.0.1:{free_port()}"
    (source,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    with Simulator(px4_types, url, [Options(sync="short")]):
        exec(source.replace(DEFAULT, url), {})  # noqa: S102 - our own text
    assert capsys.readouterr().out == "[]\n"
