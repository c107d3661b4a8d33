"""Tests of the setpoints of programs' modes: which of them a simulated vehicle uses, how, and for how long."""

from __future__ import annotations

import copy
import math
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.generate.cache import package_of
from msggen.messages.commands import ACCEPTED, ARM_DISARM
from msggen.messages.nav_states import EXTERNAL, HOLD, LAND
from msggen.messages.setpoints import ACTUATORS, THRUST_AND_TORQUE
from msggen.sim.flight import NAN, ZERO, Push
from msggen.sim.parameters import PARAMETERS
from msggen.sim.world import STEP, World
from support.examples import examples
from support.sim_world import (
    ARM,
    ATTITUDE,
    DISARM,
    GOTO,
    RATES,
    TRAJECTORY,
    Attitude,
    Goto,
    Motors,
    Program,
    Rates,
    Servos,
    Setpoint,
    Thrust,
    Torque,
    speed_of,
    world_of,
)
from support.simulation import topics_of

FORWARD = Setpoint((NAN, NAN, -2.5), (3.0, 0.0, NAN))
meters = st.floats(-20, 20)


@cache
def _hovering() -> Program:
    program = Program(World(parameters={**PARAMETERS}))  # a mapping proxy cannot be copied
    program.take_off()
    return program


def flying(kind: int | None = TRAJECTORY) -> Program:
    """Return a program whose mode has just been selected, at 2.5 m."""
    program = copy.deepcopy(_hovering())
    program.enter(kind)
    return program


# Goto


@settings(max_examples=examples(8))
@given(meters, meters, st.floats(-20, -1), st.floats(-3, 3))
def test_a_goto_leads_to_its_place_and_heading(north: float, east: float, down: float, heading: float) -> None:
    program = flying(GOTO)
    goto = Goto((north, east, down), flag_control_heading=True, heading=heading)
    program.send(30.0, program.publish(goto), 30)
    assert program.world.flight.position == pytest.approx((north, east, down), abs=0.1)
    assert program.world.flight.heading == pytest.approx(heading, abs=0.01)


def test_a_goto_is_used_for_half_a_second() -> None:
    """Then the place and the speed at that time are held: the vehicle stands some metres further on."""
    program = flying(GOTO)
    program.send(6.0, program.publish(Goto((100.0, 0.0, -2.5))), 30)
    start = program.world.flight.position[0]
    program.run(0.45)
    assert program.world.flight.velocity[0] == pytest.approx(5.0, abs=0.05)
    program.run(6.0)
    place = program.world.flight.position[0]
    assert speed_of(program) < 0.05
    assert start + 5 < place < start + 10
    program.run(5.0)
    assert program.world.flight.position[0] == pytest.approx(place, abs=0.1)
    assert program.world.mode == program.mode


@settings(max_examples=examples(8))
@given(st.floats(0.25, 20, width=32), st.floats(0.25, 20, width=32), st.floats(0.125, 5, width=32))
def test_the_limits_of_a_goto_only_tighten(horizontal: float, vertical: float, turn: float) -> None:
    program = flying(GOTO)
    goto = Goto(
        (80.0, -60.0, -40.0),
        flag_control_heading=True,
        heading=3.0,
        flag_set_max_horizontal_speed=True,
        max_horizontal_speed=horizontal,
        flag_set_max_vertical_speed=True,
        max_vertical_speed=vertical,
        flag_set_max_heading_rate=True,
        max_heading_rate=turn,
    )
    speeds, climbs, turns = [], [], []
    for _ in range(20):
        yaw = program.world.flight.yaw
        program.send(0.252, program.publish(goto), 30)
        speeds.append(speed_of(program))
        climbs.append(-program.world.flight.velocity[2])
        turns.append(abs(program.world.flight.yaw - yaw) / 0.252)
    assert max(speeds) == pytest.approx(min(horizontal, 5.0), rel=0.03)
    assert max(climbs) == pytest.approx(min(vertical, 3.0), rel=0.03)
    assert max(turns) < min(turn, math.radians(60)) * 1.02


