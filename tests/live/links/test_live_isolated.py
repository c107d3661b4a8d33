"""Tests of a link in a process of its own."""

from __future__ import annotations

import io
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.live import LinkError, Vehicle
from msggen.live.link import Remote, Route
from msggen.live.links.address import parse_address
from msggen.live.links.isolated import IsolatedLink
from msggen.live.links.isolated_child import BACKLOG, Child
from msggen.live.links.pipe import EVENT, SAMPLE, record_of, records_of
from msggen.live.sim import Options, Simulator
from support.fake_link import FakeLink
from support.link_records import Records, nothing_is_left
from support.ports import free_port
from support.repository import ROOT

WAIT = 20.0
OPTIONS = [Options(sync="off", rate=50.0)]


@pytest.fixture
def url() -> Iterator[str]:
    with nothing_is_left():
        yield f"udp://127.0.0.1:{free_port()}"


def child_of(vehicle: Vehicle) -> Any:
    link: Any = vehicle._hub.link
    return link._process


def is_alive(pid: int) -> bool:
    try:
        with suppress(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)  # the tests adopt orphans
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_an_isolated_link_does_what_another_does(url: str, px4_types: Any) -> None:
    with Vehicle(url, px4_types, isolated=True) as vehicle, Simulator(px4_types, url, OPTIONS) as simulator:
        status = vehicle.subscribe(px4_types.VehicleStatus)
        assert vehicle.wait_connected(WAIT).key == 1
        assert {*vehicle.routes} <= {*vehicle._hub.link.routes(vehicle.remote)}
        status.wait_for(lambda message: message.system_id == 1, WAIT)
        for _ in range(3):
            vehicle.publish(px4_types.TrajectorySetpoint())
        command = px4_types.VehicleCommand(command=512, target_system=1, target_component=1)
        reply = vehicle.call(px4_types.srv.VehicleCommand.Request(request=command), WAIT)
        assert reply.reply.command == 512
        assert str(vehicle.wait_firmware(WAIT)) == "v1.18"
        assert vehicle.statistics.received > 0
        process = child_of(vehicle)
    assert process.returncode == 0
    assert simulator.vehicles[0].received["/fmu/in/trajectory_setpoint"] == 3


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_killed_process_is_told_and_started_again(url: str, px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    with Vehicle(url, px4_types, isolated=True) as vehicle, Simulator(px4_types, url, OPTIONS):
        status = vehicle.subscribe(px4_types.VehicleStatus)
        first = vehicle.wait_connected(WAIT)
        route = vehicle.routes[0]
        status.wait_for(bool, WAIT)
        received = vehicle.statistics.received
        child_of(vehicle).kill()
        assert vehicle.wait_disconnected(WAIT) == "the process of the link ended (killed by signal 9)"
        with pytest.raises(LinkError, match="no longer connected"):
            vehicle._hub.link.publish(first, route, b"")
        again = vehicle.wait_connected(WAIT)
        assert again.number > first.number
        before = status.received
        status.wait_for(lambda _: status.received > before, WAIT)
        assert vehicle.statistics.received >= received
    assert "the process of the link ended (killed by signal 9), and is started again" in caplog.messages


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_readers_are_told_when_the_process_cannot_be_started_again(
    url: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Vehicle(url, px4_types, isolated=True) as vehicle:
        monkeypatch.setattr("msggen.live.links.isolated.command_of", lambda _: [sys.executable, "-c", "exit(3)"])
        monkeypatch.setattr("msggen.live.links.isolated._ATTEMPTS", 2)
        child_of(vehicle).kill()
        with pytest.raises(LinkError, match=f"the link to {url} stays closed"):
            next(iter(vehicle.subscribe(px4_types.VehicleStatus)))
        with pytest.raises(LinkError, match="stays closed"):
            vehicle.wait_connected(WAIT)


def test_a_link_that_fails_ends_its_process() -> None:
    """The parent starts another process, with another link."""
    child, output = Child(), io.BytesIO()
    child.failed("the link failed: OSError")
    child.send(FakeLink(), output)  # returns at once
    child.flush(output)
    assert {"warned": "the link failed: OSError"} in [json.loads(body) for _, body in pieces(output.getvalue())]
    assert child.has_failed


def test_a_request_that_the_link_refuses_raises(url: str, px4_types: Any) -> None:
    """A tap cannot call services: the caller need not wait for a reply that will not come."""
    with Vehicle(url, px4_types) as agent:
        address = f"tap://127.0.0.1:{free_port()}?agent={url.removeprefix('udp://')}"
        with (
            Vehicle(address, px4_types, isolated=True) as vehicle,
            Simulator(px4_types, address.partition("?")[0].replace("tap", "udp"), OPTIONS),
        ):
            agent.wait_connected(WAIT)
            vehicle.wait_connected(WAIT)
            with pytest.raises(LinkError, match="cannot be called through a tap"):
                vehicle.call(px4_types.srv.VehicleCommand.Request(), 3 * WAIT)


def test_a_link_that_cannot_be_opened_raises_the_same_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        address = parse_address(f"udp://127.0.0.1:{sock.getsockname()[1]}")
        with nothing_is_left(), pytest.raises(LinkError, match="is in use: MicroXRCEAgent"):
            Vehicle(str(address), isolated=True)
    IsolatedLink(address).close()


PARENT = """
import sys, time
sys.path[:0] = [{root!r}]
from msggen.live import Vehicle
vehicle = Vehicle({url!r}, isolated=True)
print(vehicle._hub.link._process.pid, flush=True)
{end}
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("end", ["time.sleep(600)", "", "raise ZeroDivisionError"])
def test_the_process_ends_with_its_parent(url: str, end: str) -> None:
    source = PARENT.format(root=str(ROOT), url=url, end=end)
    command = [sys.executable, "-c", source]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        if "sleep" in end:
            parent.send_signal(signal.SIGKILL)
        parent.communicate(timeout=60)
    deadline = time.monotonic() + WAIT
    while is_alive(pid) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not is_alive(pid)


RECORDS = st.lists(
    st.tuples(
        st.integers(0, 2),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**16 - 1),
        st.integers(-(2**63), 2**63 - 1),
        st.binary(max_size=300),
    )
)


@given(RECORDS, st.integers(0, 30))
def test_records_come_out_as_they_went_in(records: list[Any], cut: int) -> None:
    """Whole records arrive, however the bytes are split, and an incomplete one at the end does not."""
    data = b"".join(record_of(kind, body, *rest) for kind, *rest, body in records)
    read, write = os.pipe()
    with os.fdopen(read, "rb") as stream, os.fdopen(write, "wb") as output:
        output.write(data[: len(data) - cut] if cut else data)
        output.close()
        found = list(records_of(stream))
    assert found == records[: len(found)]
    assert cut > 0 or found == records


def test_samples_that_exceed_the_backlog_are_dropped_and_events_are_not() -> None:
    child, remote = Child(), Remote(1, "127.0.0.1:1", 1, "", continued=False)
    route = Route("/fmu/out/a", "px4_msgs/msg/A", "out", 1)
    child.connected(remote)
    child.opened(remote, route)
    payload = bytes(1 << 20)
    for number in range(40):
        child.sample(remote, route, payload, number)
    child.disconnected(remote, "gone")
    output = io.BytesIO()
    child.flush(output)
    size = len(output.getvalue())
    assert BACKLOG <= size <= BACKLOG + 2 * len(payload)
    kinds = [data[0] for data in pieces(output.getvalue())]
    assert kinds == [EVENT, EVENT, *[SAMPLE] * kinds.count(SAMPLE), EVENT]
    assert child._dropped == 40 - kinds.count(SAMPLE)
    child.connected(remote)
    child.opened(remote, route)
    child.sample(remote, route, payload, 0)
    child.flush(again := io.BytesIO())
    assert len(list(pieces(again.getvalue()))) == 3


REMOTE = Remote(1, "127.0.0.1:1", 1, "", continued=False)


def test_lost_samples_are_told_as_one_sum() -> None:
    """A sender that leaves out sequence numbers cannot fill the queue."""
    child = Child()
    child.connected(REMOTE)
    for _ in range(10_000):
        child.lost(REMOTE, 2)
    child.disconnected(REMOTE, "gone")
    child.flush(output := io.BytesIO())
    told = [json.loads(body) for _, body in pieces(output.getvalue())]
    assert told[1:] == [{"remote": 1, "lost": 20_000}, {"remote": 1, "disconnected": "gone"}]


def test_a_process_whose_parent_does_not_read_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Vehicles that connect again and again are events, which are not dropped."""

    def end(code: int) -> None:
        raise SystemExit(code)

    monkeypatch.setattr("msggen.live.links.isolated_child.LIMIT", 100_000)
    monkeypatch.setattr("os._exit", end)
    child = Child()
    remotes = [REMOTE._replace(number=number) for number in range(10_000)]
    with pytest.raises(SystemExit):
        deque(map(child.connected, remotes), maxlen=0)
    assert child._size < 101_000


def test_the_counters_are_complete_when_the_link_is_closed() -> None:
    """They are told every 0.2 s, and once more at the end."""
    child, link, output = Child(), FakeLink(), io.BytesIO()
    child.obey(link, iter(()))
    child.send(link, output)  # returns at once
    link.published.append((REMOTE, Route("/fmu/in/a", "px4_msgs/msg/A", "in", 1), b""))
    child.finish(link, output)
    child.finish(link, output)
    assert [json.loads(body) for _, body in pieces(output.getvalue())] == [{"statistics": [0, 1, 0, 0, 0, 0]}]


class Refusing(FakeLink):
    def publish(self, remote: Remote, route: Route, payload: bytes) -> None:  # noqa: ARG002
        raise LinkError("the payload has 9 bytes, and the vehicle takes up to 8")


def test_the_parent_is_told_once_what_the_link_refuses() -> None:
    child = Child()
    child.connected(REMOTE)
    child.opened(REMOTE, Route("/fmu/in/a", "px4_msgs/msg/A", "in", 1))
    child.flush(io.BytesIO())
    unknown = SAMPLE, 2, 0, 0, b""
    child.obey(Refusing(), iter([(SAMPLE, 1, 0, 0, b"")] * 3 + [unknown]))
    child.flush(output := io.BytesIO())
    assert [json.loads(body) for _, body in pieces(output.getvalue())] == [
        {"warned": "the payload has 9 bytes, and the vehicle takes up to 8"}
    ]


class Raising(Records):
    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        super().sample(remote, route, payload, time)
        raise ZeroDivisionError


def test_an_error_of_the_listener_is_told_and_the_link_goes_on(url: str, px4_types: Any) -> None:
    link, records = IsolatedLink(parse_address(url)), Raising()
    link.start(records)
    try:
        with Simulator(px4_types, url, OPTIONS):
            records.wait(lambda: len(records.samples) > 5)
    finally:
        link.close()
    assert [text for text in records.warnings if "ZeroDivisionError" in text]


def pieces(data: bytes) -> Iterator[tuple[int, bytes]]:
    from msggen.live.links.pipe import HEADER

    while data:
        kind, *_, size = HEADER.unpack_from(data)
        yield kind, data[HEADER.size : HEADER.size + size]
        data = data[HEADER.size + size :]
