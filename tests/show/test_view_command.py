"""Tests of `msggen view` as a program, with a simulated vehicle and a client of Foxglove's websocket."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from mcap.writer import Writer

from msggen.cli import DONE, FAILED, main
from msggen.sim import Options, Simulator
from support.example_program import Program, interrupted
from support.foxglove_client import FoxgloveClient
from support.ports import free_port

VIEW = ("-m", "msggen", "view", "--port", "0")


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Any]:
    """Return a function that starts the command and returns it with the port that it serves on."""
    started: list[Program] = []

    def start(*arguments: str) -> tuple[Program, int]:
        program = Program(*VIEW, *arguments, variables={"XDG_CACHE_HOME": str(tmp_path)})
        started.append(program)
        program.wait_for("Ctrl-C ends")
        found = re.search(r"ws://127.0.0.1:(\d+)", program.printed)
        assert found
        return program, int(found[1])

    yield start
    for program in started:
        program.process.kill()
        program.end()


def test_a_vehicle_is_shown(px4_types: ModuleType, run: Any) -> None:
    address = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, address, [Options(sync="short")]):
        program, port = run("--link", address, "--types", str(Path(px4_types.__path__[0])))
        with FoxgloveClient(port) as client:
            wanted = ("/pose", "/vehicle", "/location", "/fmu/out/vehicle_odometry", "/fmu/out/sensor_combined")
            client.receive(lambda: all(map(client.of, wanted)))
    interrupted(program)
    assert re.search(r"^\d+ samples shown$", program.printed, re.MULTILINE)


def test_a_recording_is_shown(px4_types: ModuleType, tmp_path: Path, run: Any) -> None:
    cls = px4_types.VehicleOdometry
    path = tmp_path / "flight.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("px4_msgs/msg/VehicleOdometry", "ros2msg", cls.__msg__.definition.encode())
        channel = writer.register_channel("/fmu/out/vehicle_odometry", "cdr", schema)
        payload = cls(pose_frame=1, q=(1.0, 0.0, 0.0, 0.0)).encode()
        for number in range(600):
            writer.add_message(channel, 1_790_000_000_000_000_000 + number * 100_000_000, payload, 0)
        writer.finish()
    program, port = run(str(path))
    with FoxgloveClient(port) as client:
        client.receive(lambda: bool(client.of("/pose")))
        assert set(client.of("/fmu/out/vehicle_odometry")) <= {payload}
    interrupted(program)
    assert f"{path}: 1 topic, 59.9 s" in program.printed


def test_errors_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.mcap"
    path.write_text("text")
    assert main(["view", str(path)]) == FAILED
    assert capsys.readouterr().err.startswith(f"{path}: R102 is not a recording")
    assert main(["view", str(tmp_path / "absent.mcap")]) == FAILED
    text = "R102 cannot be read: No such file or directory"
    assert capsys.readouterr().err.splitlines()[0] == f"{tmp_path / 'absent.mcap'}: {text}"


def test_the_time_ends_the_command(px4_types: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    address = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, address, [Options(sync="short")]):
        code = main(
            ["view", "--link", address, "--types", str(Path(px4_types.__path__[0])), "--port", "0", "--for", "0.1"]
        )
    assert code == DONE
    assert "samples shown" in capsys.readouterr().out