def test_a_limit_of_a_goto_without_its_flag_does_not_count() -> None:
    program = flying(GOTO)
    goto = Goto((100.0, 0.0, -2.5), max_horizontal_speed=1.0, heading=2.0)
    program.send(6.0, program.publish(goto), 30)
    assert speed_of(program) == pytest.approx(5.0, abs=0.1)
    assert program.world.flight.heading == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("down", [NAN, math.inf])
def test_a_goto_without_a_place_is_ignored(down: float) -> None:
    program = flying(GOTO)
    before = program.world.flight.position
    program.send(3.0, program.publish(Goto((50.0, 0.0, down))), 30)
    assert program.world.flight.position == pytest.approx(before, abs=0.1)


# Trajectory


def test_a_trajectory_is_used_for_ever() -> None:
    program = flying()
    program.send(2.0, program.publish(FORWARD), 50)
    start = program.world.flight.position[0]
    program.run(20.0)
    assert program.world.flight.position[0] - start == pytest.approx(60.0, abs=1.0)


def test_a_goto_flies_after_a_trajectory_and_a_trajectory_after_a_goto() -> None:
    program = flying()
    program.send(2.0, program.publish(FORWARD), 50)
    program.send(6.0, program.publish(Goto((0.0, 0.0, -4.0))), 30)
    assert program.world.flight.position == pytest.approx((0.0, 0.0, -4.0), abs=0.3)
    program.send(3.0, program.publish(FORWARD), 50)
    assert program.world.flight.velocity[0] == pytest.approx(3.0, abs=0.1)


@settings(max_examples=examples(8))
@given(meters, st.floats(-3, 3), st.floats(-8, -2))
def test_each_axis_of_a_trajectory_has_its_own_control(north: float, east_speed: float, down: float) -> None:
    program = flying()
    setpoint = Setpoint((NAN, NAN, down), (0.5, east_speed, NAN), yaw=1.0)
    program.send(12.0, program.publish(setpoint), 50)
    flight = program.world.flight
    assert flight.velocity == pytest.approx((0.5, east_speed, 0.0), abs=0.05)
    assert flight.position[2] == pytest.approx(down, abs=0.05)
    program.send(20.0, program.publish(Setpoint((north, 0.0, down))), 50)
    assert flight.position == pytest.approx((north, 0.0, down), abs=1.0)


@pytest.mark.parametrize(
    ("kind", "messages"),
    [
        (TRAJECTORY, [FORWARD, Goto((50.0, 0.0, -2.5))]),
        (ATTITUDE, [Attitude(thrust_body=(0.0, 0.0, -0.9))]),
        (THRUST_AND_TORQUE.number, [Thrust((0.0, 0.0, -0.9)), Torque()]),
    ],
)
def test_a_setpoint_from_before_the_mode_is_not_used(kind: int, messages: list[Any]) -> None:
    program = Program()
    program.take_off()
    for message in messages:
        program.publish(message)(program.world.time - STEP)
    program.run(0.1)
    before = program.world.flight.position
    program.enter(kind)
    program.run(3.0)
    assert program.world.flight.position == pytest.approx(before, abs=0.1)


def test_position_control_wants_a_setpoint_that_is_newer_than_its_beginning() -> None:
    """Also within a mode that sets attitudes in between."""
    program = flying()
    program.send(2.0, program.publish(FORWARD), 50)
    assert program.world.commander.configure(program.mode, ATTITUDE, is_applied=True)[0] == 0
    program.send(1.0, program.publish(Attitude()), 50)
    assert program.world.commander.configure(program.mode, TRAJECTORY, is_applied=True)[0] == 0
    program.run(5.0)
    assert speed_of(program) < 0.1
    program.send(2.0, program.publish(FORWARD), 50)
    assert program.world.flight.velocity[0] == pytest.approx(3.0, abs=0.1)


INVALID = [
    Setpoint(),
    Setpoint(yaw=1.0),
    Setpoint((NAN, NAN, -2.5)),
    Setpoint((0.0, NAN, -2.5), (NAN, 1.0, NAN)),
    Setpoint((math.inf, 0.0, -2.5)),
]


