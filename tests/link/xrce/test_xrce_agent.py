"""Sessions of clients with an agent: life, streams both ways, loss, limits, strangers and continued sessions."""

from __future__ import annotations

import itertools
from random import Random

import pytest

from msggen.link.link import (
    Connected,
    Disconnected,
    LinkError,
    Lost,
    Opened,
    Remote,
    Replied,
    Route,
    Sample,
    Service,
    Warned,
)
from msggen.link.xrce import entities, wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.limits import LOSSES, REPLIES, Limits
from msggen.link.xrce.session import Session
from msggen.link.xrce.streams import OUTPUT_WINDOW
from support.xrce_captures import sent
from support.xrce_client import PARTICIPANT, SERVICE, Client, Network, World, connected, start
from support.xrce_garbage import mutated

LE = b"\0\1\0\0"
ROUTE = Route("/fmu/out/a", "px4_msgs/msg/A", "out", 1)
READ = Route("/fmu/in/b", "px4_msgs/msg/A", "in", 2)
SERVED = Service("/fmu/s", "px4_msgs/srv/S_Request", "px4_msgs/srv/S_Response", SERVICE)


# --- life


def test_a_client_connects_and_opens_its_routes() -> None:
    world, client = connected()
    remote = Remote(1, "127.0.0.1:50001", 1, "", continued=False)
    assert world.events == [
        Connected(remote),
        Opened(remote, ROUTE),
        Opened(remote, READ),
        Opened(remote, SERVED),
    ]
    assert client.statuses() == [wire.OK] * 8
    assert world.agent.routes(1) == [ROUTE, READ, SERVED]
    assert world.agent.outbox.refused == {}


def test_an_agent_is_settled_when_all_who_send_have_had_time_to_connect() -> None:
    first, second = Client(), Client(50002, 2)
    world, _ = connected(first)
    world.clients.append(second)
    world.run(2.0)
    assert not world.agent.is_settled(), "another client may ask within 2 s"
    second.begin()
    world.settle()
    world.run(1.0)
    assert world.now > 2.5
    assert not world.agent.is_settled(), "the second one is connecting"
    second.participate()
    world.settle()
    assert len(world.all(Connected)) == 2
    assert world.agent.is_settled()


def test_a_client_that_falls_silent_while_it_connects_is_not_waited_for() -> None:
    world, _ = connected()
    silent = Client(50002, 2)
    world.clients.append(silent)
    world.run(2.5)
    assert world.agent.is_settled()
    silent.begin()
    world.settle()
    assert not world.agent.is_settled()
    world.clients.remove(silent)
    world.run(1.5)
    assert world.agent.is_settled()


@pytest.mark.parametrize("session_id", [0x01, 0x7F, 0x81, 0x82, 0xFF])
def test_a_session_has_any_id(session_id: int) -> None:
    """Below 0x80 each header has the key."""
    world, client = connected(Client(session_id=session_id))
    client.write(1, b"abc")
    world.settle()
    assert [event.payload for event in world.all(Sample)] == [LE + b"abc"]
    world.agent.publish(1, 2, LE + b"data")
    world.settle()
    assert client.samples() == [b"data"]
    assert client.statuses() == [wire.OK] * 8
    assert world.agent.outbox.refused == {}


@pytest.mark.parametrize(("session_id", "key"), [(0x82, 1), (0x01, 1), (0x01, 2)])
def test_a_wrong_session_id_or_key_is_refused(session_id: int, key: int) -> None:
    world, _ = connected(Client(session_id=0x01 if key == 2 else 0x81))
    stranger = Client(session_id=session_id, key=key)
    stranger.write(1, b"abc")
    world.clients = [stranger]
    world.settle()
    assert world.all(Sample) == []
    assert world.agent.outbox.refused == {"wrong session id or key": 1}


def test_a_ping_tells_whether_there_is_a_session() -> None:
    agent = Agent(0.0)
    client = Client()
    world = World(agent, client)
    client.ping()
    client.ping(in_session=True)
    world.settle()
    start(client)
    client.ping(in_session=True)
    world.settle()
    assert [wire.Info.unpack(payload).known for payload in client.all(wire.INFO)] == [False, False, False, True]


def test_a_silent_client_is_disconnected_and_forgotten() -> None:
    world, client = connected()
    world.run(4.9)
    assert world.all(Disconnected) == []
    world.run(0.3)
    assert [event.reason for event in world.all(Disconnected)] == ["the vehicle has sent nothing for 5 s"]
    with pytest.raises(LinkError, match="vehicle 1 is not connected any more"):
        world.agent.publish(1, 2, LE)
    client.write(1, b"a")  # the session is still there, and continues
    world.settle()
    remote = Remote(2, "127.0.0.1:50001", 1, "", continued=False)
    assert world.events[5:] == [
        Connected(remote),
        *(Opened(remote, r) for r in (ROUTE, READ, SERVED)),
        world.events[-1],
    ]
    assert world.all(Sample) == [Sample(remote, ROUTE, LE + b"a", int(world.now * 1e9))]
    assert world.all(Lost) == []
    world.run(61)
    client.write(1, b"b")
    world.settle()
    assert len(world.all(Connected)) == len(world.all(Disconnected)) == 2
    assert world.agent.outbox.refused == {"message of an unknown session": 1}
    assert world.agent._sessions == {}


def test_a_silent_client_that_ends_its_session_is_not_connected_again() -> None:
    world, client = connected()
    world.run(6)
    client.delete()
    world.settle()
    assert client.statuses()[-1] == wire.OK
    assert [type(event).__name__ for event in world.events[4:]] == ["Disconnected"]
    assert world.agent._sessions == {}


def test_a_client_that_pings_stays() -> None:
    world, client = connected()
    for _ in range(20):
        client.ping(in_session=True)
        world.run(1)
    assert world.all(Disconnected) == []


def test_a_client_that_only_writes_stays() -> None:
    world, client = connected()
    for _ in range(20):
        client.write(1, b"a")
        world.run(1)
    assert world.all(Disconnected) == []
    assert len(world.all(Sample)) == 20


def test_a_jump_of_the_clock_counts_as_one_second() -> None:
    world, _ = connected()
    for now in (0.1, 1e9, -1e9, 2e9, 5.0, 2e9):
        world.agent.tick(now)
    world.carry()
    assert world.all(Disconnected) == []
    world.agent.tick(3e9)
    world.agent.tick(4e9)
    world.agent.tick(5e9)
    world.carry()
    assert len(world.all(Disconnected)) == 1


