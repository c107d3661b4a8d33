"""Micro XRCE-DDS agents on this computer, and the vehicles behind them."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import pairwise

from msggen.doctor.observation import SIM, AgentSeen, Sender
from msggen.doctor.sockets import owners, senders_to, sockets, words_of
from msggen.link.link import LinkError
from msggen.link.xrce import wire

_PX4 = "px4"
"""The name of PX4's process in simulation."""
_TRIES = 3
_ANSWER_S = 0.15
"""How long to wait for an answer, for each try."""
_DISCOVERY_S = 2.0
_PING = wire.pack_message(wire.NO_SESSION, wire.NO_STREAM, 0, wire.GetInfo(b"\x00\x0a").pack())


def is_agent(address: tuple[str, int]) -> bool:
    """Whether an agent answers at an address: GET_INFO gets an INFO (docs/xrce.md, 3)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, suppress(OSError):
        sock.connect(address)
        for _ in range(_TRIES):
            with suppress(OSError):  # nobody listens there, or the answer is late
                sock.send(_PING)
                sock.settimeout(_ANSWER_S)
                if _is_info(sock.recv(4096)):
                    return True
                continue
            time.sleep(0.02)
    return False


def _is_info(data: bytes) -> bool:
    with suppress(wire.WireError):
        header = wire.parse_header(data)
        return any(each.id == wire.INFO for each in wire.submessages(data[wire.HEADER.size + len(header.key) :]))
    return False


def find_agents(addresses: Iterable[tuple[str, int]], domain: int) -> tuple[AgentSeen, ...]:
    """Return the agents that answer at some addresses. Without a client on this computer, look for vehicles in DDS."""
    found = []
    for host, port in dict.fromkeys(addresses):
        if is_agent((host, port)):
            clients = senders_to((host, port))
            found.append(AgentSeen(f"{host}:{port}", clients, None if clients else namespaces_in(domain)))
    return tuple(found)


def namespaces_in(domain: int) -> tuple[str, ...] | None:
    """Return the namespaces of the vehicles in a DDS domain, None if the package cyclonedds is not installed."""
    from msggen.link.dds import DdsLink
    from msggen.vehicle.hub import Hub

    link = DdsLink(domain)
    hub = Hub(link)
    try:
        link.start(hub)
    except LinkError:
        return None
    try:
        hub.wait(lambda: bool(hub.entries), _DISCOVERY_S)
        return tuple(entry.remote.namespace for entry in tuple(hub.entries.values()))
    finally:
        link.close()


def find_senders(port: int) -> tuple[Sender, ...]:
    """Return the simulated vehicles on this computer, of PX4 or `msggen sim`, that send to other ports of it."""
    remotes = {f"socket:[{each.inode}]": each.remote for each in sockets() if each.remote[1] not in (0, port)}
    return tuple(
        Sender(process._replace(name=SIM if is_sim else process.name), f"{host}:{number}")
        for name, (host, number) in remotes.items()
        if host.startswith("127.")
        for process in owners([name])
        if (is_sim := _is_sim(words_of(process.pid))) or process.name == _PX4
    )


def _is_sim(words: Sequence[str]) -> bool:
    """Whether a command line is that of `msggen sim`."""
    return any(os.path.basename(program) == "msggen" and action == "sim" for program, action in pairwise(words))
