"""Fly without GPS, by what a camera sees.

Usage: python indoor.py [udp://127.0.0.1:8888]

The vehicle needs EKF2_EV_CTRL 3 or more; msggen sim also needs EKF2_GPS_CTRL 0, because its GPS works indoors:
msggen sim --sync short --param EKF2_EV_CTRL=15 --param EKF2_GPS_CTRL=0

Instead of a camera, `see` takes the place from the simulated vehicle, adds noise, and needs some time for it.
"""

import asyncio
import random
import sys

import px4_types
from msggen.flight import Flight, FlightError, GlobalPlace, Limits

RATE = 30.0  # pictures a second
DELAY = 0.025  # s from a picture to the place
NOISE = 0.02  # m, the standard deviation of the place
ORIGIN = GlobalPlace(47.3977, 8.5456, 488.0)  # of the room, so that Hold and Return can be used
CORNERS = [(1.0, 0.0, 1.5), (1.0, 1.0, 1.5), (0.0, 0.0, 1.5)]  # east, north, up in m


async def see(flight: Flight) -> None:
    """Measure where the vehicle is, in ENU, until this task is cancelled."""
    chance = random.Random(1)  # noqa: S311 - not for secrets
    while True:
        taken, place = flight.measure.time, flight.feeds["vehicle_local_position"].latest
        await asyncio.sleep(DELAY)  # the camera computes
        if place is not None:
            east, north, up = (each + chance.gauss(0.0, NOISE) for each in (place.y, place.x, -place.z))
            flight.measure.local(position=(east, north, up), variance=NOISE**2, frame="enu", time=taken)
        await asyncio.sleep(1.0 / RATE - DELAY)


async def main(flight: Flight) -> None:
    """Wait until the estimator uses the camera, fly a triangle, and land."""
    camera = asyncio.create_task(see(flight))
    try:
        await flight.set_origin(ORIGIN)
        await flight.measure.fused()
        print("fused:", ", ".join(each.part for each in flight.measure.state), flush=True)
        await flight.arm()
        await flight.takeoff(1.5)
        async with flight.offboard(frame="enu") as setpoint:
            for corner in CORNERS:
                await setpoint.goto(corner, within=0.3)
                print("at", *corner, flush=True)
        await flight.land()
        await flight.wait_disarmed()
    finally:
        camera.cancel()


async def connect() -> None:
    """Fly a vehicle on a link."""
    address = sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888"
    async with Flight(address, types=px4_types, limits=Limits(height=3.0, distance=5.0)) as flight:
        await main(flight)


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except FlightError as error:
        sys.exit(str(error))
