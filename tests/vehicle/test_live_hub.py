"""Tests of several vehicles on one link: who gets which, and when the link is closed."""

from __future__ import annotations

import asyncio
import gc
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from msggen.link.link import deliver
from msggen.link.xrce.agent import Agent
from msggen.live import LinkError, LinkTimeoutError, Vehicle
from msggen.sim import Options, Simulator
from msggen.vehicle import vehicle as vehicle_module
from support.examples import by_day
from support.fake_link import FakeLink
from support.link_records import nothing_is_left
from support.ports import free_port
from support.repository import ROOT
from support.xrce_client import Client, World, start

WAIT = 10.0


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


def test_vehicles_are_selected_by_key_namespace_and_address(link: FakeLink, px4_types: Any) -> None:
    with (
        Vehicle(link, key=2) as by_key,
        Vehicle(link, namespace="/uav_3/") as by_namespace,
        Vehicle(link, address="10.0.0.4") as by_host,
        Vehicle(link, address="10.0.0.4:5") as by_address,
    ):
        remotes = [
            link.connect(2),
            link.connect(3, "uav_3", "127.0.0.1:3"),
            link.connect(4, "", "10.0.0.4:4"),
            link.connect(5, "", "10.0.0.4:5"),
        ]
        vehicles = [by_key, by_namespace, by_host, by_address]
        assert [vehicle.remote for vehicle in vehicles] == remotes
        subscriptions = [vehicle.subscribe(px4_types.VehicleStatus) for vehicle in vehicles]
        for number, remote in enumerate(remotes):
            link.sample(remote, px4_types.VehicleStatus(timestamp=number))
        found = [
            [message.timestamp for message in map(px4_types.VehicleStatus.decode, payloads)]
            for payloads in [[item[0] for item in subscription._feed.queue] for subscription in subscriptions]
        ]
        assert found == [[0], [1], [2], [3]]
        assert link.starts == 1
        by_key.close()
        by_host.close()
        by_namespace.close()
        assert not link.closed.is_set()
    assert link.closed.is_set()


def test_the_first_vehicle_is_taken_and_the_second_is_told_once(
    link: FakeLink, caplog: pytest.LogCaptureFixture
) -> None:
    with Vehicle(link) as vehicle:
        first = link.connect(1)
        for key in (2, 3, 3):
            link.connect(key, address=f"127.0.0.1:{key}")
        assert vehicle.remote == first
    own = "the vehicle at 127.0.0.1:40000 (key 1)"
    text = f"the vehicle at 127.0.0.1:2 (key 2) connected too and is ignored, as this Vehicle has {own}"
    assert caplog.messages == [f"{text}: select one by key, namespace or address"]


def test_the_lowest_key_is_taken_of_those_that_are_connected(link: FakeLink) -> None:
    with Vehicle(link, key=7):
        for key in (5, 2, 7):
            link.connect(key, address=f"127.0.0.1:{key}")
        with Vehicle(link) as vehicle:
            assert vehicle.remote.key == 2
            assert [each.key for each in vehicle.others] == [5, 7]
        with Vehicle(link, key=5) as chosen:
            assert (chosen.remote.key, chosen.others) == (5, ())


def test_two_vehicles_for_two_objects_are_not_told(link: FakeLink, caplog: pytest.LogCaptureFixture) -> None:
    with Vehicle(link, key=1), Vehicle(link, key=2):
        link.connect(1)
        link.connect(2)
    assert caplog.messages == []


def test_a_vehicle_is_found_that_connected_before(link: FakeLink) -> None:
    with Vehicle(link, key=1) as first:
        remotes = [link.connect(1), link.connect(2)]
        with Vehicle(link, key=2) as second:
            assert [first.remote, second.remote] == remotes
            assert len(second.routes) == len(link.routes(remotes[1])) - 1
            assert [service.name for service in second.services] == ["/fmu/vehicle_command"]


def test_only_the_same_vehicle_is_taken_again(link: FakeLink) -> None:
    with Vehicle(link) as vehicle:
        first = link.connect(1)
        link.connect(2)
        link.disconnect(first)
        assert not vehicle.is_connected, "the other vehicle is not taken"
        link.connect(3)
        assert not vehicle.is_connected
        again = link.connect(1, address="127.0.0.1:50000")
        assert vehicle.remote == again


