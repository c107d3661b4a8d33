"""Tests that a Zenoh program of others, zenoh-ros2-sdk, finds and follows a vehicle of `msggen sim --zenoh`.

It is installed from the package index, into an environment of its own, and used as its documentation says.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
import venv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.link.zenoh import ZenohLink
from msggen.sim import Options, Simulator
from support.link_records import Records
from support.ports import free_port
from support.repository import ROOT

pytest.importorskip("zenoh")
pytestmark = [pytest.mark.night, pytest.mark.timeout(600)]
PATIENCE = 120.0

PROGRAM = """\
import os, sys, time
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession
from px4_types import VehicleAttitude, VehicleCommand

place = {"router_ip": "127.0.0.1", "router_port": int(sys.argv[1])}
own, samples = [], []
attitudes = ROS2Subscriber(
    "/fmu/out/vehicle_attitude", "px4_msgs/msg/VehicleAttitude", own.append,
    msg_definition=VehicleAttitude.__msg__.definition, **place,
)
session = ZenohSession.get_instance(*place.values()).session
beside = session.declare_subscriber(attitudes.keyexpr, samples.append)
publisher = ROS2Publisher(
    "/fmu/in/vehicle_command", "px4_msgs/msg/VehicleCommand", msg_definition=VehicleCommand.__msg__.definition, **place
)
values = {each.name: 0 for each in VehicleCommand.__msg__.fields} | {"command": 400, "target_system": 1}
values |= {f"param{number}": 0.0 for number in (1, 2, 3, 4, 7)} | {"from_external": True}
end = time.monotonic() + 60
while not samples and time.monotonic() < end:
    time.sleep(0.1)
publisher.publish(**values)
time.sleep(1.0)
print(attitudes.keyexpr)
print(len(own), VehicleAttitude.decode(samples[-1].payload.to_bytes(), allow_surplus=True).q, flush=True)
os._exit(0)  # its sessions take long to end
"""
"""What a program does with the kit, and with the generated package for the samples that the kit cannot decode."""


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of programs of an environment with zenoh-ros2-sdk."""
    folder = tmp_path_factory.mktemp("zenoh-ros2-sdk")
    venv.create(folder, with_pip=False, symlinks=True)
    pip = [sys.executable, "-m", "pip", f"--python={folder / 'bin' / 'python'}", "install", "--quiet", "--no-compile"]
    done = subprocess.run([*pip, "zenoh-ros2-sdk"], timeout=PATIENCE, check=False, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"zenoh-ros2-sdk cannot be installed: {done.stderr.strip()[-200:]}")
    return folder / "bin"


@pytest.fixture
def vehicle(px4_types: Any) -> Iterator[tuple[int, Any]]:
    """The port of msggen's router, and a simulated vehicle there."""
    port, records = free_port(), Records()
    link = ZenohLink(port=port)
    link.start(records)
    try:
        with Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [Options(sync="off", rate=20.0)]) as simulator:
            records.wait(lambda: len(records.opened_routes) == 49)
            yield port, simulator.vehicles[0]
    finally:
        link.close()


def run(*command: object) -> str:
    done = subprocess.run(
        list(map(str, command)),
        timeout=PATIENCE,
        check=False,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT / "generated"), "PATH": "/usr/bin:/bin", "HOME": "/nonexistent"},
    )
    return done.stdout + done.stderr


def test_it_lists_the_topics_with_types_and_hashes(programs: Path, vehicle: tuple[int, Any], px4_types: Any) -> None:
    tool = [programs / "zenoh-ros2", "--router", f"127.0.0.1:{vehicle[0]}", "--no-daemon"]
    listed = re.findall(r"(?m)^(/fmu/\S+) \[(\S+)\]$", run(*tool, "topic", "list", "-t"))
    on_zenoh = [each for each in px4_types.topics.ENDPOINTS if each.on_zenoh]
    names = [each.zenoh_key.removeprefix("0").partition("/px4_msgs")[0] for each in on_zenoh]
    assert dict(listed) == {name: each.message.__msg__.ros_type for name, each in zip(names, on_zenoh, strict=True)}
    told = run(*tool, "topic", "info", "-v", "/fmu/out/vehicle_attitude")
    assert px4_types.VehicleAttitude.__msg__.type_hash in told
    assert "Publisher count: 1" in told


def test_it_follows_topics_and_publishes(programs: Path, vehicle: tuple[int, Any], px4_types: Any) -> None:
    """PX4's samples have bytes behind the message, which its own subscriber refuses, whoever the vehicle is."""
    shown = run(programs / "python", "-c", PROGRAM, vehicle[0])
    lines = shown.splitlines()
    assert px4_types.topics.out.vehicle_attitude.zenoh_key in lines, shown
    assert "0 (1.0, 0.0, 0.0, 0.0)" in lines, shown
    assert "CDR message size mismatch for 'px4_msgs/msg/VehicleAttitude'" in shown
    end = time.monotonic() + 10
    while not vehicle[1].received and time.monotonic() < end:
        time.sleep(0.05)
    assert vehicle[1].received == {"/fmu/in/vehicle_command": 1}
