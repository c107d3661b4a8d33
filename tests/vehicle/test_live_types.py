"""Tests that type checkers know what a subscription yields, and refuse what cannot work."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support.checkers import GENERATED, mypy
from support.repository import ROOT

RIGHT = """
import asyncio
from collections.abc import Iterator

import px4_types
from px4_types import BatteryStatus, OffboardControlMode, SensorCombined, VehicleStatus, srv, topics

from msggen.live import Firmware, Repeater, Subscription, Vehicle


def told(status: VehicleStatus) -> None:
    print(status.arming_state)


def heartbeat() -> OffboardControlMode | None:
    return OffboardControlMode(position=True)


def fly() -> None:
    with Vehicle("udp://127.0.0.1:8888", px4_types, key=1) as vehicle:
        vehicle.wait_connected(timeout=10)
        by_class: Subscription[VehicleStatus] = vehicle.subscribe(VehicleStatus)
        by_endpoint: Subscription[BatteryStatus] = vehicle.subscribe(topics.out.battery_status)
        by_callback: Subscription[VehicleStatus] = vehicle.subscribe(VehicleStatus, told)
        raw: Subscription[bytes] = vehicle.subscribe(topics.out.battery_status, raw=True, queue=10)
        state: int = by_class.wait_for(lambda status: status.arming_state == 2, timeout=5).nav_state
        newest: BatteryStatus | None = by_endpoint.latest()
        for combined in vehicle.subscribe(SensorCombined):
            rates: tuple[float, float, float] = combined.gyro_rad
            print(rates, state, newest, by_callback.dropped)
        for payload, nanoseconds in raw.timed():
            pair: tuple[bytes, int] = payload, nanoseconds
            print(pair)
        times: Iterator[tuple[VehicleStatus, int]] = by_class.timed()
        print(times, by_class.drain()["timestamp"])
        vehicle.publish(OffboardControlMode(timestamp=vehicle.time))
        vehicle.publish(OffboardControlMode(), topics.in_.offboard_control_mode)
        repeater: Repeater = vehicle.every(10, heartbeat)
        vehicle.every(10, OffboardControlMode()).close()
        print(repeater.jitter.worst)
        vehicle.call(srv.VehicleCommand.Request(), timeout=1.0)
        firmware: Firmware = vehicle.firmware
        print(firmware)


async def read(vehicle: Vehicle) -> None:
    async for status in vehicle.subscribe(VehicleStatus):
        state: int = status.nav_state
        print(state)


asyncio.run(read(Vehicle(types=(px4_types,))))
"""

WRONG = (
    "vehicle.subscribe(int)",
    "vehicle.subscribe(VehicleStatus, queue='many')",
    "vehicle.publish('arm')",
    "x: Subscription[VehicleStatus] = vehicle.subscribe(BatteryStatus)",
    "x: int = vehicle.subscribe(VehicleStatus).wait_for(bool)",
    "vehicle.subscribe(VehicleStatus, lambda status: status.no_such_field)",
    "Vehicle(baud=921600)",
    "vehicle.every('fast', VehicleStatus())",
)
HEAD = """
import px4_types
from px4_types import BatteryStatus, VehicleStatus

from msggen.live import Subscription, Vehicle


def use(vehicle: Vehicle) -> None:
    """


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with user code that is right, and a file for each line that is wrong."""
    (tmp_path / "right.py").write_text(RIGHT)
    for number, line in enumerate(WRONG):
        (tmp_path / f"wrong_{number}.py").write_text(f"{HEAD}{line}\n")
    return tmp_path


WRONG_FILES = sorted(f"wrong_{number}.py" for number in range(len(WRONG)))


@pytest.mark.slow  # the generated package is checked with it
def test_mypy_knows_the_types(folder: Path) -> None:
    done = mypy(folder, ".", path=f"{ROOT}:{GENERATED}")
    found = {line.partition(":")[0] for line in done.stdout.splitlines() if ": error:" in line}
    assert sorted(found) == WRONG_FILES, done.stdout


@pytest.mark.night  # by day, mypy judges the same files
def test_pyright_knows_the_types(folder: Path) -> None:
    settings = {"include": ["."], "typeCheckingMode": "strict", "pythonVersion": "3.10"}
    paths = [str(ROOT), str(GENERATED)]
    (folder / "pyrightconfig.json").write_text(json.dumps({**settings, "extraPaths": paths}))
    command = [sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable, "-p", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    report = json.loads(done.stdout)["generalDiagnostics"]
    errors = [row for row in report if row["severity"] == "error"]
    assert sorted({Path(row["file"]).name for row in errors}) == WRONG_FILES, errors