def test_a_vehicle_that_restarts_may_connect_before_its_old_session_ends(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link) as vehicle:
        old = link.connect(1, address="127.0.0.1:1")
        link.sample(old, px4_types.VehicleStatus(), when=1)
        new = link.connect(1, address="127.0.0.1:2")
        assert vehicle.remote == old
        link.disconnect(old)
        assert vehicle.remote == new


def test_a_vehicle_that_restarts_often_leaves_nothing(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link) as vehicle:
        subscription = vehicle.subscribe(px4_types.VehicleStatus)
        for number in range(50):
            remote = link.connect(address=f"127.0.0.1:{40000 + number}")
            link.sample(remote, px4_types.VehicleStatus(timestamp=number))
            link.answer(remote, most=3)
            link.disconnect(remote)
        assert vehicle._hub.entries == {}
        assert vehicle._member.entry is None
        assert subscription.received == 50


@pytest.mark.parametrize("leaver", [0, 1])
def test_of_two_vehicles_with_one_key_the_one_that_remains_is_taken(
    link: FakeLink, px4_types: Any, leaver: int
) -> None:
    with Vehicle(link) as vehicle:
        remotes = [link.connect(1, address=f"127.0.0.1:{port}") for port in (1, 2)]
        for remote in (*remotes, *remotes):
            link.sample(remote, px4_types.VehicleStatus())
        assert vehicle.remote == remotes[0]
        link.disconnect(remotes[leaver])
        assert vehicle.remote == remotes[1 - leaver]
        third = link.connect(1, address="127.0.0.1:3")
        link.disconnect(remotes[1 - leaver])
        assert vehicle.remote == third


def test_a_vehicle_whose_key_another_one_has_stays_connected(link: FakeLink, caplog: pytest.LogCaptureFixture) -> None:
    """The agent tells which datagrams belong to which vehicle, and the Vehicle keeps its own."""
    agent = Agent(0.0)
    clients = [Client(50001), Client(50002)]
    with Vehicle(link) as vehicle:
        world = World(agent, *clients)
        for client in clients:
            start(client)
        world.settle()
        for _ in range(20):
            for client in clients:
                client.write(1, bytes(8))
            world.run(0.1)
            give(world, link)
            assert vehicle.remote.address == "127.0.0.1:50001"
        clients[1].delete()
        world.settle()
        give(world, link)
        assert vehicle.remote.address == "127.0.0.1:50001"
        world.clients = [Client(50003)]
        start(world.clients[0])
        world.settle()
        clients[0].delete()
        world.clients.append(clients[0])
        world.settle()
        give(world, link)
        assert vehicle.remote.address == "127.0.0.1:50003"
    warnings = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert "two vehicles have the key 1, 127.0.0.1:50001 and 127.0.0.1:50002: set the parameter" in warnings[0]


def give(world: World, link: FakeLink) -> None:
    """Give the events of an agent to the Vehicle objects of a link."""
    deliver(world.events, link.user())
    world.events.clear()


def test_a_continued_session_is_selected_by_its_key_and_namespace(link: FakeLink) -> None:
    with Vehicle(link, key=2) as by_key, Vehicle(link, namespace="uav_1") as by_name, Vehicle(link, key=3) as other:
        remote = link.connect(2, namespace="uav_1", continued=True)
        assert [by_key.remote, by_name.remote] == [remote, remote]
        assert not other.is_connected
        link.disconnect(remote)
        other_one, again = link.connect(3, namespace="uav_1"), link.connect(2, namespace="uav_1")
        assert [by_key.remote, by_name.remote, other.remote] == [again, again, other_one]


def test_a_wrong_selection_is_told(link: FakeLink) -> None:
    with Vehicle(link, key=7) as vehicle:
        link.connect(1)
        with pytest.raises(
            LinkTimeoutError, match=r"only .* \(key 1\) is connected, and one with the key 7 was asked for"
        ):
            vehicle.wait_connected(0.01)


