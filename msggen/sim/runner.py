"""Clients with sockets or a serial device, and the clock of the system."""

from __future__ import annotations

import selectors
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

from msggen.link.address import Address
from msggen.link.link import LinkError
from msggen.link.link_types import DEFAULT
from msggen.sim.options import Options
from msggen.sim.publishing import FlightLog
from msggen.sim.transport import Transport, open_transport, read_address
from msggen.sim.vehicle import SimulatedVehicle

if TYPE_CHECKING:
    from typing_extensions import Self

_LONGEST_WAIT = 0.1
_SHORTEST_WAIT = 0.001
"""The time in s for which samples that are due are collected, so that many vehicles need little time."""
_MOST_BEHIND = 20_000
"""The time in us by which a clock of another speed can be late, before it runs more slowly."""


class Clock:
    """The time since boot in us, which can run at another speed than that of the system.

    At another speed, it stops at each time at which something is due, so that nothing is left out. It runs more slowly
    on a computer that is too slow.
    """

    def __init__(self, boot: int, speed: float) -> None:
        self._boot, self._speed = boot, speed
        self._start = time.monotonic_ns()
        self._time = boot
        self.shortest_wait = _SHORTEST_WAIT if speed == 1.0 else 0.0

    @property
    def now(self) -> int:
        """The time."""
        return self._target if self._speed == 1.0 else self._time

    @property
    def _target(self) -> int:
        return self._boot + int((time.monotonic_ns() - self._start) * self._speed) // 1000

    def move(self, due: int) -> None:
        """Go on, at another speed to the next time at which something is due."""
        target = self._target
        self._time = min(target, max(due, self._time))
        behind = target - self._time - _MOST_BEHIND
        if behind > 0 and self._speed != 1.0:
            self._start += round(behind * 1000 / self._speed)

    def seconds_until(self, time: int) -> float:
        """Return how long it takes until a time."""
        return (time - self._target) / 1e6 / self._speed


class Running(Protocol):
    """A client without input or output: a simulated vehicle, or a recording that is played. Times are in us."""

    @property
    def is_closed(self) -> bool:
        """Whether the session has ended after `close`."""

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""

    def advance(self, now: int) -> None:
        """Do what is due."""

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram of the newest connection, or the message of a frame."""

    def refuse(self) -> None:
        """Tell that a datagram was refused, as on a host where no agent listens."""

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its connection."""

    def close(self, now: int) -> None:
        """End the session."""


class Runner:
    """Clients that connect to one agent. The thread runs within a `with` block; `serve` runs them in this thread."""

    boot = 1_000_000
    """The time since boot in us at which the clients start."""

    def __init__(self, clients: Sequence[Running], agent: Address, *, speed: float = 1.0) -> None:
        """Open the connection of each client. Raises LinkError if one cannot be opened.

        `speed` is how fast the time of the clients runs, compared with that of the system.
        """
        if agent.link_type.is_device and len(clients) > 1:
            raise LinkError("a serial line has one vehicle: give every vehicle a line, or use udp://")
        self._clients = clients
        self._clock = Clock(self.boot, speed)
        self._selector = selectors.DefaultSelector()
        self._transports: list[Transport] = []
        self._registered: list[int] = []
        self._closing = threading.Event()
        self.error: LinkError | None = None
        """What ended the thread."""
        self._thread: threading.Thread | None = None
        try:
            for number in range(len(clients)):
                self._transports.append(open_transport(agent))
                self._registered.append(-1)
                self._register(number)
        except BaseException:
            self._release()
            raise

    def __enter__(self) -> Self:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="msggen client", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def now(self) -> int:
        """The time since boot in us."""
        return self._clock.now

    def serve(self, seconds: float, is_done: Callable[[], bool] = lambda: False) -> None:
        """Run the clients in this thread for some time of theirs, or until `is_done`.

        Raises LinkError if the device is gone.
        """
        end = self.now + round(seconds * 1e6)
        while self.now < end and not self._closing.is_set() and not is_done():
            self._step(end)

    def close(self) -> None:
        """End the sessions, which takes up to 1 s without an answer, and release all. Can be repeated."""
        self._closing.set()
        if self._thread:
            self._thread.join()
            self._thread = None
        if self._transports:
            try:
                self._leave()
            finally:
                self._release()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._step(self.now + 10_000_000)
        except LinkError as error:
            self.error = error

    def _leave(self) -> None:
        for client in self._clients:
            client.close(self.now)
        end = self.now + 1_500_000
        with suppress(LinkError):
            while self.now < end and not all(client.is_closed for client in self._clients):
                self._step(end)

    def _step(self, end: int) -> None:
        """Do what is due, and wait for the next datagram or time."""
        self._clock.move(min(client.next_time for client in self._clients))
        now = self.now
        for number, client in enumerate(self._clients):
            if client.next_time <= now:
                client.advance(now)
            self._send(number)
        seconds = self._clock.seconds_until(min(end, *(client.next_time for client in self._clients)))
        wait = min(_LONGEST_WAIT, max(self._clock.shortest_wait, seconds))
        for key, _ in self._selector.select(wait):
            self._receive(key.data)

    def _receive(self, number: int) -> None:
        client = self._clients[number]
        transport = self._transports[number]
        for data in transport.receive():
            client.receive(data, self.now)
        if transport.is_refused:
            client.refuse()
        self._send(number)

    def _send(self, number: int) -> None:
        transport = self._transports[number]
        for data, connection in self._clients[number].take_outgoing():
            transport.send(data, connection)
            if transport.fileno() != self._registered[number]:
                self._register(number)

    def _register(self, number: int) -> None:
        """Wait for the socket of a client. A closed one has left the selector of the system by itself."""
        transport: Any = self._transports[number]
        known = self._selector.get_map()
        for key in [key for key in known.values() if key.data == number]:
            self._selector.unregister(key.fileobj)
        self._registered[number] = transport.fileno()
        self._selector.register(transport.fileno(), selectors.EVENT_READ, number)

    def _release(self) -> None:
        self._selector.close()
        for transport in self._transports:
            transport.close()
        self._transports.clear()


class Simulator(Runner):
    """Vehicles that connect to one agent.

        with Simulator(px4_types, "udp://127.0.0.1:8888") as simulator:
            ...  # the vehicles run in a thread

        Simulator(px4_types).serve(10.0)  # in this thread, for 10 s

    `vehicles` tells their state. It changes while the thread runs.
    """

    def __init__(
        self,
        package: ModuleType,
        address: str = DEFAULT,
        options: Sequence[Options] = (Options(),),
        log: FlightLog | None = None,
        *,
        speed: float = 1.0,
    ) -> None:
        """Open the connections of a vehicle for each of `options`.

        `package` is a package that msggen generated. `log` takes what the first vehicle publishes and reads. With
        `speed`, the time of the vehicles runs that many times as fast, and `sync` must be "off". Raises ValueError
        for an address that is none and for another `sync`, and LinkError if the address cannot be opened.
        """
        if speed != 1.0 and any(each.sync != "off" for each in options):
            raise ValueError('the clock of the agent runs at another speed: give the vehicles Options(sync="off")')
        agent = read_address(address)
        self.vehicles = tuple(
            SimulatedVehicle(
                package, each._replace(is_on_zenoh=agent.link_type.has_router), log if number == 0 else None
            )
            for number, each in enumerate(options)
        )
        super().__init__(self.vehicles, agent, speed=speed)
