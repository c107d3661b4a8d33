"""Tests of the client: its datagrams are those of PX4's client, and it behaves as that one when things go wrong."""

from __future__ import annotations

import gzip
import itertools
import json
import random
import struct
from collections import Counter
from collections.abc import Callable
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.generate.cache import package_of
from msggen.link.xrce import entities, wire
from msggen.link.xrce.client import Client
from msggen.link.xrce.client_entities import Reader, Server, Settings, Writer
from msggen.link.xrce.client_events import Connected, Disconnected, Event, Received, Requested
from msggen.link.xrce.client_liveness import is_known
from msggen.link.xrce.client_times import OffsetFilter
from msggen.sim import Options, SimulatedVehicle
from support.examples import by_day
from support.repository import ROOT, shared
from support.simulation import SECOND
from support.xrce_agent import EPOCH, SmallAgent
from support.xrce_padding import masked

CAPTURES = ROOT / "tests" / "link" / "captures"
BOOT = 1_000_100
"""The time since boot at the first datagram of session-udp, in us: its TIMESTAMPs tell it."""


@pytest.fixture(scope="module")
def v1_17() -> ModuleType:
    """The types of the release whose client was captured."""
    return package_of("v1.17")


def capture(name: str) -> list[tuple[int, str, bytes]]:
    """Return the datagrams of a captured session: time in us, sender, bytes."""
    path = CAPTURES / f"{name}.json.gz"
    with gzip.open(path if path.exists() else shared(f"oracles/xrce/{path.name}")) as file:
        return [(round(row[0] * SECOND), row[1], bytes.fromhex(row[2])) for row in json.load(file)]


def replay(client: Client, rows: list[tuple[int, str, bytes]], boot: int = 0) -> tuple[list[bytes], list[Event]]:
    """Give a client the answers of a captured agent. Return its datagrams and events."""
    sent: list[bytes] = []
    for time, sender, data in rows:
        client.advance(boot + time)
        if sender == "agent":
            client.receive(data, boot + time)
        sent += [message for message, _ in client.take_outgoing()]
    return sent, client.take_events()


SESSIONS = {
    "session-udp": Options(sync="px4"),
    "session-namespace": Options(sync="off", namespace="uav_1"),
    "session-service": Options(sync="off"),
    "session-fragment": Options(sync="off", namespace="a" * 40),
}


def settings_of(package: ModuleType, options: Options, name: str = "") -> Settings:
    settings = SimulatedVehicle(package, options)._client.settings
    return settings._replace(localhost=name == "session-fragment")


@pytest.mark.parametrize("name", SESSIONS)
def test_the_creation_is_that_of_px4(name: str, v1_17: ModuleType) -> None:
    """The same datagrams in the same order, byte by byte but for padding, with the acknowledgements between them."""
    rows = capture(name)
    client = Client(settings_of(v1_17, SESSIONS[name], name))
    sent, events = replay(client, rows, BOOT)
    theirs = [data for _, sender, data in rows if sender == "client"]
    created = [masked(data) for data in theirs if data[1] == wire.RELIABLE and data[4] != wire.WRITE_DATA]
    assert [masked(data) for data in sent if data[1] == wire.RELIABLE] == created
    assert len(created) == (69 if name == "session-fragment" else 68)
    acknowledged = [data for data in theirs if data[4] == wire.ACKNACK]
    assert [data for data in sent if data[4] == wire.ACKNACK] == acknowledged
    assert sent[:2] == theirs[:2], "GET_INFO and CREATE_CLIENT"
    assert isinstance(events[0], Connected)
    assert not client.refused


def test_the_samples_that_px4_received_arrive(v1_17: ModuleType) -> None:
    rows = capture("session-udp")
    _, events = replay(Client(settings_of(v1_17, SESSIONS["session-udp"])), rows, BOOT)
    sent = [data[12:] for _, sender, data in rows if sender == "agent" and data[4] == wire.DATA]
    assert [event.data for event in events if isinstance(event, Received)] == sent
    assert len(sent) == 87


