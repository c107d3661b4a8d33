"""Fly two vehicles: the first one flies a square, and the second one makes the same movements, 3 m higher.

Usage: python two_vehicles.py [udp://127.0.0.1:8888]

Without PX4: msggen sim --count 2
"""

import asyncio
import sys
from contextlib import suppress

import px4_types
from msggen.flight import TRAJECTORY, Flight, FlightError, Mode, NotReachedError
from msggen.live import LinkError, Vehicle

CORNERS = [(6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)]  # north and east in m
HEIGHT = 5.0
INTERVAL = 0.05


class Lead(Mode, name="Lead"):
    """Fly a square."""

    async def fly(self) -> None:
        """Fly to the corners."""
        start = await self.position()
        for north, east in CORNERS:
            await self.goto(start.shifted(north, east), max_speed=2.0)


class Follow(Mode, name="Follow"):
    """Copy the movements of another vehicle."""

    setpoints = (TRAJECTORY,)

    def __init__(self, leader: Flight) -> None:
        self.leader = leader.telemetry

    async def fly(self) -> None:
        """Fly until the mode is left. If the leader's position is too old, raise an error, so that PX4 returns home."""
        start, origin = await self.position(), (await self.leader.local_position()).position
        while True:
            there = await self.leader.local_position()
            if not there.is_valid:
                raise RuntimeError(f"no valid position of the leader: the last one is {there.age:.1f} s old")
            north, east, down = (now - before for now, before in zip(there.position, origin, strict=True))
            self.trajectory(position=start.shifted(north, east, down), velocity=there.velocity)
            await asyncio.sleep(INTERVAL)


async def start(flight: Flight, height: float) -> None:
    """Arm and take off."""
    await flight.arm()
    await flight.takeoff(height)


async def end(flight: Flight) -> None:
    """Land, and wait until the vehicle is disarmed."""
    await flight.land()
    await flight.wait_disarmed()


async def main(first: Flight, second: Flight) -> None:
    """Fly both."""
    await first.add(Lead)
    await second.add(Follow(first))
    await asyncio.gather(start(first, HEIGHT), start(second, HEIGHT + 3.0))
    following = asyncio.ensure_future(second.fly(Follow))
    await first.fly(Lead)
    here, there = await first.telemetry.local_position(), await second.telemetry.local_position()
    print(f"the leader is at {here.position.x:.0f} m north, the other at {there.position.x:.0f} m", flush=True)
    await asyncio.gather(end(first), end(second))
    with suppress(NotReachedError):  # landing has ended the mode
        await following


async def connect() -> None:
    """Fly two vehicles on one link, with the keys 1 and 2."""
    arguments = sys.argv[1:]
    with Vehicle(*arguments, types=px4_types, key=1) as one, Vehicle(*arguments, types=px4_types, key=2) as other:
        async with Flight(one) as first, Flight(other) as second:
            await main(first, second)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except (LinkError, FlightError) as error:
        sys.exit(str(error))
