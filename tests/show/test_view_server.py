"""Tests of what the server of `msggen view` lets a client do, as the page says: docs/topic.md."""

from __future__ import annotations

import json
import socket
import struct

import pytest
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from msggen.show.view.server import Server
from support.foxglove_client import WAIT, FoxgloveClient

PUBLISHED = {
    "id": 1,
    "topic": "/fmu/in/vehicle_command",
    "encoding": "cdr",
    "schemaName": "px4_msgs/msg/VehicleCommand",
}
REQUESTS = (
    {"op": "advertise", "channels": [PUBLISHED]},
    {"op": "getParameters", "parameterNames": [], "id": "1"},
    {"op": "setParameters", "parameters": [{"name": "a", "value": 1}], "id": "1"},
    {"op": "subscribeParameterUpdates", "parameterNames": ["a"]},
    {"op": "subscribeConnectionGraph"},
    {"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1},
)
IN_BYTES = (struct.pack("<BI", 1, 1) + bytes(12), struct.pack("<BIII", 2, 1, 1, 3) + b"cdr" + bytes(12))
"""A sample, and the call of a service."""


@pytest.mark.parametrize(("span", "capabilities"), [(None, []), ((0, 10**9), ["playbackControl"])])
def test_a_client_can_read_and_control_a_playback_only(span: tuple[int, int] | None, capabilities: list[str]) -> None:
    with Server("test", "127.0.0.1", 0, span) as server, FoxgloveClient(server.port) as client:
        client.receive(lambda: bool(client.told))
        assert client.told[0]["capabilities"] == capabilities
        for request in REQUESTS:
            client.send(request)
        for sample in IN_BYTES:
            client.send_bytes(sample)
        client.receive(lambda: len(client.told) > len(REQUESTS) + len(IN_BYTES))
        refusals = [told["message"] for told in client.told[1:]]
    assert all(text.startswith(("Server does not support ", "Unknown channel ID")) for text in refusals), refusals


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "vehicles.example"])
@pytest.mark.parametrize("origin", [None, "null", "file://", "https://app.foxglove.dev", "https://other.example"])
def test_origin_and_host_are_not_looked_at(origin: Origin | None, host: str) -> None:
    """This is what foxglove-sdk does. If a version refuses some, let it, and say so on the page."""
    with Server("test", "127.0.0.1", 0) as server, socket.create_connection(("127.0.0.1", server.port)) as sock:
        address, protocol = f"ws://{host}:{server.port}", Subprotocol("foxglove.sdk.v1")
        with connect(address, sock=sock, origin=origin, subprotocols=[protocol], open_timeout=WAIT) as client:
            assert json.loads(client.recv(WAIT))["op"] == "serverInfo"
