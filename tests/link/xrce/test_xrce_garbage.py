"""Hostile datagrams: no exception, bounded state, and sessions that still begin."""

from __future__ import annotations

from random import Random

import pytest

from msggen.link.link import Connected
from msggen.link.xrce.agent import Agent
from support.xrce_client import Client, connected, start
from support.xrce_garbage import attack, datagrams, mutated


@pytest.mark.parametrize("count", [10_000, pytest.param(100_000, marks=pytest.mark.night)])
def test_garbage_is_refused_and_bounded(count: int) -> None:
    result = attack(count)
    assert result["accepted"] > count // 10
    assert result["events"] > count // 20
    assert result["message of an unknown session"] > count // 100
    assert len(result) > 25


def test_a_session_begins_amid_garbage() -> None:
    agent = Agent(0.0)
    garbage = datagrams(Random(2))  # noqa: S311
    client = Client(60_000, key=77)
    start(client)
    packets, client.outgoing = client.outgoing, []
    for data in packets:
        for _, (noise, address) in zip(range(20), garbage, strict=False):
            agent.receive(noise, address, 0)
        agent.receive(data, client.address, 0)
    events = agent.take_events()
    assert 77 in {event.remote.key for event in events if isinstance(event, Connected)}
    number = next(event.remote.number for event in events if isinstance(event, Connected) and event.remote.key == 77)
    assert len(agent.routes(number)) == 3


@pytest.mark.parametrize("seed", range(3))
def test_a_client_that_sends_errors_keeps_its_session(seed: int) -> None:
    """Messages of its own session, with errors, on the streams without order."""
    world, client = connected()
    random = Random(seed)  # noqa: S311
    for number in range(2000):
        client.write(1, bytes(8))
        if number % 2:
            client.outgoing[-1] = client.outgoing[-1][:4] + mutated(random, client.outgoing[-1][4:])[:100]
        world.carry()
    assert sum(world.agent.outbox.refused.values()) > 200
    client.received.clear()
    world.agent.publish(1, 2, b"\0\1\0\0" + b"data")
    world.settle()
    assert client.samples() == [b"data"]
