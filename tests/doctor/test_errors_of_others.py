"""Tests that docs/doctor.md names commands, rules and pages that exist for errors of others, and shows real output."""

from __future__ import annotations

import re
import shlex
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from msggen.cli import main, parser_for
from msggen.doctor.rules import DOCTOR
from msggen.vehicle.owned.places import CAN_SHARE
from support.doctor_pages import Session, plain, run_session, sessions
from support.examples import by_day
from support.pages import matches
from support.repository import ROOT

pytest_plugins = ["support.installed_ros", "support.owned_links"]

PATH = ROOT / "docs" / "doctor.md"
PAGE = PATH.read_text(encoding="utf-8").partition("\n## Errors of others\n")[2]
SESSIONS = sessions(PAGE)
NAMES = ["release", "setpoint", "arming"]
SETPOINT = "setpoint"
"""The session in which the doctor must know who publishes, which the process that owns the link tells."""


def inline() -> list[str]:
    """Return the code within the text and the table."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL))


def commands() -> Iterator[str]:
    """Yield the commands of msggen on the page."""
    yield from (each for each in inline() if each.startswith("msggen "))
    yield from (line.removesuffix(" &") for line in re.findall(r"^\$ (msggen .*)", PAGE, re.MULTILINE))


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives to the headings of a page."""
    titles = re.findall(r"^#+ (.*)", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("command", sorted({*commands()}))
def test_every_command_is_one_of_msggen(command: str) -> None:
    _, *words = shlex.split(command)
    parser_for(words).parse_args(words)


def test_every_rule_is_one_of_the_doctor() -> None:
    named = {each for each in inline() if re.fullmatch(r"[A-Z]+(_[A-Z]+)+", each)}
    named |= {*re.findall(r"^udp://\S+: ([A-Z_]+)", PAGE, re.MULTILINE)}
    assert named - {rule.id for rule in DOCTOR} == set()
    assert len(named) > 20


def test_every_link_leads_to_a_heading() -> None:
    links = re.findall(r"\]\(([^)#:]*)#([^)]+)\)", PAGE)
    assert [(page, anchor) for page, anchor in links if anchor not in anchors(PATH.parent / (page or PATH.name))] == []
    assert len(links) > 30


def test_every_row_has_a_text_and_a_command() -> None:
    rows = re.findall(r"^\| (.*) \| (.*) \| (.*) \|$", PAGE.partition("\n### ")[0], re.MULTILINE)[2:]
    assert len(rows) > 30
    assert [row for row in rows if not re.search("`[^`]+`", row[0])] == []
    assert [row for row in rows if not re.fullmatch("`msggen [^`]+`|none", row[2])] == []


@by_day("name", NAMES, 3)
def test_the_commands_print_what_the_page_shows(
    name: str,
    ros: str,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """For less time, and with a package that was built already."""
    monkeypatch.setattr("msggen.cli.commands.doctor._SECONDS", 2.5)
    if name == SETPOINT:
        if not CAN_SHARE:
            pytest.skip("links are not shared on Windows")
        request.getfixturevalue("owned")
    session: Session = SESSIONS[NAMES.index(name)]
    code, url = run_session(session)
    printed = capsys.readouterr()
    notes = [
        line.replace(ros, "/opt/ros")
        for line in printed.err.splitlines(keepends=True)
        if " note: " in line or line.startswith("--verbose")
    ]
    shown = plain(session.shown).splitlines()
    assert sorted(plain("".join([*notes, printed.out]), url).splitlines()) == sorted(shown)  # of two streams
    assert code == 1


def test_the_sessions_are_all_that_the_page_has() -> None:
    assert len(SESSIONS) == len(NAMES)
    assert PAGE.count("```console") == len(SESSIONS) + 2  # the sessions with a recording


def test_a_bag_without_definitions_is_read_as_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sim", "--log", "flight.ulg", "--px4", "v1.18"]) == 0
    words = ["flight.ulg", "vehicle_odometry", "-o", "bag", "--format", "rosbag2", "--storage", "sqlite3"]
    assert main(["log", "convert", *words]) == 0
    with closing(sqlite3.connect("bag/bag_0.db3")) as database:
        database.execute("drop table message_definitions")  # as ROS 2 Humble writes it
        database.commit()
    found = re.findall(r"```console\n\$ msggen (log .*)\n((?:.*\n)*?)```", PAGE)
    assert len(found) == 2
    for command, shown in found:
        capsys.readouterr()
        assert main(shlex.split(command)) == 0
        printed = capsys.readouterr()
        assert matches(_steady(shown), _steady(printed.err + printed.out))


def _steady(text: str) -> str:
    """Return an output without dates and sizes."""
    return re.sub(r"[\d:-]+ [\d:]+ UTC|[\d.]+ kB", "N", text)
