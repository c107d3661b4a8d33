"""Commands to a vehicle: VehicleCommand by topic, and the acknowledgement that answers it."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msggen.link.link import LinkTimeoutError, NotConnectedError, TopicError
from msggen.messages.names import stem_of
from msggen.messages.refusals import reasons_for_command

if TYPE_CHECKING:
    from msggen.messages.packages import Message
    from msggen.vehicle.vehicle import Vehicle

COMMAND = "/fmu/in/vehicle_command"
ACKNOWLEDGEMENT = "/fmu/out/vehicle_command_ack"

_IN_PROGRESS = "IN_PROGRESS"
_STATUS_S = 5.0
"""How long to wait for a VehicleStatus, which PX4 publishes at 2 Hz and more."""
_STATE_S = 2.0
"""How long to wait for another state of the vehicle."""
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


def altitude_above(vehicle: Vehicle, height: float) -> float:
    """Return the altitude above mean sea level in m that is some m above where a vehicle is.

    Raises NotConnectedError, and LinkTimeoutError if the vehicle does not know its altitude.
    """
    place = _newest(vehicle, "vehicle_local_position", lambda each: bool(each.z_valid and each.z_global))
    if place is None:
        raise LinkTimeoutError(
            "the vehicle does not know its altitude above sea level, which a takeoff to a height needs"
        )
    return float(place.ref_alt - place.z + height)


def reasons_of(vehicle: Vehicle, command: Message, cure: str) -> Sequence[str]:
    """Return why a vehicle refuses a VehicleCommand, as far as it shows that. `cure` is what selects Hold."""
    sent: Any = command
    parameters = [getattr(sent, f"param{number}") for number in range(1, 8)]
    flags, status = (_newest(vehicle, topic, lambda _: True) for topic in ("failsafe_flags", "vehicle_status"))
    return [*reasons_for_command(sent.command, parameters, flags, status, cure)]


def _newest(vehicle: Vehicle, topic: str, is_meant: Callable[[Any], bool]) -> Any:
    """Return the newest message of a topic that is meant, None if there is none for some time."""
    with suppress(TopicError, LinkTimeoutError), vehicle.subscribe(topic) as samples:
        return samples.wait_for(is_meant, timeout=_STATE_S)
    return None


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
