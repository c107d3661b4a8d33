"""PX4's client in captures, answered by our agent: events and answers equal those that were measured."""

from __future__ import annotations

from collections import Counter, defaultdict
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
    Service,
    Warned,
)
from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.framing import Deframer, pack_frame
from msggen.link.xrce.outbox import Address
from support import xrce_reference as reference
from support.xrce_captures import SESSIONS, Row, expected, load, rows, sent

PORT = ("127.0.0.1", 50001)
OTHER_PORT = ("127.0.0.1", 50002)


class Replay:
    """An agent that gets the client's datagrams of a capture."""

    def __init__(self, now: float = 0.0) -> None:
        self.agent = Agent(now)
        self.now = now
        self.events: list[Event] = []
        self.answers: list[tuple[bytes, Address]] = []

    def feed(self, captured: list[Row]) -> None:
        for row in captured:
            while self.now < row.time:
                self.now += 0.1
                self.agent.tick(self.now)
            if row.sender == "client":
                self.agent.receive(row.data, OTHER_PORT if row.port else PORT, int(row.time * 1e9))
            self.events += self.agent.take_events()
            self.answers += self.agent.take_outgoing()

    def all(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


def replay(name: str) -> Replay:
    done = Replay()
    done.feed(rows(name))
    return done


def compared(datagrams: list[tuple[bytes, Address]]) -> Counter[tuple[str, Address]]:
    """Return the answers that can be compared: DATA and TIMESTAMP_REPLY depend on publishers and clocks."""
    return Counter(
        (data.hex(), address) for data, address in datagrams if data[4] not in (wire.DATA, wire.TIMESTAMP_REPLY)
    )


STATUS_OF_DELETE = "8100000005010600 0002fffe 0000".replace(" ", "")
HEARTBEAT, ACKNACK = "810000000b01", "810000000a01"
INFO = "8100000006011c00"

DIFFERENCES = {
    STATUS_OF_DELETE: "The real agent answers after it has removed all endpoints. The recording had ended before.",
}
"""Beginnings of datagrams that only our agent sends, with the reason."""


@pytest.mark.parametrize("name", SESSIONS)
def test_our_answers_are_those_of_the_real_agent(name: str) -> None:
    ours = compared(replay(name).answers)
    theirs = compared([(data, PORT) for data in sent(name, "agent")])
    assert theirs - ours == Counter()
    assert [key for (key, _), count in (ours - theirs).items() for _ in range(count)] == list(DIFFERENCES)


def names(event: Opened) -> tuple[str, str]:
    return event.route.name, "service" if isinstance(event.route, Service) else event.route.direction


def test_the_routes_are_those_that_the_client_created() -> None:
    done = replay("session-udp")
    ours = {(*names(event), event.route.object_id) for event in done.all(Opened)}
    topics = {entity["object_id"]: entity for entity in expected()["entities"] if entity["kind"] == "topic"}
    theirs = {("/fmu/vehicle_command", "service", 2048)}
    for entity in expected()["entities"]:
        if entity["kind"] in ("datawriter", "datareader"):
            topic = topics[entity["topic"]]["name"].removeprefix("rt")
            theirs.add((topic, "out" if entity["kind"] == "datawriter" else "in", entity["id"]))
    assert ours == theirs
    assert len(done.all(Opened)) == 66
    service = next(event.route for event in done.all(Opened) if isinstance(event.route, Service))
    assert service[1:3] == ("px4_msgs/srv/VehicleCommand_Request", "px4_msgs/srv/VehicleCommand_Response")
    types = {event.route.ros_type for event in done.all(Opened) if isinstance(event.route, Route)}
    assert "px4_msgs/msg/VehicleStatus" in types
    assert all(ros_type.startswith("px4_msgs/msg/") and ros_type[-1] != "_" for ros_type in types)


def test_the_samples_are_those_that_the_client_wrote() -> None:
    done = replay("session-udp")
    found: defaultdict[str, list[bytes]] = defaultdict(list)
    for event in done.all(Sample):
        assert event.payload[:4] == b"\0\1\0\0"
        found[f"rt{event.route.name}"].append(event.payload[4:])
    theirs = expected()["samples"]["from_client"]
    assert {topic: (len(samples), samples[0].hex()) for topic, samples in found.items()} == {
        topic: (entry["count"], entry["first"]) for topic, entry in theirs.items()
    }
    written = []
    for data in sent("session-udp", "client"):
        header, parts = reference.message(data)
        written += [part[2][4:] for part in parts if part[0] == "WRITE_DATA"]
        assert header["session"] >= 0x80
    assert [event.payload[4:] for event in done.all(Sample)] == written
    assert done.all(Lost) == []
    assert (done.agent.outbox.received, done.agent.outbox.late, done.agent.outbox.refused) == (
        expected()["datagrams"]["client"],
        0,
        {},
    )


@pytest.mark.parametrize(
    ("name", "namespace"),
    [("session-udp", ""), ("session-namespace", "uav_1"), ("session-fragment", "a" * 40), ("session-service", "")],
)
def test_a_session_begins_and_ends(name: str, namespace: str) -> None:
    done = replay(name)
    remote = Remote(1, "127.0.0.1:50001", 1, namespace, continued=False)
    assert [event for event in done.events if isinstance(event, (Connected, Disconnected))] == [
        Connected(remote),
        Disconnected(remote, "the vehicle has ended the session"),
    ]
    prefix = f"/{namespace}/fmu/" if namespace else "/fmu/"
    assert all(event.route.name.startswith(prefix) for event in done.all(Opened))
    assert not done.agent.routes(1)


def test_requests_and_replies_have_the_bytes_of_the_real_agent() -> None:
    """Only the caller's GUID and the clock differ."""
    captured = rows("session-service")
    done = Replay()
    service = expected()["other_files"]["session-service"]
    identity = bytes.fromhex(service["requests"][0]["identity"])[:16]
    number = 0
    for row in captured:
        if row.sender == "agent" and row.data[4] == wire.DATA and row.data[1] == wire.RELIABLE:
            done.agent.take_outgoing()
            done.agent._find(1)._guid = identity
            number += 1
            payload = b"\0\1\0\0" + row.data[4 + 4 + 4 + 24 :]
            done.agent.call(1, 2048, number, payload)
            assert done.agent.take_outgoing() == [(row.data, PORT)]
        done.feed([row])
    replies = done.all(Replied)
    assert [reply.number for reply in replies] == [1, 2, 3]
    assert [reply.payload.hex() for reply in replies] == ["00010000" + entry["reply"] for entry in service["requests"]]
    assert {reply.service.name for reply in replies} == {"/fmu/vehicle_command"}
    assert done.agent.outbox.refused == {}


def test_published_samples_have_the_bytes_of_the_real_agent() -> None:
    done = Replay()
    count = 0
    for row in rows("session-udp"):
        if row.sender == "agent" and row.data[4] == wire.DATA:
            number = int.from_bytes(row.data[10:12], "big") >> 4
            done.agent.publish(1, number, b"\0\1\0\0" + row.data[12:])
            assert done.agent.take_outgoing() == [(row.data, PORT)]
            count += 1
        done.feed([row])
    assert count == expected()["submessages"]["agent"]["DATA"]


def test_a_serial_session_is_answered_byte_for_byte() -> None:
    """Chunks of bytes in, frames out. The clock differs, and nothing is published here."""
    agent, inward, outward = Agent(0.0), Deframer(0), Deframer(1)
    ours: list[bytes] = []
    theirs: list[bytes] = []
    topics: Counter[str] = Counter()
    for row in rows("session-serial"):
        if row.sender == "agent":
            theirs += outward.feed(row.data)
            continue
        for message in inward.feed(row.data):
            agent.receive(message, "/dev/ttyUSB0", 0)
        ours += [message for frame, _ in agent.take_outgoing() for message in Deframer(1).feed(pack_frame(frame))]
        for event in agent.take_events():
            if isinstance(event, Sample):
                topics[f"rt{event.route.name}"] += 1
            elif isinstance(event, Connected):
                assert event.remote.address == "/dev/ttyUSB0"
    port = "/dev/ttyUSB0"
    mine, real = compared([(data, port) for data in ours]), compared([(data, port) for data in theirs])
    assert real - mine == Counter()
    assert [key for key, _ in mine - real] == list(DIFFERENCES)
    assert dict(topics) == expected()["other_files"]["session-serial"]["from_client"]


RESTARTS = {
    "agent_restarts_no_sync": ([INFO], [STATUS_OF_DELETE]),
    "agent_away_9s_no_sync": ([], [STATUS_OF_DELETE]),
    "agent_restarts_sync": ([], [STATUS_OF_DELETE]),
    "client_restarts_no_sync": ([HEARTBEAT, ACKNACK], [HEARTBEAT, ACKNACK, STATUS_OF_DELETE]),
}
"""Beginnings of datagrams that only the real agent sends, and that only ours sends.

INFO: one answer that the real agent gave in the moment in which the recording says that it was killed.
HEARTBEAT and ACKNACK: the real agent needed 3 s to replace the entities of the old session. Acknowledgements in the
recording are late, and both sides ask for them, at other times than with our agent.
STATUS_OF_DELETE: as in DIFFERENCES.
"""


@pytest.mark.parametrize("case", RESTARTS)
def test_restarts_are_answered_as_by_the_real_agent(case: str) -> None:
    times = {text: time for time, text in load("session-restart")[case]["events"]}
    captured = rows("session-restart", case)
    if "agent killed" in times:
        first = Replay()
        first.feed([row for row in captured if row.time < times["agent killed"]])
        second = Replay(times["agent started again"])
        second.feed([row for row in captured if row.time >= times["agent started again"]])
        done = [first, second]
    else:
        done = [Replay()]
        done[0].feed(captured)
    ours = compared([answer for part in done for answer in part.answers])
    theirs = compared([(row.data, OTHER_PORT if row.port else PORT) for row in captured if row.sender == "agent"])

    def only(more: Counter[tuple[str, Address]], allowed: list[str]) -> None:
        rest = [key for key, _ in more if not key.startswith(tuple(allowed))]
        assert rest == []
        assert all(any(key.startswith(beginning) for key, _ in more) for beginning in allowed)

    only(theirs - ours, RESTARTS[case][0])
    only(ours - theirs, RESTARTS[case][1])
    events = [event for part in done for event in part.events if isinstance(event, (Connected, Disconnected))]
    assert len([event for event in events if isinstance(event, Connected)]) == 2
    assert events[-1] == Disconnected(events[-1].remote, "the vehicle has ended the session")
    samples = [event for part in done for event in part.all(Sample)]
    assert len(samples) > 100


def test_a_client_that_restarts_replaces_its_session() -> None:
    """Half a second after its last message, as the other one may still be there."""
    done = Replay()
    done.feed(rows("session-restart", "client_restarts_no_sync"))
    kinds = [type(event).__name__ for event in done.events if isinstance(event, (Connected, Disconnected))]
    assert kinds == ["Connected", "Connected", "Disconnected", "Disconnected"]
    assert done.all(Disconnected)[0].reason == "the vehicle has begun another session, at 127.0.0.1:50002"


def test_a_running_session_without_a_record_is_refused() -> None:
    started = next(time for time, text in load("takeover")["events"] if text == "second agent started")
    after = [row for row in rows("takeover") if row.time >= started]
    done = Replay(started)
    done.feed(after)
    (warned,) = done.events
    assert isinstance(warned, Warned)
    pings = [row for row in after if row.data[4] == wire.GET_INFO and row.sender == "client"]
    infos = [data for data, _ in done.answers if data[4] == wire.INFO]
    assert len(infos) == len(pings) == 3, "with the third one, PX4's client ends its session"
    assert not any(wire.Info.unpack(data[8:]).known for data in infos)
    assert done.agent.outbox.refused.keys() == {"message of an unknown session"}
