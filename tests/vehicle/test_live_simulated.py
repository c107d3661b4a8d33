"""Tests of the links with simulated vehicles: commands, calls, loss, restarts, and sessions that go on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen.link.link import Link, Remote, Route, Service
from msggen.link.serial import SerialLink
from msggen.link.tap import TapLink
from msggen.link.udp import UdpLink
from msggen.sim import Misbehaviour, Options, Simulator
from support.examples import by_day
from support.lines import joined
from support.link_records import Records
from support.ports import free_port

COMMAND = "/fmu/in/vehicle_command"
SERVICE = "/fmu/vehicle_command"
FEW = Options(rate=20.0, sync="short")


@contextmanager
def started(link: Any) -> Iterator[Records]:
    records = Records()
    link.start(records)
    try:
        yield records
    finally:
        link.close()


@contextmanager
def line(kind: str, state: str = "") -> Iterator[tuple[Link, str]]:
    """Return a link that is not started, and the address for the vehicle once it is. `state` is for its records."""
    if kind == "serial":
        with joined() as (ours, theirs):
            yield SerialLink(ours, 115200, records=state), f"serial://{theirs}?baud=115200"
        return
    port = free_port()
    if kind == "udp":
        yield UdpLink(port=port, records=state), f"udp://127.0.0.1:{port}"
        return
    agent = UdpLink(port=0)
    with started(agent):
        yield TapLink(port=port, agent=("127.0.0.1", agent.port)), f"udp://127.0.0.1:{port}"


def messages(records: Records, package: Any, name: str) -> list[Any]:
    decode = getattr(package, name).decode
    return [decode(each.payload) for each in list(records.samples) if each.route.ros_type == f"px4_msgs/msg/{name}"]


def arm(link: Link, records: Records, package: Any, remote: Remote) -> None:
    """Arm a vehicle by a sample, and wait for its answer and its state."""
    command = package.VehicleCommand(command=400, param1=1.0, target_system=remote.key, from_external=True)
    route = next(route for route in link.routes(remote) if route.name.endswith(COMMAND))
    assert isinstance(route, Route)
    link.publish(remote, route, command.encode())
    records.wait(lambda: any(ack.command == 400 for ack in messages(records, package, "VehicleCommandAck")))
    records.wait(lambda: any(status.arming_state == 2 for status in messages(records, package, "VehicleStatus")))


@pytest.mark.slow  # a client waits 1 s for each lost answer
def test_loss_in_both_directions_is_counted_and_calls_arrive(px4_types: Any) -> None:
    wrong = Misbehaviour(drop=0.1, duplicate=0.05, reorder=0.05, garbage=0.02)
    bad = FEW._replace(misbehaviour=wrong)
    with line("udp") as (link, address), started(link) as records, Simulator(px4_types, address, [bad]):
        records.wait(lambda: any(isinstance(route, Service) for _, route in records.opened_routes), 120)
        service = records.route(SERVICE)
        assert isinstance(service, Service)
        request = px4_types.srv.VehicleCommand.Request(request=px4_types.VehicleCommand(command=400, param1=1.0))
        link.call(records.remotes[-1], service, 1, request.encode())
        records.wait(lambda: records.replies)
        records.wait(lambda: records.losses)
        records.wait(lambda: link.statistics().refused > 0)


def again(link: Link, address: str, state: str = "") -> Link:
    """Return another link with the address of one that is closed."""
    if isinstance(link, SerialLink):
        return SerialLink(link.path, 115200, records=state)
    return UdpLink(port=int(address.rpartition(":")[2]), records=state)


@pytest.mark.parametrize("kind", ["udp", "serial"])
def test_a_link_that_is_opened_again_goes_on_with_the_session(kind: str, tmp_path: Path, px4_types: Any) -> None:
    state = str(tmp_path)
    with (
        line(kind, state) as (link, address),
        started(link) as records,
        Simulator(px4_types, address, [FEW]),
    ):
        records.wait(lambda: records.samples)
        link.close()
        with started(other := again(link, address, state)) as others:
            others.wait(lambda: others.samples)
            (remote,) = others.remotes
            assert (remote.continued, remote.key) == (True, 1)
            records.samples.clear()
            arm(other, others, px4_types, remote)
            assert [found.number for found in others.remotes] == [1], "the vehicle did not connect again"
            assert others.warnings == []


@by_day("kind", ["udp", "serial", "tap"], 2)
def test_without_a_record_of_its_session_a_vehicle_connects_anew(kind: str, px4_types: Any) -> None:
    with (
        line(kind) as (link, address),
        started(link) as records,
        Simulator(px4_types, address, [FEW]),
    ):
        records.wait(lambda: records.samples)
        link.close()
        after = TapLink(port=link.port, agent=link.agent_address) if isinstance(link, TapLink) else again(link, address)
        with started(after) as others:
            others.wait(lambda: others.samples)
            (remote,) = others.remotes
            assert (remote.continued, remote.key) == (False, 1)
            arm(after, others, px4_types, remote)
            (warning,) = others.warnings
            assert "has a session with an earlier program, of which there is no record: it connects anew" in warning
