"""A simulated commander in the place of PX4 v1.18's in a captured flight: it is told what the captured one was told.

What the vehicle senses stands in the capture, too: estimates, sticks and battery in FailsafeFlags, the ground in
VehicleLandDetected, and the end of PX4's own modes in its ModeCompleted. Times are in us.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from msggen.messages import nav_states
from msggen.messages.commands import EXECUTOR, TEMPORARILY_REJECTED
from msggen.messages.vehicle_types import VtolState
from msggen.sim.airframes import AIRFRAMES
from msggen.sim.commander.checks import Reply
from msggen.sim.commander.commander import Commander
from msggen.sim.commander.components import Overrides, Registration
from msggen.sim.commander.requirements import OF_PX4, Senses
from msggen.sim.commander.rules import V1_18, Rules
from support.flight_captures import SEEN, Captured, Sample

PARAMETERS: Mapping[str, float] = {
    "COM_MODE_ARM_CHK": 1,
    "COM_FAIL_ACT_T": 5,
    "COM_LOW_BAT_ACT": 0,
    "COM_DISARM_LAND": 2,
    "COM_DISARM_PRFLT": 10,
    "COM_SPOOLUP_TIME": 1,
}
STEP = 12_000
"""The loop of the captured commander: it sleeps for 10 ms, in the steps of 4 ms of its simulator. With 10 ms, no flight
differs either, but requests to checks come a little too fast, which would hide a fifth miss."""
_HALF = 157_000
"""Half the time between two requests of the captured commander."""
_AT_END = 150_000
"""The time after a ModeCompleted of PX4 for which its mode is at its end: it is sent each 50 ms."""
_BRING = 600_000
"""The time in a cut at which the commander is brought into the state after it."""
OF_TYPES = ("angular_velocity", "attitude", "local_alt", "local_position")
"""The requirements in SetpointConfigReply."""

VEHICLES: Mapping[str, str] = {"fw": "plane", "vtol": "vtol", "rover": "rover"}
"""The vehicle of a capture by the first word of its name. All others are of a multicopter."""

Values: TypeAlias = tuple[Any, ...]


class Silence(NamedTuple):
    """A time in which programs did not answer, in s."""

    begin: float
    end: float


class OfExecutor(NamedTuple):
    """The overrides of an executor."""

    executor: int
    overrides: Overrides


Told: TypeAlias = Registration | OfExecutor | Silence


class Answer(NamedTuple):
    """What a commander answers."""

    time: int
    topic: str
    values: Values


class Seen(NamedTuple):
    """A value that is there from a time on."""

    time: int
    value: Values


def vehicle_of(name: str) -> str:
    """Return the vehicle of a captured flight: one of `AIRFRAMES`."""
    return VEHICLES.get(name.partition("-")[0], "multicopter")


class Replay:
    """A replay of a captured flight. `told` is what programs told the captured commander in what was cut out."""

    def __init__(
        self,
        package: Any,
        name: str,
        parameters: Mapping[str, float],
        told: Sequence[Told] = (),
        rules: Rules = V1_18,
    ) -> None:
        self.captured = Captured(package, name)
        airframe = AIRFRAMES[vehicle_of(name)]
        self.commander = Commander(rules, {**parameters, **airframe.parameters}, airframe)
        self.answers: list[Answer] = []
        self.seen: dict[str, list[Seen]] = {}
        """Each value that changed, by its name."""
        self._told = told
        self._senses = Senses()
        self._now = self.captured.samples[0].time
        self._requests: dict[int, int] = {}
        """The times of the captured requests by their ids."""
        self._own = (0, 0)
        """The number and the time of our last request."""
        self._waiting: list[tuple[int, int, Any]] = []
        """Replies that wait for our request: the time of the captured one, the delay, and the reply."""
        self._replies: dict[int, Any] = {}
        """The last replies of programs by the ids of checks."""
        self._ends: dict[int, int] = {}
        """When PX4's modes reported their ends for the last time."""
        status = self.captured.first("vehicle_status", 0)
        self.commander.arming_reason = status.latest_arming_reason
        self.commander.disarming_reason = status.latest_disarming_reason
        self._sense(self.captured.first("failsafe_flags", 0))

    def run(self) -> None:
        """Replay the whole capture."""
        samples, cuts = [*self.captured.samples], [*self.captured.cuts]
        self._show()
        while samples:
            self._now += STEP
            while samples and samples[0].time <= self._now:
                self._take(samples.pop(0))
            self._step()
            if cuts and cuts[0][0] <= self._now:
                self._pass_cut(*cuts.pop(0))

    def _step(self) -> None:
        now, commander = self._now, self.commander
        self._reply()
        is_done = now < self._ends.get(commander.mode, -_AT_END) + _AT_END
        commander.step(now, self._senses._replace(is_done=is_done))
        while commander.requests:
            self._own = commander.requests.popleft().number, now
        while commander.completed:
            self._answer("mode_completed", commander.completed.popleft())
        self._show()

    def _show(self) -> None:
        commander = self.commander
        self._see("status", *self._status())
        self._see("vehicle", *self._vehicle())
        self._see("ready", commander.is_ready)
        self._see("selectable", commander.components.selectable)
        self._see("registrations", *[commander.checks.mask] if commander.checks.registered else [])
        self._see("controls", commander.mode in nav_states.EXTERNAL and commander.controls)
        for name, mask in commander.requirements.masks.items():
            self._see(name, mask)

    def _status(self) -> Values:
        one, failsafe = self.commander, self.commander.failsafe
        modes = one.mode, one.intention, one.executor_in_charge, one.displayed
        active = failsafe.is_active, failsafe.user_took_over, failsafe.defer_state
        return (*modes, 2 if one.is_armed else 1, *active, one.arming_reason, one.disarming_reason)

    def _vehicle(self) -> Values:
        one, state = self.commander, self.commander.vtol_state
        is_transition = state is not None and state.is_transition
        return one.vehicle_type, one.airframe.is_vtol, is_transition, state is VtolState.TO_FORWARD

    def _see(self, name: str, *value: Any) -> None:
        seen = self.seen.setdefault(name, [])
        if not seen or seen[-1].value != value:
            seen.append(Seen(self._now, value))

    def _answer(self, topic: str, *values: Any) -> None:
        self.answers.append(Answer(self._now, topic, values))

    # What the capture tells

    def _take(self, sample: Sample) -> None:
        message = sample.message
        if sample.topic == "failsafe_flags":
            self._sense(message)
        elif sample.topic == "vehicle_land_detected":
            self._senses = self._senses._replace(is_landed=message.landed)
        elif sample.topic == "vtol_vehicle_status":
            self.commander.vtol_state = VtolState(message.vehicle_vtol_state)
        elif sample.topic == "mode_completed":
            self._ends[message.nav_state] = sample.time
            self._step()  # before a command that follows it
        elif sample.topic == "arming_check_request":
            self._requests[message.request_id] = sample.time
        elif sample.topic == "arming_check_reply":
            asked = self._requests.get(message.request_id, sample.time)
            self._waiting.append((asked, sample.time - asked, message))
            self._replies[message.registration_id] = message
        elif sample.topic in self._DOES:
            self._DOES[sample.topic](self, message)

    def _sense(self, flags: Any) -> None:
        self._senses = self._senses._replace(
            angular_velocity=not flags.angular_velocity_invalid,
            attitude=not flags.attitude_invalid,
            local_alt=not flags.local_altitude_invalid,
            local_position=not flags.local_position_invalid,
            local_position_relaxed=not flags.local_position_invalid_relaxed,
            global_position=not flags.global_position_invalid,
            global_position_relaxed=not flags.global_position_invalid_relaxed,
            home_position=not flags.home_position_invalid,
            mission=not flags.auto_mission_missing,
            offboard_signal=not flags.offboard_control_signal_lost,
            manual_control=not flags.manual_control_signal_lost,
            ground_station=not flags.gcs_connection_lost,
            battery=flags.battery_warning,
            has_fallen=flags.fd_critical_failure,
        )

    def _register(self, one: Any) -> None:
        replaces = one.replace_internal_mode if one.enable_replace_internal_mode else None
        kinds = one.register_arming_check, one.register_mode, one.register_mode_executor
        wanted = Registration(text_of(one.name), *kinds, replaces, one.activate_mode_immediately)
        version, found = self.commander.rules.api_version, self.commander.register(wanted)
        self._answer("register_ext_component_reply", wanted.name, version, *found)

    def _unregister(self, one: Any) -> None:
        self.commander.unregister(text_of(one.name), one.arming_check_id, one.mode_id, one.mode_executor_id)

    def _configure(self, one: Any) -> None:
        result, needed = self.commander.configure(one.source_id, one.type, is_applied=one.should_apply)
        self._answer("setpoint_config_reply", one.type, one.source_id, result, *(each in needed for each in OF_TYPES))

    def _override(self, one: Any) -> None:
        values = one.disable_auto_disarm, one.defer_failsafes, one.defer_failsafes_timeout_s
        overrides = Overrides(*values, one.disable_auto_set_home)
        self.commander.override(one.source_id, overrides, of_executor=one.source_type == one.SOURCE_TYPE_MODE_EXECUTOR)
        self._answer("config_overrides_confirm", one.source_type, one.source_id, *values)

    def _command_executor(self, one: Any) -> None:
        """Do a command of an executor, or refuse it."""
        if self.commander.is_refused(one.source_component):
            self._answer("vehicle_command_ack", one.command, TEMPORARILY_REJECTED, one.source_component)
        else:
            self._command(one)

    def _command(self, one: Any) -> None:
        """Do a command. PX4 shows its effects before it decides what flies."""
        self._reply()
        if one.command == one.VEHICLE_CMD_DO_VTOL_TRANSITION:
            return
        if one.command == one.VEHICLE_CMD_COMPONENT_ARM_DISARM:
            result = self.commander.arm() if one.param1 == 1 else self.commander.disarm()
        else:
            result = self.commander.select(_mode_of(one), by_executor=one.source_component >= EXECUTOR)
        self._answer("vehicle_command_ack", one.command, result, one.source_component)
        self._see("status", *self._status())

    _DOES: Mapping[str, Any] = {
        "register_ext_component_request": _register,
        "unregister_ext_component": _unregister,
        "setpoint_config": _configure,
        "config_overrides_request": _override,
        "vehicle_command": _command,
        "vehicle_command_mode_executor": _command_executor,
    }

    # Replies to our requests

    def _reply(self) -> None:
        """Give the replies to our request that is nearest to the captured one, as late after it as captured."""
        number, asked = self._own
        waiting, self._waiting = self._waiting, []
        for time, delay, message in waiting:
            if asked < time - _HALF or self._now < asked + delay:
                self._waiting.append((time, delay, message))
            elif asked <= time + _HALF:
                self.commander.checks.take(_reply_of(message, number), self._now, self._now)

    # What was cut out

    def _pass_cut(self, begin: int, end: int) -> None:
        """Bring the commander into the state that the capture shows after a cut, while programs answer as before."""
        self._waiting.clear()
        after = [each.message for each in self.captured.of("arming_check_reply") if end <= each.time < end + SEEN]
        replies = {each.registration_id: each for each in after} | self._replies
        for each in self._told:
            if isinstance(each, Registration):
                self.commander.register(each)
        while self._now < end - STEP:
            self._now += STEP
            if self._own[1] > self._now - 2 * STEP and not self._is_silent():
                for message in replies.values():
                    self.commander.checks.take(_reply_of(message, self._own[0]), self._now, self._now)
            self._step()
            if self._now - STEP <= begin + _BRING < self._now:
                self._bring(end)

    def _is_silent(self) -> bool:
        return any(isinstance(each, Silence) and each.begin < self._now / 1e6 < each.end for each in self._told)

    def _bring(self, end: int) -> None:
        """Do what must have been done in a cut."""
        commander, status = self.commander, self.captured.first("vehicle_status", end)
        executor = status.executor_in_charge
        if executor and commander.executor_in_charge != executor:
            commander.select(commander.components.executors[executor])
        if status.arming_state == status.ARMING_STATE_ARMED:
            commander.arm()
        if commander.intention != status.nav_state_user_intention:
            commander.select(status.nav_state_user_intention, by_executor=executor > 0)
        self._senses = self._senses._replace(is_landed=self.captured.first("vehicle_land_detected", end).landed)
        for each in self._told:
            if isinstance(each, OfExecutor):
                commander.override(*each, of_executor=True)


_BY_COMMAND: Mapping[int, int] = {20: nav_states.RETURN, 21: nav_states.LAND, 22: nav_states.TAKEOFF}
"""The modes that NAV_RETURN_TO_LAUNCH, NAV_LAND and NAV_TAKEOFF select."""
_POSITION, _AUTO = 3, 4
"""Main modes of DO_SET_MODE."""
_EXTERNAL1 = 11
"""A sub mode of _AUTO."""


def _mode_of(command: Any) -> int:
    """Return the mode that a command selects."""
    if command.command in _BY_COMMAND:
        return _BY_COMMAND[command.command]
    if command.command != command.VEHICLE_CMD_DO_SET_MODE:
        return int(command.param1)
    if command.param2 == _AUTO:
        return nav_states.EXTERNAL[int(command.param3) - _EXTERNAL1]
    assert command.param2 == _POSITION
    return nav_states.POSITION


def _reply_of(message: Any, number: int) -> Reply:
    names = frozenset(each for each in OF_PX4 if getattr(message, f"mode_req_{each}", False))
    return Reply(number, message.registration_id, message.can_arm_and_run, names)


def text_of(name: Any) -> str:
    """Return the text in an array of characters."""
    return bytes(name).split(b"\0")[0].decode()
