"""Tests of `msggen sim` and of the Simulator: sockets on loopback, pseudo terminals, errors, and the end of a run."""

from __future__ import annotations

import itertools
import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from msggen.link.address import Address
from msggen.link.link import Connected, Disconnected, Event, LinkError, Sample
from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.framing import Deframer, pack_frame
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.sim.faults import NAMES, read_fault
from msggen.sim.parameters import PARAMETERS, SETTABLE
from msggen.sim.transport import read_address
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")
SHORT = Options(sync="short")


class Server:
    """The agent on a UDP port of its own, in a thread."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.02)
        self.address = f"udp://127.0.0.1:{self.socket.getsockname()[1]}"
        self.agent = Agent(time.monotonic())
        self.events: list[Event] = []
        self._closing = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._closing:
            try:
                data, address = self.socket.recvfrom(4096)
                self.agent.receive(data, address, time.time_ns())
            except TimeoutError:
                self.agent.tick(time.monotonic())
            for answer, target in self.agent.take_outgoing():
                assert isinstance(target, tuple)
                self.socket.sendto(answer, target)
            self.events += self.agent.take_events()

    def of(self, kind: type[Any]) -> list[Any]:
        return [event for event in [*self.events] if isinstance(event, kind)]

    def close(self) -> None:
        self._closing = True
        self._thread.join()
        self.socket.close()


@pytest.fixture
def server() -> Iterator[Server]:
    """An agent that runs."""
    server = Server()
    yield server
    server.close()


def wait_until(condition: Any, seconds: float = 10.0) -> None:
    """Wait for a condition, and fail if it does not come true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


# --- the library


def test_vehicles_connect_over_udp_and_leave(server: Server, px4_types: Any) -> None:
    options = [SHORT._replace(key=number, namespace=f"uav_{number}") for number in (1, 2, 3)]
    before = threading.active_count()
    with Simulator(px4_types, server.address, options) as simulator:
        wait_until(lambda: len({event.remote.key for event in server.of(Sample)}) == 3)
        assert all(vehicle.is_connected for vehicle in simulator.vehicles)
    wait_until(lambda: len(server.of(Disconnected)) == 3)
    assert sorted(event.remote.namespace for event in server.of(Connected)) == ["uav_1", "uav_2", "uav_3"]
    assert threading.active_count() == before
    assert simulator.error is None
    simulator.close()


def test_a_simulator_waits_for_its_agent(px4_types: Any) -> None:
    closed = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    closed.bind(("127.0.0.1", 0))
    port = closed.getsockname()[1]
    closed.close()
    simulator = Simulator(px4_types, f"udp://127.0.0.1:{port}", [SHORT])
    simulator.serve(0.3)
    assert not simulator.vehicles[0].is_connected
    simulator.close()


