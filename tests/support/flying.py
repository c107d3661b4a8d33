"""Vehicles that are simulated in real time, and processes that fly them over a link."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from queue import Empty, Queue
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.flight import LOCAL_POSITION, Executor, Mode
from msggen.sim import Options, Simulator
from msggen.sim.publishing import Publication, Schedule
from support.repository import ROOT

if TYPE_CHECKING:
    import pytest

PATIENCE = 20.0
LONG = 10.0
"""A time in s in which a busy computer does something that takes a moment, shorter than PX4 waits: see below."""
EXTERNAL = 23
HOLD, RETURN = 4, 5
ARM, TAKEOFF, SET_MODE = 400, 22, 100_001
QUICK = Options(sync="off")
"""A vehicle that connects at once."""
CALM = QUICK._replace(rate=10.0)
"""One that publishes each topic often enough for a flight, which costs a quarter of what PX4 sends."""


class Hop(Mode, name="Hop"):
    """Flies 1.5 m to the north."""

    requires = LOCAL_POSITION

    async def fly(self) -> None:
        await self.goto((await self.position()).shifted(1.5))


class Hops(Executor):
    """A whole flight."""

    mode = Hop

    def __init__(self) -> None:
        self.done: list[str] = []
        self.end = asyncio.Event()

    async def run(self) -> None:
        try:
            await self.takeoff(1.5)
            self.done.append("takeoff")
            await self.fly()
            self.done.append("hop")
            await self.land()
            await self.wait_disarmed()
            self.done.append("landed")
        finally:
            self.end.set()


@contextmanager
def simulated(package: ModuleType, url: str, options: Options = CALM, *, speed: float = 1.0) -> Iterator[Simulator]:
    """Simulate a vehicle in a thread."""
    with Simulator(package, url, [options], speed=speed) as simulator:
        yield simulator


def publish_once(monkeypatch: pytest.MonkeyPatch, *topics: str) -> None:
    """Let vehicles publish topics once in a session, and when they change."""
    begin = Schedule.__init__

    def begin_once(self: Schedule, publications: Sequence[Publication], start: int) -> None:
        begin(self, [each._replace(interval=None) if each.topic in topics else each for each in publications], start)

    monkeypatch.setattr(Schedule, "__init__", begin_once)


def wait_long_for_replies(simulator: Simulator) -> None:
    """Let PX4 wait more than `LONG` for the replies of programs, not 1 s: a mode that goes before was unregistered.

    A busy computer does not start a process in 1 s.
    """
    checks = commander(simulator).checks
    checks._rules = checks._rules._replace(misses=50)


def pass_time(simulator: Simulator, seconds: float) -> None:
    """Wait for some time of the vehicles."""
    end = simulator.now + round(seconds * 1e6)
    until(lambda: simulator.now >= end)


def until(condition: Callable[[], object], seconds: float = PATIENCE) -> float:
    """Wait until something is so, and return how long that took in s."""
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < seconds
        time.sleep(0.005)
    return time.monotonic() - begin


def commander(simulator: Simulator) -> Any:
    """Return what decides on modes in the vehicle."""
    return simulator.vehicles[0].world.commander


class FlyingProgram:
    """A process that flies a mode: see `flight_program`."""

    def __init__(self, url: str, package: ModuleType, way: str = "await") -> None:
        """Start it. It waits for `begin`."""
        assert package.__file__ is not None
        folder = os.path.dirname(os.path.dirname(package.__file__))
        path = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [sys.executable, "-m", "support.flight_program", url, folder, package.__name__, way],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )
        self._lines: Queue[str] = Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.wait("begins")

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.rstrip())

    def tell(self) -> None:
        """Write a line to its input, so that it begins, or goes on."""
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def wait(self, front: str) -> str:
        """Return the next line of its output that begins with a text."""
        end = time.monotonic() + PATIENCE
        seen: list[str] = []
        while True:
            try:
                line = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except Empty:
                raise AssertionError(f"no line {front!r} after {seen}") from None
            if line.startswith(front):
                return line
            seen.append(line)

    def signal(self, number: int) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def end(self) -> int:
        """Wait for its end, and return its exit code."""
        code = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()
        return code


@contextmanager
def ready(
    url: str, types: Any, way: str = "await", options: Options = CALM
) -> Iterator[tuple[Simulator, FlyingProgram]]:
    """Return a vehicle, and a program that has registered its mode."""
    with simulated(types, url, options) as simulator:
        program = FlyingProgram(url, types, way)
        program.tell()
        program.wait("ready")
        assert EXTERNAL in commander(simulator).components.modes
        yield simulator, program
        program.process.kill()
        program.end()


def fly(simulator: Simulator, program: FlyingProgram, height: float = 2.0) -> None:
    """Take off as a user, and let the program fly its mode."""
    world = simulator.vehicles[0].world
    nan = float("nan")
    assert world.command(TAKEOFF, [nan] * 6 + [world.home.altitude + height]) == 0
    assert world.command(ARM, [1.0] + [nan] * 6) == 0
    until(lambda: world.mode == HOLD and -world.flight.position[2] > height - 1.0)
    assert world.command(SET_MODE, [float(EXTERNAL)] + [nan] * 6) == 0
    program.wait("flies")
