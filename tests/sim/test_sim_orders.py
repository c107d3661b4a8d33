"""Tests of commands that select modes and places of a simulated vehicle."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.messages.commands import (
    ACCEPTED,
    DENIED,
    REPOSITION,
    SET_HOME,
    SET_MODE,
    SET_NAV_STATE,
    SET_ORIGIN,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
)
from msggen.messages.nav_states import (
    ALTITUDE,
    DESCEND,
    EXTERNAL,
    HOLD,
    LAND,
    MANUAL,
    MISSION,
    OFFBOARD,
    POSITION,
    RETURN,
    STABILIZED,
    TAKEOFF,
    TERMINATION,
)
from msggen.sim.flight import NAN
from msggen.sim.places import Home
from msggen.sim.world import World
from support.examples import examples
from support.sim_world import NOTHING, Pilot, Program, speed_of

SIMULATED = [MANUAL, ALTITUDE, POSITION, HOLD, RETURN, DESCEND, TERMINATION, OFFBOARD, STABILIZED, TAKEOFF, LAND]
START = Home()
meters = st.floats(-30, 30)


def at(*place: float, first: float = NAN, second: float = NAN, yaw: float = NAN) -> tuple[float, ...]:
    """Return the parameters of a command with a place."""
    return first, second, NAN, yaw, *place


@pytest.mark.parametrize("mode", [*SIMULATED, *EXTERNAL])
def test_every_simulated_mode_can_be_selected_on_the_ground(mode: int) -> None:
    world = World()
    world.advance(100_000)
    assert world.command(SET_NAV_STATE, (float(mode), *NOTHING[1:])) == ACCEPTED
    world.advance(150_000)
    assert world.mode == mode


@pytest.mark.parametrize("mode", [MISSION, 31, 255, -1, 4.5, NAN, math.inf])
def test_other_modes_are_rejected(mode: float) -> None:
    assert World().command(SET_NAV_STATE, (mode, *NOTHING[1:])) == TEMPORARILY_REJECTED


@pytest.mark.parametrize("mode", EXTERNAL)
def test_the_modes_of_programs_have_submodes(mode: int) -> None:
    world = World()
    assert world.command(SET_MODE, (1.0, 4.0, float(11 + mode - EXTERNAL[0]), *NOTHING[3:])) == ACCEPTED
    world.advance(50_000)
    assert world.mode == mode


@given(
    st.integers(0, 2**32 - 1).filter(lambda number: number not in {20, 21, 22, 176, 179, 192, 400, 100_000, 100_001})
)
def test_unknown_commands_are_unsupported(number: int) -> None:
    assert World().command(number, NOTHING) == UNSUPPORTED


@settings(max_examples=examples(6))
@given(meters, meters, st.floats(2, 20), st.floats(-3, 3))
def test_a_reposition_leads_to_a_place_and_holds_there(north: float, east: float, up: float, yaw: float) -> None:
    pilot = Pilot()
    pilot.take_off()
    place = START.place((north, east, -up))
    assert pilot.command(REPOSITION, at(*place, second=1.0, yaw=yaw)) == ACCEPTED
    pilot.run(30.0)
    flight = pilot.world.flight
    assert pilot.world.mode == HOLD
    assert flight.position == pytest.approx((north, east, -up), abs=0.1)
    assert flight.heading == pytest.approx(yaw, abs=0.02)
    assert (pilot.world.place.latitude, pilot.world.place.longitude) == pytest.approx(place[:2], abs=2e-6)


def test_a_reposition_keeps_what_it_does_not_tell_and_has_a_speed() -> None:
    pilot = Pilot()
    pilot.take_off()
    height = pilot.world.flight.position[2]
    north = START.place((50.0, 0.0, 0.0))
    assert pilot.command(REPOSITION, at(north.latitude, north.longitude, NAN, first=2.0, second=1.0)) == ACCEPTED
    pilot.run(5.0)
    assert speed_of(pilot) == pytest.approx(2.0, abs=0.05)
    assert pilot.world.flight.position[1:] == pytest.approx((0.0, height), abs=0.1)


def test_a_reposition_takes_over_from_the_mode_of_a_program() -> None:
    program = Program()
    program.take_off()
    program.enter()
    assert program.command(REPOSITION, at(*START.place((4.0, 0.0, -5.0)), second=1.0)) == ACCEPTED
    program.run(8.0)
    assert program.world.mode == HOLD
    assert program.world.flight.position == pytest.approx((4.0, 0.0, -5.0), abs=0.1)


@pytest.mark.parametrize("flags", [NAN, 0.0, 2.0, 3.0])
def test_a_reposition_that_does_not_ask_for_hold_is_unsupported(flags: float) -> None:
    assert World().command(REPOSITION, at(*START, second=flags)) == UNSUPPORTED


@pytest.mark.parametrize(("home", "end"), [((20.0, 5.0, 0.0), (20.0, 5.0)), (None, (8.0, -6.0))])
def test_a_return_ends_at_the_home_that_was_set(
    home: tuple[float, float, float] | None, end: tuple[float, float]
) -> None:
    pilot = Pilot()
    pilot.take_off()
    if home is None:
        pilot.command(REPOSITION, at(*START.place((8.0, -6.0, -5.0)), second=1.0))
        pilot.run(12.0)
        assert pilot.command(SET_HOME, (1.0, *NOTHING[1:])) == ACCEPTED
        assert pilot.world.home == pytest.approx(pilot.world.place, abs=1e-6)
    else:
        assert pilot.command(SET_HOME, at(*START.place(home), first=0.0)) == ACCEPTED
    assert pilot.select(RETURN) == ACCEPTED
    pilot.until(lambda: not pilot.world.is_armed, 180)
    assert pilot.world.flight.position[:2] == pytest.approx(end, abs=0.6)


@pytest.mark.parametrize("is_manual", [False, True])
def test_home_is_where_the_vehicle_takes_off_unless_a_place_was_set(*, is_manual: bool) -> None:
    pilot = Pilot()
    pilot.take_off()
    assert pilot.world.home == pytest.approx(START, abs=0.01)
    assert pilot.command(REPOSITION, at(*START.place((8.0, -6.0, -5.0)), second=1.0)) == ACCEPTED
    pilot.run(12.0)
    if is_manual:
        assert pilot.command(SET_HOME, at(*START.place((3.0, 0.0, 0.0)), first=0.0)) == ACCEPTED
    assert pilot.select(LAND) == ACCEPTED
    pilot.until(lambda: pilot.world.is_landed)
    assert pilot.world.origin.local(pilot.world.home)[0] == pytest.approx(3.0 if is_manual else 0.0, abs=0.01)
    pilot.until(lambda: not pilot.world.is_armed)
    pilot.run(0.1)
    expected = (3.0, 0.0) if is_manual else (8.0, -6.0)
    assert pilot.world.origin.local(pilot.world.home)[:2] == pytest.approx(expected, abs=0.3)
    pilot.take_off()
    assert pilot.world.origin.local(pilot.world.home)[:2] == pytest.approx(expected, abs=0.3)


def test_home_needs_a_position_and_a_place() -> None:
    world = World(has_position=False)
    assert world.command(SET_HOME, (1.0, *NOTHING[1:])) == TEMPORARILY_REJECTED
    for place in ((NAN, 8.0, 400.0), (91.0, 8.0, 400.0), (47.0, 181.0, 400.0), (47.0, 8.0, math.inf)):
        assert World().command(SET_HOME, at(*place, first=0.0)) == DENIED
        assert World().command(SET_ORIGIN, at(*place)) == DENIED
    assert world.home == START


@settings(max_examples=examples(6))
@given(meters, meters, meters)
def test_another_origin_moves_the_local_position_and_not_the_vehicle(north: float, east: float, down: float) -> None:
    pilot = Pilot()
    pilot.take_off()
    world = pilot.world
    before, local = world.place, world.flight.position
    assert world.command(SET_ORIGIN, at(*START.place((north, east, down)))) == ACCEPTED
    assert world.place == pytest.approx(before, abs=1e-6)
    moved = [here - shift for here, shift in zip(local, (north, east, down), strict=True)]
    assert world.flight.position == pytest.approx(moved, abs=0.01)
    pilot.before = pilot.state()
    pilot.run(2.0)
    assert world.flight.position == pytest.approx(moved, abs=0.1)
    pilot.land()
    assert world.place.altitude == pytest.approx(START.altitude, abs=0.01)
