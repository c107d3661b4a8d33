"""Tests of what has waited for too long on its way to a vehicle: it is dropped, counted and told, on each way."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from msggen.link import age
from msggen.link.age import LONGEST_NS, LONGEST_S, OtherClock, expiry, is_over, now
from msggen.link.link import LinkError, StaleError
from msggen.live import LinkTimeoutError, Vehicle
from msggen.sim import Options, Simulator
from msggen.sim.vehicle import SimulatedVehicle
from msggen.vehicle.hub import Delivery
from msggen.vehicle.owned import greeting, outgoing
from msggen.vehicle.owned.outgoing import Outgoing
from msggen.vehicle.owned.records import SAMPLE, event_of, record_of
from msggen.vehicle.owned.unix import UnixLink
from msggen.vehicle.owner import owner as owner_module
from msggen.vehicle.owner import program as program_module
from msggen.vehicle.owner.server import Server
from support.fake_link import FakeLink
from support.link_records import nothing_is_left
from support.ports import free_port
from support.served import hello, owners, served

pytest_plugins = ["support.owned_links"]

WAIT = 20.0
STOPPED_S = 3.0
BUSY_S = 1.0
"""The time in s that a simulated vehicle may take to read what has arrived, on a busy computer."""


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


@pytest.fixture
def path(tmp_path: Path) -> Iterator[Path]:
    with nothing_is_left():
        yield tmp_path / "link.socket"


@pytest.fixture
def server(link: FakeLink, path: Path) -> Iterator[Server]:
    with served(link, path) as server:
        yield server


def until(condition: Callable[[], object]) -> None:
    """Wait for what another thread does."""
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


class Arrivals:
    """The setpoints that a simulated vehicle receives, with their ages. Each has the time of its sending in it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ages: list[float] = []
        take = SimulatedVehicle._take_sample

        def taken(vehicle: SimulatedVehicle, event: Any) -> None:
            if len(event.data) == SIZE:  # no other message that is sent here is as long
                self.ages.append((now() - struct.unpack_from("<Q", event.data)[0]) / 1e9)
            take(vehicle, event)

        monkeypatch.setattr(SimulatedVehicle, "_take_sample", taken)


SIZE = 64
"""The bytes of a TrajectorySetpoint of v1.18 in CDR: 8, 4 x 12, 2 x 4."""


