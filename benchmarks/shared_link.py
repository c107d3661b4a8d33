"""Measure a link that a process owns for several programs, beside a program that owns its link: on Linux.

    python benchmarks/shared_link.py            three minutes; docs/links.md shows some rows
    python benchmarks/shared_link.py --quick    checks that it works

Each program takes and decodes all samples of a vehicle. CPU time is that of a process, with its part of the kernel.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from environment import HERE, ROOT
from link import line, send, sender
from link_sender import Load
from msggen.vehicle.owned.owners import running
from tables import Table

HEAD = [
    "samples",
    "programs",
    "lost",
    "CPU, us a sample: owner",
    "each program",
    "all",
    "latency: median, us",
    "99 %, us",
]


class Taken(NamedTuple):
    """What a program has taken."""

    samples: int
    median: float
    late: float
    cpu: float
    memory: int


@contextlib.contextmanager
def program(way: str, address: str, topics: int) -> Iterator[subprocess.Popen[str]]:
    """Run a program until its link is open."""
    command = [sys.executable, str(HERE / "link_subscriber.py"), way, address, str(topics)]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=variables, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            expect(process, "open")
            yield process
        finally:
            process.kill()


def expect(process: subprocess.Popen[str], text: str) -> None:
    """Wait for a line of a program."""
    found = line(process)
    if found != text:
        raise RuntimeError(f"a program has printed {found!r} in place of {text!r}")


def tell(process: subprocess.Popen[str]) -> None:
    """Let a program go on."""
    if process.stdin:
        process.stdin.write("\n")
        process.stdin.flush()


def measure(name: str, way: str, programs: int, topics: int, rate: float, seconds: float) -> list[str]:  # noqa: PLR0913, PLR0917
    """Return a row of the table. `rate` is that of a topic, in Hz."""
    port = free_port()
    with contextlib.ExitStack() as stack:
        address = f"udp://127.0.0.1:{port}"
        started = [stack.enter_context(program(way, address, topics)) for _ in range(programs)]
        owner = next((each.state["pid"] for each in running()), 0)
        if owner:
            stack.callback(os.kill, owner, signal.SIGTERM)
        load = Load("udp", port, 1, topics, rate * topics, seconds)
        vehicle = stack.enter_context(sender(load))
        for process in started:
            expect(process, "ready")
            tell(process)
            expect(process, "begun")
        before = cpu_of(owner)
        sent = send(vehicle)
        own = cpu_of(owner) - before
        taken = []
        for process in started:
            tell(process)
            taken.append(Taken(*json.loads(line(process))))
    return row(name, taken, sent, own)


def row(name: str, taken: list[Taken], sent: int, own: float) -> list[str]:
    """Return the cells of what programs have taken of the samples that were sent. `own` is the owner's CPU time."""
    lost = 1 - sum(each.samples for each in taken) / sent / len(taken)
    each = sum(each.cpu for each in taken) / len(taken) / sent * 1e6
    owner = own / sent * 1e6
    cells = [f"{owner:.0f}" if own else "", f"{each:.0f}", f"{owner + each * len(taken):.0f}"]
    median, late = (max(values) for values in ([each.median for each in taken], [each.late for each in taken]))
    kind = str(len(taken)) if own else "direct"
    return [name, kind, f"{lost:.2%}" if lost else "0", *cells, f"{median:,.0f}", f"{late:,.0f}"]


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process in s, 0 for none."""
    if not pid:
        return 0.0
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def free_port() -> int:
    """Return a UDP port that nothing uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def tables(seconds: float, *, is_quick: bool) -> Iterator[Table]:
    """Measure, and yield the table."""
    loads = (("1 topic at 100 Hz", 1, 100), ("31 topics at 100 Hz", 31, 100), ("31 topics at 222 Hz", 31, 222))
    rows = []
    for name, topics, rate in loads[:1] if is_quick else loads:
        rows.append(measure(name, "direct", 1, topics, rate, seconds))
        rows += [
            measure(name, "shared", count, topics, rate, seconds) for count in ((1, 2) if is_quick else (1, 2, 4, 8))
        ]
    yield Table("UDP, one vehicle, and programs that share the link", HEAD, rows)


def show(description: str, made: Callable[..., Iterator[Table]]) -> None:
    """Measure and print tables, as Markdown if the output is not a terminal, with links of this program alone."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="less than a second for each measurement")
    options = parser.parse_args()
    os.environ.pop("MSGGEN_DIRECT", None)
    with tempfile.TemporaryDirectory(prefix="run-") as runtime, tempfile.TemporaryDirectory() as state:
        os.environ.update(MSGGEN_RUNTIME=runtime, XDG_STATE_HOME=state)
        for table in made(0.5 if options.quick else 8, is_quick=options.quick):
            table.print()
        time.sleep(0.2)


if __name__ == "__main__":
    show("Measure a link that programs share.", tables)
