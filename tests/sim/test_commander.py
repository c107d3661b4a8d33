"""Tests of the decisions of a simulated vehicle: modes of programs, arming checks, executors, failsafes, disarming."""

from __future__ import annotations

import pytest

from msggen.messages import nav_states
from msggen.messages.commands import ACCEPTED, TEMPORARILY_REJECTED
from msggen.sim.commander.checks import Reply
from msggen.sim.commander.components import REFUSED, REFUSED_ARMED, Overrides, Registration
from msggen.sim.commander.rules import V1_15, V1_15_SITL, V1_16, V1_17, V1_18, Rules
from support.commander_driver import Driver

RELEASES = {"v1.15": V1_15, "v1.16": V1_16, "v1.17": V1_17, "v1.18": V1_18}

releases = pytest.mark.parametrize("rules", RELEASES.values(), ids=RELEASES)


# Releases


@pytest.mark.parametrize(
    ("rules", "after_answers", "before_answers"),
    [(V1_15, 0.67, 0.67), (V1_16, 0.98, 3.15), (V1_17, 0.98, 3.15), (V1_18, 0.98, 3.15)],
    ids=RELEASES,
)
def test_who_does_not_answer_is_unresponsive_after_some_requests(
    rules: Rules, after_answers: float, before_answers: float
) -> None:
    """The times begin with the first request that is not answered. The mode is removed, because it is not selected."""
    driver = Driver(rules)
    silent, talks = driver.register("Silent"), driver.register("Talks")
    driver.kill(silent)
    driver.until(lambda _: driver.masks)
    waited = driver.until(lambda one: silent.check not in one.checks.registered)
    assert waited == pytest.approx(before_answers, abs=0.05)
    number = len(driver.masks)
    driver.until(lambda _: len(driver.masks) > number)
    driver.kill(talks)
    driver.until(lambda _: len(driver.masks) > number + 1)
    assert driver.until(lambda one: not one.checks.registered) == pytest.approx(after_answers, abs=0.05)


@releases
@pytest.mark.parametrize("setting", [0, 1])
def test_programs_register_in_flight_only_if_a_parameter_allows_it(rules: Rules, setting: int) -> None:
    driver = Driver(rules, COM_MODE_ARM_CHK=setting)
    driver.fly(nav_states.HOLD)
    found = driver.register("Late")
    assert found.success if setting else found == REFUSED_ARMED


def test_v1_15_in_its_simulation_registers_in_flight() -> None:
    driver = Driver(V1_15_SITL, COM_MODE_ARM_CHK=0)
    driver.fly(nav_states.HOLD)
    assert driver.register("Late").success


@pytest.mark.parametrize(("rules", "counts"), [(V1_15, 1), (V1_16, 1), (V1_17, 0), (V1_18, 0)], ids=RELEASES)
def test_replies_that_took_more_than_0_3_s_are_dropped_from_v1_17_on(rules: Rules, counts: int) -> None:
    driver = Driver(rules)
    found = driver.register("Slow")
    driver.kill(found)
    driver.until(lambda _: driver.masks)
    reply = Reply(request=1, check=found.check, can_run=True)
    for age, has_replied in ((300_001, counts), (300_000, 1)):
        driver.commander.checks.take(reply, driver.now - age, driver.now)
        assert driver.commander.checks.registered[found.check].has_replied == has_replied


@pytest.mark.parametrize(("rules", "mode"), [(V1_15, 4), (V1_16, 4), (V1_17, 23), (V1_18, 23)], ids=RELEASES)
def test_after_landing_the_mode_of_the_executor_is_selected_from_v1_17_on(rules: Rules, mode: int) -> None:
    driver = Driver(rules)
    driver.register("Own", executor=True)
    driver.fly(23)
    for selected in (nav_states.HOLD, nav_states.LAND):
        driver.commander.select(selected, by_executor=True)
        driver.run(0.1)
    driver.sense(is_landed=True)
    driver.until(lambda one: not one.is_armed)
    driver.run(0.1)
    assert driver.commander.mode == mode


@pytest.mark.parametrize("rules", [V1_17, V1_18], ids=["v1.17", "v1.18"])
def test_leaving_a_mode_resets_the_type_of_its_setpoints_in_v1_18(rules: Rules) -> None:
    driver = Driver(rules)
    driver.register("Own")
    driver.fly(23)
    if rules.configures_setpoints:
        assert driver.commander.configure(23, 5, is_applied=True) == (0, frozenset({"angular_velocity"}))
    else:
        driver.commander.control(23, frozenset({"allocation", "rates"}))
    assert driver.commander.controls == {"allocation", "rates"}
    for mode in (nav_states.HOLD, 23):
        driver.commander.select(mode)
        driver.run(0.1)
    assert ("position" in driver.commander.controls) is rules.configures_setpoints
    assert rules.api_version == (2 if rules.configures_setpoints else 1)