@pytest.mark.parametrize("link_name", ["dds://0", "udp://127.0.0.1:8888"])
def test_a_wait_without_a_limit_tells_once_what_to_check(
    link_name: str, link: FakeLink, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vehicle_module, "PATIENCE", 0.05)
    with Vehicle(link) as vehicle:
        vehicle.url = link_name
        timer = threading.Timer(0.6, link.connect)
        timer.start()
        vehicle.wait_connected()
    (told,) = [record for record in caplog.records if "no vehicle connected" in record.message]
    assert told.levelname == "WARNING"
    assert told.message.startswith(f"no vehicle connected to {link_name} within 0.05 s: ")
    assert ("an agent runs" if link_name == "dds://0" else "uxrce_dds_client runs") in told.message


def test_time_limits_are_told(link: FakeLink) -> None:
    with Vehicle(link) as vehicle:
        link.connect()
        with pytest.raises(LinkTimeoutError, match=r"is still connected after 0\.01 s"):
            vehicle.wait_disconnected(0.01)
        with pytest.raises(LinkTimeoutError, match=r"has not answered for all its messages within 0\.01 s: "):
            vehicle.wait_firmware(0.01)


def test_a_link_that_cannot_be_opened_leaves_nothing(link: FakeLink) -> None:
    link.error = LinkError("port 8888 is in use")
    with pytest.raises(LinkError, match="in use"):
        Vehicle(link)
    link.error = None
    with Vehicle(link):
        assert link.starts == 2


def test_vehicles_that_share_a_link_allow_the_same() -> None:
    """Otherwise a Vehicle would get strangers that it does not allow, or never its own vehicle."""
    url = f"udp://127.0.0.1:{free_port()}"
    with Vehicle(url, allow=("127.0.0.1", "10.8.0.0/24")):
        for allow in ((), "127.0.0.1", ("127.0.0.1", "10.8.0.0/24", 7)):
            with pytest.raises(LinkError, match="is open with another allow=: give its Vehicle objects the same one"):
                Vehicle(url, allow=allow)
        Vehicle(url, allow=["10.8.0.0/24", "127.0.0.1"]).close()


def test_a_link_object_has_its_own_allow(link: FakeLink) -> None:
    with pytest.raises(LinkError, match="give it to the Link itself"):
        Vehicle(link, allow="127.0.0.1")
    assert link.starts == 0


def test_a_link_can_be_opened_again_after_it_was_closed(link: FakeLink) -> None:
    for number in range(3):
        with Vehicle(link):
            assert link.starts == number + 1


def test_vehicles_join_and_leave_from_many_threads(link: FakeLink, px4_types: Any) -> None:
    errors: list[BaseException] = []

    def run() -> None:
        try:
            for _ in range(50):
                with Vehicle(link) as vehicle:
                    vehicle.subscribe(px4_types.VehicleStatus).close()
        except BaseException as error:  # noqa: BLE001
            errors.append(error)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert errors == []
    assert link.closed.is_set()
    gc.collect()


# A link that fails


FAILED = "the link failed: OSError: no more"


def raised(call: Callable[[], object]) -> Callable[[], str]:
    """Call a function in another thread. Return a function that waits, and returns the text of its error."""
    errors: list[str] = []

    def run() -> None:
        with pytest.raises(LinkError) as caught:
            call()
        errors.append(str(caught.value))

    thread = threading.Thread(target=run)
    thread.start()

    def joined() -> str:
        thread.join(WAIT)
        return errors[0]

    return joined