@pytest.mark.parametrize("invalid", INVALID)
def test_an_invalid_trajectory_is_bridged_for_a_short_time(invalid: Setpoint) -> None:
    program = flying()
    program.send(3.0, program.publish(FORWARD), 50)
    program.send(0.18, program.publish(invalid), 50)
    assert program.world.flight.velocity[0] == pytest.approx(3.0, abs=0.05)
    program.send(4.0, program.publish(invalid), 50)
    assert math.hypot(*program.world.flight.velocity) < 0.05
    program.send(3.0, program.publish(FORWARD), 50)
    assert program.world.flight.velocity[0] == pytest.approx(3.0, abs=0.1)


# Attitude and rates


@pytest.mark.parametrize(("kind", "message"), [(ATTITUDE, Attitude), (RATES, Rates)])
def test_attitude_and_rates_lift_the_vehicle_at_once_and_are_used_for_ever(kind: int, message: Any) -> None:
    program = Program()
    program.enter(kind)
    assert program.command(ARM_DISARM, ARM) == ACCEPTED
    program.send(0.3, program.publish(message(thrust_body=(0.0, 0.0, -0.62))), 50)
    assert not program.world.is_landed
    program.run(8.0)
    assert program.world.flight.velocity[2] == pytest.approx(-2.35, abs=0.05), "drag limits the speed"
    assert program.world.mode == program.mode


@pytest.mark.parametrize("kind", [None, TRAJECTORY, RATES, ACTUATORS.number, THRUST_AND_TORQUE.number])
def test_an_attitude_needs_its_type_of_setpoints(kind: int | None) -> None:
    """Direct actuators, thrust and torque are not simulated: the vehicle holds."""
    program = flying(kind)
    before = program.world.flight.position
    program.send(4.0, program.publish(Attitude(thrust_body=(0.0, 0.0, -0.9))), 50)
    assert program.world.flight.position == pytest.approx(before, abs=0.1)


def test_the_vehicle_flies_where_an_attitude_leans() -> None:
    program = flying(ATTITUDE)
    nose_down = (math.cos(-0.1), 0.0, math.sin(-0.1), 0.0)
    program.send(3.0, program.publish(Attitude(nose_down, (0.0, 0.0, -0.51))), 50)
    flight = program.world.flight
    assert flight.pitch == pytest.approx(-0.2, abs=0.01)
    assert flight.velocity[0] > 1.5
    assert abs(flight.velocity[1]) < 1e-6
    assert program.select(HOLD) == ACCEPTED
    program.run(8.0)
    assert math.hypot(*flight.velocity) < 0.05


@pytest.mark.parametrize(("axis", "rate"), [(0, 0.1), (1, -0.1), (2, 0.5)])
def test_rates_turn_the_vehicle(axis: int, rate: float) -> None:
    program = flying(RATES)
    roll, pitch, yaw = (rate if each == axis else 0.0 for each in range(3))
    program.send(2.0, program.publish(Rates(roll, pitch, yaw)), 50)
    flight = program.world.flight
    assert flight.rates[axis] == pytest.approx(rate, abs=0.01)
    assert (flight.roll, flight.pitch, flight.yaw)[axis] == pytest.approx(2.0 * rate, abs=0.05)


def test_a_vehicle_that_somersaults_comes_to_rest_again() -> None:
    program = flying(ATTITUDE)
    program.most_acceleration, program.can_tumble = 40.0, True
    program.send(5.0, program.publish(Attitude(thrust_body=(0.0, 0.0, -0.9))), 50)
    assert program.world.commander.configure(program.mode, RATES, is_applied=True)[0] == 0
    program.send(3.0, program.publish(Rates(roll=3.0, pitch=1.0, yaw=0.5)), 50)
    assert program.select(HOLD) == ACCEPTED
    program.run(10.0)
    assert math.hypot(*program.world.flight.velocity) < 0.05


