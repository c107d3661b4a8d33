"""The commander: which mode flies, who is in charge, and what a command does.

The facts are those of PX4's commander, measured with v1.18. Times are in us.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from msggen.messages import nav_states
from msggen.messages.commands import ACCEPTED, EXECUTOR, TEMPORARILY_REJECTED
from msggen.messages.setpoints import OTHER_FAILURE, SUCCESS, requirements_of
from msggen.messages.vehicle_types import FIXED_WING, VtolState
from msggen.sim.airframes import AIRFRAMES, Airframe
from msggen.sim.commander import failsafe
from msggen.sim.commander.arming import BY_COMMAND, BY_FAILSAFE, BY_INACTION, BY_LANDING, WhileArmed
from msggen.sim.commander.checks import Checks, Request
from msggen.sim.commander.components import (
    AUTOPILOT,
    NONE,
    REFUSED,
    REFUSED_ARMED,
    Components,
    Overrides,
    Registered,
    Registration,
)
from msggen.sim.commander.failsafe import Action, Failsafe, Situation, Trigger
from msggen.sim.commander.requirements import Requirements, Senses, texts_of
from msggen.sim.commander.rules import Rules
from msggen.sim.commander.setpoint_types import ALL, Controls, controls_of

LOOP = 10_000
"""The time between two steps of PX4's commander."""
_CHECKS = 100_000
"""The time between two looks at the requirements of modes."""
_COMPLETED = 50_000
"""The time between two ModeCompleted of a mode of PX4 that has reached its end."""
_TAKEOFFS = frozenset({nav_states.TAKEOFF, nav_states.VTOL_TAKEOFF})
_REPORTED = _TAKEOFFS | {nav_states.LAND, nav_states.RETURN}
"""The modes whose end PX4 reports."""


