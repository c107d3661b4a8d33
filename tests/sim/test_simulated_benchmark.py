"""Tests of benchmarks/simulated.py: vehicles and a program fly, and their speed is measured."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds")

import simulated
from page import kept
from support.examples import by_day
from tables import Table


def test_a_flight_without_an_agent_is_measured() -> None:
    assert simulated.alone(3.0) > 0


@by_day(
    ("kind", "north", "height"),
    [
        ("plane", 262.0, 36.0),
        ("multicopter", 20.0, 10.0),
        ("rover", 20.0, 0.0),
        ("vtol", 68.0, 7.3),
        ("tailsitter", 63.0, 6.2),
        ("differential", 20.0, 0.0),
    ],
    4,
)
def test_a_program_flies_its_mode_in_the_same_process(kind: str, north: float, height: float) -> None:
    ratio, *place = simulated.one_process(24.0, kind)
    assert ratio > 0
    assert place == [pytest.approx(north, rel=0.1, abs=1.0), pytest.approx(height, rel=0.1, abs=1.0)]


def test_the_table_is_the_last_section_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "benchmarks.md"
    page.write_text("# Benchmarks\n\n## Codec\n\ntext\n", encoding="utf-8")
    monkeypatch.setattr(simulated, "PAGE", page)
    for ratio in ("20", "30"):
        simulated.write(Table("simulated vehicles", ["kind", "ratio"], [["plane", ratio]]), "Last run: today.")
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Benchmarks\n\n## Codec\n\ntext\n\n## Simulated vehicles\n\n```console\n")
    assert re.findall(r"^\| plane \| (\d+) \|$", text, re.MULTILINE) == ["30"]
    assert kept(text).endswith("| plane | 30 |\n")


@pytest.mark.night
def test_a_vehicle_behind_a_socket_is_measured() -> None:
    speed, rate = simulated.sockets(4.0, 1.0)
    assert 0 < speed < 4.4
    assert rate > 100