def test_jumps_of_the_clock_disconnect_nobody() -> None:
    world, client = connected()
    for now in (1.0, -1e9, 1e9, 1e9 + 1, 0.0, float(2**40), 3.0):
        world.agent.tick(now)
        client.ping(in_session=True)
        world.settle()
    assert world.all(Disconnected) == []
    for time in (-(2**70), -1, 0, 2**31 * 10**9, 2**70):
        world.agent.receive(wire.HEADER.pack(0x81, 0, 0) + wire.Timestamp(5).pack(), client.address, time)
    world.settle()
    assert len(client.all(wire.TIMESTAMP_REPLY)) == 5
    assert world.agent.outbox.refused == {}


def test_the_time_is_answered() -> None:
    world, client = connected()
    world.now = 1_700_000_000.5
    client.send(0, wire.Timestamp(123_456_789_012).pack())
    world.settle()
    reply = wire.TimestampReply.unpack(client.all(wire.TIMESTAMP_REPLY)[0])
    assert reply == (1_700_000_000_500_000_000, 1_700_000_000_500_000_000, 123_456_789_012)


def test_close_disconnects_everybody() -> None:
    agent = Agent(0.0)
    world, _ = connected(agent=agent)
    world.clients.append(Client(50002, key=2))
    start(world.clients[1])
    world.settle()
    agent.close()
    world.settle()
    assert [event.reason for event in world.all(Disconnected)] == ["the link was closed"] * 2
    agent.close()
    assert agent.take_events() == []


# --- restarts


def test_a_client_that_restarts_fifty_times_leaves_nothing() -> None:
    world, _ = connected()
    for port in range(50002, 50052):
        client = Client(port)
        world.clients = [client]
        start(client)
        client.write(1, b"a")
        world.run(0.3)
    assert len(world.all(Connected)) == 51
    assert len(world.all(Sample)) == 50
    world.run(0.3)
    assert [event.remote.number for event in world.all(Disconnected)] == list(range(1, 51))
    assert list(world.agent._connected) == [51]
    world.run(70)
    assert (world.agent._sessions, world.agent._connected, world.agent._ended) == ({}, {}, {})
    assert world.all(Warned) == []


def test_a_client_that_restarts_at_its_address_begins_a_session() -> None:
    """A serial line has one address."""
    world, client = connected()
    for number in range(50):
        client = Client()
        world.clients = [client]
        start(client)
        client.write(1, bytes([number]))
        world.settle()
        assert client.statuses() == [wire.OK] * 8
    assert len(world.all(Sample)) == 50
    assert {event.reason for event in world.all(Disconnected)} == {"the vehicle has begun another session"}
    assert len(world.agent._sessions) == 1


def test_a_doubled_create_client_changes_nothing() -> None:
    world, client = connected()
    client.begin()
    client.write(1, b"a")
    world.settle()
    assert len(client.all(wire.STATUS_AGENT)) == 2
    assert len(world.all(Connected)) == len(world.all(Sample)) == 1


def test_a_create_client_without_answer_is_repeated() -> None:
    client = Client()
    world = World(Agent(0.0), client)
    client.begin()
    world.settle()
    world.run(1)
    client.ping()
    client.begin()
    client.participate()
    world.settle()
    assert len(client.all(wire.STATUS_AGENT)) == 2
    assert len(world.all(Connected)) == 1
    assert world.all(Disconnected) == []


TWO = (
    "two vehicles have the key 1, 127.0.0.1:{} and 127.0.0.1:{}: "
    "set the parameter UXRCE_DDS_KEY of one to another number"
)


def test_two_vehicles_with_one_key_both_work() -> None:
    world, first = connected()
    second = Client(50002)
    world.clients.append(second)
    start(second)
    world.settle()
    for number in range(20):
        first.write(1, b"1" + bytes([number]))
        second.write(1, b"2" + bytes([number]))
        world.settle()
        world.run(0.1)
        assert [event.text for event in world.all(Warned)] == [TWO.format(50001, 50002)], "it is told at once"
    arrived = [event.payload[4:] for event in world.all(Sample)]
    for name in (b"1", b"2"):
        assert [data for data in arrived if data[:1] == name] == [name + bytes([number]) for number in range(20)]
    assert len(world.agent._connected) == 2
    assert world.all(Lost) == world.all(Disconnected) == []
    third = Client(50003)  # the second one restarts
    world.clients = [first, third]
    start(third)
    for _ in range(70):
        first.write(1, b"1")
        third.write(1, b"3")
        world.run(0.1)
    assert [(event.remote.address, event.reason) for event in world.all(Disconnected)] == [
        ("127.0.0.1:50002", "the vehicle has begun another session, at 127.0.0.1:50003")
    ]
    assert [event.text for event in world.all(Warned)][1:] == [TWO.format(50001, 50003)]


@pytest.mark.parametrize("leaver", [0, 1])
@pytest.mark.parametrize("ends", [True, False])
def test_of_two_vehicles_with_one_key_one_leaves(leaver: int, *, ends: bool) -> None:
    world, _ = connected()
    second = Client(50002)
    world.clients.append(second)
    start(second)
    world.settle()
    if ends:
        world.clients[leaver].delete()
    else:
        world.run(0.2)
    stayer = world.clients[1 - leaver]
    for number in range(60):
        stayer.write(1, bytes([number]))
        world.run(0.1)
    assert [event.remote.address[-1] for event in world.all(Disconnected)] == ["12"[leaver]]
    assert [event.payload[4] for event in world.all(Sample)] == [*range(60)]
    assert len(world.agent._connected) == 1


def test_a_vehicle_that_is_silent_for_a_while_is_told_of_another_one_when_it_is_heard_again() -> None:
    world, first = connected()
    world.run(1)
    second = Client(50002)
    world.clients.append(second)
    start(second)
    world.settle()
    assert [event.reason for event in world.all(Disconnected)] == [
        "the vehicle has begun another session, at 127.0.0.1:50002"
    ]
    assert world.all(Warned) == []
    first.write(1, b"1")
    second.write(1, b"2")
    world.settle()
    assert [event.text for event in world.all(Warned)] == [TWO.format(50001, 50002)]
    assert [event.payload[4:] for event in world.all(Sample)] == [b"1", b"2"]


def test_a_vehicle_that_restarts_is_replaced_within_half_a_second() -> None:
    world, first = connected()
    first.write(1, b"1")
    world.settle()
    world.clients = [Client(50002)]
    start(world.clients[0])
    world.settle()
    world.run(0.4)
    assert world.all(Disconnected) == []
    world.run(0.2)
    assert [event.remote.number for event in world.all(Disconnected)] == [1]
    assert world.all(Warned) == []


