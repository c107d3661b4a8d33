"""Tests of simulated planes, VTOLs and tailsitters."""

from __future__ import annotations

import copy
import math
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.messages import setpoints
from msggen.messages.commands import (
    ACCEPTED,
    ARM_DISARM,
    TAKEOFF,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    VTOL_TAKEOFF,
    VTOL_TRANSITION,
)
from msggen.messages.nav_states import DESCEND, HOLD, LAND, RETURN
from msggen.messages.nav_states import VTOL_TAKEOFF as TO_FORWARD
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, VtolState
from msggen.sim.attitude import quaternion_of
from msggen.sim.commander.arming import BY_FAILSAFE
from msggen.sim.commander.rules import V1_16, V1_18
from msggen.sim.flight import GRAVITY, NAN, ZERO
from msggen.sim.vtol_pilot import VtolPilot
from msggen.sim.wings import MAX_LATERAL, Wings
from support.examples import by_day, examples
from support.sim_world import (
    ARM,
    ATTITUDE,
    NOTHING,
    RATES,
    SECOND,
    TRAJECTORY,
    Attitude,
    Lateral,
    LateralLimits,
    Longitudinal,
    LongitudinalLimits,
    Pilot,
    Program,
    Rates,
    Setpoint,
    speed_of,
    world_of,
)

WINGS = setpoints.FIXED_WING.number
FORWARD, BACK = (4.0, *NOTHING[1:]), (3.0, *NOTHING[1:])
LEVEL = Setpoint(velocity=(NAN, NAN, 0.0), acceleration=(0.0, 0.0, NAN))


@cache
def _flying(vehicle: str, wind: float) -> Program:
    program = Program(world_of(vehicle, {"SIH_WIND_N": wind, "MIS_TAKEOFF_ALT": 40.0}))
    program.command(ARM_DISARM, ARM)
    program.command(TAKEOFF)
    program.until(lambda: program.world.mode == HOLD, 80.0)
    program.run(1.0)
    return program


def flying(vehicle: str = "plane", wind: float = 0.0) -> Program:
    """Return a program whose vehicle is in the air, in Hold."""
    return copy.deepcopy(_flying(vehicle, wind))


def wings_of(pilot: Pilot) -> Wings:
    assert isinstance(pilot.world.flight, Wings)
    return pilot.world.flight


def steer(program: Program, seconds: float, lateral: Lateral, longitudinal: Longitudinal) -> None:
    """Send the setpoints of a fixed-wing aircraft at 30 Hz."""
    program.publish_all(seconds, lateral, longitudinal)


def course_of(pilot: Pilot) -> float:
    north, east, _ = pilot.world.flight.velocity
    return math.atan2(east, north)


def error(one: float, two: float) -> float:
    return abs(math.degrees(math.remainder(one - two, math.tau)))


# Planes


def test_a_plane_takes_off_from_the_runway_and_circles() -> None:
    pilot = Pilot(world_of("plane"))
    pilot.run(0.5)
    assert pilot.command(TAKEOFF) == ACCEPTED
    assert pilot.command(ARM_DISARM, ARM) == ACCEPTED
    rolled = pilot.until(lambda: not pilot.world.is_landed)
    assert rolled == pytest.approx((10.0 + 4.2) / 5.0, abs=0.1)  # as captured, from FW_AIRSPD_MIN
    pilot.until(lambda: pilot.world.mode == HOLD)
    place = pilot.world.flight.position
    assert -place[2] == pytest.approx(25.0, abs=1.0)
    assert place[0] > 50.0
    pilot.run(40.0)
    for _ in range(20):
        pilot.run(1.0)
        assert math.dist(pilot.world.flight.position[:2], place[:2]) == pytest.approx(80.0, abs=3.0)
        assert pilot.world.flight.position[2] == pytest.approx(-25.0, abs=1.0)


def test_a_plane_is_never_disarmed_before_takeoff() -> None:
    pilot = Pilot(world_of("plane"))
    pilot.command(ARM_DISARM, ARM)
    pilot.run(60.0)
    assert pilot.world.is_armed


