"""Runs the examples as programs of their own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from threading import Timer

from support.repository import ROOT

EXAMPLES = ROOT / "examples"
LONGEST = 90.0
"""Seconds after which an example is ended."""


class Program:
    """An example that runs. Its lines are read one by one."""

    def __init__(
        self,
        *arguments: str,
        packages: Path = ROOT / "generated",
        python: Path = Path(sys.executable),
        variables: Mapping[str, str] | None = None,
    ) -> None:
        path = os.pathsep.join([str(ROOT), str(packages)])
        self.process = subprocess.Popen(
            [python, *arguments],
            cwd=EXAMPLES,
            env={**os.environ, "PYTHONPATH": path, **(variables or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.printed = ""
        self._limit = Timer(LONGEST, self.process.kill)
        self._limit.start()

    def lines(self) -> Iterator[str]:
        """Yield lines until the program ends."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed += line
            yield line.rstrip("\n")

    def wait_for(self, *patterns: str) -> None:
        """Read until a line matches each pattern, in this order."""
        lines = self.lines()
        for pattern in patterns:
            assert any(re.search(pattern, line) for line in lines), f"no '{pattern}' in\n{self.printed}"

    def end(self) -> int:
        """Interrupt the program as Ctrl-C does, if it runs, and return its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        for _ in self.lines():
            pass
        self._limit.cancel()
        return self.process.wait()


def interrupted(program: Program) -> None:
    """Interrupt a program, which ends without an error."""
    assert program.end() == 0, program.printed
    assert "Traceback" not in program.printed, program.printed
