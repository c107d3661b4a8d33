"""A call for each kind of setpoint, and flights of each kind of vehicle that make them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import (
    ACTUATORS,
    ATTITUDE,
    FIXED_WING,
    GOTO,
    MODES,
    RATES,
    ROVER,
    ROVER_POSITION,
    ROVER_THROTTLE,
    SENT,
    THRUST_AND_TORQUE,
    TRAJECTORY,
    Kind,
)
from msggen.messages.vehicle_types import FIXED_WING as WINGS
from msggen.messages.vehicle_types import ROTARY_WING
from msggen.messages.vehicle_types import ROVER as WHEELS
from msggen.sources.embedded import EMBEDDED
from support.flown import Flown

RELEASES = [release for release in EMBEDDED if release >= MODES]
"""The releases with modes of programs."""
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
_TURNS: Sequence[Mapping[str, float]] = ({"heading": 1.0}, {"turn_rate": 0.2}, {"steering": 0.3})


def _driving(drive: Mapping[str, float], turn: Mapping[str, float]) -> Callable[[Mode], None]:
    return lambda mode: mode.rover(**drive, **turn)


CALLS: Mapping[Kind, Callable[[Mode], Any]] = {
    TRAJECTORY: lambda mode: mode.trajectory(velocity=(1.0, 0.0, 0.0)),
    GOTO: lambda mode: mode.goto((500.0, 0.0, -20.0)),
    ATTITUDE: lambda mode: mode.attitude(UPRIGHT, thrust=0.5),
    RATES: lambda mode: mode.rates(roll=0.0, pitch=0.0, yaw=0.1, thrust=0.5),
    FIXED_WING: lambda mode: mode.fixed_wing(course_deg=90.0),
    THRUST_AND_TORQUE: lambda mode: mode.thrust_torque(thrust=(0.1, 0.0, -0.5), torque=(0.0, 0.0, 0.0)),
    ACTUATORS: lambda mode: mode.actuators(motors=[0.5] * 4, servos=[0.1]),
    ROVER_POSITION: lambda mode: mode.goto((500.0, 0.0, 0.0)),
    **{
        kind: _driving(drive, turn)
        for kinds, drive in ((ROVER[1:], {"speed": 1.0}), (ROVER_THROTTLE, {"throttle": 0.2}))
        for kind, turn in zip(kinds, _TURNS, strict=True)
    },
}
"""Each sends a setpoint of the kind. Some are coroutines."""
assert CALLS.keys() == {*SENT}
VEHICLES: Mapping[str, frozenset[int]] = {
    "multicopter": frozenset({ROTARY_WING}),
    "plane": frozenset({WINGS}),
    "vtol": frozenset({ROTARY_WING, WINGS}),
    "tailsitter": frozenset({ROTARY_WING, WINGS}),
    "rover": frozenset({WHEELS}),
    "differential": frozenset({WHEELS}),
}
"""The types of the vehicles that are simulated."""


def is_bridged(kind: Kind, release: str) -> bool:
    """Whether a release takes a kind of setpoints."""
    return tuple(map(int, kind.since[1:].split("."))) <= tuple(map(int, release[1:].split(".")))


def followed(vehicle: str, release: str) -> tuple[Kind, ...]:
    """Return the kinds that a vehicle follows, and that a release takes."""
    return tuple(each for each in SENT if each.followed_by & VEHICLES[vehicle] and is_bridged(each, release))


async def send(mode: Mode, kind: Kind, seconds: float) -> None:
    """Send a setpoint of a kind for some time."""
    found = CALLS[kind](mode)
    if found is None:
        await asyncio.sleep(seconds)
        return
    going = asyncio.ensure_future(found)
    await asyncio.sleep(seconds)
    going.cancel()
    await asyncio.gather(going, return_exceptions=True)


async def in_air(flight: Flight, vehicle: Flown) -> None:
    """Arm a vehicle of any kind, and let it fly if it does. It is in Hold."""
    await flight.arm()
    kind = vehicle.world.airframe
    if VEHICLES["rover"] == {kind.vehicle_type}:
        await flight.hold()
        return
    if kind.vehicle_type == ROTARY_WING and not kind.is_vtol:
        await vehicle.in_air(flight, 20.0)
        return
    await flight.takeoff(30.0)
    await vehicle.until(lambda: vehicle.world.mode == 4, 5.0)
