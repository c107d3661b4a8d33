"""Tests of simulated rovers."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.messages.commands import ACCEPTED, ARM_DISARM, REPOSITION, TAKEOFF
from msggen.messages.nav_states import HOLD, LAND, OFFBOARD, RETURN
from msggen.sim.commander.arming import BY_LANDING
from msggen.sim.flight import NAN
from support.examples import examples
from support.sim_world import (
    ARM,
    Program,
    RoverPosition,
    Setpoint,
    Speed,
    Steering,
    Throttle,
    Yaw,
    YawRate,
    speed_of,
    world_of,
)

ROVERS = ["rover", "differential"]
POSITION, SPEED_YAW, SPEED_RATE, SPEED_STEERING, THROTTLE_YAW, THROTTLE_RATE, THROTTLE_STEERING = range(7, 14)


def driving(vehicle: str, kind: int) -> Program:
    """Return a program whose mode drives a rover."""
    program = Program(world_of(vehicle))
    program.command(ARM_DISARM, ARM)
    program.enter(kind)
    program.run(0.1)
    return program


def yaw_of(program: Program) -> float:
    return math.degrees(math.remainder(program.world.flight.yaw, math.tau))


@settings(max_examples=examples(8))
@given(st.sampled_from(ROVERS), st.floats(-15, 15), st.floats(-15, 15))
def test_a_position_is_reached_and_held(vehicle: str, north: float, east: float) -> None:
    program = driving(vehicle, POSITION)
    program.publish_all(3.0, RoverPosition((north, east)))
    program.run(20.0)
    assert math.dist(program.world.flight.position[:2], (north, east)) < 0.6
    assert speed_of(program) == 0.0


def test_a_position_20_m_ahead_takes_as_long_as_captured() -> None:
    program = driving("rover", POSITION)
    program.publish(RoverPosition((20.0, 0.0)))(program.world.time)
    assert program.until(lambda: program.world.flight.position[0] > 19.5) == pytest.approx(7.6, abs=0.5)


@pytest.mark.parametrize("vehicle", ROVERS)
def test_a_speed_and_a_turn_are_driven(vehicle: str) -> None:
    program = driving(vehicle, SPEED_YAW)
    program.publish_all(4.0, Speed(2.0), Yaw(math.pi / 2))
    assert (speed_of(program), yaw_of(program)) == pytest.approx((2.0, 90.0), abs=0.5)
    program.world.commander.configure(program.mode, SPEED_RATE, is_applied=True)
    program.publish_all(2.0, Speed(1.0), YawRate(0.5))
    assert program.world.flight.rates[2] == pytest.approx(0.5, abs=0.02)
    assert speed_of(program) == pytest.approx(1.0, abs=0.05)
    program.world.commander.configure(program.mode, SPEED_STEERING, is_applied=True)
    program.publish_all(2.0, Speed(1.0), Steering(-1.0))
    expected = -math.tan(0.5236) / 0.321 if vehicle == "rover" else -math.radians(180.0)
    assert program.world.flight.rates[2] == pytest.approx(expected, rel=0.05)


def test_a_throttle_is_a_share_of_the_full_speed() -> None:
    program = driving("rover", THROTTLE_STEERING)
    program.publish_all(4.0, Throttle(0.2), Steering(0.0))
    assert speed_of(program) == pytest.approx(0.64, abs=0.02)
    program.publish_all(4.0, Throttle(-0.5), Steering(0.0))
    assert speed_of(program) == pytest.approx(1.6, abs=0.05)
    assert program.world.flight.velocity[0] < 0.0


def test_the_speed_stays_when_the_kind_changes_until_one_nan_is_sent() -> None:
    program = driving("rover", SPEED_YAW)
    program.publish_all(3.0, Speed(2.0), Yaw(0.0))
    program.world.commander.configure(program.mode, THROTTLE_YAW, is_applied=True)
    program.publish_all(4.0, Throttle(0.2), Yaw(0.0))
    assert speed_of(program) == pytest.approx(2.0, abs=0.05)
    program.publish(Speed(NAN))(program.world.time)
    program.publish_all(4.0, Throttle(0.2), Yaw(0.0))
    assert speed_of(program) == pytest.approx(0.64, abs=0.05)


def test_setpoints_are_used_for_ever_and_cleared_when_controls_change() -> None:
    program = driving("rover", SPEED_YAW)
    program.publish_all(3.0, Speed(2.0), Yaw(0.0))
    program.run(10.0)
    assert speed_of(program) == pytest.approx(2.0, abs=0.05)
    program.world.commander.configure(program.mode, SPEED_STEERING, is_applied=True)
    program.run(0.1)
    assert speed_of(program) == pytest.approx(2.0, abs=0.05), "nobody writes, so the motors keep their value"
    program.publish_all(3.0, Speed(0.0), Steering(0.0))
    assert speed_of(program) == 0.0


def test_a_trajectory_does_not_move_a_rover() -> None:
    program = driving("rover", SPEED_RATE)
    program.publish_all(3.0, Speed(1.0), YawRate(0.0))
    program.world.commander.configure(program.mode, 4, is_applied=True)
    program.publish_all(3.0, Setpoint(position=(-20.0, 0.0, 0.0)))
    assert program.world.flight.velocity[0] == pytest.approx(1.0, abs=0.05)


def test_land_counts_as_landed_while_the_rover_drives_on() -> None:
    """As captured from PX4: landed at once, and disarmed 2 s later, still rolling."""
    program = driving("rover", POSITION)
    program.publish_all(3.0, RoverPosition((60.0, 0.0)))
    assert not program.world.is_landed
    assert program.select(LAND) == ACCEPTED
    assert program.world.is_landed
    assert speed_of(program) > 2.5
    assert program.until(lambda: not program.world.is_armed) == pytest.approx(2.0, abs=0.1)
    assert program.world.commander.disarming_reason == BY_LANDING
    assert speed_of(program) > 2.5
    assert program.world.commander.mode in {program.mode, LAND}


@pytest.mark.parametrize("vehicle", ROVERS)
def test_hold_stops_and_a_return_drives_home(vehicle: str) -> None:
    program = driving(vehicle, SPEED_YAW)
    program.publish_all(6.0, Speed(2.0), Yaw(0.5))
    program.select(HOLD)
    program.run(5.0)
    assert speed_of(program) < 0.1
    assert program.select(RETURN) == ACCEPTED
    program.until(lambda: not program.world.is_armed)
    assert math.hypot(*program.world.flight.position[:2]) < 1.0


def test_a_takeoff_moves_nothing_and_offboard_drives() -> None:
    program = Program(world_of("rover"))
    program.command(ARM_DISARM, ARM)
    program.command(TAKEOFF)
    program.run(3.0)
    assert program.world.flight.position == (0.0, 0.0, 0.0)
    program.run(0.3, Setpoint(position=(5.0, 3.0, 0.0)))
    assert program.select(OFFBOARD) == ACCEPTED
    program.run(12.0, Setpoint(position=(5.0, 3.0, 0.0)))
    assert math.dist(program.world.flight.position[:2], (5.0, 3.0)) < 0.6
    program.run(3.0, Setpoint(velocity=(0.0, -1.0, 0.0)))
    assert program.world.flight.velocity[1] == pytest.approx(-1.0, abs=0.1)


def test_a_reposition_drives_to_a_place() -> None:
    program = driving("rover", POSITION)
    place = program.world.origin.place((10.0, -4.0, 0.0))
    parameters = (NAN, 1.0, NAN, NAN, place.latitude, place.longitude, NAN)
    assert program.command(REPOSITION, parameters) == ACCEPTED
    program.run(12.0)
    assert math.dist(program.world.flight.position[:2], (10.0, -4.0)) < 0.6


numbers = st.floats(width=32)
messages = st.one_of(
    st.builds(RoverPosition, st.tuples(numbers, numbers), numbers, numbers),
    *[st.builds(kind, numbers) for kind in (Speed, Throttle, Yaw, YawRate, Steering)],
    st.builds(Setpoint, *[st.tuples(*[numbers] * 3)] * 3, numbers, numbers),
)


@settings(max_examples=examples(30))
@given(st.sampled_from(ROVERS), st.lists(st.tuples(messages, st.sampled_from([1, 4, *range(7, 14)])), max_size=5))
def test_no_setpoint_breaks_the_world(vehicle: str, sent: list[tuple[Any, int]]) -> None:
    program = driving(vehicle, POSITION)
    program.most_acceleration = math.inf
    for message, kind in sent:
        program.world.commander.configure(program.mode, kind, is_applied=True)
        program.send(0.3, program.publish(message), 50.0)
    flight = program.world.flight
    assert all(map(math.isfinite, (*flight.position, *flight.velocity, *flight.rates)))
    assert speed_of(program) <= 3.3
    assert flight.position[2] == 0.0


def test_nothing_disarms_a_rover_before_it_drives() -> None:
    program = driving("rover", POSITION)
    program.run(30.0)
    assert program.world.is_armed
