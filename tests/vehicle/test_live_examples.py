"""The examples that talk to a vehicle, run as programs of their own against simulated vehicles."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from IPython.core import interactiveshell

from msggen.cli import main
from msggen.flight import BlockingFlight
from msggen.link.link import Remote
from msggen.sim import Options, Simulator
from support.example_program import EXAMPLES, LONGEST, Program, interrupted
from support.examples import by_day
from support.ports import free_port
from support.repository import ROOT


@pytest.fixture
def address() -> str:
    """An address for an example, whose port nobody uses."""
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture
def run() -> Iterator[type[Program]]:
    """Programs that are ended with the test."""
    started: list[Program] = []

    class Started(Program):
        def __init__(self, *arguments: str, packages: Path = ROOT / "generated") -> None:
            super().__init__(*arguments, packages=packages)
            started.append(self)

    yield Started
    for program in started:
        program.process.kill()
        program.end()


SOON = Options(sync="short", rate=10.0)
CONNECTING = sorted(
    str(path.relative_to(EXAMPLES)) for path in EXAMPLES.rglob("*.py") if "[udp://" in path.read_text(encoding="utf-8")
)
"""The examples that take the address of a link."""


def test_listener(px4_types: ModuleType, address: str, run: type[Program]) -> None:
    program = run("listener.py", address)
    with Simulator(px4_types, address, [Options(sync="short")]):
        program.wait_for(r"m/s\^2", r"m/s\^2")
    interrupted(program)


@pytest.mark.night  # builds a package, and runs two programs
def test_advertiser(tmp_path: Path, address: str, run: type[Program]) -> None:
    topics = (ROOT / "dds_topics.yaml").read_text(encoding="utf-8")
    more = "subscriptions:\n  - topic: /fmu/in/debug_vect\n    type: px4_msgs::msg::DebugVect\n"
    (tmp_path / "dds_topics.yaml").write_text(topics.replace("subscriptions:\n", more), encoding="utf-8")
    main(["build", "-q", "--topics", str(tmp_path / "dds_topics.yaml"), "-o", str(tmp_path)])
    program = run("advertiser.py", address, packages=tmp_path)
    simulator = run("-m", "msggen", "sim", address, "--types", str(tmp_path / "px4_types"), "--sync=short", "--for=5")
    program.wait_for("Jitter")
    interrupted(program)
    simulator.wait_for(r"/fmu/in/debug_vect +\d ")
    assert simulator.process.wait(LONGEST) == 0


@by_day("name", CONNECTING, 4)
def test_an_address_that_cannot_be_opened_is_one_line(name: str, run: type[Program]) -> None:
    goal = ["1", "2", "3"] if name == "enu_goal.py" else []
    program = run(name, *goal, "udp://127.0.0.1:x")
    assert [*program.lines()][1:] == [], program.printed
    assert "udp://127.0.0.1:x" in program.printed
    assert program.process.wait(LONGEST) == 1


@pytest.mark.slow
def test_offboard(px4_types: ModuleType, address: str, run: type[Program]) -> None:
    page = (ROOT / "docs" / "first-flight.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^connected: the vehicle at .*\) v1.18\n((?:at .*\n)+landed\n)", page, re.MULTILINE)
    program = run("offboard.py", address)
    with Simulator(px4_types, address, [SOON]):
        program.wait_for(
            r"connected: the vehicle at 127\.0\.0\.1:\d+ \(key \d+\) v1.18", *map(re.escape, shown.splitlines())
        )
        assert program.process.wait(LONGEST) == 0
        with BlockingFlight(address, px4_types) as flight:
            assert flight.mode == "hold"
            flight.arm()


def test_two_vehicles(px4_types: ModuleType, address: str, run: type[Program]) -> None:
    program = run("two_vehicles.py", address)
    vehicles = [Options(sync="short", rate=10.0, key=key, namespace=f"uav_{key}") for key in (1, 2)]
    with Simulator(px4_types, address, vehicles):
        program.wait_for(r"\(key 1, namespace uav_1\)", r"\(key 2, namespace uav_2\)", "heights: .* m, .* m")
    interrupted(program)


@pytest.mark.parametrize("words", [[], ["1", "2"], ["north", "2", "3"]])
def test_a_goal_that_is_missing_is_told_in_one_line(words: list[str]) -> None:
    command = [sys.executable, str(EXAMPLES / "enu_goal.py"), *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "generated")}
    outcome = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (outcome.returncode, outcome.stdout) == (1, "")
    assert outcome.stderr == "usage: python enu_goal.py EAST NORTH UP [udp://127.0.0.1:8888], in m\n"


def test_a_vehicle_is_printed_for_people() -> None:
    remote = Remote(1, "127.0.0.1:40123", 7, "uav_1", continued=False)
    assert str(remote) == "the vehicle at 127.0.0.1:40123 (key 7, namespace uav_1)"
    assert str(remote._replace(namespace="")) == "the vehicle at 127.0.0.1:40123 (key 7)"


def test_asyncio(px4_types: ModuleType, address: str, run: type[Program]) -> None:
    program = run("asyncio_listener.py", address)
    with Simulator(px4_types, address, [SOON]):
        program.wait_for("mode: ", "battery: ")
    interrupted(program)


def test_enu_goal(px4_types: ModuleType, address: str, run: type[Program]) -> None:
    program = run("enu_goal.py", "1", "2", "3", address)
    with Simulator(px4_types, address, [SOON]) as simulator:
        program.wait_for("east 0.00, north 0.00", "east")
        assert simulator.vehicles[0].received["/fmu/in/trajectory_setpoint"] > 0
    interrupted(program)


def test_notebook(px4_types: ModuleType, address: str, capsys: pytest.CaptureFixture[str]) -> None:
    shell = interactiveshell.InteractiveShell.instance()
    notebook = json.loads((EXAMPLES / "flight.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    with Simulator(px4_types, address, [SOON]):
        for cell in cells:
            shell.run_cell(cell.replace("udp://127.0.0.1:8888", address).replace("sleep(5)", "sleep(2)")).raise_error()
    printed = capsys.readouterr().out
    assert re.search(r"\d{2,} samples, \d+ Hz", printed)  # fewer on a busy machine
    assert "mean in m/s^2" in printed
