"""Tests of setpoints of modes and of actuators: rates, kinds, frames, and errors before anything is sent."""

from __future__ import annotations

import asyncio
import math
import re
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.offboard import _Heartbeat
from msggen.messages.commands import SET_ACTUATORS
from msggen.messages.setpoints import ACTUATORS, ATTITUDE, RATES, THRUST_AND_TORQUE, TRAJECTORY
from support.examples import examples
from support.flown import EXTERNAL, Flown, fly, flying, flying_each


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
        await vehicle.in_mode(flight, Kinds)
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
        await vehicle.in_mode(flight, Plain)
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


@flying()
async def test_a_limit_of_a_place_is_positive(flight: Flight, vehicle: Flown) -> None:
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

    await flight.add(Wrong)
    await vehicle.in_air(flight, 3.0)
    await flight.set_mode(Wrong)
    await asyncio.sleep(0.5)
    assert "goto_setpoint" not in {each.topic for each in vehicle.sent}
    assert errors == [f"expected limits above 0, got [{value}]" for _ in range(3) for value in (0.0, -1.0)]


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
