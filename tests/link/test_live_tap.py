"""Tests of the tap. A link over UDP stands for the real agent: both must see what the client sends."""

from __future__ import annotations

import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link import tap
from msggen.link.age import LONGEST_S, NEVER
from msggen.link.link import LinkError, Route, Service
from msggen.link.tap import Shift, TapLink
from msggen.link.udp import UdpLink
from support import xrce_captures
from support.link_records import Records, nothing_is_left
from support.replay import (
    DATA,
    DELETE,
    GET_INFO,
    INFO,
    STATUS_AGENT,
    WRITE_DATA,
    Client,
    creation,
    kind,
    sample,
    sent,
)

LINKS = ["session-udp", "session-namespace", "session-fragment", "session-service"]

TOPICS = 66
"""Those of the client of `session-udp`."""


@contextmanager
def tapped(**options: Any) -> Iterator[tuple[UdpLink, Records, TapLink, Records]]:
    """Run an agent and a tap in front of it, and give both with what they tell."""
    agent, theirs, ours = UdpLink(port=0), Records(), Records()
    agent.start(theirs)
    link = TapLink(port=0, agent=("127.0.0.1", agent.port), **options)
    try:
        link.start(ours)
        yield agent, theirs, link, ours
    finally:
        link.close()
        agent.close()


def connect(client: Client, *records: Records) -> None:
    """Let a client begin a session, and wait until all that listen have its routes."""
    counts = [len(each.remotes) for each in records]
    client.play(creation("session-udp"))

    def is_connected(each: Records, count: int) -> bool:
        opened = [remote for remote, _ in each.opened_routes if remote == each.remotes[-1]]
        return len(each.remotes) > count and len(opened) >= TOPICS

    for each, count in zip(records, counts, strict=True):
        each.wait(partial(is_connected, each, count))


def in_route(records: Records) -> Route:
    route = records.route("/fmu/in/trajectory_setpoint")
    assert isinstance(route, Route)
    return route


