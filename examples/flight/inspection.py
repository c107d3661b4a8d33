"""Inspect a mast: an executor arms, takes off, flies around the mast, returns and waits until the vehicle is disarmed.

Usage: python inspection.py [udp://127.0.0.1:8888]

Selecting the mode "Inspection" starts the executor. Here the program selects it; a pilot can use a switch instead.
"""

import asyncio
import math
import sys

import px4_types
from msggen.flight import Executor, Flight, FlightError, Limits, Mode, Problem

MAST = (0.0, 12.0)  # east and north of the local origin in m
RADIUS = 6.0
HEIGHT = 8.0
VIEWS = 6
LEAST_CHARGE = 0.3


class Inspection(Mode, name="Inspection"):
    """Fly around the mast, and view it from all sides."""

    frame = "enu"

    def __init__(self, flight: Flight) -> None:
        self.battery = flight.feeds["battery_status"]

    def problems(self) -> list[Problem]:
        """Report a low battery: PX4 does not enter the mode, and in flight it returns home."""
        battery = self.battery.latest
        return [Problem("inspection_low_battery")] if battery and battery.remaining < LEAST_CHARGE else []

    async def fly(self) -> None:
        """Go from view to view."""
        for view in range(VIEWS + 1):
            angle = math.tau * view / VIEWS - math.pi / 2
            east, north = MAST[0] + RADIUS * math.cos(angle), MAST[1] + RADIUS * math.sin(angle)
            await self.goto((east, north, HEIGHT), heading=angle + math.pi, max_speed=3.0)
            print(f"view {view}: {round(east, 1) + 0.0} m east, {round(north, 1) + 0.0} m north", flush=True)


class Inspector(Executor):
    """The whole flight. It ends if a pilot selects another mode."""

    mode = Inspection
    starts = "selected"

    async def run(self) -> None:
        """Fly from start to end."""
        await self.arm()
        await self.takeoff(HEIGHT)
        await self.fly()
        await self.rtl()
        await self.wait_disarmed()


async def main(flight: Flight) -> None:
    """Start the executor, and wait for its end."""
    await flight.add(Inspector, Inspection(flight))
    await flight.fly(Inspector)


async def connect() -> None:
    """Fly a vehicle on a link."""
    address = sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888"
    async with Flight(address, types=px4_types, limits=Limits(height=20.0, distance=50.0)) as flight:
        await main(flight)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except FlightError as error:
        sys.exit(str(error))
