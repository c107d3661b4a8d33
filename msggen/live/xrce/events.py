"""Events of an agent, and what it hands to its transport."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple, TypeAlias

from msggen.live.link import Listener, Remote, Route, Service


class Connected(NamedTuple):
    """A client has begun a session."""

    remote: Remote

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.connected(self.remote)


class Opened(NamedTuple):
    """A client has a route or a service."""

    remote: Remote
    route: Route | Service

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.opened(self.remote, self.route)


class Sample(NamedTuple):
    """A client has published a sample. `payload` starts with the encapsulation; `time` in ns, as given to `receive`."""

    remote: Remote
    route: Route
    payload: bytes
    time: int

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.sample(self.remote, self.route, self.payload, self.time)


class Replied(NamedTuple):
    """A client has answered a request. `payload` starts with the encapsulation."""

    remote: Remote
    service: Service
    number: int
    payload: bytes

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.replied(self.remote, self.service, self.number, self.payload)


class Lost(NamedTuple):
    """Sequence numbers of a client's best-effort stream are missing."""

    remote: Remote
    missing: int

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.lost(self.remote, self.missing)


class Disconnected(NamedTuple):
    """A client has ended its session, is silent, or was replaced."""

    remote: Remote
    reason: str

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.disconnected(self.remote, self.reason)


class Warned(NamedTuple):
    """A text for the user, such as a client that was refused."""

    text: str

    def deliver(self, listener: Listener) -> None:
        """Call the method of a listener for this event."""
        listener.warned(self.text)


Event: TypeAlias = Connected | Opened | Sample | Replied | Lost | Disconnected | Warned

Address: TypeAlias = "tuple[Any, ...] | str"
"""The address of a client: as a socket gives it, or the path of a serial device."""


def host(address: Address) -> str:
    """Return an address without its port: an IP address, or the path of a device."""
    return address if isinstance(address, str) else str(address[0])


class Outbox:
    """Events, datagrams to send and counters of an agent."""

    __slots__ = ("_limit", "events", "late", "lost", "outgoing", "received", "refused")

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self.events: list[Event] = []
        self.outgoing: list[tuple[bytes, Address]] = []
        self.received = 0
        self.late = 0
        self.lost = 0
        self.refused: Counter[str] = Counter()

    def send(self, data: bytes, address: Address) -> None:
        """Add a datagram, up to the limit."""
        if len(self.outgoing) < self._limit:
            self.outgoing.append((data, address))
        else:
            self.refuse("too many datagrams to send")

    def refuse(self, reason: str) -> None:
        """Count a refusal. `reason` is one of a fixed set."""
        self.refused[reason] += 1
