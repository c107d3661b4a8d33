"""Tests of what a simulated vehicle does by itself: takeoff, landing, return, and flight without a position."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.messages.commands import ACCEPTED, ARM_DISARM, TEMPORARILY_REJECTED
from msggen.messages.commands import TAKEOFF as TAKE_OFF
from msggen.messages.nav_states import (
    ALTITUDE,
    DESCEND,
    HOLD,
    LAND,
    OFFBOARD,
    POSITION,
    RETURN,
    STABILIZED,
    TAKEOFF,
    TERMINATION,
)
from msggen.sim.commander.arming import BY_LANDING
from msggen.sim.flight import NAN
from msggen.sim.parameters import PARAMETERS
from msggen.sim.world import STEP, World
from support.examples import examples
from support.sim_world import ARM, NOTHING, SECOND, TRAJECTORY, Goto, Pilot, Program, Setpoint, speed_of

meters = st.floats(-80, 80)


def there(north: float, east: float, down: float) -> Pilot:
    """Return a pilot whose vehicle hovers at a place."""
    pilot = Pilot()
    pilot.take_off()
    pilot.run(0.3, Setpoint((north, east, down)))
    assert pilot.select(OFFBOARD) == ACCEPTED
    pilot.run(2.0 + math.hypot(north, east, down) / 1.2, Setpoint((north, east, down)))
    assert math.dist(pilot.world.flight.position, (north, east, down)) < 0.5
    assert pilot.select(HOLD) == ACCEPTED
    pilot.run(2.0)
    return pilot


# Takeoff


@settings(max_examples=examples(6))
@given(st.one_of(st.just(NAN), st.floats(2, 30)))
def test_a_takeoff_spools_up_and_ends_near_its_height(height: float) -> None:
    pilot = Pilot()
    pilot.run(0.5)
    pilot.command(ARM_DISARM, ARM)
    pilot.command(TAKE_OFF, (*NOTHING[:6], pilot.world.place.altitude + height))
    assert pilot.until(lambda: not pilot.world.is_landed) == pytest.approx(1.7, abs=0.2)
    assert pilot.until(lambda: not pilot.world.flight.is_on_ground) == pytest.approx(1.7, abs=0.2)
    goal = 2.5 if math.isnan(height) else height
    pilot.until(lambda: pilot.world.mode == HOLD)
    assert -pilot.world.flight.position[2] == pytest.approx(goal - 0.8, abs=0.1)
    assert pilot.world.commander.completed[-1] == TAKEOFF
    pilot.run(6.0)
    assert -pilot.world.flight.position[2] == pytest.approx(goal, abs=0.1)


def test_a_takeoff_in_flight_climbs_by_as_much_again() -> None:
    pilot = there(3.0, 0.0, -7.0)
    assert pilot.command(TAKE_OFF) == ACCEPTED
    pilot.until(lambda: pilot.world.mode == HOLD)
    pilot.run(6.0)
    assert pilot.world.flight.position == pytest.approx((3.0, 0.0, -9.5), abs=0.15)


def test_a_takeoff_that_is_broken_off_leaves_the_vehicle_on_the_ground() -> None:
    pilot = Pilot()
    pilot.command(ARM_DISARM, ARM)
    pilot.command(TAKE_OFF)
    pilot.run(2.5)
    assert not pilot.world.is_landed
    assert pilot.select(HOLD) == ACCEPTED
    pilot.run(5.0)
    assert pilot.world.is_landed
    assert pilot.world.flight.position == (0.0, 0.0, 0.0)


# Landing


def test_a_landing_has_stages() -> None:
    pilot = there(2.0, 1.0, -4.0)
    landing = pilot.world.landing
    assert pilot.select(LAND) == ACCEPTED
    pilot.until(lambda: pilot.world.flight.is_on_ground)
    stages = [(landing.ground_contact, landing.maybe_landed, landing.landed)]
    times = [0.0]
    while not landing.landed:
        pilot.run(STEP / SECOND)
        stage = (landing.ground_contact, landing.maybe_landed, landing.landed)
        times[-1] += STEP / SECOND
        if stage != stages[-1]:
            stages.append(stage)
            times.append(0.0)
    assert stages == [(False, False, False), (True, False, False), (True, True, False), (True, True, True)]
    assert times[:3] == pytest.approx([0.33, 0.58, 0.33], abs=0.02)
    pilot.run(0.02)
    assert pilot.world.commander.completed[-1] == LAND
    assert pilot.until(lambda: not pilot.world.is_armed) == pytest.approx(2.0, abs=0.03)
    assert pilot.world.commander.disarming_reason == BY_LANDING


def test_a_vehicle_that_is_sent_sideways_stands_on_the_ground_and_has_not_landed() -> None:
    """As PX4: the ground stops it, and while no setpoint leads down, the motors carry it."""
    program = Program()
    program.take_off()
    program.enter(TRAJECTORY)
    flight, landing = program.world.flight, program.world.landing
    while not flight.is_on_ground:
        program.send(0.1, program.publish(Setpoint(velocity=(1.0, 0.0, 0.7))), 30)
    place = flight.position
    program.send(5.0, program.publish(Setpoint(velocity=(15.0, 0.0, 0.0))), 30)
    assert flight.position == place
    assert speed_of(program) == 0.0
    assert not landing.ground_contact
    program.send(2.0, program.publish(Setpoint(velocity=(15.0, 0.0, 0.4))), 30)
    assert landing.landed


@settings(max_examples=examples(6))
@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-25, -2))
def test_a_return_leads_home_at_a_height_that_depends_on_the_distance(north: float, east: float, down: float) -> None:
    pilot = there(north, east, down)
    distance = math.hypot(*pilot.world.flight.position[:2])
    before = -pilot.world.flight.position[2]
    height = 2 * distance if distance <= 10 else PARAMETERS["RTL_RETURN_ALT"]
    assert pilot.select(RETURN) == ACCEPTED
    highest, far_and_low = 0.0, False
    while not pilot.world.is_landed:
        pilot.run(0.1)
        highest = max(highest, -pilot.world.flight.position[2])
        far_and_low |= highest < max(before, height) - 1 and abs(speed_of(pilot)) > 1
    assert highest == pytest.approx(max(before, height), abs=0.3)
    assert not far_and_low, "it climbs before it goes home"
    assert pilot.world.flight.position == pytest.approx((0, 0, 0), abs=0.6)
    pilot.run(0.1)
    assert pilot.world.commander.completed[-1] == RETURN
    pilot.run(2.1)
    assert not pilot.world.is_armed


def test_parameters_of_a_return_count() -> None:
    pilot = Pilot(World(parameters={**PARAMETERS, "RTL_RETURN_ALT": 25.0}))
    pilot.take_off()
    pilot.run(0.3, Setpoint((30.0, 0.0, -5.0)))
    assert pilot.select(OFFBOARD) == ACCEPTED
    pilot.run(10.0, Setpoint((30.0, 0.0, -5.0)))
    assert pilot.select(RETURN) == ACCEPTED
    pilot.run(14.0)
    assert -pilot.world.flight.position[2] == pytest.approx(25.0, abs=0.3)


def test_hold_brakes_and_does_not_come_back() -> None:
    program = Program()
    program.take_off()
    program.enter()
    program.send(5.0, program.publish(Goto((100.0, 0.0, -2.5))), 30)
    assert speed_of(program) > 4.5
    assert program.select(HOLD) == ACCEPTED
    furthest = 0.0
    for _ in range(80):
        program.run(0.1)
        furthest = max(furthest, program.world.flight.position[0])
    assert speed_of(program) < 0.05
    assert program.world.flight.position[0] == pytest.approx(furthest, abs=0.3)


def test_termination_stops_the_motors() -> None:
    pilot = there(0.0, 0.0, -10.0)
    pilot.most_speed = 20.0
    assert pilot.select(TERMINATION) == ACCEPTED
    pilot.run(0.1)
    assert pilot.world.thrust == 0
    pilot.run(2.0)
    assert pilot.world.flight.is_on_ground


# Faults that a test switches


def test_the_position_is_lost_some_time_after_gps_and_found_again() -> None:
    pilot = there(5.0, 0.0, -15.0)
    world = pilot.world
    world.has_gps = False
    assert pilot.until(lambda: not world.has_position) == pytest.approx(5.2, abs=0.05)
    assert pilot.until(lambda: world.mode == DESCEND) < 0.15
    assert pilot.select(HOLD) == TEMPORARILY_REJECTED
    senses = world.senses
    assert (senses.local_position, senses.global_position, senses.local_alt, senses.attitude) == (
        False,
        False,
        True,
        True,
    )
    pilot.run(2.0)
    assert world.flight.velocity[2] == pytest.approx(0.7, abs=0.05)
    world.has_gps = True
    assert pilot.until(lambda: world.has_position) == pytest.approx(1.27, abs=0.05)
    pilot.until(lambda: world.mode == HOLD, 0.2)
    pilot.run(4.0)
    assert math.hypot(*world.flight.velocity) < 0.1


@pytest.mark.parametrize("mode", [ALTITUDE, STABILIZED])
def test_a_pilot_keeps_the_height_without_a_position(mode: int) -> None:
    pilot = Pilot()
    pilot.world.has_sticks = True
    pilot.run(0.1)
    pilot.take_off(8.0)
    pilot.world.has_gps = False
    assert pilot.select(mode) == ACCEPTED
    pilot.run(15.0)
    assert not pilot.world.has_position
    assert pilot.world.mode == mode
    assert pilot.world.flight.position[2] == pytest.approx(-8.0, abs=0.1)


def test_a_short_loss_of_gps_has_no_effect() -> None:
    pilot = there(0.0, 0.0, -5.0)
    for _ in range(3):
        pilot.world.has_gps = False
        pilot.run(4.5)
        pilot.world.has_gps = True
        pilot.run(0.5)
    assert pilot.world.mode == HOLD
    assert pilot.world.has_position


def test_a_descent_without_a_position_ends_landed_and_disarmed() -> None:
    pilot = there(0.0, 0.0, -4.0)
    pilot.world.has_gps = False
    pilot.until(lambda: not pilot.world.is_armed)
    assert pilot.world.commander.disarming_reason == BY_LANDING


def test_a_mode_without_requirements_lands_blindly() -> None:
    """As in a captured flight: it stays selected, and drag alone brakes the vehicle."""
    program = Program(needs=frozenset())
    program.take_off(10.0)
    program.enter()
    publish = program.publish(Goto((500.0, 0.0, -10.0)))
    program.send(5.0, publish, 30)
    program.world.has_gps = False
    program.send(5.1, publish, 30)
    assert speed_of(program) == pytest.approx(5.0, abs=0.1)
    program.send(1.1, publish, 30)
    assert speed_of(program) == pytest.approx(5.0 * math.exp(-1.0), abs=0.5)
    program.send(18.0, publish, 30)
    assert program.world.flight.is_on_ground
    assert not program.world.is_landed, "as in Land, each goto begins the detection anew"
    assert program.world.mode == program.mode


def test_a_world_without_gps_has_neither_position_nor_home_until_it_comes() -> None:
    pilot = Pilot(World(has_position=False))
    pilot.run(1.0)
    assert pilot.command(ARM_DISARM, ARM) == TEMPORARILY_REJECTED
    assert not pilot.world.senses.home_position
    pilot.world.has_gps = True
    pilot.run(1.5)
    assert pilot.world.senses.home_position
    assert pilot.command(ARM_DISARM, ARM) == ACCEPTED


def test_lost_sticks_and_an_empty_battery_lead_home() -> None:
    for lose in (_lose_sticks, _empty_battery):
        pilot = Pilot(World(parameters={**PARAMETERS, "COM_LOW_BAT_ACT": 3.0}))
        pilot.world.has_sticks = True
        pilot.run(0.1)
        pilot.take_off()
        assert pilot.select(POSITION) == ACCEPTED
        lose(pilot.world)
        pilot.run(0.2)
        assert pilot.world.mode == HOLD, "for COM_FAIL_ACT_T"
        pilot.run(5.1)
        assert pilot.world.mode == RETURN


def _lose_sticks(world: World) -> None:
    world.has_sticks = False


def _empty_battery(world: World) -> None:
    world.battery.remaining = 0.06


@given(st.floats(0, 1))
def test_the_charge_of_the_battery_can_be_set(share: float) -> None:
    world = World()
    world.battery.remaining = share
    assert world.battery.remaining == pytest.approx(share, abs=1e-9)
    world.advance(SECOND)
    assert world.senses.battery == sum(world.battery.remaining < limit for limit in (0.15, 0.07, 0.05))


def test_a_ground_station_can_come_and_go() -> None:
    world = World()
    for is_there in (True, False):
        world.has_ground_station = is_there
        world.advance(world.time + SECOND)
        assert world.commander.senses.ground_station is is_there
