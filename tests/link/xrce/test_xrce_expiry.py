"""Tests of messages that an agent keeps for a client until they expire."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msggen.link.age import NEVER
from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.outbox import Address, Outbox

if TYPE_CHECKING:
    import pytest

from support.xrce_client import PERFECT, SERVICE, Client, Network, World, connected


def test_what_has_expired_is_not_sent_again() -> None:
    time = 0
    world, client = connected(Client(), Agent(0.0, clock=lambda: time))
    client.subscribe(3, "fmu/in/c", wire.RELIABLE)
    world.settle()
    world.network = Network(loss=1.0)
    world.agent.publish(1, 3, b"\0\1\0\0" + bytes(8), 10)
    world.agent.call(1, SERVICE, 1, b"\0\1\0\0" + bytes(8), 20)
    world.run(0.3)
    world.network = PERFECT
    time = 15
    world.run(0.5)
    assert len(client.samples()) == 1, "the request, whose caller still waits"
    assert world.agent.outbox.expired == 1
    world.agent.call(1, SERVICE, 2, b"\0\1\0\0" + bytes(8), 20)
    world.settle()
    assert len(client.samples()) == 2, "no number of the stream is missing"


def test_what_is_sent_again_keeps_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[int] = []
    send = Outbox.send

    def record(self: Outbox, data: bytes, address: Address, until: int = NEVER) -> None:
        if wire.has_data(data):
            sent.append(until)
        send(self, data, address, until)

    monkeypatch.setattr(Outbox, "send", record)
    world, client = connected(Client(), Agent(0.0, clock=lambda: 0))
    client.subscribe(3, "fmu/in/c", wire.RELIABLE)
    world.settle()
    world.network = Network(loss=1.0)
    world.agent.publish(1, 3, b"\0\1\0\0" + bytes(8), 10)
    world.agent.call(1, SERVICE, 1, b"\0\1\0\0" + bytes(8), 20)
    world.run(0.3)
    assert sent == [10, 20]
    world.network = PERFECT
    world.run(0.5)
    assert (len(sent) > 2, {*sent[2:]}) == (True, {10, 20})
    assert len(client.samples()) == 2


def test_what_waits_for_the_number_of_a_continued_session_expires() -> None:
    time = 0
    world, client = connected(Client())
    (record,) = (record for _, record in settled_records(world) if record is not None)
    agent = Agent(0.0, records=[record], clock=lambda: time)
    world = World(agent, client)
    client.outgoing.clear()
    client.ping(in_session=True)
    packets, client.outgoing = client.outgoing, []
    for data in packets:
        agent.receive(data, client.address, 0)
    questions = agent.take_outgoing()
    agent.call(1, SERVICE, 1, b"\0\1\0\0" + bytes(8), 10)
    agent.call(1, SERVICE, 2, b"\0\1\0\0" + bytes(8), 1000)
    time = 11
    client.received.clear()
    for data, _ in questions:
        client.receive(data)
    world.settle()
    assert len(client.samples()) == 1
    assert agent.outbox.expired == 1


def settled_records(world: World) -> list[Any]:
    """Return the records of sessions in which nothing has changed since the last look."""
    world.agent.take_records()
    return world.agent.take_records()
