"""Tokens and samples of strangers on the network to which the owner of a link carries a vehicle.

Whatever arrives, only samples of the topic reach the vehicle, in PX4's encapsulation and in time; those of a node that
behaves reach it; and what strangers tell takes a limited part of the memory.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from logging import NullHandler, getLogger
from random import Random
from typing import Any, NamedTuple

from msggen.generate.cache import package_of
from msggen.link.address import parse_address
from msggen.link.age import LONGEST_NS, expiry, now
from msggen.link.link import LinkError, Remote, Route
from msggen.link.rmw_zenoh.names import Attachment, Key, Qos, Token
from msggen.vehicle.entry import Entry
from msggen.vehicle.owner.network import Network
from msggen.vehicle.owner.network_topics import OnNetwork, Topic
from support.zenoh_space import GUID, ZID

COUNT = 40

getLogger("msggen.live").addHandler(NullHandler())  # without a handler, Python prints the warnings

ATTACHMENT = struct.Struct("<qqB16s")
MOST = 1000
NAME = "/fmu/in/vehicle_command"
ENCAPSULATIONS = (b"\0\0", b"\0\1", b"\0\6", b"\0\7", b"\0\3", b"\xff\xff")


class Case(NamedTuple):
    """A sequence of things that arrive, which follows from a seed."""

    seed: int
    size: int


def case(chance: Random) -> Case:
    """Return a random sequence."""
    return Case(chance.randrange(2**32), chance.choice((50, 100, 200)))


class Link:
    """Takes what would be sent to the vehicle, and refuses some."""

    def __init__(self, chance: Random, size: int) -> None:
        self.sent: list[bytes] = []
        self._chance, self._size = chance, size

    def publish(self, _remote: Remote, route: Route, payload: bytes, until: int) -> None:
        """Check a sample to the vehicle."""
        assert route.name == NAME
        assert payload[:4] == b"\0\1\0\0"
        assert len(payload) == self._size
        assert until - now() <= LONGEST_NS
        if self._chance.random() < 0.05:
            raise LinkError("the vehicle is gone")
        self.sent.append(payload)


class Session:
    """A session of Zenoh."""

    zid = ZID

    def is_own(self, zid: str) -> bool:
        """Whether it is the one of the process."""
        return zid == ZID


def check(case: Case) -> None:
    """Let them arrive, each followed by a sample of a node that behaves."""
    chance, px4_types = Random(case.seed), package_of("v1.18")  # noqa: S311 - for repetition, not for secrets
    message = px4_types.VehicleCommand
    network: Any = Network(parse_address("zenoh://127.0.0.1:7447"), "/none.socket", lambda _: (px4_types,))
    link = network._link = Link(chance, len(message().encode()))
    network._connection.session = Session()
    info = message.__msg__
    route = Route(NAME, info.ros_type, "in", 1)
    topic = Topic(route, Key(0, NAME, info.ros_type, info.type_hash), Qos(), message)
    vehicle = OnNetwork(Entry(Remote(1, "", 1, "", continued=False), network._link, lambda *_: None))
    try:
        for number in range(1, case.size + 1):
            chance.choice((_token, _token, _sample, _sample, _many))(network, vehicle, topic, chance)
            own = message(command=number).encode()
            before = len(link.sent)
            refused = network.refusals.counts[NAME]
            _put(network, vehicle, topic, own, Attachment(number, time.time_ns(), GUID).pack())
            assert len(link.sent) > before or network.refusals.counts[NAME] > refused
            if len(link.sent) > before:
                assert link.sent[-1] == own, "a sample of a node that behaves has not arrived"
            assert len(network._strangers) <= MOST
            assert len(network._left) <= MOST
            assert sum(map(len, network._strangers.values())) <= MOST * MOST
            assert len(network._waiting._ways) <= MOST
            assert set(network.refusals.counts) <= {NAME}
        assert len(link.sent) > case.size / 2
    finally:
        network._aside.close(1.0)
        network._answers.close(1.0)


def _put(network: Any, vehicle: Any, topic: Topic, payload: bytes, attachment: bytes | None) -> None:
    network._send(vehicle, topic, payload, attachment, time.time_ns(), expiry())


def _sample(network: Any, vehicle: Any, topic: Topic, chance: Random) -> None:
    whole = topic.message().encode()
    body = chance.choice((whole[4:], chance.randbytes(len(whole) - 4), chance.randbytes(chance.randrange(200))))
    told = chance.choice((time.time_ns(), 0, -1, 2**63 - 1, -(2**63), chance.randrange(2**63)))
    gid = chance.choice((chance.randbytes(16), bytes(16)))
    attachment = ATTACHMENT.pack(chance.randrange(-(2**63), 2**63), told, chance.choice((16, 16, 16, 0, 255)), gid)
    given = chance.choice((attachment, attachment, attachment, chance.randbytes(chance.randrange(64)), None))
    payload = chance.choice(ENCAPSULATIONS) + chance.choice((b"\0\0", b"\0\3", b"\xff\xff")) + body
    _put(network, vehicle, topic, chance.choice((payload, payload, b"", payload[:3])), given)


def _token(network: Any, _vehicle: Any, _topic: Topic, chance: Random) -> None:
    name = chance.choice((NAME, "/fmu/out/x", f"/uav_{chance.randrange(5000)}/fmu/out/t{chance.randrange(50)}"))
    kind: Any = chance.choice(("NN", "MP", "MS", "SS", "SC"))
    key = None if kind == "NN" else Key(chance.choice((0, 0, 7)), name, "px4_msgs/msg/X", "TypeHashNotSupported")
    zid = chance.choice((ZID, chance.randbytes(16).hex()))
    text = str(Token(chance.choice((0, 0, 7)), zid, kind, chance.choice(("msggen_1", "node")), key))
    network._note(chance.choice((text, text, text[:-5], text * 3, "")), is_alive=chance.random() < 0.8)


def _many(network: Any, vehicle: Any, topic: Topic, chance: Random) -> None:
    for _ in range(chance.randrange(50)):
        act: Callable[..., None] = chance.choice((_token, _sample))
        act(network, vehicle, topic, chance)
