"""Runs a participant of DDS that looks like PX4 behind an agent."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

import pytest

from support.repository import ROOT

LONGEST = 90.0
"""Seconds after which the participant is ended."""


def domains(first: int) -> Iterator[int]:
    """Yield domains of this process, so that other programs and other tests do not take part."""
    return itertools.count(first + os.getpid() % 9 * 10)


@contextmanager
def vehicle(domain: int, namespace: str, *topics: str) -> Iterator[subprocess.Popen[str]]:
    """Run a participant that looks like PX4 behind an agent."""
    pytest.importorskip("cyclonedds")
    program = ROOT / "tests" / "support" / "px4_behind_agent.py"
    command = [sys.executable, str(program), str(domain), namespace, *topics]
    environment = {"PYTHONPATH": str(ROOT / "generated"), "PYTHONDONTWRITEBYTECODE": "1"}
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        limit = Timer(LONGEST, process.kill)
        limit.start()
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            limit.cancel()
            process.kill()
