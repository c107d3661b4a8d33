"""Tests of `Vehicle` and the commands over Zenoh: own links, and one that another process owns."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen.generate.cache import package_from, package_of
from msggen.live import FormatError, LinkError, TopicError, Vehicle
from msggen.sim import Options, Simulator
from msggen.sources.finding import find_sources
from msggen.vehicle.command import send_command
from support.commands import run
from support.fake_link import FakeLink, routes_of
from support.ports import free_port
from support.repository import ROOT

pytest.importorskip("zenoh")
pytest_plugins = ["support.owned_links"]
CALM = Options(sync="off", rate=10.0)


@pytest.fixture
def url() -> str:
    return f"zenoh://127.0.0.1:{free_port()}"


@contextmanager
def simulated(url: str, types: Any, **options: Any) -> Iterator[tuple[Vehicle, Simulator]]:
    """Connect to a vehicle of a package."""
    with Vehicle(url, types, direct=True) as vehicle, Simulator(types, url, [CALM._replace(**options)]) as simulator:
        vehicle.wait_connected(20.0)
        yield vehicle, simulator


@pytest.mark.parametrize("release", ["v1.18", "v1.17"])
def test_messages_versions_and_definitions_follow_from_the_hashes(release: str, url: str, px4_types: Any) -> None:
    types = px4_types if release == "v1.18" else package_of(release)
    with simulated(url, types) as (vehicle, _):
        status = next(iter(vehicle.subscribe(types.VehicleStatus)))
        assert (status.system_id, type(status)) == (1, types.VehicleStatus)
        assert str(vehicle.wait_firmware(10.0)) == release
        names = {route.name for route in vehicle.routes}
        endpoints = {each.ros_name for each in types.topics.ENDPOINTS}
        assert names < endpoints
        assert len(names) == {"v1.18": 49, "v1.17": 47}[release]


def test_another_release_is_decoded_with_its_package(url: str, px4_types: Any) -> None:
    older = package_of("v1.17")
    with Simulator(older, url, [CALM]), Vehicle(url, (px4_types, older), direct=True) as vehicle:
        status = vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 20.0)
        assert type(status) is older.VehicleStatus


def test_types_of_another_release_are_refused(url: str, px4_types: Any) -> None:
    error = pytest.raises(FormatError, match=r"the vehicle has '/fmu/out/vehicle_status_v1', and px4_types\.VehicleSt")
    with Simulator(package_of("v1.17"), url, [CALM]), Vehicle(url, px4_types, direct=True) as vehicle, error:
        vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 20.0)


def test_definitions_of_another_firmware_follow_from_the_given_types(url: str, px4_types: Any, tmp_path: Path) -> None:
    """No embedded release has its hashes, and so the link knows neither its versions nor the sizes of its samples."""
    for source in ("msg", "srv", "dds_topics.yaml"):
        subprocess.run(["cp", "-r", str(ROOT / source), str(tmp_path)], check=True)
    for name in ("VehicleStatus", "VehicleCommand"):
        path = tmp_path / "msg" / "versioned" / f"{name}.msg"
        path.write_text(path.read_text(encoding="utf-8") + "\nuint8 of_our_own\n", encoding="utf-8")
    ours = package_from(find_sources(str(tmp_path)))
    with Simulator(ours, url, [CALM]) as simulator, Vehicle(url, (px4_types, ours), direct=True) as vehicle:
        status = vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 20.0)
        assert (type(status), status.system_id) == (ours.VehicleStatus, 1)
        sizes: set[int] = set()
        with vehicle.watch(lambda route, payload, _: sizes.add(len(payload)) if "status_" not in route.name else None):
            while 4 + ours.VehicleStatus.__msg__.cdr_size not in sizes:
                time.sleep(0.01)
        with pytest.raises(FormatError, match=r"'/fmu/in/vehicle_command' with the hash RIHS01_.*: publish a message"):
            vehicle.publish(px4_types.VehicleCommand())
        with vehicle.every(10, ours.VehicleCommand(command=400, target_system=1)):  # a busy computer drops some
            while not simulator.vehicles[0].received:
                time.sleep(0.01)
        assert not simulator.vehicles[0].refused
    error = pytest.raises(FormatError, match="'/fmu/out/vehicle_status' has the hash RIHS01_")
    with Simulator(ours, url, [CALM]), Vehicle(url, px4_types, direct=True) as vehicle, error:
        vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 20.0)


def test_the_time_of_the_vehicle_is_since_its_boot(url: str, px4_types: Any) -> None:
    with simulated(url, px4_types, rate=50.0) as (vehicle, simulator):
        vehicle.subscribe("vehicle_attitude").wait_for(lambda _: True, 10.0)
        assert abs(vehicle.time - simulator.now) < 10**6


def test_what_zenoh_does_not_have_is_said_with_what_to_do(url: str, px4_types: Any) -> None:
    with simulated(url, px4_types) as (vehicle, _):
        with pytest.raises(TopicError, match=r"rover_speed_setpoint': it is not in the list .*zenoh/pub\.csv"):
            vehicle.publish(px4_types.RoverSpeedSetpoint())
        with pytest.raises(TopicError, match="there are no services on Zenoh: publish VehicleCommand, and wait"):
            vehicle.call(px4_types.srv.VehicleCommand.Request())
        command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1, from_external=True)
        assert send_command(vehicle, command, 10.0).result == 0


@pytest.mark.parametrize("options", [CALM._replace(zenoh_tokens=False), CALM._replace(zenoh_hashes=False)])
def test_a_firmware_that_tells_less_is_a_warning(options: Options, url: str, px4_types: Any, caplog: Any) -> None:
    with Simulator(px4_types, url, [options]), Vehicle(url, px4_types, direct=True) as vehicle:
        combined = vehicle.subscribe("sensor_combined").wait_for(lambda _: True, 20.0)
        assert combined.timestamp < 10**9  # decoded without what follows it
        with pytest.raises(LinkError):  # nothing tells what it reads, or in which version
            vehicle.publish(px4_types.ArmingCheckReply())
    assert re.search("CONFIG_ZENOH_(RMW_LIVELINESS|KEY_TYPE_HASH)=y", caplog.text)


@pytest.mark.usefixtures("owned")
def test_programs_share_a_link_over_zenoh(url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [CALM._replace(rate=None)]) as simulator:
        with Vehicle(url, px4_types) as first, Vehicle(url, px4_types) as second:
            assert first.is_shared
            remote = first.wait_connected(20.0)
            assert remote == second.wait_connected(20.0)
            assert len(remote.guid) == 32
            sent = second.subscribe("/fmu/in/vehicle_command")
            with first.every(10, px4_types.VehicleCommand(command=400, target_system=1)):  # a busy computer drops some
                assert sent.wait_for(lambda _: True, 10.0).command == 400
            assert first.wait_firmware(10.0).release == "v1.18"
            with second.subscribe("vehicle_attitude") as attitudes:
                attitudes.wait_for(lambda _: True, 10.0)
                assert abs(second.time - simulator.now) < 10**6
        listed = run(["link", "list"])
        assert f"{url}" in listed.stdout
        assert f"{remote.guid} v1.18" in listed.stdout
        echoed = run(["topic", "echo", "vehicle_status", "--once", "--field", "nav_state", "--link", url])
        assert (echoed.code, echoed.stdout) == (0, "4 (AUTO_LOITER)\n---\n")
        told = run(["topic", "info", "vehicle_attitude", "--link", url])
        assert "none on Zenoh" in told.stdout
        assert f"Zenoh key     {px4_types.topics.out.vehicle_attitude.zenoh_key}\n" in told.stdout
        assert "object id" not in told.stdout


def test_sim_tells_what_crosses_zenoh(url: str) -> None:
    command = [sys.executable, "-m", "msggen", "sim", "--zenoh", url.replace("zenoh://", "tcp/"), "--for", "0.1"]
    shown = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    assert f"23 topics out, 26 in; 1 vehicle to {url}" in shown.stdout


def test_sim_says_that_no_router_answers(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.cli.commands.sim._NOTICE", 200_000)
    shown = run(["sim", "--zenoh", url.replace("zenoh://", "tcp/"), "--for", "1"])
    text = f"no Zenoh router answers at {url}: waiting for one, such as `msggen topic list --link {url}`\n"
    assert shown.code == 0
    assert shown.stderr.endswith(text)  # a note on types that are built may come before


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (
            ["--zenoh", "udp/127.0.0.1:7447"],
            "expected a locator such as tcp/127.0.0.1:7447, found 'udp/127.",
        ),
        (["--zenoh", "tcp/127.0.0.1:7447", "udp://127.0.0.1:8888"], "leave out ADDRESS or --zenoh"),
        (["--zenoh", "tcp/127.0.0.1:x"], "'x' is not a port"),
    ],
)
def test_a_wrong_router_is_named(arguments: list[str], error: str) -> None:
    shown = run(["sim", *arguments])
    assert shown.code == 2
    assert error in shown.stderr


def test_a_vehicle_is_connected_when_its_link_has_all_its_tokens(px4_types: Any) -> None:
    """Tokens come one by one, and a sample of the first topic may come before the token of the last one."""
    link = FakeLink(px4_types)
    first, second = (each._replace(type_hash="RIHS01_" + "0" * 64) for each in routes_of(px4_types)[-2:])
    with Vehicle(link, px4_types, direct=True) as vehicle:
        remote = link.connect(is_open=False)
        link.open(remote, first)
        link.sample(remote, b"\0\1\0\0" + bytes(8), first.name)
        assert not vehicle.is_connected
        link.open(remote, second)
        assert not vehicle.is_connected
        link.user().identified(remote, {}, True)  # noqa: FBT003 - as a link calls it
        assert vehicle.is_connected
        assert {each.name for each in vehicle.routes} == {first.name, second.name}
