"""What registrations are refused for, what they leave: nothing, and what must be heard before."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from msggen.flight.errors import NoAnswerError, RegistrationError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import GOTO
from msggen.sim.loop import run
from support.flown import Flown, Short, flying, flying_each

RETURN = 5


class GoesAway(Mode, name="Goes away"):
    async def fly(self) -> None:
        await self.hold(1000.0)


@flying_each()
async def test_a_mode_of_another_version_of_the_interface_is_unregistered(flight: Flight, vehicle: Flown) -> None:
    commander = vehicle.world.commander
    commander.rules = commander.rules._replace(api_version=7)
    with pytest.raises(RegistrationError, match=r"the vehicle has version 7 .* build them from the firmware"):
        await flight.add(GoesAway)
    await asyncio.sleep(0.1)
    assert not commander.components.modes


@flying_each()
async def test_a_mode_that_is_replaced_already_is_refused(flight: Flight) -> None:
    class One(GoesAway, name="One"):
        replaces = RETURN

    class Two(GoesAway, name="Two"):
        replaces = RETURN

    await flight.add(One)
    with pytest.raises(RegistrationError, match="another mode already replaces mode 5"):
        await flight.add(Two)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a" * 24, ""),
        ("a" * 22 + "é", ""),
        ("a" * 23 + "é", "has 25 bytes, expected 1 to 24"),
        ("a" * 21 + "飛", ""),
        ("a" * 22 + "飛", "has 25 bytes"),
        ("a\0b", "has a zero"),
        ("a\nb", "not printable"),
    ],
)
@flying()
async def test_names_are_whole_or_refused(flight: Flight, vehicle: Flown, name: str, text: str) -> None:
    mode = type("Mode", (GoesAway,), {}, name=name)
    if text:
        with pytest.raises(RegistrationError, match=text):
            await flight.add(mode)
        assert not vehicle.times("register_ext_component_request")
        return
    await flight.add(mode)
    assert [each.name for each in vehicle.world.commander.components.modes.values()] == [name]
    flight.close()
    await asyncio.sleep(0.1)
    assert not vehicle.world.commander.components.modes


@flying()
async def test_a_mode_whose_setpoints_the_vehicle_does_not_take_is_unregistered(flight: Flight, vehicle: Flown) -> None:
    class Odd(Mode):
        setpoints = (GOTO, GOTO._replace(name="rover", number=7))

        async def fly(self) -> None:
            await self.hold(1000.0)

    with pytest.raises(UnsupportedError, match="does not support rover setpoints"):
        await flight.add(Odd)
    await asyncio.sleep(0.1)
    assert not vehicle.world.commander.components.modes
    await flight.add(GoesAway)


@pytest.mark.parametrize("count", [1, 2])
@flying()
async def test_a_restart_while_modes_are_registered_leaves_none_of_them(
    flight: Flight, vehicle: Flown, count: int
) -> None:
    """The vehicle restarts in the check of the first or the second one. An earlier mode is registered again."""

    class First(GoesAway, name="First"):
        pass

    class Second(GoesAway, name="Second"):
        pass

    modes = vehicle.world.commander.components.modes
    await flight.set_mode("land")  # a mode that was entered earlier shows the restart at once
    await flight.add(GoesAway)
    await asyncio.sleep(1.0)
    adding = asyncio.ensure_future(flight.add(First, Second))
    await vehicle.until(lambda: len(modes) == 1 + count, 1.0)
    vehicle.lost = {"setpoint_config"}
    await vehicle.restart_after(1.2)  # the check takes 1.5 s
    with pytest.raises(NoAnswerError, match="has not answered whether it supports"):
        await adding
    vehicle.lost.clear()
    await asyncio.sleep(3.0)
    assert [each.name for each in vehicle.world.commander.components.modes.values()] == ["Goes away"]
    await flight.add(First, Second)


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
