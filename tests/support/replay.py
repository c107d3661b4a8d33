"""A client of DDS-XRCE that sends what PX4's client sent in a capture, over a real socket or a pseudo terminal."""

from __future__ import annotations

import gzip
import json
import socket
import struct
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import pytest

from support.repository import ROOT

if TYPE_CHECKING:
    from typing_extensions import Self

CAPTURES = ROOT / "tests" / "live" / "captures"

CREATE, GET_INFO, DELETE, STATUS_AGENT, INFO, WRITE_DATA, READ_DATA, DATA, TIMESTAMP = 1, 2, 3, 4, 6, 7, 8, 9, 14
"""Ids of submessages."""


@lru_cache
def rows(name: str) -> Sequence[tuple[str, bytes]]:
    """Return the datagrams, or the chunks of bytes, of a capture, with their senders."""
    path = CAPTURES / f"{name}.json.gz"
    if not path.exists():
        pytest.skip(f"needs {path}")
    with gzip.open(path, "rt", encoding="utf-8") as file:
        loaded: Any = json.load(file)
    listed = loaded["datagrams"] if isinstance(loaded, dict) else loaded
    return [(row[1], bytes.fromhex(row[2])) for row in listed]


def expected() -> Any:
    """Return the decoding of `session-udp`, and counts of the other captures."""
    path = CAPTURES / "expected.json"
    if not path.exists():
        pytest.skip(f"needs {path}")
    return json.loads(path.read_text(encoding="utf-8"))


@lru_cache
def sent(name: str) -> Sequence[bytes]:
    """Return what the client sent in a capture."""
    return [data for sender, data in rows(name) if sender == "client"]


def kind(datagram: bytes) -> int:
    """Return the id of the first submessage."""
    return datagram[4]


@lru_cache
def creation(name: str) -> Sequence[bytes]:
    """Return what the client sent up to its last entity, without samples and time sync: a session with endpoints."""
    datagrams = sent(name)
    last = max(place for place, data in enumerate(datagrams) if data[1] == 0x80 and kind(data) in {CREATE, READ_DATA})
    return [data for data in datagrams[: last + 1] if kind(data) not in {WRITE_DATA, TIMESTAMP}]


@lru_cache
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
