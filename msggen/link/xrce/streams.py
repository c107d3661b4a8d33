"""Streams: order, loss and repetition of messages. Both sides of a session use them. docs/xrce.md, 6.

A sequence number has 16 bits and wraps. Number b is newer than a if (b - a) mod 65536 is 1 to 32767.
"""

from __future__ import annotations

from typing import Final

from msggen.link.age import NEVER
from msggen.link.xrce.wire import WireError

INPUT_WINDOW: Final = 16
"""Messages of a reliable stream that are kept while an earlier one is missing: as many as an ACKNACK can ask for."""
NEAR: Final = 1024
"""The distance of sequence numbers beyond which a message belongs to the stream only if the next one follows it. A
damaged or forged number then neither counts as thousands of lost messages, nor makes later messages look old."""
OUTPUT_WINDOW: Final = 32
"""Messages of a reliable stream that are kept until they are acknowledged."""


def distance(older: int, newer: int) -> int:
    """Return how many numbers `newer` is ahead, from -32768 to 32767."""
    return ((newer - older + 0x8000) & 0xFFFF) - 0x8000


class BestEffortInput:
    """The receiving end of a best-effort stream: drops what is not newer than the last message."""

    __slots__ = ("_far", "_near", "last")

    def __init__(self, last: int | None = 0xFFFF, near: int = 0x8000) -> None:
        self.last = last
        """The last number, 65535 before the first message. None takes any number as the first one."""
        self._near = near
        self._far = -1  # the last number that was not near

    def accept(self, sequence: int) -> int | None:
        """Return how many messages are missing before this one, or None if it is dropped.

        A message is dropped if it is late or doubled, or if its number is `near` or more away from the last one. If the
        next message follows that one, the stream goes on there.
        """
        if self.last is None:
            self.last = sequence
            return 0
        ahead = distance(self.last, sequence)
        if abs(ahead) >= self._near:
            is_next, self._far = sequence == (self._far + 1) & 0xFFFF and self._far >= 0, sequence
            if not is_next:
                return None
            self._far = -1
        elif ahead <= 0:
            return None
        self.last = sequence
        return max(ahead - 1, 0)


class ReliableInput:
    """The receiving end of a reliable stream: returns messages in order, each once."""

    __slots__ = ("_announced", "_waiting", "expected")

    def __init__(self, expected: int | None = 0) -> None:
        self.expected = expected
        """The number of the first message that was not received. None takes the first number that is seen."""
        self._announced = 0  # how many numbers from `expected` on the sender is known to have used
        self._waiting: dict[int, bytes] = {}

    def receive(self, sequence: int, body: bytes) -> list[bytes]:
        """Take a message; return the messages that are now in order. One beyond the window is dropped."""
        if self.expected is None:
            self.expected = sequence
        ahead = distance(self.expected, sequence)
        if not 0 <= ahead < INPUT_WINDOW:
            return []
        self._announced = max(self._announced, ahead + 1)
        self._waiting.setdefault(sequence, body)
        return self._take()

    def heartbeat(self, first: int, last: int) -> list[bytes]:
        """Take the sender's first and last kept message; return the messages that are now in order.

        Messages before `first` that are missing will not come any more, so the stream goes on without them.
        """
        if self.expected is None:
            self.expected = first
        gone = distance(self.expected, first)
        if gone > 0:
            self._waiting = {number: body for number, body in self._waiting.items() if distance(first, number) >= 0}
            self._advance(gone)
        self._announced = max(self._announced, min(distance(self.expected, last) + 1, INPUT_WINDOW))
        return self._take()

    def acknack(self) -> tuple[int, int] | None:
        """Return first number and bits of an ACKNACK, or None before the first message of an unknown number."""
        if self.expected is None:
            return None
        missing = 0
        for bit in range(self._announced):
            if (self.expected + bit) & 0xFFFF not in self._waiting:
                missing |= 1 << bit
        return self.expected, missing

    def _take(self) -> list[bytes]:
        ready = []
        while self.expected in self._waiting:
            ready.append(self._waiting.pop(self.expected))
            self._advance(1)
        return ready

    def _advance(self, count: int) -> None:
        self.expected = ((self.expected or 0) + count) & 0xFFFF
        self._announced = max(self._announced - count, 0)


class ReliableOutput:
    """The sending end of a reliable stream: keeps messages until they are acknowledged."""

    __slots__ = ("_kept", "_start", "_until", "next")

    def __init__(self, start: int = 0) -> None:
        self.next = start
        """The number of the next message."""
        self._start = start
        self._kept: dict[int, bytes] = {}  # in order
        self._until: dict[int, int] = {}

    @property
    def is_full(self) -> bool:
        """Whether the window is full."""
        return len(self._kept) >= OUTPUT_WINDOW

    @property
    def is_fresh(self) -> bool:
        """Whether no message was sent."""
        return self.next == self._start

    def send(self, body: bytes, until: int = NEVER) -> int:
        """Keep a message, which expires at a time, and return its number. The window must not be full."""
        sequence = self.next
        self._kept[sequence], self._until[sequence] = body, until
        self.next = (sequence + 1) & 0xFFFF
        return sequence

    def acknack(self, first: int, missing: int) -> list[tuple[int, bytes]]:
        """Take the state of the receiver; return numbers and messages to send again.

        An ACKNACK that acknowledges messages that were not sent is ignored.
        """
        acknowledged = len(self._kept) - distance(first, self.next)
        if not 0 <= acknowledged <= len(self._kept):
            return []
        for sequence in list(self._kept)[:acknowledged]:
            del self._kept[sequence], self._until[sequence]
        numbers = ((first + bit) & 0xFFFF for bit in range(16) if missing >> bit & 1)
        return [(number, self._kept[number]) for number in numbers if number in self._kept]

    def until(self, sequence: int) -> int:
        """Return the time until which a kept message may be sent."""
        return self._until.get(sequence, NEVER)

    def expire(self, now: int, instead: bytes) -> int:
        """Replace the messages that have expired by another one, as no number may be missing. Return how many."""
        expired = [sequence for sequence, until in self._until.items() if until < now]
        for sequence in expired:
            self._kept[sequence], self._until[sequence] = instead, NEVER
        return len(expired)

    def heartbeat(self) -> tuple[int, int] | None:
        """Return the numbers of the first and the last kept message, or None if all are acknowledged."""
        if not self._kept:
            return None
        return (self.next - len(self._kept)) & 0xFFFF, (self.next - 1) & 0xFFFF


class Fragments:
    """Parts of submessages that did not fit in a message of a reliable stream."""

    __slots__ = ("_joined", "_limit")

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._joined = bytearray()

    @property
    def is_begun(self) -> bool:
        """Whether a last part is awaited."""
        return bool(self._joined)

    def add(self, part: bytes, *, last: bool) -> bytes | None:
        """Add the next part; return the submessages if it is the last one.

        Raises WireError if they are longer than the limit, and forgets them.
        """
        if len(self._joined) + len(part) > self._limit:
            self.clear()
            raise WireError("fragments beyond the limit")
        self._joined += part
        if not last:
            return None
        whole = bytes(self._joined)
        self.clear()
        return whole

    def clear(self) -> None:
        """Forget the parts."""
        self._joined.clear()
