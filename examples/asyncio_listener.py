"""Wait in one asyncio program for two topics. Stop with Ctrl-C.

Usage: python asyncio_listener.py [udp://127.0.0.1:8888]
"""

import asyncio
import sys
from contextlib import suppress

from msggen.live import LinkError, Vehicle
from px4_types import BatteryStatus, VehicleStatus


async def watch_mode(vehicle: Vehicle) -> None:
    """Print the mode whenever it changes."""
    last = None
    async for message in vehicle.subscribe(VehicleStatus):
        if message.nav_state != last:
            last = message.nav_state
            print("mode:", VehicleStatus.NavigationState(last).name, flush=True)


async def watch_battery(vehicle: Vehicle) -> None:
    """Print the battery's charge."""
    async for message in vehicle.subscribe(BatteryStatus):
        print(f"battery: {message.remaining:.0%}", flush=True)


async def main() -> None:
    """Run both."""
    with Vehicle(*sys.argv[1:]) as vehicle:
        await asyncio.gather(watch_mode(vehicle), watch_battery(vehicle))


try:
    with suppress(KeyboardInterrupt):
        asyncio.run(main())
except LinkError as error:
    sys.exit(str(error))
