"""Tests of motors, servos, thrust and torque in modes, and of payload servos by command."""

from __future__ import annotations

import asyncio
import math
import re
from itertools import pairwise
from typing import Any

import pytest

from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.commands import SET_ACTUATORS
from msggen.messages.setpoints import ACTUATORS, THRUST_AND_TORQUE
from support.flown import Flown, fly, flying, flying_each

MOTORS, SERVOS = ACTUATORS.topics
THRUST, TORQUE = THRUST_AND_TORQUE.topics


class Moves(Mode):
    """Calls something on a vehicle that stands on the ground."""

    setpoints = (ACTUATORS, THRUST_AND_TORQUE)
    flies_disarmed = True

    def __init__(self, call: Any) -> None:
        self.call = call

    async def fly(self) -> None:
        self.call(self)
        await asyncio.sleep(0.1)


def moved(types: Any, call: Any) -> Flown:
    """Return the vehicle of a program whose mode calls something."""

    async def program(flight: Flight, vehicle: Flown) -> Flown:
        mode = Moves(call)
        await flight.add(mode)
        await flight.fly(mode)
        return vehicle

    return fly(types, program)


def test_motors_and_servos_have_the_values_of_the_program(types: Any) -> None:
    vehicle = moved(types, lambda mode: mode.actuators(motors=[0.5, None, -0.25], servos=[-1.0, 0.5], reversible={3}))
    motors, servos = (next(each.message for each in vehicle.sent if each.topic == topic) for topic in ACTUATORS.topics)
    assert motors.control[0] == 0.5
    assert math.isnan(motors.control[1])
    assert motors.control[2] == -0.25
    assert all(map(math.isnan, motors.control[3:]))
    assert motors.reversible_flags == 0b100
    assert servos.control[:2] == (-1.0, 0.5)
    assert all(map(math.isnan, servos.control[2:]))
    assert len(servos.control) in {8, 15}  # before and from v1.18


def test_the_thrust_comes_before_the_torque(types: Any) -> None:
    """PX4 shares both out among the motors when the torque arrives."""
    vehicle = moved(types, lambda mode: mode.thrust_torque(thrust=(0.0, 0.0, -0.4), torque=(0.1, 0.0, -0.1)))
    found = [each.topic for each in vehicle.sent if each.topic in THRUST_AND_TORQUE.topics]
    assert found[:4] == [THRUST, TORQUE] * 2
    message = next(each.message for each in vehicle.sent if each.topic == THRUST)
    assert message.xyz == pytest.approx((0.0, 0.0, -0.4))


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda mode: mode.actuators(motors=[1.1]), "expected a motor from -1 to 1, got 1.1"),
        (lambda mode: mode.actuators(servos=[math.nan]), "expected a servo from -1 to 1, got nan"),
        (lambda mode: mode.actuators(motors=[0.0, -0.1]), "motor 2 has -0.1, and is not in `reversible`"),
        (lambda mode: mode.actuators(motors=[0.0] * 13), "expected 12 motors at most, got 13"),
        (lambda mode: mode.actuators(servos=[0.0] * 16), "servos at most, got 16: this firmware has no more"),
        (lambda mode: mode.actuators(motors=[0.0], reversible=[0]), "numbers of motors from 1 to 12 in `reversible`"),
        (lambda mode: mode.thrust_torque(thrust=(0, 0, -1.5), torque=(0, 0, 0)), "a thrust from -1 to 1, got -1.5"),
        (lambda mode: mode.thrust_torque(thrust=(0, 0, 0), torque=(0, math.nan, 0)), "a torque from -1 to 1, got nan"),
        (lambda mode: mode.thrust_torque(thrust=(0, 0), torque=(0, 0, 0)), "expected three numbers"),
    ],
)
def test_wrong_values_are_errors_before_anything_is_sent(px4_types: Any, call: Any, text: str) -> None:
    seen: list[Flown] = []

    def wrong(mode: Mode) -> None:
        with pytest.raises(ValueError, match=re.escape(text)):
            call(mode)

    seen.append(moved(px4_types, wrong))
    assert not {each.topic for each in seen[0].sent} & {*ACTUATORS.topics, *THRUST_AND_TORQUE.topics}


@flying_each()
async def test_payload_servos_are_set_by_command_ten_times_a_second(flight: Flight, vehicle: Flown) -> None:
    class Drops(Mode):
        flies_disarmed = True

        async def fly(self) -> None:
            await self.set_actuators({6: 1.0})

    await asyncio.gather(*(flight.set_actuators({1: share / 10, 3: -1.0}) for share in range(5)))
    await flight.add(Drops)
    await flight.fly(Drops)
    sent = [each for each in vehicle.sent if each.topic == "vehicle_command" and each.message.command == SET_ACTUATORS]
    assert len(sent) == 6
    assert all(two.time - one.time > 0.095 for one, two in pairwise(sent))
    assert [each.message.param1 for each in sent[:5]] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert {each.message.param3 for each in sent[:5]} == {-1.0}
    assert math.isnan(sent[0].message.param2)
    assert math.isnan(sent[5].message.param1)
    assert (sent[5].message.param6, sent[5].message.param7) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("values", "text"),
    [({}, "expected the numbers of actuators from 1 to 6"), ({0: 0.5}, "from 1 to 6, got [0]"), ({7: 0.5}, "got [7]")]
    + [({1: value}, "expected a value from -1 to 1") for value in (1.1, -1.1, math.nan, math.inf)],
)
@flying()
async def test_wrong_payload_servos_are_errors(
    flight: Flight, vehicle: Flown, values: dict[int, float], text: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        await flight.set_actuators(values)
    assert not vehicle.times("vehicle_command")
