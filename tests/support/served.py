"""The owner of a link, in a thread of the test or in a process of its own."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msggen.link.address import parse_address
from msggen.link.link import Link
from msggen.vehicle.opening import open_link
from msggen.vehicle.owned.owners import Running, running, stop
from msggen.vehicle.owned.places import place_of
from msggen.vehicle.owned.records import PROTOCOL
from msggen.vehicle.owner.process import never
from msggen.vehicle.owner.server import Server

ADDRESS = "udp://127.0.0.1:8888"


@contextmanager
def served(link: Link, path: Path, address: str = ADDRESS, **settings: Any) -> Iterator[Server]:
    """Own a link in this process, for programs that join a socket at a path."""
    server = Server(link, parse_address(address), settings.get("allow", ()), settings.get("idle", never))
    link.start(server.owner)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen(64)
        thread = threading.Thread(target=server.serve, args=(listening,))
        thread.start()
        try:
            yield server
        finally:
            server.end()
            thread.join()
            link.close()


def hello(**changes: Any) -> dict[str, Any]:
    """Return what a program says first."""
    from msggen.base.version import __version__

    told = {
        "protocol": PROTOCOL,
        "version": __version__,
        "pid": os.getpid(),
        "name": "test",
        "address": "",
        "place": "",
        "allow": [],
    }
    return {**told, "is_program": True, **changes}


def owners() -> list[Running]:
    """Return the processes that own a link, in the folder of the test."""
    return running()


def end_owners() -> None:
    """Stop the processes that own a link, in the folder of the test."""
    for each in running():
        stop(each.place)


@contextmanager
def owned(url: str, allow: Sequence[str] = ()) -> Iterator[Server]:
    """Own a link in this process, where programs that name its address find and join it."""
    address = parse_address(url)
    place = place_of(address)
    with served(open_link(address, allow), Path(place.socket), url, allow=allow) as server:
        try:
            yield server
        finally:
            os.unlink(place.socket)