# Registrations


def test_what_cannot_be_registered_is_refused() -> None:
    driver = Driver()
    for wanted in (
        Registration("executor without mode", check=True, executor=True),
        Registration("mode without check", mode=True),
    ):
        assert driver.commander.register(wanted) == REFUSED
    assert driver.commander.register(Registration("nothing")) == (True, -1, -1, -1)
    found = [driver.register(f"Mode {number}", executor=number < 6) for number in range(10)]
    assert [each.mode for each in found if each.success] == [*range(23, 31)]
    assert [each.check for each in found if each.success] == [*range(8)]
    assert [number for number, each in enumerate(found) if not each.success] == [5, 9]
    assert [each.executor for each in found] == [1, 2, 3, 4, 5, -1, -1, -1, -1, -1]
    assert driver.commander.register(Registration("only a check", check=True)) == REFUSED


def test_two_programs_of_one_name_both_live_and_the_name_keeps_its_slot() -> None:
    driver = Driver()
    first, second = driver.register("Same"), driver.register("Same")
    assert (first.mode, second.mode) == (23, 24)
    driver.run(1)
    assert driver.masks[-1] == 0b11
    for each in (second, first):
        driver.commander.unregister("Same", each.check, each.mode, -1)
    assert driver.register("Other").mode == 24
    assert driver.register("Same").mode == 23


def test_a_wrong_name_unregisters_the_check_only() -> None:
    driver = Driver()
    found = driver.register("Own", executor=True)
    driver.commander.select(23)
    driver.run(0.1)
    driver.commander.unregister("Wrong", found.check, found.mode, found.executor)
    assert not driver.commander.checks.registered
    assert 23 in driver.commander.components.modes
    driver.run(0.1)
    assert driver.commander.mode == nav_states.HOLD


def test_a_dead_mode_is_removed_on_the_ground_unless_it_is_selected() -> None:
    driver = Driver()
    selected, other = driver.register("Selected", executor=True), driver.register("Other")
    driver.commander.select(selected.mode)
    driver.run(0.5)
    driver.kill(selected)
    driver.kill(other)
    driver.run(5)
    assert set(driver.commander.components.modes) == {selected.mode}
    assert (driver.commander.mode, driver.commander.is_ready) == (23, False)
    driver.commander.select(nav_states.HOLD)
    driver.run(0.1)
    assert not driver.commander.components.modes
    assert not driver.commander.components.executors


@pytest.mark.parametrize(("setting", "is_removed"), [(0, False), (1, True)])
def test_a_dead_mode_is_removed_in_flight_only_if_a_parameter_allows_it(setting: int, is_removed: int) -> None:
    driver = Driver(COM_MODE_ARM_CHK=setting)
    found = driver.register("Own", executor=True)
    driver.fly(23)
    driver.commander.select(nav_states.TAKEOFF, by_executor=True)
    driver.run(0.2)
    driver.kill(found)
    driver.run(3)
    assert (not driver.commander.components.modes) is is_removed
    assert driver.commander.executor_in_charge == (0 if is_removed else 1)
    driver.sense(is_done=True)
    driver.run(0.2)
    assert driver.commander.mode == (nav_states.HOLD if is_removed else nav_states.TAKEOFF)


def test_the_last_unregistration_in_flight_waits_until_the_vehicle_is_disarmed() -> None:
    driver = Driver(COM_MODE_ARM_CHK=0)
    one, two = driver.register("One"), driver.register("Two")
    driver.fly(nav_states.HOLD)
    driver.commander.unregister("One", one.check, one.mode, -1)
    driver.commander.unregister("Two", two.check, two.mode, -1)
    driver.run(1)
    assert set(driver.commander.components.modes) == {23, 24}
    driver.commander.disarm(is_forced=True)
    driver.run(0.1)
    assert set(driver.commander.components.modes) == {23}


def test_a_mode_that_is_registered_again_has_no_old_overrides() -> None:
    driver = Driver()
    for is_kept in (True, False):
        found = driver.register("Own", executor=True)
        if is_kept:
            driver.commander.override(1, Overrides(defers=True), of_executor=True)
            driver.commander.override(23, Overrides(keeps_armed=True), of_executor=False)
        driver.commander.select(23)
        driver.run(0.5)
        assert driver.commander.failsafe.defer_state == is_kept
        driver.commander.unregister("Own", found.check, found.mode, found.executor)
        driver.run(0.1)


