"""Sessions that an earlier program began: with a record of them, without one, and as PX4 behaved in captures."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.link.link import (
    Connected,
    Disconnected,
    Event,
    LinkError,
    Lost,
    Opened,
    Remote,
    Replied,
    Route,
    Sample,
    Service,
)
from msggen.link.xrce import entities, wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.continuation import Continuation, joined
from msggen.link.xrce.limits import QUESTIONS, Limits
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.record import Record
from msggen.messages.object_ids import object_ids_of
from msggen.messages.packages import known_routes
from msggen.sources.embedded import EMBEDDED
from support.xrce_captures import Row, load
from support.xrce_client import PARTICIPANT, SERVICE, Client, Network, World, connected

LE = b"\0\1\0\0"
PORT: Address = ("127.0.0.1", 50001)
PROBES = [*range(0, 0x10000, 0x2000)]


def records_of(agent: Agent) -> dict[Address, Record | None]:
    """Return what is to be written down, after two looks: what changes between them waits."""
    return dict([*agent.take_records(), *agent.take_records()])


def record_of(agent: Agent) -> Record:
    (record,) = records_of(agent).values()
    assert record is not None
    return record


def successor(world: World, **options: Any) -> World:
    """Return the world in which the agent was killed, and another one has its records."""
    agent = Agent(world.now, records=[record_of(world.agent)], **options)
    after = World(agent, *world.clients)
    after.now = world.now
    return after


# --- with a record


def test_a_session_of_a_record_goes_on_both_ways() -> None:
    world, client = connected(Client(namespace="uav_1", key=7))
    world.agent.call(1, SERVICE, 1, LE + b"first")
    for number in range(3):
        client.write(1, b"old")
        world.agent.publish(1, 2, LE + bytes([number]))
    world.settle()
    client.received.clear()
    after = successor(world)
    client.write(1, b"new")
    after.settle()
    remote = Remote(1, "127.0.0.1:50001", 7, "uav_1", continued=True)
    assert [event for event in after.events if not isinstance(event, Opened)] == [
        Connected(remote),
        Sample(remote, Route("/fmu/out/a", "px4_msgs/msg/A", "out", 1), LE + b"new", 0),
    ]
    assert [event.route for event in after.all(Opened)] == [event.route for event in world.all(Opened)]
    assert wire.Info.unpack(client.all(wire.INFO)[0]).known
    after.agent.publish(1, 2, LE + b"sample")
    after.agent.call(1, SERVICE, 9, LE + b"request")
    after.settle()
    sample, request = client.samples()
    assert (sample, request[24:]) == (b"sample", b"request")
    answer(client, request[:24])
    after.settle()
    assert [(event.number, event.payload) for event in after.all(Replied)] == [(9, LE + b"reply")]
    assert after.agent.refused == {}


def answer(client: Client, identity: bytes) -> None:
    replier = entities.object_id(SERVICE, entities.REPLIER)
    client.send(wire.RELIABLE, wire.Sample(client.ask(), replier, identity + b"reply").pack(wire.WRITE_DATA))


def test_a_record_wakes_its_client_before_anything_arrives() -> None:
    world, client = connected()
    sent = Agent(0.0, records=[record_of(world.agent)]).take_outgoing()
    assert {address for _, address in sent} == {client.address}
    info, *probes = (data for data, _ in sent)
    assert info.hex() == "8100000006011c00000afffd0001010d585243450100010f00010d000100000000000000"
    assert [wire.parse_header(data).sequence for data in probes] == PROBES
    assert {data[4:].hex() for data in probes} == {"0b0105000000ffff80"}


@pytest.mark.parametrize("last", [0, 1, 5, 0x1FFF, 0x2000, 0x7FFF, 0x8000, 0xBFFF, 0xC001, 0xFFFE, 0xFFFF])
@pytest.mark.parametrize("reliable", [0, 5, 0x7FFE])
def test_the_numbers_are_asked_for(last: int, reliable: int) -> None:
    world, client = connected()
    client.best_effort.last, client.input.expected = last, reliable
    after = successor(world)
    client.write(1, b"new")
    after.settle()
    client.received.clear()
    after.agent.publish(1, 2, LE + b"sample")
    after.agent.call(1, SERVICE, 1, LE + b"request")
    after.settle()
    assert [each[-7:] for each in client.samples()] == [b"sample", b"request"]
    assert client.input.expected == reliable + 1


def test_a_request_waits_for_its_number() -> None:
    world, client = connected()
    after = successor(world)
    lost = after.agent.take_outgoing()
    assert len(lost) == 9
    client.write(1, b"new")
    after.settle()
    after.agent.call(1, SERVICE, 1, LE + b"request")
    after.settle()
    assert client.samples() == []
    for _ in range(10):
        client.write(1, b"new")
        after.run(0.1)
    assert [request[24:] for request in client.samples()] == [b"request"]


def test_who_gives_no_answer_is_not_asked_for_ever() -> None:
    world, client = connected()
    after = successor(world)
    after.clients = []
    sent = after.agent.take_outgoing()
    for _ in range(60):
        after.now += 0.1
        after.agent.receive(wire.pack_message(0x81, 0, 0, wire.GetInfo(b"\0\1").pack()), client.address, 0)
        after.agent.tick(after.now)
        sent += after.agent.take_outgoing()
    assert sum(data[4] == wire.HEARTBEAT for data, _ in sent) == 8 * QUESTIONS


def test_no_acknowledgement_is_sent_before_a_number_is_seen() -> None:
    world, client = connected()
    world.agent.call(1, SERVICE, 1, LE + b"lost")
    world.settle()
    (request,) = client.samples()
    after = successor(world)
    client.write(1, b"new")
    after.settle()
    after.agent.call(1, SERVICE, 1, LE)
    after.run(0.5)
    assert client.all(wire.ACKNACK) == []
    answer(client, request[:24])
    after.settle()
    assert after.agent.refused == {"reply to a request of another program": 1}
    assert after.all(Replied) == []
    assert client.output.heartbeat() is None, "it is acknowledged"


def test_a_record_is_told_once_it_is_complete_and_when_it_changes() -> None:
    world, client = connected()
    assert world.agent.take_records() == []
    ((address, record),) = world.agent.take_records()
    assert address == client.address
    assert record is not None
    assert world.agent.take_records() == []
    client.subscribe(3, "fmu/in/late")
    world.settle()
    changed = record_of(world.agent)
    assert changed.parts[: len(record.parts)] == record.parts
    assert len(changed.parts) == len(record.parts) + 4
    world.agent.remember(1, {"px4_msgs/msg/A": 5})
    world.agent.remember(1, {"px4_msgs/msg/A": 5})
    assert record_of(world.agent).hashes == {"px4_msgs/msg/A": 5}
    client.delete()
    world.settle()
    assert records_of(world.agent) == {client.address: None}


def test_the_hashes_of_a_record_are_known_again() -> None:
    world, client = connected()
    world.agent.remember(1, {"px4_msgs/msg/A": 5})
    after = successor(world)
    client.write(1, b"x")
    after.settle()
    assert after.agent.hashes(1) == {"px4_msgs/msg/A": 5}


def test_a_closed_agent_leaves_its_records() -> None:
    world, _ = connected()
    record_of(world.agent)
    world.agent.close()
    assert records_of(world.agent) == {}


def test_a_client_that_begins_another_session_ends_that_of_its_record() -> None:
    world, client = connected()
    after = successor(world)
    again = Client(50002)
    again.begin()
    after.clients = [again]
    after.settle()
    assert records_of(after.agent) == {client.address: None}
    assert list(after.agent._sessions) == [again.address]


@pytest.mark.parametrize("what", ["ping", "begin", "delete"])
def test_a_session_that_its_client_has_left_ends_at_once(what: str) -> None:
    world, client = connected()
    after = successor(world)
    getattr(client, what)()
    after.settle()
    assert after.all(Connected) == []
    assert records_of(after.agent)[client.address] is None


def test_a_client_that_is_not_heard_is_forgotten() -> None:
    world, client = connected()
    after = successor(world)
    after.clients = []
    after.run(Limits().patience + 0.5)
    assert (after.events, after.agent._sessions) == ([], {})
    assert records_of(after.agent) == {client.address: None}


@pytest.mark.parametrize("options", [{"keys": {2}}, {"allow": lambda address: address[0] != "127.0.0.1"}])
def test_a_record_gives_no_more_than_a_new_client_gets(options: dict[str, Any]) -> None:
    world, client = connected()
    after = successor(world, **options)
    client.write(1, b"x")
    after.settle()
    assert after.all(Connected) == []
    assert client.all(wire.HEARTBEAT) == []


def test_a_record_of_an_allowed_key_is_continued() -> None:
    world, client = connected(Client(key=5))
    after = successor(world, keys={5})
    client.write(1, b"x")
    after.settle()
    assert [event.remote.key for event in after.all(Connected)] == [5]


def test_entities_that_a_record_lacks_end_the_session() -> None:
    world, client = connected()
    record = record_of(world.agent)
    client.publish(3, "fmu/out/missed")
    world.settle()
    after = World(Agent(0.0, records=[record]), client)
    client.write(3, b"x")
    after.settle()
    assert [type(event) for event in after.events if not isinstance(event, Opened)] == [Connected, Disconnected]


@pytest.mark.parametrize("is_missed", [True, False])
def test_a_client_goes_on_to_create_its_entities(is_missed: bool) -> None:  # noqa: FBT001
    client = Client()
    world = World(Agent(0.0), client)
    client.begin()
    client.participate()
    world.settle()
    record = record_of(world.agent)
    if is_missed:
        client.publish(1)
        world.settle()
    after = World(Agent(0.0, records=[record]), client)
    client.subscribe(2)
    after.settle()
    if is_missed:
        assert isinstance(after.events[-1], Disconnected)
    else:
        assert client.statuses() == [wire.OK] * 4
        assert [event.route.name for event in after.all(Opened)] == ["/fmu/in/b"]
        assert len(record_of(after.agent).parts) == len(record.parts) + 4


def test_a_record_is_bounded() -> None:
    world, client = connected(limits=Limits(record=2000))
    assert record_of(world.agent)
    for number in range(10, 40):
        client.publish(number, f"fmu/out/topic_{number}")
    world.settle()
    assert records_of(world.agent) == {client.address: None}
    assert world.agent._sessions[client.address].journal.parts is None


def test_a_client_that_deletes_entities_has_no_record() -> None:
    world, client = connected()
    client.delete(entities.object_id(1, entities.WRITER))
    world.settle()
    assert records_of(world.agent) == {client.address: None}


@pytest.mark.parametrize("change", ["topic", "participant", "order"])
def test_a_record_that_does_not_make_sense_is_dropped(change: str) -> None:
    world, client = connected()
    record = record_of(world.agent)
    parts = {
        "topic": [part for part in record.parts if part[6:8] != entities.object_id(1, entities.TOPIC)],
        "participant": record.parts[1:],
        "order": record.parts[::-1],
    }[change]
    agent = Agent(0.0, records=[record._replace(parts=tuple(parts))])
    assert records_of(agent) == {client.address: None}
    assert agent._sessions == {}


# --- without one


def test_a_client_in_its_time_synchronization_goes_on() -> None:
    client = Client(namespace="uav_1", key=3)
    first = World(Agent(0.0), client)
    client.begin()
    client.participate()
    first.settle()
    client.received.clear()
    after = World(Agent(0.0, known=KNOWN), client)
    client.send(0, wire.Timestamp(1).pack())
    after.settle()
    assert len(client.all(wire.TIMESTAMP_REPLY)) == 1
    client.subscribe(2, "uav_1/fmu/in/b")
    client.publish(1, "uav_1/fmu/out/a")
    after.settle()
    client.write(1, b"x")
    after.settle()
    remote = Remote(1, "127.0.0.1:50001", 0, "uav_1", continued=True)
    assert [event.remote for event in after.all(Connected)] == [remote]
    assert client.statuses() == [wire.OK] * 6
    assert [event.route.name for event in after.all(Opened)] == ["/uav_1/fmu/in/b", "/uav_1/fmu/out/a"]
    assert [event.payload for event in after.all(Sample)] == [LE + b"x"]
    again = successor(after)
    client.write(1, b"y")
    again.settle()
    assert [event.remote for event in again.all(Connected)] == [remote]


def routes(*numbers: tuple[int, int]) -> list[Route]:
    """Return the routes of writers with numbers and sizes. Names tell the place, so that sets differ in their ids."""
    return [
        Route(f"/fmu/out/t{place}", "px4_msgs/msg/A", "out", number, size)
        for place, (number, size) in enumerate(numbers)
    ]


DEFAULT = routes((1, 8), (2, 16), (3, 8), (4, 24), (5, 8), (6, 32))
SHIFTED = routes((1, 8), (3, 16), (4, 8), (5, 24), (6, 8), (7, 32))
KNOWN = joined([DEFAULT, SHIFTED])


def several(client: Client, *samples: tuple[int, int]) -> None:
    """Send samples of writers with some sizes in one message."""
    parts = [
        wire.Sample(client.ask(), entities.object_id(number, entities.WRITER), bytes(size)).pack(wire.WRITE_DATA)
        for number, size in samples
    ]
    client.send(wire.BEST_EFFORT, *parts)


def stranger(known: Iterable[Route] = KNOWN) -> tuple[World, Client]:
    client = Client()
    client.next = 700
    return World(Agent(0.0, known=known), client), client


@pytest.mark.parametrize("own", [DEFAULT, SHIFTED])
def test_the_samples_show_which_ids_a_client_has(own: list[Route]) -> None:
    world, client = stranger()
    several(client, *((route.object_id, route.size) for route in own))
    world.settle()
    assert [event.route for event in world.all(Opened)] == own
    assert [event.route for event in world.all(Sample)] == own
    assert world.agent.lost == 0


def test_a_session_without_a_record_leaves_one() -> None:
    request = "px4_msgs/srv/VehicleCommand_Request"
    others = [Route("/fmu/in/b", "px4_msgs/msg/B", "in", 9), Route("/fmu/vehicle_command", request, "in", SERVICE)]
    world, client = stranger(joined([[*DEFAULT, *others], SHIFTED]))
    several(client, *((route.object_id, route.size) for route in DEFAULT))
    world.settle()
    assert len(world.all(Opened)) == len(DEFAULT) + 2
    world.agent.remember(1, {"px4_msgs/msg/A": 5})
    record = record_of(world.agent)
    for _ in range(2):
        after = World(Agent(0.0, records=[record]), client)
        several(client, *((route.object_id, route.size) for route in DEFAULT))
        after.settle()
        assert after.all(Connected) == world.all(Connected)
        assert {event.route for event in after.all(Opened)} == {event.route for event in world.all(Opened)}
        assert [event.route for event in after.all(Sample)] == DEFAULT
        assert after.agent.hashes(1) == {"px4_msgs/msg/A": 5}
        client.received.clear()
        assert after.agent._sessions[client.address].record() == record
        after.agent.publish(1, 9, LE + b"sample")
        after.agent.call(1, SERVICE, 1, LE + b"request")
        after.settle()
        assert [each[-6:] for each in client.samples()] == [b"sample", b"equest"]
    several(client, (1, 9))
    after.settle()
    assert isinstance(after.events[-1], Disconnected), "its topics are others than those that were learnt"
    assert records_of(after.agent) == {client.address: None}


@pytest.mark.parametrize("other", ["none", "ping", "late ping", "session", "record"])
def test_a_vehicle_without_a_record_is_alone_if_no_other_one_is_heard(other: str) -> None:
    world, client = stranger()
    second = Client(50002)
    second.next = 900
    if other != "record":
        world.clients.append(second)
    else:
        world.agent.resume([Record(second.address, 7, 0x81, 508, 0, record_of(connected()[0].agent).parts)])
    if other == "ping":
        second.ping(in_session=True)
    for step in range(40):
        several(client, *((route.object_id, route.size) for route in DEFAULT))
        client.ping(in_session=True)
        if step == 20:
            {"late ping": lambda: second.ping(in_session=True), "session": second.begin}.get(other, lambda: None)()
        world.run(0.1)
    remotes = [event.remote for event in world.all(Connected) if event.remote.address.endswith("50001")]
    alone = [None, other != "ping"] + [False] * (other in {"late ping", "session"})
    assert [each.alone for each in remotes] == alone
    assert {each._replace(alone=None) for each in remotes} == {Remote(1, "127.0.0.1:50001", 0, "", continued=True)}


def test_a_vehicle_that_is_renewed_connects_again_and_tells_its_names() -> None:
    world, client = stranger()
    several(client, *((route.object_id, route.size) for route in DEFAULT))
    world.settle()
    world.agent.renew(1)
    client.ping(in_session=True)
    several(client, *((route.object_id, route.size) for route in DEFAULT))
    world.settle()
    assert [type(event) for event in world.events if not isinstance(event, (Opened, Sample))] == [
        Connected,
        Disconnected,
    ]
    assert not wire.Info.unpack(client.all(wire.INFO)[-1]).known
    with pytest.raises(LinkError, match="not connected"):
        world.agent.renew(1)


@pytest.mark.parametrize("own", [routes((1, 8), (2, 16), (4, 8)), routes((9, 8)), routes((1, 9))])
def test_a_set_that_does_not_fit_is_never_continued(own: list[Route]) -> None:
    world, client = stranger()
    client.ping(in_session=True)
    several(client, *((route.object_id, route.size) for route in own))
    several(client, *((route.object_id, route.size) for route in DEFAULT))
    client.ping(in_session=True)
    client.send(0, wire.Timestamp(1).pack())
    world.settle()
    assert world.all(Connected) == []
    assert [wire.Info.unpack(payload).known for payload in client.all(wire.INFO)] == [True, False]
    assert client.all(wire.TIMESTAMP_REPLY) == []


def test_a_client_that_does_not_show_its_topics_is_given_up() -> None:
    world, client = stranger()
    for _ in range(40):
        client.ping(in_session=True)
        client.write(1, bytes(8))
        world.run(0.1)
    known = [wire.Info.unpack(payload).known for payload in client.all(wire.INFO)]
    assert sum(known) in (30, 31)
    assert known == sorted(known, reverse=True)
    assert world.all(Connected) == []


def test_a_stranger_gets_little_more_than_it_sends() -> None:
    world, client = stranger()
    client.ping(in_session=True)
    client.send(0, wire.Timestamp(1).pack())
    for route in DEFAULT[:4]:
        client.write(route.object_id, bytes(route.size))
    asked = sum(map(len, client.outgoing))
    world.clients = []
    for data in client.outgoing:
        world.agent.receive(data, client.address, 0)
    assert sum(len(data) for data, _ in world.agent.take_outgoing()) < asked
    assert world.agent._sessions == {}


def test_a_forged_creation_gets_little_more_than_it_sends() -> None:
    world, client = stranger()
    client.subscribe(2)
    world.clients = []
    asked = sum(map(len, client.outgoing))
    for data in client.outgoing:
        world.agent.receive(data, client.address, 0)
    sent = world.agent.take_outgoing()
    for step in range(50):
        world.agent.tick(step / 10)
        sent += world.agent.take_outgoing()
    assert sum(len(data) for data, _ in sent) < asked


def test_strangers_are_bounded() -> None:
    world = World(Agent(0.0, known=KNOWN))
    for port in range(1000):
        for data in (wire.pack_message(0x81, 0, 0, wire.GetInfo(b"\0\1").pack()), b"\x81\x01\0\0\7\1\4\0\0\1\x09\x95"):
            world.agent.receive(data, ("10.0.0.1", port), 0)
            world.agent.receive(data, ("10.0.0.2", port), 0)
    assert len(world.agent._continuation._strangers) <= Limits().clients
    assert len(world.agent._continuation._ended) <= Limits().clients


# --- messages of several samples


def test_a_message_has_any_number_of_samples() -> None:
    world, client = connected()
    for number in range(1, 23):
        several(client, *((1, number + each) for each in range(number)))
        world.settle()
    sizes = [len(event.payload) - 4 for event in world.all(Sample)]
    assert sizes == [number + each for number in range(1, 23) for each in range(number)]
    assert (world.agent.lost, world.agent.late, world.agent.refused) == (0, 0, {})


@pytest.mark.parametrize("flags", [wire.LITTLE_ENDIAN, 0x03])
def test_both_ways_through_a_message_give_the_same(flags: int) -> None:
    """The way for samples only, and the one for all messages."""
    random = Random(5)  # noqa: S311
    for _ in range(300):
        (fast, client), (slow, _) = connected(), connected()
        several(client, (1, 4))
        parts = [
            wire.pack_submessage(
                random.choice((wire.WRITE_DATA, wire.WRITE_DATA, wire.WRITE_DATA, wire.GET_INFO)),
                b"\0\1" + random.choice((b"\0\x15", b"\0\x15", b"\0\x25")) + bytes(random.randrange(20)),
                random.choice((wire.LITTLE_ENDIAN, wire.LITTLE_ENDIAN, flags)),
            )
            for _ in range(random.randrange(1, 5))
        ]
        client.send(wire.BEST_EFFORT, *parts)
        client.outgoing[-1] += random.randbytes(random.choice((0, 0, 1, 3, 4, 9)))
        for data in client.outgoing:
            fast.agent.receive(data, client.address, 7)
            slow.agent._sessions[client.address].fast_id = -1
            slow.agent.receive(data, client.address, 7)
        assert fast.agent.take_events() == slow.agent.take_events()
        assert fast.agent.take_outgoing() == slow.agent.take_outgoing()
        assert fast.agent.refused == slow.agent.refused


# --- killed at any moment


@pytest.mark.parametrize("seed", range(40))
def test_a_session_survives_any_number_of_agents(seed: int) -> None:
    random = Random(seed)  # noqa: S311
    network = Network(0.05, 0.05, 0.05) if seed % 2 else Network()
    client = Client(namespace=random.choice(("", "uav_1")), key=random.randrange(1, 9))
    client.next = random.choice((0, 30000, 65530))
    world, _ = connected(client)
    written: list[bytes] = []
    got: list[bytes] = []
    for _ in range(5):
        for _ in range(random.randrange(20)):
            written.append(len(written).to_bytes(4, "little"))
            client.write(1, written[-1])
            if random.random() < 0.3:
                world.run(0.1)
        world.run(1.5)
        (number,) = world.agent._connected
        request = len(got) + 1
        world.agent.call(number, SERVICE, request, LE + bytes([request]))
        for _ in range(30):
            client.ping(in_session=True)
            world.run(0.1)
        found = [each[24:] for each in client.samples() if each[24:] == bytes([request])]
        assert found == [bytes([request])]
        got += found
        for event in world.all(Sample):
            assert (event.route.name, event.payload[4:] in written) == ("/fmu/out/a", True)
        session = world.agent._sessions[client.address]
        record = session.record()
        assert record is not None
        client.received.clear()
        client.outgoing.clear()  # what was on its way to the killed agent
        world = World(Agent(world.now, records=[record]), client, network=network, seed=seed)
        client.ping(in_session=True)
        world.settle()


# --- captures of PX4 v1.18


class Replay:
    """An agent that gets the client's datagrams of a capture, from its start on."""

    def __init__(self, name: str, **options: Any) -> None:
        capture = load("gaps")[name]
        self.rows = [Row(row[0], row[1], bytes.fromhex(row[2]), row[3]) for row in capture["datagrams"]]
        bound = [time for time, text in capture["events"] if "bound" in text]
        self.start = bound[0] if bound else self.rows[0].time
        self.rows = [row for row in self.rows if row.time >= self.start]
        self.agent = Agent(self.start, **options)
        self.events: list[Event] = []
        self.sent = self.agent.take_outgoing()
        self.at: list[float] = []

    def run(self) -> Replay:
        now = self.start
        for row in self.rows:
            while now + 0.1 < row.time:
                now += 0.1
                self.agent.tick(now)
            self.agent.receive(row.data, ("127.0.0.1", 50001 + row.port), 0)
            events = self.agent.take_events()
            self.events += events
            self.at += [row.time] * len(events)
            self.sent += self.agent.take_outgoing()
        return self

    def all(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]

    def answers(self, kind: int) -> list[bytes]:
        return [data for data, _ in self.sent if data[4] == kind]

    def written(self) -> list[tuple[int, bytes]]:
        """Return the object id and payload of all samples that the client sent."""
        bodies = [row.data[4:] for row in self.rows if row.data[1] == wire.BEST_EFFORT]
        parts = [part for body in bodies for part in wire.submessages(body)]
        return [(entities.object_number(part.payload[2:4]), part.payload[4:]) for part in parts]


