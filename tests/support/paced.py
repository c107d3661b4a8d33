"""A simulated vehicle in the program's process that flies in real time, as a real one does."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

from msggen.sim.near import NearVehicle

_INTERVAL = 0.004


class PacedVehicle(NearVehicle):
    """Flies from the first subscription on, in the event loop of the program."""

    def __init__(self, package: ModuleType, speed: float = 1.0) -> None:
        super().__init__(package)
        self._speed, self._began = speed, 0.0
        self._sent: dict[str, float] = {}
        self._timer: asyncio.TimerHandle | None = None
        while self.time < 1_000_000:
            self.advance(self.next_time)

    def subscribe(self, topic: str, take: Callable[[Any], None]) -> Callable[[], None]:
        if self._timer is None:
            self._began = time.monotonic()
            self._move()
        return super().subscribe(topic, take)

    def publish(self, topic: str, message: Any) -> None:
        self._sent[topic] = time.monotonic()
        super().publish(topic, message)

    def age(self, topic: str) -> float:
        """Return how long ago a message of a topic was sent, in s."""
        return time.monotonic() - self._sent[topic]

    def settle(self) -> None:
        """Take what has arrived, after the program has ended."""
        self._takers.clear()
        end = self.time + 100_000
        while self.time < end:
            self.advance(self.next_time)

    def _move(self) -> None:
        until = 1_000_000 + round((time.monotonic() - self._began) * self._speed * 1e6)
        while self.next_time <= until:
            self.advance(self.next_time)
        self._timer = asyncio.get_running_loop().call_later(_INTERVAL, self._move)