def test_a_mode_can_be_activated_with_its_registration_by_an_executor_only() -> None:
    for executor, mode in ((False, nav_states.HOLD), (True, 23)):
        driver = Driver()
        driver.register("Now", executor=executor, is_immediate=True)
        driver.step()
        assert (driver.commander.mode, driver.commander.executor_in_charge) == (mode, int(executor))


# Arming checks


def test_an_unresponsive_mode_comes_back_three_times() -> None:
    driver = Driver()
    found = driver.register("Own", executor=True)
    driver.fly(23)
    reply = driver.answers[found.check]
    for number in range(4):
        driver.kill(found)
        assert driver.until(lambda one: one.mode == nav_states.RETURN) == pytest.approx(1.15, abs=0.2)
        assert (driver.commander.executor_in_charge, driver.commander.intention) == (0, 23)
        driver.answers[found.check] = reply
        driver.run(1)
        assert driver.commander.mode == (23 if number < 3 else nav_states.RETURN)
        assert driver.masks[-1] == (number < 3)
    assert driver.commander.executor_in_charge == 0


def test_a_new_check_that_has_not_answered_harms_the_mode_of_the_check_0() -> None:
    driver = Driver()
    driver.register("Flies")
    driver.fly(23)
    new = driver.register("New")
    reply = driver.answers.pop(new.check)
    driver.run(0.2)
    assert driver.commander.mode == nav_states.RETURN
    assert not driver.commander.checks.is_unresponsive(0)
    driver.answers[new.check] = reply
    driver.run(0.5)
    assert driver.commander.mode == 23
    driver.commander.unregister("New", new.check, new.mode, -1)
    again = driver.register("New")
    driver.kill(again)
    driver.run(1)
    assert (again.check, driver.commander.mode) == (new.check, 23), "the old reply is still there"


def test_a_check_without_a_mode_blocks_arming_in_all_modes_until_it_is_gone() -> None:
    driver = Driver()
    found = driver.commander.register(Registration("only a check", check=True))
    driver.run(0.5)
    assert driver.commander.arm() == TEMPORARILY_REJECTED
    driver.answers[found.check] = Reply(check=found.check, can_run=True)
    driver.run(0.5)
    assert driver.commander.is_ready
    driver.answers[found.check] = Reply(check=found.check, can_run=False)
    driver.run(0.5)
    assert driver.commander.arm() == TEMPORARILY_REJECTED
    driver.kill(found)
    driver.run(1.5)
    assert not driver.commander.checks.registered
    assert driver.commander.arm() == ACCEPTED


def test_a_mode_that_cannot_run_is_neither_entered_nor_kept() -> None:
    driver = Driver()
    found = driver.register("Own")
    driver.fly(nav_states.HOLD)
    reply = driver.answers[found.check]
    driver.answers[found.check] = reply._replace(can_run=False)
    driver.run(0.5)
    assert driver.commander.select(23) == TEMPORARILY_REJECTED
    assert "cannot run" in driver.commander.reason
    driver.answers[found.check] = reply
    driver.run(0.5)
    assert driver.commander.select(23) == ACCEPTED
    driver.answers[found.check] = reply._replace(can_run=False)
    driver.run(0.5)
    assert (driver.commander.mode, driver.commander.failsafe.is_active) == (nav_states.RETURN, True)


# Replacing modes


def test_a_mode_flies_in_place_of_the_one_that_it_replaces() -> None:
    driver = Driver()
    found = driver.register("My return", executor=True, replaces=nav_states.RETURN)
    assert driver.register("Another", replaces=nav_states.RETURN) == REFUSED
    driver.fly(nav_states.HOLD)
    assert not driver.commander.components.selectable >> nav_states.RETURN & 1
    assert not driver.commander.requirements.masks["home_position"] >> nav_states.RETURN & 1
    for mode in (nav_states.RETURN, found.mode):
        assert driver.commander.select(mode) == ACCEPTED
        driver.run(0.1)
        assert (driver.commander.mode, driver.commander.intention) == (23, 23)
        assert driver.commander.executor_in_charge == 0, "it is never in charge"
    driver.kill(found)
    driver.until(lambda one: one.mode == nav_states.RETURN)
    assert not driver.commander.failsafe.is_active
    driver.run(0.5)
    assert not driver.commander.components.modes
    assert driver.commander.components.selectable == 0x7EC5FF


def test_a_failsafe_flies_the_mode_that_replaces_the_return() -> None:
    driver = Driver()
    replacing, own = driver.register("My return", replaces=nav_states.RETURN), driver.register("Own")
    driver.fly(own.mode)
    driver.kill(own)
    driver.run(2)
    assert (driver.commander.mode, driver.commander.failsafe.is_active) == (replacing.mode, True)
