"""What an agent hands to its transport."""

from __future__ import annotations

from collections import Counter
from typing import Any, TypeAlias

from msggen.link.age import NEVER
from msggen.link.link import Event

Address: TypeAlias = "tuple[Any, ...] | str"
"""The address of a client: as a socket gives it, or the path of a serial device."""
Datagram: TypeAlias = tuple[bytes, Address, int]
"""A datagram to send, its destination, and the time until which it may be sent."""


def host(address: Address) -> str:
    """Return an address without its port: an IP address, or the path of a device."""
    return address if isinstance(address, str) else str(address[0])


class Outbox:
    """Events, datagrams to send and counters of an agent."""

    __slots__ = ("_limit", "events", "expired", "late", "lost", "outgoing", "received", "refused")

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self.events: list[Event] = []
        self.outgoing: list[Datagram] = []
        self.received = 0
        """Datagrams from clients that were accepted."""
        self.late = 0
        """Datagrams of best-effort streams that were dropped, because the same one or a newer one had been received, or
        because their sequence number was far from the last one."""
        self.expired = 0
        """Messages to clients that were dropped: they could not be sent before they expired."""
        self.lost = 0
        """Missing sequence numbers of all clients."""
        self.refused: Counter[str] = Counter()
        """Refusals by reason: malformed, not allowed, or beyond a limit. The set of reasons is fixed."""

    def send(self, data: bytes, address: Address, until: int = NEVER) -> None:
        """Add a datagram, up to the limit."""
        if len(self.outgoing) < self._limit:
            self.outgoing.append((data, address, until))
        else:
            self.refuse("too many datagrams to send")

    def refuse(self, reason: str) -> None:
        """Count a refusal. `reason` is one of a fixed set."""
        self.refused[reason] += 1
