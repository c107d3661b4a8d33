"""Tests of `msggen log report`: its file, its exit codes and its errors."""

from __future__ import annotations

import os
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
    local = px4_types.VehicleLocalPosition
    samples = [
        ("/fmu/out/vehicle_local_position_v1", step / 10, local(x=float(step), xy_valid=True)) for step in range(50)
    ]
    write_recording(tmp_path / "flight.mcap", samples)
    write_recording(tmp_path / "other.mcap", [("/fmu/out/vehicle_command", 0.0, px4_types.VehicleCommand())])
    return tmp_path


def run(words: Sequence[str]) -> int:
    return exit_code(["log", "report", *words])


def test_a_file_is_written_and_replaced(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["flight.mcap"]) == DONE
    made = here / "flight.report.html"
    size = made.stat().st_size
    assert capsys.readouterr() == (f"flight.report.html: {number_of_bytes(size)}\n", "")
    assert "<h3>Position north" in made.read_text(encoding="utf-8")
    made.write_text("old")
    assert run(["flight.mcap", "-o", "flight.report.html", "-q"]) == DONE
    assert capsys.readouterr() == ("", "")
    assert made.stat().st_size == size
    assert sorted(os.listdir(here)) == ["flight.mcap", "flight.report.html", "other.mcap"]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["flight.mcap", "-o", "a.pdf"], "argument -o/--output: expected a name that ends in .html, found 'a.pdf'"),
        (["flight.mcap", "-o", "no/a.html"], "no"),
        (
            ["other.mcap"],
            "other.mcap: R102 there are no samples of topics that a report shows, such as vehicle_local_position, ",
        ),
        (["missing.mcap"], "missing.mcap: R102 cannot be read: No such file or directory"),
        (["text.txt"], "text.txt: R102 is not a recording: "),
        ([], "the following arguments are required: FILE"),
        (["flight.mcap", "-o", "folder.html"], "folder.html: R101 cannot be written: "),
    ],
)
def test_errors(words: Sequence[str], error: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "text.txt").write_text("text")
    (here / "folder.html").mkdir()
    before = sorted(os.listdir(here))
    assert run(words) == FAILED
    told = capsys.readouterr()
    assert error in told.err
    assert (told.out, sorted(os.listdir(here))) == ("", before)


def test_an_error_leaves_the_file_that_was_there(here: Path) -> None:
    (here / "a.html").write_text("old")
    assert run(["other.mcap", "-o", "a.html"]) == FAILED
    assert (here / "a.html").read_text() == "old"


def test_damage_is_told_and_reported(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "cut.mcap").write_bytes((here / "flight.mcap").read_bytes()[:-3000])
    assert run(["cut.mcap", "-q"]) == FINDINGS
    told = capsys.readouterr()
    assert told.err.startswith("cut.mcap: ")
    assert "the recording is damaged: " in (here / "cut.report.html").read_text(encoding="utf-8")


def test_definitions_of_a_release_are_told(here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    payload = px4_types.VehicleStatus().encode()
    bare = Written("/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "", [(START, START, payload)] * 500)
    local = px4_types.BatteryStatus
    battery = Written(
        "/fmu/out/battery_status_v1",
        "px4_msgs/msg/BatteryStatus",
        local.__msg__.definition,
        [(START + step * 10**9, START, local(connected=True, voltage_v=15.0).encode()) for step in range(9)],
    )
    write_log(here / "bare.mcap", [bare, battery])
    assert run(["bare.mcap"]) == DONE
    assert "v1.18" in capsys.readouterr().err
    assert "v1.18" in (here / "bare.report.html").read_text(encoding="utf-8")