def test_two_vehicles_with_one_key_and_two_namespaces_both_work_at_once() -> None:
    world, _ = connected(Client(namespace="uav_1"))
    second = Client(50002, namespace="uav_2")
    world.clients.append(second)
    start(second)
    world.settle()
    assert [event.remote.namespace for event in world.all(Connected)] == ["uav_1", "uav_2"]
    assert world.all(Disconnected) == []


def test_reset_begins_the_streams() -> None:
    world, client = connected()
    client.write(1, b"a")
    client.send(0, wire.pack_submessage(wire.RESET, b""))
    world.settle()
    fresh = Client()
    client.next, client.output, client.input = 0, fresh.output, fresh.input
    client.write(1, b"b")
    client.delete(entities.object_id(1, entities.WRITER))
    world.settle()
    assert [event.payload[4:] for event in world.all(Sample)] == [b"a", b"b"]
    assert world.agent.routes(1) == [READ, SERVED]


# --- streams


def test_late_and_doubled_samples_are_dropped_and_gaps_are_counted() -> None:
    world, client = connected()
    for data in (b"0", b"1", b"2", b"3", b"4", b"5"):
        client.write(1, data)
    messages = client.outgoing
    client.outgoing = [messages[at] for at in (1, 0, 1, 3, 2, 5, 5)]
    world.settle()
    assert [event.payload[4:] for event in world.all(Sample)] == [b"1", b"3", b"5"]
    assert [event.missing for event in world.all(Lost)] == [1, 1, 1]
    assert (world.agent.outbox.lost, world.agent.outbox.late) == (3, 4)


@pytest.mark.parametrize("is_fast", [True, False])
@pytest.mark.parametrize(("ahead", "arrives"), [(1, True), (1023, True), (1024, False), (32768, False), (65535, False)])
def test_numbers_that_are_near_and_newer_are_taken(ahead: int, arrives: bool, is_fast: bool) -> None:  # noqa: FBT001
    world, client = connected()
    client.write(1, b"a")
    world.settle()
    if not is_fast:
        world.agent._sessions[client.address].fast_id = -1
    client.next = ahead
    client.write(1, b"b")
    world.settle()
    assert len(world.all(Sample)) == 1 + arrives
    assert world.agent.outbox.lost == (min(ahead - 1, LOSSES) if arrives else 0)


