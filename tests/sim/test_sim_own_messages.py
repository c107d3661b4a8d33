"""Tests of docs/sim.md: the way from definitions of one's own to a topic of a simulated vehicle."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.pages import Step, check_outputs, outputs_of, reading, steps_of, variables_of
from support.ports import free_port
from support.repository import ROOT


@pytest.mark.night  # processes, one after the other
def test_own_messages_arrive(tmp_path: Path) -> None:
    steps = steps_of("sim", "Messages of your own")
    assert len(steps) == 6
    ports = free_port(), free_port()
    (tmp_path / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "udp://127.0.0.1:{ports[0]}"\n')
    with TemporaryDirectory(prefix="home-") as home:
        variables = {**variables_of(Path(sys.executable).parent, Path(home)), "PYTHONPATH": str(ROOT)}
        with reading(tmp_path, variables, ports) as reader:
            try:
                check_outputs(outputs_of(steps, reader), is_live=True)
            finally:
                reader.run(Step("console", "msggen link stop", ""))
