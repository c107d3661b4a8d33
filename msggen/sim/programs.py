"""What programs send to a simulated vehicle: of flight modes, commands, and questions about formats."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

from msggen.messages.commands import EXECUTOR, OF_EXECUTOR, RESULTS, TEMPORARILY_REJECTED
from msggen.messages.nav_states import EXTERNAL
from msggen.sim.commander.checks import Reply
from msggen.sim.commander.commander import LOOP
from msggen.sim.commander.components import Overrides, Registration
from msggen.sim.commander.rules import V1_15, V1_15_SITL, V1_16, V1_17, V1_18, Rules
from msggen.sim.commander.setpoint_types import ALL
from msggen.sim.publishing import queue_length
from msggen.sim.world import World

_INTERNAL: Final = range(EXTERNAL.start)
"""The modes that a program can replace: all before NAVIGATION_STATE_EXTERNAL1."""
_REQUIREMENT = "mode_req_"
_CONTROLS = {f"flag_control_{name}_enabled": name for name in ALL}


class Publish(Protocol):
    """Publishes a message on a topic in uORB, if the release has it, with those of the values that it has."""

    def __call__(self, topic: str, /, **values: Any) -> None:
        """Publish."""


def rules_of(uorb: Mapping[str, Any], *, has_versions: bool, is_sitl: bool) -> Rules:
    """Return the rules of the release that has some topics. From v1.16 on, their names have versions."""
    if "setpoint_config" in uorb:
        return V1_18
    request = uorb.get("arming_check_request")
    if request is not None and "valid_registrations_mask" in {each.name for each in request.message.__msg__.fields}:
        return V1_17
    if has_versions:
        return V1_16
    return V1_15_SITL if is_sitl else V1_15


class Programs:
    """Takes messages of programs, and publishes the answers. `handlers` are by the names of topics in uORB.

    It carries out commands, and answers questions about the formats of messages.

    As in PX4, messages to the commander wait for its next loop, in topics that hold a few: a further one replaces the
    oldest.
    """

    def __init__(self, world: World, publish: Publish, tell: Callable[[str], None], hashes: Mapping[str, int]) -> None:
        """Take the hash of the message of each topic, by its name in uORB. `tell` takes lines for people."""
        self._world, self._commander, self._publish = world, world.commander, publish
        self._tell, self._hashes = tell, hashes
        self._loop_time = 0
        self._read: Mapping[str, Callable[[Any, int], None]] = {
            "arming_check_reply": self._take_reply,
            "register_ext_component_request": self._take_registration,
            "unregister_ext_component": self._take_unregistration,
            "config_overrides_request": self._take_overrides,
            "config_control_setpoints": self._take_control_mode,
            "setpoint_config": self._take_setpoint_config,
        }
        """What the commander reads in a loop, in this order."""
        self._queues: dict[str, deque[tuple[Any, int]]] = {}
        self._is_waiting = False
        self.handlers: Mapping[str, Callable[[Any, int], object]] = {
            **{topic: self._queue(topic) for topic in self._read},
            **world.setpoints.handlers,
            **world.autopilot.handlers,
            **world.external.handlers,
            "message_format_request": self._answer_format_request,
            "vehicle_command": self._take_command,
            "vehicle_command_mode_executor": self._take_executor_command,
            "mode_completed": self._take_completed,
        }
        """Each takes a message and its time in us since boot."""

    def _queue(self, topic: str) -> Callable[[Any, int], None]:
        def take(message: Any, time: int) -> None:
            if topic not in self._queues:
                self._queues[topic] = deque(maxlen=queue_length(message))
            self._queues[topic].append((message, time))
            self._is_waiting = True

        return take

    @property
    def next_time(self) -> int | None:
        """The time of the next loop, None if nothing waits for it."""
        return self._loop_time + LOOP if self._is_waiting else None

    def advance(self, now: int) -> None:
        """Read what waits, if a loop begins."""
        if now < self._loop_time + LOOP:
            return
        self._loop_time, was_waiting, self._is_waiting = now - now % LOOP, self._is_waiting, False
        if not was_waiting:
            return
        for topic, take in self._read.items():
            queue = self._queues.get(topic)
            while queue:
                take(*queue.popleft())

    def ask(self) -> None:
        """Publish the requests to arming checks, and the ends of modes."""
        requests, completed = self._commander.requests, self._commander.completed
        while requests:
            request = requests.popleft()
            self._publish("arming_check_request", request_id=request.number, valid_registrations_mask=request.mask)
        while completed:
            self._publish("mode_completed", result=0, nav_state=completed.popleft())

    def _take_registration(self, message: Any, _: int) -> None:
        replaced = message.replace_internal_mode
        replaces = replaced if message.enable_replace_internal_mode and replaced in _INTERNAL else None
        found = self._commander.register(
            Registration(
                _text(message.name),
                check=message.register_arming_check,
                mode=message.register_mode,
                executor=message.register_mode_executor,
                replaces=replaces,
                is_immediate=message.activate_mode_immediately,
            )
        )
        self._publish(
            "register_ext_component_reply",
            request_id=message.request_id,
            name=bytes(message.name),
            px4_ros2_api_version=self._commander.rules.api_version,
            success=found.success,
            arming_check_id=found.check,
            mode_id=found.mode,
            mode_executor_id=found.executor,
            not_user_selectable=getattr(message, "not_user_selectable", False),
        )

    def _take_unregistration(self, message: Any, _: int) -> None:
        ids = message.arming_check_id, message.mode_id, message.mode_executor_id
        self._commander.unregister(_text(message.name), *ids)

    def _take_reply(self, message: Any, time: int) -> None:
        names = (field.name for field in message.__msg__.fields if field.name.startswith(_REQUIREMENT))
        requirements = frozenset(name.removeprefix(_REQUIREMENT) for name in names if getattr(message, name))
        reply = Reply(message.request_id, message.registration_id, message.can_arm_and_run, requirements)
        self._commander.checks.take(reply, time, self._world.time)

    def _take_setpoint_config(self, message: Any, _: int) -> None:
        mode, kind = message.source_id, message.type
        result, requirements = self._commander.configure(mode, kind, is_applied=message.should_apply)
        needs = {f"{_REQUIREMENT}{name}": True for name in requirements}
        self._publish("setpoint_config_reply", type=kind, source_id=mode, result=result, **needs)

    def _take_control_mode(self, message: Any, _: int) -> None:
        controls = frozenset(name for flag, name in _CONTROLS.items() if getattr(message, flag))
        self._commander.control(message.source_id, controls)

    def _take_overrides(self, message: Any, _: int) -> None:
        keeps_home = getattr(message, "disable_auto_set_home", False)
        seconds = message.defer_failsafes_timeout_s
        overrides = Overrides(message.disable_auto_disarm, message.defer_failsafes, seconds, keeps_home)
        self._commander.override(message.source_id, overrides, of_executor=message.source_type == OF_EXECUTOR)
        names = (field.name for field in message.__msg__.fields if field.name != "timestamp")
        self._publish("config_overrides_confirm", **{name: getattr(message, name) for name in names})

    def _take_completed(self, message: Any, _: int) -> None:
        """Publish it again, as the bridge does: both directions are one topic in uORB."""
        self._publish("mode_completed", result=message.result, nav_state=message.nav_state)

    # Commands and formats

    def carry_out(self, command: Any, *, is_refused: bool = False) -> dict[str, int]:
        """Carry out a command and publish its acknowledgement. Return its values, none for that of another vehicle."""
        if command.target_system not in (0, self._world.system_id):
            return {}
        numbers = [getattr(command, f"param{number}") for number in range(1, 8)]
        if is_refused:
            self._world.reason = f"component {command.source_component} is no executor in charge"
            result = TEMPORARILY_REJECTED
        else:
            result = self._world.command(command.command, numbers, command.source_component)
        reason = f": {self._world.reason}" if self._world.reason else ""
        self._tell(f"{_command_name(command)} {RESULTS[result]}{reason}")
        values = {
            "command": command.command,
            "result": result,
            "target_system": command.source_system,
            "target_component": command.source_component,
        }
        self._publish("vehicle_command_ack", **values)
        return values

    def _take_command(self, command: Any, _: int) -> None:
        self.carry_out(command)

    def _take_executor_command(self, command: Any, _: int) -> None:
        """Take a command on the topic of executors, where only the one in charge is heard."""
        is_in_charge = command.source_component == EXECUTOR + self._world.commander.executor_in_charge
        self.carry_out(command, is_refused=not is_in_charge)

    def _answer_format_request(self, request: Any, _time: int) -> None:
        """Tell the hash of a topic's message. PX4 looks up what follows the last `/`, without a version suffix."""
        latest = type(request).LATEST_PROTOCOL_VERSION
        _, slash, name = _text(request.topic_name).rpartition("/")
        found = bool(slash) and name in self._hashes and request.protocol_version == latest
        self._publish(
            "message_format_response",
            protocol_version=latest,
            topic_name=bytes(request.topic_name),
            success=found,
            message_hash=self._hashes[name] if found else 0,
        )


def _text(name: Any) -> str:
    return bytes(name).partition(b"\0")[0].decode(errors="replace")


def _command_name(command: Any) -> str:
    """Return the name of a VehicleCommand's command, such as DO_SET_MODE, or its number."""
    names = (name for name, value in vars(type(command)).items() if value == command.command)
    found = (name.removeprefix("VEHICLE_CMD_") for name in names if name.startswith("VEHICLE_CMD_"))
    return next(found, f"command {command.command}")
