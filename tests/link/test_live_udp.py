"""Tests of the link over UDP: captures of PX4's client over real sockets, hostile senders, and what is left behind."""

from __future__ import annotations

import itertools
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from msggen.link.link import LinkError, Remote, Route
from msggen.link.serial import SerialLink
from msggen.link.tap import TapLink
from msggen.link.udp import Bound, UdpLink
from support.link_records import Records, nothing_is_left
from support.replay import DATA, DELETE, GET_INFO, WRITE_DATA, Client, creation, kind, sample, sent
from support.repository import ROOT
from support.xrce_captures import expected


@contextmanager
def linked(records: Records | None = None, **options: Any) -> Iterator[tuple[UdpLink, Records]]:
    link, records = UdpLink(port=0, **options), records or Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


@contextmanager
def connected(link: UdpLink, records: Records, name: str = "session-udp") -> Iterator[tuple[Client, Remote]]:
    """Connect a client with all endpoints."""
    count = len(records.remotes)
    with Client(link.port) as client:
        client.play(creation(name))
        records.wait(lambda: len(records.remotes) > count)
        remote = records.remotes[-1]
        records.wait(lambda: len(link.routes(remote)) >= 66)
        yield client, remote


# --- Captures


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("session-udp", 0),
        ("session-namespace", 0),
        ("session-fragment", 0),
        ("session-service", 3),  # replies to the requests of another program
    ],
)
def test_a_captured_session_gives_its_routes_and_samples(name: str, refused: int) -> None:
    counts: dict[str, int] = (
        {topic: found["count"] for topic, found in expected()["samples"]["from_client"].items()}
        if name == "session-udp"
        else expected()["other_files"][name]["from_client"]
    )
    with nothing_is_left(), linked() as (link, records), Client(link.port) as client:
        client.play(sent(name))
        records.wait(lambda: records.gone)
        (remote,) = records.remotes
        assert (remote.address, remote.key, remote.continued) == (client.address, 1, False)
        assert Counter("rt" + sample.route.name for sample in records.samples) == counts
        assert len([route for _, route in records.opened_routes if isinstance(route, Route)]) == 65
        assert len(records.opened_routes) == 66
        assert records.losses == []
        assert records.warnings == []
        assert len(records.threads) == 1
        statistics = link.statistics()
        assert statistics.received == len(sent(name))
        assert statistics.sent > 200
        assert (statistics.refused, statistics.dropped, statistics.lost) == (refused, 0, 0)
        assert statistics.receive_buffer > 0
    assert link.statistics().received == len(sent(name))