@pytest.mark.parametrize("release", ["v1.15", "v1.16", "v1.18"])
def test_the_setpoints_of_every_release_are_understood(release: str) -> None:
    """Those of v1.15 and v1.16 have other fields, too."""
    topics = topics_of(package_of(release)).UORB
    program = flying(ATTITUDE)
    setpoints, time = program.world.setpoints, program.world.time
    takes: dict[str, tuple[Any, dict[str, Any]]] = {
        "goto_setpoint": (setpoints.take_goto, {"position": (1.0, 2.0, -3.0)}),
        "trajectory_setpoint": (setpoints.take_trajectory, {"position": (1.0, 2.0, -3.0)}),
        "vehicle_attitude_setpoint": (setpoints.take_attitude, {"q_d": (1.0, 0.0, 0.0, 0.0)}),
        "vehicle_rates_setpoint": (setpoints.take_rates, {"roll": 1.0}),
    }
    for topic, (take, values) in takes.items():
        if topic in topics:
            take(topics[topic].message(**values), time)
    place = setpoints.of_position(time, time)
    assert place is not None
    assert place.position == (1.0, 2.0, -3.0)
    assert setpoints.push(frozenset({"attitude", "rates", "allocation"}), time) == Push(0.0, (1.0, 0.0, 0.0, 0.0))
    assert setpoints.push(frozenset({"rates", "allocation"}), time) == Push(0.0, rates=(1.0, 0.0, 0.0))


def test_a_vehicle_that_falls_on_its_back_takes_no_thrust() -> None:
    """Drag then pushes it along its own down axis, which is not thrust."""
    program = flying(ATTITUDE)
    program.can_tumble, program.most_acceleration = True, 40.0
    program.send(3.0, program.publish(Attitude(thrust_body=(0.0, 0.0, -0.9))), 50)
    program.send(2.0, program.publish(Attitude((0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0))), 50)
    assert program.world.flight.velocity[2] > 1.0
    assert program.world.thrust == pytest.approx(0.0, abs=1e-3)


# On the ground


@pytest.mark.parametrize("message", [Goto((0.0, 0.0, -5.0)), Setpoint((NAN, NAN, -5.0), (0.0, 0.0, -1.0))])
def test_goto_and_trajectory_do_not_lift_the_vehicle(message: Any) -> None:
    program = Program()
    program.enter()
    assert program.command(ARM_DISARM, ARM) == ACCEPTED
    program.send(10.9, program.publish(message), 30)  # COM_DISARM_PRFLT and 1 s
    assert program.world.is_armed
    assert program.world.is_landed
    program.send(0.3, program.publish(message), 30)
    assert not program.world.is_armed
    assert program.world.flight.position == ZERO


# Thrust and torque, and actuators


@pytest.mark.parametrize(
    ("torque", "motors", "turn"),
    [
        ((0.1, 0.0, 0.0), (0.4, 0.6, 0.6, 0.4), (1.0, 0.0, 0.0)),
        ((0.0, -0.1, 0.0), (0.4, 0.6, 0.4, 0.6), (0.0, -1.0, 0.0)),
        ((0.0, 0.0, 0.1), (0.6, 0.6, 0.4, 0.4), (0.0, 0.0, 1.0)),
    ],
)
def test_torque_and_motors_turn_the_vehicle_the_same_way(torque: Any, motors: Any, turn: Any) -> None:
    by_torque, by_motors = flying(THRUST_AND_TORQUE.number), flying(ACTUATORS.number)
    by_torque.publish_all(0.3, Thrust(), Torque(torque))
    by_motors.publish_all(0.3, Motors(motors + (NAN,) * 8))
    assert by_torque.world.flight.rates == pytest.approx([0.6 * each for each in turn], abs=1e-6)
    assert by_motors.world.flight.rates == pytest.approx([0.6 * each for each in turn], abs=1e-6)


def test_a_thrust_counts_from_the_next_torque_on() -> None:
    program = flying(THRUST_AND_TORQUE.number)
    program.publish_all(1.0, Thrust(), Torque())
    assert program.world.flight.velocity[2] == pytest.approx(0.0, abs=0.1)
    program.publish_all(1.0, Thrust((0.0, 0.0, -0.8)))
    assert program.world.flight.velocity[2] == pytest.approx(0.0, abs=0.1)
    program.publish_all(1.0, Torque())
    assert program.world.flight.velocity[2] < -1.0


def test_motors_lift_and_stop() -> None:
    program = Program()
    program.enter(ACTUATORS.number)
    assert program.command(ARM_DISARM, ARM) == ACCEPTED
    program.publish_all(2.0, Motors((0.6,) * 4))
    assert program.world.flight.velocity[2] < -0.5
    program.can_tumble, program.most_speed = True, 30.0
    program.publish_all(0.5, Motors((NAN,) * 4))
    assert program.world.flight.thrust < 0.1


