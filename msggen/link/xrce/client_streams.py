"""The messages of PX4's client: its streams, acknowledgements and fragments. docs/xrce.md, "Streams".

Times are in us.
"""

from __future__ import annotations

import struct
from collections import Counter, deque
from typing import Final

from msggen.link.xrce import wire
from msggen.link.xrce.streams import BestEffortInput, distance
from msggen.link.xrce.wire import PX4_SESSION, RELIABLE, Submessage, WireError

WINDOW: Final = 4
"""Reliable messages that wait for acknowledgement, and that wait for an earlier one."""
_BITS: Final = 16


class ClientInput:
    """The receiving end of the reliable stream, which trusts the agent: returns messages in order, each once.

    The first number of a HEARTBEAT is ignored.
    """

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
    """The sending end of that stream: keeps messages until they are acknowledged."""

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


_QUEUE: Final = 16
"""Reliable messages that wait for room in the window. More are dropped."""
_HEARTBEAT: Final = 100_000
_ROOM: Final = wire.MTU - 4
_FRAGMENT: Final = wire.MTU - 8
"""The length of a fragment, after the headers of message and submessage."""
_FIRST_REQUEST: Final = 10
_BUFFER: Final = 2048
"""The length of the longest message of samples. Only messages of the agent are held to the MTU."""
_UNREAD: Final = 8
"""The length up to which a message is not read at all."""

_WRITE = struct.Struct("<BBH")


