"""A process that owns a link of simulated vehicles, and carries them to Zenoh: all in threads of the test."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import NamedTuple

from msggen.link.address import parse_address
from msggen.link.udp import UdpLink
from msggen.sim import Options, Simulator
from msggen.vehicle.owner.network import Network
from msggen.vehicle.owner.server import Server
from support.ports import free_port
from support.served import served

CALM = Options(sync="off", rate=10.0)


class Networked(NamedTuple):
    """Vehicles on a network."""

    url: str
    """The address of the router, which the network is itself."""
    simulator: Simulator
    server: Server
    network: Network


@contextmanager
def carried(owner: UdpLink, router: int, config: str, *types: ModuleType) -> Iterator[tuple[Server, Network]]:
    """Own a link, and carry its vehicles to a router at a port. `config` is a configuration of Zenoh, or ""."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "link.socket"
        with served(owner, path) as server:
            network = Network(
                parse_address(f"zenoh://127.0.0.1:{router}")._replace(config=config), str(path), lambda _: types
            )
            network.start()
            try:
                yield server, network
            finally:
                network.close()


@contextmanager
def networked(  # noqa: PLR0913 - keywords, each of which has a default
    px4: ModuleType,
    options: Sequence[Options] = (CALM,),
    *,
    port: int = 0,
    speed: float = 1.0,
    types: ModuleType | None = None,
    config: str = "",
) -> Iterator[Networked]:
    """Simulate vehicles over UDP, and carry them to the router at a port, or to one at a port of its own.

    `types` has the definitions that the owner knows, by default those of the vehicles.
    """
    port = port or free_port()
    link = UdpLink(port=0)
    with (
        carried(link, port, config, types or px4) as (server, network),
        Simulator(px4, f"udp://127.0.0.1:{link.port}", options, speed=speed) as simulator,
    ):
        yield Networked(f"zenoh://127.0.0.1:{port}", simulator, server, network)


@contextmanager
def standing(port: int) -> Iterator[tuple[int, threading.Event]]:
    """Forward the connections of a port of its own to another port, but nothing while an event is set."""
    still, ends = threading.Event(), list[socket.socket]()

    def forward(source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(4096):
                while still.is_set():
                    time.sleep(0.01)
                target.sendall(data)

    def serve() -> None:
        with suppress(OSError):
            while True:
                near, far = listening.accept()[0], socket.create_connection(("127.0.0.1", port))
                ends.extend((near, far))
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=forward, args=pair, daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve, daemon=True).start()
        try:
            yield listening.getsockname()[1], still
        finally:
            still.clear()
            listening.shutdown(socket.SHUT_RDWR)
            for end in ends:
                end.close()
