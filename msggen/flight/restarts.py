"""Detects that a vehicle no longer knows modes or checks of a program: it has restarted, or has removed them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from msggen.flight.feeds import UTC, Feeds
from msggen.flight.states import is_disarmed

_GAP = 1.0
"""The time in s without a VehicleStatus that can be a restart: PX4 takes 2 s or more."""
_QUIET = 3.0
"""The time in s without an arming-check request after which nothing is registered: PX4 sends one every 0.3 s.

At a loss of 20 %, some flights lose five requests in a row, and none loses ten."""
_BURST = 0.1
"""The time in s between two requests within which they have waited for a program that hung, and are outdated."""
_MISSES = 5
"""How many requests without an own id show that it was removed. A mode that answers again is in the second one."""
_REMOVED = 1.0
"""The time in s between two requests from which on PX4 may have removed a check without a mode: 3 replies are missing.

Before v1.17, requests do not say this."""


class Restarts:
    """Watches the clocks of a vehicle, and whether it asks for the checks of a program."""

    def __init__(
        self, feeds: Feeds, checks: Callable[[], int], alone: Callable[[], int], tell: Callable[[str, int], None]
    ) -> None:
        """Take functions that return the own checks, and those without a mode, as bit masks.

        `tell` is called with the reason of a loss, and what is lost as a mask.
        """
        self._feeds, self._checks, self._alone, self._tell = feeds, checks, alone, tell
        self._loop = asyncio.get_running_loop()
        self._last: Any = None
        self._mode_time = 0
        self._heard = float("-inf")
        self._since = 0.0
        """When the vehicle was heard again, or everything was registered. Before that, no request can be missed."""
        self._misses = 0
        self._asked = self._loop.time() - _BURST
        """When the last request has come, or could have come first."""
        self._is_unsure = False
        """Whether a check without a mode may have been removed, on a vehicle that does not say so."""
        self.close = feeds["arming_check_request"].call(self._take_request)
        """Stops watching."""

    def begin(self) -> None:
        """Expect requests from now on."""
        self._since, self._misses = self._loop.time(), 0
        self._asked = max(self._asked, self._since - _BURST)

    def take(self, status: Any) -> None:
        """Take a VehicleStatus before modes and executors do: if the vehicle has restarted, they end first."""
        now, last = self._loop.time(), self._last
        if now - self._heard > _GAP:
            self._since = now
        is_restarted = last is not None and self._goes_back(status, is_gap=now - self._heard > _GAP)
        self._heard, self._last = now, status
        if is_restarted:
            self._mode_time = 0
            self._lose("the vehicle has restarted", self._checks())
        elif min(now - self._since, self._feeds["arming_check_request"].age) > _QUIET:
            self._lose("the vehicle has restarted, or has removed what was registered", self._checks())
        self._mode_time = max(self._mode_time, status.nav_state_timestamp)

    def _goes_back(self, status: Any, *, is_gap: bool) -> bool:
        """Whether a clock of the vehicle goes back. Reordered messages do not count."""
        before, after = self._last.timestamp, status.timestamp
        if max(before, after) < UTC and after + _GAP * 1e6 < before:
            return True
        is_later = is_gap or after > before >= UTC
        return bool(is_later and status.nav_state_timestamp < self._mode_time)

    def _take_request(self, request: Any) -> None:
        now, before = self._loop.time(), self._asked
        self._asked = now
        if now - before < _BURST:
            return
        own = self._checks()
        mask = getattr(request, "valid_registrations_mask", None)
        self._is_unsure |= mask is None and now - before > _REMOVED
        lost = own & ~(own if mask is None else mask)
        self._misses = self._misses + 1 if lost else 0
        if self._last is None or not is_disarmed(self._last):  # in flight, the vehicle takes late replies of modes
            return
        if self._misses >= _MISSES:
            self._lose("the vehicle has removed what was registered", lost)
        elif self._is_unsure:
            self._lose("the vehicle may have removed what was registered", self._alone())

    def _lose(self, why: str, lost: int) -> None:
        self.begin()
        self._is_unsure = False
        if lost:
            self._tell(why, lost)