@pytest.fixture(scope="module")
def record() -> Record:
    """The record of PX4 v1.18 after it has created its entities."""
    done = Replay("creation").run()
    created = done.agent._sessions["127.0.0.1", 50003].record()
    assert created is not None
    return created._replace(address=PORT)


def test_px4_is_woken_and_goes_on_with_a_record(record: Record) -> None:
    done = Replay("continued", records=[record]).run()
    remote = Remote(1, "127.0.0.1:50001", 1, "", continued=True)
    assert done.all(Connected) == [Connected(remote)]
    assert done.all(Lost) == []
    assert len(done.answers(wire.HEARTBEAT)) == 8
    assert [(event.route.object_id, event.payload[4:]) for event in done.all(Sample)] == done.written()
    assert max(len(row.data) for row in done.rows) > 1200
    assert len(done.all(Sample)) > len(done.rows)
    done.agent.call(1, SERVICE, 1, LE + bytes(56))
    ((request, _),) = done.agent.take_outgoing()
    assert wire.parse_header(request).sequence == 0xD3, "after the two requests of the program in the capture"
    pings = [row for row in done.rows if row.data[4] == wire.GET_INFO]
    assert len(done.answers(wire.INFO)) == len(pings) + 1
    assert all(wire.Info.unpack(data[8:]).known for data in done.answers(wire.INFO))
    assert done.agent.refused == {"reply to a request of another program": 2}


