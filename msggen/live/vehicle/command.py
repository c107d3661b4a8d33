"""Commands to a vehicle: VehicleCommand by topic, and the acknowledgement that answers it."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msggen.live.link import LinkTimeoutError, NotConnectedError, TopicError
from msggen.live.messages.names import stem_of

if TYPE_CHECKING:
    from msggen.live.messages.packages import Message
    from msggen.live.vehicle.vehicle import Vehicle

COMMAND = "/fmu/in/vehicle_command"
ACKNOWLEDGEMENT = "/fmu/out/vehicle_command_ack"

_IN_PROGRESS = "IN_PROGRESS"
_STATUS_S = 5.0
"""How long to wait for a VehicleStatus, which PX4 publishes at 2 Hz and more."""
_SLICE_S = 0.2
"""The longest wait without a look at the connection and at signals."""


def address_of(vehicle: Vehicle) -> tuple[int, int]:
    """Return the system id and the component id of a vehicle, from its VehicleStatus, or 1 and 1 without one.

    PX4 ignores commands for other systems. Raises NotConnectedError.
    """
    with suppress(TopicError, LinkTimeoutError), vehicle.subscribe("vehicle_status") as statuses:
        status = statuses.wait_for(lambda _: True, timeout=_STATUS_S)
        return int(status.system_id), int(status.component_id)
    return 1, 1


def acknowledges(vehicle: Vehicle) -> bool:
    """Whether a vehicle publishes acknowledgements: those before v1.15 do not. Raises NotConnectedError."""
    return any(stem_of(route.name).endswith(ACKNOWLEDGEMENT) for route in vehicle.routes)


def send_command(
    vehicle: Vehicle, command: Message, timeout: float, progress: Callable[[Any], object] = lambda _: None
) -> Any:
    """Publish a VehicleCommand, and return the VehicleCommandAck that answers it. `timeout` is in s.

    `progress` gets acknowledgements with the result IN_PROGRESS; each of them begins the time-out again. An
    acknowledgement names the command, not its sender: of two programs with the same command, both get both answers.

    Raises LinkTimeoutError if no module of PX4 answers, and the errors of `Vehicle.publish` and `Vehicle.subscribe`.
    """
    number: int = command.command  # type: ignore[attr-defined]
    answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
    with vehicle.subscribe("vehicle_command_ack", answers.put):
        vehicle.publish(command, COMMAND)
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            try:
                answer = answers.get(timeout=_SLICE_S)
            except queue.Empty:
                if not vehicle.is_connected:
                    raise NotConnectedError("the vehicle disconnected before it answered") from None
                continue
            if answer.command == number and answer.result != answer.__msg__.enum("result")[_IN_PROGRESS]:
                return answer
            if answer.command == number:
                progress(answer)
                deadline = time.monotonic() + timeout
    raise LinkTimeoutError(f"no acknowledgement within {timeout:g} s: no module of PX4 has answered the command")
