"""Tests that the code of docs/vehicle.md works, with a simulated vehicle."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from typing import Any

import pytest

from msggen.sim import Options, Simulator
from support.ports import free_port
from support.repository import ROOT

PAGE = (ROOT / "docs" / "vehicle.md").read_text()
FIRST, *OTHERS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
DEFAULT = "udp://127.0.0.1:8888"
OPTIONS = [Options(sync="off", rate=50.0)]


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


def test_the_first_program_prints_messages_until_it_is_interrupted(url: str, px4_types: Any) -> None:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'generated'}"}
    source = FIRST.replace(DEFAULT, url).replace("arming_state)", "arming_state, flush=True)")
    command = [sys.executable, "-c", source]
    with subprocess.Popen(command, env=environment, text=True, stdout=-1, stderr=-1) as program:
        assert program.stdout is not None
        with Simulator(px4_types, url, OPTIONS):
            lines = [program.stdout.readline() for _ in range(3)]
            program.send_signal(signal.SIGINT)
            _, errors = program.communicate(timeout=60)
    assert all(re.fullmatch(r"\d+ \d+ \d+\n", line) for line in lines), lines
    assert errors.splitlines()[-1] == "KeyboardInterrupt"


def test_the_other_examples_run(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, OPTIONS):
        names: dict[str, Any] = {"__name__": "example", "VehicleStatus": px4_types.VehicleStatus}
        exec(FIRST.partition("\n\n")[0], names)  # noqa: S102 - the imports
        for number, block in enumerate(OTHERS):
            exec(compile(block.replace(DEFAULT, url), f"block {number}", "exec"), names)  # noqa: S102
    output = capsys.readouterr().out
    assert "Jitter(sent=" in output
    assert "\nv1.18\n" in output
