"""Tests of `msggen log plot`: its files, its window, and its errors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from msggen.cli.printing import number_of_bytes
from support.commands import exit_code
from support.log_files import Written, write_log
from support.recordings import START
from support.written import write_recording


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, px4_types: Any) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND"):
        monkeypatch.delenv(name, raising=False)
    local = px4_types.VehicleLocalPosition
    samples = [("/fmu/out/vehicle_local_position_v1", step / 10, local(z=-float(step))) for step in range(50)]
    write_recording(tmp_path / "flight.mcap", samples)
    return tmp_path


def run(words: Sequence[str]) -> int:
    return exit_code(["log", "plot", *words])


def test_a_file_is_written_and_replaced(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["flight.mcap", "vehicle_local_position.z", "-o", "z.svg"]
    assert run(words) == DONE
    first = (here / "z.svg").read_bytes()
    assert b">vehicle_local_position.z<" in first
    assert capsys.readouterr().out == f"z.svg: {number_of_bytes(len(first))}\n"
    assert run([*words, "--start", "1", "--stop", "2", "-q"]) == DONE
    assert (here / "z.svg").read_bytes() != first
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (
            ["flight.mcap", "vehicle_local_position.zz", "-o", "z.png"],
            "error: no field is called 'zz', did you mean",
        ),
        (
            ["flight.mcap", "vehicle_local_position.z", "-o", "z.jpg"],
            "expected a name that ends in .png, .svg, .pdf, f",
        ),
        (["flight.mcap", "vehicle_local_position.z"], "no window can be shown here: write a file, -o flight.png"),
        (["flight.mcap", "vehicle_local_position"], "is a topic: name one of its fields, such as xy_valid, "),
        (["flight.mcap", "vehicle_local_position.zz"], "error: no field is called 'zz', did you mean"),
        (["flight.mcap"], "the following arguments are required: FIELD"),
        (["text.txt", "a.b", "-o", "z.png"], "text.txt: R102 is not a recording: "),
        (["flight.mcap", "vehicle_local_position.z", "-o", "no/z.png", "--stop", "x"], "argument --stop: expected a t"),
    ],
)
def test_errors(words: Sequence[str], error: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "text.txt").write_text("text")
    assert run(words) == FAILED
    assert error in capsys.readouterr().err
    assert not list(here.glob("z.*"))


@pytest.mark.parametrize(
    ("fields", "is_drawn"),
    [(["vehicle_status.nav_state"], False), (["vehicle_status.nav_state", "vehicle_local_position.z"], True)],
)
def test_fields_without_samples_are_told(
    *, fields: Sequence[str], is_drawn: bool, here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    local, status = px4_types.VehicleLocalPosition(), px4_types.VehicleStatus()
    samples = [("/fmu/out/vehicle_local_position_v1", step / 10, local) for step in range(50)]
    write_recording(here / "late.mcap", [*samples, ("/fmu/out/vehicle_status_v4", 4.0, status)])
    assert run(["late.mcap", *fields, "-o", "late.svg", "--stop", "3"]) == FINDINGS
    told = capsys.readouterr()
    assert told.err == "late.mcap: there are no samples of vehicle_status.nav_state before 3 s\n"
    assert told.out.startswith("late.svg: ") == is_drawn
    assert (here / "late.svg").exists() == is_drawn


def test_notes_and_problems_are_told(here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    payload = px4_types.VehicleStatus().encode()
    bare = Written("/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "", [(START, START, payload)] * 500)
    write_log(here / "bare.mcap", [bare])
    assert run(["bare.mcap", "vehicle_status.nav_state", "-o", "a.svg"]) == DONE
    assert re.match(r"bare\.mcap: .* v1\.18", capsys.readouterr().err)
    (here / "cut.mcap").write_bytes((here / "flight.mcap").read_bytes()[:-3000])
    assert run(["cut.mcap", "vehicle_local_position.z", "-o", "b.svg", "-q"]) == FINDINGS
    told = capsys.readouterr()
    assert re.match(r"cut\.mcap: .* \(at byte \d+", told.err)
    assert told.out == ""
    assert (here / "b.svg").exists()


def test_a_window_is_shown_where_there_is_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib import pyplot as plt

    shown: list[list[int]] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("matplotlib.get_backend", lambda: "tkagg")
    monkeypatch.setattr(plt, "show", lambda: shown.append(plt.get_fignums()))
    plt.switch_backend("agg")
    assert run(["flight.mcap", "vehicle_local_position.z"]) == DONE
    assert shown == [plt.get_fignums()]
    assert len(shown[0]) == 1
    (axes,) = plt.figure(shown[0][0]).axes
    assert axes.get_ylabel() == "[m]"
    plt.close("all")
