"""Tests of which of several processes carries a vehicle to a network, without Zenoh."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from msggen.link.address import parse_address
from msggen.link.link import Remote, Route
from msggen.vehicle.owner.network import Network
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

    def vehicle(self) -> None:
        """Let the vehicle connect."""
        info = self.types.VehicleStatus.__msg__
        self.network.connected(REMOTE)
        self.network.opened(REMOTE, Route(NAME, info.ros_type, "out", 1, "", info.message_hash))
        self.network.identified(REMOTE, {}, is_complete=True)

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
    assert not second.network._strangers
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
