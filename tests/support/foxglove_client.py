"""A client of Foxglove's websocket, for tests: what its application does."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from types import TracebackType
from typing import Any

from typing_extensions import Self
from websockets.sync.client import connect
from websockets.typing import Subprotocol

WAIT = 20.0
"""A bound in s that no test reaches."""


class FoxgloveClient:
    """A client that subscribes to all channels and keeps what it gets."""

    def __init__(self, port: int) -> None:
        self._stack = ExitStack()
        address, protocol = f"ws://127.0.0.1:{port}", Subprotocol("foxglove.sdk.v1")
        self._socket = self._stack.enter_context(connect(address, subprotocols=[protocol], open_timeout=WAIT))
        self.channels: dict[int, Mapping[str, Any]] = {}
        self.gone: set[int] = set()
        self.told: list[Mapping[str, Any]] = []
        """All other texts of the server."""
        self.samples: list[tuple[str, int, bytes]] = []
        """Topic, time in ns and payload."""
        self._payloads: dict[str, list[bytes]] = {}
        self.states: list[bytes] = []

    def receive(self, is_done: Callable[[], bool]) -> None:
        """Receive until a condition is true. It is called after each text, and when nothing has come for a moment."""
        end = time.monotonic() + WAIT
        while not is_done():
            if time.monotonic() > end:
                numbers = {each["topic"]: len(self.of(each["topic"])) for each in self.channels.values()}
                raise TimeoutError(f"not seen in {WAIT:g} s; samples by channel: {numbers}")
            with suppress(TimeoutError):
                self._receive_one(self._socket.recv(0.05))

    def _receive_one(self, data: str | bytes) -> None:
        if isinstance(data, str):
            self._take(json.loads(data))
        elif data[0] == 1:
            number, stamp = struct.unpack_from("<IQ", data, 1)
            topic, payload = self.channels[number]["topic"], data[13:]
            self.samples.append((topic, stamp, payload))
            self._payloads.setdefault(topic, []).append(payload)
        else:
            self.states.append(data)

    def _take(self, told: Mapping[str, Any]) -> None:
        if told["op"] == "advertise":
            for channel in told["channels"]:
                self.channels[channel["id"]] = channel
            wanted = [{"id": each["id"], "channelId": each["id"]} for each in told["channels"]]
            self.send({"op": "subscribe", "subscriptions": wanted})
        elif told["op"] == "unadvertise":
            self.gone.update(told["channelIds"])
        else:
            self.told.append(told)

    def send(self, request: Mapping[str, Any]) -> None:
        """Send a request in JSON."""
        self._socket.send(json.dumps(request))

    def send_bytes(self, request: bytes) -> None:
        """Send a request in bytes."""
        self._socket.send(request)

    def send_control(self, command: int, speed: float, seek: int | None, request: str) -> None:
        """Send what the playback controls send: command 0 plays, 1 pauses."""
        place = struct.pack("<BQ", 1, seek) if seek is not None else bytes(9)
        identity = request.encode()
        self._socket.send(struct.pack("<BBf", 3, command, speed) + place + struct.pack("<I", len(identity)) + identity)

    def of(self, topic: str) -> list[bytes]:
        """Return the payloads of a topic so far."""
        return self._payloads.get(topic, [])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()
