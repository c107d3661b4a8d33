"""A program that flies a mode over a link, and says on its output what happens: for tests that end it.

    python -m support.flight_program URL FOLDER PACKAGE WAY

It begins when a line is written to its input, and flies the vehicle with the key 1: it waits for no other.
"""

from __future__ import annotations

import asyncio
import importlib
import sys
import time

from msggen.flight import LOCAL_POSITION, Executor, Flight, FlightError, Limits, Mode
from msggen.flight.limits import NO_LIMITS
from msggen.live import Vehicle


def say(text: str) -> None:
    print(text, flush=True)


class Stays(Mode, name="Stays"):
    """Holds the place where it is, by a program that `way` describes."""

    requires = LOCAL_POSITION
    way = "await"

    async def fly(self) -> None:
        say(f"flies, {self.is_resumed}")
        place = await self.position()
        if self.way == "computes":
            say("computes")
            end = time.monotonic() + 20.0
            while time.monotonic() < end:  # without an await
                pass
        await self.goto(place.shifted(1000.0))


class Runs(Executor):
    """Flies that mode."""

    mode = Stays

    async def run(self) -> None:
        say(f"runs, {self.is_resumed}")
        await self.fly()


async def program(flight: Flight, way: str) -> None:
    async with flight:
        await flight.add(Runs if way.startswith("executes") else Stays)
        say("ready")
        if way == "raises":
            await asyncio.to_thread(sys.stdin.readline)
            raise RuntimeError("planned")
        await flight.run()


async def left(flight: Flight) -> None:
    """Begin a flight that the program never ends."""
    await flight.__aenter__()
    await flight.add(Stays)
    say("ready")
    await asyncio.to_thread(sys.stdin.readline)


def main(url: str, folder: str, package: str, way: str) -> None:
    sys.path.insert(0, folder)
    types = importlib.import_module(package)
    Vehicle("udp://127.0.0.1:0", types).close()  # imports what a vehicle needs
    say("begins")
    sys.stdin.readline()
    Stays.way = way
    limits = Limits(height=100.0, distance=5000.0) if way == "limits" else NO_LIMITS
    flight = Flight(url, types, key=1, resume=way == "resumes", limits=limits)
    try:
        asyncio.run(left(flight) if way == "leaves" else program(flight, way))
    except FlightError as error:
        say(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main(*sys.argv[1:])
