"""The messages of PX4's client: its streams, acknowledgements and fragments. docs/xrce.md, "Streams".

Times are in us.
"""

from __future__ import annotations

import struct
from collections import Counter, deque
from typing import Final

from msggen.live.xrce import wire
from msggen.live.xrce.streams import BestEffortInput, ReliableInput, ReliableOutput
from msggen.live.xrce.wire import PX4_SESSION, RELIABLE, Submessage, WireError

_WINDOW: Final = 4
"""Reliable messages that wait for acknowledgement, and that wait for an earlier one."""
_QUEUE: Final = 16
"""Reliable messages that wait for room in the window. More are dropped."""
_HEARTBEAT: Final = 100_000
_ROOM: Final = wire.MTU - 4
_FRAGMENT: Final = wire.MTU - 8
"""The length of a fragment, after the headers of message and submessage."""
_FIRST_REQUEST: Final = 10

_WRITE = struct.Struct("<BBHBBH")


class ClientStreams:
    """The messages of one session of a client."""

    def __init__(self, refused: Counter[str]) -> None:
        """Count messages that are refused in `refused`, by reason."""
        self.outgoing: list[bytes] = []
        """The messages to send."""
        self.is_open = False
        """Whether the session exists. Before, messages of streams are refused."""
        self.heartbeat_time: int | None = None
        """The time of the next HEARTBEAT, None if nothing waits for acknowledgement."""
        self._refused = refused
        self._last_request = _FIRST_REQUEST - 1
        self._best_effort_sent = 0
        self._best_effort = BestEffortInput()
        self._received = ReliableInput(window=_WINDOW)
        self._sent = ReliableOutput(window=_WINDOW)
        self._collected: list[bytes] = []
        self._queue: deque[bytes] = deque(maxlen=_QUEUE)

    def next_request(self) -> bytes:
        """Return the next request id. They count from 10 to 65535 and around."""
        self._last_request = self._last_request + 1 if self._last_request < 0xFFFF else _FIRST_REQUEST
        return self._last_request.to_bytes(2, "big")

    def send(self, submessage: bytes, session: int = PX4_SESSION) -> None:
        """Send a submessage outside of all streams."""
        self.outgoing.append(wire.pack_message(session, wire.NO_STREAM, 0, submessage))

    def write(self, object_id: bytes, data: bytes) -> None:
        """Send a sample, best effort."""
        head = _WRITE.pack(PX4_SESSION, wire.BEST_EFFORT, self._best_effort_sent, wire.WRITE_DATA, 1, len(data) + 4)
        self._best_effort_sent = (self._best_effort_sent + 1) & 0xFFFF
        self.outgoing.append(b"".join((head, self.next_request(), object_id, data, bytes(-len(data) & 3))))

    def collect(self, submessage: bytes) -> None:
        """Take a submessage for the reliable stream, which `flush` sends."""
        self._collected.append(submessage + bytes(-len(submessage) & 3))

    def flush(self, now: int) -> None:
        """Send what was collected, in as few messages as possible."""
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
            kept = self._sent.heartbeat()
            self.heartbeat_time = now + _HEARTBEAT if kept else None
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
                        bodies += self._take_heartbeat(wire.Heartbeat.unpack(submessage.payload))
                    elif submessage.id == wire.ACKNACK:
                        self._take_acknack(wire.AckNack.unpack(submessage.payload), now)
                    else:
                        found.append(submessage)
            except WireError as error:
                self._refused[str(error)] += 1
        return found

    def _bodies(self, data: bytes) -> list[bytes]:
        header = wire.parse_header(data)
        body = data[4:]
        if header.session_id not in (PX4_SESSION, wire.NO_SESSION):
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
            self.heartbeat_time = now + _HEARTBEAT if self._sent.heartbeat() else None
            self._send_reliable(now)

    def _take_heartbeat(self, heartbeat: wire.Heartbeat) -> list[bytes]:
        """Return the messages that are in order now that the agent has given up earlier ones."""
        if heartbeat.stream != RELIABLE or not self.is_open:
            return []
        bodies = self._received.heartbeat(heartbeat.first, heartbeat.last)
        self._acknowledge()
        return bodies

    def _send_reliable(self, now: int) -> None:
        """Send what waits, as far as the window allows."""
        while self._queue and not self._sent.is_full:
            body = self._queue.popleft()
            self.outgoing.append(wire.pack_message(PX4_SESSION, RELIABLE, self._sent.send(body), body))
            self.heartbeat_time = now + _HEARTBEAT

    def _acknowledge(self) -> None:
        state = self._received.acknack()
        if state:
            self.send(wire.AckNack(*state).pack())


def _fragments(submessage: bytes) -> list[bytes]:
    """Return the FRAGMENTs of a submessage that is too long for a message. Its padding is part of the last one."""
    parts = [submessage[at : at + _FRAGMENT] for at in range(0, len(submessage), _FRAGMENT)]
    flags = [wire.LITTLE_ENDIAN] * (len(parts) - 1) + [wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT]
    return [wire.pack_submessage(wire.FRAGMENT, part, flag) for part, flag in zip(parts, flags, strict=True)]