def test_the_clock_is_that_of_the_agent_after_500_exchanges(v1_17: ModuleType) -> None:
    rows = [row for row in capture("session-udp") if row[0] < 5.2 * SECOND]
    client = Client(settings_of(v1_17, SESSIONS["session-udp"]))
    sent, _ = replay(client, rows, BOOT)
    asked = [sum(data[4] == wire.TIMESTAMP for data in each) for each in (sent, [row[2] for row in rows])]
    assert asked == [501, 501], "the session begins with one"
    (stamp,) = [wire.TimestampReply.unpack(data[8:]) for _, _, data in rows if data[4] == wire.TIMESTAMP_REPLY][-1:]
    observed = (stamp.transmitted - stamp.originated) // 1000
    assert abs(client.offset - observed) < 1000


def test_requests_have_the_bytes_of_their_caller_and_replies_repeat_them(v1_17: ModuleType) -> None:
    rows = capture("session-service")
    client = Client(settings_of(v1_17, SESSIONS["session-service"]))
    replies = [data for _, sender, data in rows if sender == "client" and data[1] == wire.RELIABLE and data[4] == 7]
    sent: list[bytes] = []
    for time, sender, data in rows:
        client.advance(time)
        if sender == "agent":
            client.receive(data, time)
            for event in client.take_events():
                if isinstance(event, Requested):
                    reply = next(each for each in replies if each[12:36] == event.identity)
                    size = int.from_bytes(reply[6:8], "little") - 28
                    client.reply(event.number, event.identity, reply[36 : 36 + size])
        sent += [message for message, _ in client.take_outgoing()]
    ours = [data for data in sent if data[1] == wire.RELIABLE and data[4] == wire.WRITE_DATA]
    assert [data[:8] + data[10:36] for data in ours] == [data[:8] + data[10:36] for data in replies]
    assert len(ours) == 3


# --- behaviour on a virtual clock

ONE = Settings(
    [Reader(2048, "rt/fmu/in/a", "px4_msgs::msg::dds_::A_", 2)],
    [Writer(7, "rt/fmu/out/b", "px4_msgs::msg::dds_::B_")],
    [Server(2048, "s", "q_", "r_", "rq/fmu/sRequest", "rr/fmu/sReply")],
    sync="short",
)


