"""Tests of registrations that do not go as planned, on the clock of the simulated vehicle."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from msggen.flight import Flight, Mode, UnsupportedError
from msggen.messages.setpoints import TRAJECTORY, Kind
from msggen.sim.loop import run
from support.flown import EXTERNAL, Flown, fly

WINGS = Kind("fixed wing", 3, TRAJECTORY.topics, rate=30.0)


class Waits(Mode, name="Waits"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.hold(1000.0)


class Glides(Mode, name="Waits"):
    """Sends setpoints that a multicopter does not take."""

    setpoints = (WINGS,)

    async def fly(self) -> None:
        await self.hold(1000.0)


class Late(Flown):
    """A vehicle whose replies to registrations take 1.5 s."""

    def _publish(self, topic: str, /, **values: Any) -> None:
        if topic == "register_ext_component_reply":
            asyncio.get_running_loop().call_later(1.5, lambda: super(Late, self)._publish(topic, **values))
        else:
            super()._publish(topic, **values)


def test_a_mode_that_the_vehicle_cannot_fly_does_not_stay_registered(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> None:
        with pytest.raises(UnsupportedError, match="does not support fixed wing setpoints"):
            await flight.add(Glides)
        await vehicle.until(lambda: not vehicle.world.commander.components.modes, 0.1)
        await flight.add(Waits)
        assert {*vehicle.world.commander.components.modes} == {EXTERNAL}

    fly(px4_types, program)


def test_a_late_reply_does_not_leave_a_second_mode(px4_types: Any) -> None:
    vehicle = Late(px4_types)

    async def program() -> None:
        async with Flight(vehicle) as flight:
            await flight.add(Waits)
            assert flight.find(Waits).ids.mode == EXTERNAL
            await asyncio.sleep(3.0)
            assert len(vehicle.times("register_ext_component_request")) == 2
            assert {*vehicle.world.commander.components.modes} == {EXTERNAL}

    run(program(), vehicle)