def test_px4_is_continued_without_a_record(px4_types: Any) -> None:
    default, *others = known_routes((px4_types,))
    assert len(others) == 1
    done = Replay("learnt", known=joined([default, *others])).run()
    remote = Remote(1, "127.0.0.1:50001", 0, "", continued=True)
    assert [event.remote for event in done.all(Connected)] == [remote, remote._replace(alone=True)]
    assert len(done.all(Sample)) == len(done.written()), "13 topics in the first datagram"
    assert [(event.route.object_id, event.payload[4:]) for event in done.all(Sample)] == done.written()
    request, reply = (f"px4_msgs/srv/VehicleCommand_{end}" for end in ("Request", "Response"))
    service = Service("/fmu/vehicle_command", request, reply, SERVICE)
    assert {event.route for event in done.all(Opened)} == {*default[:-1], service}
    assert done.all(Disconnected) == []
    left = done.agent._sessions[PORT].record()
    assert left is not None
    again = Agent(0.0, records=[left])
    routes, expected = (each._sessions[PORT].inventory.routes() for each in (again, done.agent))
    assert [route[:4] for route in routes] == [route[:4] for route in expected]
    assert routes[:31] == expected[:31], "the sizes of what the vehicle publishes, too"
    assert again._sessions[PORT].record() == left


