"""Measure how steadily a program sends setpoints, and how soon the vehicle answers it: on Linux.

    python benchmarks/setpoints.py            three minutes; docs/flight.md shows the tables
    python benchmarks/setpoints.py --quick    checks in some seconds that it works

The vehicle is `msggen sim`, the program is setpoints_flyer.py, both processes on this computer. Jitter is by how much
the interval between two setpoints differs from that of the rate. Their times are those at which the kernel takes them
for the vehicle, so it does not matter when the vehicle or this program run.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from itertools import pairwise
from select import select
from statistics import median

from environment import HERE, ROOT
from msggen.vehicle.owned.owners import running, stop
from tables import Table

RATES = (10.0, 50.0, 100.0, 250.0)
WAYS = ("direct", "shared")
SECONDS = {10.0: 6.0}
"""The times for which rates are measured, 3 s for the others."""
ALONE, BUSY = "alone", "a busy process on each core"
THREADS = {"a thread that computes": 0.005, "the same, `sys.setswitchinterval(0.0005)`": 0.0005}
"""Threads of the program, by what the program gives to `sys.setswitchinterval`: 0.005 is Python's default."""
_SO_TIMESTAMPNS = 35
_ADDRESS = ("127.0.0.1", 0)


def place_of(rate: float) -> tuple[float, float, float]:
    """Return the position in the setpoints of a rate, by which they are found in datagrams."""
    return rate, -rate, -5.0


class Proxy:
    """Passes datagrams between a vehicle and a link, and keeps those to the vehicle with their times in ns."""

    def __init__(self, port: int) -> None:
        """Pass them to the port of the link."""
        self._vehicle, self._link = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._vehicle.bind(_ADDRESS)
        self._link.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._link.connect(("127.0.0.1", port))
        for each in (self._vehicle, self._link):
            each.setblocking(False)  # noqa: FBT003 - the name of the method says what it means
        self.port: int = self._vehicle.getsockname()[1]
        self.seen: list[tuple[int, bytes]] = []
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="proxy", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Pass nothing more."""
        self._is_closing = True
        self._thread.join()
        self._vehicle.close()
        self._link.close()

    def _run(self) -> None:
        client = _ADDRESS
        while not self._is_closing:
            for ready in select([self._vehicle, self._link], [], [], 0.1)[0]:
                with contextlib.suppress(ConnectionRefusedError, BlockingIOError):  # the link is closed at the end
                    if ready is self._vehicle:
                        data, client = ready.recvfrom(65_536)
                        self._link.send(data)
                    else:
                        self._vehicle.sendto(self._take(), client)

    def _take(self) -> bytes:
        data, ((_, _, stamp), *_), *_ = self._link.recvmsg(65_536, 64)
        seconds, rest = struct.unpack("qq", stamp)
        self.seen.append((seconds * 1_000_000_000 + rest, data))
        return data

    def times(self, rate: float) -> list[int]:
        """Return the times in ns of the setpoints of a rate."""
        mark = struct.pack("<3f", *place_of(rate))
        return [time for time, data in self.seen for _ in range(data.count(mark))]


@contextlib.contextmanager
def process(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program, and kill it at the end if it has not ended."""
    command, path = [sys.executable, *words], {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env={**os.environ, **path}, stdout=subprocess.PIPE, text=True) as started:
        try:
            yield started
        finally:
            started.kill()


@contextlib.contextmanager
def flyer(port: int, way: str, tasks: Sequence[Sequence[object]]) -> Iterator[subprocess.Popen[str]]:
    """Run the program until its link is open."""
    with process(str(HERE / "setpoints_flyer.py"), str(port), way, json.dumps(tasks)) as started:
        try:
            line_of(started)
            yield started
        finally:
            for each in running():
                stop(each.place)


def simulated(port: int) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    """Run a vehicle."""
    types = str(ROOT / "generated" / "px4_types")
    return process("-m", "msggen", "sim", f"udp://127.0.0.1:{port}", "--types", types, "--sync", "off", "-q")


def line_of(started: subprocess.Popen[str]) -> str:
    """Return the next line of a program."""
    found = started.stdout.readline() if started.stdout else ""
    if not found:
        raise RuntimeError("the program has failed")
    return found


def free_port() -> int:
    """Return a UDP port that nothing uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(_ADDRESS)
        port: int = sock.getsockname()[1]
        return port


def steadiness(way: str, beside: str, plan: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Yield the jitter at each rate of a plan, which are sent one after the other for some s."""
    tasks: list[Sequence[object]] = [("steady", *each) for each in plan]
    if beside in THREADS:
        tasks.append(("compute", THREADS[beside]))
    port = free_port()
    with contextlib.ExitStack() as stack:
        program = stack.enter_context(flyer(port, way, tasks))
        proxy = stack.enter_context(contextlib.closing(Proxy(port)))
        stack.enter_context(simulated(proxy.port))
        for _ in range(os.cpu_count() or 1) if beside == BUSY else ():
            stack.enter_context(process("-c", "while True: pass"))
        if program.wait(60):
            raise RuntimeError("the program has failed")
    for rate, _ in plan:
        yield jitter(proxy.times(rate), rate)


def jitter(times: Sequence[int], rate: float) -> str:
    """Return the median, the 99th percentile and the worst deviation of the intervals, as ms."""
    found = sorted(abs((after - before) / 1e6 - 1e3 / rate) for before, after in pairwise(times))
    return " / ".join(f"{each:.1f}" for each in (median(found), found[int(len(found) * 0.99)], found[-1]))


def answers(way: str, times: int) -> Iterator[list[str]]:
    """Yield rows of the times from requests to answers."""
    port = free_port()
    with flyer(port, way, [("answers", times)]) as program, simulated(port):
        for name, seconds in json.loads(line_of(program)).items():
            begin = {"registered": "request to registered", "acknowledged": "command to acknowledged"}[name]
            yield [f"{begin}, {way}", f"{median(seconds) * 1e3:.1f}", f"{max(seconds) * 1e3:.1f}"]


def tables(*, is_quick: bool) -> Iterator[Table]:
    """Measure, and yield tables."""
    plan = [(rate, 0.5 if is_quick else SECONDS.get(rate, 3.0)) for rate in RATES]
    rows = [
        [f"{way}, {beside}", *steadiness(way, beside, plan)]
        for way in WAYS
        for beside in ((ALONE,) if is_quick else (ALONE, BUSY, *THREADS))
    ]
    head = ["jitter in ms: median / 99 % / worst", *(f"{rate:g} Hz" for rate in RATES)]
    yield Table("setpoints", head, rows)
    rows = [row for way in WAYS for row in answers(way, 5 if is_quick else 100)]
    yield Table("answers of the vehicle", ["ms", "median", "worst"], rows)


def main() -> None:
    """Measure and print tables, as Markdown if the output is not a terminal."""
    parser = argparse.ArgumentParser(description="Measure how steadily setpoints are sent.")
    parser.add_argument("--quick", action="store_true", help="little, to see that it works")
    options = parser.parse_args()
    os.environ.pop("MSGGEN_DIRECT", None)
    with tempfile.TemporaryDirectory(prefix="run-") as runtime, tempfile.TemporaryDirectory() as state:
        os.environ.update(MSGGEN_RUNTIME=runtime, XDG_STATE_HOME=state)
        for table in tables(is_quick=options.quick):
            table.print()


if __name__ == "__main__":
    main()
