"""Tests of a simulated vehicle's failsafes, their deferral, executors in charge, arming and disarming."""

from __future__ import annotations

import pytest

from msggen.messages import nav_states, setpoints
from msggen.messages.commands import ACCEPTED, EXECUTOR, TEMPORARILY_REJECTED
from msggen.sim.commander import arming, setpoint_types
from msggen.sim.commander.components import Overrides
from support.commander_driver import NEEDS, Driver

POSITIONS = ["local_position", "local_position_relaxed", "global_position"]


# Executors


def test_who_selects_a_mode_decides_which_executor_is_in_charge() -> None:
    driver = Driver()
    commander = driver.commander
    driver.register("One", executor=True)
    driver.register("Two", executor=True)
    driver.register("Three")
    driver.fly(nav_states.HOLD)
    for mode, by_executor, in_charge, displayed in (
        (23, False, 1, 23),
        (nav_states.TAKEOFF, True, 1, 23),
        (24, True, 2, 24),
        (nav_states.LAND, False, 0, nav_states.LAND),
        (24, False, 2, 24),
        (25, True, 2, 24),
        (25, False, 0, 25),
    ):
        assert commander.select(mode, by_executor=by_executor) == ACCEPTED
        driver.step()
        assert (commander.mode, commander.executor_in_charge, commander.displayed) == (mode, in_charge, displayed)


def test_only_the_executor_in_charge_commands() -> None:
    driver = Driver()
    found = driver.register("One", executor=True)
    driver.register("Two", executor=True)
    driver.fly(23)
    refused = [driver.commander.is_refused(EXECUTOR + number) for number in range(4)]
    assert refused == [True, False, True, True]
    assert driver.commander.reason == "executor 3 is not in charge"
    assert not driver.commander.is_refused(1), "a user"
    driver.kill(found)
    driver.run(2)
    assert driver.commander.is_refused(EXECUTOR + 1), "in a failsafe"


def test_takeoff_ends_in_hold_unless_an_executor_is_in_charge() -> None:
    for by_executor, mode in ((False, nav_states.HOLD), (True, nav_states.TAKEOFF)):
        driver = Driver()
        driver.register("Own", executor=True)
        driver.fly(23)
        driver.commander.select(nav_states.TAKEOFF, by_executor=by_executor)
        driver.run(0.1)
        driver.sense(is_done=True)
        driver.run(1)
        assert driver.commander.mode == mode
        assert set(driver.commander.completed) == {nav_states.TAKEOFF}


# Failsafes


def test_lost_sticks_hold_first_and_return_then_until_a_user_selects_a_mode() -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.register("Own", executor=True)
    driver.fly(23)
    driver.sense(manual_control=False)
    assert driver.until(lambda one: one.mode == nav_states.HOLD) < 0.2
    assert driver.commander.executor_in_charge == 0
    assert driver.until(lambda one: one.mode == nav_states.RETURN) == pytest.approx(5, abs=0.1)
    driver.sense(manual_control=True)
    driver.run(1)
    assert driver.commander.mode == nav_states.RETURN
    driver.commander.select(23)
    driver.run(0.3)
    assert (driver.commander.mode, driver.commander.failsafe.is_active) == (23, False)


def test_a_user_takes_over_while_the_sticks_are_lost() -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.fly(nav_states.HOLD)
    driver.sense(manual_control=False)
    driver.run(1)
    driver.commander.select(nav_states.TAKEOFF)
    driver.run(8)
    assert driver.commander.mode == nav_states.TAKEOFF
    assert driver.commander.failsafe.user_took_over
    driver.sense(manual_control=True)
    driver.run(0.3)
    assert not driver.commander.failsafe.user_took_over


def test_sticks_that_were_not_there_at_arming_are_not_missed() -> None:
    driver = Driver()
    driver.fly(nav_states.HOLD)
    driver.run(2)
    assert not driver.commander.failsafe.is_active
    for is_there in (True, False):
        driver.sense(manual_control=is_there)
        driver.run(0.3)
    assert driver.commander.failsafe.is_active


@pytest.mark.parametrize("mode", [nav_states.LAND, nav_states.RETURN])
def test_a_return_does_not_interrupt_a_landing(mode: int) -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.fly(nav_states.HOLD)
    driver.commander.select(mode)
    driver.run(0.2)
    driver.sense(manual_control=False)
    for seconds in (1, 7):
        driver.run(seconds)
        assert (driver.commander.mode, driver.commander.failsafe.is_active) == (mode, False)


