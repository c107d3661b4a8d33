"""Failsafes: what PX4 does by itself, how long it waits before, and what ends it.

The facts are those of the failsafe framework of PX4's commander, measured with v1.18. Times are in us.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import NamedTuple

from msggen.messages.nav_states import (
    ALTITUDE,
    DESCEND,
    HOLD,
    LAND,
    OFFBOARD,
    POSITION,
    RETURN,
    STABILIZED,
    TERMINATION,
)

DEFERRED = 30_000_000
"""How long failsafes are deferred if the request does not tell: DEFAULT_DEFER_TIMEOUT."""
_REFILL = 4
"""The time before an action grows again this many times more slowly than it passes."""


class Action(IntEnum):
    """What a failsafe does. A higher one wins."""

    NONE = 0
    WARN = 1
    FALL_BACK_TO_POSITION = 2
    FALL_BACK_TO_ALTITUDE = 3
    FALL_BACK_TO_STABILIZED = 4
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8
    TERMINATE = 9


MODES: Mapping[Action, int] = {
    Action.FALL_BACK_TO_POSITION: POSITION,
    Action.FALL_BACK_TO_ALTITUDE: ALTITUDE,
    Action.FALL_BACK_TO_STABILIZED: STABILIZED,
    Action.HOLD: HOLD,
    Action.RETURN: RETURN,
    Action.LAND: LAND,
    Action.DESCEND: DESCEND,
    Action.TERMINATE: TERMINATION,
}
"""The mode of each action."""


class Trigger(NamedTuple):
    """A reason for a failsafe, and the action to it."""

    action: Action
    waits: bool = True
    """Whether the vehicle holds for a time before the action, and the action can be deferred."""
    stays: bool = False
    """Whether the action goes on when the reason is gone, until a user selects a mode or the vehicle is disarmed."""


class Situation(NamedTuple):
    """What failsafes depend on."""

    is_armed: bool
    mode: int
    """The mode that was selected."""
    is_new: bool
    """Whether it was selected since the last step."""
    triggers: Mapping[str, Trigger]
    """The reasons that are there now."""
    can_run: Callable[[int], bool]


class _Active(NamedTuple):
    trigger: Trigger
    is_there: bool
    """Whether the reason is still there."""


class Failsafe:
    """Selects an action. `hold_time` is COM_FAIL_ACT_T: the time that the vehicle holds before most actions."""

    def __init__(self, hold_time: int) -> None:
        self.action = Action.NONE
        self.user_took_over = False
        """Whether a user has selected a mode in spite of a failsafe."""
        self._active: dict[str, _Active] = {}
        self._hold_time = self._budget = hold_time
        self._wait = 0
        self._time = 0
        self._was_armed = False
        self._defers = False
        self._defer_time: int | None = DEFERRED
        self._deferred_since: int | None = None

    @property
    def is_active(self) -> bool:
        """Whether PX4 flies another mode than the selected one."""
        return self.action > Action.WARN

    @property
    def defer_state(self) -> int:
        """FAILSAFE_DEFER_STATE_*: 0 disabled, 1 enabled, 2 a failsafe waits."""
        return (2 if self._deferred_since is not None else 1) if self._defers else 0

    def defer(self, seconds: int | None) -> None:
        """Defer failsafes, for 30 s if `seconds` is 0 and without an end if it is negative, or no more if None."""
        if seconds is None:
            if self._defers and self._deferred_since is None:
                self._wait = 0
            self._defers = False
        elif not self.is_active:
            self._defers = True
            self._defer_time = None if seconds < 0 else seconds * 1_000_000 or DEFERRED

    def step(self, now: int, situation: Situation) -> Action:
        """Return the action at a time."""
        elapsed, self._time = now - self._time, now
        if situation.is_armed != self._was_armed:
            self._was_armed, self.user_took_over = situation.is_armed, False
            self._active.clear()
        elif situation.is_new or self.user_took_over:
            self._active = {name: each for name, each in self._active.items() if each.is_there}
        since, most = self._deferred_since, self._defer_time
        if since is not None and most is not None and now > since + most:
            self._defers = False
        if since is None:
            self._wait = max(0, self._wait - elapsed)
        self._update(situation.triggers)
        if self.action > Action.HOLD or self.user_took_over or not situation.can_run(HOLD):
            self._wait = 0
        self.action, is_waiting = self._select(now, situation)
        change = -elapsed if is_waiting else elapsed // _REFILL
        self._budget = min(self._hold_time, max(0, self._budget + change))
        return self.action

    def _update(self, triggers: Mapping[str, Trigger]) -> None:
        """Begin and end what there is to do."""
        for name, trigger in triggers.items():
            if name not in self._active:
                if trigger.waits and trigger.action > Action.WARN and not self._wait:
                    self._wait = self._budget
                if trigger.action >= Action.HOLD:
                    self.user_took_over = False
            self._active[name] = _Active(trigger, is_there=True)
        for name in self._active.keys() - triggers.keys():
            trigger = self._active[name].trigger
            if trigger.stays and not (self._defers and trigger.waits):
                self._active[name] = _Active(trigger, is_there=False)
            else:
                del self._active[name]

    def _select(self, now: int, situation: Situation) -> tuple[Action, bool]:
        """Return the action, and whether it is a Hold before another one."""
        took_over, self.user_took_over = self.user_took_over, False
        if self.action is Action.TERMINATE or situation.mode == TERMINATION:
            return Action.TERMINATE, False
        wanted = max((each.trigger.action for each in self._active.values()), default=Action.NONE)
        if not situation.is_armed:
            self._deferred_since = None
            return Action.NONE, False
        can_defer = self._defers and all(each.trigger.waits for each in self._active.values())
        self._deferred_since = (self._deferred_since or now) if can_defer and wanted > Action.WARN else None
        if can_defer:
            return Action.NONE, False
        is_waiting = self._wait > 0 and not took_over and Action.HOLD < wanted < Action.TERMINATE
        found = Action.HOLD if is_waiting else wanted
        if Action.HOLD <= found < Action.TERMINATE and (took_over or (situation.is_new and self.is_active)):
            self.user_took_over, is_waiting = True, False
            found = Action.WARN if situation.can_run(situation.mode) else Action.RETURN
        found = _possible(found, situation)
        if _is_under_way(wanted if is_waiting else found, situation):
            return Action.WARN, False
        return found, is_waiting


def _possible(action: Action, situation: Situation) -> Action:
    """Return an action that is possible: a more severe one if its mode cannot run."""
    if action <= Action.WARN:
        return action
    return next((each for each, mode in MODES.items() if each >= action and situation.can_run(mode)), Action.TERMINATE)


def _is_under_way(action: Action, situation: Situation) -> bool:
    """Whether the selected mode brings the vehicle to the ground already, as a return would."""
    return action is Action.RETURN and situation.mode in {LAND, RETURN} and situation.can_run(situation.mode)


_FALLBACKS: Mapping[int, tuple[Action, ...]] = {
    OFFBOARD: (Action.FALL_BACK_TO_POSITION, Action.FALL_BACK_TO_ALTITUDE, Action.FALL_BACK_TO_STABILIZED),
    POSITION: (Action.FALL_BACK_TO_ALTITUDE, Action.FALL_BACK_TO_STABILIZED),
    ALTITUDE: (Action.FALL_BACK_TO_STABILIZED,),
}
"""What a pilot with sticks flies in place of a mode: the first one that can run. COM_OBL_RC_ACT is 0."""


def fallback(mode: int, *, can_run: Callable[[int], bool], has_sticks: bool) -> Action:
    """Return what PX4 does if the selected mode cannot run."""
    if can_run(mode):
        return Action.NONE
    actions = _FALLBACKS.get(mode, ()) if has_sticks else ()
    return next((each for each in actions if can_run(MODES[each])), Action.RETURN)
