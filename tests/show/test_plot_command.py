"""Tests of `msggen topic plot` in a terminal, into a pipe and to a file, with a simulated vehicle."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

import pytest

from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from msggen.base.missing import installing
from msggen.sim import Options, Simulator
from support.commands import exit_code
from support.imports import forget
from support.ports import free_port
from support.pseudo_terminal import TerminalProgram
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")
SOON = Options(sync="short")
FIELDS = ("vehicle_local_position.x", "vehicle_local_position.y", "vehicle_status.nav_state")


@pytest.fixture
def url() -> str:
    """An address that nothing uses."""
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture
def program(url: str) -> Iterator[TerminalProgram]:
    """The command in a terminal of 80 columns and 24 lines."""
    words = ("topic", "plot", *FIELDS, "--link", url, "--types", PACKAGE)
    program = TerminalProgram("-m", "msggen", *words, size=(80, 24))
    yield program
    program.close()


def run(words: Sequence[str], url: str) -> int:
    return exit_code(["topic", "plot", *words, "--link", url, "--types", PACKAGE])


def is_drawn(text: str) -> bool:
    """Whether a screen has the lines and the bands."""
    return "AUTO_LOITER│" in text and "a vehicle_local_position.x" in text and text.splitlines()[-1].startswith("q qui")


def test_keys_and_sizes(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    with Simulator(px4_types, url, [SOON]):
        text = program.wait_for(is_drawn)
        assert text.startswith("msggen topic plot  ")
        program.press(" ")
        program.wait_for(lambda text: "space go on" in text)
        program.press("p")
        program.wait_for(lambda text: "space pause" in text)
        program.resize(132, 40)
        text = program.wait_for(lambda text: is_drawn(text) and text.splitlines()[0].endswith(url))
        assert max(len(line) for line in text.splitlines()) > 100
        program.resize(40, 9)
        program.wait_for(lambda text: "no room for vehicle_status.nav_state" in text)
        program.press("\x03")
        assert program.wait() == 0
    assert program.is_restored
    shown, left = program.written.rsplit(b"\033[?25h\033[?1049l", 1)
    assert b"vehicle_local_position.x" in shown
    assert b"vehicle_local_position.x" in left  # the last plot stays


@pytest.mark.night  # each run does it with top
def test_a_vehicle_that_leaves_and_returns(url: str, program: TerminalProgram, px4_types: ModuleType) -> None:
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(is_drawn)
    program.wait_for(lambda text: "disconnected" in text.splitlines()[1])
    with Simulator(px4_types, url, [SOON]):
        program.wait_for(lambda text: is_drawn(text) and "disconnected" not in text)
        program.press("q")
        assert program.wait() == 0
    assert program.is_restored


def test_a_pipe_gets_the_plot_once(url: str, px4_types: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, [SOON]):
        assert run([*FIELDS, FIELDS[0], "--for", "1"], url) == DONE
        first, *lines = capsys.readouterr().out.splitlines()
        assert first.startswith("a vehicle_local_position.x ")
        assert len(lines) == 22
        assert max(map(len, lines)) <= 80
        assert any(line.strip().startswith("AUTO_LOITER│") for line in lines)


def test_fields_without_samples_are_told(url: str, px4_types: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, [SOON]):
        assert run([FIELDS[0], "vehicle_command_ack.result", "--for", "0.5"], url) == FINDINGS
    told = capsys.readouterr()
    assert told.err == "there are no samples of vehicle_command_ack.result\n"
    assert "no sample yet: vehicle_command_ack.result" in told.out


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_a_file_has_what_was_drawn(
    ending: str, url: str, tmp_path: Path, px4_types: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"plot.{ending}"
    with Simulator(px4_types, url, [SOON]):
        assert run([*FIELDS, "--for", "1", "-o", str(path)], url) == DONE
    assert capsys.readouterr().out.startswith(f"{path}: ")
    data = path.read_bytes()
    if ending == "svg":
        assert all(f">{text}<".encode() in data for text in (*FIELDS, "AUTO_LOITER", "[m]"))
    else:
        assert data.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["vehicle_status"], "argument FIELD: expected TOPIC.FIELD, found 'vehicle_status'"),
        (["vehicle_statu.nav_state"], "argument FIELD: no topic 'vehicle_statu', did you mean 'vehicle_status'?"),
        (["vehicle_status.nav_stat"], "did you mean 'nav_state'?"),
        (["vehicle_odometry.position[3]"], "'position' has 3 values, 0 to 2, and no [3]"),
        (["sensor_combined[1].timestamp"], "gives each instance a topic"),
        ([FIELDS[0], "-o", "plot.jpg"], "expected a name that ends in .png, .svg, .pdf, found 'plot.jpg'"),
        ([FIELDS[0], "-o", "nowhere/plot.png"], "there is no folder 'nowhere'"),
        ([FIELDS[0], "--window", "0"], "argument --window: expected a number above 0, found '0'"),
        ([FIELDS[0], "--for", "x"], "argument --for: expected a number"),
        ([], "the following arguments are required: FIELD"),
    ],
)
def test_errors_come_before_any_waiting(
    words: Sequence[str], error: str, url: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def connect(*_: object, **_options: object) -> None:
        raise AssertionError("a wrong argument must not wait for a vehicle")

    monkeypatch.setattr("msggen.vehicle.vehicle.Vehicle.__init__", connect)
    assert run(words, url) == FAILED
    assert error in capsys.readouterr().err


@pytest.mark.parametrize("package", ["plotille", "matplotlib", "numpy"])
def test_a_package_that_is_not_installed_is_named(
    package: str, url: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    forget(monkeypatch, "msggen.show.plot", "msggen.recordings")
    monkeypatch.setitem(sys.modules, package, None)
    assert run([FIELDS[0], "-o", "plot.png"], url) == FAILED
    assert f"{package}: L111 this package is not installed: {installing('plot')}" in capsys.readouterr().err


def test_a_topic_that_only_px4_reads_is_refused(
    url: str, px4_types: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, url, [SOON]):
        assert run(["trajectory_setpoint.yaw", "--direct", "--for", "1"], url) == FAILED
    assert "PX4 reads '/fmu/in/trajectory_setpoint', and does not publish it: " in capsys.readouterr().err