def test_samples_reach_the_client_and_arrive_in_order_from_many_threads() -> None:
    with linked() as (link, records), connected(link, records) as (client, remote):
        client.received()
        route = records.route("/fmu/in/trajectory_setpoint")
        assert isinstance(route, Route)

        def publish(which: int) -> None:
            for number in range(50):
                link.publish(remote, route, b"\0\1\0\0" + struct.pack("<QQ", which, number))

        threads = [threading.Thread(target=publish, args=(which,)) for which in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        found = [data for data in client.received() if kind(data) == DATA]
        assert [struct.unpack_from("<H", data, 2)[0] for data in found] == list(range(200))
        by_thread: dict[int, list[int]] = {}
        for data in found:
            which, number = struct.unpack_from("<QQ", data, 12)
            by_thread.setdefault(which, []).append(number)
        assert sorted(by_thread.values()) == [list(range(50))] * 4


def test_publishing_without_a_vehicle_is_an_error() -> None:
    with linked() as (link, records):
        with connected(link, records) as (client, remote):
            route = records.route("/fmu/in/trajectory_setpoint")
            assert isinstance(route, Route)
            client.play([data for data in sent("session-udp") if kind(data) == DELETE])
            records.wait(lambda: records.gone)
        with pytest.raises(LinkError):
            link.publish(remote, route, b"\0\1\0\0" + bytes(8))
        assert list(link.routes(remote)) == []
    with pytest.raises(LinkError):
        link.publish(remote, route, b"\0\1\0\0" + bytes(8))


# --- Faults


def test_a_client_that_restarts_50_times_is_50_remotes() -> None:
    with nothing_is_left(), linked() as (link, records):
        for number in range(1, 51):
            with Client(link.port) as client:
                client.play(creation("session-udp"))
                records.wait(lambda number=number: len(records.remotes) == number)  # type: ignore[misc]
        records.wait(lambda: len(records.opened_routes) == 50 * 66)
        assert [remote.number for remote in records.remotes] == list(range(1, 51))
    assert len(records.gone) == 50


def test_two_clients_with_one_key_are_two_vehicles() -> None:
    with linked() as (link, records), connected(link, records) as one, connected(link, records) as other:
        assert one[1].key == other[1].key == 1
        clients = one[0], other[0]
        for number in itertools.count():
            for client in clients:
                client.socket.send(sample(number, client.address.encode()))
            if records.warnings:
                break
            time.sleep(0.05)
        records.wait(lambda: len(records.samples) == 2 * number + 2)
        assert len(records.remotes) == 2
        assert all(found.payload[4:].decode() == found.remote.address for found in records.samples)
        addresses = " and ".join(sorted(client.address for client in clients))
        assert records.warnings == [
            f"two vehicles have the key 1, {addresses}: set the parameter UXRCE_DDS_KEY of one to another number"
        ]


def test_a_slow_listener_loses_datagrams_and_they_are_counted() -> None:
    free = threading.Event()

    class Slow(Records):
        def sample(self, *args: Any) -> None:
            super().sample(*args)
            free.wait(20)

    last = 1000  # so that the gap is no jump
    with linked(Slow()) as (link, records), connected(link, records) as (client, _):
        assert link.bound is not None
        link.bound.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        client.socket.send(sample(0, bytes(64)))
        records.wait(lambda: records.samples)
        for number in range(1, last):
            client.socket.send(sample(number, bytes(64)))
        free.set()
        time.sleep(0.2)
        for number in range(last, last + 100):  # a burst is counted while the client goes on
            client.socket.send(sample(number, bytes(64)))
        records.wait(lambda: len(records.samples) + sum(found for _, found in records.losses) == last + 100)
        statistics = link.statistics()
        lost = sum(found for _, found in records.losses)
        assert lost > 16
        assert statistics.lost == lost
        assert statistics.dropped == (lost if sys.platform == "linux" else 0)
    assert link.statistics().dropped == statistics.dropped


def test_an_error_of_the_listener_is_told_and_the_link_goes_on() -> None:
    class Failing(Records):
        def sample(self, *args: Any) -> None:
            super().sample(*args)
            raise ValueError("my error")

        def opened(self, *args: Any) -> None:
            super().opened(*args)
            raise KeyError("other")

        def warned(self, text: str) -> None:
            super().warned(text)
            raise RuntimeError("even this")

    with nothing_is_left(), linked(Failing()) as (link, records), Client(link.port) as client:
        client.play(sent("session-udp"))
        records.wait(lambda: records.gone)
    assert len(records.samples) == 496
    assert sorted(text.rpartition(": ")[2] for text in records.warnings) == ["'other'", "my error"]


def test_a_listener_may_close_the_link() -> None:
    class Closing(Records):
        def sample(self, *args: Any) -> None:
            super().sample(*args)
            link.close()

    with nothing_is_left():
        records = Closing()
        link = UdpLink(port=0)
        link.start(records)
        with Client(link.port) as client:
            client.play(sent("session-udp"))
            records.wait(lambda: records.gone)
    assert records.gone[0][1] == "the link was closed"


def garbage(count: int) -> Iterator[bytes]:
    """Yield bytes at random, and datagrams of a session with random changes."""
    chance = random.Random(7)  # noqa: S311
    real = sent("session-udp")
    for _ in range(count):
        if chance.random() < 0.3:
            yield chance.randbytes(chance.choice((0, 1, 3, 4, 7, 8, 12, 100, 1400)))
            continue
        data = bytearray(chance.choice(real))
        for _ in range(chance.randint(1, 4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        yield bytes(data[: chance.randint(0, len(data))] if chance.random() < 0.3 else data)


def test_garbage_from_others_does_not_disturb_a_vehicle() -> None:
    with nothing_is_left(), linked() as (link, records), connected(link, records) as (client, remote):
        with Client(link.port) as stranger:
            for number, data in enumerate(garbage(20000)):
                stranger.socket.send(data)
                if number % 200 == 0:
                    client.socket.send(sample(number // 200, bytes(24)))
                    time.sleep(0.002)
        client.socket.send(sample(100, b"\7" * 24))
        records.wait(lambda: any(found.payload[4:] == b"\7" * 24 for found in records.samples))
        mine = [found for found in records.samples if found.remote == remote and len(found.payload) == 28]
        assert len(mine) == 101
        assert link.statistics().refused > 0


def test_closing_while_traffic_flows_leaves_nothing() -> None:
    with nothing_is_left():
        for _ in range(10):
            with linked() as (link, records), connected(link, records) as (client, remote):
                route = records.route("/fmu/in/trajectory_setpoint")
                assert isinstance(route, Route)
                stop = threading.Event()

                def send(client: Client = client, stop: threading.Event = stop) -> None:
                    number = 1000
                    while not stop.is_set():
                        number += 1
                        with suppress(OSError):  # the socket of the link is closed
                            client.socket.send(sample(number, bytes(64)))

                def publish(
                    link: UdpLink = link, remote: Remote = remote, route: Route = route, stop: threading.Event = stop
                ) -> None:
                    while not stop.is_set():
                        try:
                            link.publish(remote, route, b"\0\1\0\0" + bytes(8))
                        except LinkError:
                            return

                threads = [threading.Thread(target=send), threading.Thread(target=publish)]
                for thread in threads:
                    thread.start()
                time.sleep(0.02)
                link.close()
                stop.set()
                for thread in threads:
                    thread.join()
                link.close()


def test_clock_jumps_change_no_more_than_the_times(monkeypatch: pytest.MonkeyPatch) -> None:
    jumps = iter([10**18, -(10**18)] * 100000)
    real = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: max(0, real() + next(jumps)))
    with linked() as (link, records), Client(link.port) as client:
        client.play(sent("session-udp"))
        records.wait(lambda: records.gone)
        assert len(records.samples) == 496


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_can_close_its_copy() -> None:
    with linked() as (link, records), connected(link, records) as (client, _):
        child = os.fork()
        if not child:
            signal.alarm(10)
            link.close()
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
        client.socket.send(sample(0, b"\5" * 24))
        records.wait(lambda: any(found.payload[4:] == b"\5" * 24 for found in records.samples))


# --- Who may connect


def test_a_stranger_is_refused_and_counted() -> None:
    with linked(allow=["127.0.0.2", "10.0.0.0/8"]) as (link, records):
        with Client(link.port) as stranger:
            stranger.play(creation("session-udp"))
            assert stranger.received() == []
        assert link.statistics().refused == len(creation("session-udp"))
        assert (records.remotes, records.samples) == ([], [])
        if sys.platform == "linux":  # other systems have one loopback address
            with Client(link.port, "127.0.0.2") as friend:
                friend.play(creation("session-udp"))
                records.wait(lambda: records.remotes)
        assert any("127.0.0.1" in text for text in records.warnings)


def test_a_client_with_another_key_is_refused() -> None:
    with linked(keys=[2, 3]) as (link, records), Client(link.port) as stranger:
        stranger.play(creation("session-udp"))
        records.wait(lambda: records.warnings)
        stranger.received()
        assert link.statistics().refused > 0
        assert (records.remotes, records.samples) == ([], [])


@pytest.mark.parametrize("network", ["127.0.0.1/33", "vehicle", ""])
def test_bad_networks_are_errors(network: str) -> None:
    with pytest.raises(LinkError, match=f"^'{network}' in allow= is not an IP address or a network: ex"):
        UdpLink(allow=[network])


def test_another_address_than_loopback_gives_a_warning() -> None:
    with nothing_is_left():
        for allow, advice in (([], True), (["127.0.0.1"], False)):
            link, records = UdpLink("0.0.0.0", 0, allow=allow), Records()  # noqa: S104
            link.start(records)
            link.close()
            (warning,) = records.warnings
            assert f"listening on 0.0.0.0:{link.port}" in warning
            assert "UDP has no authentication" in warning
            assert ("allow=" in warning) == advice


# --- Errors


def test_a_port_in_use_names_the_cure() -> None:
    words = r"is in use: MicroXRCEAgent .* udp://127\.0\.0\.1:\d+.*UXRCE_DDS_PRT"
    with linked() as (link, _), nothing_is_left(), pytest.raises(LinkError, match=words):
        UdpLink(port=link.port).start(Records())


@pytest.mark.parametrize(
    ("host", "port", "message"),
    [
        ("127.0.0.1", 65536, "between 0 and 65535"),
        ("127.0.0.1", -1, "between 0 and 65535"),
        ("192.0.2.1", 0, "no address of this computer"),
        ("no such host", 0, "no IPv4 address and no name"),
    ],
)
def test_bad_addresses_are_errors(host: str, port: int, message: str) -> None:
    with nothing_is_left(), pytest.raises(LinkError, match=message):
        UdpLink(host, port).start(Records())


def test_a_link_is_started_once() -> None:
    with linked() as (link, _), pytest.raises(LinkError, match="make another one"):
        link.start(Records())
    with pytest.raises(LinkError, match="make another one"):
        link.start(Records())
    UdpLink().close()


def test_an_error_inside_the_link_is_told_and_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with nothing_is_left(), linked() as (link, records), connected(link, records):

        def fail(*_: object) -> None:
            raise ZeroDivisionError("inside")

        monkeypatch.setattr(link.agent, "tick", fail)
        records.wait(lambda: records.gone)
        assert records.gone[0][1] == "the link failed: ZeroDivisionError: inside"
        records.wait(lambda: records.failures)
        assert records.failures == [records.gone[0][1]]
        with Bound("127.0.0.1", link.port).socket:
            pass  # its port was free when the listener was told


class Exiting(Records):
    def sample(self, *args: Any) -> None:
        super().sample(*args)
        raise SystemExit


def test_a_listener_that_ends_the_thread_of_the_link_is_told() -> None:
    with nothing_is_left(), linked(Exiting()) as (link, records), connected(link, records) as (client, _):
        client.socket.send(sample(0, bytes(24)))
        records.wait(lambda: records.failures)
    assert records.failures == ["the link failed: SystemExit: "]
    assert [reason for _, reason in records.gone] == records.failures


@contextmanager
def files_left(count: int) -> Iterator[None]:
    """Leave a number of file descriptors to the process."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken: list[int] = []
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(map(int, os.listdir("/proc/self/fd"))) + 20, hard))
    try:
        with suppress(OSError):
            while True:
                taken.append(os.open("/dev/null", os.O_RDONLY))
        for _ in range(count):
            os.close(taken.pop())
        yield
    finally:
        for number in taken:
            os.close(number)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.skipif(sys.platform != "linux", reason="counts files in /proc")
@pytest.mark.parametrize(
    ("make", "needed"),
    [(lambda: UdpLink(port=0), 2), (lambda: TapLink(port=0), 5), (lambda: SerialLink("/dev/ptmx"), 4)],
    ids=["udp", "tap", "serial"],
)
def test_a_link_that_lacks_files_says_so_and_leaves_nothing(make: Any, needed: int) -> None:
    pytest.importorskip("termios")  # which needs a file when it is imported
    errors = []
    for count in range(needed + 1):
        with nothing_is_left():
            link = make()
            with files_left(count):
                try:
                    link.start(Records())
                except LinkError as error:
                    errors.append(str(error))
            link.close()
    assert 0 < len(errors) <= needed  # files of other tests may be closed meanwhile
    assert "Too many open files" in errors[0]


KILLED = """
import sys, time
sys.path.insert(0, "tests")
from msggen.link.udp import UdpLink
from support.link_records import Records
link, records = UdpLink(port=int(sys.argv[1])), Records()
link.start(records)
print(link.port, flush=True)
records.wait(lambda: records.samples)
print("sample", flush=True)
time.sleep(60)
"""


def test_a_link_that_is_killed_frees_its_port_for_the_next() -> None:
    port = "0"
    for _ in range(3):
        with subprocess.Popen(
            [sys.executable, "-c", KILLED, port], cwd=ROOT, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            port = process.stdout.readline().strip()
            with Client(int(port)) as client:
                client.play(sent("session-udp")[:-1])
                assert process.stdout.readline() == "sample\n"
            process.kill()


def test_a_session_without_a_record_is_told_and_refused() -> None:
    running = [data for data in sent("session-udp") if kind(data) in {GET_INFO, WRITE_DATA} and data[0] == 0x81]
    with linked() as (link, records), Client(link.port) as client:
        client.play(running)
        records.wait(lambda: records.warnings)
        records.wait(lambda: link.statistics().refused >= 490)
        (warning,) = records.warnings
        assert warning.startswith(
            f"{client.address} has a session with an earlier program, of which there is no record"
        )
        assert records.remotes == []


def test_the_socket_says_nothing_by_itself() -> None:
    with linked() as (link, _), Client(link.port) as client:
        assert client.received() == []
        assert isinstance(client.socket, socket.socket)