def test_a_simulator_that_is_refused_asks_its_agent_every_other_second(px4_types: Any) -> None:
    """The system tells that nobody listens, which the client notices after its question."""
    agent = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    agent.bind(("127.0.0.1", 0))
    address = agent.getsockname()
    agent.close()
    simulator = Simulator(px4_types, f"udp://127.0.0.1:{address[1]}", [SHORT])
    simulator.serve(0.3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as agent:
        agent.bind(address)
        agent.setblocking(False)  # noqa: FBT003 - the name of the method says what it means
        simulator.serve(1.2)
        with pytest.raises(BlockingIOError):
            agent.recv(100)
        simulator.serve(0.8)
        assert agent.recv(100)[4] == wire.GET_INFO
    simulator.close()


def test_a_new_connection_has_a_port_of_its_own(server: Server, px4_types: Any) -> None:
    with Simulator(px4_types, server.address, [SHORT._replace(misbehaviour=Misbehaviour(restart_every=0.3))]):
        wait_until(lambda: len(server.of(Connected)) >= 3)
    assert len({event.remote.address for event in server.of(Connected)}) >= 3


def test_a_vehicle_on_a_serial_line(px4_types: Any) -> None:
    master, slave = os.openpty()
    agent, frames = Agent(time.monotonic()), Deframer()
    samples: list[Sample] = []
    device = os.ttyname(slave)
    with Simulator(px4_types, f"serial://{device}?baud=921600", [SHORT]):
        end = time.monotonic() + 10.0
        while len(samples) < 100 and time.monotonic() < end:
            if select.select([master], [], [], 0.05)[0]:
                for message in frames.feed(os.read(master, 65536)):
                    agent.receive(message, device, time.time_ns())
            for answer, _ in agent.take_outgoing():
                os.write(master, pack_frame(answer))
            samples += [event for event in agent.take_events() if isinstance(event, Sample)]
    assert len(samples) >= 100
    assert (frames.broken, agent.outbox.lost, +agent.outbox.refused) == (0, 0, {})
    os.close(slave)
    os.close(master)


def test_a_device_that_goes_away_ends_the_thread(px4_types: Any) -> None:
    master, slave = os.openpty()
    device = os.ttyname(slave)
    with Simulator(px4_types, f"serial://{device}", [SHORT]) as simulator:
        os.close(slave)
        os.close(master)
        wait_until(lambda: simulator.error is not None)
    assert str(simulator.error).startswith(f"{device}: ")


def test_a_serial_line_has_one_vehicle(px4_types: Any) -> None:
    with pytest.raises(LinkError, match="a serial line has one vehicle"):
        Simulator(px4_types, "serial:///dev/null", [SHORT, SHORT])


def test_a_file_is_no_serial_device(px4_types: Any) -> None:
    with pytest.raises(LinkError, match="not a serial device"):
        Simulator(px4_types, "serial:///dev/null", [SHORT])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udp://127.0.0.1:8888", Address("udp", "127.0.0.1", 8888)),
        ("udp://10.0.0.2", Address("udp", "10.0.0.2", 8888)),
        ("udp://[::1]:9", Address("udp", "::1", 9)),
        ("serial:///dev/ttyUSB0", Address("serial", path="/dev/ttyUSB0", baud=921600)),
        ("serial:///dev/pts/3?baud=57600", Address("serial", path="/dev/pts/3", baud=57600)),
    ],
)
def test_addresses(text: str, expected: Address) -> None:
    assert read_address(text) == expected


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("127.0.0.1", "did you mean 'udp://127.0.0.1'?"),
        ("udp://host:x", "'x' is not a port"),
        ("udp://host:99999", "'99999' is not a port: expected a number from 1 to 65535"),
        ("udp://host?a=1", "unknown key 'a': expected an address such as 'udp://127.0.0.1:8888'"),
        ("tap://host:1", ", did you mean 'udp://host:1'?"),
        ("dds://0", ": expected one of udp://127.0.0.1:8888, serial:///dev/ttyUSB0?baud=921600"),
        ("0", ": expected one of udp://127.0.0.1:8888, serial:///dev/ttyUSB0?baud=921600"),
        ("serial:///dev/tty?baud=0", "'0' is not a baud rate"),
    ],
)
def test_other_texts_are_no_addresses(text: str, error: str) -> None:
    """An agent is at a UDP port or a serial line. test_live_address.py has the rest."""
    with pytest.raises(ValueError, match=re.escape(error)):
        read_address(text)


# --- the command


