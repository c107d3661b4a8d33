"""The session of a simulated vehicle with a Zenoh router, through the package eclipse-zenoh."""

from __future__ import annotations

import json
import socket
from collections import deque
from contextlib import suppress
from typing import Any

from msggen.base.missing import installing
from msggen.link.address import Address
from msggen.link.link import LinkError
from msggen.link.rmw_zenoh.names import GID_SIZE, PX4_QOS, Token, parse_key, reversed_id
from msggen.sim.zenoh import DECLARE, OPENED, SAMPLE, packed, unpacked

_ATTACHMENT = 17 + GID_SIZE


class Zenoh:
    """A session as a client of a router, as PX4 has one. It is opened when there is something to declare."""

    is_refused = False
    """TCP tells when a session is opened."""

    def __init__(self, address: Address) -> None:
        try:
            import zenoh
        except ImportError as error:
            raise LinkError(f"the package eclipse-zenoh is not installed: {installing('zenoh')}") from error
        self._zenoh: Any = zenoh
        self._locator = f"tcp/{address.host}:{address.port}"
        self._connection = 0
        self._session: Any = None
        self._declared: list[Any] = []
        self._arrived: deque[bytes] = deque(maxlen=10_000)
        self._awake, self._wake = socket.socketpair()
        for end in (self._awake, self._wake):
            end.setblocking(False)  # noqa: FBT003 - the name of the method says what it means

    def fileno(self) -> int:
        """Return the file descriptor of what the threads of Zenoh write to."""
        return self._awake.fileno()

    def send(self, data: bytes, connection: int) -> None:
        """Declare, or put a sample. What cannot be sent is lost. A new connection is a new session."""
        if connection != self._connection:
            self._end()
            self._connection = connection
        kind, key, payload = unpacked(data)
        with suppress(self._zenoh.ZError):
            if kind == DECLARE and self._session is None:
                self._open(key.split("\n"))
            elif kind == SAMPLE and self._session is not None:
                block = self._zenoh.CongestionControl.BLOCK  # what is to be lost is lost on purpose
                attachment, sample = payload[:_ATTACHMENT], payload[_ATTACHMENT:]
                self._session.put(key, sample, attachment=attachment, congestion_control=block, express=True)

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived."""
        with suppress(OSError):
            self._awake.recv(65_536)
        found = []
        while self._arrived:
            found.append(self._arrived.popleft())
        return found

    def close(self) -> None:
        """End the session."""
        self._end()
        self._awake.close()
        self._wake.close()

    def _open(self, lines: list[str]) -> None:
        """Open a session, and declare what PX4 declares, in its order: what it reads, and then what it publishes."""
        settings = {
            "mode": "client",
            "connect/endpoints": [self._locator],
            "connect/timeout_ms": 0,
            "scouting/multicast/enabled": False,
            "scouting/delay": 0,
        }
        made = self._zenoh.Config()
        for name, value in settings.items():
            made.insert_json5(name, json.dumps(value))
        session = self._zenoh.open(made)
        guid, *rows = lines
        zid, node = reversed_id(str(session.info.zid())), f"px4_{guid}"
        self._declare(session, str(Token(0, zid, "NN", node)) if guid else "")
        for kind, text in sorted((row.split(" ") for row in rows), reverse=True):
            key = parse_key(text)
            if kind == "MS":
                self._declared.append(session.declare_subscriber(text, self._take))
            if guid and key is not None:
                self._declare(session, str(Token(key.domain, zid, "MS" if kind == "MS" else "MP", node, key, PX4_QOS)))
        self._session = session
        self._tell(packed(OPENED, "", b""))

    def _declare(self, session: Any, token: str) -> None:
        if token:
            self._declared.append(session.liveliness().declare_token(token))

    def _take(self, sample: Any) -> None:
        self._tell(packed(SAMPLE, str(sample.key_expr), bytes(sample.payload)))

    def _tell(self, data: bytes) -> None:
        self._arrived.append(data)
        with suppress(OSError):
            self._wake.send(b"\0")

    def _end(self) -> None:
        session, self._session = self._session, None
        self._declared.clear()
        if session is not None:
            session.close()