@pytest.mark.parametrize("is_fast", [True, False])
@pytest.mark.parametrize("gap", [LOSSES, LOSSES + 1, 500, 1022])
def test_a_burst_is_counted_as_a_whole_when_the_vehicle_goes_on(gap: int, is_fast: bool) -> None:  # noqa: FBT001
    world, client = connected()
    client.write(1, b"a")
    world.settle()
    session = world.agent._sessions[client.address]
    client.next += gap
    for number in range(-(-gap // LOSSES)):
        assert world.agent.outbox.lost == number * LOSSES
        if not is_fast:
            session.fast_id = -1
        client.write(1, b"b")
        world.settle()
    assert world.agent.outbox.lost == sum(event.missing for event in world.all(Lost)) == gap
    assert session.fast_id == client.session_id
    assert len(world.all(Sample)) + gap == client.next


@pytest.mark.parametrize("steps", [(1022,), (30000, 0), (1022, 0, 0)])
def test_forged_numbers_count_for_little_more_than_what_was_sent(steps: tuple[int, ...]) -> None:
    world, client = connected()
    for number in (1, 2, 3, 4, 5):
        client.write(number, bytes(4 * number))
    for number in range(3000):
        client.next = (client.next + steps[number % len(steps)]) % 65536
        client.write(1, bytes(4))
    world.settle()
    assert len(world.all(Connected)) == 1
    assert 3000 < world.agent.outbox.lost <= LOSSES * 3005


def test_forged_numbers_count_for_little_more_when_the_vehicle_goes_on() -> None:
    world, client = connected()
    for number in range(4000):
        client.next = (client.next + 30000 * (number % 2 and number < 200)) % 65536
        client.write(1, bytes(4))
    world.settle()
    assert world.agent.outbox.lost <= 0x8000 + 200 * LOSSES
    assert world.agent._sessions[client.address].fast_id == client.session_id


@pytest.mark.parametrize("number", [1024, 20000, 32767, 40000, 60000])
def test_a_forged_number_neither_counts_as_lost_nor_hides_what_follows(number: int) -> None:
    world, client = connected()
    for index in range(10):
        client.write(1, b"real")
        client.next, real = number + 7 * index, client.next
        client.write(1, b"forged")
        client.next = real
    world.settle()
    assert [event.payload for event in world.all(Sample)] == [LE + b"real"] * 10
    assert (world.agent.outbox.lost, world.agent.outbox.late) == (0, 10)


def test_a_damaged_message_does_not_move_the_number() -> None:
    world, client = connected()
    for number in range(10):
        client.write(1, b"real")
        client.outgoing.append(b"\x81\x01" + (number + 500).to_bytes(2, "little") + b"\x07\x01\xff\xff damaged")
    world.settle()
    assert len(world.all(Sample)) == 10
    assert world.agent.outbox.lost == 0
    assert world.agent.outbox.refused == {"submessage longer than its message": 10}


@pytest.mark.parametrize("gap", [2000, 30000])
def test_a_long_gap_is_counted_once_the_stream_goes_on(gap: int) -> None:
    """What arrived and what was lost are what was sent."""
    world, client = connected()
    client.write(1, b"a")
    client.next += gap
    for _ in range(2000):
        client.write(1, b"b")
    world.settle()
    assert len(world.all(Sample)) == 1 + 1999
    assert len(world.all(Sample)) + world.agent.outbox.lost == client.next


def test_a_stream_that_begins_anew_goes_on_after_two_messages() -> None:
    world, client = connected()
    client.next = 10000
    for number in (10000, 0):
        client.next = number
        for _ in range(5):
            client.write(1, b"a")
    world.settle()
    assert len(world.all(Sample)) == 4 + 4


def test_what_follows_a_sample_in_its_message_counts() -> None:
    world, client = connected()
    sample = wire.Sample(b"\0\1", entities.object_id(1, entities.WRITER), b"1234").pack(wire.WRITE_DATA)
    client.write(1, b"a")
    client.send(wire.BEST_EFFORT, sample, wire.pack_submessage(wire.RESET, b""))
    client.next = 0
    client.write(1, b"b")
    client.send(wire.BEST_EFFORT, wire.Delete(b"\0\1").pack(), sample)
    world.settle()
    assert [event.payload[4:] for event in world.all(Sample)] == [b"a", b"1234", b"b"]
    assert type(world.events[-1]) is Disconnected


@pytest.mark.parametrize("sizes", [[1], [4, 4], [3, 1, 9], [0, 7]])
def test_samples_share_a_datagram(sizes: list[int]) -> None:
    world, client = connected()
    object_id = entities.object_id(1, entities.WRITER)
    parts = [wire.Sample(b"\0\1", object_id, bytes(size)).pack(wire.WRITE_DATA) for size in sizes]
    client.send(wire.BEST_EFFORT, *parts)
    client.outgoing[-1] += bytes(-len(client.outgoing[-1]) % 4)
    world.settle()
    assert [len(event.payload) - 4 for event in world.all(Sample)] == sizes


def test_best_effort_wraps_both_ways() -> None:
    world, client = connected()
    session = world.agent._find(1)
    session.best_effort.last = client.best_effort.last = 65_000
    session._next = client.next = 65_001
    for number in range(2000):
        client.write(1, b"x")
        world.agent.publish(1, 2, LE + b"y")
        if number % 100 == 0:
            world.settle()
    world.settle()
    assert len(world.all(Sample)) == len(client.samples()) == 2000
    assert (world.agent.outbox.lost, world.agent.outbox.late) == (0, 0)


def answer_one(world: World, client: Client, number: int) -> None:
    """Call the service once, and let the client answer."""
    world.agent.call(1, SERVICE, number, LE + b"ask")
    world.settle()
    ids = client.received[-1].payload
    assert ids[28:] == b"ask"
    reply = wire.Sample(b"\0\1", ids[2:4], ids[4:28] + b"answer").pack(wire.WRITE_DATA)
    client.send(wire.RELIABLE, reply)
    world.settle()
    event = world.events[-1]
    assert isinstance(event, Replied)
    assert (event.service, event.number, event.payload) == (SERVED, number, LE + b"answer")


def test_a_lost_reply_is_asked_for() -> None:
    """Micro XRCE-DDS Client 2.4.3 sends no HEARTBEAT if it is polled more often than every 100 ms, as PX4 does."""
    world, client = connected()
    world.agent.call(1, SERVICE, 7, LE + b"ask")
    world.settle()
    identity = client.samples()[-1][:24]
    object_id = entities.object_id(SERVICE, entities.REPLIER)
    client.send(wire.RELIABLE, wire.Sample(b"\0\1", object_id, identity + b"ok").pack(wire.WRITE_DATA))
    sequence = (client.output.next - 1).to_bytes(2, "little")
    client.outgoing.clear()  # lost
    world.agent.tick(0.1)
    [(asked, _)] = world.agent.take_outgoing()
    assert asked == bytes.fromhex("81000000 0a010500") + sequence + bytes.fromhex("0001 80")
    client.receive(asked)
    world.settle()
    assert [event.number for event in world.all(Replied)] == [7]
    world.agent.tick(0.2)
    assert world.agent.take_outgoing() == []


def test_a_reply_that_never_comes_is_asked_for_some_time() -> None:
    world, client = connected()
    world.agent.call(1, SERVICE, 7, LE + b"ask")
    world.settle()
    client.received.clear()
    asked = []
    for tick in range(100):
        world.agent.tick(tick / 10)
        asked += [data for data, _ in world.agent.take_outgoing()]
        client.ping(in_session=True)
        world.carry()
    assert [data[4] for data in asked] == [wire.ACKNACK] * 50
    assert (world.all(Replied), world.all(Disconnected)) == ([], [])


def test_reliable_streams_wrap_both_ways() -> None:
    world, client = connected()
    session = world.agent._find(1)
    session._output.next = client.input.expected = 65530
    session.input.expected = client.output.next = 65520
    for number in (1, 2**32 - 1, 2**32, 2**63 - 1, *range(10, 300)):
        answer_one(world, client, number)
    assert world.agent.outbox.refused == {}


@pytest.mark.parametrize("seed", range(5))
def test_everything_arrives_over_a_bad_network(seed: int) -> None:
    """10 % of the datagrams are lost, 10 % doubled and 10 % overtaken, both ways."""
    client = Client()
    world = World(Agent(0.0), client, network=Network(0.1, 0.1, 0.1), seed=seed)
    while not client.all(wire.STATUS_AGENT):
        client.begin()
        world.run(1)
    client.participate()
    client.publish(1)
    client.subscribe(2)
    client.serve()
    world.run(3)
    assert client.statuses() == [wire.OK] * 8
    assert world.agent.routes(1) == [ROUTE, READ, SERVED]
    for number in range(1, 101):
        world.agent.call(1, SERVICE, number, LE + bytes([number]))
        client.write(1, bytes([number]))
        world.run(1)
        requests = [
            data for data in client.all(wire.DATA) if data[2:4] == entities.object_id(SERVICE, entities.REPLIER)
        ]
        assert [data[28] for data in requests] == list(range(1, number + 1))
        reply = wire.Sample(b"\0\1", requests[-1][2:4], requests[-1][4:28] + b"ok").pack(wire.WRITE_DATA)
        client.send(wire.RELIABLE, reply)
    world.run(3)
    assert [event.number for event in world.all(Replied)] == list(range(1, 101))
    arrived = [event.payload[4] for event in world.all(Sample)]
    assert arrived == sorted(set(arrived))
    assert len(arrived) + world.agent.outbox.lost == arrived[-1]
    assert world.agent.outbox.refused == {}


def test_a_fragmented_entity_is_created() -> None:
    world, client = connected()
    topic = entities.object_id(9, entities.TOPIC)
    entity = entities.TopicEntity("rt/" + "x" * 200, "px4_msgs::msg::dds_::A_", PARTICIPANT)
    whole = wire.Create(b"\0\1", topic, entity.pack()).pack()
    parts = [whole[at : at + 50] for at in range(0, len(whole), 50)]
    for part in parts:
        flags = wire.LITTLE_ENDIAN | (wire.LAST_FRAGMENT if part is parts[-1] else 0)
        client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, part, flags))
    client.outgoing.insert(0, client.outgoing.pop(2))  # out of order
    world.settle()
    assert client.statuses() == [wire.OK] * 9


