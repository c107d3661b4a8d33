"""Sessions of hostile clients beside a genuine one, which behaves as PX4's client does.

The clock is simulated, and so is the machine of the agent: datagrams wait in a buffer, and a step has time for some
datagrams and replies. The genuine client keeps its session, and each of its samples and replies arrives in time.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from random import Random
from typing import NamedTuple

from msggen.live.link import Connected, Disconnected, Event, Replied, Sample, Service
from msggen.live.xrce import client as genuine
from msggen.live.xrce import entities, wire
from msggen.live.xrce.agent import DEFAULTS, Agent
from msggen.live.xrce.client_entities import Reader, Server, Settings, Writer
from msggen.live.xrce.entities import LARGEST_NUMBER, Group, Participant, TopicEntity, object_id
from msggen.live.xrce.outbox import Address
from msggen.live.xrce.wire import Create, Delete
from support.xrce_client import PARTICIPANT, Client
from support.xrce_garbage import check as check_limits

COUNT = 16

STEP = 2_000
"""The us of a step."""
WORK = 60
"""The datagrams and replies for which a step has time: 30,000 a second."""
BUFFER = 400
"""The datagrams that the socket of the agent holds. One more is lost."""
PATIENCE = 50
"""The most steps until a reply has come: 0.1 s."""
AMPLIFIED = 5
"""The most bytes that are sent to an address for each byte that seems to come from it."""
CPU_SECONDS = 0.002
"""The most processor time that a datagram takes on average. It takes a tenth of it."""

ADDRESS = ("127.0.0.1", 50001)
WRITERS = 15
SERVICE = 2048
TYPE = "px4_msgs::msg::dds_::A_"
SETTINGS = Settings(
    key=1,
    readers=tuple(Reader(SERVICE + each, f"rt/fmu/in/r{each}", TYPE, 1) for each in range(5)),
    writers=tuple(Writer(1 + each, f"rt/fmu/out/w{each}", TYPE) for each in range(WRITERS)),
    servers=(Server(SERVICE, "s", "S_Request_", "S_Response_", "rq/fmu/sRequest", "rr/fmu/sReply"),),
    sync="short",
)

Act = Callable[[Client, Random, bytes], None]
"""Adds datagrams of a hostile client. It has a datagram of the genuine one."""


class Case(NamedTuple):
    """Hostile clients."""

    seed: int
    clients: int
    acts: tuple[str, ...]
    rate: float
    """The hostile datagrams of a step."""
    is_early: bool
    """Whether they are there before the genuine client."""
    steps: int


def begin(client: Client, _: Random, __: bytes) -> None:
    client.begin()
    client.participate()


def storm(client: Client, chance: Random, _: bytes) -> None:
    """Create many entities in a datagram, and delete their parent."""
    client.participate()
    kind = chance.choice((entities.PUBLISHER, entities.SUBSCRIBER, entities.PARTICIPANT))
    body = (Participant("a") if kind == entities.PARTICIPANT else Group(kind, PARTICIPANT)).pack()
    start = chance.randrange(LARGEST_NUMBER - 150)
    client.send(
        wire.RELIABLE,
        *(Create(b"\0\1", object_id(start + each, kind), body).pack() for each in range(chance.randrange(150))),
    )
    client.delete(PARTICIPANT)
    client.send(wire.NO_STREAM, *[Delete(b"\0\1", object_id(start, kind)).pack()] * chance.randrange(300))


def ask(client: Client, chance: Random, _: bytes) -> None:
    """Ask for replies as often as a datagram can."""
    asking = chance.choice((wire.Timestamp(5).pack(), wire.GetInfo(b"\0\1").pack(), wire.Heartbeat(0, 0).pack()))
    client.send(wire.NO_STREAM, *[asking] * (4000 // (len(asking) + 3)))


def cut(client: Client, chance: Random, __: bytes) -> None:
    """Send fragments, of which few are the last one."""
    for _ in range(chance.randrange(1, 20)):
        last = wire.LAST_FRAGMENT if chance.random() < 0.1 else 0
        client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, chance.randbytes(chance.randrange(4000)), last))


def pretend(client: Client, _: Random, data: bytes) -> None:
    """Send what the genuine client has sent."""
    client.outgoing.append(data)


def name(client: Client, chance: Random, _: bytes) -> None:
    """Give hostile names."""
    text = chance.choice(("/", "a", "/a", "px4_micro_xrce_dds", "\0")) * chance.randrange(1, 3800 // 18)
    client.create(PARTICIPANT, Participant(text + chance.choice(("", "px4_micro_xrce_dds"))))
    client.create(object_id(1, entities.TOPIC), TopicEntity("rt/" + text, text, PARTICIPANT))


def acknowledge(client: Client, chance: Random, _: bytes) -> None:
    """Acknowledge and announce what was never sent."""
    parts = [wire.AckNack(chance.randrange(65536), chance.randrange(65536)).pack() for _ in range(chance.randrange(99))]
    parts += [
        wire.Heartbeat(chance.randrange(65536), chance.randrange(65536)).pack() for _ in range(chance.randrange(99))
    ]
    chance.shuffle(parts)
    client.send(wire.NO_STREAM, *parts, wire.GetInfo(b"\0\1").pack())


def share(client: Client, chance: Random, last: bytes) -> None:
    """Begin a session with the key of the genuine client, and send samples."""
    client.key = SETTINGS.key
    begin(client, chance, last)
    client.publish(1)
    for _ in range(10):
        client.write(1, bytes(8))


def jump(client: Client, chance: Random, __: bytes) -> None:
    """Send samples whose numbers do not follow each other."""
    for _ in range(10):
        client.next = chance.randrange(65536)
        client.write(chance.randrange(1, WRITERS), bytes(chance.randrange(50)))


def resemble(client: Client, chance: Random, _: bytes) -> None:
    """Do what a vehicle does, up to its entities and samples."""
    begin(client, chance, b"")
    for number in range(1, 20):
        client.publish(number, f"fmu/out/w{number}", entities.WRITER)
        client.write(number, bytes(8))


ACTS: Mapping[str, Act] = {
    each.__name__: each for each in (storm, ask, cut, pretend, name, acknowledge, share, jump, resemble)
}
"""What hostile clients do."""


def case(chance: Random) -> Case:
    """Return random hostile clients. Those that are there earlier may not take all places."""
    acts = tuple(chance.sample(sorted(ACTS), chance.randint(1, 4)))
    is_early = chance.random() < 0.5
    clients = chance.choice((1, 5, 60 if is_early else 100))
    return Case(
        chance.randrange(2**32), clients, acts, chance.choice((0.2, 0.5, 1)), is_early, chance.choice((800, 1200))
    )


class Scene:
    """An agent with a genuine client and hostile ones."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.chance = Random(case.seed)  # noqa: S311
        self.agent = Agent(0.0)
        self.client = genuine.Client(SETTINGS)
        self.hostile = [Client(20000 + each, key=self.chance.randrange(2, 99)) for each in range(case.clients)]
        self.buffer: deque[tuple[bytes, Address]] = deque()
        self.events: list[Event] = []
        self.last = wire.pack_message(wire.PX4_SESSION, 0, 0, wire.GetInfo(b"\0\1").pack())
        self.now = 0
        self.left = 0
        self.written: list[int] = []
        self.calls: dict[int, int] = {}  # the steps in which they were made
        self.delays: list[int] = []
        self.bytes: Counter[tuple[Address, bool]] = Counter()  # of hostile clients, and whether the agent has sent them
        self.cpu = 0.0
        self.taken = 0

    def step(self, number: int) -> None:
        """Let a step pass."""
        self.now = number * STEP
        self.attack()
        self.live(number)
        self.work()
        if number % 50 == 0:
            self.agent.tick(self.now / 1e6)
        for event in self.agent.take_events():
            self.take(event, number)

    def attack(self) -> None:
        for _ in range(int(self.case.rate + self.chance.random())):
            client = self.chance.choice(self.hostile)
            if not client.outgoing:
                if self.chance.random() < 0.5:
                    begin(client, self.chance, b"")
                ACTS[self.chance.choice(self.case.acts)](client, self.chance, self.last)
            self.put(client.outgoing.pop(0), ("127.0.0.1", 20000 + self.hostile.index(client)))

    def live(self, number: int) -> None:
        """Let the genuine client do its part: a sample in each step."""
        if number < (300 if self.case.is_early else 0):
            return
        self.client.advance(self.now)
        if self.client.is_ready and self.client.write(1 + number % WRITERS, number.to_bytes(8, "little")):
            self.written.append(number)
        for data, connection in self.client.take_outgoing():
            assert not connection, "the genuine client gave up its session"
            self.last = data
            self.put(data, ADDRESS)
        for event in self.client.take_events():
            assert not isinstance(event, genuine.Disconnected), event
            if isinstance(event, genuine.Requested):
                self.client.reply(SERVICE, event.identity, bytes(4))

    def put(self, data: bytes, address: Address) -> None:
        if address != ADDRESS:
            self.bytes[address, False] += len(data)
        if len(self.buffer) < BUFFER:
            self.buffer.append((data, address))

    def work(self) -> None:
        """Let the agent do what it has time for. Work that takes longer than a step is done in the next ones."""
        self.left = min(self.left, 0) + WORK
        while self.buffer and self.left > 0:
            data, address = self.buffer.popleft()
            started = time.process_time()
            self.agent.receive(data, address, self.now * 1000)
            self.cpu += time.process_time() - started
            self.taken += 1
            self.left -= 1
            for reply, receiver in self.agent.take_outgoing():
                self.left -= 1
                if receiver == ADDRESS:
                    self.client.receive(reply, self.now + STEP // 2)
                else:
                    self.bytes[receiver, True] += len(reply)

    def take(self, event: Event, number: int) -> None:
        """Look at what the agent reports, and call a service now and then."""
        self.events.append(event)
        if isinstance(event, Disconnected):
            assert event.remote.address != "{}:{}".format(*ADDRESS), event
        elif isinstance(event, Replied):
            self.delays.append(number - self.calls.pop(event.number))
        elif isinstance(event, Sample) and event.remote.key == SETTINGS.key and number % 100 == 0 and not self.calls:
            self.call(event.remote.number, number)

    def call(self, remote: int, number: int) -> None:
        if any(isinstance(route, Service) for route in self.agent.routes(remote)):
            self.calls[number] = number
            self.agent.call(remote, SERVICE, number, b"\0\1\0\0" + bytes(4))


def check(case: Case) -> None:
    """Run the clients, and check that the genuine one has lost nothing."""
    scene = Scene(case)
    steps = case.steps + 300 * case.is_early
    for number in range(1, steps):
        scene.step(number)
    assert scene.client.is_connected
    own = "{}:{}".format(*ADDRESS)
    arrived = [
        int.from_bytes(event.payload[4:12], "little")
        for event in scene.events
        if isinstance(event, Sample) and event.remote.address == own
    ]
    assert [number for number in scene.written if number < steps - PATIENCE] == [
        number for number in arrived if number < steps - PATIENCE
    ]
    assert len(arrived) > steps // 4
    assert len([event for event in scene.events if isinstance(event, Connected) and event.remote.address == own]) == 1
    assert scene.delays
    assert max(scene.delays) <= PATIENCE
    assert all(number > steps - PATIENCE for number in scene.calls), "a call has no reply"
    assert scene.cpu <= CPU_SECONDS * scene.taken
    check_limits(scene.agent, DEFAULTS)
    for client in scene.hostile:
        sent, received = (scene.bytes[client.address, is_sent] for is_sent in (True, False))
        assert sent <= AMPLIFIED * received, f"{received} bytes were amplified to {sent}"
