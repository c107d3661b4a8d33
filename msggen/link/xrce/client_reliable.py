"""Both ends of the reliable stream as PX4's client has them, which trust the agent: docs/xrce.md, 6."""

from __future__ import annotations

from typing import Final

from msggen.link.xrce.streams import distance

WINDOW: Final = 4
"""Reliable messages that wait for acknowledgement, and that wait for an earlier one."""
_BITS: Final = 16


class ClientInput:
    """The receiving end: returns messages in order, each once. The first number of a HEARTBEAT is ignored."""

    def __init__(self) -> None:
        self.expected = 0
        """The number of the next message."""
        self._announced = 0xFFFF  # the newest number that the agent is known to have used
        self._waiting: dict[int, bytes] = {}

    def receive(self, sequence: int, body: bytes) -> list[bytes]:
        """Take a message; return the messages that are now in order. One beyond the window is dropped."""
        if 0 <= distance(self.expected, sequence) < WINDOW:
            self.announce(sequence)
            self._waiting.setdefault(sequence, body)
        ready = []
        while self.expected in self._waiting:
            ready.append(self._waiting.pop(self.expected))
            self.expected = (self.expected + 1) & 0xFFFF
        return ready

    def announce(self, last: int) -> None:
        """Take the number of the last message that the agent keeps. An older one than before changes nothing."""
        if distance(self._announced, last) > 0:
            self._announced = last

    def acknack(self) -> tuple[int, int]:
        """Return the first number and the bits of an ACKNACK."""
        missing = 0
        for bit in range(min(distance(self.expected, self._announced) + 1, _BITS)):
            if (self.expected + bit) & 0xFFFF not in self._waiting:
                missing |= 1 << bit
        return self.expected, missing


class ClientOutput:
    """The sending end: keeps messages until they are acknowledged."""

    def __init__(self) -> None:
        self.next = 0
        """The number of the next message."""
        self._first = 0  # the first number that is not acknowledged
        self._kept: dict[int, bytes] = {}

    @property
    def is_full(self) -> bool:
        """Whether the window is full. An ACKNACK of a number that is too low fills it for good."""
        return distance(self._first, self.next) >= WINDOW

    def send(self, body: bytes) -> int:
        """Keep a message and return its number. The window must not be full."""
        sequence = self.next
        self._kept[sequence] = body
        self.next = (sequence + 1) & 0xFFFF
        return sequence

    def acknack(self, first: int, missing: int) -> list[tuple[int, bytes]]:
        """Take the state of the agent, whatever it is; return numbers and messages to send again."""
        self._first = first
        self._kept = {number: body for number, body in self._kept.items() if distance(first, number) >= 0}
        numbers = ((first + bit) & 0xFFFF for bit in range(_BITS) if missing >> bit & 1)
        return [(number, self._kept[number]) for number in numbers if number in self._kept]

    def heartbeat(self) -> tuple[int, int] | None:
        """Return the numbers of the first and the last kept message, or None if all are acknowledged."""
        return (next(iter(self._kept)), (self.next - 1) & 0xFFFF) if self._kept else None
