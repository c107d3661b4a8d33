"""Properties of the commander of a simulated vehicle that hold for whatever programs, pilots and sensors do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from msggen.messages import nav_states
from msggen.messages.commands import ACCEPTED
from msggen.sim.commander.components import Components, Overrides, Registered, Registration
from support.commander_driver import Driver

NAMES = st.sampled_from([f"Mode {number}" for number in range(11)])


class SlowSlots:
    """The slots of modes, by names in place of their hashes, written down as a list of eight rows."""

    def __init__(self) -> None:
        self.kept: list[str | None] = [None] * 8
        self.live: list[str | None] = [None] * 8

    def register(self, name: str) -> int | None:
        """Return the slot that a name gets."""
        free = [slot for slot in range(8) if self.live[slot] is None]
        if not free:
            return None
        own = [slot for slot in free if self.kept[slot] == name]
        is_taken = name in self.kept and not own
        slot = min(own or [slot for slot in free if self.kept[slot] is None] or free)
        if is_taken and self.kept[slot] is not None:
            self.kept[slot] = None
        elif not is_taken:
            self.kept[slot] = name
        self.live[slot] = name
        return slot


EIGHT: list[tuple[str, int | None]] = [(f"Mode {number}", None) for number in range(8)]


@example([*EIGHT, ("", 3), ("Mode 5", None), ("", 3), ("", 0), ("Mode 8", None)])
@given(st.lists(st.tuples(NAMES, st.integers(0, 7) | st.none()), max_size=40))
def test_names_get_the_slots_that_a_slow_reference_gives_them(steps: list[tuple[str, int | None]]) -> None:
    """A step is a name that registers, or the slot that is given back instead."""
    components, slow = Components(), SlowSlots()
    for name, given_back in steps:
        if given_back is not None:
            live = slow.live[given_back]
            assert components.remove(23 + given_back, live or name) is (live is not None)
            slow.live[given_back] = None
            continue
        expected = slow.register(name)
        assert components.has_room(Registration(name, check=True, mode=True)) is (expected is not None)
        if expected is not None:
            assert components.add(Registration(name, check=True, mode=True)) == (23 + expected, -1)
    assert {mode: own.name for mode, own in components.modes.items()} == {
        23 + slot: name for slot, name in enumerate(slow.live) if name is not None
    }


MODES = st.sampled_from([0, 2, 3, 4, 5, 14, 17, 18, *range(23, 31)])
CHANGES = st.fixed_dictionaries(
    {},
    optional={
        **dict.fromkeys(("local_position", "global_position", "manual_control", "is_landed", "is_done"), st.booleans()),
        "battery": st.integers(0, 3),
    },
)
OPERATIONS: Mapping[str, st.SearchStrategy[Any]] = {
    "register": st.tuples(NAMES, st.booleans(), st.sampled_from([None, 4, 5])),
    "unregister": st.integers(0, 7),
    "kill": st.integers(0, 20),
    "fail": st.integers(0, 20),
    "select": st.tuples(MODES, st.booleans()),
    "arm": st.booleans(),
    "disarm": st.booleans(),
    "override": st.tuples(st.integers(0, 30), st.booleans(), st.sampled_from([-1, 0, 1])),
    "sense": CHANGES,
    "run": st.floats(0.01, 4),
}
"""What programs, a pilot and sensors do: the methods of `Play`, and what they are given."""


def operations(*names: str) -> st.SearchStrategy[tuple[str, Any]]:
    """Return a strategy for operations."""
    return st.one_of([st.tuples(st.just(name), OPERATIONS[name]) for name in names])


class Play:
    """A driver that does what an operation says."""

    def __init__(self, setting: int) -> None:
        self.driver = Driver(COM_MODE_ARM_CHK=setting, COM_LOW_BAT_ACT=3)
        self.registered: list[Registered] = []
        self.was_told_to_arm = False

    def do(self, name: str, value: Any) -> None:
        """Do an operation."""
        getattr(self, f"do_{name}")(value)

    def do_register(self, value: tuple[str, bool, int | None]) -> None:
        name, executor, replaces = value
        self.registered.append(self.driver.register(name, executor=executor, replaces=replaces))

    def do_unregister(self, place: int) -> None:
        for mode, own in [*self.driver.commander.components.modes.items()][place : place + 1]:
            self.driver.commander.unregister(own.name, own.check, mode, own.executor)

    def do_kill(self, place: int) -> None:
        for found in self.registered[place : place + 1]:
            self.driver.answers.pop(found.check, None)

    def do_fail(self, place: int) -> None:
        for found in self.registered[place : place + 1]:
            if found.check in self.driver.answers:
                self.driver.answers[found.check] = self.driver.answers[found.check]._replace(can_run=False)

    def do_select(self, value: tuple[int, bool]) -> None:
        mode, by_executor = value
        self.driver.commander.select(mode, by_executor=by_executor)

    def do_arm(self, is_forced: bool) -> None:  # noqa: FBT001 - drawn
        if self.driver.commander.arm(is_forced=is_forced) == ACCEPTED:
            self.was_told_to_arm = True

    def do_disarm(self, is_forced: bool) -> None:  # noqa: FBT001 - drawn
        self.driver.commander.disarm(is_forced=is_forced)

    def do_override(self, value: tuple[int, bool, int]) -> None:
        owner, of_executor, seconds = value
        overrides = Overrides(keeps_armed=seconds < 0, defers=True, defer_seconds=seconds)
        self.driver.commander.override(owner, overrides, of_executor=of_executor)

    def do_sense(self, changes: dict[str, Any]) -> None:
        self.driver.sense(**changes)

    def do_run(self, seconds: float) -> None:
        self.driver.run(seconds)

    def check(self) -> None:
        """Check what always holds after a step."""
        self.driver.step()
        one = self.driver.commander
        components, checks = one.components, one.checks
        assert one.executor_in_charge == 0 or one.executor_in_charge in components.executors
        assert set(components.executors.values()) <= set(components.modes)
        assert {own.check for own in components.modes.values()} <= set(checks.registered)
        assert {each.mode for each in checks.registered.values()} == set(components.modes)
        assert not checks.mask & ~sum(1 << number for number in checks.registered)
        assert not one.components.selectable >> 23 & ~sum(1 << mode - 23 for mode in components.modes)
        assert not one.is_armed or self.was_told_to_arm
        assert one.is_armed or one.mode in {one.intention, nav_states.TERMINATION}
        assert not one.failsafe.is_active or one.executor_in_charge == 0
        assert one.failsafe.defer_state < 2 or not one.failsafe.is_active
        self.was_told_to_arm = one.is_armed


@given(st.sampled_from([0, 1]), st.lists(operations(*OPERATIONS), max_size=25))
def test_what_always_holds(setting: int, steps: list[tuple[str, Any]]) -> None:
    play = Play(setting)
    for name, value in steps:
        play.do(name, value)
        play.check()


@given(st.lists(operations(*(name for name in OPERATIONS if name != "arm")), max_size=15))
def test_nothing_arms_by_itself(steps: list[tuple[str, Any]]) -> None:
    play = Play(1)
    for name, value in steps:
        play.do(name, value)
        play.check()
        assert not play.driver.commander.is_armed
