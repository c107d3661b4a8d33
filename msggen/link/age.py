"""How long what a program sends may wait on its way to a vehicle. What waits longer is dropped and counted.

A setpoint, a heartbeat or a command that arrives late asks for what the program wanted earlier, in a mode that the
vehicle may have left. So each has a time until which it may be sent:

- a message of a topic that PX4 reads, of any topic: `LONGEST_S` after `publish` was called
- a request to a service: as long as its caller waits for the reply

Nothing is sent after that, and nothing is published twice. Who needs an answer, as a registration does, publishes
again.

Times are those of `now`. All processes of a computer share that clock; `OtherClock` is that of another computer.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from functools import cache, partial
from typing import Final

LONGEST_S: Final = 0.5
"""The longest time in s that a message may wait: after it, PX4 takes a goto or an Offboard heartbeat for lost."""
LONGEST_NS: Final = round(LONGEST_S * 1e9)
LATE: Final = f"waited for more than {LONGEST_S:g} s: dropped"
NEVER: Final = (1 << 63) - 1
"""The time until which something may be sent that does not expire."""
_SURE_NS: Final = 1_000_000_000
"""How long no time may agree with those before until they count as wrong."""
_DRIFT: Final = 2e-4
"""By how much of the elapsed time two clocks may drift apart. Quartz clocks do by less than 1e-4."""

now: Final[Callable[[], int]] = (
    partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME) if sys.platform == "linux" else time.monotonic_ns
)
"""Returns the time in ns since some moment. The clock goes on while the computer sleeps."""


def expiry(waited: float = 0.0) -> int:
    """Return the time until which a message may be sent that is published now, and has waited for some s already."""
    until = now() + LONGEST_NS
    return until - round(waited * 1e9) if waited > 0.0 else until


def is_over(until: int) -> bool:
    """Whether the time until which something may be sent has passed, or cannot be right."""
    return not 0 <= until - now() <= LONGEST_NS


@cache
def clock_name() -> str:
    """Return what identifies the clock of `now` among those of all computers, "" if that is not known."""
    try:
        with open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
            return f"{file.read(64).strip()} {os.readlink('/proc/self/ns/time')}"
    except (OSError, ValueError):
        return ""


class OtherClock:
    """The clock of another process, which may run on another computer, as far as its messages tell it.

    A time that arrives was told some time ago, so what is computed from it is late by the shortest delay so far, and
    never early: nothing is taken for younger than it is.

    A time that differs by more than `LONGEST_S` was told by somebody else, or was held up: it counts only if none
    agrees for a second after the first such one.
    """

    def __init__(self) -> None:
        self._offset: int | None = None
        self._heard = 0
        self._odd: int | None = None
        """Since when times do not agree with those before."""

    def hear(self, theirs: int, name: str) -> None:
        """Take the time that the other clock has just told, and its name."""
        own = now()
        if name and name == clock_name():
            self._offset = 0
            return
        offset = theirs - own
        known = offset if self._offset is None else self._offset - int((own - self._heard) * _DRIFT)
        if abs(offset - known) <= LONGEST_NS:
            known, self._odd = max(offset, known), None
        elif self._odd is None:
            self._odd = own
        elif own - self._odd > _SURE_NS:
            known, self._odd = offset, None
        self._offset, self._heard = known, own

    def of(self, own: int) -> int:
        """Return the time of the other clock at a time of the own one; NEVER stays what it is."""
        return own if own == NEVER else own + (self._offset or 0)

    def own(self, theirs: int) -> int:
        """Return the time of the own clock at a time of the other one."""
        return theirs - (self._offset or 0)