@pytest.mark.parametrize(("vehicle", "servos"), [("rover", Servos((1.0,))), ("differential", None)])
def test_motors_drive_a_rover(vehicle: str, servos: Servos | None) -> None:
    program = Program(world_of(vehicle))
    program.enter(ACTUATORS.number)
    program.command(ARM_DISARM, ARM)
    motors = Motors((0.5,) if servos else (0.4, 0.6))
    program.publish_all(4.0, *([Motors((*motors.control, NAN)), servos] if servos else [motors]))
    assert speed_of(program) == pytest.approx(1.6, abs=0.05)
    assert program.world.flight.rates[2] > 0.2


# In modes that are not the program's


def test_a_goto_during_land_keeps_the_vehicle_from_landing() -> None:
    """As in a captured flight: ground contact 0.3 s, and landed 1.3 s after the last one."""
    program = flying(GOTO)
    publish = program.publish(Goto((0.0, 0.0, -2.5)))
    program.send(1.0, publish, 30)
    assert program.select(LAND) == ACCEPTED
    program.send(20.0, publish, 30)
    landing = program.world.landing
    assert not landing.ground_contact
    assert program.until(lambda: landing.ground_contact) == pytest.approx(0.31, abs=0.05)
    assert program.until(lambda: landing.landed) == pytest.approx(1.0, abs=0.15)
    assert program.until(lambda: not program.world.is_armed) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("rate", [49.8, 50, 50.3])
def test_a_trajectory_during_hold_moves_the_vehicle_by_jerks(rate: float) -> None:
    """As in a captured flight: 1.3 m in 4 s, at speeds up to 0.9 m/s and back to rest."""
    program = flying()
    assert program.select(HOLD) == ACCEPTED
    program.run(0.5)
    start, speeds = program.world.flight.position[0], []

    def publish(time: int) -> None:
        program.publish(FORWARD)(time)
        speeds.append(program.world.flight.velocity[0])

    program.send(4.0, publish, rate)
    assert program.world.flight.position[0] - start == pytest.approx(1.4, abs=0.6)
    assert max(speeds) > 0.7
    assert min(speeds[50:]) < 0.3
    program.run(8.0)
    assert program.world.flight.position[0] == pytest.approx(start, abs=0.1)


@pytest.mark.parametrize("message", [Attitude(thrust_body=(0.0, 0.0, -0.9)), Rates(roll=1.0), Goto((15.0, 0.0, -2.5))])
def test_other_setpoints_during_hold_do_not_move_the_vehicle(message: Any) -> None:
    program = flying()
    assert program.select(HOLD) == ACCEPTED
    program.run(1.0)
    before = program.world.flight.position
    program.send(4.0, program.publish(message), 50)
    assert program.world.flight.position == pytest.approx(before, abs=0.1)


numbers = st.floats(width=32)
vectors = st.tuples(numbers, numbers, numbers)
messages = st.one_of(
    st.builds(Setpoint, vectors, vectors, vectors, numbers, numbers),
    st.builds(Goto, vectors, *[strategy for _ in range(4) for strategy in (st.booleans(), numbers)]),
    st.builds(Attitude, st.tuples(*[numbers] * 4), vectors),
    st.builds(Rates, numbers, numbers, numbers, vectors),
)


@settings(max_examples=examples(40))
@given(st.lists(st.tuples(messages, st.sampled_from([*range(1, 7), 15, 16])), min_size=1, max_size=4))
def test_no_setpoint_of_a_program_breaks_the_world(sent: list[tuple[Any, int]]) -> None:
    """Any float32, infinities and NaN too, in any mode: motion stays finite and continuous."""
    program = flying()
    program.most_acceleration, program.most_speed, program.can_tumble = 60.0, 60.0, True
    for message, kind in sent:
        program.world.commander.configure(program.mode, kind, is_applied=True)
        program.send(0.3, program.publish(message), 50)
    assert program.world.mode in EXTERNAL
    program.command(ARM_DISARM, (DISARM[0], 21196.0, *DISARM[2:]))
    program.run(1.0)
    flight = program.world.flight
    assert all(map(math.isfinite, (*flight.position, *flight.rates)))
