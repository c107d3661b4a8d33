"""A link to simulated vehicles on a clock of its own: minutes of it take seconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

from msggen.link.age import NEVER
from msggen.link.agent_link import TICK, AgentLink
from msggen.link.link import Listener, deliver
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.outbox import Address
from msggen.sim import Options
from msggen.sim.vehicle import SimulatedVehicle

if TYPE_CHECKING:
    import pytest

START_NS = 1_767_225_600_000_000_000  # 2026-01-01
_BOOT = 1_000_000
_STEP = 0.002
"""The shortest step in s: what is due within it comes together."""
_CLOCKS = ("msggen.doctor.watching", "msggen.doctor.listener", "msggen.vehicle.entry")
"""The modules that look at the clock while the doctor watches."""


class SimulatedLink(AgentLink):
    """A link without a thread. It goes on when somebody sleeps."""

    def __init__(self, package: ModuleType, vehicles: Sequence[Options], **settings: Any) -> None:
        super().__init__(**settings)
        self.now = 0.0
        """The time in s."""
        self.agent = Agent(0.0, **settings)
        self.after_sleep: Callable[[], object] = lambda: None
        self._vehicles = [SimulatedVehicle(package, each) for each in vehicles]
        self._listener: Listener | None = None
        self._due = 0.0

    def use(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Let the doctor and what it uses look at this clock."""
        clock = SimpleNamespace(
            monotonic=lambda: self.now, time_ns=lambda: START_NS + round(self.now * 1e9), sleep=self.sleep
        )
        for module in _CLOCKS:
            monkeypatch.setattr(f"{module}.time", clock)

    def start(self, listener: Listener) -> None:
        """Tell a listener what happens."""
        self._listener = listener

    def close(self) -> None:
        """Leave. The clock stands still."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        while self.now < end:
            due = [(each.next_time - _BOOT) / 1e6 for each in self._vehicles]
            self.now = min(end, max(self.now + _STEP, min([*due, self._due])))
            self._move()
        self.after_sleep()

    def _move(self) -> None:
        now = _BOOT + round(self.now * 1e6)
        with self.lock:
            for place, vehicle in enumerate(self._vehicles):
                if vehicle.next_time <= now:
                    vehicle.advance(now)
                for data, connection in vehicle.take_outgoing():
                    address = ("127.0.0.1", 40_000 + 1000 * place + connection)
                    self.agent.receive(data, address, START_NS + round(self.now * 1e9))
            if self.now >= self._due:
                self._due = self.now + TICK
                self.agent.tick(self.now)
            events = self.settle()
        if self._listener is not None:
            deliver(events, self._listener)

    # --- What a transport gives

    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:  # noqa: ARG002 - none waits
        """Give datagrams to the vehicles. One to an address that a vehicle has no more comes too, as some do in PX4."""
        for data, address in datagrams:
            place = (int(address[1]) - 40_000) // 1000
            self.sent += 1
            self._vehicles[place].receive(data, _BOOT + round(self.now * 1e6))

    def name(self) -> str:
        """Return the address of the link."""
        return "udp://127.0.0.1:8888"

    def open(self, listener: Listener) -> None:
        """Open nothing."""

    def wait(self, seconds: float, listener: Listener) -> None:
        """Wait for nothing."""

    def wake(self) -> None:
        """Wake nothing."""
