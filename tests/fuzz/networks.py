"""Tokens and samples of strangers on the network to which the owner of a link carries a vehicle.

Whatever arrives, only samples of the topic reach the vehicle, in PX4's encapsulation and in time; those of a node that
behaves reach it; and what strangers tell takes a limited part of the memory. Clocks are ahead and behind, that of the
owner is set at times, and strangers forge times and the gid of the node that behaves.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from logging import NullHandler, getLogger
from random import Random
from typing import Any, NamedTuple

from msggen.generate.cache import package_of
from msggen.link.address import parse_address
from msggen.link.age import LONGEST_NS
from msggen.link.link import LinkError, Remote, Route
from msggen.link.rmw_zenoh.names import Attachment, Key, Qos, Token
from msggen.vehicle.entry import Entry
from msggen.vehicle.owner.network import Network
from msggen.vehicle.owner.network_topics import OnNetwork, Topic
from support.zenoh_space import GUID, OTHER, ZID

COUNT = 40

getLogger("msggen.live").addHandler(NullHandler())  # without a handler, Python prints the warnings

ATTACHMENT = struct.Struct("<qqB16s")
MOST = 1000
NAME = "/fmu/in/vehicle_command"
SECOND = "/fmu/in/vehicle_command_mode_executor"
START = 10**18 + 10**17
RIGHT = bytes(range(16))
"""The gid of a node of a computer whose clock is right."""
LOST = "a sample of a node that behaves has not arrived"
FORGED_NS = 20 * 10**9
WAYS = 5
"""After how many samples the clock of a node is known."""
ENCAPSULATIONS = (b"\0\0", b"\0\1", b"\0\6", b"\0\7", b"\0\3", b"\xff\xff")


class Case(NamedTuple):
    """A sequence of things that arrive, which follows from a seed."""

    seed: int
    size: int


def case(chance: Random) -> Case:
    """Return a random sequence."""
    return Case(chance.randrange(2**32), chance.choice((50, 100, 200)))


class Computer:
    """The clocks of the computer of the owner, in ns: that since boot, and that since 1970, which is set at times."""

    def __init__(self) -> None:
        self.boot, self.own = 10**13, START
        self.right = START
        """What the clocks of other computers tell."""
        self.forged = 0
        """When the last sample was forged that is whole."""

    def wait(self, time: int) -> None:
        """Let time pass."""
        self.boot, self.own, self.right = self.boot + time, self.own + time, self.right + time


class Link:
    """Takes what would be sent to the vehicle, and refuses some."""

    def __init__(self, chance: Random, size: int, computer: Computer) -> None:
        self.sent: list[bytes] = []
        self.computer = computer
        self.longest = LONGEST_NS
        """How long what arrives next may still wait."""
        self.gone = 0
        self._chance, self._size = chance, size

    def publish(self, _remote: Remote, route: Route, payload: bytes, until: int) -> None:
        """Check a sample to the vehicle."""
        assert route.name == NAME
        assert payload[:4] == b"\0\1\0\0"
        assert len(payload) == self._size
        assert until - self.computer.boot <= LONGEST_NS
        assert 0 <= until - self.computer.boot <= self.longest, "a sample that is late"
        if self._chance.random() < 0.05:
            self.gone += 1
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
    link = network._link = Link(chance, len(message().encode()), Computer())
    network._connection.session = Session()
    info = message.__msg__
    route = Route(NAME, info.ros_type, "in", 1)
    topic = Topic(route, Key(0, NAME, info.ros_type, info.type_hash), Qos(), message)
    vehicle = OnNetwork(Entry(Remote(1, "", 1, "", continued=False), network._link, lambda *_: None))
    try:
        for number in range(1, case.size + 1):
            chance.choice(ACTS)(network, vehicle, topic, chance)
            own = message(command=number).encode()
            computer = link.computer
            for gid, told in ((GUID, computer.own), (OTHER, computer.boot), (RIGHT, computer.right)):
                computer.wait(way := chance.randrange(10**8))
                is_known = gid != RIGHT or computer.own == computer.right
                link.sent, link.gone, link.longest = [], 0, LONGEST_NS - (way if is_known else 0)
                _put(network, vehicle, topic, own, Attachment(number, told, gid).pack())
                assert link.gone or link.sent == [own] or not is_known, LOST
            assert len(network._namespaces._tokens) <= MOST
            assert len(network._namespaces._left) <= MOST
            assert sum(map(len, network._namespaces._tokens.values())) <= MOST * MOST
            assert len(network._waiting._ways) <= MOST
            assert set(network.refusals.counts) <= {NAME, SECOND}
    finally:
        network._aside.close(1.0)
        network._answers.close(1.0)


def _put(network: Any, vehicle: Any, topic: Topic, payload: bytes, attachment: bytes | None) -> None:
    computer = network._link.computer
    network._send(vehicle, topic, payload, attachment, computer.own, computer.boot + LONGEST_NS)


def _sample(network: Any, vehicle: Any, topic: Topic, chance: Random) -> None:
    whole = topic.message().encode()
    body = chance.choice((whole[4:], chance.randbytes(len(whole) - 4), chance.randbytes(chance.randrange(200))))
    computer = network._link.computer
    told = chance.choice((computer.own, computer.boot, 0, -1, 2**63 - 1, -(2**63), chance.randrange(2**63)))
    gid = chance.choice((chance.randbytes(16), bytes(16), GUID, OTHER))
    attachment = ATTACHMENT.pack(chance.randrange(-(2**63), 2**63), told, chance.choice((16, 16, 16, 0, 255)), gid)
    given = chance.choice((attachment, attachment, attachment, chance.randbytes(chance.randrange(64)), None))
    payload = chance.choice(ENCAPSULATIONS) + chance.choice((b"\0\0", b"\0\3", b"\xff\xff")) + body
    network._link.longest = LONGEST_NS
    if gid in {GUID, OTHER} and chance.random() < 0.5:
        second = topic._replace(key=topic.key._replace(name=SECOND))
        _put(network, vehicle, second, whole, Attachment(1, chance.choice((2**63 - 1, computer.own)), gid).pack())
    elif gid in {GUID, OTHER} and computer.boot - computer.forged > FORGED_NS:
        computer.forged = computer.boot
        _put(network, vehicle, topic, whole, given)
    else:
        is_own = gid in {GUID, OTHER}
        _put(network, vehicle, topic, payload[:3] if is_own else chance.choice((payload, b"", payload[:3])), given)


def _clocks(network: Any, vehicle: Any, topic: Topic, chance: Random) -> None:
    """Let samples of another computer arrive, all in the same way, whose clock may be wrong."""
    link, gid = network._link, chance.randbytes(16)
    computer, hears_beats = link.computer, chance.random() < 0.3
    error = 0 if hears_beats else chance.choice((0, chance.randrange(-(10**9), 10**9), 5 * 10**9))
    shift = (0 if hears_beats else computer.right - computer.own) + error
    for number in range(chance.randrange(20)):
        computer.wait(chance.randrange(10**8))
        way = chance.choice((0, chance.randrange(10**9), 4 * 10**9, 10**10)) if number > WAYS else 0
        told = (computer.boot if hears_beats else computer.own) + shift - way
        link.longest = LONGEST_NS - way
        _put(network, vehicle, topic, topic.message().encode(), Attachment(1, told, gid).pack())


def _set(network: Any, _vehicle: Any, _topic: Topic, chance: Random) -> None:
    """Set the clock of the owner."""
    step = chance.choice((-1, 1)) * chance.randrange(10**9 // 5, chance.choice((10**9, 10**10, 10**11)))
    computer = network._link.computer
    computer.own = chance.choice((computer.right, computer.own + step))


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


ACTS: tuple[Callable[..., None], ...] = (_token, _token, _sample, _sample, _many, _clocks, _clocks, _set)
"""What happens."""
