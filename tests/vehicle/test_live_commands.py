"""Tests of `msggen topic pub`, `command` and `call` with a simulated vehicle."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest

from msggen.cli import main
from msggen.link.link import Remote, Route
from msggen.link.udp import UdpLink
from msggen.live import LinkTimeoutError, Vehicle
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.vehicle.command import acknowledges, address_of, send_command
from support.examples import by_day
from support.fake_link import FakeLink, routes_of
from support.ports import free_port
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")


class Bench(NamedTuple):
    """A simulated vehicle, and the options that name it."""

    simulator: Simulator
    link: list[str]

    def received(self, topic: str) -> int:
        return self.simulator.vehicles[0].received.get(topic, 0)


@pytest.fixture(scope="module")
def bench(px4_types: ModuleType) -> Iterator[Bench]:
    """One vehicle for all tests: each command continues the session of the last one."""
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0, key=7)]) as simulator:
        yield Bench(simulator, ["--link", url, "--types", PACKAGE, "--key", "7"])


def wait_until(condition: Any) -> None:
    """Wait for a condition, and fail if it does not come true."""
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


# --- topic pub


def test_messages_are_published_and_shown(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    values = "{position: [0, 0, -5], yaw: nan}"
    before = bench.received("/fmu/in/trajectory_setpoint")
    assert main(["topic", "pub", "-n", "3", "-r", "50", *bench.link, "trajectory_setpoint", values]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(": ")[0] for line in lines] == ["publishing #1", "publishing #2", "publishing #3"]
    assert "position=(0.0, 0.0, -5.0)" in lines[0]
    assert "yaw=nan" in lines[0]
    wait_until(lambda: bench.received("/fmu/in/trajectory_setpoint") == before + 3)


def test_a_message_is_published_once_and_quietly(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    before = bench.received("/fmu/in/offboard_control_mode")
    words = ["topic", "pub", "--once", "-q", *bench.link, "/fmu/in/offboard_control_mode", "position: true"]
    assert main(words) == 0
    assert capsys.readouterr().out == ""
    wait_until(lambda: bench.received("/fmu/in/offboard_control_mode") == before + 1)


def test_values_come_from_a_file_or_stdin(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "setpoint.yaml"
    file.write_text("yaw: 1.5\nposition: [1, 2, 3]\n")
    words = ["topic", "pub", "-1", *bench.link, "trajectory_setpoint"]
    assert main([*words, "-f", str(file)]) == 0
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(file.read_bytes())))
    assert main([*words, "-"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == second
    assert "position=(1.0, 2.0, 3.0)" in first
    file.write_text("yaw: 1.5\n\tx: 3\n")
    assert main([*words, "-f", str(file)]) == 2
    assert f"{file}:2:1: Y101 not YAML" in capsys.readouterr().err


@pytest.mark.parametrize("given", [b"", b"# nothing yet\n", None])
def test_no_values_are_not_zeros(
    given: bytes | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From stdin, which may also be closed."""
    monkeypatch.setattr("sys.stdin", None if given is None else io.TextIOWrapper(io.BytesIO(given)))
    assert main(["topic", "pub", "--types", PACKAGE, "--once", "trajectory_setpoint", "-"]) == 2
    assert capsys.readouterr().err == "stdin: L110 no values: write {} for a message of zeros\n1 error\n"


