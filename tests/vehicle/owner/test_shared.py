"""Tests of links that a process owns: it is joined or started, and started again when it was killed."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from msggen.cli import main
from msggen.link.address import parse_address
from msggen.link.session_files import records_folder
from msggen.live import LinkError, Vehicle
from msggen.sim import Options, Simulator
from msggen.vehicle.opening import can_share, open_link
from msggen.vehicle.owned.greeting import connected
from msggen.vehicle.owned.joining import SharedLink
from msggen.vehicle.owned.places import place_of, runtime_folder
from msggen.vehicle.owner.process import IDLE, idle
from support.examples import by_day
from support.link_records import nothing_is_left
from support.owners import give, needs_owners
from support.ports import free_port
from support.pseudo_terminal import TerminalProgram
from support.repository import ROOT
from support.served import end_owners, owners

WAIT = 20.0


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for the sockets of links, in which no owner is left after the test."""
    with TemporaryDirectory(prefix="run-") as name:  # whose name is short, as those of sockets are
        monkeypatch.setenv("MSGGEN_RUNTIME", name)
        monkeypatch.delenv("MSGGEN_DIRECT")
        with nothing_is_left():
            yield Path(name)
            monkeypatch.setenv("MSGGEN_RUNTIME", name)
            end_owners()


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


def until(condition: Callable[..., object], *values: object) -> None:
    end = time.monotonic() + WAIT
    while not condition(*values):
        assert time.monotonic() < end
        time.sleep(0.01)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_programs_share_a_link_and_the_vehicle_is_there_at_once(url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]):
        with Vehicle(url, px4_types) as first:
            first.wait_connected(WAIT)
            with Vehicle(url.replace("127.0.0.1", "localhost"), px4_types) as second:
                start = time.monotonic()
                remote = second.wait_connected(WAIT)
                assert second.subscribe("vehicle_status").wait_for(bool, WAIT)
                assert time.monotonic() - start < 5.0, "the vehicle connects in one session"
                assert remote == first.remote
                assert first.wait_firmware(WAIT) == second.wait_firmware(WAIT)
                command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1)
                request = px4_types.srv.VehicleCommand.Request(request=command)
                assert [each.call(request, WAIT).reply.command for each in (first, second)] == [400, 400]
                (owner,) = owners()
                assert owner.state["address"] == url
                assert {each["pid"] for each in owner.state["programs"]} == {os.getpid()}
                assert owner.state["vehicles"][0]["release"] == "v1.18"
        with Vehicle(url, px4_types) as third:
            assert third.wait_connected(1.0) == remote, "the owner has stayed"


PROGRAM = """
import sys
sys.path[:0] = [{root!r}]
from msggen.live import Vehicle
with Vehicle({url!r}) as vehicle:
    print("joined", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("times", [1, pytest.param(100, marks=[pytest.mark.night, pytest.mark.timeout(600)])])
def test_programs_that_start_at_once_start_one_owner(url: str, times: int) -> None:
    for _ in range(times):
        program = PROGRAM.format(root=str(ROOT), url=url)
        command = [sys.executable, "-c", program]
        started = [
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)
        ]
        for process in started:
            assert process.stdout
            assert process.stdout.readline() == "joined\n"
        (owner,) = owners()
        assert {each["pid"] for each in owner.state["programs"]} == {each.pid for each in started}
        for process in started:
            process.communicate("", WAIT)
        end_owners()
        assert owners() == []
        until(lambda pid: not is_alive(pid), owner.state["pid"])


STOPPED = """
import sys
sys.path[:0] = [{root!r}]
from msggen.live import Vehicle
with Vehicle({url!r}) as vehicle:
    vehicle.wait_connected(20)
    with vehicle.watch(lambda *_: None):
        print("watching", flush=True)
        sys.stdin.read()
