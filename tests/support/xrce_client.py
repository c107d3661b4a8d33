"""A small client of DDS-XRCE for tests of the agent, and a network between both."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any, NamedTuple

from msggen.link.link import Event
from msggen.link.xrce import entities, wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.streams import BestEffortInput, ReliableInput, ReliableOutput

PARTICIPANT = entities.object_id(1, entities.PARTICIPANT)
SERVICE = 2048


class Client:
    """One client, with queues instead of a socket."""

    def __init__(
        self, port: int = 50001, key: int = 1, namespace: str = "", session_id: int = wire.PX4_SESSION
    ) -> None:
        self.address: Address = ("127.0.0.1", port)
        self.key, self.namespace, self.session_id = key, namespace, session_id
        self.outgoing: list[bytes] = []
        self.received: list[wire.Submessage] = []
        """The submessages of the agent, without repetitions."""
        self.next = 0
        self.request = 9
        self.best_effort, self.input, self.output = BestEffortInput(), ReliableInput(), ReliableOutput()

    # To the agent

    def send(self, stream: int, *parts: bytes, session_id: int | None = None) -> None:
        session = self.session_id if session_id is None else session_id
        number = 0
        if stream == wire.BEST_EFFORT:
            number, self.next = self.next, (self.next + 1) % 65536
        elif stream == wire.RELIABLE:
            number = self.output.send(wire.pack_message(0x80, 0, 0, *parts)[4:])
        key = wire.key_bytes(self.key) if session < 0x80 else b""
        self.outgoing.append(wire.pack_message(session, stream, number, *parts, key=key))

    def ask(self) -> bytes:
        """Return the next request id."""
        self.request = (self.request + 1) % 65536
        return self.request.to_bytes(2, "big")

    def ping(self, *, in_session: bool = False) -> None:
        self.send(0, wire.GetInfo(self.ask()).pack(), session_id=None if in_session else wire.NO_SESSION)

    def begin(self) -> None:
        self.send(0, wire.CreateClient(self.key, self.session_id).pack(), session_id=wire.NO_SESSION)

    def create(self, object_id: bytes, entity: entities.Entity, flags: int = wire.LITTLE_ENDIAN | wire.REPLACE) -> None:
        self.send(wire.RELIABLE, wire.Create(self.ask(), object_id, entity.pack(), flags).pack())

    def participate(self) -> None:
        self.create(PARTICIPANT, entities.Participant(f"{self.namespace}/px4_micro_xrce_dds"))

    def publish(self, number: int, name: str = "fmu/out/a", kind: int = entities.WRITER) -> None:
        """Create a writer, or a reader."""
        group = entities.PUBLISHER if kind == entities.WRITER else entities.SUBSCRIBER
        topic, parent = entities.object_id(number, entities.TOPIC), entities.object_id(number, group)
        self.create(topic, entities.TopicEntity(f"rt/{name}", "px4_msgs::msg::dds_::A_", PARTICIPANT))
        self.create(parent, entities.Group(group, PARTICIPANT))
        self.create(entities.object_id(number, kind), entities.Endpoint(kind, topic, parent))

    def subscribe(self, number: int, name: str = "fmu/in/b", stream: int = wire.BEST_EFFORT) -> None:
        self.publish(number, name, entities.READER)
        self.read(entities.object_id(number, entities.READER), stream)

    def read(self, object_id: bytes, stream: int = wire.BEST_EFFORT) -> None:
        self.send(wire.RELIABLE, wire.ReadData(self.ask(), object_id, stream).pack())

    def serve(self) -> None:
        types = ("px4_msgs::srv::dds_::S_Request_", "px4_msgs::srv::dds_::S_Response_")
        object_id = entities.object_id(SERVICE, entities.REPLIER)
        self.create(object_id, entities.Replier("s", *types, "rq/fmu/sRequest", "rr/fmu/sReply", PARTICIPANT))
        self.read(object_id, wire.RELIABLE)

    def write(self, number: int, data: bytes) -> None:
        object_id = entities.object_id(number, entities.WRITER)
        self.send(wire.BEST_EFFORT, wire.Sample(self.ask(), object_id, data).pack(wire.WRITE_DATA))

    def delete(self, object_id: bytes = wire.CLIENT_ID) -> None:
        self.send(0, wire.Delete(self.ask(), object_id).pack())

    def beat(self) -> None:
        """Ask for acknowledgements that are due."""
        beat = self.output.heartbeat()
        if beat is not None:
            self.send(0, wire.Heartbeat(*beat).pack())

    # From the agent

    def receive(self, data: bytes) -> None:
        header = wire.parse_header(data)
        body = data[4 + len(header.key) :]
        if header.stream == wire.RELIABLE:
            self.take(self.input.receive(header.sequence, body))
            self.acknowledge()
        elif header.stream == 0 or self.best_effort.accept(header.sequence) is not None:
            self.take([body])

    def acknowledge(self) -> None:
        state = self.input.acknack()
        if state is not None:
            self.send(0, wire.AckNack(*state).pack())

    def take(self, bodies: Iterable[bytes]) -> None:
        for body in bodies:
            for part in wire.submessages(body):
                if part.id == wire.ACKNACK:
                    state = wire.AckNack.unpack(part.payload)
                    for number, again in self.output.acknack(state.first, state.missing):
                        self.outgoing.append(wire.HEADER.pack(self.session_id, wire.RELIABLE, number) + again)
                elif part.id == wire.HEARTBEAT:
                    beat = wire.Heartbeat.unpack(part.payload)
                    self.take(self.input.heartbeat(beat.first, beat.last))
                    self.acknowledge()
                else:
                    self.received.append(part)

    def all(self, kind: int) -> list[bytes]:
        """Return the payloads of the agent's submessages of a kind."""
        return [part.payload for part in self.received if part.id == kind]

    def statuses(self) -> list[int]:
        return [wire.Status.unpack(payload).status for payload in self.all(wire.STATUS)]

    def samples(self) -> list[bytes]:
        return [payload[4:] for payload in self.all(wire.DATA)]


