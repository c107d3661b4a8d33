"""What a mode or an executor overrides in PX4: failsafes, disarming after landing, setting the home position."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.feeds import Connection, Feeds, Topics, filled

_REQUEST, _CONFIRM = "config_overrides_request", "config_overrides_confirm"
_LONGEST = 32767
"""The longest time in s for which failsafes can be deferred."""
_OFF, _WAITS = 0, 2
"""FAILSAFE_DEFER_STATE_DISABLED and _WOULD_FAILSAFE of VehicleStatus."""
_TRIES, _PATIENCE = 5, 0.3
_SHOWN = 1.0
"""The time in s within which the status shows that failsafes are deferred."""


class Keeps(NamedTuple):
    """What PX4 leaves unchanged while the mode is active or the executor is in charge."""

    armed: bool = False
    """The vehicle is not disarmed after landing."""
    home: bool = False
    """The home position is not set at takeoff."""


def check_overrides(topics: Topics, keeps: Keeps) -> None:
    """Raise UnsupportedError if the firmware does not support an override."""
    if keeps == Keeps():
        return
    names = {field.name for field in topics.incoming(_REQUEST).__msg__.fields}
    if keeps.home and "disable_auto_set_home" not in names:
        raise UnsupportedError("keeping the home position needs PX4 v1.18: this firmware sets it at takeoff")


class Deferral:
    """Failsafes that are deferred."""

    def __init__(self, feeds: Feeds) -> None:
        self._feeds = feeds

    @property
    def is_waiting(self) -> bool:
        """Whether a failsafe is pending: PX4 has a reason for it, and acts at the end or when the time is over."""
        return _is_waiting(self._feeds["vehicle_status"].latest)

    async def wait(self) -> None:
        """Wait until a failsafe is pending."""
        await self._feeds["vehicle_status"].wait(_is_waiting)


class Overrides:
    """The overrides of a mode or an executor. PX4 applies them while it is active or in charge."""

    def __init__(self, connection: Connection, feeds: Feeds, kind: int, number: int, keeps: Keeps) -> None:
        self._connection, self._feeds = connection, feeds
        self._kind, self._number, self._keeps = kind, number, keeps
        self._topics = Topics(connection.package)
        self._seconds: int | None = None
        """How long failsafes are deferred in s, or None if they are not."""
        self._is_used = False
        """Whether anything was sent to PX4."""
        self._is_closed = False
        self._timers: list[asyncio.TimerHandle] = []

    async def begin(self) -> None:
        """Send the overrides to PX4. Raises NoAnswerError."""
        if self._keeps != Keeps():
            await self._confirm()

    def renew(self) -> None:
        """Send the overrides again, without a deferral: the mode is active again, or the executor in charge again."""
        if self._is_used:
            self._seconds = None
            self._repeat()

    def close(self) -> None:
        """Send nothing more."""
        self._is_closed = True
        self._cancel()

    def _cancel(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    @asynccontextmanager
    async def deferring(self, seconds: float) -> AsyncIterator[Deferral]:
        """See `Executor.deferring_failsafes`."""
        if not 0 < seconds <= _LONGEST:
            raise ValueError(f"expected a time of more than 0 s and at most {_LONGEST} s, got {seconds:g}")
        if self._seconds is not None:
            raise FlightError("failsafes are deferred already: their end would end both")
        self._seconds = math.ceil(seconds)
        try:
            await self._confirm()
            await self._until_shown()
            yield Deferral(self._feeds)
        finally:
            self._seconds = None
            self._repeat()

    async def _until_shown(self) -> None:
        try:
            await self._feeds["vehicle_status"].wait(lambda each: bool(each.failsafe_defer_state != _OFF), _SHOWN)
        except TimeoutError:
            raise FlightError(
                "PX4 does not defer failsafes: one is already active, the mode is not active, or the executor "
                "is not in charge"
            ) from None

    async def _confirm(self) -> None:
        """Send the overrides until PX4 confirms them. Before v1.18, send them a few times. Raises NoAnswerError."""
        if not self._topics.has("out", _CONFIRM):
            self._repeat()
            return
        request = self._request()
        text = "the vehicle has not confirmed the overrides"
        await self._feeds.answer(_CONFIRM, lambda: self._publish(request), lambda each: _is_same(each, request), text)

    def _repeat(self) -> None:
        """Send the overrides now and a few times later, because messages can get lost. Does not wait."""
        self._cancel()
        if self._is_closed:
            return
        request = self._request()
        self._publish(request)
        loop = asyncio.get_running_loop()
        self._timers = [loop.call_later(_PATIENCE * each, self._publish, request) for each in range(1, _TRIES)]

    def _publish(self, request: Any) -> None:
        self._is_used = True
        self._connection.publish(_REQUEST, request)

    def _request(self) -> Any:
        return filled(
            self._topics.incoming(_REQUEST),
            source_type=self._kind,
            source_id=self._number,
            disable_auto_disarm=self._keeps.armed,
            disable_auto_set_home=self._keeps.home,
            defer_failsafes=self._seconds is not None,
            defer_failsafes_timeout_s=self._seconds or 0,
        )


def _is_waiting(status: Any) -> bool:
    return bool(status is not None and status.failsafe_defer_state == _WAITS)


def _is_same(answer: Any, request: Any) -> bool:
    names = [field.name for field in request.__msg__.fields if field.name != "timestamp"]
    return all(getattr(answer, name) == getattr(request, name) for name in names)
