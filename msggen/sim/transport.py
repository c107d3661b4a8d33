"""Sockets and serial devices of simulated vehicles."""

from __future__ import annotations

import os
import socket
from contextlib import ExitStack, suppress
from typing import Any, Protocol

from msggen.link.address import Address, parse_address
from msggen.link.link import LinkError
from msggen.link.link_types import SIMULATED
from msggen.link.serial import close_line, open_line
from msggen.link.xrce.framing import AGENT, CLIENT, Deframer, pack_frame

_LONGEST = 65_536


def read_address(text: str) -> Address:
    """Return the address of an agent in a text. Raises ValueError, which tells what is wrong."""
    try:
        address = parse_address(text, SIMULATED)
    except LinkError as error:
        raise ValueError(str(error)) from None
    if address.has_free_port:
        raise ValueError(f"'{text}' names no port to send to: expected one such as '{address.link_type.example}'")
    return address


class Transport(Protocol):
    """The connection of a vehicle."""

    @property
    def is_refused(self) -> bool:
        """Whether a datagram of the connection was refused: nobody listens on that port, which only UDP tells."""

    def fileno(self) -> int:
        """Return the file descriptor, for a selector."""

    def send(self, data: bytes, connection: int) -> None:
        """Send a datagram. What cannot be sent is lost."""

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived. Raises LinkError if there will be no more."""

    def close(self) -> None:
        """Release the socket or device."""


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
        self._is_refused = False
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

    @property
    def is_refused(self) -> bool:
        """Whether the host of the agent has refused a datagram since the last call of `send`."""
        return self._is_refused

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
        self._is_refused = False
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
                    self._is_refused = True
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


def open_transport(address: Address) -> Transport:
    """Return a new connection to the agent. Raises LinkError."""
    if address.link_type.has_router:
        from msggen.sim.zenoh_transport import Zenoh

        return Zenoh(address)
    return Serial(address) if address.link_type.is_device else Udp(address)
