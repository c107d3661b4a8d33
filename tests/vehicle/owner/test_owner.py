"""Tests of the owner of a link and of the programs that join it, in one process, without a vehicle."""

from __future__ import annotations

import errno
import os
import random
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from msggen.link.address import parse_address
from msggen.link.age import expiry
from msggen.live import LinkError, LinkTimeoutError, NotConnectedError, Vehicle
from msggen.vehicle.owned import greeting
from msggen.vehicle.owned.records import CALL, EVENT, HEADER, LAST, SAMPLE, RecordReader, event_in, event_of, record_of
from msggen.vehicle.owned.unix import UnixLink
from msggen.vehicle.owner import process
from msggen.vehicle.owner import program as program_module
from msggen.vehicle.owner import server as server_module
from msggen.vehicle.owner.owner import LOGGER
from msggen.vehicle.owner.server import Server
from support.fake_link import FakeLink
from support.link_records import Records, nothing_is_left
from support.served import ADDRESS, hello, served

WAIT = 10.0


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


def until(condition: Any) -> None:
    """Wait for what another thread does."""
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def followers(server: Server, name: str) -> int:
    """Return how many programs follow a topic of the first vehicle."""
    return len(next(row for route, row in server.owner.vehicles[1].rows.items() if name in route).programs)


def raw(path: Path, *records: bytes) -> socket.socket:
    """Join as a program that sends these records."""
    own = greeting.connected(str(path))
    own.settimeout(WAIT)
    own.sendall(event_of("hello", hello()) + b"".join(records))
    return own


def received(own: socket.socket) -> Iterator[Any]:
    """Yield the records that a program gets."""
    reader = RecordReader()
    while chunk := own.recv(1 << 16):
        yield from reader.add(chunk)


def is_ended(own: socket.socket) -> bool:
    """Whether the owner ends the connection."""
    try:
        while own.recv(1 << 16):
            pass
    except ConnectionError:
        pass
    return True


