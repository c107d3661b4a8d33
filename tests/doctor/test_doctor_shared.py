"""Tests that the doctor sees the same through a process that owns the link as at the link itself.

Two observers watch the same vehicles at the same time: one is told by the link, and one by its owner.
"""

from __future__ import annotations

import socket
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import pytest

from msggen.doctor import watching as observe
from msggen.doctor.expected import Expected, expected_of
from msggen.doctor.listener import Observer
from msggen.doctor.observation import Observation, TopicSeen, VehicleSeen
from msggen.link.address import parse_address
from msggen.link.link import Client, Link, Remote, Route, Sample, Statistics
from msggen.link.udp import UdpLink
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.vehicle.owned.places import CAN_SHARE
from msggen.vehicle.owned.unix import UnixLink
from support.findings import ids, judged
from support.link_records import PATIENCE, nothing_is_left
from support.ports import free_port
from support.served import served

pytestmark = pytest.mark.skipif(not CAN_SHARE, reason="links are not shared on Windows")

STRAY = bytes.fromhex("81010000 07010800 00f90105 01020304")
"""A sample of a session that nobody has begun."""
CALM = Options(sync="off", rate=3.0)
"""Few samples, because all vehicles, the link and both observers are in this process."""
WRONG = (
    CALM,
    CALM._replace(key=2, namespace="hash", misbehaviour=Misbehaviour(wrong_hashes=("VehicleStatus",))),
    CALM._replace(key=3, namespace="restart", misbehaviour=Misbehaviour(restart_every=6.0)),
    CALM._replace(key=4, namespace="silent", misbehaviour=Misbehaviour(silent_after=3.0)),
    CALM._replace(key=5, namespace="deaf", sync="short", misbehaviour=Misbehaviour(no_time_reply=True)),
    CALM._replace(key=6, namespace="lossy", rate=20.0, misbehaviour=Misbehaviour(drop=0.1), seed=3),
    CALM._replace(key=7, namespace="clock", sync="short", misbehaviour=Misbehaviour(clock_off=-7.0)),
    CALM._replace(key=8, namespace="twin"),
    CALM._replace(key=8, namespace="twin"),
)

FOUND = {
    "NO_TIME_SYNC",
    "KEY_SHARED",
    "VEHICLE_RESTARTS",
    "VEHICLE_SILENT",
    "DEFINITION_DIFFERS",
    "TIME_NOT_SYNCED",
    "CLOCK_WRONG",
    "RATE_LOW",
}
"""The rules that find something in them. SAMPLES_LOST does at times, because about 1 % of the samples are lost."""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder whose name is short, as those of sockets are."""
    with nothing_is_left(), TemporaryDirectory(prefix="run-") as name:
        yield Path(name)


@pytest.fixture(scope="module")
def expected(px4_types: Any) -> Expected:
    return expected_of(px4_types, "px4_types", is_given=True)


class Overheard:
    """A link that tells an observer what it tells its listener."""

    def __init__(self, link: Link, observer: Any) -> None:
        self._link, self._observer = link, observer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._link, name)

    def start(self, listener: Any) -> None:
        self._link.start(cast("Any", Both(listener, self._observer)))


class Both:
    """Two listeners of a link."""

    def __init__(self, *listeners: Any) -> None:
        self._listeners = listeners

    def __getattr__(self, name: str) -> Any:
        methods = [getattr(each, name) for each in self._listeners]

        def tell(*values: Any) -> None:
            for method in methods:
                method(*values)

        return tell


class Noting(Observer):
    """An observer that notes when the samples of each topic arrived at the link."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.arrivals: dict[tuple[int, str], list[int]] = defaultdict(list)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        self.arrivals[remote.number, route.name].append(time)
        super().sample(remote, route, payload, time)


def send_stray(link: UdpLink, count: int) -> None:
    """Send samples, and wait until the link has refused them."""
    refused = sum(link.refusals().values()) + count
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for _ in range(count):
            sock.sendto(STRAY, ("127.0.0.1", link.port))
    wait_for(lambda: sum(link.refusals().values()) == refused)


