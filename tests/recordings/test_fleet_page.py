"""Tests of docs/fleet.md: its command and its code, with the recordings of support/fleet_logs.py."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.fleet_logs import write_logs
from support.network import isolated
from support.repository import ROOT

PAGE = (ROOT / "docs" / "fleet.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^\$ (msggen .*)\n((?:(?!\$|```).*\n)*)", PAGE, re.MULTILINE)
BLOCKS = re.findall(r"(?:<!-- needs: (\w+) -->\n\n)?```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", PAGE, re.DOTALL)
"""The package that each block needs if it is not run with the others, its text and its output."""

MARK = "-" * 10
_FIGURES = re.compile(r"in [\d.]+ s|[\d.]+ kB")


def program_of(blocks: Sequence[str]) -> str:
    """Return a program that runs blocks, and prints a mark after each."""
    return "\n".join(f"{text}\nprint({MARK!r}, flush=True)" for text in blocks)


def run(*command: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=300)


@pytest.mark.slow  # imports duckdb, polars, dask and pandas, and starts a cluster
def test_the_code_prints_what_the_page_shows(tmp_path: Path) -> None:
    write_logs(tmp_path / "logs")
    assert len(COMMANDS) == 4
    for command, expected in COMMANDS:
        done = run(sys.executable, "-m", *command.split(), cwd=tmp_path)
        assert _FIGURES.sub("#", done.stderr + done.stdout) == _FIGURES.sub("#", expected)
    chosen = [(text, output) for needs, text, output in BLOCKS if not needs]
    assert len(chosen) >= 6
    (tmp_path / "program.py").write_text(program_of([text for text, _ in chosen]))
    done = run(sys.executable, "program.py", cwd=tmp_path)
    assert done.stdout.split(f"{MARK}\n")[:-1] == [output for _, output in chosen], done.stderr


@pytest.mark.night  # starts the servers of Ray
@pytest.mark.timeout(600)
def test_ray_prints_what_the_page_shows(tmp_path: Path) -> None:
    """In a network of its own, because Ray listens on all interfaces."""
    if find_spec("ray") is None:
        pytest.skip("needs ray, which has no wheel for this Python or system")
    write_logs(tmp_path / "logs")
    chosen = [(text, output) for needs, text, output in BLOCKS if needs == "ray" or "def battery_of" in text]
    assert len(chosen) == 2
    (tmp_path / "program.py").write_text(program_of([text for text, _ in chosen]))
    with TemporaryDirectory(prefix="ray") as folder:  # a short path, because it has sockets
        variables = {
            "HOME": folder,  # for a token
            "TMPDIR": folder,
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_raylet_start_wait_time_s": "200",  # the usual 30 s are too short on a machine under load
        }
        done = run(*isolated(sys.executable, "program.py"), cwd=tmp_path, **variables)
    assert done.stdout.split(f"{MARK}\n")[:-1] == [output for _, output in chosen], done.stderr


def test_an_isolated_program_has_only_the_loopback_interface_and_leaves_no_process(tmp_path: Path) -> None:
    """What it started keeps its output open, so `run` would wait for it."""
    program = (
        "import socket, subprocess\n"
        "print([name for _, name in socket.if_nameindex()])\n"
        "socket.create_server(('127.0.0.1', 0)).close()\n"
        "subprocess.Popen(['sleep', '1000'])\n"
    )
    done = run(*isolated(sys.executable, "-c", program), cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("['lo']\n", "")
