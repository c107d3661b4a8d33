"""Tests of docs/plots.md: its commands on the flight that it shows, its program, and its lists."""

from __future__ import annotations

import lzma
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msggen import analysis
from msggen.analysis import motion, response, spectrum
from msggen.cli import main
from msggen.exports.pictures import PICTURES
from support.moving import write_moving
from support.repository import ROOT, shared

if TYPE_CHECKING:
    import pytest

PAGE = (ROOT / "docs" / "plots.md").read_text(encoding="utf-8")


def test_the_command_of_the_page_prints_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = lzma.decompress(shared("oracles/flight/flight.ulg.xz").read_bytes())
    (tmp_path / "flight.ulg").write_bytes(flight)
    monkeypatch.chdir(tmp_path)
    ((command, shown),) = re.findall(r"^\$ msggen (.*)\n((?:(?!\$ |```).*\n)*)", PAGE, re.MULTILINE)
    assert main(shlex.split(command)) == 0
    assert _rough(capsys.readouterr().out) == _rough(shown)


def _rough(text: str) -> list[str]:
    """Return lines without the sizes of files, and without the last digits of numbers, which depend on libraries."""
    return [re.sub(r"\d(?!\d)", "N", re.sub(r"[\d.]+ kB", "N kB", line)) for line in text.splitlines()]


def test_the_program_of_the_page_runs(
    tmp_path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_moving(tmp_path / "flight.mcap", px4_types)
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(program.replace("flight.ulg", "flight.mcap"), {})  # noqa: S102 - code of our own page
    assert len(capsys.readouterr().out.splitlines()) == 7


def test_the_page_has_all_pictures_and_functions() -> None:
    assert set(re.findall(r"`msggen log plot FILE ([\w-]+)`", PAGE)) == set(PICTURES)
    assert {f"`{name}(" for name in analysis.__all__ if name.islower()} <= set(re.findall(r"`\w+\(", PAGE))
    for sensor in motion.SENSORS:
        for name in (*sensor.names, *(parameter for _, parameter in sensor.filters)):
            assert f"`{name}`" in PAGE, name


def test_the_limits_are_those_of_the_code() -> None:
    angle, rate = response.LOOPS[0], response.LOOPS[3]
    for text in (
        f"windows of {rate.window:.0f} s (rates) or {angle.window:.0f} s (angles)",
        f"has {rate.seconds} s for rates and {angle.seconds:.0f} s for angles",
        f"by {rate.least:.0f} deg/s (rates) or {angle.least:.0f} deg (angles)",
        f"up to {response._PARTS} parts",
        f"fewer than {response._FEWEST_WINDOWS} windows",
        f"the {response._MOST_WINDOWS} with the largest changes",
        f"less than {response._LEAST_FIT * 100:.0f} % of the movement",
        f"{spectrum._SHORTEST} to {spectrum._LONGEST:,} samples",
        f"at most {spectrum._MOST_WINDOWS:,} of a recording",
    ):
        assert text in PAGE, text
