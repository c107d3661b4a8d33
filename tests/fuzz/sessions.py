"""Sessions of hostile clients beside a genuine one, which behaves as PX4's client does.

The clock is simulated, and so is the machine of the agent: datagrams wait in a buffer, and a step has time for some
datagrams and replies. The genuine client keeps its session, and each of its samples and replies arrives in time. Only
the processor time of a datagram is real. It is compared with that of a ping, so that it does not depend on the machine.
"""

from __future__ import annotations

import gc
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from random import Random
from typing import NamedTuple

from msggen.link.link import Connected, Disconnected, Event, Lost, Replied, Sample, Service
from msggen.link.xrce import client as genuine
from msggen.link.xrce import client_events, wire
from msggen.link.xrce.agent import DEFAULTS, Agent
from msggen.link.xrce.client_entities import Reader, Server, Settings, Writer
from msggen.link.xrce.entities import (
    PUBLISHER,
    SUBSCRIBER,
    TOPIC,
    WRITER,
    Endpoint,
    Group,
    Participant,
    TopicEntity,
    object_id,
)
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.streams import ReliableOutput
from msggen.link.xrce.wire import Create, Delete
from support.xrce_client import PARTICIPANT, Client
from support.xrce_garbage import check as check_limits

COUNT = 16

STEP = 2_000
"""The us of a step."""
WORK = 100
"""The datagrams and replies for which a step has time: 50,000 a second."""
BUFFER = 400
"""The datagrams that the socket of the agent holds. One more is lost."""
PATIENCE = 50
"""The most steps until a reply has come: 0.1 s."""
AMPLIFIED = 5
"""The most bytes that are sent to an address for each byte that seems to come from it."""
PINGS = 300, 0.2
"""The processor time of a datagram, and of each of its bytes, in that of a ping: most take a tenth."""
EXCESS = 4000
"""The most time of all datagrams beyond that. A machine that is busy with others needs some."""
LOST = 16
"""The most samples that are counted as lost for each datagram of a hostile client."""

ADDRESS = ("127.0.0.1", 50001)
NAME = "127.0.0.1:50001"
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
    hosts: str
    """The IP address of each, with its number."""
    acts: tuple[str, ...]
    rate: float
    """The hostile datagrams of a step, on average."""
    burst: int
    """How many come at once."""
    is_early: bool
    """Whether they are there before the genuine client. Otherwise they come when it has connected."""
    steps: int


def begin(client: Client, chance: Random, _: bytes) -> None:
    """Begin another session. With the key of the last one, it would be taken for the same."""
    client.key = chance.randrange(2, 2**32)
    client.next, client.output = 0, ReliableOutput()
    client.begin()


def join(client: Client, chance: Random, last: bytes) -> None:
    begin(client, chance, last)
    client.participate()


def storm(client: Client, chance: Random, last: bytes) -> None:
    """Create as many entities as a client may have, and delete their parent."""
    join(client, chance, last)
    kind = chance.choice((PUBLISHER, SUBSCRIBER, TOPIC))
    body = (TopicEntity("rt/a", "a", PARTICIPANT) if kind == TOPIC else Group(kind, PARTICIPANT)).pack()
    creates = [Create(b"\0\1", object_id(number, kind), body).pack() for number in range(DEFAULTS.entities - 1)]
    each = DEFAULTS.message // (len(creates[0]) + 3) - 1
    for start in range(0, chance.choice((100, len(creates), len(creates))), each):
        client.send(wire.RELIABLE, *creates[start : start + each])
    client.delete(PARTICIPANT)
    client.send(wire.NO_STREAM, *[Delete(b"\0\1", object_id(1, kind)).pack()] * chance.randrange(1, 9))


def ask(client: Client, chance: Random, last: bytes) -> None:
    """Ask for replies as often as a datagram can."""
    join(client, chance, last)
    asking = chance.choice((wire.Timestamp(5).pack(), wire.GetInfo(b"\0\1").pack(), wire.Heartbeat(0, 0).pack()))
    for _ in range(chance.randrange(4, 20)):
        client.send(wire.NO_STREAM, *[asking] * (4000 // (len(asking) + 3)))


def repeat(client: Client, chance: Random, last: bytes) -> None:
    """Ask for the same replies again and again."""
    join(client, chance, last)
    client.send(wire.RELIABLE, *[Delete(b"\0\1", b"\0\1").pack()] * 30)
    for _ in range(chance.randrange(1, 60)):
        client.send(wire.NO_STREAM, wire.AckNack(0, 0xFFFF).pack())


def cut(client: Client, chance: Random, __: bytes) -> None:
    """Send fragments, of which few are the last one."""
    for _ in range(chance.randrange(1, 20)):
        last = wire.LAST_FRAGMENT if chance.random() < 0.1 else 0
        client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, chance.randbytes(chance.randrange(4000)), last))


