"""Sockets and serial devices of simulated vehicles."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Any, NamedTuple, Protocol
from urllib.parse import parse_qs, urlsplit

from msggen.live.link import LinkError
from msggen.live.xrce.framing import AGENT, CLIENT, Deframer, pack_frame

DEFAULT_ADDRESS = "udp://127.0.0.1:8888"
_PORT = 8888
_BAUD = 921_600
_LONGEST = 65_536
_EXAMPLES = f"expected an address such as {DEFAULT_ADDRESS} or serial:///dev/ttyUSB0?baud={_BAUD}"


class Address(NamedTuple):
    """The address of an agent."""

    kind: str
    """`udp` or `serial`."""
    place: str
    """A host, or the path of a device."""
    number: int
    """A port, or the speed in baud."""


def read_address(text: str) -> Address:
    """Return the address in a text. Raises ValueError, which tells what is wrong."""
    try:
        parts = urlsplit(text)
        port = parts.port
        options = parse_qs(parts.query, strict_parsing=bool(parts.query))
    except ValueError:
        raise ValueError(f"'{text}': {_EXAMPLES}") from None
    if parts.scheme == "udp" and parts.hostname and not parts.path.strip("/") and not options:
        return Address("udp", parts.hostname, _PORT if port is None else port)
    if parts.scheme == "serial" and parts.path and not parts.netloc and not options.keys() - {"baud"}:
        baud = options.get("baud", [str(_BAUD)])[-1]
        if baud.isascii() and baud.isdecimal() and int(baud) > 0:
            return Address("serial", parts.path, int(baud))
    raise ValueError(f"'{text}': {_EXAMPLES}")


class Transport(Protocol):
    """The connection of a vehicle."""

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
            found = socket.getaddrinfo(address.place, address.number, type=socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise LinkError(f"'{address.place}': {error}, {_EXAMPLES}") from None
        self._family: int = found[0][0]
        self._agent: tuple[Any, ...] = found[0][4]
        self._connection = -1
        self._socket = self._open()

    def _open(self) -> socket.socket:
        opened = socket.socket(self._family, socket.SOCK_DGRAM)
        opened.setblocking(False)  # noqa: FBT003 - the name of the method says what it means
        try:
            opened.connect(self._agent)
        except OSError as error:
            opened.close()
            raise LinkError(f"cannot send to {self._agent[0]}: {error.strerror}") from None
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
        with suppress(OSError):
            self._socket.send(data)

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived."""
        found: list[bytes] = []
        with suppress(BlockingIOError):
            while True:
                try:
                    found.append(self._socket.recv(_LONGEST))
                except ConnectionError:  # nobody listens on that port
                    continue
        return found

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class Serial:
    """A serial device or a pseudo terminal."""

    def __init__(self, address: Address) -> None:
        try:
            self._device = os.open(address.place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise LinkError(f"{address.place}: {error.strerror}") from None
        try:
            _make_raw(self._device, address.number)
        except LinkError as error:
            os.close(self._device)
            raise LinkError(f"{address.place}: {error}") from None
        self._path = address.place
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
        os.close(self._device)


def _make_raw(device: int, baud: int) -> None:
    """Set a speed, and pass all bytes unchanged. Raises LinkError."""
    try:
        import termios
        import tty
    except ImportError:
        raise LinkError("serial devices need Linux or macOS") from None
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise LinkError(f"{baud} baud is not a speed of this system: use 57600, 115200 or 921600")
    try:
        tty.setraw(device)
        settings = termios.tcgetattr(device)
        settings[4] = settings[5] = speed
        termios.tcsetattr(device, termios.TCSANOW, settings)
    except termios.error:
        raise LinkError("not a serial device") from None


def open_transport(address: Address) -> Transport:
    """Return a new connection to the agent. Raises LinkError."""
    return Udp(address) if address.kind == "udp" else Serial(address)
