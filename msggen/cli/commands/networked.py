"""The network of `msggen link serve --zenoh`, also in a process of its own, which `--background` starts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.vehicle.owner.process import main as own

if TYPE_CHECKING:
    from msggen.messages.firmware import Firmware
    from msggen.messages.packages import Packages
    from msggen.vehicle.owned.places import Place

PROCESS = "msggen.cli.commands.networked"


def main() -> None:
    """Run an owner with a network, apart from the program that starts it."""
    own(_network)


def setup_of(zenoh: str, types: ModuleType | None) -> Mapping[str, object]:
    """Return what tells another process about a network: the address of the router, and the types that are named."""
    return {"zenoh": zenoh, "types": os.path.dirname(os.path.abspath(str(types.__file__))) if types is not None else ""}


@contextmanager
def _network(setup: Mapping[str, Any], place: Place) -> Iterator[None]:
    from msggen.cli.packages import import_package

    types = import_package(setup["types"]) if setup["types"] else None
    with networked(setup["zenoh"], place, types):
        yield


@contextmanager
def networked(zenoh: str, place: Place, types: ModuleType | None) -> Iterator[None]:
    """Carry the vehicles of an owner, which serves soon, to the router at an address. Raises LinkError."""
    from msggen.link.address import parse_address
    from msggen.vehicle.owner.network import Network

    network = Network(parse_address(zenoh), place.socket, _types_for(types))
    network.start()
    try:
        yield
    finally:
        network.close()


def _types_for(known: ModuleType | None) -> Callable[[Firmware], Packages]:
    """Return what chooses the packages of a firmware: the one that is named, if its definitions are told, and its own.

    A firmware that tells none, before v1.15, has those of its release.
    """
    from msggen.generate.cache import package_of

    def types(firmware: Firmware) -> Packages:
        released = (package_of(firmware.release),) if firmware.release else ()
        return (known, *released) if known is not None and firmware.hashes else (*released, *filter(None, [known]))

    return types