def test_fragments_that_never_end_are_bounded() -> None:
    world, client = connected()
    for _ in range(200):
        client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, bytes(1000)))
        world.settle()
        assert len(world.agent._find(1)._fragments._joined) <= 65536
    assert world.agent.outbox.refused == {"fragments beyond the limit": 3}
    client.delete(entities.object_id(1, entities.WRITER))
    client.participate()
    world.settle()
    assert world.agent.outbox.refused["fragments without an end"] == 1
    assert client.statuses()[-2:] == [wire.OK, wire.OK]


def test_a_message_between_fragments_ends_them() -> None:
    world, client = connected()
    client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, b"lost"))
    client.participate()
    whole = wire.Create(client.ask(), PARTICIPANT, entities.Participant("/px4_micro_xrce_dds").pack()).pack()
    client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, whole[:20]))
    last = wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT
    client.send(wire.RELIABLE, wire.pack_submessage(wire.FRAGMENT, whole[20:], last))
    world.settle()
    assert client.statuses() == [wire.OK] * 10
    assert world.agent.outbox.refused == {"fragments without an end": 1}


def test_fragments_inside_of_fragments_are_refused() -> None:
    world, client = connected()
    inner = wire.pack_submessage(wire.FRAGMENT, b"", wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT)
    for _ in range(50):
        inner = wire.pack_submessage(wire.FRAGMENT, inner, wire.LITTLE_ENDIAN | wire.LAST_FRAGMENT)
    client.send(wire.RELIABLE, inner)
    client.send(wire.BEST_EFFORT, inner)
    world.settle()
    assert sum(world.agent.outbox.refused.values()) == 2