def stamped(px4_types: Any) -> Any:
    """Return a setpoint with the time of its sending."""
    return px4_types.TrajectorySetpoint(timestamp=now())


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    """Let a process stand still."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@pytest.mark.usefixtures("owned")
def test_nothing_late_arrives_from_an_owner_that_stood_still(
    px4_types: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, capsys: Any
) -> None:
    arrivals = Arrivals(monkeypatch)
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="off", rate=5.0)]), Vehicle(url, px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        (owner,) = owners()
        with vehicle.every(50.0, lambda: stamped(px4_types)):
            until(lambda: len(arrivals.ages) > 20)
            until(lambda: vehicle.problem == "")
            with stopped(owner.state["pid"]):
                time.sleep(STOPPED_S)
                assert "has taken none" in vehicle.problem
            before = len(arrivals.ages)
            until(lambda: len(arrivals.ages) > before + 20)
            until(lambda: vehicle.problem == "")
            assert vehicle.statistics.unsent > 50
            until(lambda: "waited for more than 0.5 s" in caplog.text)
        assert main(["link", "list", "--json"]) == 0
        (told,) = json.loads(capsys.readouterr().out)
        assert told["programs"][0]["unsent"] > 50
        assert main(["link", "list"]) == 0
        assert "not sent, because they came late" in capsys.readouterr().out
    assert max(arrivals.ages) < LONGEST_S + BUSY_S
    assert 1 <= caplog.text.count("do not get through") < 10  # at each begin, of which a busy computer has some


def test_a_message_that_waited_in_the_socket_is_dropped_and_counted(
    link: FakeLink, path: Path, server: Server, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    link.connect()
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=1), link)
        with server.owner.lock:  # the owner stands still
            for number in range(2, 12):
                vehicle.publish(px4_types.TrajectorySetpoint(timestamp=number))
            time.sleep(LONGEST_S + 0.1)
        until(lambda: "they reach the process that owns the link after more than 0.5 s" in vehicle.problem)
        until(lambda: vehicle.statistics.unsent >= 10)
        arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=99), link)
        (program,) = server.owner.programs
        assert program.unsent >= 10
        until(lambda: vehicle.problem == "")
        arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=100), link)
        assert re.search(r"\d+ messages to the vehicle waited for more than 0\.5 s: dropped", caplog.text)
        (publisher,) = vehicle.publishers
        assert publisher.dropped >= 10
    assert set(setpoints(link)) == {1, 99, 100}


def arrives(vehicle: Vehicle, setpoint: Any, link: FakeLink) -> None:
    """Publish a setpoint until it is sent: a busy computer may take longer than it may wait."""
    end = time.monotonic() + WAIT
    while setpoints(link)[-1:] != [setpoint.timestamp]:
        assert time.monotonic() < end
        vehicle.publish(setpoint)
        for _ in range(100):
            if setpoints(link)[-1:] != [setpoint.timestamp]:
                time.sleep(0.005)


def setpoints(link: FakeLink) -> list[int]:
    """Return the timestamps of the setpoints that a link has sent."""
    name = "/fmu/in/trajectory_setpoint"
    return [struct.unpack_from("<4xQ", payload)[0] for _, route, payload in link.published if route.name == name]


@pytest.mark.usefixtures("server")
def test_a_program_whose_socket_is_full_goes_on(link: FakeLink, path: Path, server: Server, px4_types: Any) -> None:
    link.connect()
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        with server.owner.lock:
            begun = time.monotonic()
            for _ in range(2000):
                vehicle.publish(px4_types.TrajectorySetpoint())
            assert time.monotonic() - begun < WAIT
            assert vehicle._hub.link.late() > 0
            time.sleep(LONGEST_S + 0.1)
        until(lambda: vehicle.statistics.unsent)
        arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=5), link)


def test_a_call_ends_with_the_wait_of_its_caller(link: FakeLink, path: Path, server: Server, px4_types: Any) -> None:
    link.connect()
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        with server.owner.lock, pytest.raises(LinkTimeoutError):
            vehicle.call(px4_types.srv.VehicleCommand.Request(), 0.1)
        assert vehicle.statistics.sent >= 0  # the owner has read what was sent before
        assert link.calls == []
        with pytest.raises(LinkTimeoutError):
            vehicle.call(px4_types.srv.VehicleCommand.Request(), 0.1)
        assert len(link.calls) == 1


def test_a_message_to_a_vehicle_that_is_gone_is_counted(link: FakeLink, path: Path, server: Server) -> None:
    remote = link.connect()
    index = link.opened[1].index(link.route(remote, "in/trajectory_setpoint"))
    with Vehicle(UnixLink(str(path))) as vehicle:
        vehicle.wait_connected(WAIT)
        link.disconnect(remote)
        until(lambda: not vehicle.is_connected)
        hub = vehicle._hub
        assert isinstance(hub.link, UnixLink)
        hub.link._outgoing.send(record_of(SAMPLE, bytes(8), 1, index, expiry()))
        until(lambda: server.owner.unsent == 1)
        assert link.published == []
        assert [each.unsent for each in server.owner.programs] == [0], "it was not late"
        assert vehicle.problem == "the vehicle has disconnected: no answer for 3 s"
        link.connect()
        until(lambda: vehicle.is_connected)
        assert vehicle.problem == ""


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize("stamp", [0, 1, -1, -(1 << 63), (1 << 63) - 1, "late", "early"])
def test_a_time_that_cannot_be_right_is_not_taken(link: FakeLink, path: Path, px4_types: Any, stamp: int | str) -> None:
    remote = link.connect()
    index = link.opened[1].index(link.route(remote, "in/trajectory_setpoint"))
    told = stamp if isinstance(stamp, int) else now() + {"late": -1, "early": 2 * LONGEST_NS}[stamp]
    with Vehicle(UnixLink(str(path))) as vehicle:
        vehicle.wait_connected(WAIT)
        assert isinstance(vehicle._hub.link, UnixLink)
        vehicle._hub.link._outgoing.send(record_of(SAMPLE, px4_types.TrajectorySetpoint().encode(), 1, index, told))
        until(lambda: link.unsent == 1)
        assert setpoints(link) == []


def test_a_program_of_another_computer_has_another_clock(
    link: FakeLink, path: Path, server: Server, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Let the owner's clock be a year behind the program's, as through ssh."""
    link.connect()
    year = 365 * 24 * 3600 * 1_000_000_000
    monkeypatch.setattr(program_module, "clock_name", lambda: "another computer")
    monkeypatch.setattr(program_module, "now", lambda: now() - year)
    monkeypatch.setattr(owner_module, "is_over", lambda until: is_over(until + year))
    publish = link.publish
    monkeypatch.setattr(link, "publish", lambda *given: publish(given[0], given[1], given[2], given[3] + year))
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        for number in range(1, 6):
            arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=number), link)
        before = link.unsent
        with server.owner.lock:
            vehicle.publish(px4_types.TrajectorySetpoint(timestamp=77))
            time.sleep(LONGEST_S + 0.1)
        until(lambda: link.unsent == before + 1)
    assert set(setpoints(link)) == {1, 2, 3, 4, 5}


