"""Keys, tokens and guids of vehicles on Zenoh, for tests."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from msggen.link.rmw_zenoh.definitions import Definition, definition_of
from msggen.link.rmw_zenoh.names import Key, Token
from support.live_releases import DEFINITIONS

GUID = bytes.fromhex("0002") + bytes(13) + b"\1"
OTHER = GUID[:-1] + b"\2"
ZID = "0a" * 16


def key_of(message: str, version: int, name: str) -> Key:
    """Return the key of a topic with a version of a message, as an embedded release has it."""
    table = json.loads(DEFINITIONS.read_text(encoding="utf-8"))
    found = next(each for each, row in table.items() if row[0] == message and version in row[1])
    return Key(0, name, f"px4_msgs/msg/{message}", f"RIHS01_{found}")


STATUS = key_of("VehicleStatus", 4, "/fmu/out/vehicle_status")
COMMAND = key_of("VehicleCommand", 0, "/fmu/in/vehicle_command")


def definition(key: Key) -> Definition:
    """Return what the hash of a key stands for."""
    found = definition_of(key.type_hash, key.ros_type.rpartition("/")[2])
    assert found is not None
    return found


def token_of(key: Key | None, guid: bytes = GUID, zid: str = ZID) -> str:
    """Return the token of a vehicle's node, or of its endpoint."""
    kind: Any = "NN" if key is None else "MP" if "/out/" in key.name else "MS"
    return str(Token(0, zid, kind, f"px4_{guid.hex()}", key))


@contextmanager
def session(port: int, mode: str = "client") -> Iterator[Any]:
    """Open a session of another program, which is a client of a router, or the router."""
    import zenoh

    made = zenoh.Config()
    place = "connect" if mode == "client" else "listen"
    for key, value in (
        ("mode", f'"{mode}"'),
        (f"{place}/endpoints", f'["tcp/127.0.0.1:{port}"]'),
        ("scouting/multicast/enabled", "false"),
    ):
        made.insert_json5(key, value)
    with zenoh.open(made) as opened:
        yield opened
