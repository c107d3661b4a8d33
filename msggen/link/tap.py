"""The tap: between PX4's client and a real agent, so that ROS 2 goes on and this program reads and writes beside it.

The client sends to the tap, and the tap to the agent, from a socket for each client: the agent tells clients apart by
their addresses. All datagrams are forwarded as they are, whether the tap understands them or not, but for one number:
samples of this program share the best-effort stream to the client with the agent's, so that the sequence numbers of
the agent's datagrams on it are shifted by the number of samples that were added. The client drops what is not newer
than the last one it had.

What the vehicle has and publishes is learned by an `Agent` that receives what the client sends, and whose answers are
thrown away.
"""

from __future__ import annotations

import selectors
import socket
import struct
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from msggen.link.age import LONGEST_NS, NEVER
from msggen.link.agent_link import SelectorLink
from msggen.link.link import LinkError, Listener, Remote, Service
from msggen.link.link_types import AGENT_PORT, PORT
from msggen.link.udp import BATCH, LONGEST, RECEIVE_BUFFER, Bound, allowed
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.wire import BEST_EFFORT, HEADER, NO_SESSION, STATUS_AGENT, has_data

HALF = 0x8000
"""A sequence number is newer than half of all numbers."""
_SO_TIMESTAMPNS = 35
"""An option of Linux, and the kind of what it tells: when a datagram has arrived, of the clock `time.time_ns`."""
_TIMESPEC = struct.Struct("@ll")
_TOLD = 64
"""The bytes for it: a header of up to 16 and two numbers."""
MAX_CLIENTS = 64
FORGET = 60.0
"""The time in s after which the socket of a silent client is closed."""

SILENT = 5.0
"""The time in s after which the socket of a silent client is closed if another client needs it."""


class Shift:
    """The numbers of the best-effort stream to a client: the agent's, shifted by the samples that were added."""

    def __init__(self) -> None:
        self.added = 0
        self._newest: int | None = None

    def forward(self, data: bytes) -> bytes:
        """Return a datagram of the agent as it goes to the client."""
        if len(data) < HEADER.size:
            return data
        session, stream, sequence = HEADER.unpack_from(data)
        if session < NO_SESSION:
            return data  # with a client key in the header: PX4's client has none
        if stream == 0 and len(data) > HEADER.size and data[HEADER.size] == STATUS_AGENT:
            self.added, self._newest = 0, None  # the client begins a session, and the stream begins anew
        if stream != BEST_EFFORT:
            return data
        shifted = (sequence + self.added) & 0xFFFF
        if self._newest is None or (shifted - self._newest) & 0xFFFF < HALF:
            self._newest = shifted
        return data if shifted == sequence else HEADER.pack(session, stream, shifted) + data[HEADER.size :]

    def add(self, data: bytes) -> bytes:
        """Return a datagram of this program as it goes to the client."""
        self.added = (self.added + 1) & 0xFFFF
        self._newest = 0 if self._newest is None else (self._newest + 1) & 0xFFFF
        session, stream, _ = HEADER.unpack_from(data)
        return HEADER.pack(session, stream, self._newest) + data[HEADER.size :]


class _Client:
    """A client of the tap, and its socket towards the agent."""

    def __init__(self, address: Address, sock: socket.socket) -> None:
        self.address = address
        self.socket = sock
        self.shift = Shift()
        self.heard = time.monotonic()


