"""Fly a plane over the corners of a triangle, in a flight mode that this program registers.

Usage: python triangle.py [udp://127.0.0.1:8888]

A plane for it: msggen sim --vehicle plane
"""

import asyncio
import sys

import px4_types
from msggen.flight import FIXED_WING, Flight, FlightError, Mode

CORNERS = [(200.0, 0.0), (100.0, 170.0), (0.0, 0.0)]  # north and east in m
HEIGHT = 40.0


class Triangle(Mode, name="Triangle"):
    """Fly over the corners, and then around the last one."""

    setpoints = (FIXED_WING,)

    async def fly(self) -> None:
        """Fly from corner to corner: the mode guides the plane, because PX4 has no goto for it."""
        for north, east in CORNERS:
            await self.goto((north, east, -HEIGHT), within=20.0)
            print(f"over {north:.0f} {east:.0f}", flush=True)


async def main(flight: Flight) -> None:
    """Take off, fly the triangle, and land."""
    await flight.add(Triangle)
    await flight.arm()
    await flight.takeoff(30.0)
    await flight.fly(Triangle)
    await flight.land()
    await flight.wait_disarmed()


async def connect() -> None:
    """Fly a vehicle on a link."""
    async with Flight(sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888", types=px4_types) as flight:
        await main(flight)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except FlightError as error:
        sys.exit(str(error))
