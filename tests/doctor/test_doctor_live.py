"""Tests of the doctor with links: each cause is provoked by simulated vehicles, sockets or readers, and found.

The vehicles of a test share a port, each in a namespace of its own, so that one observation finds the causes of all.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from msggen.cli import main
from msggen.doctor.agents import is_agent, namespaces_in
from msggen.doctor.case import Case
from msggen.doctor.diagnose import diagnose
from msggen.doctor.expected import Expected, expected_of, expected_of_catalog
from msggen.doctor.observation import Observation
from msggen.doctor.sockets import Socket, owners_of_port, parse_sockets
from msggen.doctor.watching import Plan, look_around, observe
from msggen.link.address import parse_address
from msggen.link.udp import UdpLink
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.vehicle.owned.places import CAN_SHARE
from support.commands import run
from support.dds_vehicle import domains, vehicle
from support.faults import rules_of
from support.findings import ids, judged, texts
from support.link_records import Records, nothing_is_left
from support.ports import free_port
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")
CALM = Options(sync="short", rate=10.0)
"""Few samples, so that a busy computer loses none."""
DOMAINS = domains(130)
shared = pytest.mark.skipif(not CAN_SHARE, reason="links are not shared on Windows")
linux = pytest.mark.skipif(sys.platform != "linux", reason="the owners of sockets are known on Linux")


@pytest.fixture(autouse=True)
def _do_not_wait_for_further_vehicles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.doctor.watching._SETTLED_S", 0.1)


@pytest.fixture(autouse=True)
def _alone(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the vehicles that other tests simulate at the same time."""
    if "sends_elsewhere" not in request.node.name:
        monkeypatch.setattr("msggen.doctor.watching.find_senders", lambda _: ())


@pytest.fixture
def _wait_for_further_vehicles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.doctor.watching._SETTLED_S", 2.0)


@pytest.fixture
def url() -> Iterator[str]:
    with nothing_is_left():
        yield f"udp://127.0.0.1:{free_port()}"


at_night = pytest.mark.parametrize(
    "owning", ["direct", pytest.param("owner", marks=[pytest.mark.night, shared])], indirect=True
)
Owning: TypeAlias = Callable[..., AbstractContextManager[object]]


