"""Tests of `msggen link serve --zenoh`: a process that owns a link and carries its vehicles, and what goes wrong."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.live import LinkError, Vehicle
from msggen.sim import Options, Simulator
from support.certificates import write_certificate
from support.commands import run
from support.dds_vehicle import domains, vehicle
from support.networked import networked
from support.ports import free_port
from support.repository import ROOT
from support.zenoh_space import session

pytest.importorskip("zenoh")
pytest_plugins = ["support.owned_links"]
TYPES = str(ROOT / "generated" / "px4_types")
ZENOH_DOMAINS = domains(150)


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@contextmanager
def served(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run `msggen link serve` until the end of the block, and wait for its first line."""
    command = [sys.executable, "-m", "msggen", "link", "serve", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout is not None
            assert "is open, process" in process.stdout.readline()
            while "this process is the router" not in process.stdout.readline():
                assert process.poll() is None
            yield process
        finally:
            process.send_signal(signal.SIGINT)


@pytest.mark.usefixtures("owned")
def test_a_process_owns_a_link_and_carries_its_vehicle(url: str, px4_types: Any, tmp_path: Path) -> None:
    router = f"127.0.0.1:{free_port()}"
    link = ["--link", f"zenoh://{router}", "--direct", "--types", TYPES]
    with (
        served(url, "--zenoh", f"tcp/{router}") as process,
        Simulator(px4_types, url, [Options(sync="short", rate=10.0)]),
    ):
        echoed = run(["topic", "echo", "vehicle_status", "--once", "--field", "nav_state", *link])
        assert (echoed.code, echoed.stdout) == (0, "4 (AUTO_LOITER)\n---\n")
        listed = run(["topic", "list", *link])
        assert len(listed.stdout.splitlines()) >= 69
        told = [run(["command", "arm", *link])]
        while told[-1].code and len(told) < 4:  # a busy computer can let it wait for more than 0.5 s
            told.append(run(["command", "arm", *link]))
        assert told[-1].stdout == "COMPONENT_ARM_DISARM: ACCEPTED\n"
        told_of = run(["topic", "info", "vehicle_status", *link]).stdout
        assert "on Zenoh" not in told_of
        key = re.search(
            r"Zenoh key +(0/fmu/out/vehicle_status_v4/px4_msgs::msg::dds_::VehicleStatus_/RIHS01_\w+)\n", told_of
        )
        assert key is not None
        with session(int(router.rpartition(":")[2])) as other, other.declare_subscriber(key[1]) as subscriber:
            assert subscriber.recv().payload
        target = tmp_path / "flight.mcap"
        recorded = run(["record", "vehicle_attitude", "--for", "1", "-o", str(target), *link])
        assert recorded.code == 0, recorded
        with recordings.open(str(target)) as log:
            times = log["vehicle_attitude"]["timestamp"]
            assert abs(times[-1] / 1e6 - time.time()) < 30.0
        owners = run(["link", "list"])
        assert url in owners.stdout
        assert re.search(rf"zenoh tcp/{router} \(pid {process.pid}\)", owners.stdout)
    assert process.returncode == 0


@pytest.mark.night
@pytest.mark.usefixtures("owned")
def test_in_the_background_it_has_the_types_that_are_named(url: str, px4_types: Any) -> None:
    router = f"127.0.0.1:{free_port()}"
    begun = run(["link", "serve", "--background", "--link", url, "--zenoh", f"tcp/{router}", "--types", TYPES])
    assert (begun.code, begun.stderr) == (0, "")
    with (
        Simulator(px4_types, url, [Options(sync="off", rate=10.0)]),
        Vehicle(f"zenoh://{router}", px4_types, direct=True) as vehicle,
    ):
        vehicle.wait_connected(20.0)
        vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)
    assert run(["link", "stop", url]).stdout == f"{url} is closed\n"


