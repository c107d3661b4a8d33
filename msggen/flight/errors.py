"""What goes wrong when a program flies a vehicle."""

from __future__ import annotations

from collections.abc import Sequence


class FlightError(Exception):
    """A vehicle cannot do, or has not done, what a program asked for."""


class UnsupportedError(FlightError):
    """The firmware, or this vehicle, does not have what is needed. The text says which has."""


class LimitError(FlightError):
    """A place is beyond the limits of the program, or they cannot be kept. Nothing was sent."""


class RegistrationError(FlightError):
    """A mode cannot be registered."""


class NoAnswerError(FlightError):
    """The vehicle has not answered in time."""


class RestartedError(FlightError):
    """The vehicle has restarted, and what a program flew has ended."""


class RefusedError(FlightError):
    """The vehicle refuses a command. `reasons` are those that the vehicle shows, for people."""

    def __init__(self, what: str, result: int, reasons: Sequence[str] = ()) -> None:
        """Take what was refused, and the result of VehicleCommandAck."""
        self.result, self.reasons = result, tuple(reasons)
        why = f": {', '.join(reasons)}" if reasons else ""
        super().__init__(f"{what}: {_RESULTS.get(result, f'result {result}')}{why}")


class NotReachedError(FlightError):
    """A mode of PX4, such as a takeoff, has ended before its goal."""


_RESULTS = {
    1: "temporarily rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
    6: "cancelled",
}
"""The results of VehicleCommandAck."""
