"""Tests of which of several processes carries a vehicle to a network, without Zenoh."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from msggen.link.address import parse_address
from msggen.link.link import LinkError, Remote, Route
from msggen.link.rmw_zenoh.names import parse_attachment, parse_token
from msggen.vehicle.owner.network import Network
from msggen.vehicle.owner.network_topics import Flow
from msggen.vehicle.owner.owner import LOGGER

LATER = 2.1
REMOTE = Remote(1, "127.0.0.1:40123", 1, "", continued=False)
NAME = "/fmu/out/vehicle_status_v4"


class Declared:
    """What a session has declared."""

    is_heard = False

    def __init__(self, withdraw: Callable[[], None] = lambda: None) -> None:
        self.withdraw = withdraw


class Session:
    """A session of Zenoh in a space, which has the tokens of all sessions that are connected."""

    is_router = False

    def __init__(self, space: Space, zid: str) -> None:
        self.space, self.zid, self.own = space, zid, dict[str, None]()
        self.take: Any = None
        self.has_router = False
        space.sessions.append(self)

    def is_own(self, zid: str) -> bool:
        return zid == self.zid

    def tokens(self, take: Any) -> None:
        self.take = take

    def declare(self, token: str) -> Declared:
        self.own[token] = None
        if self.has_router:
            self.space.tell(self, token, is_alive=True)
        return Declared(lambda: self.withdraw(token))

    def withdraw(self, token: str) -> None:
        if token in self.own:
            del self.own[token]
            self.space.tell(self, token, is_alive=False)

    def publisher(self, _key: str, _matching: Any) -> Declared:
        return Declared()

    def answer(self, _key: str, _answer: Any) -> Declared:
        return Declared()

    def connect(self) -> None:
        """Find the router, as Zenoh does: what was declared is declared there, too."""
        self.has_router = True
        for other in self.space.sessions:
            if other is not self and other.has_router:
                for token in self.own:
                    other.take(token, is_alive=True)
                for token in other.own:
                    self.take(token, is_alive=True)

    def close(self) -> None:
        for token in tuple(self.own):
            self.withdraw(token)
        self.has_router = False


class Space:
    """The sessions of a router."""

    def __init__(self) -> None:
        self.sessions: list[Session] = []

    def tell(self, teller: Session, token: str, *, is_alive: bool) -> None:
        for each in self.sessions:
            if each is not teller and each.has_router and teller.has_router:
                each.take(token, is_alive)

    def lose(self) -> None:
        """Lose the router: for each session, all tokens of others are gone."""
        for each in self.sessions:
            for other in self.sessions:
                for token in other.own if other is not each else ():
                    each.take(token, is_alive=False)
        for each in self.sessions:
            each.has_router = False


class Process:
    """A process that owns a link with one vehicle, of PX4's defaults."""

    def __init__(self, space: Space, zid: str, types: Any) -> None:
        self.space, self.types = space, types
        self.network: Any = Network(parse_address("zenoh://127.0.0.1:7447"), "/none.socket", lambda _: (types,))
        self.begin(zid)

    def begin(self, zid: str) -> Session:
        session = self.session = Session(self.space, zid)
        self.network._connection.session = session
        self.network._begin(session)
        session.connect()
        return session

    def vehicle(self, remote: Remote = REMOTE) -> None:
        """Let the vehicle connect."""
        info = self.types.VehicleStatus.__msg__
        self.network.connected(remote)
        self.network.opened(remote, Route(NAME, info.ros_type, "out", 1, "", info.message_hash))
        self.network.identified(remote, {}, is_complete=True)

    def run(self) -> None:
        """Do what waits for the thread of the network."""
        while not (self.network._aside.is_idle and self.network._queue.empty()):
            while not self.network._queue.empty():
                self.network._queue.get()()

    @property
    def carries(self) -> bool:
        return any(token.endswith("2::,:,:,:,,") for token in self.session.own)


@pytest.fixture
def space() -> Space:
    return Space()


@pytest.fixture
def pair(space: Space, px4_types: Any) -> Iterator[tuple[Process, Process]]:
    """The first one has the larger id, so that it would withdraw: Zenoh leaves out zeros at the front."""
    found = Process(space, "0b" * 16, px4_types), Process(space, "a" * 31, px4_types)
    yield found
    for each in found:
        each.network._aside.close(1.0)
        each.network._answers.close(1.0)


