"""Arming checks of programs: requests, replies, and who does not answer.

Times are in us. The facts are those of ExternalChecks in PX4's commander, measured with v1.18.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msggen.sim.commander.rules import Rules

CHECKS = 8
"""The number of arming checks that can be registered: MAX_NUM_REGISTRATIONS."""
INTERVAL = 300_000
"""The time between two requests: UPDATE_INTERVAL."""
_DEADLINE = 50_000
"""The time after a request at which a reply is missing: REQUEST_TIMEOUT."""
_RECOVERIES = 3
"""How often a reply makes an unresponsive registration responsive again."""
_NO_MODE = -1


class Request(NamedTuple):
    """An ArmingCheckRequest."""

    number: int
    """Its request_id, from 0 to 255."""
    mask: int
    """`Checks.mask`: valid_registrations_mask."""


class Reply(NamedTuple):
    """An ArmingCheckReply."""

    request: int = 0
    check: int = 0
    can_run: bool = False
    requirements: frozenset[str] = frozenset()
    """The names of the requirements that are set, without `mode_req_`."""


class Check:
    """A registered arming check. `mode` is the nav_state that it belongs to, -1 for none."""

    def __init__(self, mode: int) -> None:
        self.mode = mode
        self.has_replied = False
        self.misses = 0
        self.is_unresponsive = False
        self.failures = 0
        """How often it became unresponsive."""


class Checks:
    """The arming checks by their ids, and the requests to them."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self.registered: dict[int, Check] = {}
        """The checks by their ids."""
        self._replies: dict[int, Reply] = {}
        """The last reply of each id. As in PX4, a new registration begins with that of the one before it."""
        self._number = 0
        self._time: int | None = None
        """The time of the last request."""
        self._answered: set[int] = set()
        self._has_counted = False
        """Whether missing replies to the last request were counted."""

    @property
    def mask(self) -> int:
        """A bit for each registration that is not unresponsive."""
        return sum(1 << number for number, each in self.registered.items() if not each.is_unresponsive)

    @property
    def is_full(self) -> bool:
        """Whether no further check can be registered."""
        return len(self.registered) == CHECKS

    def register(self, mode: int) -> int:
        """Add the check of a mode, or of none, and return its id."""
        number = next(each for each in range(CHECKS) if each not in self.registered)
        self.registered[number] = Check(mode)
        self._replies.setdefault(number, Reply())
        return number

    def remove(self, number: int, mode: int) -> bool:
        """Remove the check of a mode, or of none. Return False if there is none such."""
        if number not in self.registered or self.registered[number].mode != mode:
            return False
        del self.registered[number]
        return True

    def is_unresponsive(self, number: int) -> bool:
        """Whether a check does not answer."""
        return number in self.registered and self.registered[number].is_unresponsive

    def take(self, reply: Reply, time: int, now: int) -> None:
        """Take a reply with its time. One to another request, or of no check, does not count."""
        check = self.registered.get(reply.check)
        is_old = self._rules.most_age is not None and now > time + self._rules.most_age
        if check is None or is_old or reply.request != self._number:
            return
        self._answered.add(reply.check)
        self._replies[reply.check] = reply
        check.misses, check.has_replied = 0, True
        if check.failures <= _RECOVERIES:
            check.is_unresponsive = False

    def step(self, now: int) -> Request | None:
        """Count missing replies, and return the request that is due."""
        if not self.registered:
            return None
        if self._time is not None and now > self._time + _DEADLINE and not self._has_counted:
            self._count()
        if self._time is not None and now <= self._time + INTERVAL:
            return None
        self._time, self._has_counted = now, False
        self._answered.clear()
        self._number = (self._number + 1) % 256
        return Request(self._number, self.mask)

    def _count(self) -> None:
        missing = self.registered.keys() - self._answered
        self._has_counted = bool(missing)
        for number in sorted(missing):
            check = self.registered[number]
            most = self._rules.misses if check.has_replied else self._rules.first_misses
            check.misses += not check.is_unresponsive
            if check.misses >= most and not check.is_unresponsive:
                if check.mode == _NO_MODE:
                    del self.registered[number]
                    continue
                check.is_unresponsive = True
                check.failures += 1

    def verdicts(self) -> Iterator[tuple[int, Reply | None]]:
        """Yield the mode of each check with its reply, None if it is unresponsive.

        As in PX4, a reply counts for the mode of the check whose id it has: in an id that was never used, the reply is
        zeros until the first one, so it counts for the check 0.
        """
        for number in sorted(self.registered):
            reply = self._replies[number]
            of = self.registered.get(reply.check)
            if of is not None:
                yield of.mode, None if of.is_unresponsive else reply
