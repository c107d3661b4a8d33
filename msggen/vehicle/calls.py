"""Calls of services: those of several threads wait in a queue, and one is on the wire at a time."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from msggen.link.age import now
from msggen.link.link import Link, LinkError, LinkTimeoutError, NotConnectedError, Remote, Service
from msggen.vehicle.feed import check_outside_callback

WAITING = 16
"""The number of calls that may wait for those before them."""

_SLICE = 0.2


class _Call:
    def __init__(self) -> None:
        self.number = -1
        self.reply: bytes | None = None
        self.problem = ""
        """Why the owner of the link has not sent it."""

    @property
    def is_over(self) -> bool:
        """Whether nothing follows."""
        return self.reply is not None or bool(self.problem)


class Calls:
    """The calls of one vehicle. PX4's client keeps one request: a second one would leave the first without a reply."""

    def __init__(self, remote: Remote, link: Link) -> None:
        self._remote, self._link = remote, link
        self._changed = threading.Condition()
        self._queue: deque[_Call] = deque()
        self._last = 0
        self._reason: str | None = None

    def call(self, service: Service, payload: bytes, timeout: float) -> bytes:
        """Return the reply to a request. The time-out in s includes the time in the queue.

        Raises LinkTimeoutError, NotConnectedError if the vehicle disconnects, and LinkError if too many calls wait or
        the vehicle does not take the request.
        """
        check_outside_callback()
        deadline = time.monotonic() + timeout
        until = now() + int(timeout * 1e9)
        call = _Call()
        with self._changed:
            if len(self._queue) > WAITING:
                raise LinkError(f"{WAITING} calls of '{service.name}' are waiting: wait for their replies first")
            self._queue.append(call)
        try:
            self._wait(lambda: self._queue[0] is call, deadline, service, f"other calls took all of {timeout:g} s")
            with self._changed:
                self._last += 1
                call.number = self._last
            self._link.call(self._remote, service, call.number, payload, until)
            self._wait(lambda: call.is_over, deadline, service, f"no reply within {timeout:g} s")
            if call.problem:
                raise LinkError(call.problem)
        finally:
            if call.number > 0 and not call.is_over:
                self._link.cancel(self._remote, call.number)
            with self._changed:
                self._queue.remove(call)
                self._changed.notify_all()
        return call.reply or b""

    def replied(self, number: int, payload: bytes) -> None:
        """Take a reply. One to an earlier call, which no longer waits, is ignored."""
        with self._changed:
            if self._queue and self._queue[0].number == number:
                self._queue[0].reply = payload
                self._changed.notify_all()

    def refused(self, number: int, problem: str) -> None:
        """End a call that was not sent."""
        with self._changed:
            if self._queue and self._queue[0].number == number:
                self._queue[0].problem = problem
                self._changed.notify_all()

    def fail(self, reason: str) -> None:
        """End all calls: the vehicle disconnected."""
        with self._changed:
            self._reason = reason
            self._changed.notify_all()

    def _wait(self, is_done: Callable[[], bool], deadline: float, service: Service, problem: str) -> None:
        with self._changed:
            while not is_done():
                if self._reason is not None:
                    raise NotConnectedError(
                        f"the vehicle disconnected during a call of '{service.name}': {self._reason}"
                    )
                rest = deadline - time.monotonic()
                if rest <= 0:
                    text = f"'{service.name}': {problem}; PX4 replies when a module acknowledges"
                    raise LinkTimeoutError(text)
                self._changed.wait(min(rest, _SLICE))