class ClientStreams:
    """The messages of one session of a client."""

    def __init__(self, refused: Counter[str]) -> None:
        """Count messages that are refused in `refused`, by reason."""
        self.outgoing: list[bytes] = []
        """The messages to send."""
        self.is_open = False
        """Whether the session exists. Before, messages of streams are refused."""
        self._beat: int | None = None  # the time of the next HEARTBEAT while the client waits
        self._refused = refused
        self._last_request = _FIRST_REQUEST - 1
        self._best_effort_sent = 0
        self._best_effort = BestEffortInput()
        self._samples: list[bytes] = []
        self._size = wire.HEADER.size  # that of the message of samples
        self._received = ClientInput()
        self._sent = ClientOutput()
        self._collected: list[bytes] = []
        self._queue: deque[bytes] = deque(maxlen=_QUEUE)

    def next_request(self) -> bytes:
        """Return the next request id. They count from 10 to 65535 and around."""
        self._last_request = self._last_request + 1 if self._last_request < 0xFFFF else _FIRST_REQUEST
        return self._last_request.to_bytes(2, "big")

    @property
    def heartbeat_time(self) -> int | None:
        """The time of the next HEARTBEAT, None if there will be none.

        Each loop of PX4's client puts it off, so there is one only in a wait of more than 100 ms.
        """
        return self._beat if self._sent.heartbeat() else None

    def wait(self, now: int | None) -> None:
        """Begin a wait of the client, or end it with None."""
        self._beat = None if now is None else now + _HEARTBEAT

    def send(self, submessage: bytes, session: int = PX4_SESSION) -> None:
        """Send a submessage outside of all streams."""
        self.flush_samples()
        self.outgoing.append(wire.pack_message(session, wire.NO_STREAM, 0, submessage))

    def write(self, object_id: bytes, data: bytes) -> None:
        """Take a sample for the best-effort stream, which is sent before the next message, or by `flush_samples`."""
        padding = -len(data) & 3
        size = 8 + len(data) + padding
        if self._size + size > _BUFFER:
            self.flush_samples()
        head = _WRITE.pack(wire.WRITE_DATA, wire.LITTLE_ENDIAN, len(data) + 4)
        self._samples += (head, self.next_request(), object_id, data, bytes(padding))
        self._size += size

    def flush_samples(self) -> None:
        """Send the samples, in one message."""
        if self._samples:
            header = wire.HEADER.pack(PX4_SESSION, wire.BEST_EFFORT, self._best_effort_sent)
            self._best_effort_sent = (self._best_effort_sent + 1) & 0xFFFF
            self.outgoing.append(b"".join((header, *self._samples)))
            self._samples.clear()
            self._size = wire.HEADER.size

    def collect(self, submessage: bytes) -> None:
        """Take a submessage for the reliable stream, which `flush` sends."""
        self._collected.append(submessage + bytes(-len(submessage) & 3))

    def flush(self, now: int) -> None:
        """Send what was collected, in as few messages as possible, after the samples."""
        self.flush_samples()
        body = b""
        for part in self._collected:
            if body and len(body) + len(part) > _ROOM:
                self._queue.append(body)
                body = b""
            if len(part) > _ROOM:
                self._queue.extend(_fragments(part))
            else:
                body += part
        if body:
            self._queue.append(body)
        self._collected.clear()
        self._send_reliable(now)

    def advance(self, now: int) -> None:
        """Ask for acknowledgements if they are due."""
        if self.heartbeat_time is not None and now >= self.heartbeat_time:
            self._beat = now + _HEARTBEAT
            kept = self._sent.heartbeat()
            if kept:
                self.send(wire.Heartbeat(*kept).pack())

    def receive(self, data: bytes, now: int) -> list[Submessage]:
        """Return the submessages that are now in order, without those that concern streams."""
        try:
            bodies = self._bodies(data)
        except WireError as error:
            self._refused[str(error)] += 1
            return []
        found: list[Submessage] = []
        while bodies:
            body = bodies.pop(0)
            try:
                for submessage in wire.submessages(body):
                    if submessage.id == wire.HEARTBEAT:
                        self._take_heartbeat(wire.Heartbeat.unpack(submessage.payload))
                    elif submessage.id == wire.ACKNACK:
                        self._take_acknack(wire.AckNack.unpack(submessage.payload), now)
                    else:
                        found.append(submessage)
            except WireError as error:
                self._refused[str(error)] += 1
        return found

    def _bodies(self, data: bytes) -> list[bytes]:
        if len(data) <= _UNREAD:
            raise WireError("message that PX4 does not read")
        header = wire.parse_header(data)
        body = data[4:]
        if header.session_id != PX4_SESSION and (self.is_open or header.session_id != wire.NO_SESSION):
            raise WireError("message of another session")
        if header.stream == wire.NO_STREAM:
            return [body]
        if not self.is_open:
            raise WireError("message outside of a session")
        if header.stream == wire.BEST_EFFORT:
            return [] if self._best_effort.accept(header.sequence) is None else [body]
        if header.stream == RELIABLE:
            bodies = self._received.receive(header.sequence, body)
            self._acknowledge()
            return bodies
        raise WireError("unknown stream")

    def _take_acknack(self, acknowledged: wire.AckNack, now: int) -> None:
        if acknowledged.stream == RELIABLE:
            for sequence, body in self._sent.acknack(acknowledged.first, acknowledged.missing):
                self.outgoing.append(wire.pack_message(PX4_SESSION, RELIABLE, sequence, body))
            self._send_reliable(now)

    def _take_heartbeat(self, heartbeat: wire.Heartbeat) -> None:
        """Tell the agent the number of its next reliable message, on whatever stream it asks."""
        if heartbeat.stream == RELIABLE and self.is_open:
            self._received.announce(heartbeat.last)
            self._acknowledge()

    def _send_reliable(self, now: int) -> None:
        """Send what waits, as far as the window allows."""
        while self._queue and not self._sent.is_full:
            body = self._queue.popleft()
            self.outgoing.append(wire.pack_message(PX4_SESSION, RELIABLE, self._sent.send(body), body))
            self._beat = self._beat and now + _HEARTBEAT

    def _acknowledge(self) -> None:
        self.send(wire.AckNack(*self._received.acknack()).pack())


def _fragments(submessage: bytes) -> list[bytes]:
    """Return the FRAGMENTs of a submessage that is too long for a message. Its padding is part of the last one."""
    parts = [submessage[at : at + _FRAGMENT] for at in range(0, len(submessage), _FRAGMENT)]
    flags = [wire.LITTLE_ENDIAN] * (len(parts) - 1) + [wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT]
    return [wire.pack_submessage(wire.FRAGMENT, part, flag) for part, flag in zip(parts, flags, strict=True)]