@by_day("mode", [DESCEND, LAND], 2)
def test_a_plane_comes_down_rolls_out_and_is_disarmed(mode: int) -> None:
    pilot = flying()
    if mode == DESCEND:
        pilot.world.has_gps = pilot.world.has_position = False
    assert pilot.select(mode) == ACCEPTED
    pilot.until(lambda: pilot.world.flight.is_on_ground, 120.0)
    pilot.until(lambda: speed_of(pilot) < 5.0)
    assert pilot.until(lambda: pilot.world.is_landed) == pytest.approx(2.0, abs=0.7)
    assert pilot.until(lambda: not pilot.world.is_armed) == pytest.approx(2.0, abs=0.1)


def test_a_plane_without_a_position_circles_before_it_sinks() -> None:
    """FW_GPSF_R and FW_GPSF_LT."""
    pilot = flying()
    height = pilot.world.flight.position[2]
    pilot.world.has_gps = pilot.world.has_position = False
    pilot.run(29.0)
    assert pilot.world.mode == DESCEND
    assert pilot.world.flight.position[2] == pytest.approx(height, abs=1.0)
    assert math.degrees(pilot.world.flight.roll) == pytest.approx(15.0, abs=0.1)
    pilot.run(10.0)
    assert pilot.world.flight.velocity[2] == pytest.approx(0.5, abs=0.05)


def test_a_return_ends_in_a_circle_over_home() -> None:
    pilot = flying()
    assert pilot.select(RETURN) == ACCEPTED
    pilot.run(60.0)
    home = pilot.world.flight.home
    for _ in range(10):
        pilot.run(1.0)
        assert math.dist(pilot.world.flight.position[:2], home[:2]) == pytest.approx(80.0, abs=4.0)
    assert home[2] - pilot.world.flight.position[2] == pytest.approx(100.0, abs=1.0)
    assert pilot.world.mode == RETURN


angles = st.floats(-math.pi, math.pi)


@settings(max_examples=examples(12))
@given(angles, st.sampled_from([0.0, 6.0, -4.0]), st.sampled_from(["course", "direction"]))
def test_a_course_is_over_ground_and_a_direction_through_the_air(wanted: float, wind: float, kind: str) -> None:
    program = flying(wind=wind)
    program.enter(WINGS)
    is_course = kind == "course"
    lateral = Lateral(course=wanted) if is_course else Lateral(course=1.0, airspeed_direction=wanted)
    steer(program, 14.0, lateral, Longitudinal(height_rate=0.0))
    flight = wings_of(program)
    air = flight.velocity[0] + wind, flight.velocity[1]
    assert math.hypot(*air) == pytest.approx(flight.airspeed, abs=0.3)
    found = course_of(program) if is_course else math.atan2(air[1], air[0])
    assert error(found, wanted) < 2.0


@settings(max_examples=examples(8))
@given(st.floats(-40, 80), st.floats(8, 25))
def test_an_altitude_is_approached_within_the_limits_of_climb_and_sink(higher: float, airspeed: float) -> None:
    program = flying()
    program.enter(WINGS)
    altitude = program.world.place.altitude + higher
    rates = []

    def sent(time: int) -> None:
        for each in (Lateral(course=0.0), Longitudinal(altitude=altitude, equivalent_airspeed=airspeed)):
            program.publish(each)(time)
        rates.append(-program.world.flight.velocity[2])

    program.send(50.0, sent, 30.0)
    assert program.world.place.altitude == pytest.approx(altitude, abs=0.5)
    assert max(rates[60:]) <= 3.05
    assert min(rates[60:]) >= -2.05
    assert wings_of(program).airspeed == pytest.approx(max(10.0, min(20.0, airspeed)), abs=0.2)


def test_an_altitude_is_above_sea_level_whatever_the_origin_is() -> None:
    program = flying()
    program.enter(WINGS)
    origin, altitude = program.world.origin, program.world.place.altitude
    program.world.set_origin(origin._replace(altitude=origin.altitude - 40.0))
    program.before = program.state()
    steer(program, 8.0, Lateral(course=0.0), Longitudinal(altitude=altitude))
    assert program.world.place.altitude == pytest.approx(altitude, abs=0.5)


