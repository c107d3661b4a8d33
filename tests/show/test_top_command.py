"""Tests of `msggen top` in a terminal and into a pipe, with a simulated vehicle."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from msggen.cli import main
from msggen.show.top.drawing import screen
from msggen.show.top.rows import Health, Table
from msggen.show.top.terminal import keys_in
from msggen.show.top.view import _CHANGES, _PAGES, _STEPS, View
from msggen.sim import Options, Simulator
from support.ports import free_port
from support.pseudo_terminal import TerminalProgram
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")
SOON = Options(sync="short")


@pytest.fixture
def url() -> str:
    """An address that nothing uses."""
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture
def program(url: str) -> Iterator[TerminalProgram]:
    """The command in a terminal of 100 columns and 24 lines."""
    program = TerminalProgram("-m", "msggen", "top", "--link", url, "--types", PACKAGE, size=(100, 24))
    yield program
    program.close()


def rate_of(text: str, topic: str) -> float:
    """Return the rate of a topic on a screen, 0 if it is not known yet."""
    words = next((line.split() for line in text.splitlines() if topic in line), ["", "-"])
    return 0.0 if words[1] == "-" else float(words[1])


def test_keys_and_sizes(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    with Simulator(px4_types, url, [SOON._replace(parts=("obstacle-sensor",))]):
        text = program.wait_for(lambda text: rate_of(text, "/fmu/out/collision_constraints") > 1)
        text = program.wait_for(lambda text: text.startswith("msggen top  AUTO_LOITER  DISARMED  battery "))
        assert PACKAGE[:20] in text.splitlines()[0]
        assert "31 topics, " in text
        program.press("/status_v4\r")
        program.wait_for(lambda text: "filter: status_v4" in text and "odometry" not in text)
        program.press("\r")
        program.wait_for(lambda text: "nav_state" in text and "AUTO_LOITER (4)" in text)
        program.press("q")
        program.wait_for(lambda text: "nav_state" not in text and "q quit" in text)
        program.press("\033")
        program.wait_for(lambda text: "odometry" in text)
        program.press("?")
        program.wait_for(lambda text: "explain the keys" in text and "odometry" not in text)
        program.press("x")
        program.wait_for(lambda text: "odometry" in text)
        program.press("s\033[B ")
        program.wait_for(lambda text: "sort: rate" in text and "paused" in text.splitlines()[0])
        program.resize(60, 12)
        program.wait_for(lambda text: text.splitlines()[2].split() == ["topic", "Hz", "age", "s"])
        program.resize(120, 40)
        program.wait_for(
            lambda text: "longest s" in text and "last 20 s" in text and text.splitlines()[-1].startswith("q quit")
        )
        assert "/fmu/out/wind" in program.text
        program.press(" ")
        program.wait_for(lambda text: re.search(r"vehicle_odometry +[\d.]+ +[▅▆▇]{3}", text))
        program.press("\x03")
        assert program.wait() == 0
    assert program.is_restored
    assert program.written.endswith(b"\033[?25h\033[?1049l")


def test_a_vehicle_that_leaves_and_returns(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(lambda text: "q quit" in text)
    program.wait_for(lambda text: "disconnected" in text.splitlines()[1])
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(lambda text: text.splitlines()[1].startswith("31 topics, "))
        program.press("q")
        assert program.wait() == 0
    assert program.is_restored


def test_a_signal_restores_the_terminal(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(lambda text: "q quit" in text)
        program.process.send_signal(signal.SIGTERM)
        assert program.wait() == 128 + signal.SIGTERM
    assert program.is_restored
    assert program.written.endswith(b"\033[?25h\033[?1049l")


def test_a_pipe_gets_the_table_once(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, [SOON]):
        assert main(["top", "--link", url, "--types", PACKAGE, "--window", "0.5"]) == 0
        heading, *lines = capsys.readouterr().out.splitlines()
        assert heading.split()[:3] == ["topic", "Hz", "limit"]
        assert len(lines) == 31
        assert rate_of("\n".join(lines), "/fmu/out/vehicle_odometry") > 1
        assert main(["top", "--link", url, "--types", PACKAGE, "--window", "1.5", "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
    odometry = next(each for each in document["topics"] if each["topic"] == "/fmu/out/vehicle_odometry")
    assert (odometry["message"], odometry["limit_hz"], odometry["size_bytes"]) == ("VehicleOdometry", 100.0, 118)
    assert document["vehicle"] == f"{PACKAGE}  {url}"
    assert (document["mode"], document["arming"], document["failsafe"]) == ("AUTO_LOITER", "DISARMED", False)
    assert 0 < document["battery"] <= 1


def test_warnings_do_not_spoil_the_screen(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    text = "two vehicles have the key 1"
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(lambda screen: "q quit" in screen)
        with Simulator(px4_types, url, [SOON]):
            program.wait_for(lambda screen: text in screen.splitlines()[2])
            assert program.lines[0].startswith("msggen top")
            assert program.lines[-1].startswith("q quit")
            program.press("q")
            assert program.wait() == 0
    assert program.written.rpartition(b"\033[?1049l")[2].startswith(text.encode())


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("a/ \r", ["a", "/", "space", "enter"]),
        ("\033[A\033OB\033[5~\033[1~\033[F\033[3~", ["up", "down", "page up", "home", "end", "delete"]),
        ("\033", ["escape"]),
        ("\x7f\b\x03", ["backspace", "backspace", "ctrl-c"]),
        ("\033[1;5Ax\033[99~\x01", ["x"]),
        ("é漢", ["é", "漢"]),
    ],
)
def test_keys_have_names(text: str, keys: list[str]) -> None:
    assert [*keys_in(text)] == keys


# --- the page

PAGE = (ROOT / "docs" / "topic.md").read_text(encoding="utf-8").partition("\n## Live table\n")[2].partition("\n## ")[0]


def test_the_page_shows_what_the_command_prints(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, [SOON]):
        main(["top", "--link", url, "--types", PACKAGE, "--once", "--window", "0.5"])
    printed = capsys.readouterr().out.splitlines()
    session = PAGE.split("```console\n")[2].partition("```")[0]
    command, heading, *rows = session.splitlines()
    assert command == "$ msggen top --once | grep -e topic -e odometry -e local_position"
    assert heading == printed[0]
    unmeasured = [(row.split()[0], row.split()[2], row.split()[5]) for row in rows]
    assert unmeasured == [
        (row.split()[0], row.split()[2], row.split()[5]) for row in printed if "odometry" in row or "local_pos" in row
    ]


def test_the_picture_of_the_page_is_a_screen_of_the_command() -> None:
    health = Health("AUTO_LOITER", "DISARMED", battery=1.0)
    picture = (ROOT / "docs" / "top.svg").read_text(encoding="utf-8").replace("&#160;", " ")
    table = Table((), "v1.18  udp://127.0.0.1:8888", health=health)
    title, _, heading, *_, keys = screen(table, View(sort="bandwidth"), (), 104, 24)
    for line in (title, heading, keys):
        assert all(word in picture for word in line.plain.split())


def test_the_page_lists_the_keys() -> None:
    shown = ", ".join(re.findall(r"(?m)^\| (.*?) \|", PAGE[PAGE.index("| key |") :]))
    names = {each.strip("`") for each in re.split(r"[,;] ", shown)}
    assert {*_STEPS, *_PAGES, *_CHANGES, "enter"} - {"ctrl-c"} <= names