@pytest.mark.parametrize("name", LINKS)
def test_agent_and_program_see_the_same_and_the_client_gets_the_agents_answers(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with nothing_is_left(), tapped() as (agent, theirs, link, ours), Client(link.port) as client:
        told: list[bytes] = []
        transmit = agent.transmit

        def record(datagrams: list[tuple[bytes, Any]], until: int = NEVER) -> None:
            told.extend(data for data, _ in datagrams)
            transmit(datagrams, until)

        monkeypatch.setattr(agent, "transmit", record)
        client.play(sent(name))
        theirs.wait(lambda: theirs.gone)
        ours.wait(lambda: ours.gone)
        answers = client.received()
        for field in ("route", "payload"):
            assert [getattr(each, field) for each in ours.samples] == [getattr(each, field) for each in theirs.samples]
        assert [route for _, route in ours.opened_routes] == [route for _, route in theirs.opened_routes]
        assert ours.remotes[0].address == client.address
        assert ours.remotes[0].namespace == theirs.remotes[0].namespace
        assert ours.remotes[0].address != theirs.remotes[0].address
        assert ours.warnings == []
        assert answers == told


@contextmanager
def real_agent() -> Iterator[tuple[UdpLink, Records]]:
    link, records = UdpLink(port=0), Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


def test_samples_of_agent_and_program_share_the_stream() -> None:
    with tapped() as (agent, theirs, link, ours), Client(link.port) as client:
        connect(client, theirs, ours)
        client.received()

        def publish(who: Any, records: Records, name: bytes) -> None:
            for number in range(100):
                who.publish(records.remotes[0], in_route(records), b"\0\1\0\0" + name + struct.pack("<Q", number))
                time.sleep(0.0005)

        threads = [
            threading.Thread(target=publish, args=(agent, theirs, b"theirs  ")),
            threading.Thread(target=publish, args=(link, ours, b"ours    ")),
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        found = [data for data in client.received() if kind(data) == DATA]
        assert [struct.unpack_from("<H", data, 2)[0] for data in found] == list(range(200))
        for name in (b"theirs  ", b"ours    "):
            numbers = [struct.unpack_from("<Q", data, 20)[0] for data in found if data[12:20] == name]
            assert numbers == list(range(100))


def test_a_new_session_counts_from_the_start() -> None:
    with tapped() as (agent, theirs, link, ours), Client(link.port) as client:
        for _ in range(3):
            connect(client, theirs, ours)
            link.publish(ours.remotes[-1], in_route(ours), b"\0\1\0\0" + b"1" * 8)
            agent.publish(theirs.remotes[-1], in_route(theirs), b"\0\1\0\0" + b"2" * 8)
            found = [data for data in client.received() if kind(data) == DATA]
            assert [(data[2], data[12:13]) for data in found] == [(0, b"1"), (1, b"2")]
            client.play([data for data in sent("session-udp") if kind(data) == DELETE])
            ours.wait(lambda: len(ours.gone) == len(ours.remotes))


@contextmanager
def bare_tap() -> Iterator[tuple[socket.socket, TapLink, Records]]:
    """Run a tap in front of a socket that stands for the agent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as agent:
        agent.bind(("127.0.0.1", 0))
        agent.settimeout(20)
        link, records = TapLink(port=0, agent=agent.getsockname()), Records()
        link.start(records)
        try:
            yield agent, link, records
        finally:
            link.close()


def test_datagrams_that_nobody_understands_are_forwarded_untouched() -> None:
    odd = [b"", b"\x7f", b"abc", b"\x81\x01\x00", b"\x05\x01\x00\x00keys" + bytes(9), bytes(1400), b"\x81\x02\x07\x00?"]
    with bare_tap() as (agent, link, _), Client(link.port) as client:
        for data in odd:
            client.socket.send(data)
            forwarded, source = agent.recvfrom(65536)
            assert forwarded == data
            agent.sendto(data, source)
            client.socket.settimeout(20)
            assert client.socket.recv(65536) == data
        with Client(link.port) as other:
            other.socket.send(b"x")
            assert agent.recvfrom(65536)[1] != source


def test_a_tap_that_restarts_gets_the_client_again() -> None:
    """The agent does not know the address that the client has now, so that it lets the client connect anew."""
    running = [data for data in sent("session-udp") if kind(data) in {GET_INFO, WRITE_DATA} and data[0] == 0x81]
    with tapped() as (_, theirs, link, ours), Client(link.port) as client:
        client.play(running)
        ours.wait(lambda: ours.warnings)
        theirs.wait(lambda: theirs.warnings)
        assert "has a session with an earlier program" in ours.warnings[0]
        infos = [data for data in client.received() if kind(data) == INFO]
        assert infos
        assert not any(data[13] for data in infos), "the session is not known"
        assert theirs.remotes == ours.remotes == []
        connect(client, theirs, ours)


def test_an_agent_that_restarts_gets_the_client_again() -> None:
    with tapped() as (agent, theirs, link, ours), Client(link.port) as client:
        connect(client, theirs, ours)
        agent.close()
        client.play([sample(number, bytes(16)) for number in range(10)])
        ours.wait(lambda: len(ours.samples) == 10)
        ours.wait(lambda: ours.warnings or client.socket.send(sample(len(ours.samples), bytes(16))) < 0)
        (warning,) = ours.warnings
        assert f"no agent answers at 127.0.0.1:{agent.port}" in warning
        again, others = UdpLink(port=agent.port), Records()
        again.start(others)
        try:
            connect(client, others, ours)
        finally:
            again.close()


def test_a_service_cannot_be_called() -> None:
    with tapped() as (_, theirs, link, ours), Client(link.port) as client:
        connect(client, theirs, ours)
        service = ours.route("/fmu/vehicle_command")
        assert isinstance(service, Service)
        with pytest.raises(LinkError, match="cannot be called through a tap: publish VehicleCommand"):
            link.call(ours.remotes[0], service, 1, b"\0\1\0\0" + bytes(56))


def test_strangers_are_not_forwarded() -> None:
    with tapped(allow=["10.0.0.0/8"]) as (agent, theirs, link, ours), Client(link.port) as client:
        client.play(creation("session-udp"))
        assert client.received() == []
        assert link.statistics().refused == len(creation("session-udp"))
        assert agent.statistics().received == 0
        assert theirs.remotes == ours.remotes == []


def test_clients_beyond_the_bound_are_ignored_and_silent_ones_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tap, "MAX_CLIENTS", 2)
    monkeypatch.setattr(tap, "SILENT", 0.3)
    with tapped() as (_, theirs, link, ours), ExitStack() as stack:
        clients = [stack.enter_context(Client(link.port)) for _ in range(3)]
        for client in clients:
            client.socket.send(sent("session-udp")[0])
        ours.wait(lambda: ours.warnings)
        assert "more than 2 clients" in ours.warnings[0]
        assert [len(client.received(0.2)) for client in clients] == [1, 1, 0]
        time.sleep(0.2)
        connect(clients[2], theirs, ours)
        assert len(link._clients) == 2


def test_an_agent_is_not_missed_because_a_client_made_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """The agent's answer to a client and the datagram of the client that takes its place arrive at the same time."""
    monkeypatch.setattr(tap, "MAX_CLIENTS", 1)
    monkeypatch.setattr(tap, "SILENT", 0.0)
    for _ in range(5):
        with bare_tap() as (agent, link, records), Client(link.port) as old, Client(link.port) as new:
            old.socket.send(b"old")
            _, source = agent.recvfrom(65536)
            with link.lock:  # the thread waits for it when it has taken the next datagram
                old.socket.send(b"old")
                time.sleep(0.05)
                new.socket.send(b"new")
                agent.sendto(b"answer", source)
                time.sleep(0.05)
            new.socket.send(b"new")
            records.wait(lambda: len(link._clients) == 1)
            assert {agent.recvfrom(65536)[0] for _ in range(3)} == {b"old", b"new"}
        assert records.warnings == []


def test_a_datagram_that_cannot_be_sent_now_is_not_the_agents_absence(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full:
        def __init__(self, error: OSError) -> None:
            self.error = error

        def send(self, _data: bytes) -> int:
            raise self.error

    with bare_tap() as (agent, link, records), Client(link.port) as client:
        client.socket.send(b"first")
        agent.recvfrom(65536)
        (known,) = link._clients.values()
        for error in (BlockingIOError(), OSError(101, "Network is unreachable")):
            monkeypatch.setattr(known, "socket", Full(error))
            refused = link.statistics().refused
            client.socket.send(b"second")
            records.wait(lambda refused=refused: link.statistics().refused > refused)  # type: ignore[misc]
            monkeypatch.undo()
        records.wait(lambda: records.warnings)
        host, port = agent.getsockname()
        assert records.warnings == [f"cannot send to the agent at {host}:{port}: Network is unreachable"]


def test_silent_clients_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tap, "FORGET", 0.2)
    with tapped() as (_, theirs, link, ours), Client(link.port) as client:
        connect(client, theirs, ours)
        ours.wait(lambda: not link._clients)
        connect(client, theirs, ours)


def test_tap_and_agent_at_one_address_are_an_error() -> None:
    with real_agent() as (agent, _), pytest.raises(LinkError, match="in use"):
        TapLink(port=agent.port, agent=("127.0.0.1", agent.port)).start(Records())
    with nothing_is_left(), pytest.raises(LinkError, match="cannot both be at"):
        TapLink(port=agent.port, agent=("127.0.0.1", agent.port)).start(Records())
    with nothing_is_left(), pytest.raises(LinkError, match=r"cannot both be at 0\.0\.0\.0"):  # it would send to itself
        TapLink("0.0.0.0", port=agent.port, agent=("127.0.0.1", agent.port)).start(Records())  # noqa: S104
    with nothing_is_left(), pytest.raises(LinkError, match="no IPv4 address"):
        TapLink(port=0, agent=("no such host", 1)).start(Records())


@given(st.lists(st.one_of(st.none(), st.integers(0, 3)), max_size=300), st.integers(0, 0xFFFF))
def test_numbers_stay_newer_than_the_last_across_the_wrap(steps: list[int | None], first: int) -> None:
    """The agent sends with gaps, the program adds (None): what was new stays new and gaps stay gaps."""
    shift = Shift()
    sequence = first
    last = int.from_bytes(shift.forward(sample(sequence, b""))[2:4], "little")
    assert last == first
    for step in steps:
        if step is None:
            expected, data = 1, shift.add(sample(0, b"added"))
            assert data[4:] == sample(0, b"added")[4:]
        else:
            sequence = (sequence + step) & 0xFFFF
            expected, data = step, shift.forward(sample(sequence, b"sent"))
            if step == 0:
                continue  # doubled or late: the client drops it, or would have
        number = int.from_bytes(data[2:4], "little")
        assert (number - last) & 0xFFFF == expected
        last = number


def test_only_the_best_effort_stream_is_changed() -> None:
    shift = Shift()
    session = [data for data in xrce_captures.sent("session-service", "agent") if kind(data) != STATUS_AGENT]
    for _ in range(5):
        shift.add(sample(0, b""))
    for data in session:
        changed = shift.forward(data)
        if data[1] == 1:
            assert (int.from_bytes(changed[2:4], "little") - int.from_bytes(data[2:4], "little")) & 0xFFFF == 5
            assert (changed[:2], changed[4:]) == (data[:2], data[4:])
        else:
            assert changed == data
    assert any(data[1] == 1 for data in session)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when a datagram has arrived")
def test_what_waited_for_a_tap_that_stood_still_is_dropped() -> None:
    with tapped() as (agent, theirs, link, ours), Client(link.port) as client:
        connect(client, theirs, ours)
        client.received()
        with link.lock:  # the thread of the tap waits for it, as if the process stood still
            for number in range(20):
                agent.publish(theirs.remotes[0], in_route(theirs), b"\0\1\0\0" + struct.pack("<Q", number))
            time.sleep(LONGEST_S + 0.1)
        ours.wait(lambda: link.statistics().unsent >= 19)
        agent.publish(theirs.remotes[0], in_route(theirs), b"\0\1\0\0" + struct.pack("<Q", 99))
        found = [struct.unpack_from("<Q", data, 12)[0] for data in client.received() if kind(data) == DATA]
        assert found[-1] == 99
        assert set(found) <= {0, 99}, "the first one may have been under way"
