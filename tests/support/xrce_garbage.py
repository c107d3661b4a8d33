"""Hostile datagrams for an agent: random ones, and mutations of captured ones.

`python tests/support/xrce_garbage.py 1000000` gives an agent a million of them and prints the refusals.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from random import Random

if __name__ == "__main__":
    from pathlib import Path

    sys.path[0:1] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2])]

from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.limits import Limits
from msggen.link.xrce.streams import INPUT_WINDOW, OUTPUT_WINDOW
from support.xrce_captures import SESSIONS, sent

SPECIAL = (0, 1, 2, 3, 4, 5, 7, 8, 0x0D, 0x7F, 0x80, 0x81, 0xFF)
ADDRESSES = 50


def mutated(random: Random, data: bytes) -> bytes:
    """Return a datagram with some bytes changed, cut, doubled or added."""
    changed = bytearray(data)
    for _ in range(random.choice((0, 0, 1, 1, 2, 5))):
        at = random.randrange(len(changed) + 1)
        action = random.randrange(5)
        if action == 0:
            del changed[at:]
        elif action == 1:
            changed[at:at] = changed[: random.randrange(60)]
        elif action == 2 and at < len(changed):
            changed[at] = random.randrange(256)
        elif at < len(changed):
            changed[at] = random.choice(SPECIAL)
    return bytes(changed)


def datagrams(random: Random) -> Iterator[tuple[bytes, tuple[str, int]]]:
    """Yield datagrams with their senders, without an end."""
    captured = [data for name in SESSIONS for data in sent(name, "client") + sent(name, "agent")]
    beginnings = [sent(name, "client")[: 2 + 4 * 40] for name in SESSIONS]
    joined = wire.HEADER.pack(0x81, 0x80, 0)
    while True:
        address = "127.0.0.1", random.randrange(ADDRESSES)
        choice = random.random()
        if choice < 0.02:  # a session in order, with an error now and then
            for data in random.choice(beginnings)[: random.randrange(160)]:
                yield (mutated(random, data) if random.random() < 0.05 else data), address
        elif choice < 0.05:  # a message that is a sequence of submessages
            parts = (random.choice(captured)[4:] for _ in range(random.randrange(12)))
            yield joined[:1] + bytes((random.choice((0, 1, 0x80)), random.randrange(8), 0)) + b"".join(parts), address
        elif choice < 0.95:
            yield mutated(random, random.choice(captured)), address
        else:
            yield random.randbytes(random.randrange(80)), address


def check(agent: Agent, limits: Limits) -> None:
    """Check that the state of an agent is within its limits."""
    assert len(agent._sessions) <= limits.clients
    assert len(agent._ended) <= limits.clients
    assert len(agent._dropped) <= limits.clients
    assert len(agent._connected) <= limits.clients
    assert all(len(told) <= 20 for _, told in agent._warned.values())
    assert len(agent.outbox.refused) < 50
    for session in agent._sessions.values():
        inventory = session.inventory
        assert len(inventory) <= limits.entities
        assert len(inventory._readers) + len(inventory.writers) <= limits.entities
        assert len(inventory.readings) <= limits.entities
        assert sum(map(len, session.journal.parts or ())) <= limits.record
        assert len(session._waiting or ()) <= OUTPUT_WINDOW
        assert len(session.input._waiting) < INPUT_WINDOW
        assert len(session._output._kept) <= OUTPUT_WINDOW
        assert len(session._fragments._joined) <= limits.fragments


def attack(count: int, seed: int = 1) -> Counter[str]:
    """Give an agent datagrams; return the refusals, and under `accepted` and `events` how much went through."""
    random = Random(seed)  # noqa: S311
    limits = Limits(clients=20, entities=100, outgoing=50, fragments=5000)
    agent = Agent(0.0, limits=limits)
    now = 0.0
    events = 0
    for number, (data, address) in zip(range(count), datagrams(random), strict=False):
        agent.receive(data, address, random.choice((0, 1, -1, 2**64)))
        events += len(agent.take_events())
        assert len(agent.take_outgoing()) <= limits.outgoing
        if number % 50 == 0:
            now += random.choice((0.0, 0.1, 0.1, 1.0, -5.0, 1e9))
            agent.tick(now)
        if number % 1000 == 0:
            check(agent, limits)
    check(agent, limits)
    return agent.outbox.refused + Counter(accepted=agent.outbox.received, events=events, late=agent.outbox.late)


if __name__ == "__main__":
    for reason, times in attack(int(sys.argv[1])).most_common():
        print(f"{times:9,} {reason}")