class TapLink(SelectorLink):
    """A link to the vehicles that send to a UDP port, and through it to a real agent."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        agent: tuple[str, int] = ("127.0.0.1", AGENT_PORT),
        allow: Sequence[str] = (),
    ) -> None:
        """Make a tap that listens on an address of this computer, and sends to an agent.

        `allow` as for UdpLink: what others send is not forwarded. Raises LinkError.
        """
        self._is_allowed = allowed(allow)
        super().__init__(allow=self._is_allowed)
        self.host = host
        self.port = port
        """The port, once the link is started also if it was 0."""
        self.agent_address = agent
        self._is_open_to_all = not allow
        self._bound: Bound | None = None
        self._clients: dict[Address, _Client] = {}
        self._told: set[str] = set()

    def open(self, listener: Listener) -> None:
        """Bind the socket that clients send to."""
        super().open(listener)
        self._bound = Bound(self.host, self.port)
        self.resources.callback(self._bound.close)
        self.resources.callback(self._close_clients)
        self.host, self.port = self._bound.host, self._bound.port
        try:
            self.agent_address = (socket.gethostbyname(self.agent_address[0]), self.agent_address[1])
        except OSError as error:
            raise LinkError(
                f"'{self.agent_address[0]}' is no IPv4 address and no known name: use 127.0.0.1 if the agent runs here"
            ) from error
        if self.agent_address[1] == self.port and _is_at(self.agent_address[0], self.host):
            raise LinkError(
                f"the tap and the agent cannot both be at {self.host}:{self.port}: start the agent with another port, "
                f"MicroXRCEAgent udp4 -p {AGENT_PORT}, and use tap://{self.host}:{self.port}?agent=127.0.0.1:{AGENT_PORT}"
            )
        self._bound.warn(listener, is_open_to_all=self._is_open_to_all)
        self.selector.register(self._bound.socket, selectors.EVENT_READ, self._from_clients)

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> NoReturn:
        """Raise LinkError: requests go on the reliable stream, which belongs to the agent."""
        del remote, number, payload, until
        raise LinkError(
            f"{service.name} cannot be called through a tap: publish VehicleCommand on /fmu/in/vehicle_command and "
            "wait for VehicleCommandAck, or call the service with ROS 2 through the agent"
        )

    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:  # noqa: ARG002 - none waits
        """Add samples to what the clients get. The caller holds the lock."""
        for data, address in datagrams:
            client = self._clients.get(address)
            if client is not None and data[1] == BEST_EFFORT:
                self._to_client(client.shift.add(data), address)

    def _to_client(self, data: bytes, address: Address) -> None:
        if self._bound is not None:
            self.sent += self._bound.send(data, address)

    def _from_clients(self, _events: int, listener: Listener) -> None:
        """Forward what clients have sent, then let the agent of this link have it."""
        if self._bound is None:
            return
        received: list[tuple[bytes, Address]] = []
        for _ in range(BATCH):
            try:
                data, address = self._bound.socket.recvfrom(LONGEST)
            except OSError:
                break
            client = self._client(address, listener)
            if client is not None:
                try:
                    client.socket.send(data)
                except BlockingIOError:  # lost, as on the network
                    pass
                except OSError as error:
                    self._miss_agent(error, listener)
            if client is not None or not self._is_allowed(address):
                received.append((data, address))
        now = time.time_ns()
        with self.lock:
            for data, address in received:
                self.agent.receive(data, address, now)
            self.agent.take_outgoing()  # the answers come from the other agent
        self.flush(listener)

    def _client(self, address: Address, listener: Listener) -> _Client | None:
        """Return the client at an address, or None if it may not connect."""
        client = self._clients.get(address)
        if client is not None:
            client.heard = time.monotonic()
            return client
        if not self._is_allowed(address):
            return None  # the agent of this link counts it
        if len(self._clients) >= MAX_CLIENTS and not self._make_room():
            text = f"ignored {address[0]}:{address[1]}: there are more than {MAX_CLIENTS} clients"
            self._tell_once("too many clients", text, listener)
            return None
        try:
            sock = self._towards_agent()
        except OSError as error:
            self._miss_agent(error, listener)
            return None
        client = _Client(address, sock)
        with self.lock:
            self._clients[address] = client
        self.selector.register(sock, selectors.EVENT_READ, lambda _, told: self._from_agent(client, told))
        return client

    def _towards_agent(self) -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sock.settimeout(0.0)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            if sys.platform == "linux":
                sock.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            sock.connect(self.agent_address)
        except BaseException:
            sock.close()
            raise
        return sock

    def _from_agent(self, client: _Client, listener: Listener) -> None:
        """Forward what the agent has sent to a client."""
        if self._clients.get(client.address) is not client:
            return  # another client has just taken its place
        with self.lock:
            for _ in range(BATCH):
                try:
                    data, is_late = _receive(client.socket)
                except BlockingIOError:
                    return
                except OSError as error:
                    problem = error
                    break
                if is_late and has_data(data):
                    self.unsent += 1
                else:
                    self._to_client(client.shift.forward(data), client.address)
            else:
                return
        self._miss_agent(problem, listener)

    def _miss_agent(self, error: OSError, listener: Listener) -> None:
        """Tell why the agent cannot be reached. Nobody listens at its port if a connection is refused."""
        host, port = self.agent_address
        if isinstance(error, ConnectionError):
            text = f"no agent answers at {host}:{port}: start it with MicroXRCEAgent udp4 -p {port}"
            self._tell_once("no agent", text, listener)
        else:
            text = f"cannot send to the agent at {host}:{port}: {error.strerror}"
            self._tell_once(f"error {error.errno}", text, listener)

    def _tell_once(self, kind: str, text: str, listener: Listener) -> None:
        if kind not in self._told:
            self._told.add(kind)
            listener.warned(text)

    def _make_room(self) -> bool:
        """Forget the client that is silent for longest, if PX4's would not be. Return whether there was one."""
        oldest = min(self._clients.values(), key=lambda client: client.heard)
        is_silent = time.monotonic() - oldest.heard > SILENT
        if is_silent:
            self._forget(oldest)
        return is_silent

    def _forget(self, client: _Client) -> None:
        with self.lock:
            del self._clients[client.address]
            self.selector.unregister(client.socket)
            client.socket.close()

    def look(self, now: float, listener: Listener) -> None:  # noqa: ARG002
        """Forget clients that are silent."""
        with self.lock:
            self.agent.take_outgoing()  # heartbeats for the answers that were thrown away
        for client in [client for client in self._clients.values() if now - client.heard > FORGET]:
            self._forget(client)

    def dropped(self) -> int:
        """Return how many datagrams of clients the kernel has dropped. Known on Linux."""
        return self._bound.dropped() if self._bound else 0

    def receive_buffer(self) -> int:
        """Return the size of the receive buffer in bytes that the kernel granted."""
        return self._bound.receive_buffer if self._bound else 0

    def _close_clients(self) -> None:
        for client in self._clients.values():
            client.socket.close()
        self._clients.clear()


def _receive(sock: socket.socket) -> tuple[bytes, bool]:
    """Return a datagram, and whether it has waited for too long in this computer, which is known on Linux."""
    if sys.platform != "linux":
        return sock.recv(LONGEST), False
    data, told, *_ = sock.recvmsg(LONGEST, _TOLD)
    for level, kind, stamp in told:
        if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS) and len(stamp) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(stamp)
            return data, not abs(time.time_ns() - seconds * 1_000_000_000 - nanoseconds) <= LONGEST_NS
    return data, False


def _is_at(host: str, listening: str) -> bool:
    """Whether a socket that listens on an address of this computer gets what is sent to a host."""
    if listening != "0.0.0.0":  # noqa: S104 - all addresses
        return host == listening
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, suppress(OSError):
        sock.bind((host, 0))
        return True
    return False
