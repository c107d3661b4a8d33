"""Tests of the limits of tests: each ends after some time, and so do the processes that it has started."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.children import children, ended
from support.repository import ROOT

HANGING = """
import subprocess, sys, time

def test_hangs():
    child = subprocess.Popen(["sh", "-c", "sleep 1000 & echo $!; exec sleep 1000"], stdout=subprocess.PIPE, text=True)
    print(f"[{child.pid} {child.stdout.readline().strip()}]")
    time.sleep(1000)

def test_follows():
    pass
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, the processes that tests leave run on")
def test_a_test_that_hangs_fails_and_its_processes_end(tmp_path: Path) -> None:
    (tmp_path / "test_hanging.py").write_text(HANGING)
    options = [f"--rootdir={ROOT}", f"-c{ROOT / 'pyproject.toml'}", "-pno:cacheprovider", "-pconftest", "-otimeout=1"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")]), "PYTEST_ADDOPTS": ""}
    command = [sys.executable, "-m", "pytest", *options, str(tmp_path)]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "Timeout" in done.stdout, done.stdout + done.stderr
    assert "1 failed, 1 passed" in done.stdout
    [pids] = [line.strip("[]").split() for line in done.stdout.splitlines() if line.startswith("[")]
    assert len(pids) == 2
    assert [pid for pid in pids if Path("/proc", pid).exists()] == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, the processes that tests leave run on")
def test_only_what_was_started_in_the_meantime_ends() -> None:
    with subprocess.Popen(["sleep", "1000"]) as earlier:
        with ended():
            later = subprocess.Popen(["sleep", "1000"])
            assert {earlier.pid, later.pid} <= children()
        assert later.poll() is not None
        assert earlier.poll() is None
        earlier.kill()
