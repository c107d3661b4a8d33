"""A program that has joined, as the owner of the link sees it."""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections import deque

from msggen.link.age import clock_name, now
from msggen.vehicle.owned.records import SAMPLE, RecordReader, event_of

BACKLOG = 16 << 20
"""The bytes that may wait for a program. Beyond it, the oldest half of its samples is dropped and counted."""

_CHUNK = 1 << 17
_TAKEN_S = 0.1
"""The shortest time in s between two records that tell a program what was taken."""
_CLOCK_S = 10.0
"""The time in s after which it is told the time again."""
_LONGEST = 1 << 16
"""The bytes of the longest body that a program may send: no vehicle takes as much."""

_PEER = struct.Struct("3i")
"""What SO_PEERCRED tells: process, user and group (unix(7))."""


class Program:
    """A program: its socket, what waits for it, and what it has asked for."""

    def __init__(self, own: socket.socket) -> None:
        self.socket = own
        self.pid, self.uid = _peer(own)
        self.name = ""
        self.reader = RecordReader(_LONGEST)
        self.since = time.monotonic()
        self.has_joined = False
        """Whether it has said hello, and is told what happens."""
        self.is_gone = False
        self.is_blocked = False
        """Whether its socket was full."""
        self.dropped = 0
        """Samples that it did not read in time."""
        self.warnings: set[str] = set()
        self.taken = 0
        """The time until which its last message to a vehicle could be sent: that tells it which one was taken."""
        self.unsent = 0
        """Its messages to vehicles that were dropped, because they had waited for too long."""
        self._told = -1, 0.0
        """The last message that it knows to be taken, and when it was told."""
        self._queue: deque[list[bytes]] = deque()
        """The records, each in a list of one. That of a sample that was dropped is empty."""
        self._samples: deque[list[bytes]] = deque()
        """The samples among them, so that the oldest one is found at once."""
        self._size = self._holes = 0
        self._rest = memoryview(b"")

    def fileno(self) -> int:
        """Return the number of the socket, for a selector."""
        return self.socket.fileno()

    @property
    def is_waiting(self) -> bool:
        """Whether something waits for the program."""
        return bool(self._queue or self._rest)

    def tell_taken(self, time: float) -> None:
        """Tell it which of its messages were taken, and the time, if that is due. `time` is of the monotonic clock."""
        told, at = self._told
        if time - at >= (_TAKEN_S if self.taken != told else _CLOCK_S):
            self._told = self.taken, time
            self.put(event_of("taken", self.taken, self.unsent, now(), clock_name()))

    def put(self, record: bytes) -> None:
        """Add a record to those that wait."""
        cell = [record]
        self._queue.append(cell)
        if record[0] == SAMPLE:
            self._samples.append(cell)
        self._size += len(record)
        if self._size > BACKLOG:
            self._drop()

    def _drop(self) -> None:
        """Drop the oldest samples, so that half of the backlog is free. All other records stay."""
        while self._samples and self._size > BACKLOG // 2:
            cell = self._samples.popleft()
            self._size -= len(cell[0])
            self.dropped += 1
            self._holes += 1
            cell[0] = b""
        if self._holes > len(self._queue) // 2:
            self._queue = deque(cell for cell in self._queue if cell[0])
            self._holes = 0
        self.is_gone |= self._size > BACKLOG  # it reads nothing, and no samples are left to drop

    def flush(self) -> None:
        """Send what waits, as much as the socket takes. Never blocks and never raises."""
        self.is_blocked = False
        while self.is_waiting and not self.is_gone:
            if not self._rest:
                self._rest = memoryview(self._next())
            try:
                sent = self.socket.send(self._rest)
            except BlockingIOError:
                self.is_blocked = True
                return
            except OSError:
                self.is_gone = True
                return
            self._rest = self._rest[sent:]

    def _next(self) -> bytes:
        records, size = [], 0
        while self._queue and size < _CHUNK:
            cell = self._queue.popleft()
            if not cell[0]:
                self._holes -= 1
            elif cell[0][0] == SAMPLE:
                self._samples.popleft()
            size += len(cell[0])
            records.append(cell[0])
        self._size -= size
        return b"".join(records)

    def close(self) -> None:
        """Close the socket. What waits is lost."""
        self.is_gone = True
        self._queue.clear()
        self._samples.clear()
        self._size, self._holes, self._rest = 0, 0, memoryview(b"")
        self.socket.close()


def _peer(own: socket.socket) -> tuple[int, int]:
    """Return the process and the user at the other end, as the system tells them; -1 if it tells none."""
    if sys.platform != "linux":
        return -1, -1
    pid, uid, _ = _PEER.unpack(own.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
    return pid, uid
