"""Tests of the player on a virtual clock: an agent gets the samples of a recording in order and in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen.exports.player import Endpoints, Player, endpoints_of, is_played
from msggen.exports.writer import Channel, Writer
from msggen.link.link import Connected, Disconnected, Opened, Route, Sample
from msggen.link.xrce.agent import Agent
from msggen.messages.firmware import REQUEST, RESPONSE, releases
from msggen.recordings.log import opening
from msggen.recordings.log.log import Log
from msggen.recordings.source.source import Channel as SourceChannel
from msggen.recordings.topics.choice import Choice
from msggen.recordings.topics.topic import Topic
from support.recordings import START, Found, channel_of, route_of

MS = 1_000_000
TOPICS = ("vehicle_status", "sensor_combined", "vehicle_odometry")


class Stage:
    """A player and the agent of msggen, without sockets. Times are in us."""

    def __init__(self, player: Player) -> None:
        self.player, self.agent, self.now = player, Agent(0.0), 0
        self.events: list[Any] = []
        self.arrived: list[tuple[int, str, bytes]] = []
        self.is_deaf = False

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Let time pass."""
        end = self.now + round(seconds * 1e6)
        while self.now < end and not until():
            self.player.advance(self.now)
            while self._exchange():
                pass
            self.agent.tick(self.now / 1e6)
            for event in self.agent.take_events():
                self.events.append(event)
                if isinstance(event, Sample):
                    self.arrived.append((self.now, event.route.name, event.payload))
            self.now = min(end, max(self.now + 100, min(self.player.next_time, self.now + 100_000)))

    def _exchange(self) -> bool:
        """Carry datagrams both ways. Return whether there were any."""
        datagrams = self.player.take_outgoing()
        for data, connection in datagrams:
            if not self.is_deaf:
                self.agent.receive(data, ("127.0.0.1", 40_000 + connection), self.now * 1000)
        answers = self.agent.take_outgoing()
        for data, _ in answers:
            self.player.receive(data, self.now)
        return bool(datagrams or answers)

    def of(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


def recorded(  # noqa: PLR0913 - keywords, most of which have a default
    path: Path,
    package: Any,
    count: int = 200,
    *,
    interval: int = 10 * MS,
    front: str = "",
    more: list[Channel] | None = None,
) -> list[Found]:
    """Write a recording of some topics, and return its samples."""
    known = [channel_of(package, route_of(package, topic, front)) for topic in TOPICS] + (more or [])
    writer = Writer(str(path))
    numbers = {channel.topic: writer.add_channel(channel) for channel in known}
    found = []
    for number in range(count):
        topic = known[number % len(known)].topic
        payload = b"\0\1\0\0" + number.to_bytes(8, "little") + bytes(4 * (number % 9))
        found.append(Found(topic, START + number * interval, payload))
        writer.write(numbers[topic], START + number * interval, START, payload)
    writer.close()
    return found


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.mcap"


def play(path: Path, choice: Choice = Choice(), **options: Any) -> tuple[Stage, Endpoints]:  # noqa: B008
    recording = opening.open(path)
    endpoints = endpoints_of(recording, choice)
    return Stage(Player(recording, endpoints, **options)), endpoints


def gaps(stage: Stage, rate: float = 1.0) -> Iterator[float]:
    """Yield for each arrival how much later than its time it came, in ms, after the first one."""
    first = stage.arrived[0][0]
    for number, (now, _, _) in enumerate(stage.arrived):
        yield (now - first) / 1000 - number * 10 / rate


@pytest.mark.parametrize("rate", [1.0, 4.0, 0.25])
def test_samples_arrive_in_order_at_their_times(path: Path, px4_types: Any, rate: float) -> None:
    expected = recorded(path, px4_types)
    stage, endpoints = play(path, rate=rate)
    stage.run(2.0 / rate + 3, lambda: len(stage.arrived) == 200)
    assert [(name, payload) for _, name, payload in stage.arrived] == [(each.topic, each.payload) for each in expected]
    assert all(-1 <= gap < 25 for gap in gaps(stage, rate))
    assert stage.player.is_done
    assert (stage.player.sent, endpoints.release) == (200, next(iter(releases())))


def test_the_vehicle_has_the_endpoints_of_its_release(path: Path, px4_types: Any) -> None:
    recorded(path, px4_types)
    stage, _ = play(path)
    stage.run(2)
    opened = [event.route for event in stage.of(Opened)]
    expected = {
        (each.ros_name, each.message.__msg__.ros_type, each.direction, each.object_id)
        for each in px4_types.topics.ENDPOINTS
        if each.direction == "in" or each.uorb_topic in (*TOPICS, "message_format_response")
    }
    assert {route[:4] for route in opened if isinstance(route, Route)} == expected


def test_a_part_of_a_recording_is_played(path: Path, px4_types: Any) -> None:
    expected = recorded(path, px4_types)
    stage, _ = play(path, Choice(["vehicle_*"], ["VehicleStatus"]), start=1.0)
    stage.run(4)
    chosen = [each for each in expected if each.topic.endswith("odometry") and each.time >= START + 1000 * MS]
    assert [payload for _, _, payload in stage.arrived] == [each.payload for each in chosen]
    assert len(chosen) == 33


def test_samples_that_are_older_than_the_start_come_at_once(
    path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = recorded(path, px4_types, 120)
    monkeypatch.setattr(Log, "start", START + 1000 * MS)
    stage, _ = play(path)
    stage.run(3, lambda: len(stage.arrived) == 120)
    assert [payload for _, _, payload in stage.arrived] == [each.payload for each in expected]
    times = [now // 1000 - stage.arrived[0][0] // 1000 for now, _, _ in stage.arrived]
    assert times[100] < 25
    assert all(-1 <= time - 10 * number < 25 for number, time in enumerate(times[100:]))


def test_a_recording_is_repeated(path: Path, px4_types: Any) -> None:
    expected = recorded(path, px4_types, 20)
    stage, _ = play(path, is_repeated=True)
    stage.run(10, lambda: len(stage.arrived) >= 70)
    payloads = [each.payload for each in expected]
    assert [payload for _, _, payload in stage.arrived] == (payloads * 4)[: len(stage.arrived)]
    assert not stage.player.is_done
    assert len(stage.of(Connected)) == 1


def test_a_pause_in_a_recording_does_not_end_the_session(path: Path, px4_types: Any) -> None:
    recorded(path, px4_types, 4, interval=10_000 * MS)
    stage, _ = play(path)
    stage.run(45, lambda: stage.player.is_done)
    assert len(stage.arrived) == 4
    assert (len(stage.of(Connected)), len(stage.of(Disconnected))) == (1, 0)


def test_a_recording_goes_on_where_it_was_when_the_agent_is_back(path: Path, px4_types: Any) -> None:
    expected = recorded(path, px4_types, 2000)
    stage, _ = play(path)
    stage.run(30, lambda: len(stage.arrived) >= 100)
    stage.is_deaf = True
    stage.run(30, lambda: any("disconnected" in change for change in stage.player.changes))
    sent = stage.player.sent
    stage.is_deaf = False
    stage.run(60, lambda: stage.player.is_done)
    payloads = [each.payload for each in expected]
    assert [payload for _, _, payload in stage.arrived] == payloads[:100] + payloads[sent:]
    assert list(stage.player.changes) == [
        "connected",
        "disconnected: the agent has ended, or does not answer; looking for the next one",
        "connected",
    ]


def ask(stage: Stage, package: Any, topic: str, front: str = "") -> Any:
    """Ask the vehicle for a definition, and return its answer."""
    remote = stage.of(Connected)[0].remote
    routes = [event.route for event in stage.of(Opened)]
    request = next(route for route in routes if route.name == f"{front}{REQUEST}")
    message = package.MessageFormatRequest(protocol_version=1, topic_name=topic.encode().ljust(50, b"\0"))
    stage.agent.publish(remote.number, request.object_id, message.encode())
    before = len(stage.arrived)
    stage.run(0.2)
    (found,) = [payload for _, name, payload in stage.arrived[before:] if name == f"{front}{RESPONSE}"]
    return package.MessageFormatResponse.decode(found)


@pytest.mark.parametrize("front", ["", "/uav_1"])
def test_requests_for_definitions_are_answered(path: Path, px4_types: Any, front: str) -> None:
    """As the release does, if all definitions of the recording are of it."""
    recorded(path, px4_types, 2000, front=front)
    stage, endpoints = play(path)
    assert endpoints.namespace == front.strip("/")
    stage.run(2)
    assert stage.of(Connected)[0].remote.namespace == front.strip("/")
    for name, known in {
        "/fmu/out/vehicle_status": "VehicleStatus",
        "/fmu/in/vehicle_command": "VehicleCommand",
    }.items():
        answer = ask(stage, px4_types, name, front)
        assert (answer.success, answer.message_hash) == (True, getattr(px4_types, known).__msg__.message_hash)
        assert answer.timestamp > 0
    assert not ask(stage, px4_types, "/fmu/out/mine", front).success
    assert not ask(stage, px4_types, "vehicle_status", front).success


def test_definitions_that_the_recording_does_not_tell_are_unknown(path: Path, px4_types: Any) -> None:
    """A definition that differs from the release: what else differs is not known."""
    mine = channel_of(px4_types, route_of(px4_types, "wind"))
    mine = mine._replace(definition=f"{mine.definition}uint8 more\n")
    recorded(path, px4_types, 2000, more=[mine])
    stage, endpoints = play(path)
    stage.run(2)
    answer = ask(stage, px4_types, "/fmu/out/wind")
    assert answer.success
    assert answer.message_hash not in (0, px4_types.Wind.__msg__.message_hash)
    assert ask(stage, px4_types, "/fmu/out/vehicle_status").success
    assert not ask(stage, px4_types, "/fmu/in/vehicle_command").success
    assert endpoints.release == "v1.18"


def test_a_topic_of_no_release_has_a_free_number(path: Path, px4_types: Any) -> None:
    recorded(path, px4_types, 40, more=[Channel("/fmu/out/mine", "my_msgs/msg/Mine", "uint64 timestamp\n", "")])
    stage, endpoints = play(path)
    stage.run(4, lambda: stage.player.is_done)
    stage.run(0.1)
    assert endpoints.writers["/fmu/out/mine"].type == "my_msgs::msg::dds_::Mine_"
    assert len({writer.number for writer in endpoints.settings.writers}) == 5
    assert sum(name == "/fmu/out/mine" for _, name, _ in stage.arrived) == 10


def test_no_more_topics_are_played_than_an_agent_takes(path: Path, px4_types: Any) -> None:
    names = [f"/fmu/out/mine_{number}" for number in range(1200)]
    recorded(path, px4_types, 1203, more=[Channel(name, "my_msgs/msg/Mine", "", "") for name in names])
    stage, endpoints = play(path)
    stage.run(30, lambda: stage.player.is_done)
    stage.run(0.1)
    assert [name.rpartition("/")[2] for name in endpoints.writers][:4] == [
        *sorted((*TOPICS[1:], "vehicle_status_v4")),
        "mine_0",
    ]
    assert sorted([*endpoints.writers, *endpoints.left_out]) == sorted(each.name for each in opening.open(path).topics)
    assert {name for _, name, _ in stage.arrived} == {*endpoints.writers}
    assert len(endpoints.writers) > 300
    assert play(path, Choice(["mine_1100"]))[1].left_out == []


def test_a_recording_without_definitions_is_played(path: Path, px4_types: Any) -> None:
    expected = recorded(path, px4_types, 0)
    route = route_of(px4_types, "vehicle_status")
    path.unlink()
    writer = Writer(str(path))
    number = writer.add_channel(Channel(route.name, route.ros_type, "", ""))
    writer.write(number, START, START, b"\0\1\0\0abcd")
    writer.close()
    stage, endpoints = play(path)
    stage.run(3)
    assert [payload for _, _, payload in stage.arrived] == [b"\0\1\0\0abcd"]
    assert "vehicle_status" not in endpoints.hashes
    assert expected == []


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("/fmu/out/vehicle_status_v4", True),
        ("/uav_1/fmu/out/wind", True),
        ("/fmu/in/vehicle_command", False),
        ("/fmu/out/message_format_response", False),
        ("/rosout", False),
        ("/fmu/out/wind\x1b", False),
        (f"/fmu/out/{'x' * 255}", False),
        ("/fmu/out/" * 100_000 + "!", False),
    ],
)
def test_what_a_vehicle_publishes_is_played(name: str, *, expected: bool) -> None:
    channel = SourceChannel(0, name, "px4_msgs/msg/X", "")
    topic = Topic(name, 0, channel.ros_type, "", "", ((0, channel),), lambda: np.zeros(0, np.int64))
    assert is_played(topic) == expected
    assert not is_played(replace(topic, channels=((0, channel._replace(encoding="ulog")),)))
    for ros_type in (f"px4_msgs/msg/{'X' * 70_000}", "px4_msgs/msg/X\n", "px4_msgs/X"):
        assert not is_played(replace(topic, ros_type=ros_type))
