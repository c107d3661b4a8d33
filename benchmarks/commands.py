"""Measure the commands that watch a running vehicle: the part of a core that they need.

    python benchmarks/commands.py            two minutes; docs/topic.md and docs/topic.md show the figures
    python benchmarks/commands.py --quick    checks in a few seconds that it works

The vehicle is `msggen sim` on this computer. CPU time is that of the command, with its part of the kernel. It is the
difference of two runs of different length, so that start and connection do not count.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import pty
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from environment import ROOT
from tables import Table

ONE = """\
publications:
  - topic: /fmu/out/vehicle_status
    type: px4_msgs::msg::VehicleStatus
subscriptions: []
"""
"""A dds_topics.yaml with one topic."""


class Case(NamedTuple):
    """A command, and the vehicle that it watches."""

    words: Sequence[str]
    topics: str
    """`one` or `all`: the topics of the vehicle."""
    rate: str
    """In Hz, or "" for the usual rates."""


CASES = (
    Case(("topic", "echo", "vehicle_status"), "one", "250"),
    Case(("topic", "echo", "vehicle_status"), "all", "250"),
    Case(("topic", "hz", "vehicle_status"), "one", "250"),
    Case(("top",), "all", ""),
    Case(("top",), "all", "100"),
)


def free_port() -> int:
    """Return a UDP port that nothing uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


@contextlib.contextmanager
def vehicle(case: Case, types: Path, url: str) -> Iterator[None]:
    """Run a simulated vehicle."""
    rate = ["--rate", case.rate] if case.rate else []
    with msggen("sim", url, "--types", str(types), "--sync", "off", "-q", *rate) as process:
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def msggen(*words: str, output: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """Start a command."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm-256color"}
    return subprocess.Popen(
        [sys.executable, "-m", "msggen", *words], env=variables, stdin=output, stdout=output, stderr=subprocess.DEVNULL
    )


def cpu(case: Case, types: Path, url: str, seconds: float) -> float:
    """Return the CPU time in s of a command that runs for some seconds in a terminal."""
    own, terminal = pty.openpty()
    threading.Thread(target=drain, args=(own,), daemon=True).start()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with msggen(*case.words, "--link", url, "--types", str(types), output=terminal) as process:
        os.close(terminal)
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def drain(terminal: int) -> None:
    """Read what a command prints."""
    with contextlib.suppress(OSError):
        while os.read(terminal, 65536):
            pass
    os.close(terminal)


def measure(case: Case, types: Path, seconds: float, start: float) -> list[str]:
    """Return the cells of a row. `start` is the time in s until a command has connected."""
    url = f"udp://127.0.0.1:{free_port()}"
    with vehicle(case, types, url):
        cpu(case, types, url, start)  # the client begins its session
        short, long = (cpu(case, types, url, start + length) for length in (0.0, seconds))
    rate = f"{case.rate} Hz" if case.rate else "the usual rates"
    return [f"msggen {' '.join(case.words)}", f"{case.topics}, {rate}", f"{100 * (long - short) / seconds:.1f}"]


def build(folder: Path) -> dict[str, Path]:
    """Build the types of v1.18 with one topic and with all, and return their folders."""
    (folder / "one.yaml").write_text(ONE, encoding="utf-8")
    chosen = {"one": ("--topics", str(folder / "one.yaml")), "all": ()}
    for name, options in chosen.items():
        with msggen("build", "-q", "--package", "px4_types", "-o", str(folder / name), *options) as process:
            if process.wait():
                raise RuntimeError("the types cannot be built")
    return {name: folder / name / "px4_types" for name in chosen}


def main() -> None:
    """Measure and print a table, as Markdown if the output is not a terminal."""
    parser = argparse.ArgumentParser(description="Measure the commands that watch a running vehicle.")
    parser.add_argument("--quick", action="store_true", help="one second for each measurement")
    options = parser.parse_args()
    seconds, start = (1.0, 2.0) if options.quick else (15.0, 4.0)
    with tempfile.TemporaryDirectory() as name:
        types = build(Path(name))
        cases = CASES[:1] if options.quick else CASES
        rows = [measure(case, types[case.topics], seconds, start) for case in cases]
    Table("commands that watch a vehicle", ["command", "topics of the vehicle", "% of a core"], rows).print()


if __name__ == "__main__":
    main()
