"""Sessions that an earlier program began: with a record of them, without one, and as PX4 behaved in captures."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from msggen.link.link import (
    Connected,
    Disconnected,
    Event,
    Lost,
    Opened,
    Remote,
    Replied,
    Route,
    Sample,
    Warned,
)
from msggen.link.xrce import entities, wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.limits import QUESTIONS, Limits
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.record import Record
from support.xrce_captures import Row, load
from support.xrce_client import PARTICIPANT, SERVICE, Client, Network, World, connected, start

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
    assert after.agent.outbox.refused == {}


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
    assert after.agent.outbox.refused == {"reply to a request of another program": 1}
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


def several(client: Client, *samples: tuple[int, int]) -> None:
    """Send samples of writers with some sizes in one message."""
    parts = [
        wire.Sample(client.ask(), entities.object_id(number, entities.WRITER), bytes(size)).pack(wire.WRITE_DATA)
        for number, size in samples
    ]
    client.send(wire.BEST_EFFORT, *parts)


def told(port: int = 50001) -> Warned:
    """Return what the user is told of a client in a session without a record."""
    text = f"127.0.0.1:{port} has a session with an earlier program, of which there is no record"
    return Warned(f"{text}: it connects anew, which takes about 10 s")


def stranger(**options: Any) -> tuple[World, Client]:
    """Return a client in a session, and an agent that has no record of it."""
    _, client = connected()
    client.received.clear()
    return World(Agent(0.0, **options), client), client


def test_a_client_without_a_record_has_to_connect_anew() -> None:
    world, client = stranger()
    for _ in range(3):
        client.ping(in_session=True)
        several(client, *((number, 8) for number in range(1, 9)))
        client.send(0, wire.Timestamp(1).pack())
        client.publish(7)
    world.run(3.0)
    assert world.events == [told()]
    assert [wire.Info.unpack(payload).known for payload in client.all(wire.INFO)] == [False] * 3
    assert len(client.received) == 3, "it gets no other answer"
    assert world.agent.outbox.refused.keys() == {"message of an unknown session"}
    client.delete()
    again = Client(50002)
    world.clients.append(again)
    start(again)
    world.settle()
    assert [event.remote for event in world.all(Connected)] == [Remote(1, "127.0.0.1:50002", 1, "", continued=False)]
    assert world.all(Warned) == [told()]


@pytest.mark.parametrize("what", ["ping", "sample", "time", "creation"])
def test_whatever_a_client_without_a_record_sends_is_told(what: str) -> None:
    world, client = stranger()
    {
        "ping": lambda: client.ping(in_session=True),
        "sample": lambda: client.write(1, b"x"),
        "time": lambda: client.send(0, wire.Timestamp(1).pack()),
        "creation": lambda: client.publish(7),
    }[what]()
    world.settle()
    assert world.events == [told()]


@pytest.mark.parametrize("what", ["delete", "begin", "ping"])
def test_a_client_that_begins_or_ends_a_session_is_not_told(what: str) -> None:
    world, client = stranger()
    getattr(client, what)()
    world.settle()
    assert world.events == []


def test_each_client_without_a_record_is_told_once() -> None:
    world, client = stranger()
    other = Client(50002)
    world.clients.append(other)
    for _ in range(20):
        client.ping(in_session=True)
        other.ping(in_session=True)
        world.run(0.5)
    assert world.events == [told(), told(50002)]


@pytest.mark.parametrize("how", ["ended", "ended before", "refused"])
def test_what_a_client_sends_late_in_a_session_that_has_ended_is_not_told(how: str) -> None:
    world, client = {"ended": connected, "ended before": stranger, "refused": lambda: connected(keys={7})}[how]()
    client.delete()
    world.run(2.0)
    client.write(1, b"late")
    client.ping(in_session=True)
    world.run(5.0)
    assert [event for event in world.all(Warned) if "earlier program" in event.text] == []


def test_a_client_that_comes_back_after_its_session_was_forgotten_is_told() -> None:
    world, client = connected()
    world.run(Limits().memory + 20)
    client.write(1, b"x")
    world.settle()
    assert world.all(Warned) == [told()]


@pytest.mark.parametrize("options", [{"keys": {1}}, {"allow": lambda address: address[0] == "127.0.0.1"}])
def test_a_client_that_may_connect_does_so_anew(options: dict[str, Any]) -> None:
    world, client = stranger(**options)
    client.write(1, b"x")
    world.settle()
    assert world.events == [told()]


def test_strangers_are_bounded_and_get_little_more_than_they_send() -> None:
    agent = Agent(0.0)
    asked = answered = 0
    for port in range(1, 1000):
        client = Client(port)
        client.ping(in_session=True)
        client.write(1, bytes(8))
        client.send(0, wire.Timestamp(1).pack())
        client.publish(7)
        client.delete()
        for data in client.outgoing:
            agent.receive(data, client.address, 0)
            asked += len(data)
        answered += sum(len(data) for data, _ in agent.take_outgoing())
    assert answered < asked
    assert (agent._sessions, agent._dropped) == ({}, {})
    assert len(agent._ended) <= Limits().clients
    assert len(agent.take_events()) <= 20
    agent.tick(1.0)
    for _ in range(100):
        agent.tick(agent._last_tick + 0.2)
    assert agent._ended == {}


# --- messages of several samples


def test_a_message_has_any_number_of_samples() -> None:
    world, client = connected()
    for number in range(1, 23):
        several(client, *((1, number + each) for each in range(number)))
        world.settle()
    sizes = [len(event.payload) - 4 for event in world.all(Sample)]
    assert sizes == [number + each for number in range(1, 23) for each in range(number)]
    assert (world.agent.outbox.lost, world.agent.outbox.late, world.agent.outbox.refused) == (0, 0, {})


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
        assert fast.agent.outbox.refused == slow.agent.outbox.refused


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
    assert done.agent.outbox.refused == {"reply to a request of another program": 2}


@pytest.mark.parametrize("name", ["learnt", "running", "continued"])
def test_px4_without_a_record_is_refused_whatever_it_sends(name: str) -> None:
    done = Replay(name).run()
    assert done.events == [told()]
    pings = [row for row in done.rows if row.data[4] == wire.GET_INFO]
    assert [wire.Info.unpack(data[8:]).known for data in done.answers(wire.INFO)] == [False] * len(pings)
    assert len(done.sent) == len(pings), "it gets no other answer"
    assert len(done.written()) > 100


def test_px4_without_a_record_ends_its_session_after_three_answers() -> None:
    """Where the other agent of the capture gave the same answers, 2.7 s after its start."""
    rows = [Row(row[0], row[1], bytes.fromhex(row[2]), row[3]) for row in load("gap-info-no")["datagrams"]]
    start = load("gap-info-no")["events"][1][0]
    agent = Agent(start)
    sent = []
    for row in rows:
        if row.sender == "client" and row.time > start and len(row.data) > 4:
            agent.receive(row.data, ("127.0.0.1", 50001 + row.port), 0)
            sent += [data for data, _ in agent.take_outgoing() if data[4] == wire.INFO]
    assert sent == [row.data for row in rows if row.sender == "agent" and row.time > start and row.data[4] == wire.INFO]
    assert [data[0] for data in sent] == [0x81, 0x81, 0x81, 0x80], "the last one is before the next session"
    assert ("127.0.0.1", 50002) in agent._sessions
    assert agent.take_events() == [told()]


def test_px4_goes_on_after_its_time_synchronization(record: Record) -> None:
    early = record._replace(parts=record.parts[:1], next=1)
    done = Replay("sync", records=[early]).run()
    (connection,) = done.all(Connected)
    assert connection.remote == Remote(1, "127.0.0.1:50001", 1, "", continued=True)
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
