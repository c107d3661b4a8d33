"""A client of DDS-XRCE that sends what PX4's client sent in a capture, over a real socket or a pseudo terminal."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

from support import xrce_captures

if TYPE_CHECKING:
    from typing_extensions import Self

CREATE, GET_INFO, DELETE, STATUS_AGENT, INFO, WRITE_DATA, READ_DATA, DATA, TIMESTAMP = 1, 2, 3, 4, 6, 7, 8, 9, 14
HEARTBEAT = 11
"""Ids of submessages."""


@cache
def sent(name: str) -> Sequence[bytes]:
    """Return what the client sent in a capture."""
    return xrce_captures.sent(name, "client")


def kind(datagram: bytes) -> int:
    """Return the id of the first submessage."""
    return datagram[4]


@cache
def creation(name: str) -> Sequence[bytes]:
    """Return what the client sent up to its last entity, without samples and time sync: a session with endpoints."""
    datagrams = sent(name)
    last = max(place for place, data in enumerate(datagrams) if data[1] == 0x80 and kind(data) in {CREATE, READ_DATA})
    return [data for data in datagrams[: last + 1] if kind(data) not in {WRITE_DATA, TIMESTAMP}]


@cache
def writer() -> bytes:
    """Return the object id of a writer of `session-udp`."""
    return next(data for data in sent("session-udp") if kind(data) == WRITE_DATA)[10:12]


def sample(number: int, cdr: bytes) -> bytes:
    """Return a datagram with a sample on the best-effort stream, of which `number` is the place."""
    payload = b"\0\0" + writer() + cdr
    return struct.pack("<BBHBBH", 0x81, 1, number & 0xFFFF, WRITE_DATA, 1, len(payload)) + payload


class Client:
    """A socket that sends to a link."""

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)  # for answers that nobody reads yet
        self.socket.bind((host, 0))
        self.socket.connect(("127.0.0.1", port))
        self.address = "{}:{}".format(*self.socket.getsockname())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def play(self, datagrams: Sequence[bytes]) -> None:
        """Send datagrams, in bursts that a small receive buffer can hold."""
        for place, data in enumerate(datagrams):
            with suppress(ConnectionRefusedError):  # the link is closed
                self.socket.send(data)
            if place % 100 == 99:
                time.sleep(0.005)

    def received(self, patience: float = 0.3) -> list[bytes]:
        """Return what arrives, until nothing does for a while."""
        self.socket.settimeout(patience)
        found = []
        try:
            while True:
                found.append(self.socket.recv(65536))
        except TimeoutError:
            return found
