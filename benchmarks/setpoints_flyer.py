"""A program that flies: a process of its own for setpoints.py.

Its arguments are a port, `direct` or `shared`, and what it does, as JSON. It prints `open` when its link is open.

- `[["steady", 50.0, 4.0], ...]`: it repeats a setpoint at a rate in Hz for a time in s, one after the other.
- `[["answers", 100]]`: it registers and commands as often. It prints the times in s that the answers took, as JSON.

With `["compute", 0.005]` among them, a thread of the program computes meanwhile. The number is the time in s after
which Python lets another thread run: `sys.setswitchinterval`.
"""

from __future__ import annotations

import asyncio
import importlib
import json
import math
import random
import sys
import threading
import time
from collections.abc import Awaitable
from typing import Any

from environment import ROOT
from msggen.flight import TRAJECTORY, Flight, Mode
from msggen.flight.commands import Commands
from msggen.flight.feeds import Feeds
from msggen.flight.link import LinkConnection
from msggen.flight.registration import Registrar, Wanted
from msggen.flight.sending import FREE, Trajectory
from msggen.live import Vehicle
from msggen.messages.commands import ARM_DISARM
from setpoints import place_of

sys.path.insert(0, str(ROOT / "generated"))


async def repeat(vehicle: Vehicle, steps: list[tuple[float, float]]) -> None:
    """Repeat setpoints at rates in Hz, each for a time in s. The vehicle stays on the ground, as it is disarmed."""
    async with Flight(vehicle) as flight:

        class Steady(Mode, name="Steady"):
            setpoints = tuple(TRAJECTORY._replace(rate=rate) for rate, _ in steps)
            flies_disarmed = True

            async def fly(self) -> None:
                for kind, (rate, seconds) in zip(self.setpoints, steps, strict=True):
                    values = Trajectory(place_of(rate), FREE, FREE, None, None, math.nan).values("ned")
                    steering = flight.find(self)._steering  # noqa: SLF001 - a mode refuses positions on the ground
                    steering.set(kind, {kind.topic: values})
                    await asyncio.sleep(seconds)

        await flight.add(Steady)
        await flight.fly(Steady)


async def ask(vehicle: Vehicle, times: int, types: Any) -> dict[str, list[float]]:
    """Register and command, and return the times in s from each request to its answer."""
    connection = LinkConnection(vehicle, [types])
    await connection.open([])
    feeds = Feeds(connection)
    for topic in ("vehicle_command_ack", "register_ext_component_reply"):  # as a Flight, which asks for them at first
        feeds[topic]
    await feeds["vehicle_status"].wait(lambda _: True)
    registrar, commands = Registrar(connection, feeds), Commands(connection, feeds)
    registered, acknowledged = list[float](), list[float]()
    for _ in range(times):
        acknowledged.append(await seconds_of(commands.send(ARM_DISARM, 0.0)))
        ids, seconds = await timed(registrar.register(Wanted("Asked")))
        registered.append(seconds)
        registrar.unregister(ids)
        await registrar.settle()
        await asyncio.sleep(random.uniform(0.02, 0.04))  # noqa: S311 - at any moment of the vehicle's loop
    feeds.close()
    return {"registered": registered, "acknowledged": acknowledged}


async def timed(work: Awaitable[Any]) -> tuple[Any, float]:
    """Return a result, and how long it took in s."""
    begin = time.perf_counter()
    return await work, time.perf_counter() - begin


async def seconds_of(work: Awaitable[Any]) -> float:
    """Return how long something took in s."""
    return (await timed(work))[1]


def compute() -> None:
    """Compute without an end."""
    while True:
        sum(range(1000))


def main() -> None:
    """Do what the arguments say."""
    port, way, tasks = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    types = importlib.import_module("px4_types")
    with Vehicle(f"udp://127.0.0.1:{port}", types, direct=way == "direct") as vehicle:
        print("open", flush=True)
        for _, seconds in (each for each in tasks if each[0] == "compute"):
            sys.setswitchinterval(seconds)
            threading.Thread(target=compute, daemon=True).start()
        steps = [(rate, seconds) for word, rate, seconds in (each for each in tasks if each[0] == "steady")]
        if steps:
            asyncio.run(repeat(vehicle, steps))
        for _, times in (each for each in tasks if each[0] == "answers"):
            print(json.dumps(asyncio.run(ask(vehicle, times, types))), flush=True)


if __name__ == "__main__":
    main()