@pytest.mark.slow  # it loads all releases
def test_the_samples_of_a_release_rule_out_all_others() -> None:
    known = {release: known_routes((package_of(release),)) for release in EMBEDDED}
    continuation = Continuation(joined(each for sets in known.values() for each in sets), 64)
    for sets in known.values():
        for own in sets:
            written = [route for route in own if route.direction == "out"]
            samples = [
                wire.Sample(b"\0\0", entities.object_id(route.object_id, entities.WRITER), bytes(max(0, route.size)))
                for route in written
            ]
            continuation.greet(PORT, 0.0)
            continuation.observe(0, samples, PORT)
            found = continuation.proved(PORT)
            assert found is not None
            assert found.routes == tuple(own)
            continuation.end(PORT, 0.0)
            continuation.tick(100.0)


def test_px4_is_not_continued_with_the_ids_of_another_board(px4_types: Any) -> None:
    """All samples of 1.5 s, in any order of the sets: none is taken for another topic."""
    default, others = known_routes((px4_types,))
    done = Replay("learnt", known=others).run()
    assert (done.all(Connected), done.all(Sample)) == ([], [])
    assert len(done.answers(wire.HEARTBEAT)) == 0
    assert len(object_ids_of(px4_types)) == 2
    assert default != others


def test_a_running_px4_shows_its_ids_soon(px4_types: Any) -> None:
    """From each datagram on."""
    known = joined(known_routes((px4_types,)))
    for first in range(0, 150, 7):
        done = Replay("running", known=known)
        done.rows = done.rows[first:]
        done.run()
        begun = next(at for at, event in zip(done.at, done.events, strict=True) if isinstance(event, Connected))
        assert begun - done.rows[0].time < 0.03
        names = {route.object_id: route.name for route in known_routes((px4_types,))[0]}
        assert all(event.route.name == names[event.route.object_id] for event in done.all(Sample))