class Commander:
    """A vehicle on the ground, disarmed, in Hold. `parameters` are those of PX4 by their names.

    It is one class: each step looks at mode, arming, failsafe and components together, in PX4's order.
    """

    def __init__(
        self, rules: Rules, parameters: Mapping[str, float], airframe: Airframe = AIRFRAMES["multicopter"]
    ) -> None:
        self.rules = rules
        self.airframe = airframe
        self.vtol_state = VtolState.HOVER if airframe.is_vtol else None
        """Whether a VTOL hovers or flies by its wings, None for another vehicle."""
        self.components = Components()
        self.checks = Checks(rules)
        self.failsafe = Failsafe(round(parameters["COM_FAIL_ACT_T"] * 1e6))
        self.mode = self.intention = nav_states.HOLD
        """The mode that flies, and the one that was selected: nav_state and nav_state_user_intention."""
        self.executor_in_charge = AUTOPILOT
        """The id of the executor that commands, 0 for the autopilot."""
        self.is_armed = False
        self.arming_reason = self.disarming_reason = 0
        self.armed_time = self.takeoff_time = self.mode_time = 0
        self.reason = ""
        """Why the last command was refused."""
        self.requests: deque[Request] = deque()
        """The requests to arming checks that were not yet taken."""
        self.completed: deque[int] = deque(maxlen=8)
        """The modes of PX4 that have reported their end and were not yet taken."""
        self.requirements = Requirements(self.vehicle_type)
        self.senses = self._sensed = Senses()
        """What the vehicle knew of itself at the last look at what modes require, and what it knows now."""
        self.is_ready = True
        """Whether nothing was missing for arming at the last look: pre_flight_checks_pass."""
        self._parameters = parameters
        self._selected = nav_states.HOLD
        """The mode that was selected, before one that replaces it is put in its place."""
        self._is_new = False
        self._mode_when_disarmed = nav_states.HOLD
        self._executor = AUTOPILOT
        self._leaving: tuple[str, int, int, int] | None = None
        """The last unregistration that waits until the vehicle is disarmed."""
        self._controls: dict[int, Controls] = {}
        self._overrides: dict[tuple[bool, int], Overrides] = {}
        """By whether it is an executor's, and the id of the executor or the mode."""
        self._applied = Overrides()
        self._now = self._check_time = self._completion_time = 0
        self._resting: int | None = None
        """Since when the vehicle rests on the ground, as far as that disarms it."""
        self._armed = WhileArmed(parameters)

    @property
    def vehicle_type(self) -> int:
        """That of VehicleStatus. A VTOL in a transition counts as a multicopter."""
        return FIXED_WING if self.vtol_state is VtolState.FORWARD else self.airframe.vehicle_type

    @property
    def _in_charge(self) -> int:
        return AUTOPILOT if self.failsafe.is_active else self._executor

    @property
    def displayed(self) -> int:
        """The mode for people: that of the executor in charge, or the one that flies."""
        return self.components.executors.get(self.executor_in_charge, self.mode)

    @property
    def controls(self) -> Controls:
        """What the setpoints of the mode of a program control."""
        return self._controls.get(self.mode, ALL)

    @property
    def missing(self) -> tuple[str, ...]:
        """What is missing for arming, as names of requirements."""
        found = self.requirements.missing(self.mode, self.senses)
        if self.requirements.prevents_arming(self.mode) and not self.is_armed:
            found = (*found, "prevent_arming")
        if self.requirements.blocks_arming:
            found = (*found, "arming_check")
        if self.senses.has_fallen:
            found = (*found, "has_fallen")
        return (*found, "battery") if self.senses.battery > 1 else found

    # Time

    def step(self, now: int, senses: Senses) -> None:
        """Move on to a time. To be called every `LOOP` or more often."""
        was_landed, self._now, self._sensed = self._sensed.is_landed, now, senses
        if self.is_armed and was_landed and not senses.is_landed:
            self.takeoff_time = now
        request = self.checks.step(now)
        if request:
            self.requests.append(request)
        if not self.is_armed or self._can_change_while_armed:
            self._remove_unresponsive()
            if self._leaving:
                self.unregister(*self._leaving)
        self._finish()
        before = self.mode, self.failsafe.action, self.failsafe.defer_state
        self._decide()
        after = self.mode, self.failsafe.action, self.failsafe.defer_state
        if now >= self._check_time + _CHECKS or before != after:
            self._look()

    def _look(self) -> None:
        """Look at the requirements of all modes. The next step decides by what is missing now."""
        self._check_time, self.senses = self._now, self._sensed
        self._armed.had_sticks |= self.senses.manual_control
        modes = self.components.modes
        replaced = {mode: own.replaces for mode, own in modes.items() if own.replaces is not None}
        registered = {each.mode for each in self.checks.registered.values()} & modes.keys()
        kind = FIXED_WING if self.vtol_state and self.vtol_state.is_transition else self.vehicle_type
        self.requirements = Requirements(kind, registered, self.checks.verdicts(), replaced)
        self.is_ready = not self.missing

    def _decide(self) -> None:
        """Choose the mode that flies."""
        situation = Situation(self.is_armed, self._selected, self._is_new, self._triggers(), self._runs)
        self._is_new = False
        action = self.failsafe.step(self._now, situation)
        mode = failsafe.MODES[action] if action > Action.WARN else self._selected
        self.intention = self._flown(self._selected)
        self._fly(self._flown(mode))
        self.executor_in_charge = self._in_charge
        self._apply_overrides()

    def _fly(self, mode: int) -> None:
        if mode == self.mode:
            return
        if self.rules.configures_setpoints:
            self._controls.pop(self.mode, None)
        self.mode, self.mode_time = mode, self._now

    def _flown(self, mode: int) -> int:
        """Return the mode of a program that replaces a mode, if it answers, or the mode itself."""
        found = self.components.replacement(mode)
        if found is None or self.checks.is_unresponsive(self.components.modes[found].check):
            return mode
        return found

    def _triggers(self) -> Mapping[str, Trigger]:
        """Return the reasons for failsafes that are there now."""
        action = failsafe.fallback(self._selected, can_run=self._runs, has_sticks=self.senses.manual_control)
        found = {"mode": Trigger(action, waits=False)} if action else {}
        return {**found, **self._armed.triggers(self._selected, self.senses)} if self.is_armed else found

    def _runs(self, mode: int) -> bool:
        """Whether a mode can run, as failsafes see it."""
        return not self.requirements.missing(mode, self.senses, with_sticks=False)

    def _finish(self) -> None:
        """Report the end of a mode of PX4, and disarm on the ground."""
        mode = self.mode
        if self.is_armed and self._sensed.is_done and mode in _REPORTED:
            if self._now >= self._completion_time + _COMPLETED:
                self._completion_time = self._now
                self.completed.append(mode)
            if mode in _TAKEOFFS and self.executor_in_charge == AUTOPILOT:
                self._select(nav_states.HOLD, by_executor=True)
        self._rest()

    def _rest(self) -> None:
        """Disarm a vehicle that has fallen over, or rested on the ground for long enough, after a flight or before."""
        if self.is_armed and self._sensed.has_fallen:
            self._disarm(BY_FAILSAFE)
        if not self.is_armed:
            self._resting = None
        elif not self.takeoff_time:
            self._resting = self._resting or self._now
            self._disarm_after("COM_DISARM_PRFLT", BY_INACTION, self._parameters["COM_SPOOLUP_TIME"])
        elif not self._applied.keeps_armed:
            self._resting = (self._resting or self._now) if self._sensed.is_landed else None
            self._disarm_after("COM_DISARM_LAND", BY_LANDING)

    def _disarm_after(self, name: str, reason: int, more: float = 0.0) -> None:
        """Disarm after the seconds of a parameter and some more. A parameter that is not positive never disarms."""
        seconds = self._parameters[name]
        if seconds > 0 and self._resting is not None and self._now >= self._resting + (seconds + more) * 1e6:
            self._disarm(reason)

    # Programs

    @property
    def _can_change_while_armed(self) -> bool:
        return self.rules.always_registers or self._parameters["COM_MODE_ARM_CHK"] > 0

    def register(self, wanted: Registration) -> Registered:
        """Take a RegisterExtComponentRequest."""
        if self.is_armed and not self._can_change_while_armed:
            return REFUSED_ARMED
        has_check = not wanted.mode or wanted.check
        if not has_check or not self.components.has_room(wanted) or (wanted.check and self.checks.is_full):
            return REFUSED
        modes = self.components.modes
        mode, executor = self.components.add(wanted) if wanted.mode else (NONE, NONE)
        check = self.checks.register(mode) if wanted.check else NONE
        if wanted.mode:
            modes[mode] = modes[mode]._replace(check=check)
        if wanted.is_immediate and wanted.executor and not self.is_armed:
            self._select(mode)
        return Registered(success=True, check=check, mode=mode, executor=executor)

    def unregister(self, name: str, check: int, mode: int, executor: int) -> None:
        """Take an UnregisterExtComponent. While the vehicle is armed, the last one waits if `COM_MODE_ARM_CHK` is 0."""
        if self.is_armed and not self._can_change_while_armed:
            self._leaving = name, check, mode, executor
            return
        self._leaving = None
        self.checks.remove(check, mode)
        self._remove(mode, name, executor)
        if self.intention == mode and not self.is_armed:
            self._select(nav_states.HOLD)

    def configure(self, mode: int, kind: int, *, is_applied: bool) -> tuple[int, frozenset[str]]:
        """Take a SetpointConfig. Return the result, and the requirements of the type."""
        if mode not in self.components.modes:
            return OTHER_FAILURE, frozenset()
        is_both = self.airframe.is_vtol and self.rules.takes_both_of_vtol
        result, controls = controls_of(kind, self.vehicle_type, is_vtol=is_both)
        if result == SUCCESS and is_applied:
            self._controls[mode] = controls
        return result, requirements_of(controls)

    def control(self, mode: int, controls: Controls) -> None:
        """Take what the setpoints of a mode control, from a VehicleControlMode of v1.15 to v1.17."""
        if mode in self.components.modes:
            self._controls[mode] = controls

    @property
    def keeps_home(self) -> bool:
        """Whether a mode or an executor keeps the home position."""
        return self._applied.keeps_home

    def override(self, owner: int, overrides: Overrides, *, of_executor: bool) -> None:
        """Take the ConfigOverrides of an executor or a mode. It replaces the one before."""
        if owner in (self.components.executors if of_executor else self.components.modes):
            self._overrides[of_executor, owner] = overrides

    def _remove_unresponsive(self) -> None:
        """Remove modes that do not answer and are not selected."""
        for mode, own in [*self.components.modes.items()]:
            if mode != self.intention and self.checks.is_unresponsive(own.check):
                self.checks.remove(own.check, mode)
                self._remove(mode, own.name, own.executor)

    def _remove(self, mode: int, name: str, executor: int) -> None:
        """Remove a mode and its executor, with what they have configured, if the mode has this name."""
        if not self.components.remove(mode, name):
            return
        self.components.executors.pop(executor, None)
        self._controls.pop(mode, None)
        self._overrides.pop((False, mode), None)
        self._overrides.pop((True, executor), None)
        if self._executor == executor:
            self._executor = AUTOPILOT

    def _apply_overrides(self) -> None:
        if not self._overrides and not any(self._applied):
            return
        own = self._overrides.get((False, self.mode), Overrides())
        executor = self._overrides.get((True, self.executor_in_charge), Overrides())
        found = (executor if executor.defers else own)._replace(
            keeps_armed=own.keeps_armed or executor.keeps_armed, keeps_home=own.keeps_home or executor.keeps_home
        )
        self.failsafe.defer(found.defer_seconds if found.defers else None)
        self._applied = found

    # Commands

    def is_refused(self, source_component: int) -> bool:
        """Whether a command comes from an executor that is not in charge. `reason` tells it."""
        executor = source_component - EXECUTOR
        if executor >= AUTOPILOT and executor != self._in_charge:
            self.reason = f"executor {executor} is not in charge"
            return True
        return False

    def select(self, mode: int, *, by_executor: bool = False) -> int:
        """Select a mode, and return the result of the command. Disarmed, all modes can be selected."""
        self.reason = ""
        if self.mode == nav_states.TERMINATION:
            self.reason = "the flight is terminated"
            return TEMPORARILY_REJECTED
        if self.is_armed and mode != nav_states.LAND:
            missing = self.requirements.missing(self.components.replaced_by(mode), self.senses)
            if missing:
                self.reason = texts_of(missing)
                return TEMPORARILY_REJECTED
        self._select(mode, by_executor=by_executor)
        return ACCEPTED

    def _select(self, mode: int, *, by_executor: bool = False) -> None:
        selected = self.components.replaced_by(mode)
        self._selected, self._is_new = selected, True
        if not self.requirements.prevents_arming(selected) and selected not in _TAKEOFFS:
            self._mode_when_disarmed = selected
        self._take_charge(selected, by_executor=by_executor)

    def _take_charge(self, mode: int, *, by_executor: bool) -> None:
        """Let the executor that owns a mode be in charge. If none does, a user's choice ends an executor's charge."""
        owner = self.components.owner(mode)
        if owner != NONE:
            self._executor = owner
        elif not by_executor:
            self._executor = AUTOPILOT

    def arm(self, *, is_forced: bool = False) -> int:
        """Arm, and return the result."""
        self.reason = ""
        if self.is_armed:
            return ACCEPTED
        self._look()
        if self.missing and not is_forced:
            self.reason = texts_of(self.missing)
            return TEMPORARILY_REJECTED
        self.is_armed, self.armed_time, self.arming_reason = True, self._now, BY_COMMAND
        self.takeoff_time = 0
        self._armed.begin(self.senses)
        return ACCEPTED

    def disarm(self, *, is_forced: bool = False) -> int:
        """Disarm, and return the result."""
        self.reason = ""
        if self.is_armed and not self._sensed.is_landed and not is_forced:
            self.reason = "the vehicle is in the air"
            return TEMPORARILY_REJECTED
        if self.is_armed:
            self._disarm(BY_COMMAND)
        return ACCEPTED

    def _disarm(self, reason: int) -> None:
        self.is_armed, self.disarming_reason = False, reason
        self.armed_time = self.takeoff_time = 0
        self._selected = self._mode_when_disarmed
        if not self.rules.asks_executor:
            return
        following = self.components.executors.get(self._executor, self._mode_when_disarmed)
        own = self.components.modes.get(following)
        if own is not None and self.checks.is_unresponsive(own.check):
            following = nav_states.HOLD
        self._selected = following
        self._take_charge(following, by_executor=False)