class Line:
    """A client and a small agent with a delay, through functions that decide what arrives."""

    def __init__(self, settings: Settings = ONE, delay: int = 100) -> None:
        self.client = Client(settings)
        self.answers: list[tuple[int, bytes]] = []
        self.delay = delay
        self.agent = SmallAgent(lambda data: self.answers.append((self.now + delay, data)))
        self.now = self.due = 0
        self.sent: list[tuple[int, bytes, int]] = []
        self.events: list[tuple[int, Event]] = []
        self.arrives: Callable[[bytes, str], bool] = lambda data, sender: True  # noqa: ARG005

    def run(self, seconds: float, write_every: int = 0) -> None:
        end, due = self.now + round(seconds * SECOND), [b""]
        while self.now < end:
            self.client.advance(self.now)
            if write_every and self.now >= self.due and self.client.write(7, b"\1\2\3\4"):
                self.due = self.now + write_every
            self._carry()
            self.now += 100 if due else self._pause(end, write_every)
            if self.now % 200_000 == 0:
                self.agent.tick()
            due = [data for time, data in self.answers if time <= self.now]
            self.answers = [each for each in self.answers if each[0] > self.now]
            for data in due:
                if self.arrives(data, "agent"):
                    self.client.receive(data, self.now)
            self._carry()

    def _pause(self, end: int, write_every: int) -> int:
        """Return how long nothing happens, in steps of 100 us."""
        ticks = self.now // 200_000 * 200_000 + 200_000
        times = [end, ticks, self.client.next_time, *(time for time, _ in self.answers)]
        if write_every:
            times.append(self.due)
        return max(100, -(-(min(times) - self.now) // 100) * 100)

    def _carry(self) -> None:
        for data, connection in self.client.take_outgoing():
            self.sent.append((self.now, data, connection))
            if self.arrives(data, "client"):
                self.agent.receive(data, self.now)
        self.events += [(self.now, event) for event in self.client.take_events()]

    def times(self, kind: int, start: int = 0) -> list[float]:
        """Return when the client sent submessages of a kind, in s."""
        return [time / SECOND for time, data, _ in self.sent if data[4] == kind and time >= start]

    def reasons(self) -> list[str]:
        return [event.reason for _, event in self.events if isinstance(event, Disconnected)]


def test_it_asks_for_an_agent_once_a_second() -> None:
    line = Line()
    line.agent.is_away = True
    line.run(3.5)
    assert line.times(wire.GET_INFO) == [0.0, 1.0, 2.0, 3.0]
    line.agent.is_away = False
    line.run(1.0)
    assert line.client.is_connected
    assert line.times(wire.CREATE_CLIENT) == pytest.approx([4.0], abs=0.001)


def test_it_asks_for_an_agent_every_other_second_where_it_is_refused() -> None:
    line = Line()
    line.agent.is_away = True
    ask = line.arrives

    def refuse(data: bytes, sender: str) -> bool:
        line.client.refuse()
        return ask(data, sender)

    line.arrives = refuse
    line.run(4.5)
    assert line.times(wire.GET_INFO) == [0.0, 2.0, 4.0]
    line.arrives = ask
    line.agent.is_away = False
    line.run(2.0)
    assert line.client.is_connected
    assert line.times(wire.CREATE_CLIENT) == pytest.approx([6.0], abs=0.001)


def test_create_client_is_sent_ten_times() -> None:
    line = Line()
    line.arrives = lambda data, sender: data[4] != wire.CREATE_CLIENT  # noqa: ARG005
    line.run(9.9)
    assert len(line.times(wire.CREATE_CLIENT)) == 10
    line.run(0.5)
    assert line.reasons() == ["the agent did not create a session"]


def test_samples_count_their_sequence_numbers_around() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.1)
    sequences = []
    for _ in range(65540):
        assert line.client.write(7, b"1234")
        sequences += [struct.unpack_from("<H", data, 2)[0] for data, _ in line.client.take_outgoing()]
    assert sequences == [number & 0xFFFF for number in range(65540)]


@given(st.lists(st.integers(0, 2028), max_size=60))
def test_the_samples_of_a_loop_share_messages_of_up_to_2048_bytes(sizes: list[int]) -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.1)
    for size in sizes:
        assert line.client.write(7, bytes(size))
    messages = [data for data, _ in line.client.take_outgoing()]
    found = [[part.payload[4:] for part in wire.submessages(data[4:])] for data in messages]
    assert [sample for samples in found for sample in samples] == [bytes(size) for size in sizes]
    assert all(len(data) <= 2048 and len(data) % 4 == 0 for data in messages)
    lengths = [
        (len(data), 8 + len(following[0]) + -len(following[0]) % 4)
        for data, following in zip(messages, found[1:], strict=False)
    ]
    assert all(length + more > 2048 for length, more in lengths), "no message is sent that has room for the next sample"


def test_requests_count_from_10_and_around() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.1)
    requests = []
    for _ in range(65540):
        line.client.write(7, b"1234")
        requests += [int.from_bytes(data[8:10], "big") for data, _ in line.client.take_outgoing()]
    turn = requests.index(0xFFFF)
    assert requests[turn + 1] == 10
    assert {b - a for a, b in itertools.pairwise(requests[: turn + 1])} == {1}


def test_four_pings_without_an_answer_end_the_session() -> None:
    line = Line()
    line.run(2.5, write_every=50_000)
    line.agent.is_away = True
    away = line.now
    line.run(6.0, write_every=50_000)
    pings = line.times(wire.GET_INFO, away)
    (deleted,) = line.times(wire.DELETE)
    before = [time for time in pings if time < deleted]
    assert len(before) == 4
    assert deleted == pytest.approx(before[-1] + 1.0, abs=0.001)
    after = [(data[0], connection) for time, data, connection in line.sent if time / SECOND >= deleted]
    assert after[0] == (wire.PX4_SESSION, 0), "DELETE by the old connection"
    assert after[1] == (wire.NO_SESSION, 1), "GET_INFO by a new one"
    line.agent.is_away = False
    line.run(2.0)
    assert line.client.is_connected