@pytest.mark.usefixtures("server")
def test_only_what_a_program_follows_crosses(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    records = Records()
    joined = UnixLink(str(path))
    joined.start(records)
    until(lambda: len(records.opened_routes) == len(link.opened[1]))
    assert [route for _, route in records.opened_routes] == list(joined.routes(records.remotes[0]))
    route = link.route(remote, "out/vehicle_status")
    link.sample(remote, px4_types.VehicleStatus(timestamp=1))
    joined.follow(records.remotes[0], route, is_followed=True)
    until(lambda: joined.last(records.remotes[0], route))  # the owner has taken all that was sent before
    link.sample(remote, px4_types.VehicleStatus(timestamp=2), when=77)
    link.sample(remote, px4_types.SensorCombined(timestamp=3))
    joined.follow(records.remotes[0], route, is_followed=False)
    until(lambda: records.samples)
    assert joined.ask("state")["programs"][0]["name"]
    link.sample(remote, px4_types.VehicleStatus(timestamp=4))
    link.disconnect(remote)
    until(lambda: records.gone)
    joined.close()
    assert [(each.payload, each.time) for each in records.samples] == [
        (px4_types.VehicleStatus(timestamp=2).encode(), 77)
    ]


def test_vehicles_of_several_programs_read_publish_and_call(
    link: FakeLink, path: Path, server: Server, px4_types: Any
) -> None:
    remote = link.connect(namespace="uav_1")
    url = f"unix://{path}"
    with Vehicle(url, px4_types) as first, Vehicle(UnixLink(str(path)), px4_types) as second:
        subscriptions = [each.subscribe("vehicle_status") for each in (first, second)]
        assert [each.wait_connected(WAIT).namespace for each in (first, second)] == ["uav_1", "uav_1"]
        until(lambda: followers(server, "out/vehicle_status") == 2)
        link.sample(remote, px4_types.VehicleStatus(timestamp=5))
        assert [each.wait_for(bool, WAIT).timestamp for each in subscriptions] == [5, 5]
        for vehicle in (first, second):
            vehicle.publish(px4_types.TrajectorySetpoint(timestamp=6))
        until(lambda: [route.name for _, route, _ in link.published].count("/uav_1/fmu/in/trajectory_setpoint") == 2)
        replies = _call_at_once((first, second), link, px4_types)
    assert replies == {0: 10, 1: 11}


def _call_at_once(vehicles: Any, link: FakeLink, px4_types: Any) -> dict[int, int]:
    """Let each vehicle call at once, and answer one call after the other. Return the results by vehicle."""
    results: dict[int, int] = {}

    def call(number: int) -> None:
        command = px4_types.VehicleCommand(command=number)
        request = px4_types.srv.VehicleCommand.Request(request=command)
        results[number] = vehicles[number].call(request, WAIT).reply.result

    threads = [threading.Thread(target=call, args=(number,)) for number in range(len(vehicles))]
    for thread in threads:
        thread.start()
    for answered in range(len(vehicles)):
        until(lambda answered=answered: len(link.calls) > answered)
        time.sleep(0.02)
        assert len(link.calls) == answered + 1, "one call is on the wire at a time"
        remote, service, number, payload = link.calls[answered]
        asked = px4_types.srv.VehicleCommand.Request.decode(payload).request.command
        reply = px4_types.srv.VehicleCommand.Response(reply=px4_types.VehicleCommandAck(result=10 + asked))
        link.user().replied(remote, service, number, reply.encode())
    for thread in threads:
        thread.join()
    return results


@pytest.mark.usefixtures("server")
def test_a_call_that_nobody_waits_for_keeps_no_other_one_waiting(link: FakeLink, path: Path, px4_types: Any) -> None:
    link.connect()
    request = px4_types.srv.VehicleCommand.Request()
    with Vehicle(UnixLink(str(path))) as first, Vehicle(UnixLink(str(path))) as second:
        for vehicle in (first, second):
            vehicle.wait_connected(WAIT)
            with pytest.raises(LinkTimeoutError):
                vehicle.call(request, 0.5)
    assert [number for _, _, number, _ in link.calls] == [1, 2]


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize("is_direct", [True, False])
def test_a_call_that_is_refused_raises_at_once(
    is_direct: bool,  # noqa: FBT001
    link: FakeLink,
    path: Path,
    px4_types: Any,
) -> None:
    own = FakeLink(px4_types) if is_direct else link
    with Vehicle(own if is_direct else UnixLink(str(path))) as vehicle:
        own.connect()
        vehicle.wait_connected(WAIT)
        own.refusal = LinkError("the vehicle does not acknowledge what it gets")
        request = px4_types.srv.VehicleCommand.Request()
        for _ in range(2):
            begun = time.monotonic()
            with pytest.raises(LinkError) as caught:
                vehicle.call(request, 60.0)
            assert time.monotonic() - begun < WAIT
            assert (type(caught.value), str(caught.value)) == (LinkError, str(own.refusal))
        own.refusal = None
        with pytest.raises(LinkTimeoutError):
            vehicle.call(request, 0.5)
    assert len(own.calls) == 1


@pytest.mark.usefixtures("server")
def test_a_call_ends_when_the_vehicle_does(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    with Vehicle(UnixLink(str(path))) as vehicle:
        vehicle.wait_connected(WAIT)
        threading.Timer(0.05, link.disconnect, (remote,)).start()
        with pytest.raises(NotConnectedError, match="no answer for 3 s"):
            vehicle.call(px4_types.srv.VehicleCommand.Request(), WAIT)


@pytest.mark.usefixtures("server")
def test_the_owner_asks_for_definitions_once_for_all_programs(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    with Vehicle(UnixLink(str(path)), px4_types) as early:
        early.wait_connected(WAIT)
        link.sample(remote, px4_types.VehicleStatus())
        asked = link.answer(remote)
        assert early.wait_firmware(WAIT).is_complete
        with Vehicle(UnixLink(str(path)), px4_types) as late:
            late.wait_connected(WAIT)
            assert late.wait_firmware(WAIT).hashes == early.firmware.hashes
        assert len(asked) == len({*asked}) == len(early.firmware.hashes)


def test_a_program_that_joins_a_moment_later_is_told_why_it_waits(
    link: FakeLink, path: Path, server: Server, caplog: pytest.LogCaptureFixture
) -> None:
    link.user().warned("the vehicle connects anew")
    caplog.clear()
    with Vehicle(own := UnixLink(str(path))):
        until(lambda: "the vehicle connects anew" in caplog.messages)
        link.connect()
        caplog.clear()
        with Vehicle(UnixLink(str(path))) as late:
            late.wait_connected(WAIT)
            assert caplog.messages == [], "a vehicle is there"
        assert own.warnings() == ["the vehicle connects anew"]
    with server.owner.lock:
        server.owner.warnings["the vehicle connects anew"] -= 20.0
        assert server.owner.missed() == []


def test_a_program_is_told_nothing_before_it_is_welcome(link: FakeLink, path: Path, server: Server) -> None:
    with greeting.connected(str(path)) as own:
        own.settimeout(WAIT)
        until(lambda: server.owner.programs)
        link.connect()
        own.sendall(event_of("hello", hello()))
        names = (event_in(record[4])[0] for record in received(own))
        assert [next(names) for _ in range(4)] == ["welcome", "taken", "connected", "opened"]


@pytest.mark.usefixtures("server")
def test_the_last_sample_is_there_at_once(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    link.sample(remote, px4_types.VehicleStatus(timestamp=8))
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        status, attitude = vehicle.subscribe("vehicle_status"), vehicle.subscribe("vehicle_attitude")
        assert status.latest() == px4_types.VehicleStatus(timestamp=8)
        assert (attitude.latest(), status.received, len(status)) == (None, 0, 0)


@pytest.mark.usefixtures("server")
def test_what_a_program_publishes_is_there_for_those_who_ask(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    records = Records()
    other = UnixLink(str(path))
    other.start(records)
    route = link.route(remote, "in/trajectory_setpoint")
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        until(lambda: records.remotes)
        until(lambda: len(records.opened_routes) == len(link.opened[1]))
        other.follow(records.remotes[0], route, is_followed=True)
        other.last(records.remotes[0], route)
        vehicle.publish(px4_types.TrajectorySetpoint(timestamp=9))
        until(lambda: records.samples)
        (publisher,) = other.publishers(records.remotes[0])
        assert (publisher.topic, publisher.pid, publisher.samples) == (route.name, os.getpid(), 1)
    other.close()
    assert (records.samples[0].route, records.samples[0].payload) == (
        route,
        px4_types.TrajectorySetpoint(timestamp=9).encode(),
    )


def test_a_program_that_does_not_read_loses_its_own_oldest_samples(
    link: FakeLink, path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program_module, "BACKLOG", 100_000)
    with served(link, path) as server:
        remote = link.connect()
        index = link.opened[1].index(link.route(remote, "out/vehicle_status"))
        slow = raw(path, event_of("follow", 1, index, 1))
        with Vehicle(UnixLink(str(path)), px4_types, queue=100_000) as vehicle, slow:
            status = vehicle.subscribe("vehicle_status")
            vehicle.wait_connected(WAIT)
            until(lambda: followers(server, "out/vehicle_status") == 2)
            for number in range(8000):
                link.sample(remote, px4_types.VehicleStatus(timestamp=number))
                if number % 200 == 199:  # the other one keeps up
                    until(lambda number=number: status.received == number + 1)
            (dropped,) = [each.dropped for each in server.owner.programs if each.dropped]
            assert vehicle.statistics.unread == 0
            link.disconnect(remote)
            stamps = []
            for kind, _, _, _, body in received(slow):
                if kind == SAMPLE:
                    stamps.append(struct.unpack_from("<4xQ", body)[0])
                elif kind == EVENT and event_in(body)[0] == "disconnected":
                    break
    assert len(stamps) + dropped == 8000
    assert stamps == sorted(stamps)
    assert stamps[-1] == 7999


def test_a_program_that_does_not_read_loses_samples_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_module, "BACKLOG", 100_000)
    theirs, own = socket.socketpair()
    theirs.settimeout(0.0)
    own.settimeout(WAIT)
    program = program_module.Program(theirs)
    with own:
        for number in range(300):
            program.put(event_of("lost", 1, number))
            program.put(record_of(SAMPLE, bytes(2000), 1, 0, number))
        told, stamps, reader = [], [], RecordReader()
        while program.is_waiting:
            program.flush()
            for kind, _, _, when, body in reader.add(own.recv(1 << 20)):
                (told.append(event_in(body)[1][1]) if kind == EVENT else stamps.append(when))
        program.close()
    assert told == list(range(300))
    assert len(stamps) + program.dropped == 300
    assert program.dropped > 0


def test_settings_of_the_link_belong_to_its_owner(link: FakeLink, path: Path) -> None:
    def joined(**changes: Any) -> None:
        asked = {"address": "udp://127.0.0.1:8888", "allow": (), **changes}
        greeting.greeted(greeting.connected(str(path)), **asked).close()

    with served(link, path, "udp://127.0.0.1:8888", allow=("192.168.0.7", 3)):
        joined()
        joined(allow=(3, "192.168.0.7"))
        joined(address="udp://localhost:8888")
        joined(address="")
        stop = "or `msggen link stop udp://127.0.0.1:8888` first"
        with pytest.raises(LinkError, match=f"open to 192.168.0.7, 3, not to 4: leave that out, {stop}"):
            joined(allow=(4,))
        expected = f"open as udp://127.0.0.1:8888, not as udp://0.0.0.0:8888: use that address, {stop}"
        with pytest.raises(LinkError, match=expected):
            joined(address="udp://0.0.0.0:8888")
        with pytest.raises(LinkError, match="not as tap://"):
            joined(address="tap://127.0.0.1:8888?agent=127.0.0.1:8889")


def test_an_owner_of_all_addresses_hears_each(link: FakeLink, path: Path) -> None:
    with served(link, path, "udp://0.0.0.0:8888"):
        greeting.greeted(greeting.connected(str(path)), "udp://127.0.0.1:8888").close()


def test_another_version_gets_an_owner_of_its_own_if_nobody_else_is_there(
    link: FakeLink, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(link, path) as server:
        with raw(path) as other:
            assert next(received(other))
            monkeypatch.setattr(greeting, "__version__", "9.9")
            with pytest.raises(
                LinkError, match=r"this is msggen 9\.9, and test \(pid \d+\) use it: end them, or `msggen link"
            ):
                greeting.greeted(greeting.connected(str(path)), "")
        until(lambda: not server.owner.programs)
        with pytest.raises(greeting.LeavingError):
            greeting.greeted(greeting.connected(str(path)), "")
        until(lambda: server._is_over)


HOSTILE: list[bytes] = [
    b"GET / HTTP/1.1\r\n\r\n" * 4,
    record_of(SAMPLE, b"", 1),
    record_of(EVENT, b"[]"),
    event_of("hello"),
    event_of("hello", 3),
    event_of("hello", hello(allow=3)),
    event_of("hello", hello(address="x://")),
    event_of("serve"),
    event_of("hello", hello()) + record_of(CALL, b"", 1, 9),
    event_of("hello", hello()) + record_of(LAST, b"", 1, 999),
    event_of("hello", hello()) + event_of("follow", 1, 999, 1),
    event_of("hello", hello()) + event_of("follow", 1),
    event_of("hello", hello()) + event_of("follow", [], 1, 1),
    event_of("hello", hello()) + event_of("follow", 1, "", 1),
    event_of("hello", hello()) + event_of("cancel", {}, 1),
    HEADER.pack(EVENT, 0, 0, 0, 1 << 20),
]


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize("data", HOSTILE)
def test_bytes_that_no_program_sends_end_its_connection_only(
    data: bytes, link: FakeLink, path: Path, px4_types: Any
) -> None:
    remote = link.connect()
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        with greeting.connected(str(path)) as hostile:
            hostile.settimeout(WAIT)
            hostile.sendall(data)
            assert is_ended(hostile)
        link.sample(remote, px4_types.VehicleStatus(timestamp=8))
        until(lambda: vehicle.subscribe("vehicle_status").latest() is not None)


def test_a_program_that_ends_in_the_middle_of_a_record_has_sent_nothing(
    link: FakeLink, path: Path, server: Server, px4_types: Any
) -> None:
    remote = link.connect()
    index = link.opened[1].index(link.route(remote, "in/trajectory_setpoint"))
    body = px4_types.TrajectorySetpoint().encode()
    for part in (0.0, 0.5, 1.0):
        record = record_of(SAMPLE, body, 1, index, expiry())
        end = 1 + round(part * (len(record) - 2))
        with raw(path, record, record[:end]):
            until(lambda: server.owner.programs)
        until(lambda: not server.owner.programs)
    assert [route.name for _, route, _ in link.published].count("/fmu/in/trajectory_setpoint") == 3


@pytest.mark.parametrize("frames", [5_000, pytest.param(100_000, marks=pytest.mark.night)])
def test_random_frames_end_the_connection_of_their_program_only(
    frames: int, link: FakeLink, path: Path, px4_types: Any
) -> None:
    choose = random.Random(28)  # noqa: S311 - no secret
    names = ("hello", "follow", "cancel", "ask", "connected", "x")
    values: tuple[object, ...] = (0, 1, -1, 2**40, "", "state", "clients", None, True, [], {}, [1], hello(), 1.5)

    def frame() -> bytes:
        if choose.random() < 0.5:
            return event_of(choose.choice(names), *(choose.choice(values) for _ in range(choose.randrange(4))))
        body = choose.randbytes(choose.randrange(40))
        return record_of(choose.randrange(4), body, choose.randrange(3), choose.randrange(80), choose.randrange(9))

    with served(link, path) as server:
        remote = link.connect()
        with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
            vehicle.wait_connected(WAIT)
            sent = 0
            while sent < frames:
                data = [event_of("hello", hello()), *(frame() for _ in range(choose.randrange(1, 30)))]
                sent += len(data)
                with greeting.connected(str(path)) as hostile:
                    try:
                        hostile.sendall(b"".join(data))
                    except OSError:  # it was ended
                        continue
            link.sample(remote, px4_types.VehicleStatus(timestamp=8))
            until(lambda: vehicle.subscribe("vehicle_status").latest() is not None)
            until(lambda: len(server.owner.programs) == 1)


def test_fifty_programs_come_and_go(link: FakeLink, path: Path, px4_types: Any) -> None:
    with served(link, path) as server:
        remote = link.connect()
        for _ in range(2):
            links = [UnixLink(str(path)) for _ in range(50)]
            vehicles = [Vehicle(each, px4_types) for each in links]
            subscriptions = [each.subscribe("vehicle_status") for each in vehicles]
            for vehicle in vehicles:
                vehicle.wait_connected(WAIT)
            until(lambda: followers(server, "out/vehicle_status") == 50)
            link.sample(remote, px4_types.VehicleStatus(timestamp=4))
            assert {each.wait_for(bool, WAIT).timestamp for each in subscriptions} == {4}
            for vehicle in vehicles:
                vehicle.close()
        until(lambda: not server.owner.programs)


def test_it_ends_when_nobody_uses_it(link: FakeLink, path: Path) -> None:
    asked: list[bool] = []

    def idle(has_vehicle: bool) -> float:  # noqa: FBT001
        asked.append(has_vehicle)
        return 1e9 if has_vehicle else 0.0

    with served(link, path, idle=idle) as server:
        until(lambda: server._is_over)
    assert asked == [False]


def test_a_router_of_others_does_not_end_before_they_do(
    link: FakeLink, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[bool] = []

    def serves_others() -> bool:
        told.append(len(told) < 3)
        return told[-1]

    monkeypatch.setattr(link, "serves_others", serves_others, raising=False)
    with served(link, path, idle=lambda _: 0.0) as server:
        until(lambda: server._is_over)
    assert told == [True, True, True, False]


@pytest.mark.usefixtures("server")
def test_a_callback_may_leave(link: FakeLink, path: Path) -> None:
    """Nothing else wakes its thread, which waits for what the owner tells."""
    joined = UnixLink(str(path))

    class Leaving(Records):
        def connected(self, *args: Any) -> None:
            super().connected(*args)
            joined.close()

    joined.start(records := Leaving())
    until(lambda: joined.ask("state"))
    link.connect()
    until(lambda: records.gone)
    until(lambda: joined._thread is not None and not joined._thread.is_alive())


def test_a_link_that_fails_ends_its_programs(link: FakeLink, path: Path, px4_types: Any) -> None:
    with served(link, path), Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        link.connect()
        vehicle.wait_connected(WAIT)
        link.fail("the link failed: no more")
        with pytest.raises(LinkError, match="no more"):
            vehicle.subscribe("vehicle_status").wait_for(bool, WAIT)


@pytest.mark.usefixtures("server")
def test_a_question_of_a_later_release_has_no_answer(path: Path) -> None:
    records = Records()
    joined = UnixLink(str(path))
    joined.start(records)
    assert joined.ask("what is not known") is None
    assert joined.ask("state")["programs"]
    joined.close()


@pytest.mark.usefixtures("server")
def test_the_state_names_the_release_of_each_vehicle(link: FakeLink, path: Path) -> None:
    link.connect(1)
    link.connect(2)
    joined = UnixLink(str(path))
    joined.start(Records())
    found = joined.ask("state")["vehicles"]
    joined.close()
    assert [(each["key"], each["release"]) for each in found] == [(1, "v1.18"), (2, "v1.18")]


def test_dropping_samples_takes_no_longer_if_much_else_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that reads nothing asks much: each sample that is dropped costs the same, however many answers wait."""
    monkeypatch.setattr(program_module, "BACKLOG", 4_000_000)
    here, there = socket.socketpair()
    with here, there:
        slow = program_module.Program(here)
        answer, sample = event_of("answer", 1, "x" * 20), record_of(SAMPLE, bytes(200), 1, 0, 5)
        count = 3_900_000 // len(answer)
        for _ in range(count):
            slow.put(answer)
        begin = time.process_time()
        for _ in range(20_000):
            slow.put(sample)
        assert time.process_time() - begin < 5.0, "it took 50 s and more"
        assert not slow.is_gone
        assert slow.dropped > 19_000
        got = bytearray()
        here.settimeout(0.0)
        there.settimeout(0.0)
        while slow.is_waiting:
            slow.flush()
            while True:
                try:
                    got += there.recv(1 << 16)
                except BlockingIOError:
                    break
        kinds = [kind for kind, *_ in RecordReader().add(bytes(got))]
        assert (kinds.count(EVENT), kinds.count(SAMPLE)) == (count, 20_000 - slow.dropped)
        assert kinds == sorted(kinds, reverse=True), "in their order"


def test_who_asks_for_the_state_ends_no_owner_of_another_version(server: Server, path: Path) -> None:
    with greeting.connected(str(path)) as own:  # as `link list`, which needs no hello
        own.settimeout(WAIT)
        own.sendall(event_of("ask", 1, "state"))
        ((kind, *_, body),) = [next(received(own))]
        assert (kind, event_in(body)[0]) == (EVENT, "answer")
    with greeting.connected(str(path)) as own:
        own.settimeout(WAIT)
        own.sendall(event_of("hello", hello(version="9.9.9", is_program=False)))
        name, (text,) = event_in(next(received(own))[-1])
        assert (name, text.endswith("this is msggen 9.9.9")) == ("refused", True)
    assert not server._is_over


def test_names_of_programs_are_shown_with_escapes(
    server: Server, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    level = LOGGER.level
    monkeypatch.setattr(LOGGER, "handlers", [])
    monkeypatch.setattr(LOGGER, "propagate", True)
    process._log_to(str(tmp_path / "log"))
    forged = "a\x1b[2J\n2026-01-01 00:00:00,000 ERROR forged"
    with greeting.connected(str(path)) as own:
        own.settimeout(WAIT)
        own.sendall(event_of("hello", hello(name=forged)))
        next(received(own))
        assert [each.name for each in server.owner.programs] == [r"a\x1b[2J\n2026-01-01 00:00:00,000 ERROR forged"]
    LOGGER.warning("%s", forged)
    LOGGER.setLevel(level)
    for handler in LOGGER.handlers:
        handler.close()
    lines = (tmp_path / "log").read_text().splitlines()
    assert not any(each.startswith("2026-01-01") for each in lines)
    assert not any("\x1b" in each for each in lines)


@pytest.mark.usefixtures("server")
def test_an_owner_without_descriptors_waits_for_some(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It serves those who are there, and takes the next one when it can."""
    accepts, is_full = 0, True
    accept = socket.socket.accept

    def limited(self: socket.socket) -> Any:
        nonlocal accepts
        accepts += 1
        if is_full:
            raise OSError(errno.EMFILE, "Too many open files")
        return accept(self)

    with UnixLink(str(path)).connect():
        monkeypatch.setattr(server_module, "_PAUSE_S", 0.3)
        monkeypatch.setattr(socket.socket, "accept", limited)
        own = greeting.connected(str(path))
        begin = time.monotonic()
        until(lambda: accepts >= 3)
        assert accepts <= 3 + (time.monotonic() - begin) / 0.3
        is_full = False
        with greeting.greeted(own, ""):
            pass


def test_a_program_does_not_wait_for_ever_for_a_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(greeting, "_HELLO_S", 0.2)
    with socket.socket(socket.AF_UNIX) as listening, ExitStack() as waiting:
        listening.bind(str(tmp_path / "s"))
        listening.listen(1)
        for _ in range(2):  # Linux takes one more than is asked for
            waiting.enter_context(greeting.connected(str(tmp_path / "s")))
        with pytest.raises(LinkError, match="takes no further program"):
            greeting.connected(str(tmp_path / "s"))


@pytest.mark.usefixtures("server")
def test_programs_take_the_same_of_several_vehicles(link: FakeLink, path: Path) -> None:
    for key in (5, 2, 7):
        link.connect(key, address=f"127.0.0.1:{key}")
    for _ in range(5):
        with Vehicle(UnixLink(str(path))) as vehicle:
            assert vehicle.wait_connected(WAIT).key == 2


@pytest.mark.usefixtures("server")
def test_several_threads_can_ask_for_the_same(link: FakeLink, path: Path, px4_types: Any) -> None:
    remote = link.connect()
    link.sample(remote, px4_types.VehicleStatus(timestamp=8))
    found: list[Any] = []
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        status = vehicle.subscribe("vehicle_status")
        until(status.latest)

        def ask() -> None:
            found.extend(status.last() for _ in range(50))

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(WAIT)
    assert [each[0].timestamp for each in found] == [8] * 200


def test_a_signal_at_any_line_ends_the_server(link: FakeLink, path: Path) -> None:
    """A handler of signals runs between two lines of the thread that serves, whatever lock this one holds."""
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()
        for number in range(100):
            server = Server(link, parse_address(ADDRESS), (), process.never)
            server.wake()
            thread = threading.Thread(target=_interrupted, args=(server, listening, number), daemon=True)
            thread.start()
            thread.join(WAIT)
            assert not thread.is_alive(), f"it hangs after {number} lines"


def _interrupted(server: Server, listening: socket.socket, number: int) -> None:
    """Serve, and call what a handler of signals calls before a line."""
    count = 0

    def trace(_frame: Any, event: str, _value: Any) -> Any:
        nonlocal count
        count += event == "line"
        if count == number:
            server.end()
        return trace

    sys.settrace(trace)
    server.serve(listening)
    sys.settrace(None)
    server.end()