def test_a_lateral_acceleration_turns_and_is_limited() -> None:
    program = flying()
    program.enter(WINGS)
    steer(program, 4.0, Lateral(lateral_acceleration=3.0), Longitudinal(height_rate=2.0))
    assert math.degrees(program.world.flight.roll) == pytest.approx(math.degrees(math.atan(3.0 / GRAVITY)), abs=0.5)
    assert -program.world.flight.velocity[2] == pytest.approx(2.0, abs=0.1)
    steer(program, 4.0, Lateral(lateral_acceleration=1e30), Longitudinal(height_rate=1e30))
    assert math.degrees(program.world.flight.roll) == pytest.approx(50.0, abs=0.5)
    assert -program.world.flight.velocity[2] == pytest.approx(5.0, abs=0.2)
    program.publish(LateralLimits(2.0))(program.world.time)
    program.run(3.0)
    assert math.degrees(program.world.flight.roll) == pytest.approx(math.degrees(math.atan(2.0 / GRAVITY)), abs=0.5)


def test_limits_of_a_program_end_with_its_mode() -> None:
    program = flying()
    program.enter(WINGS)
    program.publish(LongitudinalLimits(climb_rate_target=1.0))(program.world.time)
    goal = Longitudinal(altitude=program.world.place.altitude + 200.0)
    steer(program, 6.0, Lateral(course=0.0), goal)
    assert -program.world.flight.velocity[2] == pytest.approx(1.0, abs=0.05)
    program.select(HOLD)
    program.run(1.0)
    program.enter(WINGS)
    steer(program, 6.0, Lateral(course=0.0), goal)
    assert -program.world.flight.velocity[2] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(
    ("limits", "wanted", "rate"),
    [
        ({"pitch_max": math.radians(6.0)}, 4.0, 15.0 * math.sin(math.radians(3.0))),
        ({"pitch_min": math.radians(-3.0)}, -4.0, -15.0 * math.sin(math.radians(6.0))),
        ({"throttle_max": 0.7}, 4.0, 1.25),
        ({"throttle_max": 0.0}, 4.0, -2.0),
    ],
)
def test_pitch_and_throttle_limit_the_height_rate(limits: dict[str, float], wanted: float, rate: float) -> None:
    program = flying()
    program.enter(WINGS)
    program.publish(LongitudinalLimits(**limits))(program.world.time)
    steer(program, 8.0, Lateral(course=0.0), Longitudinal(height_rate=wanted))
    assert -program.world.flight.velocity[2] == pytest.approx(rate, abs=0.1)


def test_the_limits_of_a_takeoff_are_kept_until_others_are_sent() -> None:
    """fw_lateral_longitudinal_control of v1.17 uses the last configuration, here that of the takeoff: 10 degrees."""
    program = Program(world_of("plane", {"MIS_TAKEOFF_ALT": 100.0}))
    program.command(ARM_DISARM, ARM)
    program.command(TAKEOFF)
    program.until(lambda: program.world.flight.position[2] < program.world.flight.ground - 30.0, 40.0)
    program.enter(WINGS)
    steer(program, 4.0, Lateral(course=0.0), Longitudinal(height_rate=-1.0))
    assert -program.world.flight.velocity[2] > 1.5
    program.publish(LongitudinalLimits())(program.world.time)
    steer(program, 4.0, Lateral(course=0.0), Longitudinal(height_rate=-1.0))
    assert -program.world.flight.velocity[2] == pytest.approx(-1.0, abs=0.1)


@by_day(("course", "airspeed"), [(0.0, 17.0), (math.pi / 2, 15.0), (math.pi, 15.0)], 3)
def test_a_course_against_the_wind_raises_the_airspeed(course: float, airspeed: float) -> None:
    """FW_GND_SPD_MIN of v1.17, for courses only: fw_lateral_longitudinal_control, getMinAirspeedForCurrentBearing."""
    program = flying(wind=12.0)
    program.enter(WINGS)
    steer(program, 25.0, Lateral(course=course), Longitudinal(height_rate=0.0))
    assert wings_of(program).airspeed == pytest.approx(airspeed, abs=0.2)
    steer(program, 25.0, Lateral(airspeed_direction=course), Longitudinal(height_rate=0.0))
    assert wings_of(program).airspeed == pytest.approx(15.0, abs=0.2)


def test_the_last_setpoint_is_flown_for_ever() -> None:
    program = flying()
    program.enter(WINGS)
    steer(program, 6.0, Lateral(course=1.0), Longitudinal(altitude=program.world.place.altitude))
    program.run(60.0)
    assert error(course_of(program), 1.0) < 1.0
    assert speed_of(program) > 9.0