def test_a_ping_blocks_samples_until_it_is_answered() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(1.5, write_every=50_000)
    line.agent.is_away = True
    away = line.now
    line.run(2.6, write_every=50_000)
    assert len(line.times(wire.WRITE_DATA, away)) < 20, "20 a second without the pings"


def test_there_are_no_pings_while_samples_flow_both_ways() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.5)
    start = line.now
    for _ in range(40):
        line.agent.publish("rt/fmu/in/a", bytes(8))
        line.run(0.1, write_every=50_000)
    assert line.times(wire.GET_INFO, start) == []


def test_three_seconds_without_a_sample_end_the_session() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(4.0)
    assert line.reasons() == ["no sample was sent for 3 s"]


def test_a_writer_that_is_refused_starts_the_session_again_and_a_reader_is_skipped() -> None:
    line = Line(ONE._replace(sync="off"))
    line.agent.status = wire.ERR_DDS_ERROR
    line.run(0.05)
    assert line.reasons()[0] == "the agent refused the participant"
    line.agent.status = wire.OK
    line.run(1.2)
    assert line.client.is_connected


@pytest.mark.parametrize("kind", [entities.PUBLISHER, entities.WRITER])
def test_a_writer_needs_all_of_its_entities(kind: int) -> None:
    line = Line(ONE._replace(sync="off"))
    line.agent.refused = frozenset({kind})
    line.run(0.5)
    assert line.reasons() == ["the agent refused the writer of rt/fmu/out/b"]


@pytest.mark.parametrize("kind", [entities.SUBSCRIBER, entities.READER])
def test_a_reader_without_one_of_its_entities_is_skipped(kind: int) -> None:
    line = Line(ONE._replace(sync="off"))
    line.agent.refused = frozenset({kind})
    line.run(0.5)
    assert line.client.is_connected
    assert not {each for each in line.agent.reads if each[1] & 15 == entities.READER}


def test_an_agent_that_is_slower_than_10_ms_never_gets_further_than_the_time() -> None:
    line = Line(delay=11_000)
    line.run(3.0)
    assert len(line.times(wire.TIMESTAMP)) > 100
    assert line.times(wire.READ_DATA) == []
    assert not line.client.is_connected


def test_an_agent_without_time_ends_the_session() -> None:
    line = Line()
    line.agent.answers_time = False
    line.run(12.5)
    assert line.reasons() == ["the agent did not answer TIMESTAMP"]


def test_the_time_is_asked_for_once_a_second() -> None:
    line = Line()
    line.run(0.5, write_every=50_000)
    assert abs(line.client.offset - EPOCH) < 200
    start = line.now
    line.run(3.0, write_every=50_000)
    assert len(line.times(wire.TIMESTAMP, start)) == 3


def test_the_clocks_are_synchronised_anew_in_each_session() -> None:
    line = Line()
    line.run(0.5)
    assert len(line.times(wire.TIMESTAMP)) == 21
    line.agent.reset()
    line.run(4.0, write_every=50_000)
    assert line.client.is_connected
    restarted = next(time for time, _, connection in line.sent if connection == 1)
    found = [time for time in line.times(wire.TIMESTAMP, restarted) if time < restarted / SECOND + 0.5]
    assert len(found) == 21


def test_a_normal_end_waits_for_the_status() -> None:
    line = Line()
    line.run(0.5)
    line.client.close(line.now)
    assert not line.client.is_closed
    line.run(0.01)
    assert line.client.is_closed
    assert not line.agent.is_in_session
    line.run(3.0)
    assert len(line.times(wire.DELETE)) == 1


