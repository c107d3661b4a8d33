"""Sockets, serial devices and sessions with Zenoh routers of simulated vehicles."""

from __future__ import annotations

import json
import os
import socket
from collections import deque
from contextlib import ExitStack, suppress
from typing import Any, TypeAlias

from msggen.base.missing import installing
from msggen.link.address import Address, parse_address
from msggen.link.link import LinkError
from msggen.link.link_types import SIMULATED
from msggen.link.rmw_zenoh.names import GID_SIZE, PX4_QOS, Token, parse_key, reversed_id
from msggen.link.serial import close_line, open_line
from msggen.link.xrce.framing import AGENT, CLIENT, Deframer, pack_frame
from msggen.sim.zenoh import DECLARE, OPENED, SAMPLE, packed, unpacked

_LONGEST = 65_536
_ATTACHMENT = 17 + GID_SIZE


def read_address(text: str) -> Address:
    """Return the address of an agent in a text. Raises ValueError, which tells what is wrong."""
    try:
        address = parse_address(text, SIMULATED)
    except LinkError as error:
        raise ValueError(str(error)) from None
    if address.has_free_port:
        raise ValueError(f"'{text}' names no port to send to: expected one such as '{address.link_type.example}'")
    return address


class Udp:
    """A socket that is connected to the agent. A new connection has a socket, and so a port, of its own."""

    def __init__(self, address: Address) -> None:
        try:
            found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            text = f"no address is known for '{address.host}': {error}; give the IP address of the agent's computer"
            raise LinkError(text) from None
        self._family: int = found[0][0]
        self._agent: tuple[Any, ...] = found[0][4]
        self._connection = -1
        self.is_refused = False
        """Whether the host of the agent has refused a datagram since the last call of `send`."""
        self._socket = self._open()

    def _open(self) -> socket.socket:
        with ExitStack() as stack:
            try:
                opened = stack.enter_context(socket.socket(self._family, socket.SOCK_DGRAM))
                opened.setblocking(False)  # noqa: FBT003 - the name of the method says what it means
                opened.connect(self._agent)
            except OSError as error:
                raise LinkError(f"cannot send to {self._agent[0]}: {error.strerror}") from None
            stack.pop_all()
            return opened

    def fileno(self) -> int:
        """Return the file descriptor, another one after `send` on a new connection."""
        return self._socket.fileno()

    def send(self, data: bytes, connection: int) -> None:
        """Send a datagram. What cannot be sent is lost, as on a network without an agent."""
        if connection != self._connection:
            if self._connection >= 0:
                earlier, self._socket = self._socket, self._open()  # in this order, so that the descriptor differs
                earlier.close()
            self._connection = connection
        self.is_refused = False
        with suppress(OSError):
            self._socket.send(data)

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived."""
        found: list[bytes] = []
        with suppress(OSError):  # all are read, or the network is gone for now
            while True:
                try:
                    found.append(self._socket.recv(_LONGEST))
                except ConnectionError:
                    self.is_refused = True
        return found

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class Serial:
    """A serial device or a pseudo terminal."""

    is_refused = False
    """A line does not tell whether somebody listens."""

    def __init__(self, address: Address) -> None:
        self._device = open_line(address.path, address.baud)
        self._path = address.path
        self._frames = Deframer(CLIENT)

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._device

    def send(self, data: bytes, connection: int) -> None:  # noqa: ARG002 - a line has one connection
        """Send a frame. What the buffer of the device cannot take is lost."""
        with suppress(OSError):
            os.write(self._device, pack_frame(data, CLIENT, AGENT))

    def receive(self) -> list[bytes]:
        """Return the messages that have arrived. Raises LinkError if the device is gone."""
        found: list[bytes] = []
        try:
            while data := os.read(self._device, _LONGEST):
                found += self._frames.feed(data)
        except BlockingIOError:
            return found
        except OSError as error:
            raise LinkError(f"{self._path}: {error.strerror}, the device is gone") from None
        raise LinkError(f"{self._path}: the device is gone")

    def close(self) -> None:
        """Close the device."""
        close_line(self._device)


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


Transport: TypeAlias = Udp | Serial | Zenoh
"""The connection of a vehicle."""


def open_transport(address: Address) -> Transport:
    """Return a new connection to the agent. Raises LinkError."""
    if address.link_type.has_router:
        return Zenoh(address)
    return Serial(address) if address.link_type.is_device else Udp(address)