def test_a_mode_begins_with_the_setpoint_of_the_mode_before() -> None:
    """From the circle of Hold, the vehicle leaves on a straight line at the height of Hold."""
    program = flying()
    program.run(20.0)
    program.enter(WINGS)
    program.run(3.0)
    course, height = course_of(program), program.world.flight.position[2]
    program.run(6.0)
    assert error(course_of(program), course) < 3.0
    assert program.world.flight.position[2] == pytest.approx(height, abs=1.0)


def test_setpoints_in_hold_win_over_hold_until_they_stop() -> None:
    program = flying()
    program.run(10.0)
    steer(program, 6.0, Lateral(course=math.pi / 2), Longitudinal())
    assert error(course_of(program), math.pi / 2) < 8.0
    program.run(1.0)
    assert program.world.flight.roll > math.radians(3.0)


def test_a_trajectory_does_not_move_a_plane() -> None:
    program = flying()
    program.enter(WINGS)
    steer(program, 8.0, Lateral(course=0.0), Longitudinal(height_rate=0.0))
    program.world.commander.configure(program.mode, TRAJECTORY, is_applied=True)
    program.send(6.0, program.publish(Setpoint(position=(-500.0, -500.0, -50.0))), 30.0)
    assert error(course_of(program), 0.0) < 1.0


def test_attitude_and_rates_steer_a_plane() -> None:
    program = flying()
    program.enter(ATTITUDE)
    attitude = Attitude(quaternion_of(math.radians(20.0), math.radians(8.0), 0.0), (0.5, 0.0, 0.0))
    program.send(4.0, program.publish(attitude), 50.0)
    assert math.degrees(program.world.flight.roll) == pytest.approx(20.0, abs=0.5)
    assert program.world.flight.velocity[2] < -0.5
    program.world.commander.configure(program.mode, RATES, is_applied=True)
    program.send(1.0, program.publish(Rates(roll=math.radians(-20.0), thrust_body=(0.5, 0.0, 0.0))), 50.0)
    assert math.degrees(program.world.flight.roll) == pytest.approx(0.0, abs=4.0)


numbers = st.floats(width=32)
messages = st.one_of(
    st.builds(Lateral, numbers, numbers, numbers),
    st.builds(Longitudinal, *[numbers] * 5),
    st.builds(LateralLimits, numbers),
    st.builds(LongitudinalLimits, numbers, numbers),
    st.builds(Attitude, st.tuples(*[numbers] * 4), st.tuples(*[numbers] * 3)),
    st.builds(Rates, numbers, numbers, numbers, st.tuples(*[numbers] * 3)),
    st.builds(Setpoint, *[st.tuples(*[numbers] * 3)] * 3, numbers, numbers),
)


@settings(max_examples=examples(30))
@given(
    st.sampled_from(["plane", "vtol", "tailsitter"]),
    st.lists(st.tuples(messages, st.sampled_from([1, 3, 4, 5, 6, 15])), min_size=1, max_size=4),
)
def test_no_setpoint_breaks_the_world(vehicle: str, sent: list[tuple[object, int]]) -> None:
    program = flying(vehicle)
    program.most_acceleration, program.most_speed, program.can_tumble = math.inf, 60.0, True
    if vehicle != "plane":
        program.command(VTOL_TRANSITION, FORWARD)
    program.enter()
    for message, kind in sent:
        program.world.commander.configure(program.mode, kind, is_applied=True)
        program.send(0.5, program.publish(message), 50.0)
    flight = wings_of(program)
    assert all(map(math.isfinite, (*flight.position, *flight.velocity, *flight.rates, flight.airspeed)))
    assert abs(flight.roll) <= math.pi


def test_commands_of_vtols_are_unsupported_on_others() -> None:
    for vehicle in ("plane", "multicopter", "rover"):
        pilot = Pilot(world_of(vehicle))
        assert pilot.command(VTOL_TRANSITION, FORWARD) == UNSUPPORTED
        assert pilot.world.reason == "the vehicle is no VTOL"
        assert pilot.command(VTOL_TAKEOFF) == UNSUPPORTED


# VTOLs