def test_an_end_without_an_agent_takes_a_second() -> None:
    line = Line()
    line.run(0.5)
    line.agent.is_away = True
    line.client.close(line.now)
    line.run(0.99)
    assert not line.client.is_closed
    line.run(0.02)
    assert line.client.is_closed


def test_four_replies_wait_for_acknowledgement_and_the_others_for_room() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.1)
    line.arrives = lambda data, sender: sender == "client" or data[4] != wire.ACKNACK
    start = len(line.sent)
    for number in range(10):
        line.client.reply(2048, wire.Identity(bytes(16), number).pack(), b"abcd")
    line.run(0.05)
    replies = [data for _, data, _ in line.sent[start:] if data[4] == wire.WRITE_DATA]
    assert len(replies) == 4
    line.arrives = lambda data, sender: True  # noqa: ARG005
    line.run(1.0, write_every=50_000)
    assert [number for number, _ in line.agent.replies] == [*range(10)]


@by_day("seed", range(3), 3)
def test_a_session_is_created_and_replies_arrive_with_10_percent_of_loss_both_ways(seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311 - for repetition
    line = Line(ONE._replace(sync="off"))  # a lost TIMESTAMP would cost a second
    line.arrives = lambda data, sender: chance.random() > 0.1  # noqa: ARG005
    line.run(8.0, write_every=50_000)
    assert line.client.is_connected
    start = len(line.agent.samples)
    for number in range(8):
        line.agent.call(number, bytes(8))
    for _ in range(30):
        line.run(0.1, write_every=50_000)
        for _, event in line.events:
            if isinstance(event, Requested):
                line.client.reply(event.number, event.identity, b"done")
        line.events.clear()
    assert sorted(number for number, _ in line.agent.replies) == [*range(8)]
    assert len(line.agent.samples) > start
    assert line.agent.lost > 0


def test_a_message_that_the_agent_no_longer_has_is_awaited_for_good() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.1)
    expected = line.client._streams._received.expected
    line.client.receive(wire.pack_message(0x81, 0, 0, wire.Heartbeat(expected + 2, expected + 3).pack()), line.now)
    (answer, _) = line.client.take_outgoing()[-1]
    assert wire.AckNack.unpack(answer[8:]) == wire.AckNack(expected, 0b1111)


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_no_bytes_raise(datagrams: list[bytes]) -> None:
    line = Line()
    line.run(0.05)
    for data in datagrams:
        line.client.receive(data, line.now)
        line.client.receive(b"\x81\x80\0\0" + data, line.now)
        line.client.receive(b"\x81\0\0\0" + data, line.now)
    assert len(line.client._streams._received._waiting) <= 4
    assert len(line.client._statuses) <= 16


# --- the offset


def test_the_offset_follows_a_jump_of_the_agents_clock() -> None:
    clock = OffsetFilter(20)
    for number in range(25):
        clock.add(number * 1000, number * 1000 + 500, number * 1000 + 100)
    assert clock.offset == pytest.approx(450, abs=1)
    for number in range(40):
        clock.add(number * 1000, number * 1000 + 10**7, number * 1000 + 100)
    assert clock.is_converged
    assert clock.offset == pytest.approx(10**7 - 50, abs=1)


