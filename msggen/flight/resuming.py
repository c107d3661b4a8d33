"""What a program does with the ids that one before it has left: it goes on with them, or removes them."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from logging import getLogger
from typing import Any

from msggen.flight.checks import Answers, Verdict
from msggen.flight.errors import NoAnswerError, RegistrationError
from msggen.flight.feeds import Feeds
from msggen.flight.memory import Memory, Remembered
from msggen.flight.mode import Mode, needs_of
from msggen.flight.registration import Ids, Registrar

LOGGER = getLogger("msggen.flight")
FRESH = 2.0
"""The age in s up to which an earlier program's ids are its own for certain: a vehicle does not start faster."""
_HEARD = 2.0
_REMOVED = 0.05
"""The time in s in which a vehicle has removed a mode."""
_ASKED = 0.5
"""The time in s within which a vehicle asks for the checks of modes, which it does every 0.3 s."""


class Resuming:
    """Looks for the ids of a mode."""

    def __init__(
        self, memory: Memory | None, feeds: Feeds, answers: Answers, registrar: Registrar, *, resume: bool
    ) -> None:
        self._memory, self._feeds, self._answers, self._registrar = memory, feeds, answers, registrar
        self._resume = resume
        self._found: Remembered | None = None

    async def ids_of(self, mode: Mode) -> Ids | None:
        """Return the ids with which the vehicle still flies, or can fly, a mode, or None: it is to be registered.

        Raises RegistrationError if another program flies it, or if the vehicle has lost it in flight and the program
        was not told to resume.
        """
        self._found = self._memory.claim(mode.name) if self._memory is not None else None
        found = self._found
        if found is None or found.is_over:
            return None
        if found.age < FRESH:  # at once, before anything else is known: PX4 waits for 1 s
            self._answers.add(found.ids.check, lambda: Verdict(requires=needs_of(mode)), only_asked=True)
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
        """Warn of a mode that has another slot than before."""
        if self._found is not None and self._found.ids.mode != ids.mode:
            LOGGER.warning(
                "mode %r is mode %d of the vehicle and was %d before: another program flies a mode of this name, or "
                "one that was killed did; a switch of a transmitter selects the old one",
                *(ids.name, ids.mode, self._found.ids.mode),
            )

    async def _resumed(self, found: Remembered) -> Ids | None:
        status = await self._feeds["vehicle_status"].wait(lambda _: True, _HEARD)
        if not _is_same_boot(found, status):
            return None
        if status.arming_state != status.ARMING_STATE_ARMED:
            self._registrar.unregister(found.ids)  # otherwise the mode would get another slot
            await asyncio.sleep(_REMOVED)
            return None
        if not await self._is_lost(found.ids) or self._resume:
            return found.ids
        raise RegistrationError(
            f"{found.ids.name}: an earlier program has lost the mode in flight. Flight(..., resume=True) goes on with "
            "it, or let the vehicle land first"
        )

    async def _is_lost(self, ids: Ids) -> bool:
        """Whether the vehicle waits no longer for the replies of a mode."""
        flags = await self._feeds["failsafe_flags"].wait(lambda _: True, _HEARD)
        if flags.mode_req_other >> ids.mode & 1:
            return True
        feed = self._feeds["arming_check_request"]
        with suppress(TimeoutError):
            request = feed.latest if feed.age < _ASKED else await feed.following(lambda _: True, _ASKED)
            return not is_asked(request, ids.check)
        return True


def is_asked(request: Any, check: int) -> bool:
    """Whether a request is for a check. Before v1.17, it does not tell."""
    return bool(getattr(request, "valid_registrations_mask", -1) >> check & 1)


def _is_same_boot(found: Remembered, status: Any) -> bool:
    """Whether the vehicle has not restarted since an earlier program has flown it."""
    if found.armed_time and status.armed_time:
        return bool(found.armed_time == status.armed_time)
    return found.age < FRESH or bool(found.mode_time and found.mode_time == status.nav_state_timestamp)
