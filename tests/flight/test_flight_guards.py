"""Tests of conditions that keep a wrong setpoint from the vehicle, one by one."""

from __future__ import annotations

import asyncio
import math
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight import Flight, Mode
from msggen.flight.offboard import _Heartbeat
from msggen.messages.setpoints import TRAJECTORY
from support.flown import Flown, fly

NAN = math.nan


@pytest.mark.parametrize(
    ("position", "velocity", "acceleration"),
    [
        ((NAN, NAN, -5.0), (1.0, 0.0, NAN), (NAN, NAN, NAN)),  # a height, and a speed over ground
        ((1.0, 2.0, -5.0), (NAN, NAN, NAN), (NAN, NAN, NAN)),
        ((NAN, NAN, NAN), (NAN, NAN, 0.5), (0.1, 0.1, NAN)),
    ],
)
def test_the_heartbeat_of_offboard_names_what_some_axis_has(
    px4_types: Any, position: Any, velocity: Any, acceleration: Any
) -> None:
    """PX4 runs no controller for what the heartbeat does not name, and ignores these values."""
    sent: list[Any] = []
    connection: Any = SimpleNamespace(package=px4_types, publish=lambda _topic, message: sent.append(message))
    heartbeat = _Heartbeat(connection)
    heartbeat.apply(TRAJECTORY)
    heartbeat.values = {"position": position, "velocity": velocity, "acceleration": acceleration}
    heartbeat.send()
    told = (sent[0].position, sent[0].velocity, sent[0].acceleration)
    assert told == tuple(not all(map(math.isnan, each)) for each in (position, velocity, acceleration))


def test_a_limit_of_a_place_is_positive(px4_types: Any) -> None:
    errors: list[str] = []

    class Wrong(Mode):
        async def fly(self) -> None:
            for name in ("max_speed", "max_climb", "max_turn_rate"):
                for value in (0.0, -1.0):
                    limit: Any = {name: value}
                    try:
                        await asyncio.wait_for(self.goto((1.0, 0.0, -5.0), **limit), 1.0)
                    except ValueError as error:
                        errors.append(str(error))
            await asyncio.Event().wait()

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Wrong)
        await vehicle.in_air(flight, 3.0)
        await flight.set_mode(Wrong)
        await asyncio.sleep(0.5)
        assert "goto_setpoint" not in {each.topic for each in vehicle.sent}

    fly(px4_types, program)
    assert errors == [f"expected limits above 0, got [{value}]" for _ in range(3) for value in (0.0, -1.0)]
