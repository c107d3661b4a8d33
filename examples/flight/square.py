"""Fly a square in a flight mode that this program registers. A pilot can also select the mode, as "Square".

Usage: python square.py [udp://127.0.0.1:8888]
"""

import asyncio
import sys

import px4_types
from msggen.flight import LOCAL_POSITION, Flight, FlightError, Limits, Mode

CORNERS = [(5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0)]  # north and east in m


class Square(Mode, name="Square"):
    """Fly a square at the current height, from the place where the mode was entered."""

    requires = LOCAL_POSITION

    async def fly(self) -> None:
        """Fly to the corners. If a pilot takes over, the current `await` is cancelled."""
        start = await self.position()
        for north, east in CORNERS:
            await self.goto(start.shifted(north, east), max_speed=2.0)
            print("at", north, east, flush=True)


async def main(flight: Flight) -> None:
    """Take off, fly the square, and land."""
    await flight.add(Square)
    await flight.arm()
    await flight.takeoff(5.0)
    await flight.fly(Square)
    await flight.land()
    await flight.wait_disarmed()


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
