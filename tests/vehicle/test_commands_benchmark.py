"""Tests of benchmarks/commands.py: the CPU time of a command is measured."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import pytest

pytest.importorskip("termios")

import commands


@pytest.mark.night  # it measures for seconds
def test_the_time_of_a_command_is_measured(tmp_path: Path) -> None:
    types = commands.build(tmp_path)
    case = commands.CASES[0]
    command, vehicle, share = commands.measure(case, types[case.topics], 0.5, 1.5)
    assert (command, vehicle) == ("msggen topic echo vehicle_status", "one, 250 Hz")
    assert isfinite(float(share))  # it can be 0 on a busy machine
