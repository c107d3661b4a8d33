"""Tells when a vehicle no longer knows what a program has registered: it has restarted, or has removed it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

from msggen.flight.feeds import Feeds

_GAP = 1.0
"""The time in s without a VehicleStatus after which the next one can be from after a restart: PX4 takes 2 s or more."""
_QUIET = 3.0
"""The time in s without a request for arming checks after which none are registered: PX4 asks every 0.3 s.

At a loss of 20 %, five requests in a row are lost in some flights, and ten in none."""
_MISSES = 5
"""How many requests without an own id show that it is removed: one that answers again is in the second one."""
_UTC: Final = 10**15
"""Timestamps in us from this one on are since 1970, others since boot."""


class Restarts:
    """Watches the clocks of a vehicle, and whether it asks for the checks of a program."""

    def __init__(self, feeds: Feeds, checks: Callable[[], int], tell: Callable[[str], None]) -> None:
        """Take what returns the own checks as a mask of bits, and what is told why they are lost."""
        self._feeds, self._checks, self._tell = feeds, checks, tell
        self._loop = asyncio.get_running_loop()
        self._last: Any = None
        self._mode_time = 0
        self._heard = float("-inf")
        self._since = 0.0
        """When the vehicle was heard again, or all was registered: before that, no request can be missed."""
        self._misses = 0
        self.close = feeds["arming_check_request"].call(self._take_request)
        """Watches no more."""

    def begin(self) -> None:
        """Expect requests from now on."""
        self._since, self._misses = self._loop.time(), 0

    def take(self, status: Any) -> None:
        """Take a VehicleStatus, before others do: what was flown has ended if the vehicle has restarted."""
        now, last = self._loop.time(), self._last
        if now - self._heard > _GAP:
            self._since = now
        is_restarted = last is not None and self._goes_back(status, is_gap=now - self._heard > _GAP)
        self._heard, self._last = now, status
        if is_restarted:
            self._mode_time = 0
            self._lose("the vehicle has restarted")
        elif min(now - self._since, self._feeds["arming_check_request"].age) > _QUIET:
            self._lose("the vehicle has restarted, or has removed what was registered")
        self._mode_time = max(self._mode_time, status.nav_state_timestamp)

    def _goes_back(self, status: Any, *, is_gap: bool) -> bool:
        """Whether a clock of the vehicle goes back. Messages that overtake others are no restart."""
        before, after = self._last.timestamp, status.timestamp
        if max(before, after) < _UTC and after + _GAP * 1e6 < before:
            return True
        is_later = is_gap or after > before >= _UTC
        return bool(is_later and status.nav_state_timestamp < self._mode_time)

    def _take_request(self, request: Any) -> None:
        own = self._checks()
        mask = getattr(request, "valid_registrations_mask", own)  # from v1.17 on
        self._misses = self._misses + 1 if own & ~mask else 0
        is_armed = self._last is None or self._last.arming_state == self._last.ARMING_STATE_ARMED
        if self._misses >= _MISSES and not is_armed:  # in flight, the vehicle takes late replies
            self._lose("the vehicle has removed what was registered")

    def _lose(self, why: str) -> None:
        self.begin()
        if self._checks():
            self._tell(why)
