"""Errors of programs that fly a vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from msggen.messages.commands import REFUSALS


class FlightError(Exception):
    """The vehicle cannot do, or has not done, what the program asked for."""

    is_handled = False
    """Whether an executor that ends with it has seen to the vehicle already. Otherwise, the vehicle returns home."""


class UnsupportedError(FlightError):
    """The firmware or the vehicle lacks a feature. The text names the release that has it, or another cure."""


class LimitError(FlightError):
    """A place is beyond the limits of the program, or the limits cannot be enforced. Nothing was sent."""


class RegistrationError(FlightError):
    """A mode cannot be registered."""


class NoAnswerError(FlightError):
    """The vehicle has not answered in time."""


class RestartedError(FlightError):
    """The vehicle has restarted, which has ended the modes of the program."""


class RefusedError(FlightError):
    """The vehicle refuses a command. `reasons` are texts for people, as far as the vehicle shows the reasons."""

    def __init__(self, what: str, result: int, reasons: Sequence[str] = ()) -> None:
        """Take the name of the command, and the result in VehicleCommandAck."""
        self.result, self.reasons = result, tuple(reasons)
        why = f": {', '.join(reasons)}" if reasons else ""
        super().__init__(f"{what}: {REFUSALS.get(result, f'result {result}')}{why}")


class NotReachedError(FlightError):
    """A mode, such as Takeoff, has ended before its goal was reached."""


def report(message: str, error: BaseException) -> None:
    """Report an error that nobody waits for to the exception handler of the event loop."""
    asyncio.get_running_loop().call_exception_handler({"message": message, "exception": error})


def watched(
    coroutine: Coroutine[Any, Any, None], name: str, failed: Callable[[asyncio.Task[None], BaseException], None]
) -> asyncio.Task[None]:
    """Return a task of a coroutine. `failed` gets it and the exception that ends it, such as one that a handler raises.

    It may be no Exception, as in a failed test of pytest. SystemExit and KeyboardInterrupt end the program instead.
    """

    def look(task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if error is not None and not isinstance(error, (SystemExit, KeyboardInterrupt)):
            failed(task, error)

    task = asyncio.get_running_loop().create_task(coroutine, name=name)
    task.add_done_callback(look)
    return task