def pretend(client: Client, _: Random, data: bytes) -> None:
    """Send what the genuine client has sent."""
    client.outgoing.append(data)


def name(client: Client, chance: Random, last: bytes) -> None:
    """Give hostile names, most of them as long as a name may be."""
    begin(client, chance, last)
    end = chance.choice(("", "x", "px4_micro_xrce_dds"))
    part = chance.choice(("/", "/", "a", "/a", "px4_micro_xrce_dds", "\0"))
    text = (part * chance.choice((DEFAULTS.text, DEFAULTS.text, 3500 // len(part), 9)))[: -len(end) or None]
    client.create(PARTICIPANT, Participant((text[: DEFAULTS.text - len(end)] if chance.random() < 0.8 else text) + end))
    client.create(object_id(1, TOPIC), TopicEntity("rt/" + text[:1800], text[:1800], PARTICIPANT))


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
    begin(client, chance, last)
    client.outgoing.pop()
    client.key = SETTINGS.key
    client.begin()
    client.participate()
    client.publish(1)
    for _ in range(10):
        client.write(1, bytes(8))


def jump(client: Client, chance: Random, last: bytes) -> None:
    """Send samples whose numbers do not follow each other."""
    join(client, chance, last)
    step = chance.choice((1022, 30000, chance.randrange(65536)))
    for number in range(chance.randrange(99)):
        client.next = (client.next + step * (number % 3 > 0)) % 65536
        client.write(chance.randrange(1, WRITERS), bytes(chance.randrange(50)))


def displace(client: Client, chance: Random, last: bytes) -> None:
    """Send a sample of the genuine client, from its address, with a number far from its own ones.

    It is even, because two of them that follow each other are a stream that has begun anew.
    """
    if last[1] == wire.BEST_EFFORT:
        number = int.from_bytes(last[2:4], "little") + chance.randrange(2000, 63000)
        client.outgoing.append(last[:2] + (number & 0xFFFE).to_bytes(2, "little") + last[4:])


def resemble(client: Client, chance: Random, last: bytes) -> None:
    """Do what a vehicle does, up to its entities and samples."""
    join(client, chance, last)
    creates = []
    for number in range(1, chance.choice((5, 20, 20, 20))):
        topic, group, writer = (object_id(number, kind) for kind in (TOPIC, PUBLISHER, WRITER))
        for identity, entity in (
            (topic, TopicEntity(f"rt/fmu/out/w{number}", TYPE, PARTICIPANT)),
            (group, Group(PUBLISHER, PARTICIPANT)),
            (writer, Endpoint(WRITER, topic, group)),
        ):
            creates.append(Create(b"\0\1", identity, entity.pack()).pack())
    client.send(wire.RELIABLE, *creates)
    for _ in range(chance.randrange(9)):
        client.write(1, bytes(8))


ACTS: Mapping[str, Act] = {
    each.__name__: each
    for each in (begin, storm, ask, repeat, cut, pretend, name, acknowledge, share, jump, displace, resemble)
}
"""What hostile clients do."""
HEAVY = frozenset({"ask", "acknowledge", "storm"})
"""Acts whose datagrams have as many replies or entities as a datagram can have."""


CROWDING = ("begin", "resemble", "share", "name")
"""Acts of those that want to take all places."""


def case(chance: Random) -> Case:
    """Return random hostile clients.

    Those that are there earlier and have many addresses, or the IP address of the genuine one, may not take all places.
    """
    is_early = chance.random() < 0.5
    hosts = chance.choice(("10.0.0.1", "10.0.0.{}", "127.0.0.1"))
    is_crowd = chance.random() < 0.4
    clients = (60 if is_early and hosts != "10.0.0.1" else 150) if is_crowd else chance.choice((1, 5))
    choices, most = (CROWDING, 2) if is_crowd else (sorted(ACTS), 3)
    acts = tuple(chance.sample(choices, chance.randint(1, most)))
    rate, burst = (1, 10) if HEAVY.intersection(acts) else chance.choice(((1, 1), (4, 40), (10, 10)))
    steps = 800 if rate <= 1 else 500
    return Case(chance.randrange(2**32), clients, hosts, acts, rate, burst, is_early, steps)


def ping_seconds() -> float:
    """Return the processor time that a ping takes.

    That of the thread is used, because the runner's limit makes that of the process coarse.
    """
    agent, client = Agent(0.0), Client()
    client.begin()
    agent.receive(client.outgoing.pop(), client.address, 0)
    client.ping(in_session=True)
    times = []
    for _ in range(5):
        started = time.thread_time()
        for _ in range(50):
            agent.receive(client.outgoing[0], client.address, 0)
        times.append((time.thread_time() - started) / 50)
    return min(times)


class Scene:
    """An agent with a genuine client and hostile ones."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.chance = Random(case.seed)  # noqa: S311
        self.agent = Agent(0.0)
        self.client = genuine.Client(SETTINGS)
        self.hostile = [Client(20000 + each) for each in range(case.clients)]
        for number, client in enumerate(self.hostile):
            client.address = case.hosts.format(number), 20000 + number
        self.active = self.hostile[0]
        self.buffer: deque[tuple[bytes, Address]] = deque()
        self.events: list[Event] = []
        self.last = wire.pack_message(wire.PX4_SESSION, 0, 0, wire.GetInfo(b"\0\1").pack())
        self.now = 0
        self.left = 0
        self.written: list[int] = []
        self.calls: dict[int, int] = {}  # the steps in which they were made
        self.delays: list[int] = []
        self.bytes: Counter[tuple[Address, bool]] = Counter()  # of hostile clients, and whether the agent has sent them
        self.ping = ping_seconds()
        self.excess = 0.0  # of processor time, in pings
        self.sent = 0

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
        if not self.case.is_early and not self.client.is_connected:
            return
        if self.chance.random() < self.case.rate / self.case.burst:
            for _ in range(self.case.burst):
                self.send()

    def send(self) -> None:
        """Send a datagram of a hostile client, mostly of the one that has sent the last one."""
        if not self.active.outgoing or self.chance.random() < 0.02:
            self.active = self.chance.choice(self.hostile)
        client = self.active
        address = client.address
        if not client.outgoing:
            act = self.chance.choice(self.case.acts)
            ACTS[act](client, self.chance, self.last)
            address = ADDRESS if act == displace.__name__ else address
        if client.outgoing:
            self.sent += 1
            self.put(client.outgoing.pop(0), address)

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
            assert not isinstance(event, client_events.Disconnected), event
            if isinstance(event, client_events.Requested):
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
            self.receive(data, address)
            self.left -= 1
            for reply, receiver in self.agent.take_outgoing():
                self.left -= 1
                if receiver == ADDRESS:
                    self.client.receive(reply, self.now + STEP // 2)
                else:
                    self.bytes[receiver, True] += len(reply)

    def receive(self, data: bytes, address: Address) -> None:
        """Let the agent take a datagram, and look at the time that it takes."""
        started = time.thread_time()
        self.agent.receive(data, address, self.now * 1000)
        taken = (time.thread_time() - started) / self.ping
        self.excess += max(taken - PINGS[0] - PINGS[1] * len(data), 0)
        assert self.excess <= EXCESS, f"datagrams take too much time, the last one {taken:.0f} times that of a ping"

    def take(self, event: Event, number: int) -> None:
        """Look at what the agent reports, and call a service now and then."""
        self.events.append(event)
        if isinstance(event, Disconnected):
            assert event.remote.address != NAME, event
        elif isinstance(event, Replied):
            self.delays.append(number - self.calls.pop(event.number))
        elif isinstance(event, Sample) and event.remote.address == NAME and number % 100 == 0 and not self.calls:
            self.call(event.remote.number, number)

    def call(self, remote: int, number: int) -> None:
        if any(isinstance(route, Service) for route in self.agent.routes(remote)):
            self.calls[number] = number
            self.agent.call(remote, SERVICE, number, b"\0\1\0\0" + bytes(4))


def check(case: Case) -> None:
    """Run the clients, and check that the genuine one has lost nothing."""
    gc.disable()  # it would take its time in the middle of a datagram
    try:
        check_scene(Scene(case))
    finally:
        gc.enable()


def check_scene(scene: Scene) -> None:
    steps = scene.case.steps + 300 * scene.case.is_early
    for number in range(1, steps):
        scene.step(number)
    assert scene.client.is_connected
    arrived = [
        int.from_bytes(event.payload[4:12], "little")
        for event in scene.events
        if isinstance(event, Sample) and event.remote.address == NAME
    ]
    assert [number for number in scene.written if number < steps - PATIENCE] == [
        number for number in arrived if number < steps - PATIENCE
    ]
    assert len(arrived) > steps // 4
    assert len([event for event in scene.events if isinstance(event, Connected) and event.remote.address == NAME]) == 1
    assert scene.delays
    assert max(scene.delays) <= PATIENCE
    assert all(number > steps - PATIENCE for number in scene.calls), "a call has no reply"
    assert sum(event.missing for event in scene.events if isinstance(event, Lost)) <= LOST * scene.sent
    assert not [event for event in scene.events if isinstance(event, Lost) and event.remote.address == NAME]
    check_limits(scene.agent, DEFAULTS)
    for client in scene.hostile:
        sent, received = (scene.bytes[client.address, is_sent] for is_sent in (True, False))
        assert sent <= AMPLIFIED * received, f"{received} bytes were amplified to {sent}"
