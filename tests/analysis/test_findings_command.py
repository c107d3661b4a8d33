"""Tests of `msggen log findings`: its texts, its JSON and its exit codes."""

from __future__ import annotations

import io
import json
import re
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from msggen.analysis.finding import LEVELS
from msggen.analysis.rules.table import FLIGHT
from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from msggen.cli import main
from support.report_flights import FAILSAFE, LAND, write_ulog
from support.repository import ROOT
from support.written import write_recording

IDS = {rule.id for rule in FLIGHT}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, px4_types: Any) -> Path:
    monkeypatch.chdir(tmp_path)
    write_ulog(tmp_path / "flight.ulg", px4_types)
    quiet = [("/fmu/out/cpuload", step / 10, px4_types.Cpuload(load=0.4, ram_usage=0.5)) for step in range(50)]
    write_recording(tmp_path / "quiet.mcap", quiet)
    return tmp_path


def run(*words: str) -> int:
    try:
        return main(["log", "findings", *words])
    except SystemExit as error:
        return int(error.code or 0)


def document(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    run(*words, "--json")
    return json.loads(capsys.readouterr().out)


def test_findings_are_told_with_their_times_the_worst_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("flight.ulg") == FINDINGS
    lines = capsys.readouterr().out.splitlines()
    assert "warning IN_FAILSAFE: failsafe for 4.0 s, in mode Return" in "\n".join(lines)
    assert f"(from {FAILSAFE:.1f} to {LAND:.1f} s)" in "\n".join(lines)
    levels = [line.partition(" ")[0] for line in lines[:-1] if not line.startswith(" ")]
    assert levels == sorted(levels, key=LEVELS.index)
    fixes = {rule.id: rule.fix for rule in FLIGHT}
    for line, below in pairwise(lines):
        named = re.match(r"\w+ ([A-Z_]+): ", line)
        if named and below.startswith("  "):
            assert below.endswith(fixes[named[1]])
    assert lines[-1].startswith("flight.ulg: ")


def test_a_quiet_recording_has_nothing_and_says_what_it_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("quiet.mcap") == DONE
    (line,) = capsys.readouterr().out.splitlines()
    assert re.fullmatch(
        r"quiet\.mcap: nothing found, \d+ rules found nothing, \d+ cannot say: no .+ \(-v lists them\)", line
    )
    assert run("quiet.mcap", "-v") == DONE
    *unsaid, clear, _ = capsys.readouterr().out.splitlines()
    told = {line.split()[1].rstrip(":") for line in unsaid}
    found = set(clear.removeprefix("nothing found by ").split(", "))
    assert told | found == IDS
    assert not told & found


@pytest.mark.parametrize("name", ["flight.ulg", "quiet.mcap"])
def test_the_object_of_json_is_the_one_of_the_page(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8").partition("## JSON")[2]
    whole, _, each = page.partition("A finding has:")
    made = document(capsys, name)
    assert list(made) == _keys(whole)
    assert all(list(finding) == _keys(each) for finding in made["findings"])
    assert made["recording"] == name
    told = [*made["clear"], *(finding["rule"] for finding in [*made["findings"], *made["unsaid"]])]
    assert set(told) == IDS
    for finding in made["findings"]:
        assert finding["level"] in LEVELS
        assert "\n" not in finding["text"]
        assert finding["time"] is None or 0 <= finding["time"] <= made["duration"]


def _keys(text: str) -> list[str]:
    cells = re.findall(r"(?m)^\| (`[^|]+) \|", text)
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


def test_a_recording_from_stdin_is_examined(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = document(capsys, "flight.ulg")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO((here / "flight.ulg").read_bytes())))
    found = document(capsys, "-")
    assert found | {"recording": ""} == expected | {"recording": ""}


def test_a_damaged_recording_is_a_finding(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = (here / "flight.ulg").read_bytes()
    (here / "cut.ulg").write_bytes(content[: len(content) // 2])
    assert run("cut.ulg") == FINDINGS
    shown = capsys.readouterr()
    assert shown.out.startswith("error LOG_DAMAGED: ")
    assert shown.err.startswith("cut.ulg: ")
    assert document(capsys, "cut.ulg")["problems"]


def test_of_several_vehicles_the_findings_are_about_one(
    here: Path, capsys: pytest.CaptureFixture[str], px4_types: Any
) -> None:
    load = [
        (f"/px4_{number}/fmu/out/cpuload", step / 10, px4_types.Cpuload(load=0.95 if number == 2 else 0.1))
        for step in range(20)
        for number in (1, 2)
    ]
    status = [("/px4_1/fmu/out/vehicle_status", 0.5, px4_types.VehicleStatus())]
    write_recording(here / "two.mcap", [*load, *status])
    assert run("two.mcap") == DONE
    assert "two.mcap: the findings are about /px4_1, not about: /px4_2" in capsys.readouterr().err
    made = document(capsys, "two.mcap")
    assert (made["namespace"], made["findings"]) == ("/px4_1", [])


def test_what_is_no_recording_is_an_error(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "text.ulg").write_text("none")
    assert run("text.ulg") == FAILED
    assert "text.ulg: R102 is not a recording" in capsys.readouterr().err
    assert run("no.ulg") == FAILED
