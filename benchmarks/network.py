"""Measure the ways from a vehicle to a program, and a network of three Zenoh routers: on Linux.

    python benchmarks/network.py            three minutes; docs/zenoh.md shows the tables
    python benchmarks/network.py --quick    checks that it works

A program takes and decodes all samples. Senders pack theirs before, and all processes are on one computer. CPU time is
that of a process, with its part of the kernel.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import randrange
from typing import NamedTuple, TypeAlias

from environment import HERE, ROOT
from link import line, send, sender
from link_sender import Load
from msggen.vehicle.owned.owners import running
from shared_link import Taken, cpu_of, expect, program, show, tell
from tables import Table

WAYS_HEAD = [
    "way",
    "lost",
    "CPU, us a sample: program",
    "between",
    "latency: median, us",
    "99 %, us",
    "memory, MB: program",
    "between",
]
SIZES_HEAD = [
    "vehicles",
    "samples a second",
    "lost",
    "CPU, us a sample: program",
    "three routers",
    "latency: median, us",
    "99 %, us",
]
FIRST_HEAD = ["way", "first sample, s"]
_HOST = "127.0.0.1"

Between: TypeAlias = Callable[[int, int], contextlib.AbstractContextManager[subprocess.Popen[str] | None]]
"""Runs what is between a vehicle and a program, which use two ports, until it is left."""


def free_port() -> int:
    """Return a port that nothing uses, and that the kernel gives to no connection."""
    while True:
        port = randrange(20_000, 30_000)  # noqa: S311 - not a secret
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
                stack.enter_context(socket.socket(socket.AF_INET, kind)).bind((_HOST, port))
            return port


class Way(NamedTuple):
    """A way from a vehicle to a program."""

    name: str
    vehicle: str
    """The link of the vehicle: `udp` or `zenoh`."""
    program: str
    """That of the program."""
    between: Between
    is_shared: bool = False

    def ports(self) -> tuple[int, int]:
        """Return free ports for the vehicle and for the program."""
        port = free_port()
        return port, port if self.vehicle == self.program else free_port()


@contextlib.contextmanager
def run(*command: str, ready: str) -> Iterator[subprocess.Popen[str]]:
    """Run a process of Python from a line of its output on."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, *command], env=variables, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            while ready not in (found := line(process)):
                if not found:
                    raise RuntimeError(f"{' '.join(command)} has not told '{ready}'")
            yield process
        finally:
            process.terminate()


def router(port: int, *others: int) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    """Run a router that is connected to others."""
    return run(str(HERE / "zenoh_router.py"), *map(str, (port, *others)), ready="ready")


def _nothing(_to_vehicle: int, _to_program: int) -> contextlib.AbstractContextManager[None]:
    return contextlib.nullcontext()


def _router(to_vehicle: int, _to_program: int) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    return router(to_vehicle)


def _network(to_vehicle: int, to_program: int) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    """Run a process that owns the link over UDP, and is the router that carries it."""
    address, network = f"udp://{_HOST}:{to_vehicle}", f"tcp/{_HOST}:{to_program}"
    types = str(ROOT / "generated/px4_types")
    return run("-m", "msggen", "link", "serve", address, "--zenoh", network, "--types", types, ready="open")


WAYS = (
    Way("UDP", "udp", "udp", _nothing),
    Way("UDP, a process owns the link", "udp", "udp", _nothing, is_shared=True),
    Way("Zenoh, the program is the router", "zenoh", "zenoh", _nothing),
    Way("Zenoh, through a router", "zenoh", "zenoh", _router),
    Way("UDP, then Zenoh from the process that owns the link", "udp", "zenoh", _network),
)


def measure_way(way: Way, topics: int, rate: float, seconds: float) -> list[str]:
    """Return a row of the table of ways. `rate` is that of a topic, in Hz."""
    to_vehicle, to_program = way.ports()
    with contextlib.ExitStack() as stack:
        between = stack.enter_context(way.between(to_vehicle, to_program))
        kind = "shared" if way.is_shared else "direct"
        process = stack.enter_context(program(kind, f"{way.program}://{_HOST}:{to_program}", topics))
        pid = between.pid if between else 0
        if way.is_shared:
            pid = next(each.state["pid"] for each in running())
            stack.callback(os.kill, pid, signal.SIGTERM)
        vehicle = stack.enter_context(sender(Load(way.vehicle, to_vehicle, 1, topics, rate * topics, seconds)))
        sent, taken, own = measured(process, vehicle, [pid] if pid else [])
        memory = f"{_peak(pid) / 1000:.0f}" if pid else ""
    return [way.name, *cells(sent, taken, own), f"{taken.memory / 1000:.0f}", memory]