@pytest.mark.parametrize("seed", range(10))
def test_the_fast_path_equals_the_slow_one(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A captured session over a bad network, with errors: the same events with and without the path for WRITE_DATA."""
    random = Random(seed)  # noqa: S311
    captured = sent(("session-udp", "session-namespace", "session-fragment")[seed % 3], "client")
    written = next(at for at, data in enumerate(captured) if data[4] == wire.WRITE_DATA)
    noisy = Network(0.1, 0.1, 0.1).carry(random, captured[written:])
    noisy = captured[:written] + [mutated(random, data) if random.random() < 0.2 else data for data in noisy]
    results = []
    for is_slow in (False, True):
        if is_slow:
            monkeypatch.setattr(Session, "_open_fast_path", lambda _: None)
        agent = Agent(0.0)
        for number, data in enumerate(noisy):
            agent.receive(data, ("127.0.0.1", 1), number)
        counts = agent.outbox.received, agent.outbox.late, agent.outbox.lost, agent.outbox.refused
        results.append((agent.take_events(), agent.take_outgoing(), counts))
    assert results[0] == results[1]
    assert results[0][2][1] > 0
    assert len(results[0][0]) > 70


# --- to the client


def test_what_does_not_fit_is_an_error() -> None:
    world, client = connected()
    agent = world.agent
    agent.publish(1, 2, LE + bytes(496))
    assert len(agent.take_outgoing()[0][0]) == wire.MTU
    with pytest.raises(LinkError, match="the payload has 497 bytes, and the vehicle takes up to 496"):
        agent.publish(1, 2, LE + bytes(497))
    with pytest.raises(LinkError, match="not little-endian CDR"):
        agent.publish(1, 2, b"\0\0\0\0abcd")
    for object_id in (1, 3, -1, 4096, SERVICE):
        with pytest.raises(LinkError, match="does not read object"):
            agent.publish(1, object_id, LE)
    for object_id in (1, 2, -1, 4096):
        with pytest.raises(LinkError, match="no service with object"):
            agent.call(1, object_id, 1, LE)
    with pytest.raises(LinkError, match="vehicle 2 is not connected"):
        agent.call(2, SERVICE, 1, LE)
    agent._find(1).create = agent._find(1).create._replace(mtu=0xFFFF)
    with pytest.raises(LinkError, match="the vehicle takes up to 4084"):  # a frame of a serial line holds no more
        agent.publish(1, 2, LE + bytes(4085))
    world.clients = []
    for number in range(OUTPUT_WINDOW):
        agent.call(1, SERVICE, number, LE)
    with pytest.raises(LinkError, match="does not acknowledge"):
        agent.call(1, SERVICE, 100, LE)
    assert client.samples() == []


def test_a_client_that_acknowledges_nothing_is_bounded() -> None:
    world, client = connected()
    world.clients = []
    for _ in range(50):
        client.participate()
    for data in client.outgoing:
        world.agent.receive(data, client.address, 0)
    assert len(world.agent._find(1)._output._kept) == OUTPUT_WINDOW
    assert world.agent.outbox.refused == {"too many messages without acknowledgement": 50 - OUTPUT_WINDOW}
    world.agent.take_outgoing()
    for number in range(1, 101):
        world.agent.tick(number / 100)
    beats = [data for data, _ in world.agent.take_outgoing()]
    assert 5 <= len(beats) <= 10
    assert {data[4] for data in beats} == {wire.HEARTBEAT}


def test_a_reader_that_is_created_again_has_to_ask_again() -> None:
    world, client = connected()
    client.publish(2, "fmu/in/b", entities.READER)
    world.settle()
    with pytest.raises(LinkError, match="does not read object 2"):
        world.agent.publish(1, 2, LE)
    client.read(entities.object_id(2, entities.READER))
    world.settle()
    world.agent.publish(1, 2, LE + b"x")
    world.settle()
    assert client.samples() == [b"x"]


def test_a_reply_to_another_program_is_refused() -> None:
    world, client = connected()
    object_id = entities.object_id(SERVICE, entities.REPLIER)
    for data in (bytes(24) + b"answer", bytes(23)):
        client.send(wire.RELIABLE, wire.Sample(b"\0\1", object_id, data).pack(wire.WRITE_DATA))
    world.settle()
    assert world.all(Replied) == []
    assert world.agent.outbox.refused == {"reply to a request of another program": 1, "payload too short": 1}


def test_a_reader_on_the_reliable_stream_gets_its_samples_there() -> None:
    world, client = connected()
    client.subscribe(3, "fmu/in/c", wire.RELIABLE)
    world.settle()
    world.network = Network(loss=0.3)
    for number in range(30):
        world.agent.publish(1, 3, LE + bytes([number]))
        world.run(1)
    assert client.samples() == [bytes([number]) for number in range(30)]


# --- a client's share

ASKING = {
    "TIMESTAMP": wire.Timestamp(5).pack(),
    "GET_INFO": wire.GetInfo(b"\0\1").pack(),
    "DELETE": wire.Delete(b"\0\1", b"\1\2").pack(),
    "HEARTBEAT": wire.Heartbeat(0, 0).pack(),
    "ACKNACK": wire.AckNack(8, 0xFFFF).pack(),
    "CREATE": wire.Create(b"\0\1", b"\0\x15", entities.Group(entities.WRITER, PARTICIPANT).pack()).pack(),
}
"""Submessages that are answered, each time that they are sent."""


@pytest.mark.parametrize("asking", ASKING.values(), ids=ASKING)
def test_a_datagram_has_a_bounded_number_of_replies(asking: bytes) -> None:
    world, client = connected()
    for _ in range(OUTPUT_WINDOW):  # what an ACKNACK can ask for
        world.agent.call(1, SERVICE, 1, LE)
    world.agent.take_outgoing()
    client.send(wire.NO_STREAM, *[asking] * (4000 // (len(asking) + 3)))
    world.agent.receive(client.outgoing.pop(), client.address, 0)
    assert len(world.agent.take_outgoing()) == REPLIES
    assert world.agent.outbox.refused["too many requests in a message"] > 100
    client.ping(in_session=True)
    world.settle()
    assert wire.Info.unpack(client.all(wire.INFO)[-1]).known


def test_a_client_is_answered_while_others_ask_for_more() -> None:
    """A link gives its agent up to 65 datagrams before it sends replies."""
    world, client = connected()
    hostile = Client(50002, key=2)
    world.clients.append(hostile)
    start(hostile)
    world.settle()
    for _ in range(64):
        hostile.send(wire.NO_STREAM, *[ASKING["GET_INFO"]] * 340)
        world.agent.receive(hostile.outgoing.pop(), hostile.address, 0)
    client.ping(in_session=True)
    world.settle()
    assert len(client.all(wire.INFO)) == 1 + 1
    assert "too many datagrams to send" not in world.agent.outbox.refused


def test_reliable_replies_beyond_the_bound_are_sent_later() -> None:
    client = Client()
    world = World(Agent(0.0), client)
    client.begin()
    participant = wire.Create(client.ask(), PARTICIPANT, entities.Participant("/px4_micro_xrce_dds").pack())
    client.send(wire.RELIABLE, wire.GetInfo(client.ask()).pack(), participant.pack())
    group = entities.Group(entities.PUBLISHER, PARTICIPANT).pack()
    ids = [entities.object_id(number, entities.PUBLISHER) for number in range(OUTPUT_WINDOW - 1)]
    client.send(wire.RELIABLE, *(wire.Create(client.ask(), each, group).pack() for each in ids))
    client.outgoing[1:] = reversed(client.outgoing[1:])  # so that one datagram completes the sequence
    world.settle()
    assert world.agent.outbox.refused == {"too many requests in a message": 2}
    world.run(1)
    assert client.statuses() == [wire.OK] * OUTPUT_WINDOW


def test_a_forged_address_gets_few_datagrams() -> None:
    """A sender that forges an address does not see the replies, so it acknowledges none."""
    client = Client()
    agent = Agent(0.0)
    client.begin()
    client.create(b"\0\x11", entities.Participant("/px4_micro_xrce_dds"))
    for data in client.outgoing:
        agent.receive(data, client.address, 0)
    for number in range(1, 1000):
        agent.tick(number / 10)
    replies = [data for data, _ in agent.take_outgoing()]
    assert [data[4] for data in replies] == [wire.STATUS_AGENT, wire.STATUS, wire.ACKNACK, *[wire.HEARTBEAT] * 8]
    assert sum(map(len, replies)) < 3 * sum(map(len, client.outgoing))


# --- refusals


def test_strangers_get_no_answer() -> None:
    stranger = Client()
    world = World(Agent(0.0, allow=lambda address: address[0] != "127.0.0.1"), stranger)
    start(stranger)
    stranger.write(1, b"a")
    stranger.delete()
    count = len(stranger.outgoing)
    world.settle()
    assert stranger.received == []
    assert world.agent.outbox.refused == {"address that is not allowed": count}
    assert [event.text for event in world.events if isinstance(event, Warned)] == [
        "refused 127.0.0.1: only allowed addresses may connect; add it to allow="
    ]
    assert len(world.events) == 1


def test_many_strangers_cost_little() -> None:
    agent = Agent(0.0, allow=lambda _: False)
    for number in range(1000):
        agent.receive(b"\x80\0\0\0", (f"10.0.{number // 256}.{number % 256}", 1), 0)
    assert len(agent.take_events()) == 20
    assert agent.outbox.refused == {"address that is not allowed": 1000}


def test_a_hostile_sender_cannot_use_up_the_warnings() -> None:
    def warnings() -> list[str]:
        return [event.text for event in agent.take_events() if isinstance(event, Warned)]

    def flood(network: int) -> None:
        for number in range(1000):
            agent.receive(b"\x80\0\0\0", (f"{network}.0.{number // 256}.{number % 256}", 1), 0)

    agent = Agent(0.0, allow=lambda address: address[0] == "127.0.0.1", keys={1})
    client = Client(key=2)
    client.begin()
    flood(10)
    assert len(warnings()) == 20
    agent.receive(client.outgoing[0], client.address, 0)
    assert warnings() == ["refused 127.0.0.1: key 2 is not allowed; add it to the keys in allow="]
    for second in range(70):
        flood(10)
        agent.tick(second)
    agent.take_events()
    for second in range(70, 140):
        agent.tick(second)
    agent.receive(b"\x80\0\0\0", ("192.168.0.7", 1), 0)
    assert warnings() == ["refused 192.168.0.7: only allowed addresses may connect; add it to allow="]


def test_a_key_that_is_not_allowed_gets_no_session() -> None:
    world, client = connected(Client(key=5), keys={1, 2})
    assert [part.id for part in client.received] == [wire.INFO]
    assert world.agent.outbox.refused["key that is not allowed"] == 1
    assert [event.text for event in world.events if isinstance(event, Warned)] == [
        "refused 127.0.0.1: key 5 is not allowed; add it to the keys in allow="
    ]
    world, _ = connected(Client(key=2), keys={1, 2})
    assert len(world.all(Connected)) == 1


def test_clients_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.link.xrce.session.VEHICLE", 8)  # as many entities as these have
    world, _ = connected(limits=Limits(clients=3))
    for port in range(50002, 50006):
        world.clients.append(Client(port, key=port))
        start(world.clients[-1])
    world.settle()
    assert len(world.all(Connected)) == 3
    assert world.agent.outbox.refused["too many clients"] == 2
    assert wire.StatusAgent.unpack(world.clients[-1].all(wire.STATUS_AGENT)[0]).status == wire.ERR_RESOURCES
    assert [event.text for event in world.all(Warned)] == [
        "refused 127.0.0.1: 3 vehicles are connected, the most for a port"
    ]
    world.run(6)  # silent clients make room
    client = Client(50010, key=10)
    world.clients = [client]
    start(client)
    world.settle()
    assert len(world.all(Connected)) == 4
    assert len(world.agent._sessions) == 3


def forge(port: int, entities_each: int = 10) -> Client:
    """Return a forged client that has begun a session and created some entities, and its datagrams."""
    client = Client(port, key=port)
    client.begin()
    client.participate()
    for number in range(1, 1 + entities_each // 3):
        client.publish(number)
    return client


@pytest.mark.parametrize("steps", [150, pytest.param(600, marks=pytest.mark.night)])
def test_a_vehicle_finds_a_place_among_forged_sessions_that_go_on_sending(steps: int) -> None:
    """It first synchronises its clock, and creates its entities seconds later."""
    world = World(Agent(0.0), *(forge(port) for port in range(40000, 40200)))
    world.settle()
    vehicle = Client(50001)
    forged, world.clients = world.clients, [*world.clients, vehicle]
    vehicle.begin()
    vehicle.participate()
    for time in range(steps):  # of 10 ms
        vehicle.send(wire.NO_STREAM, wire.Timestamp(time).pack())
        for client in forged[time % 10 :: 10]:
            client.write(1, b"forged")
            client.send(wire.NO_STREAM, wire.Timestamp(time).pack())
            client.begin()
        world.settle()
        world.agent.tick(time / 100)
    assert len(vehicle.all(wire.TIMESTAMP_REPLY)) == steps
    for number in range(1, 12):
        vehicle.publish(number)
    world.settle()
    for number in range(200):  # neither do new ones take its place, when it is not heard for a while
        client = forge(41000 + number)
        world.clients = [client]
        world.settle()
    world.clients = [vehicle]
    vehicle.write(1, b"genuine")
    world.settle()
    assert world.all(Sample)[-1].payload == LE + b"genuine"
    reasons = {event.reason for event in world.all(Disconnected) if event.remote.key == 1}
    assert reasons == set()


def test_a_vehicle_that_is_heard_keeps_its_place_and_one_that_sleeps_does_not() -> None:
    world = World(Agent(0.0, limits=Limits(clients=2)), forge(50001, 40), forge(50002, 40))
    world.settle()
    first, second = world.clients
    second.write(1, b"a")
    world.run(4)
    second.write(1, b"a")
    world.run(2)
    new = Client(50003, key=3)
    world.clients.append(new)
    start(new)
    world.settle()
    assert [event.remote.key for event in world.all(Disconnected)] == [50001]
    assert {address[1] for address in world.agent._sessions} == {50002, 50003}
    assert first.all(wire.STATUS_AGENT)


def crowd(count: int, network: str, *, is_writing: bool = True) -> World:
    """Return an agent with clients that have the entities of a vehicle. Those of a network have the same host.

    With "10.0.{}.1" each has a host of its own.
    """
    clients = [forge(40000 + number, 36) for number in range(count)]
    for number, client in enumerate(clients):
        client.address = network.format(number), client.key
        if is_writing:
            client.write(1, bytes(4))
    world = World(Agent(0.0), *clients)
    world.settle()
    return world


def go_on(world: World, rounds: int, *others: Client) -> None:
    """Let all clients of a world send a sample every 0.1 s, and others send something."""
    crowded = world.clients
    world.clients = [*crowded, *others]
    for _ in range(rounds):
        for client in crowded:
            client.write(1, bytes(4))
        for client in others:
            client.send(wire.NO_STREAM, wire.Timestamp(1).pack())
        world.run(0.1)


def test_a_vehicle_finds_a_place_among_forged_ones_that_only_keep_their_sessions() -> None:
    world = crowd(64, "127.0.0.1", is_writing=False)
    forged = world.clients
    world.run(1)
    vehicle = Client(50001)
    vehicle.begin()
    world.clients = [vehicle]
    world.settle()
    world.clients = [*forged, vehicle]
    for time in range(100):
        vehicle.send(wire.NO_STREAM, wire.Timestamp(1).pack())
        for client in forged if time % 20 == 0 else ():
            client.ping(in_session=True)
            client.write(9, bytes(4))  # of no writer
        world.run(0.1)
    assert len(vehicle.all(wire.TIMESTAMP_REPLY)) == 100


def test_a_host_leaves_eight_places_to_others() -> None:
    world = crowd(64, "10.0.0.1")
    forged = world.clients
    vehicles = [Client(50001) for _ in range(8)]
    for number, vehicle in enumerate(vehicles):
        vehicle.address = f"10.0.1.{number}", 50001
        vehicle.begin()
    world.clients = vehicles
    world.settle()
    for time in range(60):
        world.clients = forged
        begins = Client(41000 + time)
        begins.address = "10.0.0.1", 41000 + time
        begins.begin()
        go_on(world, 1, *vehicles, begins)
    assert [len(vehicle.all(wire.TIMESTAMP_REPLY)) for vehicle in vehicles] == [60] * 8
    hosts = [address[0] for address in world.agent._sessions]
    assert hosts.count("10.0.0.1") == 56


def test_a_fleet_on_one_host_keeps_its_places() -> None:
    world = crowd(56, "10.0.0.1")
    fleet = world.clients
    for time in range(40):
        strangers = [forge(41000 + number, 36) for number in range(5 * time, 5 * time + 5)]
        for number, client in enumerate(strangers):
            client.address = f"10.1.{time}.{number}", client.key
        world.clients = fleet
        go_on(world, 1, *strangers)
    assert len(world.agent._sessions) == 64
    assert {event.remote.address for event in world.all(Disconnected)}.isdisjoint(
        f"{client.address[0]}:{client.address[1]}" for client in fleet
    )


def test_a_vehicle_of_another_host_keeps_its_place_before_it_has_entities() -> None:
    """Of the clients with few entities, one of the host with the most sessions gives way."""
    vehicle = Client(50001)
    world = World(Agent(0.0), vehicle)
    vehicle.begin()
    world.settle()
    for number in range(200):
        client = Client(40000 + number)
        client.address = "10.0.0.1", client.key
        client.begin()
        world.clients = [client]
        world.settle()
    assert vehicle.address in world.agent._sessions


def test_vehicles_of_many_hosts_keep_their_places() -> None:
    world = crowd(64, "10.0.{}.1")
    vehicle = Client(50001)
    vehicle.begin()
    go_on(world, 20, vehicle)
    assert world.all(Disconnected) == []
    assert vehicle.all(wire.TIMESTAMP_REPLY) == []


def test_entities_are_bounded() -> None:
    world, client = connected(limits=Limits(entities=10))
    for number in range(10, 15):
        client.create(entities.object_id(number, entities.PUBLISHER), entities.Group(entities.PUBLISHER, PARTICIPANT))
    world.settle()
    assert client.statuses()[8:] == [wire.OK, wire.OK, *[wire.ERR_RESOURCES] * 3]
    assert world.agent.outbox.refused == {"too many entities": 3}


def test_routes_of_deleted_entities_are_bounded() -> None:
    """A listener keeps the routes of a session, also those whose entities are gone."""
    world, client = connected(limits=Limits(entities=20))
    before = len(world.all(Opened))
    for number in range(100):
        client.publish(9, f"fmu/out/{number}")
        client.delete(entities.object_id(9, entities.PUBLISHER))
        client.delete(entities.object_id(9, entities.TOPIC))
        world.settle()
    assert 5 < len(world.all(Opened)) - before < 4 * 20
    assert world.agent.outbox.refused["too many entities"] > 100


@pytest.mark.parametrize("name", ["a\nb", "x" * 300, "\x1b[31m", "a b", "ä"])
def test_names_are_checked(name: str) -> None:
    world, client = connected()
    client.publish(5, name)
    world.settle()
    assert client.statuses()[8:] == [wire.ERR_INVALID_DATA, wire.OK, wire.ERR_UNKNOWN_REFERENCE]
    assert len(world.all(Opened)) == 3


def test_entities_need_their_parents_and_topics() -> None:
    client = Client()
    world = World(Agent(0.0), client)
    client.begin()
    client.publish(1)
    client.participate()
    client.create(b"\0\x15", entities.Endpoint(entities.WRITER, b"\0\x12", PARTICIPANT))
    client.read(b"\0\x26")
    world.settle()
    unknown = wire.ERR_UNKNOWN_REFERENCE
    assert client.statuses() == [unknown, unknown, unknown, wire.OK, unknown, unknown]
    assert world.all(Opened) == []


def test_replace_and_reuse() -> None:
    world, client = connected()
    topic = entities.object_id(1, entities.TOPIC)
    same = entities.TopicEntity("rt/fmu/out/a", "px4_msgs::msg::dds_::A_", PARTICIPANT)
    for entity, flags in itertools.product((same, same._replace(name="rt/z")), (1, 1 | wire.REUSE, 1 | wire.REPLACE)):
        client.create(topic, entity, flags)
        world.settle()
    exists = wire.ERR_ALREADY_EXISTS
    assert client.statuses()[8:] == [exists, wire.OK, wire.OK, exists, exists, wire.OK]
    client.publish(1)
    world.settle()
    assert world.all(Opened)[3:] == []
    client.publish(1, "fmu/out/new")
    world.settle()
    assert [event.route.name for event in world.all(Opened)[3:]] == ["/fmu/out/new"]


def test_delete_removes_an_entity_and_its_parts() -> None:
    world, client = connected()
    client.delete(entities.object_id(1, entities.PUBLISHER))
    client.delete(entities.object_id(1, entities.PUBLISHER))
    client.write(1, b"a")
    world.settle()
    assert client.statuses()[8:] == [wire.OK, wire.ERR_UNKNOWN_REFERENCE]
    assert world.agent.routes(1) == [READ, SERVED]
    client.delete(PARTICIPANT)
    world.settle()
    assert world.agent.routes(1) == []
    assert world.agent.outbox.refused == {"DELETE of an unknown entity": 1, "data of an unknown entity": 1}
    assert len(world.agent._find(1).inventory) == 0


@pytest.mark.parametrize(
    ("stream", "text", "reason"),
    [
        (0, "07 00 0400 00010015", "big-endian submessage"),
        (1, "07 01 ffff 00010015", "submessage longer than its message"),
        (1, "07 03 0800 00010015 00000000", "data of another format than plain data"),
        (1, "07 01 0800 00010f05 00000000", "data of an unknown entity"),
        (1, "07 01 0200 0001", "payload too short"),
        (2, "07 01 0400 00010015", "unknown stream"),
        (0, "05 01 0600 00010015 0000", "submessage that an agent does not take"),
        (0, "63 01 0000", "submessage that an agent does not take"),
        (0, "0a 01 0500 0000 0000 81", "unknown stream"),
        (0, "0b 01 0500 0000 0000 01", "unknown stream"),
        (0, "02 01 0800 0001 0011 02000000", "GET_INFO of something else than the agent"),
        (0, "0d 03 0000", "fragment outside of a reliable stream"),
    ],
)
def test_what_is_malformed_is_refused_with_a_reason(stream: int, text: str, reason: str) -> None:
    world, client = connected()
    client.send(stream, bytes.fromhex(text))
    world.settle()
    assert world.agent.outbox.refused == {reason: 1}
    assert len(world.events) == 4


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("80", "message shorter than its header"),
        ("00 00 0000", "message shorter than its header"),
        ("80 00 0000", "message without a submessage"),
        ("80 00 0000 03 01 0000", "submessage that needs a session"),
        ("80 00 0000 00 01 1000 58524346 0100 010f 00000001 81 00 fc01", "wrong cookie"),
        ("80 00 0000 00 01 1000 58524345 0200 010f 00000001 81 00 fc01", "unknown version of the protocol"),
        ("80 00 0000 00 01 1000 58524345 0100 010f 00000001 80 00 fc01", "wrong session id or key"),
        ("81 01 0000 07 01 0400 00010015", "message of an unknown session"),
        ("81 00 0000 0e 01 0800 0000000000000000", "message of an unknown session"),
        ("00" * 5000, "message beyond the limit"),
    ],
)
def test_a_stranger_that_is_malformed_is_refused_with_a_reason(text: str, reason: str) -> None:
    agent = Agent(0.0)
    agent.receive(bytes.fromhex(text), ("127.0.0.1", 1), 0)
    assert agent.outbox.refused == {reason: 1}
    is_told = reason == "message of an unknown session"
    assert (len(agent.take_events()), agent.take_outgoing(), agent._sessions) == (is_told, [], {})
