"""Land on a moving target, by its position as seen from the vehicle.

Usage: python precision_landing.py [udp://127.0.0.1:8888]

Instead of a camera, `Target` computes what a camera would measure: how far north and east the target is.
"""

import asyncio
import math
import sys
from typing import NamedTuple

import px4_types
from msggen.flight import TRAJECTORY, Executor, Flight, FlightError, Limits, Mode, Vector

INTERVAL = 0.05  # s between two measurements
GAIN = 0.8  # m/s towards the target for each m of distance
SMOOTHING = 0.1  # the weight of a new measurement in the estimated velocity of the target
NEAR = 0.3  # m of horizontal distance to the target, within which the vehicle descends
ABOVE = 0.15  # m added to NEAR for each m of height
FASTEST = 3.0  # m/s sideways
FAST, SLOW = 1.0, 0.4  # m/s downwards
LOW = 2.0  # m above the ground, below which the vehicle descends slowly
TOUCHED, DECIDED = 0.05, 0.5  # m above the ground, below which it stops sideways motion, and always goes down


class Target:
    """A platform that drives north-east."""

    def __init__(self, place: tuple[float, float] = (8.0, 3.0), velocity: tuple[float, float] = (0.5, 0.3)) -> None:
        self.place, self.velocity, self.start = place, velocity, asyncio.get_running_loop().time()

    def now(self) -> tuple[float, float]:
        """Return the position of the target: north and east in m."""
        seconds = asyncio.get_running_loop().time() - self.start
        return self.place[0] + self.velocity[0] * seconds, self.place[1] + self.velocity[1] * seconds

    def seen_from(self, place: Vector) -> tuple[float, float]:
        """Return what a camera at a place would measure: how far north and east the target is, in m."""
        north, east = self.now()
        return north - place.x, east - place.y


class Motion(NamedTuple):
    """The estimated motion of the target: its place and its velocity."""

    place: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)

    def after(self, place: tuple[float, float]) -> "Motion":
        """Return the estimate after one more measurement of the place."""
        moved = [(now - before) / INTERVAL for now, before in zip(place, self.place, strict=True)]
        north, east = (old + SMOOTHING * (new - old) for old, new in zip(self.velocity, moved, strict=True))
        return Motion(place, (north, east))


class PreciseLanding(Mode, name="Precise Landing"):
    """Follow the target, and descend while the vehicle is above it. Near the ground, land."""

    setpoints = (TRAJECTORY,)

    def __init__(self, flight: Flight, target: Target) -> None:
        self.target = target
        self.estimate = flight.feeds["vehicle_local_position"]

    async def fly(self) -> None:
        """Fly until PX4 says that the vehicle has landed."""
        place = await self.position()
        motion = Motion(self._absolute(place))
        while not (land := await self.telemetry.land()).is_landed:
            place = await self.position()
            motion = motion.after(self._absolute(place))
            height = self.height(place)
            is_down = land.has_ground_contact or height < TOUCHED  # PX4 sees a landing while the setpoint leads down
            self.trajectory(velocity=(0.0, 0.0, SLOW) if is_down else self._towards(motion, place, height))
            await asyncio.sleep(INTERVAL)
        print(f"landed {math.hypot(*self.target.seen_from(await self.position())):.1f} m from the target", flush=True)

    def height(self, place: Vector) -> float:
        """Return the distance to the ground, which an estimate of the height that drifts does not tell."""
        estimate = self.estimate.latest
        return estimate.dist_bottom if estimate and estimate.dist_bottom_valid else -place.z

    def _towards(self, motion: Motion, place: Vector, height: float) -> tuple[float, float, float]:
        """Return the velocity to the target, and down if the vehicle is above it, or too low to turn back."""
        away = self.target.seen_from(place)
        north, east = (speed + GAIN * distance for speed, distance in zip(motion.velocity, away, strict=True))
        share = FASTEST / max(math.hypot(north, east), FASTEST)
        is_above = height < DECIDED or math.hypot(*away) < NEAR + ABOVE * height
        return north * share, east * share, (FAST if height > LOW else SLOW) if is_above else 0.0

    def _absolute(self, place: Vector) -> tuple[float, float]:
        north, east = self.target.seen_from(place)
        return place.x + north, place.y + east


class Delivery(Executor):
    """Take off, land on the target, and let PX4 disarm."""

    mode = PreciseLanding
    starts = "selected"

    async def run(self) -> None:
        """Fly from start to end."""
        await self.arm()
        await self.takeoff(10.0)
        await self.fly()
        await self.land()
        await self.wait_disarmed()


async def main(flight: Flight, target: Target) -> None:
    """Start the executor, and wait until it has ended."""
    await flight.add(Delivery, PreciseLanding(flight, target))
    await flight.fly(Delivery)


async def connect() -> None:
    """Fly a vehicle on a link."""
    address = sys.argv[1] if sys.argv[1:] else "udp://127.0.0.1:8888"
    async with Flight(address, types=px4_types, limits=Limits(height=20.0, distance=100.0)) as flight:
        await main(flight, Target())


if __name__ == "__main__":
    try:
        asyncio.run(connect())
    except FlightError as error:
        sys.exit(str(error))
