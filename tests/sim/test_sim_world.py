"""Tests of the simulated world: it flies as a vehicle could, in NED, and obeys commands as PX4 does."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.messages.commands import (
    ACCEPTED,
    ARM_DISARM,
    DENIED,
    LAND,
    SET_MODE,
    TAKEOFF,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
)
from msggen.messages.nav_states import HOLD, OFFBOARD, POSITION, RETURN
from msggen.messages.nav_states import LAND as LANDING
from msggen.messages.nav_states import TAKEOFF as TAKING_OFF
from msggen.sim.flight import NAN, Flight, Target, wrapped
from msggen.sim.places import Home
from msggen.sim.world import STEP, World
from support.examples import examples
from support.sim_world import ARM, DISARM, NOTHING, SECOND, Controls, Pilot, Setpoint

TO_OFFBOARD = (1.0, 6.0, *NOTHING[2:])


def test_it_takes_off_flies_a_square_and_lands() -> None:
    pilot = Pilot()
    world = pilot.world
    pilot.take_off()
    completed = [*world.commander.completed]
    assert world.mode == HOLD
    assert world.flight.position == pytest.approx((0, 0, -2.5), abs=0.1)
    corners = [(5.0, 0.0, -5.0), (5.0, 5.0, -5.0), (0.0, 5.0, -5.0), (0.0, 0.0, -5.0)]
    pilot.run(0.5, Setpoint(corners[0]))
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    for corner in corners:
        pilot.run(8.0, Setpoint(corner, yaw=1.0))
        assert world.flight.position == pytest.approx(corner, abs=0.1)
        assert world.mode == OFFBOARD
    assert world.flight.heading == pytest.approx(1.0, abs=0.01)
    assert pilot.command(LAND) == ACCEPTED
    pilot.run(15.0)
    completed += world.commander.completed
    assert not world.is_armed
    assert world.is_landed
    assert world.flight.position == pytest.approx((0, 0, 0), abs=0.1)
    assert [*dict.fromkeys(completed)] == [TAKING_OFF, LANDING]
    assert world.commander.disarming_reason == 6, "ARM_DISARM_REASON_LANDING"


def test_north_east_and_down_have_their_signs() -> None:
    pilot = Pilot()
    pilot.take_off()
    place = pilot.world.flight.position
    pilot.run(0.3, Setpoint(velocity=(2.0, 1.0, -0.5)), Controls(position=False, velocity=True))
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    pilot.run(4.0, Setpoint(velocity=(2.0, 1.0, -0.5)), Controls(position=False, velocity=True))
    world = pilot.world
    assert world.flight.velocity == pytest.approx((2.0, 1.0, -0.5), abs=0.05)
    assert world.flight.position[0] > place[0] + 5
    assert world.place.latitude > world.home.latitude
    assert world.place.longitude > world.home.longitude
    assert world.place.altitude > world.home.altitude + 2.5


def test_it_leans_forward_to_fly_forward() -> None:
    flight = Flight()
    for _ in range(100):
        flight.step(0.004, Target(velocity=(3.0, 0.0, -1.0), yaw=0.0))
    assert flight.pitch < -0.05
    assert abs(flight.roll) < 1e-9


def test_the_angular_velocity_is_that_of_the_quaternion() -> None:
    """By small steps: the product of a quaternion and half its angular velocity is its derivative."""
    flight = Flight()
    target = Target(position=(20.0, -10.0, -20.0), yaw=2.0)
    seconds = 1e-4
    for number in range(30_000):
        w, x, y, z = flight.quaternion
        flight.step(seconds, target)
        p, q, r = flight.rates
        if number % 500 or number < 5000:
            continue
        derivative = (-x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p)
        found = [(after - before) / seconds for after, before in zip(flight.quaternion, (w, x, y, z), strict=True)]
        assert found == pytest.approx([each / 2 for each in derivative], abs=2e-3)


def test_a_world_does_not_depend_on_how_often_it_is_asked() -> None:
    worlds = World(), World()
    for world in worlds:
        world.command(ARM_DISARM, ARM)
        world.command(TAKEOFF, NOTHING)
    worlds[0].advance(5 * SECOND)
    for time in range(0, 5 * SECOND + 1, 777):
        worlds[1].advance(time)
    worlds[1].advance(5 * SECOND)
    assert worlds[0].flight.position == worlds[1].flight.position
    assert worlds[0].battery.discharged == worlds[1].battery.discharged


def test_a_long_pause_is_not_flown() -> None:
    world = World()
    world.advance(10**12)
    assert 10**12 - world.time < STEP


def test_offboard_mode_needs_a_heartbeat_to_arm_and_to_be_entered_in_flight() -> None:
    """Disarmed, PX4 lets all modes be selected."""
    pilot = Pilot()
    pilot.world.advance(SECOND)
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    assert pilot.command(ARM_DISARM, ARM) == TEMPORARILY_REJECTED
    pilot.world.setpoints.take_offboard(Controls(), pilot.world.time)
    pilot.run(0.1)
    assert pilot.command(ARM_DISARM, ARM) == TEMPORARILY_REJECTED, "one message is no rate"
    pilot.run(0.3, Setpoint((0.0, 0.0, -3.0)))
    assert pilot.command(ARM_DISARM, ARM) == ACCEPTED
    pilot.command(ARM_DISARM, DISARM)
    pilot.command(SET_MODE, (1.0, 4.0, 3.0, *NOTHING[3:]))
    pilot.take_off()
    assert pilot.command(SET_MODE, TO_OFFBOARD) == TEMPORARILY_REJECTED
    pilot.run(0.3, Setpoint((0.0, 0.0, -3.0)))
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED


def test_offboard_mode_lifts_the_vehicle_off_the_ground() -> None:
    pilot = Pilot()
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    pilot.run(0.5, Setpoint((0.0, 0.0, -3.0)))
    assert pilot.command(ARM_DISARM, ARM) == ACCEPTED
    pilot.run(10.0, Setpoint((0.0, 0.0, -3.0)))
    assert pilot.world.flight.position == pytest.approx((0, 0, -3), abs=0.1)


def test_a_heartbeat_with_an_old_time_does_not_count() -> None:
    pilot = Pilot()
    pilot.take_off()
    for number in range(5):
        pilot.world.setpoints.take_offboard(Controls(), number * 1000)
    pilot.run(0.1)
    assert pilot.command(SET_MODE, TO_OFFBOARD) == TEMPORARILY_REJECTED


def test_it_returns_when_the_heartbeat_is_lost() -> None:
    """PX4 falls back to a return if no pilot has sticks."""
    pilot = Pilot()
    pilot.take_off()
    pilot.run(0.3, Setpoint((0.0, 0.0, -4.0)))
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    pilot.run(3.0, Setpoint((0.0, 0.0, -4.0)))
    pilot.run(0.85)
    assert pilot.world.mode == OFFBOARD
    pilot.run(0.2)
    commander = pilot.world.commander
    assert (pilot.world.mode, commander.failsafe.is_active, commander.intention) == (RETURN, True, OFFBOARD)
    pilot.run(15.0)
    assert pilot.world.is_landed
    assert not pilot.world.is_armed
    assert not commander.failsafe.is_active


@pytest.mark.parametrize(
    ("number", "parameters", "result"),
    [
        (ARM_DISARM, (2.0, *NOTHING[1:]), DENIED),
        (ARM_DISARM, NOTHING, DENIED),
        (ARM_DISARM, DISARM, ACCEPTED),
        (SET_MODE, (1.0, 3.0, *NOTHING[2:]), ACCEPTED),
        (SET_MODE, (0.0, 3.0, *NOTHING[2:]), DENIED),
        (SET_MODE, (1.0, 4.0, 3.0, *NOTHING[3:]), ACCEPTED),
        (SET_MODE, (1.0, 4.0, 5.0, *NOTHING[3:]), ACCEPTED),
        (SET_MODE, (1.0, 4.0, 4.0, *NOTHING[3:]), DENIED),
        (SET_MODE, (1.0, math.inf, *NOTHING[2:]), DENIED),
        (SET_MODE, NOTHING, DENIED),
        (LAND, NOTHING, ACCEPTED),
        (TAKEOFF, (*NOTHING[:6], 400.0), ACCEPTED),
        (TAKEOFF, (*NOTHING[:6], 500.0), ACCEPTED),
        (16, NOTHING, UNSUPPORTED),
        (2**32 - 1, NOTHING, UNSUPPORTED),
    ],
)
def test_the_results_of_commands_on_the_ground(number: int, parameters: tuple[float, ...], result: int) -> None:
    assert World().command(number, parameters) == result


def test_it_disarms_in_the_air_only_by_force() -> None:
    pilot = Pilot()
    pilot.take_off()
    assert pilot.command(ARM_DISARM, DISARM) == TEMPORARILY_REJECTED
    assert pilot.world.is_armed
    assert pilot.command(ARM_DISARM, (0.0, 21196.0, *NOTHING[2:])) == ACCEPTED
    pilot.world.advance(pilot.world.time + 2 * SECOND)
    assert pilot.world.is_landed


def test_it_disarms_if_it_does_not_take_off() -> None:
    pilot = Pilot()
    pilot.command(ARM_DISARM, ARM)
    pilot.run(10.9)  # COM_DISARM_PRFLT and 1 s, as measured
    assert pilot.world.is_armed
    pilot.run(0.2)
    assert not pilot.world.is_armed
    assert pilot.world.why_disarmed == "no takeoff within 10 s"
    pilot.command(ARM_DISARM, ARM)
    pilot.command(ARM_DISARM, DISARM)
    assert (pilot.world.is_armed, pilot.world.why_disarmed) == (False, "")


def test_a_take_off_waits_for_arming() -> None:
    pilot = Pilot()
    assert pilot.command(TAKEOFF, (*NOTHING[:6], Home().altitude + 10.0)) == ACCEPTED
    pilot.run(1.0)
    assert pilot.world.is_landed
    pilot.command(ARM_DISARM, ARM)
    pilot.run(16.0)
    assert pilot.world.place.altitude == pytest.approx(Home().altitude + 10.0, abs=0.1)


def test_the_battery_drains_faster_in_the_air() -> None:
    pilot = Pilot()
    pilot.run(5.0)
    on_ground = pilot.world.battery.discharged
    pilot.take_off()
    assert pilot.world.battery.discharged > 5 * on_ground > 0
    assert 0 < pilot.world.battery.remaining < 1
    assert 12 < pilot.world.battery.voltage < 16.8


def test_position_mode_with_sticks_at_rest_holds_its_place() -> None:
    pilot = Pilot()
    pilot.world.has_sticks = True
    pilot.take_off()
    pilot.command(SET_MODE, (1.0, 3.0, *NOTHING[2:]))
    assert pilot.world.mode == POSITION
    before = pilot.world.flight.position
    pilot.run(3.0)
    assert pilot.world.flight.position == pytest.approx(before, abs=0.2)


@pytest.mark.parametrize("axis", [0, 1])
def test_the_speed_of_one_axis_has_the_limit_of_both(axis: int) -> None:
    """Also if the other axis is not controlled."""
    flight = Flight()
    goal = (1e4, NAN, -10.0) if axis == 0 else (NAN, 1e4, -10.0)
    for _ in range(round(20 * SECOND / STEP)):
        flight.step(STEP / SECOND, Target(position=goal))
    assert 11.5 < flight.velocity[axis] <= 12.0


numbers = st.floats(width=32)
vectors = st.tuples(numbers, numbers, numbers)


@settings(max_examples=examples(40))
@given(
    st.builds(Setpoint, vectors, vectors, vectors, numbers, numbers),
    st.builds(Controls, st.booleans(), st.booleans(), st.booleans()),
)
def test_no_setpoint_breaks_the_world(setpoint: Setpoint, controls: Controls) -> None:
    """Any float32, infinities and NaN too: motion stays finite and continuous."""
    pilot = Pilot()
    pilot.command(ARM_DISARM, ARM)
    pilot.run(0.1)
    for time in (1, 2):
        pilot.world.setpoints.take_offboard(controls, time)
    pilot.run(0.12)  # the commander looks every 0.1 s
    assert pilot.command(SET_MODE, TO_OFFBOARD) == ACCEPTED
    pilot.run(4.0, setpoint, controls)
    assert all(map(math.isfinite, (*pilot.world.flight.position, *pilot.world.flight.rates)))


@settings(max_examples=examples(40))
@given(st.lists(st.tuples(st.sampled_from([ARM_DISARM, SET_MODE, TAKEOFF, LAND, 5]), st.tuples(*[numbers] * 7))))
def test_no_commands_break_the_world(commands: list[tuple[int, tuple[float, ...]]]) -> None:
    pilot = Pilot()
    for number, parameters in commands:
        assert pilot.command(number, parameters) in {ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED}
        pilot.run(0.02)


@pytest.mark.parametrize("angle", [0.0, 3.0, -3.0, 3.2, -3.2, 100.0])
def test_angles_are_wrapped(angle: float) -> None:
    assert -math.pi <= wrapped(angle) <= math.pi
    assert math.cos(wrapped(angle)) == pytest.approx(math.cos(angle))
    assert math.sin(wrapped(angle)) == pytest.approx(math.sin(angle))
