"""Tests of docs/report.md: its commands are real, and its limits those of the code."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msggen.cli import main
from msggen.recordings.report import findings, plans, thinning
from support.report_flights import write_ulog
from support.repository import ROOT

if TYPE_CHECKING:
    import pytest

_NEAR = 0.1
"""How much the size of a report may differ from that on the page."""
PAGE = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")


def test_the_command_is_real(px4_types: Any, working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ulog(working_folder / "flight.ulg", px4_types)
    (block,) = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    ((command, shown),) = re.findall(r"\$ msggen (.*)\n((?:[^$].*\n)*)", block)
    assert main(shlex.split(command)) == 0
    printed = capsys.readouterr()
    (size,), (size_on_page,) = (re.findall(r"([\d.]+) kB", text) for text in (printed.out, shown))
    assert (printed.out.replace(size, size_on_page), printed.err) == (shown, "")
    assert abs(float(size) / float(size_on_page) - 1) < _NEAR


def test_the_limits_are_those_of_the_code() -> None:
    for text in (
        f"up to {thinning.MOST:,} samples",
        f"reaches {findings.VIBRATION[0]} m/s² while armed (high), or {findings.VIBRATION[1]} m/s²",
        f"less than {findings.LOW_BATTERY:.0%} remain".replace("%", " %"),
        f"at {findings.SATURATED:.0%} or more".replace("%", " %"),
        f"above {findings.HIGH_LOAD:.0%}".replace("%", " %"),
    ):
        assert text in PAGE, text
    for group in plans.GROUPS:
        assert group.plans
