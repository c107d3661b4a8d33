"""Fly a VTOL to a place on its wings, and back, in a flight mode that this program registers.

Usage: python vtol.py [udp://127.0.0.1:8888]

A VTOL for it: msggen sim --vehicle vtol
"""

import asyncio
import sys

import px4_types
from msggen.flight import FIXED_WING, GOTO, TRAJECTORY, Flight, FlightError, Mode

PLACE = (200.0, 0.0, -30.0)  # north, east and down in m


class There(Mode, name="There and back"):
    """Hover, fly forward, and hover again."""

    setpoints = (GOTO, TRAJECTORY, FIXED_WING)

    async def fly(self) -> None:
        """Fly over the place, and back to the start."""
        start = await self.position()
        await self.to_fixed_wing()
        print("on wings", flush=True)
        await self.goto(PLACE)
        print("there", flush=True)
        await self.goto(start.shifted(z=-10.0))
        await self.to_multicopter()
        print("hovering", flush=True)
        await self.goto(start)


async def main(flight: Flight) -> None:
    """Take off, fly there and back, and land."""
    await flight.add(There)
    await flight.arm()
    await flight.takeoff(20.0)
    await flight.fly(There)
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
