"""The commands to a simulated vehicle, and questions about the formats of messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from msggen.messages.commands import EXECUTOR, RESULTS, TEMPORARILY_REJECTED
from msggen.sim.programs import Publish
from msggen.sim.world import World


class Requests:
    """Carries out commands, and publishes the answers. `handlers` are by the names of topics in uORB."""

    def __init__(self, world: World, publish: Publish, tell: Callable[[str], None], hashes: Mapping[str, int]) -> None:
        """Take the hash of the message of each topic, by its name in uORB. `tell` takes lines for people."""
        self._world, self._publish, self._tell, self._hashes = world, publish, tell, hashes
        self.handlers: Mapping[str, Callable[[Any, int], object]] = {
            "message_format_request": self._answer_format_request,
            "vehicle_command": self._take_command,
            "vehicle_command_mode_executor": self._take_executor_command,
        }
        """Each takes a message and its time in us since boot."""

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
        path = bytes(request.topic_name).partition(b"\0")[0].decode(errors="replace")
        _, slash, name = path.rpartition("/")
        found = bool(slash) and name in self._hashes and request.protocol_version == latest
        self._publish(
            "message_format_response",
            protocol_version=latest,
            topic_name=bytes(request.topic_name),
            success=found,
            message_hash=self._hashes[name] if found else 0,
        )


def _command_name(command: Any) -> str:
    """Return the name of a VehicleCommand's command, such as DO_SET_MODE, or its number."""
    names = (name for name, value in vars(type(command)).items() if value == command.command)
    found = (name.removeprefix("VEHICLE_CMD_") for name in names if name.startswith("VEHICLE_CMD_"))
    return next(found, f"command {command.command}")