@pytest.mark.parametrize(
    ("setting", "low", "critical", "emergency"),
    [
        (0, nav_states.TAKEOFF, nav_states.TAKEOFF, nav_states.TAKEOFF),
        (1, nav_states.TAKEOFF, nav_states.RETURN, nav_states.RETURN),
        (2, nav_states.TAKEOFF, nav_states.LAND, nav_states.LAND),
        (3, nav_states.TAKEOFF, nav_states.RETURN, nav_states.LAND),
    ],
)
def test_a_battery_that_gets_worse_than_at_arming_leads_to_an_action(
    setting: int, low: int, critical: int, emergency: int
) -> None:
    for at_arming, warning, mode in ((0, 1, low), (0, 2, critical), (0, 3, emergency), (1, 1, nav_states.TAKEOFF)):
        driver = Driver(COM_LOW_BAT_ACT=setting)
        driver.sense(battery=at_arming)
        driver.fly(nav_states.TAKEOFF)
        driver.sense(battery=warning)
        driver.run(1)
        assert driver.commander.mode == (nav_states.HOLD if mode != nav_states.TAKEOFF else mode), "it holds first"
        driver.run(6)
        assert driver.commander.mode == mode


def test_without_a_position_the_vehicle_descends_until_it_has_one() -> None:
    driver = Driver()
    driver.register("Own", executor=True)
    driver.fly(23)
    for is_there, mode, executor in ((False, nav_states.DESCEND, 0), (True, 23, 1)):
        driver.sense(**dict.fromkeys(POSITIONS, is_there))
        driver.run(0.3)
        assert (driver.commander.mode, driver.commander.executor_in_charge) == (mode, executor)
        if not is_there:
            assert driver.commander.select(nav_states.HOLD) == TEMPORARILY_REJECTED
            assert driver.commander.reason == "there is no local position, there is no global position"


@pytest.mark.parametrize(
    ("selected", "lost", "flown"),
    [
        (nav_states.OFFBOARD, ["offboard_signal"], nav_states.POSITION),
        (nav_states.OFFBOARD, ["offboard_signal", *POSITIONS], nav_states.ALTITUDE),
        (nav_states.POSITION, POSITIONS, nav_states.ALTITUDE),
        (nav_states.POSITION, [*POSITIONS, "local_alt"], nav_states.STABILIZED),
        (nav_states.ALTITUDE, ["local_alt"], nav_states.STABILIZED),
        (nav_states.HOLD, POSITIONS, nav_states.DESCEND),
    ],
)
def test_a_pilot_falls_back_to_a_mode_that_needs_less(selected: int, lost: list[str], flown: int) -> None:
    driver = Driver()
    driver.sense(manual_control=True, offboard_signal=True)
    driver.fly(selected)
    driver.sense(**dict.fromkeys(lost, False))
    driver.run(0.3)
    assert driver.commander.mode == flown
    driver.sense(**dict.fromkeys(lost, True))
    driver.run(0.3)
    assert driver.commander.mode == selected


def test_nothing_ends_a_termination() -> None:
    driver = Driver()
    driver.fly(nav_states.HOLD)
    driver.sense(attitude=False, angular_velocity=False)
    driver.run(0.3)
    assert driver.commander.mode == nav_states.TERMINATION
    driver.sense(attitude=True, angular_velocity=True)
    driver.run(1)
    assert driver.commander.select(nav_states.HOLD) == TEMPORARILY_REJECTED
    assert driver.commander.mode == nav_states.TERMINATION


# Deferral


@pytest.mark.parametrize(("seconds", "deferred"), [(6, 6), (0, 30), (-1, None)])
def test_a_deferred_failsafe_waits_for_some_time(seconds: int, deferred: float | None) -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.register("Own", executor=True)
    driver.fly(23)
    driver.commander.override(1, Overrides(defers=True, defer_seconds=seconds), of_executor=True)
    driver.run(3)
    assert driver.commander.failsafe.defer_state == 1
    driver.sense(manual_control=False)
    driver.until(lambda one: one.failsafe.defer_state == 2)
    if deferred is None:
        driver.run(40)
        assert driver.commander.failsafe.defer_state == 2
        return
    assert driver.until(lambda one: one.mode == nav_states.HOLD) == pytest.approx(deferred, abs=0.1)
    assert driver.commander.failsafe.defer_state == 0


def test_a_deferred_failsafe_whose_reason_goes_is_forgotten() -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.register("Own")
    driver.fly(23)
    driver.commander.override(23, Overrides(defers=True), of_executor=False)
    for is_there, state in ((True, 1), (False, 2), (True, 1)):
        driver.sense(manual_control=is_there)
        driver.run(0.5)
        assert driver.commander.failsafe.defer_state == state
    driver.commander.override(23, Overrides(), of_executor=False)
    driver.run(0.5)
    assert (driver.commander.mode, driver.commander.failsafe.defer_state) == (23, 0)


def test_a_mode_that_fails_is_not_deferred_and_a_failsafe_that_is_active_neither() -> None:
    driver = Driver()
    found = driver.register("Own", executor=True)
    driver.fly(23)
    driver.commander.override(1, Overrides(defers=True, defer_seconds=-1), of_executor=True)
    driver.run(0.2)
    reply = driver.answers[found.check]
    driver.kill(found)
    driver.run(2)
    assert (driver.commander.mode, driver.commander.failsafe.defer_state) == (nav_states.RETURN, 0)
    driver.answers[found.check] = reply
    driver.run(1)
    assert (driver.commander.mode, driver.commander.failsafe.defer_state) == (23, 1)