def stop_link(link: UdpLink, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the link take nothing more, and wait until its listener was told of all that it has taken."""
    has_stopped = threading.Event()
    monkeypatch.setattr(link.agent, "receive", lambda *_: None)
    monkeypatch.setattr(link.agent, "tick", lambda *_: has_stopped.set())
    assert has_stopped.wait(PATIENCE)


def without_times(seen: Observation) -> Observation:
    """Return an observation without what depends on when it was made, and on the first samples.

    Only what programs send is not known at the link itself.
    """
    return seen._replace(
        link="",
        now=0,
        hears_programs=False,
        vehicles=tuple(map(_timeless, seen.vehicles)),
        clients=tuple(each._replace(age=0.0, silence=0.0) for each in seen.clients),
    )


def _timeless(vehicle: VehicleSeen) -> VehicleSeen:
    """Leave out the samples of a session that has ended: it may have before the doctor followed all its topics."""
    vehicle = vehicle._replace(seconds=0.0, since=0, inputs={})
    if vehicle.ended:
        return vehicle._replace(topics={}, states={}, heard=0)
    topics = {name: TopicSeen(0, topic.size) for name, topic in sorted(vehicle.topics.items())}
    states = {name: tuple(each.data[:8] for each in samples[-1:]) for name, samples in vehicle.states.items()}
    return vehicle._replace(topics=topics, states=cast("Any", states))


def findings(seen: Observation, expected: Expected) -> list[str]:
    return ids(judged(seen, expected))


def wait_for(condition: Callable[[], object], patience: float = PATIENCE) -> None:
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def is_provoked(observer: Observer, url: str, expected: Expected) -> bool:
    """Whether all that is wrong with the vehicles has happened, and the doctor finds it."""
    seen = observe._seen(observer, parse_address(url), 1.0, 5.0)
    has_lost = any(each.lost > 5 for each in seen.vehicles if each.remote.namespace == "lossy")
    return has_lost and {*findings(seen, expected)} >= FOUND


@pytest.mark.night  # by day, test_doctor_times finds faults through the owner
def test_all_that_is_observed_arrives_through_the_owner(
    folder: Path, px4_types: Any, expected: Expected, monkeypatch: pytest.MonkeyPatch
) -> None:
    link, path = UdpLink(port=free_port()), folder / "x.socket"
    near, far = Noting(link), Noting(UnixLink(str(path)))
    url = f"udp://127.0.0.1:{link.port}"
    with served(cast("Link", Overheard(link, near)), path, url):
        send_stray(link, 5)  # before the doctor looks
        earlier = link.statistics()
        assert earlier.refused == 5
        near.begin()
        far.link.start(far)
        far.begin()
        assert far.counters()._replace(receive_buffer=0) == Statistics(0, 0, 0, 0, 0, 0)
        assert far.refusals() == {}
        with Simulator(px4_types, url, WRONG):
            send_stray(link, 7)
            wait_for(lambda: is_provoked(near, url, expected), 200.0)
            stop_link(link, monkeypatch)
            wait_for(lambda: cast("UnixLink", far.link).ask("state"))  # an answer comes after all samples
            at_link = observe._seen(near, parse_address(url), 1.0, 5.0)
            through = observe._seen(far, parse_address(f"unix://{path}"), 1.0, 5.0)
            present = {each.address for each in link.clients()}
        far.link.close()
    assert through.link == f"unix://{path}"
    assert sum(through.refused.values()) == 7
    since = [count - before for count, before in zip(at_link.statistics, earlier, strict=True)]
    at_link = at_link._replace(
        statistics=Statistics(*since)._replace(receive_buffer=earlier.receive_buffer),
        refused={reason: count - 5 for reason, count in at_link.refused.items()},
    )
    at_link, through = (
        each._replace(clients=tuple({client.address: client for client in each.clients}[name] for name in present))
        for each in (at_link, through)
    )  # only the one at the link has looked for others all the time
    assert without_times(through)._asdict() == without_times(at_link)._asdict()
    for vehicle, other in zip(through.vehicles, at_link.vehicles, strict=True):
        for name, topic in vehicle.topics.items():
            every, followed = (each.arrivals[vehicle.remote.number, name] for each in (near, far))
            assert followed == every[len(every) - len(followed) :], "none is missed once the owner knows its follower"
            assert topic.samples == len(followed) or (topic.samples, followed) == (1, [])  # the last one before that
            assert (topic.age is None) == (other.topics[name].age is None)
    now = max(vehicle.heard for vehicle in at_link.vehicles)
    found = findings(through._replace(now=now), expected)
    assert found == findings(at_link._replace(now=now), expected)


class Told(UnixLink):
    """The link of an owner that answers what a test says."""

    counts: Sequence[int] = (100, 0, 0, 0, 0, 4096, 0)
    silences: Sequence[float] = ()
    kept: tuple[bytes, int] | None = None
    """The last sample of each route, and its arrival."""

    def statistics(self) -> Statistics:
        return Statistics(*self.counts)

    def refusals(self) -> dict[str, int]:
        return {"too many clients": self.counts[0]}

    def warnings(self) -> list[str]:
        return ["earlier", "both"]

    def last(self, remote: Remote, route: Route) -> Sample | None:
        return self.kept and Sample(remote, route, *self.kept)

    def clients(self) -> list[Client]:
        return [Client("127.0.0.1:1", 1, 0, 600.0, silence, 9) for silence in self.silences]


def test_what_an_owner_knows_from_earlier_is_left_out_unless_it_still_holds() -> None:
    link = Told("/nowhere")
    observer = Observer(link)
    observer.warned("both")
    observer.begin()
    assert observer.warnings == ["earlier", "both"]
    link.silences = (0.0, 0.5, 50.0)
    assert [each.silence for each in observer.clients()] == [0.0, 0.5]
    link.counts = (103, 0, 0, 0, 0, 4096, 0)
    assert (observer.counters().received, observer.refusals()) == (3, {"too many clients": 3})
    link.counts = (7, 0, 0, 0, 0, 4096, 0)  # those of the next owner, after the first was killed
    assert observer.counters().received == 7
    assert observer.refusals() == {}


def test_a_vehicle_whose_samples_came_before_the_doctor_followed_them_is_not_silent() -> None:
    link = Told("/nowhere")
    observer = Observer(link)
    observer.begin()
    remote = Remote(1, "127.0.0.1:1", 1, "", continued=False)
    observer.connected(remote)
    observer.opened(remote, Route("/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "out", 1))
    observer.catch_up()
    assert observer.vehicles()[0].heard == 0
    link.kept = bytes(12), time.time_ns()
    observer.catch_up()
    (vehicle,) = observer.vehicles()
    assert vehicle.heard == link.kept[1]
    assert [topic.samples for topic in vehicle.topics.values()] == [1]


def test_another_program_is_no_agent_behind_a_socket() -> None:
    """It may be on another computer, and the ports of this one tell nothing."""
    address = parse_address("unix:///run/x.socket")
    seen = Observation(str(address), "udp", 8888, 0, 1.0, 0.0, 0)
    assert observe.look_around(seen, address) is seen