@pytest.mark.night
@pytest.mark.usefixtures("owned")
def test_a_vehicle_behind_an_agent_is_carried(px4_types: Any) -> None:
    domain, router = next(ZENOH_DOMAINS), f"127.0.0.1:{free_port()}"
    with (
        vehicle(domain, "", "vehicle_status"),
        served(f"dds://{domain}", "--zenoh", f"tcp/{router}"),
        Vehicle(f"zenoh://{router}", px4_types, direct=True) as found,
    ):
        found.wait_connected(30.0)
        found.subscribe("vehicle_status").wait_for(lambda _: True, 20.0)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["udp://8888", "--zenoh", "udp/127.0.0.1:1"], "expected a locator such as tcp/127.0.0.1:7447"),
        (["udp://8888", "--zenoh", "tcp/127.0.0.1:x"], "'x' is not a port"),
        (["udp://8888", "--types", TYPES], "--types and --px4 are for --zenoh"),
        (["udp://8888", "--link", "udp://8888"], "the address of the link is given already"),
        (["zenoh://7447", "--zenoh", "tcp/127.0.0.1:7448"], "its vehicles are on Zenoh already: connect the routers"),
        (["dds://0"], "'dds://0' cannot be owned for others"),
    ],
)
def test_wrong_arguments_are_named(arguments: list[str], error: str) -> None:
    shown = run(["link", "serve", *arguments])
    assert shown.code == 2
    assert error in shown.stderr


NO_CONFIGURATION = "there is no configuration of Zenoh '/none.json5': correct config="


@pytest.mark.usefixtures("owned")
@pytest.mark.parametrize(
    ("router", "error", "place"),
    [
        ("tcp/192.0.2.1:1", "no Zenoh router answers at 192.0.2.1:1, which is no address of this computer: start", []),
        (
            "tcp/127.0.0.1:1?config=/none.json5",
            f"tcp/127.0.0.1:1?config=/none.json5: L102 {NO_CONFIGURATION}",
            [],
        ),
        ("tcp/127.0.0.1:1?config=/none.json5", NO_CONFIGURATION, ["--background"]),
        ("tcp/127.0.0.1:{port}", "is in use by a program that is no Zenoh router", []),
    ],
)
def test_a_router_that_cannot_be_had_ends_the_command(url: str, router: str, error: str, place: list[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        named = router.format(port=other.getsockname()[1])
        shown = run(["link", "serve", url, "--zenoh", named, *place])
    assert shown.code == 2
    assert error in shown.stderr
    assert "no process owns a link" in run(["link", "list"]).stdout


def test_with_a_configuration_of_tls_both_sides_are_encrypted(px4_types: Any, tmp_path: Path) -> None:
    pem = str(write_certificate(tmp_path))
    tls = {"root_ca_certificate": pem, "listen_private_key": pem, "listen_certificate": pem}
    config = tmp_path / "zenoh.json5"
    config.write_text(json.dumps({"transport": {"link": {"tls": tls}}}), encoding="utf-8")
    with networked(px4_types, config=str(config)) as space:
        with Vehicle(f"{space.url}?config={config}", px4_types, direct=True) as vehicle:
            vehicle.wait_connected(20.0)
            vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)
        with pytest.raises(LinkError, match="a router with TLS needs its certificate, config= in the address"):
            Vehicle(space.url, px4_types, direct=True)


def test_a_router_that_others_can_reach_is_a_warning(px4_types: Any, caplog: Any) -> None:
    from msggen.link.address import parse_address
    from msggen.vehicle.owner.network import Network

    network = Network(parse_address(f"zenoh://0.0.0.0:{free_port()}"), "/none.socket", lambda _: (px4_types,))
    network.start()
    network.close()
    assert "whoever can connect to this port can read all topics, and command the vehicles; name a" in caplog.text


def test_a_domain_of_ros_that_is_none_is_named(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "x")
    shown = run(["link", "serve", url, "--zenoh", f"tcp/127.0.0.1:{free_port()}"])
    assert shown.code == 2
    assert "ROS_DOMAIN_ID is 'x': expected a number from 0 to 232" in shown.stderr