def run(*processes: Process) -> None:
    for _ in range(3):
        for each in processes:
            each.run()


def test_the_first_process_keeps_a_namespace(pair: tuple[Process, Process], caplog: Any) -> None:
    first, second = pair
    for each in pair:
        each.vehicle()
        run(*pair)
    assert first.carries
    assert not second.carries
    text = "not carried: the vehicle at 127.0.0.1:40123 (key 1): another program publishes topics without a namespace"
    assert f"{text} on this network, in the session {first.session.zid}: give each one its own" in caplog.text
    first.network.disconnected(REMOTE, "")
    run(*pair)
    second.network._settle(time.monotonic())
    assert not second.carries  # it may be back
    second.network._settle(time.monotonic() + LATER)
    run(*pair)
    assert second.carries


def test_of_two_that_began_at_one_moment_one_keeps_a_namespace(pair: tuple[Process, Process], caplog: Any) -> None:
    """Neither knows of the other one when it declares its vehicle."""
    caplog.set_level("INFO", LOGGER.name)
    for each in pair:
        each.session.has_router = False
        each.vehicle()
        each.run()
        assert each.carries
    for each in pair:
        each.session.connect()
    run(*pair)
    first, second = pair
    assert not first.carries
    assert second.carries
    assert f"in the session {second.session.zid}" in caplog.text
    assert "the vehicle at 127.0.0.1:40123 (key 1) is no longer on the network" in caplog.text
    for _ in range(3):  # and that stays so
        for each in pair:
            each.network._settle(time.monotonic() + LATER)
        run(*pair)
    assert (first.carries, second.carries) == (False, True)
    second.session.close()
    first.run()
    first.network._settle(time.monotonic() + LATER)
    first.run()
    assert first.carries


def test_a_router_that_was_lost_and_is_back_changes_nothing(pair: tuple[Process, Process], space: Space) -> None:
    first, second = pair
    for each in pair:
        each.vehicle()
        run(*pair)
    space.lose()
    run(*pair)
    second.network._settle(time.monotonic() + 10.0)
    second.run()
    assert not second.carries
    second.session.connect()
    second.network._settle(time.monotonic() + 10.0)
    second.run()
    assert not second.carries
    first.session.connect()
    run(*pair)
    second.network._settle(time.monotonic() + 20.0)
    run(*pair)
    assert (first.carries, second.carries) == (True, False)


def test_another_session_gives_the_first_process_time_to_come_back(pair: tuple[Process, Process]) -> None:
    first, second = pair
    for each in pair:
        each.vehicle()
        run(*pair)
    late = second.session.take
    token = next(text for text in first.session.own if "/MP/" in text)
    first.session.close()
    second.session.close()
    second.begin("0c" * 16)
    late(token, is_alive=True)  # of the session before: nothing tells when it goes
    second.run()
    assert not second.network._namespaces._tokens
    second.network._settle(time.monotonic())
    second.run()
    assert not second.carries
    first.begin("0d" * 16)
    run(*pair)
    second.network._settle(time.monotonic() + LATER)
    run(*pair)
    assert (first.carries, second.carries) == (True, False)


def test_a_node_of_ros_takes_no_vehicle_away(pair: tuple[Process, Process], space: Space, caplog: Any) -> None:
    first, _ = pair
    first.vehicle()
    first.run()
    text = next(text for text in first.session.own if "/MP/" in text)
    stranger = Session(space, "01")
    stranger.take = lambda *_, **__: None
    stranger.declare(text.replace(first.session.zid, "01").replace("msggen_1", "node"))
    stranger.connect()
    first.run()
    assert first.carries
    assert "in the session 01" in caplog.text


def test_questions_of_others_keep_no_vehicle_off_the_network(pair: tuple[Process, Process]) -> None:
    first, _ = pair
    hung, dropped = threading.Event(), list[bool]()

    class Question:
        def close(self) -> None:
            dropped.append(True)

        def reply(self, *_: Any) -> None:
            pass

    first.network._link.last = lambda *_: hung.wait(20.0) and None
    topic = type("Topic", (), {"route": Route(NAME, "", "out", 1)})
    ask = partial(first.network._answer, REMOTE, topic)
    try:
        for _ in range(1100):
            ask(Question())
        assert dropped  # whoever asks need not wait
        first.vehicle()
        first.run()
        assert first.carries
    finally:
        hung.set()