def test_a_run_prints_what_happens(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["sim", server.address, "--types", PACKAGE, "--sync", "short", "--count", "2", "--for", "1"]
    assert main(words) == 0
    first, *changes, last = capsys.readouterr().out.splitlines()
    assert re.fullmatch(rf".*px4_types: 31 topics out, 38 in; 2 vehicles to {server.address}", first)
    assert sorted(re.sub(r"[\d.]+ s", "T", line).strip() for line in changes) == [
        "T  uav_1  connected",
        "T  uav_2  connected",
    ]
    assert re.fullmatch(r"\d+ samples sent, 0 received, in \d+\.\d s", last)
    wait_until(lambda: len(server.of(Disconnected)) == 2)


@pytest.mark.slow
def test_ctrl_c_ends_the_session(server: Server) -> None:
    """As a process: it takes a second or two to start."""
    words = ["sim", server.address, "--px4", "v1.17", "--sync", "off"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-m", "msggen", *words], stdout=subprocess.PIPE, env=environment, text=True
    ) as process:
        wait_until(lambda: server.of(Sample), 60.0)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert output.startswith("the embedded PX4 v1.17: 27 topics out, 38 in; 1 vehicle to udp://127.0.0.1:")
    wait_until(lambda: server.of(Disconnected))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["127.0.0.1:8888"], "ADDRESS: L101 '127.0.0.1:8888' is not the address of a link, did you mean 'udp://"),
        (["tap://127.0.0.1:8888"], "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        (["serial:///dev/no"], "serial:///dev/no: L102 there is no device /dev/no: is it plugged in?"),
        (["serial:///dev/no", "--count", "2"], "serial:///dev/no: L102 a serial line has one vehicle"),
        (["--types", "no_such_types"], "no_such_types: L103 cannot be imported: No module named 'no_such_types'"),
        (["--types", "json"], "json: L103 not a package that msggen has generated"),
        (["--px4", "v1.19"], "v1.19: S105 neither a folder nor an embedded release, did you mean 'v1.18'?"),
        (["--px4", "v1.13"], "v1.13: S105 neither a folder nor an embedded release: there are v1.14 to v1.18"),
    ],
)
def test_errors_have_codes(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    types = [] if {"--types", "--px4"} & {*words} else ["--types", PACKAGE]
    assert main(["sim", *words, *types, "--for", "0.1"]) == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--count", "0"], "argument --count: expected a number from 1 to 255, found '0'"),
        (["--key", "250", "--count", "9"], "--key 250: the last of 9 vehicles needs a key up to 255"),
        (["--drop", "10"], "argument --drop: expected a share from 0 to 1, found '10'"),
        (["--garbage", "nan"], "argument --garbage: expected a share from 0 to 1, found 'nan'"),
        (["--clock-off", "inf"], "argument --clock-off: expected a number from -1e+06 to 1e+06, found 'inf'"),
        (["--rate", "x"], "argument --rate: expected a number, found 'x'"),
        (["--for", "-1"], "argument --for: expected a number above 0, found '-1'"),
        (["--rate", "2e6"], "argument --rate: expected a number above 0 and up to 1000000, found '2e6'"),
        (["udp://127.0.0.1:8888?key=2"], "argument ADDRESS: 'key' is not part of an address: give it as --key"),
        (["--namespace", "a b"], "argument --namespace: expected a name such as uav_1, found 'a b'"),
        (["--version", "VehicleStatus"], "argument --version: expected a message and a version such as"),
        (["--version", "VehicleStatu=3"], "argument --version: no topic has a message 'VehicleStatu', did you mean"),
        (["--wrong-hash", "VehicleStat"], "argument --wrong-hash: no topic has a message 'VehicleStat', did you mean"),
        (["--sync", "fast"], "invalid choice: 'fast'"),
        (["--px4", "v1.18"], "not allowed with argument"),
        (
            ["--param", "COM_MODE_ARM_CH=1"],
            "argument --param: parameter 'COM_MODE_ARM_CH' cannot be set, did you mean 'COM_",
        ),
        (
            ["--param", "MAV_SYS_ID=1"],
            "argument --param: parameter 'MAV_SYS_ID' cannot be set: there are COM_DISARM_LAND, ",
        ),
        (
            ["--param", "RTL_MIN_DIST"],
            "argument --param: expected a parameter and a value such as RTL_MIN_DIST=1, found 'RTL_MIN_DIST'",
        ),
        (
            ["--param", "EKF2_AGP_CTRL=1"],
            "argument --param: parameter 'EKF2_AGP_CTRL' cannot be set, did you mean 'EKF2_AGP",
        ),
        (
            ["--log", "flight.ulg", "--param", "EKF2_AGP_CTRL=1"],
            "argument --param: parameter 'EKF2_AGP_CTRL' cannot be set, did you mean 'EKF2_AGP",
        ),
        (["--param", "RTL_MIN_DIST=x"], "argument --param: expected a number, found 'x'"),
        (
            ["--fault", "no-position"],
            "argument --fault: expected a time and a fault such as 20:no-position, found 'no-",
        ),
        (["--fault", "x:sticks"], "argument --fault: expected a number, found 'x'"),
        (["--fault", "2:stick"], "argument --fault: no fault 'stick', did you mean 'sticks'?: there are no-position, "),
        (
            ["--fault", "2:battery=7"],
            "argument --fault: 'battery=7': expected a share from 0 to 1, as in 'battery=0.1'",
        ),
        (
            ["--fault", "2:mode=lan"],
            "argument --fault: 'mode=lan': no such mode, did you mean 'land'?: there are manual, ",
        ),
        (["--speed", "0"], "argument --speed: expected a number above 0, found '0'"),
        (
            ["--speed", "5", "--sync", "px4"],
            "argument --sync: the agent's clock runs at another speed, so that it cannot",
        ),
    ],
)
def test_errors_of_usage(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["sim", "--types", PACKAGE, *words])
    assert stopped.value.code == 2
    assert text in capsys.readouterr().err


def test_time_runs_at_another_speed(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    start = time.monotonic()
    words = ["sim", server.address, "--types", PACKAGE, "--speed", "4", "--for", "8", "--fault", "2:sticks"]
    assert main(words) == 0
    assert 1.9 < time.monotonic() - start < 8.0, "as long as the time of the vehicle"
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r" +2\.0\d s  the pilot's sticks are there", lines[2])
    assert re.search(r", in 8\.\d s$", lines[3])
    assert len(server.of(Sample)) > 2000  # of 8 s


def test_no_sample_is_left_out_at_another_speed(server: Server, px4_types: Any) -> None:
    """A computer that is too slow for the speed gets a lower one."""
    simulator = Simulator(px4_types, server.address, [Options(sync="off")], speed=20.0)
    simulator.serve(8.0)
    simulator.close()
    decode = px4_types.SensorCombined.decode
    samples = [each for each in server.of(Sample) if each.route.name == "/fmu/out/sensor_combined"]
    times = [decode(each.payload).timestamp for each in samples]
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    assert len(gaps) > 500
    assert sum(gap > 5_000 for gap in gaps) < 0.02 * len(gaps)