def test_deferring_has_no_effect_on_a_failsafe_that_is_active() -> None:
    driver = Driver()
    driver.sense(manual_control=True)
    driver.run(0.2)
    driver.register("My hold", replaces=nav_states.HOLD)
    driver.fly(nav_states.TAKEOFF)
    driver.sense(manual_control=False)
    driver.run(1)
    assert driver.commander.mode == 23
    driver.commander.override(23, Overrides(defers=True), of_executor=False)
    driver.run(1)
    assert (driver.commander.failsafe.is_active, driver.commander.failsafe.defer_state) == (True, 0)


# Arming and disarming


def test_a_vehicle_that_does_not_take_off_is_disarmed_and_one_that_has_landed_too() -> None:
    driver = Driver()
    driver.commander.arm()
    assert driver.until(lambda one: not one.is_armed) == pytest.approx(11, abs=0.05)
    assert driver.commander.disarming_reason == arming.BY_INACTION
    driver.fly(nav_states.HOLD)
    driver.run(20)
    driver.sense(is_landed=True)
    assert driver.until(lambda one: not one.is_armed) == pytest.approx(2, abs=0.05)
    assert driver.commander.disarming_reason == arming.BY_LANDING


def test_overrides_keep_a_vehicle_armed_after_landing_but_not_before_takeoff() -> None:
    driver = Driver()
    driver.register("Own", executor=True)
    driver.commander.override(1, Overrides(keeps_armed=True), of_executor=True)
    driver.run(0.5)
    driver.commander.select(23)
    driver.run(0.2)
    driver.commander.arm()
    driver.until(lambda one: not one.is_armed, most=12)
    driver.fly(23)
    driver.sense(is_landed=True)
    driver.run(30)
    assert driver.commander.is_armed
    driver.commander.override(1, Overrides(), of_executor=True)
    driver.until(lambda one: not one.is_armed, most=3)


def test_in_the_air_only_force_disarms() -> None:
    driver = Driver()
    driver.fly(nav_states.HOLD)
    assert driver.commander.disarm() == TEMPORARILY_REJECTED
    assert driver.commander.reason == "the vehicle is in the air"
    assert driver.commander.disarm(is_forced=True) == ACCEPTED
    assert driver.commander.arm(is_forced=True) == ACCEPTED


@pytest.mark.parametrize(
    ("changes", "mode", "reason"),
    [
        ({}, nav_states.LAND, "the mode does not allow arming"),
        ({}, nav_states.POSITION, "there are no sticks"),
        ({}, 23, "the mode is not registered, does not answer, or says that it cannot run"),
        ({"local_position": False}, nav_states.HOLD, "there is no local position"),
        ({"battery": 2}, nav_states.HOLD, "the battery is empty"),
        ({}, nav_states.MISSION, "there is no mission"),
    ],
)
def test_what_is_missing_for_arming_is_told(changes: dict[str, bool], mode: int, reason: str) -> None:
    driver = Driver()
    driver.sense(**changes)
    driver.commander.select(mode)
    driver.run(0.2)
    assert not driver.commander.is_ready
    assert driver.commander.arm() == TEMPORARILY_REJECTED
    assert reason in driver.commander.reason
    assert driver.commander.arm(is_forced=True) == ACCEPTED


# Types of setpoints


def test_types_of_setpoints_and_what_they_require() -> None:
    driver = Driver()
    driver.register("Own")
    results = {kind: driver.commander.configure(23, kind, is_applied=False) for kind in (*range(18), 99)}
    unknown = {0, 17, 99}
    unsupported = {kind for kind, (result, _) in results.items() if result == setpoints.UNSUPPORTED_TYPE}
    assert unsupported == {3, *range(7, 15)}
    assert {kind for kind, (result, _) in results.items() if result == setpoints.UNKNOWN_TYPE} == unknown
    assert results[1][1] == results[15][1] == set()
    assert results[2][1] == results[4][1] == results[16][1] == NEEDS
    assert results[5][1] == {"angular_velocity"}
    assert results[6][1] == {"angular_velocity", "attitude"}
    for mode in (nav_states.HOLD, 24):
        assert driver.commander.configure(mode, 2, is_applied=True) == (setpoints.OTHER_FAILURE, frozenset())
    driver.commander.select(23)
    driver.run(0.1)
    assert driver.commander.controls == setpoint_types.ALL, "without a configuration"
    for kind, controls in (
        (6, {"allocation", "rates", "attitude"}),
        (3, {"allocation", "rates", "attitude"}),
        (1, set()),
    ):
        driver.commander.configure(23, kind, is_applied=True)
        assert driver.commander.controls == controls
