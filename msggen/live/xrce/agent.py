"""All clients of one transport, agent side: docs/xrce.md.

No input, output, clock or thread: a transport gives datagrams and times, and takes datagrams and events. A transport
that calls an agent from several threads holds a lock of its own.

    agent.receive(data, address, time.time_ns())
    for data, address in agent.take_outgoing():
        sock.sendto(data, address)
    for event in agent.take_events():
        event.deliver(listener)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

from msggen.live.link import Route, Service
from msggen.live.xrce.session import Connected, Disconnected, Event, Lost, Opened, Replied, Sample, Warned

__all__ = [
    "Address",
    "Agent",
    "Connected",
    "Disconnected",
    "Event",
    "Limits",
    "Lost",
    "Opened",
    "Replied",
    "Sample",
    "Warned",
]

Address: TypeAlias = "tuple[Any, ...] | str"
"""The address of a client: as a socket gives it, or the path of a serial device."""


class Limits(NamedTuple):
    """Bounds of an agent."""

    clients: int = 64
    """Sessions, with those that are silent."""
    entities: int = 1024
    """Entities of a client. PX4's client has about 200."""
    text: int = 255
    """Characters of a topic's or a type's name."""
    buffered: int = 65536
    """Bytes of a client that wait for missing messages or fragments."""
    outgoing: int = 4096
    """Datagrams that wait for `take_outgoing`."""
    silence: float = 5.0
    """Seconds after which a silent client is reported as disconnected. PX4's client sends every second."""
    memory: float = 60.0
    """Seconds after which a silent client is forgotten. Until then it continues its session if it sends again."""


DEFAULTS = Limits()


def everybody(address: Address) -> bool:  # noqa: ARG001
    """Allow every address."""
    return True


class Agent:
    """All clients of one transport."""

    received: int
    """Datagrams from clients that were accepted."""
    late: int
    """Datagrams of best-effort streams that were dropped since a newer one, or the same, had been received."""
    lost: int
    """Missing sequence numbers of all clients."""
    refused: Counter[str]
    """Datagrams that were refused, by reason: malformed, not allowed, beyond a limit. The set of reasons is fixed."""

    def __init__(
        self,
        now: float,
        *,
        allow: Callable[[Address], bool] = everybody,
        keys: Container[int] | None = None,
        known: Iterable[Route] = (),
        limits: Limits = DEFAULTS,
    ) -> None:
        """Make an agent.

        `now` is the time of a monotonic clock, in seconds.

        `allow` tells whether an address may talk to this agent. Other senders get no answer. `keys` are the keys of
        clients that may begin a session, None for all of them.

        `known` are the routes that a client of the expected firmware has. With them a session that an earlier program
        began is continued (docs/xrce.md, "Take-over"), unless `keys` are given: a running session tells no key.
        """
        raise NotImplementedError

    def receive(self, data: bytes, address: Address, time: int) -> None:
        """Take a datagram, or the message of a frame. Never raises.

        `time` is the time of its arrival in ns, of the clock that the vehicle is told: `time.time_ns`.
        """
        raise NotImplementedError

    def tick(self, now: float) -> None:
        """Do what time demands: ask for missing acknowledgements, report silent clients. To be called every 0.1 s.

        `now` is the time of a monotonic clock, in seconds.
        """
        raise NotImplementedError

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        raise NotImplementedError

    def take_outgoing(self) -> list[tuple[bytes, Address]]:
        """Return the datagrams to send, with their destinations, since the last call."""
        raise NotImplementedError

    def publish(self, number: int, object_id: int, payload: bytes) -> None:
        """Send a sample to vehicle `Remote.number`, to its route of direction `in` with this `Route.object_id`.

        `payload` is CDR with its encapsulation, which is little-endian.
        Raises LinkError if the vehicle is not connected, has no such route, or if the payload does not fit.
        """
        raise NotImplementedError

    def call(self, number: int, object_id: int, request: int, payload: bytes) -> None:
        """Send a request to vehicle `Remote.number`, to its service with this `Service.object_id`.

        The answer is a Replied with the same number `request`, which is unique for this vehicle, from 1 to 2**63 - 1.
        `payload` as for `publish`.
        Raises LinkError if the vehicle is not connected or was adopted, has no such service,
        or leaves too many requests without acknowledgement, or if the payload does not fit.
        """
        raise NotImplementedError

    def routes(self, number: int) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle. Raises LinkError if it is not connected."""
        raise NotImplementedError

    def close(self, reason: str = "the link was closed") -> None:
        """Forget all clients and report them as disconnected. The protocol has no message for it."""
        raise NotImplementedError
