"""The side of a simulated vehicle that PX4's module `zenoh` has, without input and output (docs/zenoh.md).

It takes the place of the client of DDS-XRCE. Its datagrams are those of `msggen.sim.transport`.
"""

from __future__ import annotations

import random
import struct
from collections import Counter
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, Final, NamedTuple, cast

from msggen.link.rmw_zenoh.names import NO_HASH, Attachment, Key
from msggen.link.xrce import client as xrce
from msggen.link.xrce.client_events import Connected, Event, Exchange, Received
from msggen.link.xrce.wire import ENCAPSULATION
from msggen.messages.names import stem_of
from msggen.messages.packages import zenoh_endpoints
from msggen.sim.endpoints import Endpoints, Input
from msggen.sim.options import Options
from msggen.sim.publishing import Publication, publication_of

OPENED, DECLARE, SAMPLE = range(3)
"""The kinds of datagrams: the session is open; what to declare; a sample, of either direction."""

_HEADER: Final = struct.Struct("<BH")
_SURPLUS: Final = 24
"""The bytes of its stack that PX4 v1.17 sends after a struct."""
_MARGIN: Final = 28
"""The bytes by which a sample to PX4 may be longer than the struct."""
_RETRY: Final = 1_000_000
"""The time in us after which a session is tried to be opened again. PX4 waits 5 s."""
_NEVER: Final = 1 << 62
_FAST: Final = frozenset({"sensor_combined", "vehicle_attitude"})
_FAST_INTERVAL: Final = 5_000
"""The interval in us of topics that the bridge to DDS limits, and Zenoh does not."""


class Topic(NamedTuple):
    """A topic on Zenoh."""

    key: Key
    size: int
    """That of the struct in uORB, with the padding at its end."""


class Declared(NamedTuple):
    """What a vehicle declares: its node, and its topics."""

    guid: bytes
    out: Mapping[int, Topic]
    to: Mapping[int, Topic]
    has_tokens: bool = True

    @property
    def text(self) -> str:
        """Return it as lines: the guid, or nothing for no tokens, and then MP or MS and a key."""
        kinds = [("MP", each.key) for each in self.out.values()] + [("MS", each.key) for each in self.to.values()]
        return "\n".join([self.guid.hex() if self.has_tokens else "", *(f"{kind} {key}" for kind, key in kinds)])


def zenoh_endpoints_of(package: ModuleType, options: Options) -> Endpoints:
    """Return the endpoints of a generated package that PX4's list for Zenoh has: without versions and limits."""
    namespace = f"/{options.namespace}" if options.namespace else ""
    import_module(f"{package.__name__}.topics")
    endpoints = zenoh_endpoints(package)
    is_by_type = not any(each.uorb_topic == "setpoint_config" for each in endpoints)
    publications, inputs, out, to = [], {}, {}, {}
    for number, endpoint in enumerate(endpoints):
        info = endpoint.message.__msg__
        name = namespace + stem_of(endpoint.ros_name)
        type_hash = info.type_hash if options.zenoh_hashes else NO_HASH
        topic = Topic(Key(0, name, info.ros_type, type_hash), -(-info.struct_size // 8) * 8)
        if endpoint.direction == "in":
            to[number] = topic
            uorb = info.topics[0] if is_by_type and endpoint.uorb_topic not in info.topics[:1] else endpoint.uorb_topic
            inputs[number] = Input(uorb, name, endpoint.message)
        else:
            out[number] = topic
            found = publication_of(endpoint, name=name, number=number, rate=options.rate, parts=options.equipment)
            publications.append(_unlimited(found) if options.rate is None else found)
    declared = Declared(_guid(options.key), out, to, options.zenoh_tokens)
    return Endpoints(publications, inputs, lambda: cast("xrce.Client", Client(declared, options.seed)))


def _unlimited(publication: Publication) -> Publication:
    if publication.topic not in _FAST:
        return publication
    return publication._replace(interval=_FAST_INTERVAL, pause=_FAST_INTERVAL)


def _guid(key: int) -> bytes:
    """Return a unique id as PX4's, whose first two bytes are the architecture."""
    return struct.pack(">H10xI", 2, key)


class Client:
    """The publishers and subscribers of a vehicle, with the methods of a client of DDS-XRCE. Times are in us."""

    offset = 0
    """What is added to timestamps: nothing converts them."""
    exchange = Exchange(0, 0, 0)

    def __init__(self, declared: Declared, seed: int = 0) -> None:
        self.is_connected = self.is_closed = False
        self.connections = 1
        self.refused: Counter[str] = Counter()
        self._declared = declared
        self._random = random.Random(seed)  # noqa: S311 - stale memory, not a secret
        self._numbers = {str(topic.key): number for number, topic in declared.to.items()}
        self._sequences: Counter[int] = Counter()
        self._events: list[Event] = []
        self._outgoing: list[tuple[bytes, int]] = []
        self._now = self._next = 0

    @property
    def is_ready(self) -> bool:
        """Whether `write` sends."""
        return self.is_connected

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        return _NEVER if self.is_connected else self._next

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its session."""
        taken, self._outgoing = self._outgoing, []
        return taken

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self._events = self._events, []
        return taken

    def advance(self, now: int) -> None:
        """Ask for a session."""
        self._now = now
        if not self.is_connected and not self.is_closed and now >= self._next:
            self._next = now + _RETRY
            self._send(DECLARE, self._declared.text, b"")

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram. Never raises."""
        self._now = now
        kind, key, payload = unpacked(data)
        if kind == OPENED:
            self.is_connected = True
            self._events.append(Connected())
        number = self._numbers.get(key) if kind == SAMPLE else None
        if number is None:
            return
        size = self._declared.to[number].size
        if len(ENCAPSULATION) <= len(payload) <= size + _MARGIN:  # others are dropped without a word
            self._events.append(Received(number, payload[len(ENCAPSULATION) :]))

    def refuse(self) -> None:
        """Do nothing: TCP tells who listens."""

    def write(self, number: int, data: bytes) -> bool:
        """Publish a sample, with what is left on the stack after it, and return whether it was sent."""
        topic = self._declared.out[number]
        self._now = max(self._now, int.from_bytes(data[:8], "little"))  # its timestamp: it may be made before `advance`
        self._sequences[number] += 1
        attachment = Attachment(self._sequences[number], self._now, self._declared.guid).pack()
        surplus = self._random.randbytes(max(0, topic.size + _SURPLUS - len(data)))
        self._send(SAMPLE, str(topic.key), attachment + ENCAPSULATION + data + surplus)
        return True

    def reply(self, number: int, identity: bytes, data: bytes) -> None:
        """Do nothing: there are no services."""

    def close(self, now: int) -> None:
        """End the session."""
        self._now = now
        self.is_connected, self.is_closed = False, True

    def _send(self, kind: int, key: str, payload: bytes) -> None:
        self._outgoing.append((packed(kind, key, payload), self.connections))


def packed(kind: int, key: str, payload: bytes) -> bytes:
    """Return a datagram."""
    name = key.encode()
    return _HEADER.pack(kind, len(name)) + name + payload


def unpacked(data: bytes) -> tuple[int, str, Any]:
    """Return the kind of a datagram, its key and its payload; -1 for other bytes."""
    if len(data) < _HEADER.size:
        return -1, "", b""
    kind, length = _HEADER.unpack_from(data)
    end = _HEADER.size + length
    return kind, data[_HEADER.size : end].decode("utf-8", "replace"), data[end:]
