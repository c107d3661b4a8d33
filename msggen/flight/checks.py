"""Replies to the arming checks of PX4: whether modes can run, and what they need."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

from msggen.flight.connection import Connection, Topics, filled
from msggen.flight.feeds import Feeds
from msggen.flight.requirements import Requirement

_MOST_AT_ONCE = 4
"""How many replies PX4's queue holds before v1.18."""
_PAUSE = 0.012
"""The time in s within which PX4's commander reads the replies."""
_AGAIN = 0.1
"""The time in s after which a reply is sent again, because the first one can get lost."""
_OVERDUE = 0.33
"""The time in s after a request by which the next one is overdue: PX4 sends one every 0.31 s."""
_INTERVAL = 0.314
_MOST_LOST = 3
"""How many overdue requests in a row are answered."""
_NUMBERS = 256
_MOST_EVENTS = 5
_EVENT_SIZE = 25


class Severity(IntEnum):
    """Severities of events in PX4."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class Problem(NamedTuple):
    """An unmet condition of a program. While there is one, PX4 does not enter the mode, or leaves it.

    A ground station shows a text only if its event metadata contains the id of `event`.
    """

    event: str
    """The name of the event, such as `my_mode_no_target`."""
    severity: Severity = Severity.ERROR

    @property
    def number(self) -> int:
        """The id of the event."""
        return event_id(self.event)


def event_id(name: str) -> int:
    """Return the id of an event from its name: the lower 24 bits of the FNV-1a hash, and component 1."""
    found = 0x811C9DC5
    for octet in name.encode():
        found = (found ^ octet) * 0x01000193 & 0xFFFFFFFF
    return found & 0xFFFFFF | 1 << 24


class Verdict(NamedTuple):
    """What a program replies to an arming check."""

    can_run: bool = True
    requires: Requirement = Requirement.NONE
    problems: Sequence[Problem] = ()


class Answers:
    """Replies at once to the requests of the vehicle, for all checks of a program.

    PX4 gives up a mode after three or four requests without a reply. So that a lossy link does not end flights, each
    reply is sent twice, and overdue requests are answered before they arrive: their numbers are known.
    """

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection = connection
        topics = Topics(connection.package)
        self._class = topics.incoming("arming_check_reply")
        self._has_short_queue = not topics.has("in", "setpoint_config")
        self._checks: dict[int, Callable[[], Verdict]] = {}
        self._only_asked: set[int] = set()
        self._asked = 0
        """The checks that the last request says that it is for, as a mask of bits: from v1.17 on."""
        self._loop = asyncio.get_running_loop()
        self._end = feeds["arming_check_request"].call(self._take)
        self._timers: list[asyncio.TimerHandle] = []
        """The replies to the last request that are still to be sent."""

    def add(self, check: int, verdict: Callable[[], Verdict], *, only_asked: bool = False) -> None:
        """Reply for the check with an id. With `only_asked`, only to requests whose mask contains the check."""
        self._checks[check] = verdict
        (self._only_asked.add if only_asked else self._only_asked.discard)(check)

    def remove(self, check: int) -> None:
        """Stop replying for a check."""
        self._checks.pop(check, None)

    def close(self) -> None:
        """Stop replying."""
        self._checks.clear()
        self._cancel()
        self._end()

    def _cancel(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    def _take(self, request: Any) -> None:
        self._cancel()
        self._asked = getattr(request, "valid_registrations_mask", 0)
        number = request.request_id
        self._answer(number)
        self._later(_AGAIN, self._answer, number)
        for lost in range(_MOST_LOST):
            self._later(_OVERDUE + lost * _INTERVAL, self._answer, (number + 1 + lost) % _NUMBERS)

    def _answer(self, number: int) -> None:
        for index, check in enumerate(sorted(self._checks)):
            if check in self._only_asked and not self._asked >> check & 1:
                continue
            turn = index // _MOST_AT_ONCE if self._has_short_queue else 0
            if turn:
                self._later(turn * _PAUSE, self._reply, number, check)
            else:
                self._reply(number, check)

    def _later(self, seconds: float, call: Callable[..., None], *values: int) -> None:
        self._timers.append(self._loop.call_later(seconds, call, *values))

    def _reply(self, number: int, check: int) -> None:
        verdict = self._checks.get(check)
        if verdict is None:
            return
        found = verdict()
        events = [self._event(each) for each in found.problems[:_MOST_EVENTS]]
        reply = filled(
            self._class,
            request_id=number,
            registration_id=check,
            can_arm_and_run=found.can_run and not found.problems,
            num_events=len(events),
            **dict.fromkeys(found.requires.fields, True),
        )
        reply.events = (*events, *reply.events[len(events) :])
        self._connection.publish("arming_check_reply", reply)

    def _event(self, problem: Problem) -> Any:
        cls = type(self._class().events[0])
        levels = problem.severity << 4 | problem.severity  # for the log, and for ground stations
        return cls(id=problem.number, log_levels=levels, arguments=bytes(_EVENT_SIZE))
