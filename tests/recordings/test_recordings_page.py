"""Tests of docs/reading.md and docs/recording_formats.md: their examples are real."""

from __future__ import annotations

import doctest
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msggen.cli import main
from support.log_files import example_flight
from support.repository import ROOT
from support.written import write_recording

if TYPE_CHECKING:
    import pytest

READING = (ROOT / "docs" / "reading.md").read_text(encoding="utf-8")
FORMATS = (ROOT / "docs" / "recording_formats.md").read_text(encoding="utf-8")


def test_the_examples_of_python_are_real(px4_types: Any, working_folder: Path) -> None:
    example_flight(working_folder, px4_types)
    source = "\n".join(re.findall(r"```pycon\n(.*?)```", READING, re.DOTALL))
    error = "Traceback (most recent call last):\nmsggen.recordings.source.source.RecordingError: "
    source = re.sub(r"(?m)^RecordingError: ", error, source)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    results = runner.run(parser.get_doctest(source, {}, "reading.md", "reading.md", 0))
    assert (results.failed, results.attempted) == (0, source.count(">>> "))


def test_the_commands_are_real(px4_types: Any, working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example_flight(working_folder, px4_types)
    (block,) = re.findall(r"```console\n(\$ msggen check flight.*?)```", READING, re.DOTALL)
    for command, shown in re.findall(r"\$ msggen (.*)\n((?:[^$].*\n)*)", block):
        assert main(shlex.split(command)) == 0
        assert capsys.readouterr() == (shown, "")


def test_the_commands_on_formats_are_real(px4_types: Any, working_folder: Path, capsys: Any) -> None:
    example_flight(working_folder, px4_types)
    (block,) = re.findall(r"```console\n(.*?)```", FORMATS, re.DOTALL)
    for command, shown in re.findall(r"\$ msggen (.*)\n((?:[^$].*\n|\n)*)", block):
        assert main(shlex.split(command)) == 0
        printed = capsys.readouterr()
        assert (re.sub(r"[\d.]+ kB", "N kB", printed.out), printed.err) == (re.sub(r"[\d.]+ kB", "N kB", shown), "")


def test_damage_is_told_as_the_page_shows(px4_types: Any, working_folder: Path, capsys: Any) -> None:
    odometry = [("/fmu/out/vehicle_odometry", step / 10, px4_types.VehicleOdometry()) for step in range(50)]
    whole = write_recording(working_folder / "flight.mcap", odometry).read_bytes()
    (working_folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (code,) = re.findall(r"```python\n(.*?)```", FORMATS[FORMATS.index("## Damaged files") :], re.DOTALL)
    exec(code, {})  # noqa: S102 - the code of the page
    assert "cut off" in capsys.readouterr().out
