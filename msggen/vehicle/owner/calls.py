"""The calls of all programs to the services of a vehicle: one is on the wire at a time."""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from msggen.link.age import NEVER, now
from msggen.link.link import LinkError
from msggen.vehicle.owner.program import Program

PATIENCE = 30.0
"""The time in s after which a call without a reply no longer keeps the others waiting."""


class Call(NamedTuple):
    """A call of a program."""

    program: Program
    number: int
    """The number that the program has given it."""
    service: int
    """The index of the service."""
    payload: bytes
    until: int = NEVER
    """The time of `age.now` until which the program waits."""


class CallQueue:
    """The calls of one vehicle, in the order in which they came: a program waits for its reply before it calls again.

    PX4's client keeps one request: a second one would leave the first without a reply.
    """

    def __init__(self, send: Callable[[int, Call], None], refuse: Callable[[Call, str], None]) -> None:
        """Make an empty queue. `send` sends a call with its number on the wire. If it raises LinkError, `refuse` tells
        the program.
        """
        self._send, self._refuse = send, refuse
        self._waiting: deque[Call] = deque()
        self._numbers = itertools.count(1)
        self._current: tuple[int, Call] | None = None
        self._sent_at = 0.0

    def add(self, call: Call) -> None:
        """Take a call."""
        self._waiting.append(call)
        self._go_on()

    def replied(self, number: int) -> Call | None:
        """Return the call that a reply belongs to, and send the next one. None if nobody waits for it any more."""
        if self._current is None or self._current[0] != number:
            return None
        call = self._current[1]
        self._current = None
        self._go_on()
        return call

    def cancel(self, program: Program, number: int | None = None) -> None:
        """Forget a call of a program that no longer waits, or all of them."""

        def is_meant(call: Call) -> bool:
            return call.program is program and number in {None, call.number}

        self._waiting = deque(call for call in self._waiting if not is_meant(call))
        if self._current is not None and is_meant(self._current[1]):
            self._current = None
        self._go_on()

    def look(self) -> None:
        """Go on if a call has been without a reply for too long."""
        if self._current is not None and time.monotonic() - self._sent_at > PATIENCE:
            self._current = None
            self._go_on()

    def _go_on(self) -> None:
        while self._current is None and self._waiting:
            call = self._waiting.popleft()
            if now() > call.until:
                continue
            number = next(self._numbers)
            self._current, self._sent_at = (number, call), time.monotonic()
            try:
                self._send(number, call)
            except LinkError as error:
                self._current = None
                self._refuse(call, str(error))