def test_ctrl_c_ends_publishing(bench: Bench) -> None:
    """As a process: Ctrl-C is a signal."""
    before = bench.received("/fmu/in/vehicle_command_mode_executor")
    words = ["topic", "pub", "-r", "20", *bench.link, "vehicle_command_mode_executor", "{}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-m", "msggen", *words], stdout=subprocess.PIPE, env=environment, text=True
    ) as process:
        wait_until(lambda: bench.received("/fmu/in/vehicle_command_mode_executor") >= before + 5)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    assert re.fullmatch(r"\d+ messages in \d+\.\d s", output.splitlines()[-1])


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ["vehicle_status", "{}"],
            "argument TOPIC: PX4 publishes '/fmu/out/vehicle_status_v4', and does not read it: msggen",
        ),
        (["trajectory_setpoint"], "arguments are required: VALUES: '{}' stands for a message of zeros"),
        (["trajectory_setpoin", "{}"], "no topic 'trajectory_setpoin', did you mean 'trajectory_setpoint'?"),
        (["cpuload", "{}"], "uORB topic that does not cross the bridge"),
        (
            ["trajectory_setpoint", "{yw: 1, position: [1]}"],
            "VALUES: L110 position: expected a list of 3 values, got 1",
        ),
        (["trajectory_setpoint", "{yw: 1, position: [1]}"], "L110 TrajectorySetpoint has no field 'yw', did you mean"),
        (["trajectory_setpoint", "{yaw: 1"], "VALUES:2:1: Y101 not YAML: "),
        (["trajectory_setpoint", "px4_msgs/msg/TrajectorySetpoint"], "L110 expected the fields of TrajectorySetpoint"),
        (["trajectory_setpoint", "{}", "-f", "x"], "argument --file: not allowed with argument VALUES"),
        (["trajectory_setpoint", "-f", "/nowhere/x"], "/nowhere/x: No such file"),
        (["trajectory_setpoint", "-r", "0"], "argument --rate: expected a number above 0, found '0'"),
        (["trajectory_setpoint", "-r", "20000"], "argument --rate: expected up to 10000 Hz, found '20000'"),
        (["trajectory_setpoint", "-n", "3", "--once"], "argument --once: not allowed with argument -n/--count"),
        (["trajectory_setpoint", "-n", "0"], "argument --count: expected a number from 1 to"),
    ],
)
def test_what_cannot_be_published_is_told_without_a_vehicle(
    words: list[str], text: str, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert px4_types
    try:
        code = main(["topic", "pub", "--link", "udp://127.0.0.1:1", "--types", PACKAGE, *words])
    except SystemExit as error:
        code = int(error.code or 0)
    assert code == 2
    assert text in capsys.readouterr().err


def test_a_message_of_another_definition_is_not_published(
    px4_types: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    wrong = Misbehaviour(wrong_hashes=("TrajectorySetpoint", "VehicleCommand"))
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0, misbehaviour=wrong)]) as simulator:
        for words in (["topic", "pub", "--once", "trajectory_setpoint", "{}"], ["command", "arm"]):
            assert main([*words, "--link", url, "--types", PACKAGE]) == 2
            told = capsys.readouterr()
            assert told.out == ""
            assert f"{url}: L102 the vehicle's definition of '/fmu/in/" in told.err
        received = simulator.vehicles[0].received
        assert not {"/fmu/in/trajectory_setpoint", "/fmu/in/vehicle_command"} & received.keys()


# --- command


