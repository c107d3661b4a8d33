"""Tests of users of modes: they select one and wait for its end, and what they ask is answered."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from msggen.flight.errors import FlightError, NotReachedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.sim.loop import run
from support.flown import Flown, fly

RETURN = 5


class Short(Mode, name="Short"):
    """Flies to a place, and counts how often."""

    flights = 0

    async def fly(self) -> None:
        await self.goto((await self.position()).shifted(3.0))
        self.flights += 1


class Waits(Mode, name="Waits"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.goto((50.0, 0.0, -10.0))


def test_a_user_waits_for_the_end_of_a_mode(px4_types: Any) -> None:
    class Fails(Mode, name="Fails"):
        async def fly(self) -> None:
            raise ArithmeticError("no corner")

    async def program(flight: Flight, vehicle: Flown) -> None:
        with pytest.raises(FlightError, match="'Short' is not registered"):
            await flight.fly(Short)
        mode = Short()
        await flight.add(mode, Waits, Fails)
        await vehicle.in_air(flight)
        await flight.fly(Short)
        await flight.fly(mode)
        assert mode.flights == 2
        with pytest.raises(ArithmeticError):
            await flight.fly(Fails)
        assert vehicle.world.mode != RETURN
        waiting = asyncio.ensure_future(flight.fly(Waits))
        await asyncio.sleep(1.0)
        await flight.hold()
        with pytest.raises(NotReachedError, match="left before its end"):
            await waiting

    fly(px4_types, program)


def test_answers_are_subscribed_to_before_anything_is_asked(px4_types: Any) -> None:
    """On a link, the answer to what is asked before is lost. PX4 takes a second request for a second mode."""
    answers = {
        "register_ext_component_request": "register_ext_component_reply",
        "setpoint_config": "setpoint_config_reply",
        "vehicle_command": "vehicle_command_ack",
    }
    early: list[str] = []

    class Asked(Flown):
        subscribed: frozenset[str] = frozenset()

        def subscribe(self, topic: str, take: Any) -> Any:
            self.subscribed |= {topic}
            return super().subscribe(topic, take)

        def publish(self, topic: str, message: Any) -> None:
            if answers.get(topic, topic) not in self.subscribed | {topic}:
                early.append(topic)
            super().publish(topic, message)

    vehicle = Asked(px4_types)

    async def program() -> None:
        async with Flight(vehicle) as flight:
            await flight.add(Short)
            await flight.arm()

    run(program(), vehicle)
    assert vehicle.times("register_ext_component_request")
    assert early == []