def test_everybody_who_waits_is_told_that_the_link_has_failed(
    link: FakeLink, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    async def read() -> None:
        async for _ in vehicle.subscribe(px4_types.VehicleStatus):
            pass

    with Vehicle(link) as vehicle, Vehicle(link, key=2) as other:
        remote = link.connect()
        read_before = vehicle.subscribe(px4_types.VehicleStatus)
        link.sample(remote, px4_types.VehicleStatus(timestamp=7))
        waits = [
            raised(lambda: next(iter(vehicle.subscribe(px4_types.VehicleStatus)))),
            raised(lambda: vehicle.subscribe(px4_types.VehicleStatus).wait_for(bool)),
            raised(lambda: asyncio.run(read())),
            raised(other.wait_connected),
        ]
        while len(vehicle._member.feeds) < 5:  # that of wait_for, too
            time.sleep(0.01)
        link.fail()
        assert [wait() for wait in waits] == [FAILED] * 3 + [f"{FAILED}; close the Vehicle, and make a new one"]
        messages = iter(read_before)
        assert next(messages).timestamp == 7, "what has arrived can be read"
        with pytest.raises(LinkError, match=FAILED):
            next(messages)
        with pytest.raises(LinkError, match=FAILED):
            vehicle.publish(px4_types.TrajectorySetpoint())
        with pytest.raises(LinkError, match=FAILED):
            vehicle.subscribe(px4_types.VehicleStatus)
        assert vehicle.wait_disconnected(0) == FAILED
        assert FAILED in repr(vehicle)
    assert caplog.messages.count(f"{FAILED}; close the Vehicle, and make a new one") == 1


def test_a_repeater_ends_when_the_link_has_failed(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link) as vehicle:
        link.connect()
        repeater = vehicle.every(100, px4_types.TrajectorySetpoint())
        assert link.sent.wait(WAIT)
        link.fail()
        repeater._thread.join(WAIT)
        assert not repeater.is_running
        assert FAILED in str(repeater.error)


def test_a_new_vehicle_gets_another_link_than_the_one_that_has_failed(
    monkeypatch: pytest.MonkeyPatch, px4_types: Any
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with nothing_is_left():
        failed = Vehicle(url, px4_types)
        link: Any = failed._hub.link
        monkeypatch.setattr(link.agent, "tick", lambda _: 1 / 0)
        with pytest.raises(LinkError, match="the link failed: ZeroDivisionError"):
            failed.wait_connected(WAIT)
        with Vehicle(url, px4_types) as vehicle, Simulator(px4_types, url, [Options(sync="off", rate=10.0)]):
            failed.close()  # and leaves the other one as it is
            assert vehicle.wait_connected(WAIT).key == 1
            with Vehicle(url, px4_types) as third:
                assert third._hub is vehicle._hub


def test_a_link_object_that_has_failed_says_why(link: FakeLink) -> None:
    with Vehicle(link):
        link.fail()
        with pytest.raises(LinkError, match=f"{FAILED}; make another FakeLink"):
            Vehicle(link)


END = """
import sys
sys.path[:0] = [{root!r}, {tests!r}]
from msggen.live import Vehicle
from support.fake_link import FakeLink

class Link(FakeLink):
    def close(self):
        print("closed")

vehicle = Vehicle(Link())
{end}
"""


@pytest.mark.parametrize("end", ["", "raise SystemExit(0)", "del vehicle", "def f(): raise ZeroDivisionError\n"])
def test_the_link_is_closed_when_the_program_ends(end: str) -> None:
    source = END.format(root=str(ROOT), tests=str(ROOT / "tests"), end=end)
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "closed\n"


INTERRUPT = """
import _thread, sys, threading
sys.path[:0] = [{root!r}, {tests!r}, {generated!r}]
from msggen.live import Vehicle
from support.fake_link import FakeLink
import px4_types

link = FakeLink(px4_types)
with Vehicle(link) as vehicle:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    threading.Timer(0.3, lambda: __import__("os").kill(__import__("os").getpid(), 2)).start()
    try:
        {wait}
    except KeyboardInterrupt:
        print("interrupted")
print(link.closed.is_set())
"""


@by_day(
    "wait",
    [
        "next(iter(subscription))",
        "subscription.wait_for(bool)",
        "vehicle.wait_connected()",
        "__import__('asyncio').run(subscription.__aiter__().__anext__())",
    ],
    2,
)
def test_ctrl_c_ends_a_wait(wait: str) -> None:
    places = {"root": str(ROOT), "tests": str(ROOT / "tests"), "generated": str(ROOT / "generated")}
    source = INTERRUPT.format(wait=wait, **places)
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.returncode) == ("interrupted\nTrue\n", 0), done.stderr
