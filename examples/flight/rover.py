"""Drive a rover along a line and back, in a mode that this program registers.

Usage: python rover.py [udp://127.0.0.1:8888]

A rover for it: msggen sim --vehicle rover
"""

import asyncio
import sys

import px4_types
from msggen.flight import ROVER, Flight, FlightError, Limits, Mode


class Line(Mode, name="Line"):
    """Drive to a place, and from there by speed and heading."""

    setpoints = ROVER

    async def fly(self) -> None:
        """Drive 20 m north, then east."""
        start = await self.position()
        await self.goto(start.shifted(20.0), max_speed=2.0)
        print("20 m north", flush=True)
        self.rover(speed=1.5, heading_deg=90.0)
        await asyncio.sleep(10.0)
        await self.hold(3.0)
        print(f"{(await self.position()).y - start.y:.0f} m east", flush=True)


async def main(flight: Flight) -> None:
    """Arm, drive, and disarm: a rover does not take off."""
    await flight.add(Line)
    await flight.arm()
    await flight.fly(Line)
    await flight.land()
    await flight.wait_disarmed()


async def connect() -> None:
    """Drive a vehicle on a link."""
    address = sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888"
    async with Flight(address, types=px4_types, limits=Limits(distance=50.0)) as flight:
        await main(flight)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except FlightError as error:
        sys.exit(str(error))