def test_a_name_that_takes_long_to_look_up_holds_up_its_own_program_only(
    link: FakeLink, path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended, look_up = threading.Event(), socket.gethostbyname
    asked: list[str] = []

    def slow(host: str) -> str:
        asked.append(host)
        if host == "slow.example":
            ended.wait(WAIT)
        return look_up("127.0.0.1")

    monkeypatch.setattr(socket, "gethostbyname", slow)
    with served(link, path, "udp://127.0.0.1:8888"), Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        link.connect()
        vehicle.wait_connected(WAIT)
        joining = threading.Thread(
            target=lambda: greeting.greeted(greeting.connected(str(path)), "udp://slow.example:8888").close()
        )
        joining.start()
        until(lambda: "slow.example" in asked)
        for number in range(20):
            arrives(vehicle, px4_types.TrajectorySetpoint(timestamp=number), link)
        assert joining.is_alive()
        ended.set()
        joining.join()


def test_the_owner_looks_up_no_name(link: FakeLink, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(link, path, "udp://127.0.0.1:8888"):
        asked: list[object] = []
        monkeypatch.setattr(socket, "gethostbyname", asked.append)
        monkeypatch.setattr(socket, "getaddrinfo", asked.append)
        for host, place in (("slow.example", "127.0.0.1"), ("localhost", "127.0.0.1"), ("slow.example", "10.0.0.1")):
            with greeting.connected(str(path)) as own:
                own.settimeout(WAIT)
                own.sendall(event_of("hello", hello(address=f"udp://{host}:8888", place=place)))
                name, _ = greeting._first_event(own)
                assert name == ("welcome" if place == "127.0.0.1" else "refused")
        assert asked == []


def test_another_clock_is_never_taken_for_later_than_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, own = OtherClock(), 0
    monkeypatch.setattr(age, "now", lambda: own)

    def theirs(time: int) -> int:
        """Return the time of a clock that is slower by 50 millionths."""
        return 5_000_000_000 + time - time // 20_000

    for second in range(600):
        own = second * 1_000_000_000
        delay = 1_000_000 if second % 3 else 400_000_000
        clock.hear(theirs(own - delay), "elsewhere")
        late = theirs(own) - clock.of(own)
        assert 0 <= late <= (3_000_000 if second else 402_000_000)
        assert clock.own(clock.of(own)) == own
    assert clock.of(age.NEVER) == age.NEVER


def test_a_time_that_differs_from_those_of_another_clock_counts_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, own = OtherClock(), 0
    monkeypatch.setattr(age, "now", lambda: own)
    clock.hear(5_000_000_000, "")
    for wrong in (1 << 62, 0):
        clock.hear(own + wrong, "")
        assert clock.of(own) == own + 5_000_000_000
    clock.hear(5_000_000_000, "")
    own = 3_000_000_000
    clock.hear(own, "")  # held up while nothing else arrived
    clock.hear(own + 5_000_000_000, "")
    assert clock.of(own) == own + 5_000_000_000
    clock.hear(own + (1 << 40), "")
    own += 1_000_000_001
    clock.hear(own + (1 << 40), "")  # none has agreed for a second
    assert clock.of(own) == own + (1 << 40)


def test_a_direct_link_drops_what_waited_in_its_own_process(
    px4_types: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrivals = Arrivals(monkeypatch)
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="off", rate=5.0)]), Vehicle(url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(WAIT)
        vehicle.wait_firmware(WAIT)  # a question about a format would wait, too, and be counted
        vehicle.publish(stamped(px4_types))
        until(lambda: arrivals.ages)
        own: Any = vehicle._hub.link
        threads = [threading.Thread(target=vehicle.publish, args=(stamped(px4_types),)) for _ in range(5)]
        with own.lock:
            for thread in threads:
                thread.start()
            time.sleep(LONGEST_S + 0.1)
        for thread in threads:
            thread.join()
        assert vehicle.statistics.unsent == 5
        vehicle.publish(stamped(px4_types))
        until(lambda: len(arrivals.ages) == 2)
        assert "messages to the vehicle do not get through: a message of /fmu/in/trajectory_setpoint" in caplog.text
        remote = vehicle.remote
        (route,) = (each for each in vehicle.routes if each.name == "/fmu/in/trajectory_setpoint")
        with pytest.raises(StaleError):
            own.publish(remote, route, bytes(8), now() - 1)
        with pytest.raises(StaleError):
            own.call(remote, vehicle.services[0], 1, b"\0\1\0\0", now() - 1)
    assert max(arrivals.ages) < LONGEST_S + BUSY_S


def test_an_owner_that_takes_nothing_is_left_after_a_second() -> None:
    """A flight joins topics in its event loop: it must not stand still with the owner."""
    own, owner = socket.socketpair()
    with own, owner:
        sending = Outgoing()
        sending.begin(own)
        for _ in range(100_000):
            sending.offer(bytes(1000), now() + LONGEST_NS)
            if sending.dropped:
                break
        failed: list[BaseException] = []

        def send() -> None:
            try:
                sending.send(bytes(1000))
            except LinkError as error:
                failed.append(error)

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        begin = time.monotonic()
        sending.offer(b"x", now() + LONGEST_NS)
        assert time.monotonic() - begin < LONGEST_S, "a message does not wait for what waits"
        thread.join(WAIT)
        assert "does it stand still?" in str(failed[0])
        assert own.recv(1) == b"", "the link joins again"


def test_news_that_are_faster_than_the_call_that_sends_are_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    sending, time_now = Outgoing(), [0]
    monkeypatch.setattr(outgoing, "now", lambda: time_now[0])

    class Socket:
        """Takes a message, whose owner tells of it at once; or takes none, as one that is full."""

        is_full = False

        def send(self, record: bytes, _: int) -> int:
            if self.is_full:
                raise BlockingIOError
            sending.taken(7, 0)
            return len(record)

    own: Any = Socket()
    monkeypatch.setattr(outgoing, "_has_news", lambda _: False)
    sending.begin(own)
    sending.offer(b"x", 7)
    own.is_full = True
    time_now[0] = 5 * LONGEST_NS
    sending.offer(b"x", 8)
    assert sending.dropped == 1
    time_now[0] = 20 * LONGEST_NS
    assert "has taken none" in sending.problem(), "the one that the socket did not take counts, too"
    sending.taken(7, 0)
    assert sending.problem() == ""


def test_the_user_is_told_once_when_it_begins_and_ends(caplog: pytest.LogCaptureFixture) -> None:
    delivery = Delivery(FakeLink())
    for problem, dropped in (("", 0), ("it stands still", 0), ("it stands still", 3), ("", 7), ("", 7), ("", 8)):
        delivery.take(problem, dropped)
    assert [each.message for each in caplog.records] == [
        "messages to the vehicle do not get through: it stands still",
        "7 messages to the vehicle waited for more than 0.5 s: dropped",
        "1 message to the vehicle waited for more than 0.5 s: dropped",
    ]
