"""Faults of a simulated vehicle, of its link and of its pilot, at once or at a given time."""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Callable
from itertools import count

from msggen.flight.pytest.flown import mode_of
from msggen.sim.faults import choose, read_fault
from msggen.sim.near import NearVehicle

_REPLIES = ("arming_check_reply",)
_BOOT = 2.0
"""The time in s that a restart takes."""


class Faults:
    """Faults on request. `at` is the time in s since boot at which one begins, by default now; it lasts `seconds`."""

    def __init__(self, vehicle: NearVehicle, seed: str) -> None:
        self._vehicle = vehicle
        self._random = random.Random(f"losses {seed}")  # noqa: S311 - not for secrets
        self._losses: list[tuple[float, tuple[str, ...]]] = []
        """The shares of messages that are lost, of topics. Empty: all topics."""
        self._due: list[tuple[int, int, Callable[[], object]]] = []
        self._numbers = count()

    # The link

    def lose_link(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Lose all messages, in both directions."""
        self.lose_messages(1.0, seconds=seconds, at=at)

    def lose_messages(self, share: float, *topics: str, seconds: float = math.inf, at: float | None = None) -> None:
        """Lose a share of the messages, from 0 to 1, in both directions: of the given uORB topics, or of all.

        Raises ValueError for another share.
        """
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"expected a share from 0 to 1, got {share:g}")
        loss = share, topics
        self._during(seconds, at, lambda: self._losses.append(loss), lambda: self._losses.remove(loss))

    def silence_program(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Lose the replies of the program to arming checks, which tell PX4 that the program lives."""
        self.lose_messages(1.0, *_REPLIES, seconds=seconds, at=at)

    # The vehicle

    def low_battery(self, remaining: float = 0.1, *, at: float | None = None) -> None:
        """Leave a share of the battery's charge: PX4 calls 0.15 low, 0.07 critical, 0.05 an emergency.

        COM_LOW_BAT_ACT says what PX4 does then, by default a warning. Raises ValueError for a share outside 0 to 1.
        """
        self._begin(at, self._change(f"battery={remaining}"))

    def lose_position(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Let the vehicle lose the estimate of its position at once."""
        self._during(seconds, at, self._change("no-position"), self._change("position"))

    def lose_gps(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Let the vehicle lose GPS. It loses the estimate of its position 5.2 s later."""
        self._during(seconds, at, self._change("no-gps"), self._change("gps"))

    def disturb_compass(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Disturb the magnetic field. The estimator says so, and the vehicle flies on."""
        self._during(seconds, at, self._change("disturbed-compass"), self._change("compass"))

    def weaken_battery(self, seconds: float = math.inf, *, at: float | None = None) -> None:
        """Let the voltage of the battery fall with the current, as that of a worn one: to 3.1 V a cell in hover."""
        self._during(seconds, at, self._change("weak-battery"), self._change("new-battery"))

    def restart(self, *, at: float | None = None) -> None:
        """Restart the vehicle, which takes 2 s. It is back at its start, and knows no programs."""
        self._begin(at, self._vehicle.restart)
        self.lose_link(_BOOT, at=at)

    # The pilot

    def sticks(self, *, there: bool, at: float | None = None) -> None:
        """Start or stop the stick input of a pilot. A vehicle that has had stick input returns when it is lost."""
        self._begin(at, self._change("sticks" if there else "no-sticks"))

    def pilot_takes_over(self, mode: str = "position", *, at: float | None = None) -> None:
        """Let a pilot with sticks select a mode by its name: one of PX4's, or one that a program has registered.

        PX4 may refuse the mode. Raises ValueError for an unknown name.
        """
        connect = self._change("sticks")

        def take_over() -> None:
            connect()
            choose(self._vehicle.world, mode_of(self._vehicle.world, mode), mode)

        self._begin(at, take_over)

    # What the vehicle calls

    def advance(self, now: int) -> None:
        """Apply the faults that are due at a time in us."""
        while self._due and self._due[0][0] <= now:
            heapq.heappop(self._due)[2]()

    def loses(self, topic: str) -> bool:
        """Whether the next message of a topic is lost."""
        matching = [share for share, topics in self._losses if not topics or topic in topics]
        return any(share >= 1.0 or self._random.random() < share for share in matching)

    def _change(self, text: str) -> Callable[[], object]:
        """Return what lets a fault of `msggen sim` happen. Raises ValueError for another text."""
        change = read_fault(text).change
        return lambda: change and change(self._vehicle.world)

    def _during(self, seconds: float, at: float | None, begin: Callable[[], object], end: Callable[[], object]) -> None:
        self._begin(at, begin)
        if math.isfinite(seconds):
            self._add(seconds + (self._vehicle.time / 1e6 if at is None else at), end)

    def _begin(self, at: float | None, action: Callable[[], object]) -> None:
        if at is None:
            action()
        else:
            self._add(at, action)

    def _add(self, at: float, action: Callable[[], object]) -> None:
        heapq.heappush(self._due, (round(at * 1e6), next(self._numbers), action))