class Network(NamedTuple):
    """Probabilities that a datagram is lost, doubled, or overtaken."""

    loss: float = 0.0
    repetition: float = 0.0
    disorder: float = 0.0

    def carry(self, random: Random, packets: list[Any]) -> list[Any]:
        """Return the packets that arrive."""
        arrived: list[Any] = []
        for packet in packets:
            while random.random() >= self.loss:
                at = len(arrived)
                if random.random() < self.disorder:
                    at = random.randint(max(at - 3, 0), at)
                arrived.insert(at, packet)
                if random.random() >= self.repetition:
                    break
        return arrived


PERFECT = Network()


class World:
    """An agent, clients, a network between them, and time."""

    def __init__(self, agent: Agent, *clients: Client, network: Network = PERFECT, seed: int = 1) -> None:
        self.agent = agent
        self.clients = list(clients)
        self.network = network
        self.random = Random(seed)  # noqa: S311
        self.now = 0.0
        self.events: list[Event] = []

    def carry(self) -> bool:
        """Carry what waits, once each way. Return whether there was anything."""
        busy = False
        for client in self.clients:
            packets, client.outgoing = client.outgoing, []
            for data in self.network.carry(self.random, packets):
                busy = True
                self.agent.receive(data, client.address, int(self.now * 1e9))
        self.events += self.agent.take_events()
        for data, address in self.network.carry(self.random, self.agent.take_outgoing()):
            busy = True
            for client in self.clients:
                if client.address == address:
                    client.receive(data)
        return busy

    def settle(self) -> None:
        """Carry until nothing waits."""
        while self.carry():
            pass

    def run(self, seconds: float, step: float = 0.1) -> None:
        """Let time pass."""
        for _ in range(round(seconds / step)):
            self.now += step
            for client in self.clients:
                client.beat()
            self.agent.tick(self.now)
            self.settle()

    def all(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


def connected(client: Client | None = None, agent: Agent | None = None, **options: Any) -> tuple[World, Client]:
    """Return a client with the writer 1, the reader 2 and the service 2048, connected to an agent."""
    client = client or Client()
    world = World(agent or Agent(0.0, **options), client)
    start(client)
    world.settle()
    return world, client


def start(client: Client) -> None:
    """Let a client begin a session and create its entities."""
    client.ping()
    client.begin()
    client.participate()
    client.publish(1)
    client.subscribe(2)
    client.serve()