def test_commands_are_sent_and_answered(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    said = []
    for words in (
        ["arm"],
        ["NAV_TAKEOFF", "altitude=500"],
        ["vehicle_cmd_nav_land"],
        ["NAV_TAKEOFF", "altitude=5"],
        ["DO_SET_MODE", "mav_mode_value=0"],
        ["DO_CHANGE_SPEED", "speed=airspeed", "speed_2=12.5"],
    ):
        code = main(["command", *words, *bench.link])
        said.append((code, capsys.readouterr().out))
    assert said == [
        (0, "COMPONENT_ARM_DISARM: ACCEPTED\n"),
        (0, "NAV_TAKEOFF: ACCEPTED\n"),
        (0, "NAV_LAND: ACCEPTED\n"),
        (0, "NAV_TAKEOFF: ACCEPTED\n"),
        (1, "DO_SET_MODE: DENIED\n"),
        (1, "DO_CHANGE_SPEED: UNSUPPORTED\n"),
    ]


def test_modes_are_selected_by_name(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    world = bench.simulator.vehicles[0].world
    for words, mode in (
        (["arm"], 4),
        (["takeoff", "4"], 17),
        (["mode", "hold"], 4),
        (["mode", "LAND"], 18),
        (["mode", "AUTO_LOITER"], 4),
        (["rtl"], 5),
        (["SET_NAV_STATE", "navigation_state_value=AUTO_LOITER"], 4),
        (["SET_NAV_STATE", "param1=auto_rtl"], 5),
        (["mode", "takeoff", "8"], 17),
        (["land"], 18),
    ):
        assert main(["command", *words, *bench.link]) == 0, words
        assert re.fullmatch(r"[A-Z_]+: ACCEPTED\n", capsys.readouterr().out)
        wait_until(lambda mode=mode: world.commander.intention == mode)


def test_a_takeoff_to_a_height_begins_where_the_vehicle_is(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = bench.simulator.vehicles[0]
    wait_until(lambda: vehicle.world.is_landed)
    assert main(["command", "mode", "hold", *bench.link]) == main(["command", "arm", *bench.link]) == 0
    assert main(["command", "takeoff", "3", *bench.link]) == 0
    wait_until(lambda: vehicle.world.mode == 17)
    wait_until(lambda: vehicle.world.mode == 4)  # from takeoff to hold, within 0.8 m of the height
    assert vehicle.world.flight.ground - vehicle.world.flight.position[2] == pytest.approx(3.0, abs=1.0)
    assert capsys.readouterr().err == ""


WITHOUT_STICKS = (
    "there are no sticks, mode position is selected (`msggen command mode hold` selects another), "
    "the preflight checks fail (pre_flight_checks_pass)"
)


def test_a_refusal_has_the_reasons_that_the_vehicle_shows(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    link = ["--link", url, "--types", PACKAGE, "--key", "1"]
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0)]) as simulator:
        for words, text in (
            (["mode", "position"], "SET_NAV_STATE: ACCEPTED\n"),
            (["arm"], f"COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED: {WITHOUT_STICKS}\n"),
            (["mode", "hold"], "SET_NAV_STATE: ACCEPTED\n"),
            (["arm"], "COMPONENT_ARM_DISARM: ACCEPTED\n"),
            (["takeoff"], "NAV_TAKEOFF: ACCEPTED\n"),
        ):
            main(["command", *words, *link])
            assert capsys.readouterr().out == text
        wait_until(lambda: not simulator.vehicles[0].world.is_landed)
        assert main(["command", "disarm", *link]) == 1
        assert "REJECTED: the vehicle is in the air\n" in capsys.readouterr().out
        assert main(["command", "mode", "position", "--json", *link]) == 1
        assert json.loads(capsys.readouterr().out)["reasons"] == ["there are no sticks"]


def test_a_firmware_without_modes_by_number_is_told(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert px4_types
    with pytest.raises(SystemExit):
        main(["command", "--link", "udp://127.0.0.1:1", "--px4", "v1.14", "mode", "hold"])
    assert "no command 'mode': the firmware has no SET_NAV_STATE, as none before v1.15" in capsys.readouterr().err


def test_a_command_goes_to_the_system_of_the_vehicle(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["command", "CUSTOM_0", "--json", *bench.link]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["command"] == "CUSTOM_0"
    assert (document["target_system"], document["result"]) == (7, "UNSUPPORTED")
    assert main(["command", "CUSTOM_0", "--target", "3", "--timeout", "0.3", *bench.link]) == 1
    told = capsys.readouterr()
    assert told.out == ""
    assert (
        "CUSTOM_0: no acknowledgement within 0.3 s: no module of PX4 has answered the command for system 3" in told.err
    )


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["NAV_TAKEOF"], "argument COMMAND: no command 'NAV_TAKEOF', did you mean 'NAV_TAKEOFF'?"),
        (["rtk"], "argument COMMAND: no command 'rtk', did you mean 'rtl'?"),
        (["hold"], "argument COMMAND: no command 'hold': to select the mode, msggen command mode hold"),
        (["LOITER"], "argument COMMAND: no command 'LOITER': to select the mode, msggen command mode hold"),
        (["vtol_takeoff"], "no command 'vtol_takeoff': to select the mode, msggen command mode vtol-takeoff"),
        (["mode"], "argument NAME=VALUE: no mode '': there are manual, altitude, position, mission, hold, return, "),
        (["mode", "hols"], "argument NAME=VALUE: no mode 'hols', did you mean 'hold'?"),
        (["mode", "x=4"], "argument NAME=VALUE: no mode 'x=4': there are manual, "),
        (["takeoff", "x"], "argument NAME=VALUE: expected a height above the ground in m, as in takeoff 5, found 'x'"),
        (["mode", "takeoff", "-5"], "expected a height above the ground in m, as in takeoff 5, found '-5'"),
        (["takeoff", "5", "6"], "expected a name and a value such as altitude=5, found '6'"),
        (["SET_NAV_STATE", "param1=AUTO_LOTER"], "expected a number, found 'AUTO_LOTER', did you mean 'AUTO_LOITER'?"),
        (["xyz"], "argument COMMAND: no command 'xyz': msggen command --list has all"),
        (["NAV_TAKEOFF", "altitud=3"], "NAV_TAKEOFF has no parameter 'altitud', did you mean 'altitude'?"),
        (["NAV_TAKEOFF", "altitude"], "expected a name and a value such as altitude=5, found 'altitude'"),
        (["NAV_TAKEOFF", "altitude=x"], "altitude: expected a number, found 'x'"),
        (["NAV_TAKEOFF", "altitude=1", "altitude=2"], "'altitude' is given more than once"),
        (["NAV_TAKEOFF", "altitude=1", "param7=2"], "altitude is param7: give one of them"),
        (["NAV_TAKEOFF", "heading=400"], "heading, param4: expected 0 to 360, got 400"),
        (["DO_CHANGE_SPEED", "speed=AIRSPED"], "speed: expected a number, found 'AIRSPED', did you mean 'AIRSPEED'?"),
        (["NAV_LAND", "source_system=300"], "source_system: expected uint8, 0 to 255, got 300"),
        (["NAV_LAND", "--target", "x"], "argument --target: expected ids from 0 to 255 such as 1 or 1:1, found 'x'"),
        (["NAV_LAND", "--timeout", "0"], "argument --timeout: expected a number above 0"),
    ],
)
def test_wrong_commands_are_told_without_a_vehicle(
    words: list[str], text: str, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert px4_types
    with pytest.raises(SystemExit) as stopped:
        main(["command", "--link", "udp://127.0.0.1:1", "--types", PACKAGE, *words])
    assert stopped.value.code == 2
    assert text in capsys.readouterr().err


def test_the_list_has_all_commands_and_their_parameters(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--types", PACKAGE]
    assert main(["command", *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = px4_types.VehicleCommand.__msg__.enum("command").__members__
    assert [line.split()[0] for line in lines] == [*names]
    assert "NAV_TAKEOFF" in {line.split()[0] for line in lines if line.endswith(" altitude=m")}
    assert main(["command", "--list", "NAV_TAKEOFF", *options]) == 0
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading == "NAV_TAKEOFF (22): Take off."
    assert [row.split()[:3] for row in rows] == [
        [each.name, f"param{each.number}", each.unit] for each in px4_types.commands.NAV_TAKEOFF.params
    ]
    assert main(["command", "--list", "DO_CHANGE_SPEED", *options]) == 0
    assert capsys.readouterr().out.splitlines()[1].endswith(": AIRSPEED, GROUNDSPEED, CLIMB_SPEED, DESCEND_SPEED")


# --- the library below it


class AnsweringLink(FakeLink):
    """A link whose vehicle acknowledges each VehicleCommand with these commands and results."""

    answers: tuple[tuple[int, int], ...] = ()

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        super().publish(remote, route, payload, until)
        if route.name.endswith("/vehicle_command"):
            for command, result in self.answers:
                self.sample(remote, self.package.VehicleCommandAck(command=command, result=result))  # type: ignore[union-attr]


def test_progress_is_told_until_the_final_answer(px4_types: Any) -> None:
    result = px4_types.VehicleCommandAck.VehicleCmdResult
    link, seen = AnsweringLink(px4_types), []
    link.answers = ((21, result.ACCEPTED), (22, result.IN_PROGRESS), (22, result.FAILED), (22, result.ACCEPTED))
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        found = send_command(vehicle, px4_types.commands.NAV_TAKEOFF(), 5.0, lambda ack: seen.append(ack.result))
        assert (found.command, found.result, seen) == (22, result.FAILED, [result.IN_PROGRESS])
        assert acknowledges(vehicle)


def test_a_command_without_an_answer_is_an_error(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.vehicle.command._STATUS_S", 0.01)
    link = AnsweringLink(px4_types)
    link.answers = ((21, 0),)
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        with pytest.raises(LinkTimeoutError, match=r"no acknowledgement within 0\.01 s"):
            send_command(vehicle, px4_types.commands.NAV_TAKEOFF(), 0.01)
        assert address_of(vehicle) == (1, 1)  # it publishes no VehicleStatus


def test_a_vehicle_may_publish_no_acknowledgements(px4_types: Any) -> None:
    link = AnsweringLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        link.connect(routes=[each for each in routes_of(px4_types) if "command_ack" not in each.name])
        assert not acknowledges(vehicle)


# --- call


def test_a_service_is_called_in_a_session_of_its_own(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    request = "{request: {command: CUSTOM_1, target_system: 7}}"
    assert main(["call", request, *bench.link]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("VehicleCommand_Response\n  reply\n")
    assert "UNSUPPORTED (3)" in printed


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["vehicle_comand", "{}"], "argument SERVICE: no service 'vehicle_comand': there is 'vehicle_command'"),
        ([], "the following arguments are required: VALUES: '{}' stands for a message of zeros"),
        (["vehicle_command"], "the following arguments are required: VALUES: "),
        (["{comand: 3}"], "VALUES: L110 VehicleCommand_Request has no field 'comand': it has 'request'"),
        (["/fmu/vehicle_command", "{request: {command: NAV_LND}}"], "L110 request.command: expected a member of"),
    ],
)
@pytest.mark.parametrize("types", [[], ["--types", PACKAGE]])
@pytest.mark.usefixtures("px4_types")
def test_wrong_calls_are_told_without_a_vehicle(
    types: list[str], words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["call", "--link", f"udp://127.0.0.1:{free_port()}", *types, *words])
    except SystemExit as error:
        code = int(error.code or 0)
    assert code == 2
    assert text in capsys.readouterr().err


# --- which vehicle


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait longer for vehicles that connect later: a busy computer connects them so."""
    for name in ("vehicle.alone._OTHERS", "link.xrce.agent._SETTLED"):
        monkeypatch.setattr(f"msggen.{name}", 30.0)


ACTING = [
    ["command", "arm"],
    ["command", "mode", "hold"],
    ["call", "vehicle_command", "{request: {command: COMPONENT_ARM_DISARM, param1: 1}}"],
    ["topic", "pub", "--once", "trajectory_setpoint", "{}"],
]


@pytest.mark.usefixtures("patient")
@by_day("words", ACTING, 3)
def test_a_command_that_acts_does_not_take_the_vehicle_that_connects_first(
    words: list[str], px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    first, second = (Simulator(px4_types, url, [Options(sync="short", rate=10.0, key=key)]) for key in (2, 1))
    later = threading.Timer(0.5, second.__enter__)
    with first:
        later.start()
        try:
            assert main([*words, "--link", url, "--types", PACKAGE]) == 2
        finally:
            later.join()
            second.__exit__(None, None, None)
    told = capsys.readouterr().err
    assert re.search(r"L102 2 vehicles are on udp.*key 1.*key 2.*Say which one is meant: --key 1, or --namespace", told)
    for simulator in (first, second):
        received = simulator.vehicles[0].received
        assert not {"/fmu/in/vehicle_command", "/fmu/in/trajectory_setpoint"} & received.keys()


def test_a_command_acts_on_the_vehicle_that_is_named(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0, key=key) for key in (1, 2)]) as simulator:
        assert main(["command", "arm", "--key", "2", "--link", url, "--types", PACKAGE]) == 0
        assert [each.world.is_armed for each in simulator.vehicles] == [False, True]
    assert capsys.readouterr().out == "COMPONENT_ARM_DISARM: ACCEPTED\n"


def test_a_command_that_reads_waits_for_no_other_vehicle(
    px4_types: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def is_settled(_: object) -> bool:
        raise AssertionError

    monkeypatch.setattr(UdpLink, "is_settled", is_settled)
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0)]):
        assert main(["topic", "echo", "--once", "vehicle_status", "--link", url, "--types", PACKAGE]) == 0
    assert "arming_state" in capsys.readouterr().out


def test_a_command_that_reads_tells_of_another_vehicle(
    px4_types: Any, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    both = [Options(sync="short", rate=10.0, key=key) for key in (1, 2)]
    with Simulator(px4_types, url, both):
        words = ["topic", "echo", "--for", "4", "vehicle_status", "--link", url, "--types", PACKAGE]
        assert main(words) == 0
    assert "arming_state" in capsys.readouterr().out
    assert re.search(r"connected too and is ignored, as .* select one by key, namespace or address", caplog.text)


# --- the page

PAGE = (ROOT / "docs" / "topic.md").read_text(encoding="utf-8").partition("\n## Publish\n")[2]
SESSIONS = "".join(re.findall(r"```console\n(.*?)```", PAGE.partition("\n## In Foxglove\n")[0], re.DOTALL))
STEPS = re.findall(r"^\$ (msggen .*)\n((?:(?!\$ ).*\n)*)", SESSIONS, re.MULTILINE)


def test_the_sessions_of_the_page_are_real(px4_types: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    """All commands, in order, with one vehicle. Only times differ."""
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short", rate=10.0)]):
        for command, shown in STEPS:
            with suppress(SystemExit):
                main([*shlex.split(command)[1:], "--link", url, "--types", PACKAGE, "--key", "1"])
            told = capsys.readouterr()
            assert masked(told.out + told.err) == masked(shown), command
    assert len(STEPS) == 10


def masked(text: str) -> str:
    """Return a text without times, and without the line that a command waits."""
    return re.sub(r"[0-9]{16}|waiting for a vehicle on .*\n", "", text)
