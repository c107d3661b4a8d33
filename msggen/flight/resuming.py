"""Continuing with the ids that an earlier program has left, or removing them."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from logging import getLogger
from typing import Any

from msggen.flight.checks import Answers, Check, Verdict
from msggen.flight.errors import NoAnswerError, RegistrationError
from msggen.flight.feeds import Feeds
from msggen.flight.memory import Memory, Remembered, booted
from msggen.flight.mode import Mode, needs_of
from msggen.flight.registration import NONE, Ids, Registrar
from msggen.flight.states import is_disarmed

LOGGER = getLogger("msggen.flight")
FRESH = 2.0
"""The age in s up to which the ids of an earlier program are surely valid: no vehicle restarts faster."""
_HEARD = 2.0
_REMOVED = 0.05
"""The time in s within which a vehicle removes a mode."""
_SAME = 1.0
"""By how many s the time of a boot may differ: messages take different times. A restart takes longer."""
_TRIES = 3
_ASKED = 0.5
"""The time in s to wait for an arming-check request: the vehicle sends one every 0.3 s."""


class Resuming:
    """Looks for the ids of a mode or a check."""

    def __init__(
        self, memory: Memory | None, feeds: Feeds, answers: Answers, registrar: Registrar, *, resume: bool
    ) -> None:
        self._memory, self._feeds, self._answers, self._registrar = memory, feeds, answers, registrar
        self._resume = resume
        self._found: Remembered | None = None

    async def ids_of(self, subject: Mode | Check) -> Ids | None:
        """Return the ids of a mode or a check if the vehicle still has them. None: it has to be registered.

        Raises RegistrationError if another program has registered it, or if the vehicle has left the mode in flight and
        the program was started without `resume`.
        """
        self._found = self._memory.claim(subject.name) if self._memory is not None else None
        found = self._found
        if found is None or found.is_over or (found.ids.mode == NONE) is not isinstance(subject, Check):
            return None
        if found.age < FRESH:  # at once, before anything else is known: PX4 waits for 1 s
            early = Verdict(can_run=False) if isinstance(subject, Check) else Verdict(requires=needs_of(subject))
            self._answers.add(found.ids.check, lambda: early, only_asked=True)
        ids = None
        try:
            ids = await self._resumed(found)
        except TimeoutError as error:
            raise NoAnswerError(f"no {error} within {_HEARD:.0f} s") from None
        finally:
            if ids is None:
                self._answers.remove(found.ids.check)
        return ids

    def tell_slot(self, ids: Ids) -> None:
        """Log a warning if a mode has another slot than before."""
        if self._found is not None and self._found.ids.mode != ids.mode:
            LOGGER.warning(
                "mode %r is mode %d of the vehicle and was %d before: another program has, or a killed program had, a "
                "mode of this name; a switch of a transmitter selects the old one",
                *(ids.name, ids.mode, self._found.ids.mode),
            )

    async def _resumed(self, found: Remembered) -> Ids | None:
        status = await self._feeds["vehicle_status"].wait(lambda _: True, _HEARD)
        if not _is_same_boot(found, status):
            return None
        if is_disarmed(status):
            await self._remove(found.ids)
            return None
        is_lost = await self._is_lost(found.ids)
        if is_lost and found.ids.mode == NONE:  # the vehicle takes no late replies
            return None
        if not is_lost or self._resume:
            return found.ids
        raise RegistrationError(
            f"{found.ids.name}: the vehicle has left this mode of an earlier program in flight. Use "
            "Flight(..., resume=True) to continue the mode, or let the vehicle land first"
        )

    async def _remove(self, ids: Ids) -> None:
        """Unregister a mode, and wait for the end of its requests: before that, its name would get another slot."""
        for _ in range(_TRIES):
            self._registrar.unregister(ids)
            await asyncio.sleep(_REMOVED)
            try:
                request = await self._feeds["arming_check_request"].following(lambda _: True, _ASKED)
            except TimeoutError:  # nothing else is registered
                return
            if not (hasattr(request, "valid_registrations_mask") and is_asked(request, ids.check)):
                return

    async def _is_lost(self, ids: Ids) -> bool:
        """Whether the vehicle no longer waits for the replies of a mode or a check."""
        if ids.mode != NONE:
            flags = await self._feeds["failsafe_flags"].wait(lambda _: True, _HEARD)
            if flags.mode_req_other >> ids.mode & 1:
                return True
        feed = self._feeds["arming_check_request"]
        with suppress(TimeoutError):
            request = feed.latest if feed.age < _ASKED else await feed.following(lambda _: True, _ASKED)
            return not is_asked(request, ids.check, unsaid=ids.mode != NONE)
        return True


def is_asked(request: Any, check: int, *, unsaid: bool = True) -> bool:
    """Whether a request is for a check. Before v1.17, requests do not say this."""
    mask = getattr(request, "valid_registrations_mask", None)
    return unsaid if mask is None else bool(mask >> check & 1)


def _is_same_boot(found: Remembered, status: Any) -> bool:
    """Whether the vehicle has not restarted since an earlier program has flown it."""
    if found.armed_time and status.armed_time:
        return bool(found.armed_time == status.armed_time)
    if found.age < FRESH or abs(found.booted - booted(status)) < _SAME:
        return True
    return bool(found.mode_time and found.mode_time == status.nav_state_timestamp)
