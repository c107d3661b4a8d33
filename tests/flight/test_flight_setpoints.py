"""Tests of setpoints of modes: their rates, their kinds, their frames, and errors before anything is sent."""

from __future__ import annotations

import asyncio
import math
import re
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.sending import FREE
from msggen.messages.setpoints import ATTITUDE, RATES
from support.examples import examples
from support.flown import EXTERNAL, Flown, fly


def test_setpoints_are_sent_at_the_rate_of_their_kind(px4_types: Any) -> None:
    class Kinds(Mode):
        setpoints = (*Mode.setpoints, ATTITUDE, RATES)

        async def fly(self) -> None:
            self.trajectory(velocity=(1.0, 0.0, 0.0))
            await asyncio.sleep(2.0)
            self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.5)
            await asyncio.sleep(2.0)
            self.rates(roll=0.0, pitch=0.0, yaw=0.1, thrust=0.5)
            await asyncio.sleep(2.0)
            await self.goto((100.0, 0.0, -10.0))

    async def program(flight: Flight, vehicle: Flown) -> Flown:
        await flight.add(Kinds)
        await vehicle.in_air(flight)
        await flight.set_mode(EXTERNAL)
        await asyncio.sleep(8.0)
        return vehicle

    vehicle = fly(px4_types, program)
    for topic, rate in (
        ("trajectory_setpoint", 50),
        ("vehicle_attitude_setpoint", 100),
        ("vehicle_rates_setpoint", 200),
        ("goto_setpoint", 30),
    ):
        times = vehicle.times(topic)
        pauses = [two - one for one, two in pairwise(times)]
        assert len(times) > rate
        assert max(pauses) <= 1 / rate + 0.005, topic  # a step of the simulation is 4 ms
        assert sum(pauses) / len(pauses) == pytest.approx(1 / rate, rel=0.02), topic
    applied = [
        each.message.type for each in vehicle.sent if each.topic == "setpoint_config" and each.message.should_apply
    ]
    assert [kind for kind, before in zip(applied, [0, *applied], strict=False) if kind != before] == [4, 6, 5, 2]


def test_a_kind_that_a_mode_does_not_declare_is_an_error(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    class Plain(Mode):
        async def fly(self) -> None:
            self.rates(roll=0.0, pitch=0.0, yaw=0.0, thrust=0.5)

    async def program(flight: Flight, vehicle: Flown) -> Flown:
        await flight.add(Plain)
        await vehicle.in_air(flight)
        await flight.set_mode(EXTERNAL)
        await asyncio.sleep(1.0)
        return vehicle

    vehicle = fly(px4_types, program)
    assert not vehicle.times("vehicle_rates_setpoint")
    assert "mode 'Plain' declares goto, trajectory setpoints: add `RATES` to its `setpoints`" in caplog.text


@settings(max_examples=examples(30, by_day=3))
@given(st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-30, -5)), st.floats(-180, 180))
def test_enu_and_ned_lead_to_the_same_setpoint(
    px4_types: Any, place: tuple[float, float, float], heading: float
) -> None:
    def setpoint(frame: str, goal: tuple[float, float, float], towards: float) -> Any:
        class There(Mode):
            async def fly(self) -> None:
                await self.goto(goal, heading_deg=towards)

        There.frame = frame  # type: ignore[assignment]

        async def program(flight: Flight, vehicle: Flown) -> Any:
            await flight.add(There)
            await vehicle.in_air(flight, 5.0)
            await flight.set_mode(EXTERNAL)
            await asyncio.sleep(0.5)
            return next(each.message for each in vehicle.sent if each.topic == "goto_setpoint")

        return fly(px4_types, program)

    north, east, down = place
    one, two = setpoint("ned", place, heading), setpoint("enu", (east, north, -down), 90.0 - heading)
    assert two.position == pytest.approx(one.position)
    assert math.cos(one.heading) == pytest.approx(math.cos(two.heading), abs=1e-6)
    assert math.sin(one.heading) == pytest.approx(math.sin(two.heading), abs=1e-6)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda mode: mode.trajectory(velocity=(1.0, 0.0, math.nan)), "each axis needs"),
        (lambda mode: mode.trajectory(position=(0.0, 0.0, 0.0), heading=0.0, heading_deg=0.0), "got both"),
        (lambda mode: mode.trajectory(velocity=(1.0, 0.0, 0.0), heading=math.inf), "finite numbers for a heading"),
        (lambda mode: mode.attitude((1.0, 0.0, 0.0, 0.0), thrust=1.5), "a thrust from 0 to 1"),
    ],
)
@pytest.mark.parametrize("axes", ["ned", "enu"])
def test_wrong_setpoints_are_errors_before_anything_is_sent(
    px4_types: Any, caplog: pytest.LogCaptureFixture, call: Any, text: str, axes: Any
) -> None:
    class Wrong(Mode):
        frame = axes
        setpoints = (*Mode.setpoints, ATTITUDE)

        async def fly(self) -> None:
            call(self)

    async def program(flight: Flight, vehicle: Flown) -> Flown:
        await flight.add(Wrong)
        await vehicle.in_air(flight)
        sent = len(vehicle.sent)
        await flight.set_mode(EXTERNAL)
        await asyncio.sleep(0.3)
        topics = {each.topic for each in vehicle.sent[sent:]}
        assert not topics & {"trajectory_setpoint", "vehicle_attitude_setpoint"} - {"trajectory_setpoint"}
        return vehicle

    fly(px4_types, program)
    assert text in caplog.text


@pytest.mark.parametrize("name", ["max_speed", "max_climb", "max_turn_rate"])
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_limit_of_a_goto_is_above_zero(px4_types: Any, name: str, value: float) -> None:
    async def program(flight: Flight, vehicle: Flown) -> None:
        mode = Goes(name, value)
        await flight.add(mode)
        await vehicle.in_air(flight)
        with pytest.raises(ValueError, match=re.escape(f"expected limits above 0, got [{value}]")):
            await flight.fly(mode)

    class Goes(Mode, name="Goes"):
        def __init__(self, name: str, value: float) -> None:
            self.options: dict[str, Any] = {name: value}

        async def fly(self) -> None:
            await self.goto((5.0, 0.0, -10.0), **self.options)

    fly(px4_types, program)


@pytest.mark.parametrize("position", [(1.0, math.nan, math.nan), (math.nan, 1.0, -10.0), FREE])
def test_the_heartbeat_of_offboard_mode_tells_what_is_controlled_on_any_axis(
    px4_types: Any, position: tuple[float, float, float]
) -> None:
    velocity = tuple(math.nan if math.isfinite(each) else 0.5 for each in position)

    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_air(flight)
        async with flight.offboard() as setpoint:
            setpoint.trajectory(position=position, velocity=velocity)
            before = len(vehicle.sent)
            await asyncio.sleep(0.2)
            beats = [each.message for each in vehicle.sent[before:] if each.topic == "offboard_control_mode"]
        assert beats
        told = {(beat.position, beat.velocity, beat.acceleration) for beat in beats}
        assert told == {(position != FREE, True, False)}

    fly(px4_types, program)
