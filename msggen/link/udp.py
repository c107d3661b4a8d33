"""The link over UDP: PX4's client connects to this program instead of MicroXRCEAgent."""

from __future__ import annotations

import errno
import ipaddress
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache

from msggen.link.age import NEVER
from msggen.link.agent_link import AgentLink
from msggen.link.link import LinkError, Listener, deliver
from msggen.link.link_types import PORT
from msggen.link.xrce.outbox import Address

LONGEST = 65536
"""The length of the longest datagram."""
BATCH = 64
"""The number of datagrams that are received before the listener is told."""
FAST = 100_000
"""The time in ns between two datagrams below which more of them are expected."""
RECEIVE_BUFFER = 4 << 20
"""The size of the receive buffer that is asked for. Linux grants up to `net.core.rmem_max`."""

_SO_MEMINFO = 55
"""A socket option of Linux since 4.12, which the module socket does not name: nine numbers, the last one the drops."""
_MEMINFO = struct.Struct("9I")


class UdpLink(AgentLink):
    """A link to all vehicles whose clients send to a UDP port."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        allow: Sequence[str] = (),
        keys: Sequence[int] = (),
        records: str = "",
    ) -> None:
        """Make a link that listens on an address of this computer; 0.0.0.0 for all of them, port 0 for any free one.

        `allow` are IP addresses and networks (`192.168.0.0/24`) that may connect, all of them if there are none.
        `keys` and `records` as for AgentLink. Raises LinkError.
        """
        super().__init__(allow=allowed(allow), keys=keys, records=records)
        self.host = host
        self.port = port
        """The port, once the link is started also if it was 0."""
        self._is_open_to_all = not allow and not keys
        self.bound: Bound | None = None
        self._last = 0

    def open(self, listener: Listener) -> None:
        """Bind the socket."""
        self.bound = Bound(self.host, self.port)
        self.resources.callback(self.bound.close)
        self.host, self.port = self.bound.host, self.bound.port
        self.bound.warn(listener, is_open_to_all=self._is_open_to_all)
        self._waits = self.resources.enter_context(self.bound.socket.dup())  # the same socket, with another time-out

    def wait(self, seconds: float, listener: Listener) -> None:
        """Give the agent what arrives.

        There is no selector, which would cost half as much again as all the rest, and more than one datagram is asked
        for only if they come fast.
        """
        agent = self.agent
        self._waits.settimeout(seconds)
        try:
            data, address = self._waits.recvfrom(LONGEST)
        except (BlockingIOError, TimeoutError, ConnectionError):  # the last one on Windows: a receiver has gone
            return
        now = time.time_ns()
        with self.lock:
            agent.receive(data, address, now)
            if now - self._last < FAST:
                self._drain(now)
            self._last = now
            events = self.settle()
        deliver(events, listener)

    def _drain(self, now: int) -> None:
        """Give the agent what has arrived already. The caller holds the lock."""
        if self.bound is None:
            return
        receive, take = self.bound.socket.recvfrom, self.agent.receive
        with suppress(BlockingIOError, ConnectionError):
            for _ in range(BATCH):
                data, address = receive(LONGEST)
                take(data, address, now)

    def wake(self) -> None:
        """Let the thread look around at once, where the system wakes it. Elsewhere it does so after TICK."""
        if self.bound is not None:
            with suppress(OSError):
                self.bound.socket.shutdown(socket.SHUT_RD)

    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:  # noqa: ARG002 - none waits
        """Send datagrams. One that cannot be sent at once is lost, as on the network."""
        if self.bound is None:
            return
        for data, address in datagrams:
            self.sent += self.bound.send(data, address)

    def name(self) -> str:
        """Return the address of the link."""
        return f"udp://{self.host}:{self.port}"

    def dropped(self) -> int:
        """Return how many datagrams the kernel has dropped. Known on Linux."""
        return self.bound.dropped() if self.bound else 0

    def receive_buffer(self) -> int:
        """Return the size of the receive buffer in bytes that the kernel granted."""
        return self.bound.receive_buffer if self.bound else 0


class Bound:
    """A UDP socket at an address of this computer, and what the kernel tells of it."""

    def __init__(self, host: str, port: int) -> None:
        """Bind a socket that does not block. Raises LinkError."""
        self.socket = bound(host, port)
        self.host: str
        self.port: int
        self.host, self.port = self.socket.getsockname()
        size = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        self.receive_buffer = size // 2 if sys.platform == "linux" else size  # Linux counts its own overhead: socket(7)
        self._dropped = 0

    def warn(self, listener: Listener, *, is_open_to_all: bool) -> None:
        """Warn if the socket is reachable from the network."""
        if ipaddress.ip_address(self.host).is_loopback:
            return
        text = (
            f"listening on {self.host}:{self.port}: UDP has no authentication, "
            "so whoever can send to this port can pose as a vehicle"
        )
        listener.warned(f"{text}; name those who may with allow=" if is_open_to_all else text)

    def send(self, data: bytes, address: Address) -> bool:
        """Send a datagram. Return whether it could be sent."""
        try:
            self.socket.sendto(data, address)
        except OSError:
            return False
        return True

    def dropped(self) -> int:
        """Return how many datagrams the kernel has dropped because the receive buffer was full. Known on Linux."""
        if sys.platform == "linux":
            with suppress(OSError, struct.error):  # closed, or an old kernel
                told = self.socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size)
                self._dropped = _MEMINFO.unpack(told)[-1]
        return self._dropped

    def close(self) -> None:
        """Close the socket."""
        self.dropped()  # the last chance to ask
        self.socket.close()


def allowed(networks: Sequence[str]) -> Callable[[Address], bool]:
    """Return a function that tells whether an address is in one of some networks. Raises LinkError."""
    if isinstance(networks, str):
        networks = (networks,)
    parsed = [_network(each) for each in networks]

    @lru_cache(maxsize=1024)
    def is_allowed(host: str) -> bool:
        address = ipaddress.ip_address(host)
        return not parsed or any(address in network for network in parsed)

    return lambda address: is_allowed(address[0])


def _network(text: str) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        expected = "expected one such as '192.168.0.7' or '192.168.0.0/24'"
        raise LinkError(f"'{text}' in allow= is not an IP address or a network: {expected}") from None


def bound(host: str, port: int) -> socket.socket:
    """Return a UDP socket at an address of this computer. Raises LinkError."""
    if not 0 <= port < 65536:  # noqa: PLR2004 - 16 bits
        raise LinkError(f"the port is {port}, and must be between 0 and 65535")
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # PX4's client speaks IPv4 only
    try:
        sock.settimeout(0.0)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.bind((host, port))
    except OSError as error:
        sock.close()
        raise LinkError(_why(error, host, port)) from error
    except BaseException:
        sock.close()
        raise
    return sock


def _why(error: OSError, host: str, port: int) -> str:
    """Return why a socket cannot be bound, and what to do."""
    if error.errno == errno.EADDRINUSE:
        return (
            f"UDP port {port} of {host} is in use: MicroXRCEAgent or another program listens there. Stop it, or use "
            f"another port: udp://{host}:{port + 1 if port < 65535 else port - 1}, "  # noqa: PLR2004 - the last port
            "and the same port at the vehicle (UXRCE_DDS_PRT, or uxrce_dds_client start -p)"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{host} is no address of this computer: use 127.0.0.1, one of its own addresses, or 0.0.0.0 for all"
    if error.errno == errno.EACCES:
        return f"no permission for UDP port {port}: use one above 1023"
    if isinstance(error, socket.gaierror):
        return (
            f"'{host}' is no IPv4 address and no name that this computer knows: use 127.0.0.1, or an address of its own"
        )
    return f"cannot listen on UDP port {port} of {host}: {error}"