def pilot_of(pilot: Pilot) -> VtolPilot:
    assert isinstance(pilot.world.autopilot, VtolPilot)
    return pilot.world.autopilot


@pytest.mark.parametrize(
    ("vehicle", "there", "back"), [("vtol", 2.4, 0.55), ("tailsitter", 60.0 / 90.0 * 5.0, 75.0 / 90.0 * 5.0)]
)
def test_a_vtol_goes_there_and_back_level(vehicle: str, there: float, back: float) -> None:
    pilot = flying(vehicle)
    height = pilot.world.flight.position[2]
    assert pilot.command(VTOL_TRANSITION, FORWARD) == ACCEPTED
    assert (pilot.world.vtol_state, pilot.world.commander.vehicle_type) == (VtolState.TO_FORWARD, ROTARY_WING)
    time = pilot.until(lambda: pilot.world.vtol_state is VtolState.FORWARD)
    assert time == pytest.approx(there, abs=0.15)
    pilot.run(0.02)
    assert pilot.world.commander.vehicle_type == FIXED_WING
    pilot.run(10.0)
    assert wings_of(pilot).airspeed >= 7.0
    assert pilot.world.flight.position[2] == pytest.approx(height, abs=1.5)
    assert pilot.command(VTOL_TRANSITION, BACK) == ACCEPTED
    assert (pilot.world.vtol_state, pilot.world.commander.vehicle_type) == (VtolState.TO_HOVER, ROTARY_WING)
    assert pilot.until(lambda: pilot.world.vtol_state is VtolState.HOVER) == pytest.approx(back, abs=0.1)
    pilot.run(6.0)
    assert speed_of(pilot) < 0.2
    assert pilot.world.flight.position[2] == pytest.approx(height, abs=2.0)


def test_a_tailsitter_has_the_attitude_of_a_hovering_vehicle_nose_down() -> None:
    pilot = flying("tailsitter")
    pilot.command(VTOL_TRANSITION, FORWARD)
    pilot.run(20.0)
    w, x, y, z = pilot.world.flight.quaternion
    assert math.degrees(math.asin(2 * (w * y - x * z))) == pytest.approx(-90.0, abs=12.0)


def test_a_vtol_flies_the_setpoints_of_its_state() -> None:
    program = flying("vtol")
    program.enter(TRAJECTORY)
    hover = program.publish(Setpoint(velocity=ZERO))
    program.send(2.0, hover, 30.0)
    program.command(VTOL_TRANSITION, FORWARD)
    program.publish_all(3.0, LEVEL, Lateral(course=1.5), Longitudinal(height_rate=0.0))
    assert program.world.vtol_state is VtolState.FORWARD
    steer(program, 8.0, Lateral(course=1.5), Longitudinal(height_rate=1.0))
    assert error(course_of(program), 1.5) < 3.0
    assert -program.world.flight.velocity[2] == pytest.approx(1.0, abs=0.1)
    program.send(4.0, hover, 30.0)
    assert speed_of(program) > 8.0, "in forward flight, nothing listens to a trajectory"
    program.command(VTOL_TRANSITION, BACK)
    program.send(6.0, hover, 30.0)
    assert speed_of(program) < 0.2


def test_after_a_transition_back_setpoints_from_before_are_not_used() -> None:
    program = flying("vtol")
    program.enter(TRAJECTORY)
    program.send(1.0, program.publish(Setpoint(velocity=(3.0, 0.0, 0.0))), 30.0)
    program.command(VTOL_TRANSITION, FORWARD)
    program.run(6.0)
    program.command(VTOL_TRANSITION, BACK)
    program.run(8.0)
    assert speed_of(program) < 0.2


def test_types_of_setpoints_follow_the_state_of_a_vtol() -> None:
    program = flying("vtol")
    ask = program.world.commander.configure
    assert [ask(program.mode, kind, is_applied=False)[0] for kind in (2, 3, 4)] == [0, 2, 0]
    program.command(VTOL_TRANSITION, FORWARD)
    assert [ask(program.mode, kind, is_applied=False)[0] for kind in (2, 3, 4)] == [0, 2, 0]
    program.until(lambda: program.world.vtol_state is VtolState.FORWARD)
    program.run(0.02)
    assert [ask(program.mode, kind, is_applied=False)[0] for kind in (2, 3, 4)] == [2, 0, 0]
    program.world.commander.rules = V1_18._replace(takes_both_of_vtol=True)
    assert ask(program.mode, 3, is_applied=False)[0] == 0
    program.command(VTOL_TRANSITION, BACK)
    program.run(2.0)
    assert ask(program.mode, 3, is_applied=False)[0] == 0