@given(st.lists(st.tuples(st.integers(0, 9_999), st.integers(-40_000, 40_000)), min_size=1, max_size=200))
def test_the_offset_is_within_what_was_observed(samples: list[tuple[int, int]]) -> None:
    clock = OffsetFilter(1)
    for number, (trip, error) in enumerate(samples):
        clock.add(number * SECOND, number * SECOND + trip // 2 + error, number * SECOND + trip)
    errors = [error for _, error in samples]
    assert min(errors) - 1 <= clock.offset <= max(errors) + 1


def test_what_is_counted_as_sent_is_what_was_sent(v1_17: ModuleType) -> None:
    rows = capture("session-namespace")
    sent, _ = replay(Client(settings_of(v1_17, SESSIONS["session-namespace"])), rows)
    theirs: Counter[int] = Counter(data[4] for _, sender, data in rows if sender == "client")
    ours: Counter[int] = Counter(data[4] for data in sent)
    for kind in (wire.CREATE, wire.READ_DATA, wire.ACKNACK, wire.CREATE_CLIENT):
        assert ours[kind] == theirs[kind]


# --- what is an answer


@pytest.mark.parametrize(
    ("info", "knows"),
    [
        ("000afffd00010001 0d00 0100 00000000", True),  # without a configuration
        ("000afffd85010001 0d00 0100 00000000", True),  # with an error
        ("000afffd00000001 0d00 0100 00000000", False),
        ("000afffd00010001 0d00 0000 00000000", None),
        ("00000000 0001 010d585243450100010f00 010d00 0100 0000 00000000", True),
        ("000afffd 0000 010d585243450100010f00 010d00 0100 0000 00000000", False),
        ("000afffd 0001 010d585243450100010f00 010d00 ffff 0000 00000000", None),
    ],
)
def test_an_info_is_an_answer_if_the_agent_is_available(info: str, knows: bool | None) -> None:  # noqa: FBT001
    assert is_known(bytes.fromhex(info)) is knows


def test_a_session_that_has_never_pinged_ends_after_three_pings() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.5, write_every=50_000)
    line.agent.is_away = True
    line.run(4.0, write_every=50_000)
    (deleted,) = line.times(wire.DELETE)
    pings = [time for time in line.times(wire.GET_INFO) if 0.1 < time < deleted]
    assert pings == pytest.approx([1.0, 2.0, 3.0], abs=0.02)


def test_an_info_without_a_question_ends_the_wait_for_another_one() -> None:
    line = Line(ONE._replace(sync="off"))
    line.run(0.5, write_every=50_000)
    line.agent.is_away = True
    line.run(0.7, write_every=50_000)
    assert not line.client.is_ready
    line.client.receive(wire.pack_message(0x81, 0, 0, wire.Info(b"\0\0", known=True).pack()), line.now)
    assert line.client.is_ready


def test_outliers_restart_the_estimate_and_the_session_goes_on() -> None:
    line = Line()
    line.run(0.5, write_every=50_000)
    wrong = (line.now + EPOCH + 10**8) * 1000
    line.agent.wrong_time = wire.TimestampReply(wrong, wrong, line.now * 1000)
    start = line.now
    line.run(11.5, write_every=50_000)
    line.agent.wrong_time = None
    line.run(2.0, write_every=50_000)
    assert line.client.is_connected
    assert not line.reasons()
    assert len(line.times(wire.TIMESTAMP, start)) > 20
    assert line.client.clock.is_converged


def test_the_estimate_restarts_with_a_time_in_each_loop() -> None:
    """PX4's client sent 372 and 403 a second in captures, whose loops take 2.5 ms."""
    line = Line(ONE._replace(sync="px4"))
    line.run(7.0, write_every=4_000)
    assert line.client.is_connected
    line.client.clock._outliers = 10
    line.agent.wrong_time = wire.TimestampReply(0, 10**18, 0)
    line.run(1.1, write_every=4_000)
    line.agent.wrong_time = None
    assert not line.client.clock.is_converged
    start = line.now
    line.run(0.5, write_every=4_000)
    assert 150 < len(line.times(wire.TIMESTAMP, start)) < 250
    line.run(1.5, write_every=4_000)
    assert line.client.clock.is_converged
    start = line.now
    line.run(3.0, write_every=4_000)
    assert len(line.times(wire.TIMESTAMP, start)) <= 3


def test_a_doubled_reply_does_not_make_those_after_it_late() -> None:
    """It waits for the end of the pause, and is none to the next question."""
    line = Line(ONE._replace(sync="px4"))
    line.run(0.1)
    line.answers += line.answers or [(line.now, wire.pack_message(0x81, 0, 0, wire.TimestampReply(0, 0, 0).pack()))]
    line.run(6.5, write_every=4_000)
    assert line.client.is_connected