@pytest.mark.parametrize("has_record", [True, False])
def test_px4_goes_on_after_its_time_synchronization(has_record: bool, record: Record, px4_types: Any) -> None:  # noqa: FBT001
    early = record._replace(parts=record.parts[:1], next=1)
    given: dict[str, Any] = {"records": [early]} if has_record else {"known": joined(known_routes((px4_types,)))}
    done = Replay("sync", **given).run()
    connection, *further = done.all(Connected)
    assert connection.remote == Remote(1, "127.0.0.1:50001", int(has_record), "", continued=True)
    assert [event.remote for event in further] == [connection.remote._replace(alone=True)] * (not has_record)
    asked = [row for row in done.rows if row.data[4] == wire.TIMESTAMP]
    assert len(done.answers(wire.TIMESTAMP_REPLY)) == len(asked) > 250
    assert len(done.all(Opened)) == 31 + 38 + 1
    assert len(done.all(Sample)) == len(done.written()) > 100
    again = done.agent._sessions[PORT].record()
    assert again is not None
    assert len(again.parts) == len(record.parts)
    number = connection.remote.number
    assert set(done.agent.routes(number)) == {event.route for event in Replay("creation").run().all(Opened)}


def test_px4_that_has_begun_another_session_ends_that_of_the_record(record: Record) -> None:
    done = Replay("client-restarted", records=[record]).run()
    assert [event.remote for event in done.all(Connected)] == [Remote(1, "127.0.0.1:50002", 1, "", continued=False)]
    assert records_of(done.agent)[PORT] is None
    assert entities.object_id(1, entities.PARTICIPANT) == PARTICIPANT