def test_clocks_of_different_speeds_cannot_be_synchronised(px4_types: Any) -> None:
    with pytest.raises(ValueError, match="the clock of the agent runs at another speed"):
        Simulator(px4_types, options=[SHORT], speed=2.0)


def test_faults_can_be_told_from_another_thread(server: Server, px4_types: Any) -> None:
    with Simulator(px4_types, server.address, [SHORT]) as simulator:
        (vehicle,) = simulator.vehicles
        wait_until(lambda: vehicle.is_connected)
        vehicle.fault("no-gps")
        wait_until(lambda: vehicle.changes[-1].text == "GPS is lost")
        vehicle.fault("no-link")
        wait_until(lambda: not vehicle.is_connected, 20.0)
        vehicle.fault("link")
        wait_until(lambda: vehicle.is_connected, 20.0)
        with pytest.raises(ValueError, match="no fault 'nothing': there are no-position, "):
            vehicle.fault("nothing")


def test_nothing_is_left_in_the_folder_for_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    before = [*sys.path]
    assert main(["sim", server.address, "--px4", "v1.14", "--sync", "off", "--for", "0.3"]) == 0
    assert capsys.readouterr().out.startswith("the embedded PX4 v1.14: 13 topics out, 13 in;")
    assert [*tmp_path.iterdir()] == []
    assert sys.path == before
    assert not [name for name in sys.modules if name.startswith("msggen_sim")]


# --- the page

PAGE = (ROOT / "docs" / "sim.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_the_example_with_a_virtual_clock_prints_what_the_page_shows(
    px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert px4_types
    (shown,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    exec(BLOCKS[1], {})  # noqa: S102 - the code of the page
    assert capsys.readouterr().out == shown


def test_the_example_with_a_vehicle_works(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("msggen.vehicle.vehicle")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    exec(BLOCKS[0].replace("8888", port), {})  # noqa: S102 - the code of the page
    assert capsys.readouterr().out == f"{px4_types.VehicleStatus.ARMING_STATE_DISARMED}\n"


def test_the_commands_of_the_page_are_accepted() -> None:
    from msggen.cli import parser_for

    commands = re.findall(r"^(?:\$ )?msggen (sim.*?)(?: &|  #.*)?$", PAGE, re.MULTILINE)
    assert len(commands) == 17
    for command in commands:
        parser_for(command.split()).parse_args(command.split())


def test_the_options_of_the_page_are_all_misbehaviours() -> None:
    shown = re.findall(r"^\| `(--[\w-]+)", PAGE.partition("## What goes wrong")[2], re.MULTILINE)
    names = [name.replace("_", "-") for name in Misbehaviour._fields]
    assert shown == [f"--{ {'wrong-hashes': 'wrong-hash', 'versions': 'version'}.get(name, name) }" for name in names]


def test_the_page_has_all_parameters_and_faults() -> None:
    texts = (PAGE, (ROOT / "tests" / "sim" / "compared.md").read_text(encoding="utf-8"))
    settable, fixed = (
        {name: float(value) for name, value in re.findall(r"^\| ([A-Z][A-Z0-9_]+) \| ([\d.]+) \|", text, re.MULTILINE)}
        for text in texts
    )
    assert settable | fixed == PARAMETERS
    assert settable.keys() <= {*SETTABLE}
    assert not fixed.keys() & {*SETTABLE}
    table = PAGE.partition("| fault | what happens |")[2].partition("\n\n")[0]
    names = [name for row in table.splitlines()[2:] for name in re.findall("`([^`]+)`", row.split("|")[1])]
    assert sorted(re.sub("=.*", "", name) for name in names) == sorted(re.sub("=.*", "", name) for name in NAMES)
    for name in names:
        read_fault(name)


def test_the_summary_of_the_page_has_the_format_of_the_command(
    server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["sim", server.address, "--types", PACKAGE, "--sync", "short", "--for", "0.5"])
    masked = [re.sub(r"[\d.]+", "N", line) for line in capsys.readouterr().out.splitlines()]
    shown = [re.sub(r"[\d.]+", "N", line) for line in PAGE.split("```")[1].splitlines()]
    assert {line.split("N")[0] for line in masked[1:]} <= {line.split("N")[0] for line in shown}


def test_the_help_names_no_option_of_other_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["sim", "--help"])
    text = capsys.readouterr().out
    assert "--quiet" in text
    assert "--diff" not in text