@pytest.mark.parametrize("is_full", [True, False])
def test_types_that_were_not_found_are_looked_for_again(pair: tuple[Process, Process], is_full: bool) -> None:  # noqa: FBT001
    """Too much waits, or an error, such as a disk that is full."""
    first, _ = pair
    find, do = first.network._types, first.network._aside.do
    if is_full:
        first.network._aside.do = lambda _: False
    else:
        first.network._types = lambda _: 1 / 0
    first.vehicle()
    first.run()
    assert not first.carries
    first.network._aside.do, first.network._types = do, find
    first.network._look_again(time.monotonic())
    first.run()
    assert not first.carries  # not all the time
    first.network._look_again(time.monotonic() + 11.0)
    first.run()
    assert first.carries


def test_the_log_tells_the_router(pair: tuple[Process, Process], space: Space, caplog: Any, monkeypatch: Any) -> None:
    caplog.set_level("INFO", LOGGER.name)
    first, _ = pair
    connection = first.network._connection

    def told() -> list[str]:
        first.network._tell_role()
        first.network._tell_role()
        found = [each.getMessage().removeprefix("zenoh tcp/127.0.0.1:7447: ") for each in caplog.records]
        caplog.clear()
        return found

    def fail() -> None:
        raise LinkError("the port is in use")

    assert told() == ["a client of the router there"]
    space.lose()
    assert told() == ["no router: its connection has ended"]
    monkeypatch.setattr(connection, "open", fail)
    connection._routed_at = time.monotonic() - 10.0
    connection.look()
    assert told() == ["no router: the port is in use"]
    connection.session = session = Session(space, "0e" * 16)
    session.has_router = session.is_router = True
    connection.look()
    assert told() == ["this process is the router"]


def test_the_log_tells_why_the_network_has_ended(pair: tuple[Process, Process], caplog: Any) -> None:
    caplog.set_level("INFO", LOGGER.name)
    pair[0].network.failed("it sent what is no record")
    assert "the network has ended: it sent what is no record" in caplog.text


def test_two_threads_count_the_samples_of_a_topic_together() -> None:
    """What a subscriber has missed is published beside what arrives."""
    numbers: list[int] = []

    class Publisher:
        def put(self, _payload: bytes, attachment: bytes) -> None:
            told = parse_attachment(attachment)
            assert told is not None
            time.sleep(0.0001)
            numbers.append(told.sequence)

    publisher: Any = Publisher()
    flow = Flow(publisher, bytes(16))

    def put() -> None:
        for _ in range(100):
            flow.put(b"", 5)

    threads = [threading.Thread(target=put) for _ in range(2)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert numbers == [*range(1, 201)]
    flow.put(b"", 5, after=1)  # it is the newest one already
    flow.put(b"", 6, after=7)
    assert flow.sequence == 200
    flow.put(b"", 6, after=5)
    assert flow.sequence == 201


def test_tokens_stay_of_the_form_however_many_vehicles_there_were(pair: tuple[Process, Process]) -> None:
    first, _ = pair
    first.vehicle(REMOTE._replace(number=123_456))
    first.run()
    assert first.carries
    assert all(parse_token(token) for token in first.session.own)


def test_samples_do_not_wait_for_all_tokens(pair: tuple[Process, Process], monkeypatch: Any) -> None:
    first, _ = pair
    sent: list[bytes] = []
    network = first.network
    topic = type("Topic", (), {"key": type("Key", (), {"name": "/fmu/in/x"})})
    for number in range(2000):
        network._take_token(first.session, str(number), is_alive=True)
    monkeypatch.setattr(network, "_send", lambda _vehicle, _topic, payload, *_: sent.append(payload))
    for number in range(3):
        network._take_sample(None, topic, "", bytes([number]), None)
    network._do_next()
    assert sent == [b"\0", b"\1", b"\2"]
    assert not network.refusals.counts