def measure_size(vehicles: int, topics: int, rate: float, seconds: float) -> list[str]:
    """Return a row of the table of sizes: vehicles at the first of three routers, a program at the third.

    `rate` is that of a topic, in Hz.
    """
    ports = [free_port() for _ in range(3)]
    total = vehicles * topics * rate
    with contextlib.ExitStack() as stack:
        routers = [stack.enter_context(router(port, *ports[:place][-1:])) for place, port in enumerate(ports)]
        address = f"zenoh://{_HOST}:{ports[-1]}"
        process = stack.enter_context(program("direct", address, vehicles * topics))
        load = Load("zenoh", ports[0], vehicles, topics, total, seconds)
        vehicle = stack.enter_context(sender(load))
        sent, taken, own = measured(process, vehicle, [each.pid for each in routers])
    return [str(vehicles), f"{total:,.0f}", *cells(sent, taken, own)]


def measured(
    process: subprocess.Popen[str], vehicle: subprocess.Popen[str], between: Sequence[int]
) -> tuple[int, Taken, float]:
    """Let a sender send, and return the number of samples, what the program took, and the CPU time between them."""
    expect(process, "ready")
    tell(process)
    expect(process, "begun")
    before = sum(map(cpu_of, between))
    sent = send(vehicle)
    own = sum(map(cpu_of, between)) - before
    tell(process)
    return sent, Taken(*json.loads(line(process))), own


def cells(sent: int, taken: Taken, own: float) -> list[str]:
    """Return the cells of what a program has taken of the samples that were sent."""
    lost = max(0.0, 1 - taken.samples / sent)  # a vehicle that is kept alive sends a sample more
    between = f"{own / sent * 1e6:.0f}" if own else ""
    each = f"{taken.cpu / max(1, taken.samples) * 1e6:.0f}"
    return [f"{lost:.2%}" if lost else "0", each, between, f"{taken.median:,.0f}", f"{taken.late:,.0f}"]


def _peak(pid: int) -> int:
    """Return the most memory of a process so far, in kB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    return int(status.partition("VmHWM:")[2].split()[0])


def measure_first(way: Way) -> list[str]:
    """Return how long `msggen topic echo --once` takes with a simulated vehicle that is connected, where it can be."""
    to_vehicle, to_program = way.ports()
    address = f"{way.program}://{_HOST}:{to_program}"
    place = f"{_HOST}:{to_vehicle}"
    option = ("--zenoh", f"tcp/{place}") if way.vehicle == "zenoh" else (f"udp://{place}",)
    echo = [sys.executable, "-m", "msggen", "topic", "echo", "vehicle_status", "--once", "--link", address]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "MSGGEN_DIRECT": "" if way.is_shared else "1"}
    with contextlib.ExitStack() as stack:
        between = stack.enter_context(way.between(to_vehicle, to_program))
        if way.is_shared:
            between = stack.enter_context(run("-m", "msggen", "link", "serve", "--link", address, ready="open"))
        simulated = subprocess.Popen([sys.executable, "-m", "msggen", "sim", "--quiet", *option], env=variables)
        stack.callback(simulated.terminate)
        wait_connected(echo, variables, is_direct=between is None)
        begun = time.monotonic()
        subprocess.run(echo, env=variables, stdout=subprocess.DEVNULL, check=True, timeout=60)
        return [way.name, f"{time.monotonic() - begun:.2f}"]


def wait_connected(echo: Sequence[str], variables: dict[str, str], *, is_direct: bool) -> None:
    """Wait until the vehicle is connected to what is there already; it looks for a link that is not there yet."""
    if is_direct:
        time.sleep(1)
    else:
        subprocess.run(echo, env=variables, stdout=subprocess.DEVNULL, check=True, timeout=60)


def tables(seconds: float, *, is_quick: bool) -> Iterator[Table]:
    """Measure, and yield the tables."""
    topics, rate = (2, 50) if is_quick else (31, 100)
    rows = [measure_way(way, topics, rate, seconds) for way in WAYS]
    yield Table(f"One vehicle, {topics} topics at {rate} Hz", WAYS_HEAD, rows)
    rows = [measure_first(way) for way in WAYS]
    yield Table("First sample of a program, with the start of Python", FIRST_HEAD, rows)
    sizes = (
        [(1, 2, 10), (3, 2, 10)] if is_quick else [(1, 31, 10), (10, 31, 10), (50, 31, 2), (8, 31, 50), (20, 31, 50)]
    )
    rows = [measure_size(*size, seconds) for size in sizes]
    yield Table("Three routers in a row: vehicles at the first, a program at the third", SIZES_HEAD, rows)


if __name__ == "__main__":
    show("Measure the ways to a vehicle, and a network of routers.", tables)