@pytest.mark.parametrize("command", [TAKEOFF, VTOL_TAKEOFF])
def test_a_transition_is_refused_in_takeoff(command: int) -> None:
    pilot = Pilot(world_of("vtol"))
    pilot.command(ARM_DISARM, ARM)
    pilot.command(command)
    pilot.run(5.0)
    if command == TAKEOFF:
        assert pilot.command(VTOL_TRANSITION, FORWARD) == TEMPORARILY_REJECTED
        assert pilot.world.reason == "not in takeoff"
    else:
        pilot.until(lambda: pilot.world.vtol_state is VtolState.FORWARD)
        pilot.run(0.1)
        assert TO_FORWARD in pilot.world.commander.completed
        assert pilot.world.mode == HOLD


def test_a_transition_on_the_ground_is_done_at_once_and_turns_the_vehicle_over() -> None:
    pilot = Pilot(world_of("vtol"))
    pilot.can_tumble = True
    pilot.command(ARM_DISARM, ARM)
    pilot.world.command(TAKEOFF, NOTHING)
    assert pilot.world.command(VTOL_TRANSITION, FORWARD) == ACCEPTED
    assert pilot.world.vtol_state is VtolState.FORWARD
    assert pilot.until(lambda: not pilot.world.is_armed) == pytest.approx(1.4, abs=0.2)
    assert pilot.world.commander.disarming_reason == BY_FAILSAFE
    assert abs(math.degrees(pilot.world.flight.roll)) > 170.0


def test_a_transition_that_does_not_get_fast_is_a_quad_chute() -> None:
    program = Program(world_of("vtol", {"VT_TRANS_TIMEOUT": 3.0}, V1_16))
    program.take_off()
    program.enter()
    program.command(VTOL_TRANSITION, FORWARD)
    program.run(2.0)
    assert speed_of(program) < 1.0, "before v1.17, the mode of a program does not start the pusher"
    program.until(lambda: program.world.vtol_state is VtolState.HOVER)
    assert pilot_of(program).has_failed
    program.run(0.5)
    assert program.world.mode == program.mode, "in the mode of a program, nothing but the state changes"
    program.select(HOLD)
    program.until(lambda: program.world.mode == RETURN)
    assert program.world.commander.failsafe.is_active


def test_a_transition_at_once_is_a_quad_chute() -> None:
    pilot = flying("vtol")
    pilot.command(VTOL_TRANSITION, FORWARD)
    pilot.run(8.0)
    pilot.command(VTOL_TRANSITION, (3.0, 1.0, *NOTHING[2:]))
    assert pilot.world.vtol_state is VtolState.HOVER
    assert pilot_of(pilot).has_failed
    pilot.run(12.0)
    assert pilot.command(VTOL_TRANSITION, FORWARD) in {ACCEPTED, TEMPORARILY_REJECTED}


@by_day("mode", [RETURN, LAND], 2)
def test_landing_from_forward_flight_goes_back_by_itself(mode: int) -> None:
    pilot = flying("vtol")
    pilot.command(VTOL_TRANSITION, FORWARD)
    pilot.run(10.0)
    pilot.select(mode)
    pilot.until(lambda: not pilot.world.is_armed, 200.0)
    assert pilot.world.vtol_state is VtolState.HOVER
    if mode == RETURN:
        assert math.hypot(*pilot.world.flight.position[:2]) < 1.0


def test_gusts_move_the_air() -> None:
    calm, windy = flying(), flying()
    windy.world.disturbances = type(windy.world.disturbances)(("wind",))
    for each in (calm, windy):
        each.enter(WINGS)
        steer(each, 5.0, Lateral(course=0.0), Longitudinal(height_rate=0.0))
    assert math.dist(calm.world.flight.position, windy.world.flight.position) > 0.1


def test_the_largest_lateral_acceleration_is_that_of_the_largest_roll() -> None:
    assert pytest.approx(11.7, abs=0.05) == MAX_LATERAL
    assert SECOND == 1_000_000
