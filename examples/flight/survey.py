"""Fly the mission of survey.json, with an action of this program. A pilot can also select its mode, "survey".

Usage: python survey.py [udp://127.0.0.1:8888]

If a pilot takes over, and selects the mode again, the mission goes on with the same item.
"""

import asyncio
import sys
from pathlib import Path

import px4_types
from msggen import InputError
from msggen.flight import Flight, FlightError, Limits
from msggen.flight.missions import Arguments, Handler, Mission

FILE = Path(__file__).with_suffix(".json")


async def take_photo(handler: Handler, arguments: Arguments) -> None:
    """Take photos, while the vehicle holds its place."""
    for number in range(arguments.get("count", 1)):
        await asyncio.sleep(0.5)
        print(f"item {handler.index}: photo {number + 1} of the {arguments['id']}", flush=True)


async def main(flight: Flight) -> None:
    """Arm, and fly the mission."""
    mission = Mission.load(FILE, actions={"takePhoto": take_photo})
    await flight.add(mission)
    await flight.arm()
    await flight.fly(mission)
    await flight.wait_disarmed()
    print("back", flush=True)


async def connect() -> None:
    """Fly a vehicle on a link."""
    address = sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888"
    async with Flight(address, types=px4_types, limits=Limits(height=20.0, distance=50.0)) as flight:
        await main(flight)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except (FlightError, InputError) as error:
        sys.exit(str(error))