@pytest.fixture(params=["direct", pytest.param("owner", marks=[pytest.mark.slow, shared])])
def owning(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Owning:
    """Make nothing, or the owner of a link, which is there before the vehicles and the doctor: both see the same.

    What test_doctor_times finds through an owner, in simulated time, is `at_night` found with sockets.
    """
    if request.param == "direct":
        return lambda *_, **_allow: nullcontext()
    from support.served import owned

    monkeypatch.delenv("MSGGEN_DIRECT")
    return owned


@pytest.fixture
def expected(px4_types: Any) -> Expected:
    found = expected_of(px4_types, "px4_types", is_given=True)
    return found._replace(topics=tuple(topic._replace(interval=0.1) for topic in found.topics))


def looked_at(url: str, seconds: float = 1.0, wait: float = 20.0, allow: Sequence[str] = ()) -> Observation:
    """Return what the doctor sees."""
    return observe(parse_address(url), Plan(seconds, wait, allow))


# --- vehicles


def test_a_healthy_vehicle_has_no_findings(url: str, px4_types: Any, expected: Expected) -> None:
    with Simulator(px4_types, url, [CALM]):
        seen = looked_at(url)
    report = judged(seen, expected)
    assert texts(report) == ""
    assert "69 topics, 25 heard, 63 definitions compared with px4_types" in report.summary
    for name in ("/fmu/out/vehicle_status_v4", "vehicle_status", "VehicleOdometry", "/fmu/in/trajectory_setpoint"):
        assert texts(judged(seen, expected, name)) == ""
    found = judged(
        seen, expected, "/uav_1/fmu/out/wind", "/fmu/out/vehicle_status", "sensor_gyro", "wnd", "vehicle_command_ack"
    )
    assert ids(found) == rules_of("names")


def test_a_healthy_vehicle_behind_a_tap_and_at_a_serial_line(px4_types: Any, expected: Expected) -> None:
    agent = UdpLink(port=0)
    agent.start(Records())
    try:
        url = f"udp://127.0.0.1:{free_port()}"
        with Simulator(px4_types, url, [CALM]):
            seen = looked_at(f"{url.replace('udp', 'tap')}?agent=127.0.0.1:{agent.port}")
    finally:
        agent.close()
    assert texts(judged(seen, expected)) == ""
    with joined() as (here, there), Simulator(px4_types, f"serial://{there}", [CALM]):
        seen = looked_at(f"serial://{here}")
    assert texts(judged(seen, expected)) == ""


TOGETHER = {
    "healthy": (Misbehaviour(), []),
    "hash": (Misbehaviour(wrong_hashes=("VehicleStatus",)), rules_of("hash")),
    "version": (Misbehaviour(versions={"VehicleStatus": 9}), rules_of("version")),
    "clock": (Misbehaviour(clock_off=-7.0), rules_of("clock")),
}
LONG = {
    "silent": (Misbehaviour(silent_after=3.5), rules_of("silent")),
    "deaf": (Misbehaviour(no_time_reply=True), rules_of("deaf")),
    "restart": (Misbehaviour(restart_every=3.5), rules_of("restart")),
}


def check_vehicles(
    seen: Observation, expected: Expected, options: Sequence[Options], found: Sequence[Sequence[str]]
) -> None:
    """Check that the findings about each vehicle are those that are expected."""
    for each, ids_of_vehicle in zip(options, found, strict=True):
        only = seen._replace(clients=tuple(client for client in seen.clients if client.key == each.key))
        assert ids(judged(only, expected, key=each.key)) == ids_of_vehicle, each.namespace


def options_of(rows: dict[str, tuple[Misbehaviour, list[str]]]) -> list[Options]:
    return [
        CALM._replace(key=key, namespace=name, misbehaviour=wrong)
        for key, (name, (wrong, _)) in enumerate(rows.items(), 1)
    ]


@pytest.mark.usefixtures("_wait_for_further_vehicles")
@at_night
def test_each_vehicle_has_its_cause(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    options = [
        *options_of(TOGETHER),
        CALM._replace(key=11, namespace="boot", sync="off"),
        CALM._replace(key=12, namespace="slow", rate=1.0),
    ]
    with owning(url), Simulator(px4_types, url, options):
        seen = looked_at(url)
    found = [*(ids_of_vehicle for _, ids_of_vehicle in TOGETHER.values()), rules_of("boot"), rules_of("slow")]
    check_vehicles(seen, expected, options, found)
    report = judged(seen, expected, namespace="uav_1")
    assert ids(report) == rules_of("namespace")
    there = r"those that are there have (the namespace '\w+', ){3}the namespace '\w+' and 2 more: use --namespace \w+,"
    assert re.search(there, texts(report))
    assert ids(judged(seen, expected, key=99)) == rules_of("key")
    assert "/hash/fmu/out/vehicle_status_v4" in texts(judged(seen, expected, key=2))


@pytest.mark.slow  # clients repeat a request after 1 s, and silence counts from 2 s
@at_night
def test_sessions_that_do_not_last_are_found(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    options = options_of(LONG)
    with owning(url), ThreadPoolExecutor(1) as pool:
        looking = pool.submit(looked_at, url, 3.5, 3.5)
        time.sleep(0.2)  # clients whose first ping is answered connect a second earlier
        with Simulator(px4_types, url, options):
            seen = looking.result()
    check_vehicles(seen, expected, options, [found for _, found in LONG.values()])


@at_night
def test_a_client_that_restarts_before_it_has_the_time_is_found(
    url: str, owning: Owning, px4_types: Any, expected: Expected
) -> None:
    """It is not told that the time is missing: each session asks for it, and has ended before it is known."""
    early = CALM._replace(sync="px4", misbehaviour=Misbehaviour(restart_every=2.0))
    with owning(url), Simulator(px4_types, url, [early]):
        seen = looked_at(url, wait=9.0)
    assert len(seen.clients) > 2
    assert max(client.timestamps for client in seen.clients) > 3
    report = judged(seen, expected)
    assert ids(report) == rules_of("early")
    assert re.search(r"the vehicle at 127.0.0.1:\d+ \(key 1\) has begun \d sessions in \d+ s", texts(report))


def test_damaged_datagrams_are_found(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    with owning(url), Simulator(px4_types, url, [CALM._replace(misbehaviour=Misbehaviour(garbage=0.3), seed=2)]):
        seen = looked_at(url)
    report = judged(seen, expected)
    assert ids(report) == rules_of("garbage")
    assert re.search(r"\d+ damaged datagrams of \d+ refused \(.*: \d+", texts(report))


def test_another_protocol_is_found(url: str, owning: Owning, expected: Expected) -> None:
    with owning(url), bursts(url, bytes(range(200, 240)), 3):
        report = judged(looked_at(url, wait=1.0), expected)
    assert ids(report) == rules_of("noise")


def test_another_release_is_one_finding(url: str, px4_types: Any) -> None:
    other = expected_of_catalog(read_catalog(find_sources("v1.15")), "PX4 v1.15")
    with Simulator(px4_types, url, [CALM]):
        seen = looked_at(url)
    case = Case(seen, dict.fromkeys((each.remote.number for each in seen.vehicles), other))
    every, brief = diagnose(case), diagnose(case, is_brief=True)
    assert ids(brief) == rules_of("release")
    assert re.search(
        r"has PX4 v1.18, and PX4 v1.15 is not of that: \d+ topics with another version suffix, \d+ unknown messages?, ",
        texts(brief),
    )
    assert len(every.findings) > 14
    assert {*ids(every)} == {"RELEASE_DIFFERS", "VERSION_WRONG", "TYPE_UNKNOWN", "DEFINITION_DIFFERS"}
    assert brief.advice == f"--verbose lists {len(every.findings) - 1} differences of the release"
    assert brief.summary.startswith("1 problem found: ")
    asked = diagnose(case._replace(wanted=("vehicle_status",)), is_brief=True)
    assert ids(asked) == ["VERSION_WRONG"]


@at_night
def test_lost_samples_are_found(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    options = CALM._replace(sync="off", rate=50.0, misbehaviour=Misbehaviour(drop=0.1), seed=3)
    with owning(url), Simulator(px4_types, url, [options]):
        seen = looked_at(url)
    assert ids(judged(seen, expected)) == rules_of("lossy")


@pytest.mark.usefixtures("_wait_for_further_vehicles")
@at_night
def test_two_clients_of_a_key_are_found(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    options = [CALM._replace(key=7), CALM._replace(key=7, namespace="b"), CALM._replace(key=8, namespace="c")]
    with owning(url), Simulator(px4_types, url, options):
        report = judged(looked_at(url), expected)
    assert ids(report) == rules_of("twin")
    assert "2 clients have the key 7" in texts(report)


@pytest.mark.usefixtures("_wait_for_further_vehicles")
@at_night
def test_two_vehicles_without_namespaces_are_found(
    url: str, owning: Owning, px4_types: Any, expected: Expected
) -> None:
    options = [CALM._replace(key=7), CALM._replace(key=8), CALM._replace(key=9, namespace="c")]
    with owning(url), Simulator(px4_types, url, options):
        seen = looked_at(url)
    report = judged(seen, expected)
    assert ids(report) == rules_of("same namespace")
    told = texts(report).partition(" have no namespace, so that in ROS 2 and DDS")[0]
    assert sorted(re.findall(r"\(key (\d)\)", told)) == ["7", "8"]  # in the order in which they have connected
    assert ids(judged(seen, expected, key=7)) == []


def test_a_message_that_the_types_do_not_have_is_found(url: str, px4_types: Any, expected: Expected) -> None:
    messages = {name: each for name, each in expected.messages.items() if name != "Wind"}
    with Simulator(px4_types, url, [CALM]):
        report = judged(looked_at(url), expected._replace(messages=messages))
    assert ids(report) == rules_of("type")
    assert "'/fmu/out/wind' has the type px4_msgs/msg/Wind, which is not in px4_types" in texts(report)


# --- who has the port


def test_nothing_arrives(url: str, owning: Owning, expected: Expected) -> None:
    with owning(url):
        report = judged(looked_at(url, wait=0.2), expected)
    assert ids(report) == rules_of("nothing")
    assert report.summary == f"1 problem found: {url}, no vehicle in 0 s"


@linux
def test_the_owner_of_the_port_is_named(expected: Expected) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
        address = parse_address(f"udp://127.0.0.1:{port}")
        seen = look_around(looked_at(str(address)), address, next(DOMAINS))
        assert [owner.pid for owner in seen.owners] == [os.getpid()]
    report = judged(seen, expected)
    assert ids(report) == rules_of("port")
    assert f"UDP port {port} is in use by {seen.owners[0]}: end it (`kill {os.getpid()}`)" in texts(report)


@linux
def test_a_process_that_shares_the_link_is_named(
    url: str, expected: Expected, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("MSGGEN_DIRECT")
    assert main(["link", "serve", "--background", "--link", url]) == 0
    try:
        address = parse_address(url)
        seen = look_around(observe(address, Plan(is_direct=True)), address, next(DOMAINS))
        assert main(["topic", "list", "--direct", "--link", url]) == 2
    finally:
        main(["link", "stop", url])
    assert ids(judged(seen, expected)) == ["PORT_TAKEN"]
    (owner,) = seen.owners
    told = f"is in use by msggen link (pid {owner.pid}): leave out --direct to share it, or end it (`msggen link stop"
    assert f"{told} {url}`)" in texts(judged(seen, expected))
    assert "; msggen link (pid " in capsys.readouterr().err


@linux
@pytest.mark.parametrize("name", ["MicroXRCEAgent", "python"])
def test_an_agent_with_the_vehicle_is_found(
    name: str, url: str, px4_types: Any, expected: Expected, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The agent is a link of this process. Another program of msggen is none."""
    monkeypatch.setattr("msggen.doctor.sockets.name_of", lambda _: name)
    address, records = parse_address(url), Records()
    agent = UdpLink(port=address.port)
    agent.start(records)
    try:
        with Simulator(px4_types, url, [CALM]):
            records.wait(lambda: records.samples)
            seen = look_around(looked_at(url), address, next(DOMAINS))
    finally:
        agent.close()
    assert [owner.pid for owner in seen.owners] == [os.getpid()]
    if name == "python":
        assert ids(judged(seen, expected)) == ["PORT_TAKEN"]
        return
    assert ids(judged(seen, expected)) == rules_of("agent")
    assert [client.pid for client in seen.agents[0].clients] == [os.getpid()]


def test_an_agent_without_a_client_is_found(url: str, expected: Expected, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.doctor.agents._DISCOVERY_S", 0.2)
    monkeypatch.setattr("msggen.doctor.sockets.name_of", lambda _: "MicroXRCEAgent")
    address = parse_address(url)
    agent = UdpLink(port=address.port)
    agent.start(Records())
    try:
        seen = look_around(looked_at(url), address, next(DOMAINS))
    finally:
        agent.close()
    assert ids(judged(seen, expected)) == rules_of("idle")
    assert not is_agent((address.host, address.port))


def test_a_tap_without_an_agent_is_found(url: str, owning: Owning, expected: Expected) -> None:
    tap = f"{url.replace('udp', 'tap')}?agent=127.0.0.1:{free_port()}"
    address = parse_address(tap)
    with owning(tap):
        report = judged(look_around(looked_at(tap, wait=0.2), address, next(DOMAINS)), expected)
    assert ids(report) == rules_of("no agent")


@linux
@pytest.mark.parametrize("name", ["px4", "msggen sim"])
def test_a_simulated_vehicle_that_sends_elsewhere_is_found(name: str, url: str, expected: Expected) -> None:
    other = f"udp://127.0.0.1:{free_port()}"
    words = ["sim", other, "--types", PACKAGE]
    source = f"open('/proc/self/comm', 'w').write('px4'); from msggen.cli import main; main({words!r})"
    command = ["-c", source] if name == "px4" else ["-m", "msggen", *words]
    address = parse_address(url)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, *command], env=environment, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            report = judged(look_around(looked_at(url, wait=0.2), address, next(DOMAINS)), expected)
        finally:
            process.kill()
    assert {*rules_of("elsewhere")} <= {*ids(report)}
    assert (
        f"{name} (pid {process.pid}) sends to {other.removeprefix('udp://')}, not to {url}: use --link {other}"
        in texts(report)
    )


def test_clients_that_may_not_connect_are_found(url: str, owning: Owning, px4_types: Any, expected: Expected) -> None:
    allow = ["10.0.0.0/8"]
    with owning(url, allow=allow), Simulator(px4_types, url, [CALM]):
        time.sleep(1.5)  # an owner has told of it when the doctor joins
        report = judged(looked_at(url, wait=2.5, allow=allow), expected)
    assert ids(report) == rules_of("refused")
    assert "of 127.0.0.1 refused, because the address is not in --allow" in texts(report)


def burst(url: str, data: bytes, count: int, closing: threading.Event) -> None:
    """Send datagrams again and again, many at once."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        address = parse_address(url)
        while not closing.wait(0.1):
            for _ in range(count):
                sock.sendto(data, (address.host, address.port))


@contextmanager
def bursts(url: str, data: bytes, count: int) -> Iterator[None]:
    closing = threading.Event()
    thread = threading.Thread(target=burst, args=(url, data, count, closing))
    thread.start()
    try:
        yield
    finally:
        closing.set()
        thread.join()


def test_samples_of_an_unknown_session_are_found(url: str, owning: Owning, expected: Expected) -> None:
    with owning(url), bursts(url, bytes.fromhex("81010000 07010800 00f90105 01020304"), 1):
        report = judged(looked_at(url, wait=0.5), expected)
    assert ids(report) == rules_of("unready")


@linux
def test_datagrams_that_the_kernel_drops_are_found(
    url: str, owning: Owning, px4_types: Any, expected: Expected, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.link.udp.RECEIVE_BUFFER", 2048)
    with owning(url), Simulator(px4_types, url, [CALM]), bursts(url, bytes(1400), 200):
        seen = looked_at(url)
    assert {*rules_of("buffer")} <= {*ids(judged(seen, expected))}
    assert seen.buffer_limit > 0


# --- serial lines


@contextmanager
def joined() -> Iterator[tuple[str, str]]:
    """Yield the paths of both ends of a serial line."""
    (first, first_end), (second, second_end) = os.openpty(), os.openpty()
    closing = threading.Event()

    def carry() -> None:
        while not closing.is_set():
            for master in select.select([first, second], [], [], 0.05)[0]:
                os.write(second if master == first else first, os.read(master, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(first_end), os.ttyname(second_end)
    finally:
        closing.set()
        thread.join()
        for each in (first, first_end, second, second_end):
            os.close(each)


def test_a_line_that_is_too_slow_is_found(owning: Owning, px4_types: Any, expected: Expected) -> None:
    with joined() as (here, there):
        url = f"serial://{here}?baud=57600"
        with owning(url), Simulator(px4_types, f"serial://{there}", [CALM._replace(rate=20.0)]):
            report = judged(looked_at(url), expected)
    assert [each for each in ids(report) if each != "VEHICLE_RESTARTS"] == rules_of("full")  # pings get lost, too
    assert re.search(
        r"and 57600 baud carries 5,760: .* most cost /fmu/out/position_setpoint_triplet [\d,]+", texts(report)
    )


@linux
def test_a_line_with_another_speed_or_owner_is_found(owning: Owning, expected: Expected) -> None:
    master, slave = os.openpty()
    path = os.ttyname(slave)
    url = f"serial://{path}?baud=57600"
    with ExitStack() as stack:
        stack.callback(os.close, master)
        stack.callback(os.close, slave)
        timer = threading.Timer(0.3, os.write, (master, bytes(range(1, 100)) * 30))
        with owning(url):
            timer.start()
            garbled = judged(looked_at(url, wait=1.0), expected)
            timer.join()
        fcntl.flock(slave, fcntl.LOCK_EX)
        taken = look_around(looked_at(url), parse_address(url))
    assert ids(garbled) == rules_of("garbled")
    assert ids(judged(taken, expected)) == ["PORT_TAKEN"]
    assert os.getpid() in [owner.pid for owner in taken.owners]
    assert f"{path} is in use by" in texts(judged(taken, expected))


# --- DDS


def test_readers_in_dds_are_judged(px4_types: Any) -> None:
    with ExitStack() as stack:
        domain = next(DOMAINS)
        stack.enter_context(vehicle(domain, "", "vehicle_status", "vehicle_attitude"))
        from msggen.link.cyclone import Participant
        from msggen.link.dds import LOOPBACK

        program = Participant(domain, LOOPBACK)
        stack.callback(program.close)
        status, attitude = "px4_msgs::msg::dds_::VehicleStatus_", "px4_msgs::msg::dds_::VehicleAttitude_"
        program.reader("rt/fmu/out/vehicle_attitude", attitude, is_reliable=True)
        program.reader("rt/fmu/out/vehicle_status", status, is_reliable=False)
        assert namespaces_in(domain) == ("",)
        seen = looked_at(f"dds://{domain}")
    report = judged(seen, expected_of(px4_types, "px4_types", is_given=False))
    assert ids(report) == rules_of("readers")  # its timestamps are numbers from 1
    assert "a reader in DDS gets nothing: '/fmu/out/vehicle_status' has another version suffix" in texts(report)
    assert "a reader of '/fmu/out/vehicle_attitude' is RELIABLE" in texts(report)


# --- the sockets of the kernel


@linux
def test_the_sockets_of_the_kernel_are_read() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        sock.bind(("127.0.0.1", 0))
        peer.connect(sock.getsockname())
        table = list(parse_sockets(Path("/proc/net/udp").read_text(encoding="ascii")))
        inode = os.fstat(peer.fileno()).st_ino
        assert Socket(peer.getsockname(), sock.getsockname(), inode) in table
        assert os.getpid() in [owner.pid for owner in owners_of_port(sock.getsockname()[1])]


def test_a_table_of_sockets() -> None:
    text = """  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref drops
  1: 0100007F:22B8 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 31337 2 0
  2: 0000000000000000FFFF00000100007F:22B9 00000000000000000000000000000000:0000 07 0:0 0:0 0 0 0 7 2 0 0
  3: nonsense
"""
    if sys.byteorder == "little":
        assert list(parse_sockets(text)) == [
            Socket(("127.0.0.1", 8888), ("0.0.0.0", 0), 31337),  # noqa: S104
            Socket(("127.0.0.1", 8889), ("::", 0), 7),
        ]


# --- the command


def test_the_command_says_that_nothing_is_wrong(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulator(px4_types, url, [Options(sync="short")]):
        assert main(["doctor", "--link", url, "--for", "1", "--types", PACKAGE]) == 0
    assert capsys.readouterr().out.startswith(f"no problem found: {url}, the vehicle at 127.0.0.1:")


def test_the_command_tells_what_it_finds(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """Without types, definitions are compared with the release of the vehicle."""
    wrong = Misbehaviour(wrong_hashes=("VehicleStatus",), clock_off=5.0)
    with Simulator(px4_types, url, [CALM._replace(misbehaviour=wrong)]):
        assert main(["doctor", "--link", url, "--for", "1", "--json", "vehicle_status", "vehicle_stats"]) == 1
    told = json.loads(capsys.readouterr().out)
    with Simulator(px4_types, url, [CALM._replace(misbehaviour=wrong)]):
        check = ["check", "--live", "--link", url, "--output-format", "concise", "--wait", "30"]
        assert main([*check, PACKAGE]) == 1
    first, *_, last = capsys.readouterr().out.splitlines()
    assert [finding["rule"] for finding in told["findings"]] == ["TOPIC_UNKNOWN", "DEFINITION_DIFFERS", "CLOCK_WRONG"]
    assert "did you mean 'vehicle_status'?" in told["findings"][0]["message"]
    assert "in PX4 v1.18: build the types" in told["findings"][1]["message"]
    assert first.startswith(f"{url}: DEFINITION_DIFFERS '/fmu/out/vehicle_status_v4': VehicleStatus has the hash 0x")
    assert last == f"{PACKAGE} differs from the vehicle on {url}: 63 definitions compared"


def test_an_interrupted_watch_is_judged(
    url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("msggen.doctor.watching._wait", interrupt)
    monkeypatch.setattr("msggen.doctor.watching._places", lambda *_: [])
    assert main(["doctor", "--link", url]) == 1
    assert "NO_CLIENT" in capsys.readouterr().out


def test_definitions_of_any_source_are_checked_against_the_vehicle(
    url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, url, [CALM]):
        assert main(["check", "--live", "--link", url, "v1.18"]) == 0
        assert capsys.readouterr().out.endswith(f" matches the vehicle on {url}: 63 definitions compared\n")


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["doctor", "--link", "serial:///dev/none"], "L102 there is no device"),
        (["doctor", "--link", "8888"], "L101 '8888' is not the address of a link"),
        (["doctor", "--types", "nothing_here"], "L103 cannot be imported"),
        (["check", "--live", "--wait", "0.2", "v1.18"], "L104 no vehicle has created its topics within 0 s"),
    ],
)
def test_what_cannot_be_looked_at_is_an_error(
    words: list[str], code: str, url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, *([] if "--link" in words else ["--link", url])]) == 2
    assert code in capsys.readouterr().err


def test_errors_are_json_too(capsys: pytest.CaptureFixture[str]) -> None:
    outputs = []
    for words in (["--json"], ["--output-format", "json"]):
        assert main(["doctor", *words, "--link", "serial:///dev/none"]) == 2
        outputs.append(json.loads(capsys.readouterr().out))
    assert outputs[0] == outputs[1]
    assert outputs[0]["errors"][0]["code"] == "L102"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["check", "--live", "a", "b"], "--live compares one source with the vehicle"),
        (["check", "a", "--link", "udp://127.0.0.1:9"], "--link is for a vehicle: add --live"),
        (["check"], "the following arguments are required: PKG"),
        (["doctor", "--for", "x"], "argument --for: expected a number"),
    ],
)
def test_wrong_arguments(words: list[str], text: str) -> None:
    outcome = run(words)
    assert outcome.code == 2
    assert text in outcome.stderr