"""


def test_a_stopped_program_delays_nobody(url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [Options(sync="off", rate=100.0)]), Vehicle(url, px4_types) as vehicle:
        status = vehicle.subscribe("vehicle_status", lambda _: None)
        vehicle.wait_connected(WAIT)
        command = [sys.executable, "-c", STOPPED.format(root=str(ROOT), url=url)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as stopped:
            assert stopped.stdout
            assert stopped.stdout.readline() == "watching\n"
            os.kill(stopped.pid, signal.SIGSTOP)
            for _ in range(5):
                until(lambda before: status.received >= before + 20, status.received)
                assert vehicle.is_connected
            os.kill(stopped.pid, signal.SIGCONT)
            stopped.communicate("", WAIT)
        assert stopped.returncode == 0
        assert vehicle.lost == 0


@pytest.mark.parametrize("times", [1, pytest.param(50, marks=[pytest.mark.night, pytest.mark.timeout(900)])])
def test_a_killed_owner_is_started_again_and_programs_go_on(url: str, times: int, px4_types: Any) -> None:
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]), Vehicle(url, px4_types) as vehicle:
        status = vehicle.subscribe("vehicle_status")
        vehicle.wait_connected(WAIT)
        for _ in range(times):
            number = vehicle.remote.number
            found = owners()
            assert [each.problem for each in found] == [""], found
            pid = found[0].state["pid"]
            os.kill(pid, signal.SIGKILL)
            until(lambda last: vehicle.is_connected and vehicle.remote.number != last, number)
            until(lambda before: status.received > before, status.received)
            vehicle.publish(px4_types.TrajectorySetpoint())
        assert status.undecodable == 0


def leave_unrecorded(url: str, types: Any, count: int, *, is_direct: bool) -> None:
    """Connect vehicles, and leave their sessions without a record, as a program on another computer does."""
    vehicles = [Vehicle(url, types, key=key, direct=is_direct) for key in range(1, count + 1)]
    for vehicle in vehicles:
        vehicle.wait_connected(WAIT)
        vehicle.subscribe("vehicle_status").wait_for(bool, WAIT)
    for vehicle in vehicles:
        vehicle.close()
    pids = [each.state["pid"] for each in owners()]
    end_owners()
    for pid in pids:
        until(lambda pid: not is_alive(pid), pid)
    shutil.rmtree(records_folder())


NO_RECORD = (
    "has a session with an earlier program, of which there is no record: it connects anew, which takes about 10 s"
)


@by_day("is_direct", [False, True], 2)
def test_vehicles_without_a_record_connect_anew_and_are_told(
    is_direct: bool,  # noqa: FBT001
    url: str,
    px4_types: Any,
    caplog: pytest.LogCaptureFixture,
) -> None:
    both = [Options(sync="off", rate=10.0, key=key, namespace=f"uav_{key}") for key in (1, 2)]
    with Simulator(px4_types, url, both):
        leave_unrecorded(url, px4_types, 2, is_direct=is_direct)
        assert NO_RECORD not in caplog.text
        with Vehicle(url, px4_types, key=2, direct=is_direct) as vehicle:
            remote = vehicle.wait_connected(WAIT)
            assert (remote.continued, remote.key, remote.namespace) == (False, 2, "uav_2")
            assert vehicle.subscribe("/uav_2/fmu/out/vehicle_status").wait_for(bool, WAIT)
        told = [text for text in caplog.messages if NO_RECORD in text]
        assert len({*told}) == len(told) == 2


def test_a_socket_of_a_killed_owner_is_replaced(url: str, runtime: Path, px4_types: Any) -> None:
    place = place_of(parse_address(url))
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(place.socket)
    with pytest.raises(ConnectionRefusedError):
        connected(place.socket)
    with Vehicle(url, px4_types):
        assert [each.place for each in owners()] == [place]
    assert oct(os.stat(place.socket).st_mode & 0o777) == "0o600"
    assert oct(runtime.stat().st_mode & 0o777) == "0o700"


def test_an_owner_that_ends_during_a_greeting_is_replaced(url: str, px4_types: Any) -> None:
    place = place_of(parse_address(url))
    with socket.socket(socket.AF_UNIX) as dying:
        dying.bind(place.socket)
        dying.listen(1)

        def end() -> None:
            dying.accept()[0].close()
            dying.close()

        thread = threading.Thread(target=end)
        thread.start()
        with Vehicle(url, px4_types):
            thread.join()
            assert [each.place for each in owners()] == [place]


def test_a_folder_that_is_open_to_others_is_refused(url: str, runtime: Path) -> None:
    runtime.chmod(0o770)
    with pytest.raises(
        LinkError, match=r"is open to others: chmod 700 '.*', or set MSGGEN_RUNTIME to a folder of your own"
    ):
        Vehicle(url)
    runtime.chmod(0o700)


@needs_owners
def test_a_folder_of_another_user_is_refused(url: str, runtime: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        give(patch, runtime)
        with pytest.raises(LinkError, match="belongs to another user"):
            Vehicle(url)


def test_a_folder_that_cannot_be_made_is_told(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("MSGGEN_RUNTIME", str(tmp_path / "file" / "run"))
    with pytest.raises(LinkError, match="cannot be made: Not a directory: set MSGGEN_RUNTIME"):
        Vehicle(url)
    monkeypatch.setenv("MSGGEN_RUNTIME", str(tmp_path / ("x" * 120)))
    with pytest.raises(LinkError, match="is too long"):
        Vehicle(url)


@pytest.mark.parametrize("way", ["XDG_RUNTIME_DIR", "TMPDIR"])
def test_the_folder_is_the_users(way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MSGGEN_RUNTIME")
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setenv(way, str(tmp_path))
    name = "msggen" if way == "XDG_RUNTIME_DIR" else f"msggen-{os.getuid()}"
    assert runtime_folder() == str(tmp_path / name)
    (tmp_path / name).rmdir()
    (tmp_path / name).symlink_to(tmp_path)
    with pytest.raises(LinkError, match="is no folder"):
        runtime_folder()


def test_a_socket_without_an_owner_is_told(runtime: Path, capsys: pytest.CaptureFixture[str]) -> None:
    link = f"unix://{runtime}/none.socket"
    assert main(["topic", "list", "--link", link]) == 2
    problem = f"no process owns the link at '{runtime}/none.socket' (No such file or directory): start `msggen link"
    text = f"{link}: L102 {problem}"
    assert text in capsys.readouterr().err


def test_a_port_in_use_is_told_with_its_owner(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", int(url.rpartition(":")[2])))
        with pytest.raises(LinkError, match="is in use: MicroXRCEAgent or another program listens there"):
            Vehicle(url)
        assert main(["topic", "list", "--link", url]) == 2
        assert f"(pid {os.getpid()}) has it" in capsys.readouterr().err


def test_an_owner_ends_when_nobody_uses_it(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(IDLE, "0.1")
    with Vehicle(url):
        (owner,) = owners()
    until(lambda: not is_alive(owner.state["pid"]))
    assert owners() == []
    assert not Path(owner.place.socket).exists()
    assert "no program uses the link any more" in Path(owner.place.log).read_text()


def test_the_time_without_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (idle(False), idle(True)) == (60.0, 600.0)  # noqa: FBT003
    monkeypatch.setenv(IDLE, "5")
    assert (idle(False), idle(True)) == (5.0, 5.0)  # noqa: FBT003
    monkeypatch.setenv(IDLE, "soon")
    assert idle(False) == 60.0  # noqa: FBT003


@pytest.mark.parametrize("way", ["direct", "variable"])
def test_a_program_can_own_its_link(way: str, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if way == "variable":
        monkeypatch.setenv("MSGGEN_DIRECT", "1")
    with Vehicle(url, direct=way == "direct"):
        assert owners() == []


def test_a_free_port_is_opened_in_the_program_and_told(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with Vehicle("udp://0", px4_types) as vehicle:
        assert owners() == []
        assert re.fullmatch(r"udp://127\.0\.0\.1:[1-9]\d*", vehicle.url)
        assert repr(vehicle) == f"<Vehicle on {vehicle.url}: not connected>"
        with (
            Vehicle("udp://127.0.0.1:0") as other,
            Simulator(px4_types, vehicle.url, [Options(sync="short", rate=10.0)]),
        ):
            assert other.url == vehicle.url, "Vehicles of a program share a link"
            assert vehicle.wait_connected(WAIT) == other.wait_connected(WAIT)
    assert main(["topic", "list", "--link", "udp://0", "--wait", "0.1"]) == 2
    first, second, _ = capsys.readouterr().err.splitlines()
    opened = first.removeprefix("listening on ")
    assert f"no vehicle connected to {opened} within 0.1 s" in second
    assert main(["doctor", "--link", "udp://0", "--wait", "0.1"]) == 1
    waiting, found = capsys.readouterr()[::-1]
    opened = f"udp://127.0.0.1:{waiting.strip().rpartition(':')[2]}"
    assert re.search(rf"{opened}: (NO_CLIENT|AGENT_HAS_CLIENT)", found), "another test can have a vehicle"
    assert owners() == []


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["link", "serve", "--link", "udp://0"], "names no port by which other programs would find the link: expected"),
        (["sim", "udp://0"], "'udp://0' names no port to send to: expected one such as 'udp://127.0.0.1:8888'"),
    ],
)
def test_others_need_a_port(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with suppress(SystemExit):
        assert main(words) == 2
    assert text in capsys.readouterr().err


def test_which_links_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = {
        each: can_share(parse_address(each))
        for each in ("udp://8888", "udp://0", "serial:///dev/ttyS9", "dds://0", "unix:///x")
    }
    assert [*shared.values()] == [True, False, True, False, False]
    link = open_link(parse_address("udp://8888"), is_shared=True)
    assert isinstance(link, SharedLink)
    monkeypatch.setattr("msggen.vehicle.opening.CAN_SHARE", False)
    assert not can_share(parse_address("udp://8888"))


def test_a_device_has_one_owner_by_any_name(tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to("/dev/null")
    places = {place_of(parse_address(f"serial://{path}")) for path in ("/dev/null", tmp_path / "by-id")}
    assert len(places) == 1
    assert place_of(parse_address("udp://0.0.0.0:7")) == place_of(parse_address("tap://127.0.0.1:7?agent=127.0.0.1:8"))


def test_the_command_lists_and_stops_owners(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["link", "list"]) == 0
    assert capsys.readouterr().out == "no process owns a link\n"
    assert main(["link", "stop"]) == 2
    assert "no link is owned" in capsys.readouterr().err
    assert main(["link", "serve", "--background", "--link", url]) == 0
    assert capsys.readouterr().out.startswith(f"{url} is open; its log is ")
    assert main(["link", "serve", "--link", url]) == 2
    assert "another process owns this link" in capsys.readouterr().err
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]), Vehicle(url) as vehicle:
        vehicle.wait_connected(WAIT)
        vehicle.wait_firmware(WAIT)
        assert main(["link", "list"]) == 0
        heading, row, program = capsys.readouterr().out.splitlines()
        assert heading.split() == ["link", "pid", "age", "vehicles", "programs", "samples/s", "lost", "log"]
        assert row.split()[0] == url
        assert "v1.18" in row
        assert f"(pid {os.getpid()}), for " in program
    assert main(["link", "stop", "udp://127.0.0.1:9"]) == 2
    assert f"no process owns it: {url} is owned" in capsys.readouterr().err
    assert main(["link", "stop", url]) == 0
    assert owners() == []


def test_serving_tells_of_a_vehicle_without_a_record(url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0, key=1)]):
        leave_unrecorded(url, px4_types, 1, is_direct=True)
        command = [sys.executable, "-m", "msggen", "link", "serve", "--link", url]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
            assert process.stdout
            told = process.stdout.readline()
            if f"{url} is open" not in told:  # the vehicle was faster
                told += process.stdout.readline()
            assert f"{url} is open" in told
            with Vehicle(url) as vehicle:
                assert not vehicle.wait_connected(WAIT).continued
            process.send_signal(signal.SIGINT)
            told += process.stdout.read()
            assert told.count(NO_RECORD) == 1


def test_serving_in_the_foreground_tells_what_happens(url: str, px4_types: Any) -> None:
    command = [sys.executable, "-m", "msggen", "link", "serve", "--link", url]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert f"{url} is open" in process.stdout.readline()
        with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]), Vehicle(url) as vehicle:
            vehicle.wait_connected(WAIT)
        process.send_signal(signal.SIGINT)
        told = process.stdout.read()
    assert process.returncode in {0, 130}
    assert "has joined" in told
    assert "127.0.0.1:" in told
    assert "has left" in told
    assert "samples/s" not in told, "a pipe gets lines only"


def test_serving_in_a_terminal_shows_the_rate(url: str, px4_types: Any) -> None:
    terminal = TerminalProgram("-m", "msggen", "link", "serve", "--link", url)
    try:
        terminal.wait_for(lambda text: f"{url} is open" in text)
        with Simulator(px4_types, url, [Options(sync="off", rate=20.0)]), Vehicle(url) as vehicle:
            vehicle.wait_connected(WAIT)
            state = "^1 vehicle, 1 program, [1-9][0-9]+ samples/s, 0 lost$"
            terminal.wait_for(lambda text: re.search(state, text, re.MULTILINE))
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.wait() == 0
        assert "samples/s" not in terminal.text
        assert re.search(r"\(pid \d+\) has joined$", terminal.text, re.MULTILINE)
    finally:
        terminal.close()


def test_a_program_waits_for_a_process_that_is_about_to_own_its_link(url: str) -> None:
    command = [sys.executable, "-m", "msggen", "link", "serve", "--link", url]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        place = place_of(parse_address(url))
        until(os.path.exists, place.start)
        with Vehicle(url):
            assert [each.state["pid"] for each in owners()] == [process.pid]
        process.terminate()
        process.communicate()
    assert process.returncode == 0


def test_the_link_goes_on_when_nobody_reads_what_it_tells(url: str, px4_types: Any) -> None:
    command = [sys.executable, "-m", "msggen", "link", "serve", "--link", url]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.readline()
        process.stdout.close()
        with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]), Vehicle(url, px4_types) as vehicle:
            assert vehicle.wait_connected(WAIT)
            assert vehicle.subscribe("vehicle_status").wait_for(bool, WAIT)
            assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.stderr.read() == ""
    assert process.returncode == 0
