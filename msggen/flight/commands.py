"""Commands to the vehicle: VehicleCommand with its acknowledgement."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Final

from msggen.flight.errors import FlightError, RefusedError
from msggen.flight.feeds import Condition, Connection, Feeds, Topics, filled
from msggen.messages.commands import ACCEPTED, ARM_DISARM, EXECUTOR, IN_PROGRESS, SET_NAV_STATE
from msggen.messages.refusals import reasons_for_command

COMPANION: Final = 191
"""The component id of a companion computer in MAVLink: PX4 takes commands of components below 1000 as a user's."""
_TRIES = 6
"""With 20 % loss in both directions, one command in 460 gets no answer."""
_OF_ACTUATORS = 0.1
"""The shortest period in s of commands that set actuators."""
_PATIENCE = 0.3
"""How long to wait for an acknowledgement, in s. PX4 v1.18 takes 4 to 17 ms."""


class Commands:
    """Sends commands of a user or of an executor."""

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection, self._feeds = connection, feeds
        self._topics = Topics(connection.package)
        self._lock = asyncio.Lock()
        """For one command at a time: an acknowledgement has only the number of the command."""
        self._actuators = 0.0
        """When a command may set actuators next."""
        self._is_closed = False
        self.problems_in: Callable[[int], Sequence[str]] = lambda _: ()
        """Returns the problems that the program itself reports, which prevent a mode, and arming in it."""

    def close(self) -> None:
        """Send nothing any more."""
        self._is_closed = True

    async def send(
        self,
        number: int,
        *parameters: float,
        executor: int = 0,
        what: str = "",
        shown: Condition | None = None,
    ) -> None:
        """Send a command until the vehicle answers. Parameters that are not given are NaN.

        The answer can get lost. `shown` says whether a VehicleStatus shows the effect of the command. If one does, the
        command is not sent again, because it could undo a later command.

        Raises RefusedError with the reasons that the vehicle reports, and NoAnswerError after six tries of 0.3 s.
        """
        topic = "vehicle_command_mode_executor" if executor else "vehicle_command"
        source = EXECUTOR + executor if executor else COMPANION
        status = self._feeds["vehicle_status"].latest
        system, component = (0, 0) if status is None else (status.system_id, status.component_id)  # 0: any vehicle
        values = [*parameters, *[math.nan] * (7 - len(parameters))]
        message = filled(
            self._topics.incoming(topic),
            command=number,
            target_system=system,
            target_component=component,
            source_system=1,
            source_component=source,
            from_external=True,
            **{f"param{place}": value for place, value in enumerate(values, 1)},
        )
        what = what or f"command {number}"

        def is_answer(answer: Any) -> bool:
            is_mine = answer.command == number and answer.target_component == source
            return bool(is_mine and answer.result != IN_PROGRESS)

        async with self._lock:
            answer = await self._answered(topic, message, is_answer, what, shown)
        if answer is not None and answer.result != ACCEPTED:
            flags, status = (self._feeds[each].latest for each in ("failsafe_flags", "vehicle_status"))
            reasons = reasons_for_command(number, values, flags, status, "`hold()`")
            raise RefusedError(what, answer.result, [*reasons, *self._own_reasons(number, values, status)])

    def _own_reasons(self, number: int, values: Sequence[float], status: Any) -> Sequence[str]:
        """Return the problems of the program that PX4 knows by their numbers only."""
        if number == SET_NAV_STATE:
            return self.problems_in(int(values[0]))
        return self.problems_in(status.nav_state) if number == ARM_DISARM and values[0] and status is not None else ()

    async def pace_actuators(self) -> None:
        """Wait until a command may set actuators: PX4 takes 10 a second."""
        now = asyncio.get_running_loop().time()
        due, self._actuators = max(now, self._actuators), max(now, self._actuators) + _OF_ACTUATORS
        await asyncio.sleep(due - now)

    async def _answered(
        self, topic: str, message: Any, is_answer: Condition, what: str, shown: Condition | None
    ) -> Any:
        """Send a message until the vehicle answers, and return that, or None if it has shown the effect."""
        answers = self._feeds["vehicle_command_ack"]  # before the command: a shared link follows it only then
        with self._noticing(shown) as has_shown:
            for _ in range(_TRIES):
                if self._is_closed:
                    raise FlightError(f"{what}: the flight has ended")
                self._connection.publish(topic, message)
                with suppress(TimeoutError):
                    return await answers.following(is_answer, _PATIENCE)
                if has_shown():
                    return None
        raise self._feeds.no_answer(f"{what}: no answer from the vehicle to {_TRIES} tries of {_PATIENCE} s")

    @contextmanager
    def _noticing(self, shown: Condition | None) -> Iterator[Callable[[], bool]]:
        """Return a function that says whether a VehicleStatus has met a condition since."""
        found: list[Any] = []
        end = self._feeds["vehicle_status"].call(lambda each: found.append(each) if shown and shown(each) else None)
        try:
            yield lambda: bool(found)
        finally:
            end()
