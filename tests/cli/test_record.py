"""Tests of `msggen record` and `msggen play` with simulated vehicles: sockets, errors, and docs/recordings.md."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.cli import main
from msggen.exports.writer import Channel, Writer
from msggen.link.xrce import client
from msggen.link.xrce.wire import ENCAPSULATION
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.sim.endpoints import object_ids_of
from support.commands import run
from support.examples import by_day
from support.ports import free_port
from support.recordings import START, Found, check_decoded, check_read, read_mcap
from support.repository import ROOT

PACKAGE = str(ROOT / "generated" / "px4_types")
SHORT = Options(sync="short")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def address() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, bytes]]:
    """The samples that clients of this process send: the numbers of their topics and payloads."""
    found: list[tuple[int, bytes]] = []
    real = client.Client.write

    def write(self: client.Client, number: int, data: bytes) -> bool:
        is_sent = real(self, number, data)
        if is_sent:
            found.append((number, ENCAPSULATION + data))
        return is_sent

    monkeypatch.setattr(client.Client, "write", write)
    return found


def record(address: str, *words: str, types: str = PACKAGE) -> int:
    return main(["record", "--link", address, "--types", types, *words])


def check_complete(found: Sequence[Found], sent: Sequence[tuple[int, bytes]], package: Any) -> None:
    """Check that each topic has a stretch of what was sent, without a gap, and that all have been recorded together."""
    ids = object_ids_of(package.topics)
    numbers = {each.ros_name: number for each, number in zip(package.topics.ENDPOINTS, ids, strict=True)}
    for name in {each.topic for each in found}:
        ours = [each.payload for each in found if each.topic == name]
        theirs = [payload for number, payload in sent if number == numbers[name]]
        starts = [start for start in range(len(theirs)) if theirs[start : start + len(ours)] == ours]
        assert starts, name


def test_every_payload_is_that_of_the_vehicle(
    address: str, px4_types: Any, sent: list[tuple[int, bytes]], capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, address, [SHORT]):
        assert record(address, "-o", "flight", "--for", "1.5", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    found = read_mcap("flight.mcap")
    assert (summary["files"], summary["lost"], summary["dropped"]) == (["flight.mcap"], 0, 0)
    assert summary["samples"] == len(found) == sum(summary["topics"].values())
    assert summary["bytes"] == os.path.getsize("flight.mcap")
    assert summary["without_definition"] == []
    assert len(summary["topics"]) >= 10  # a busy computer connects late, and some topics are sent once a second
    check_complete(found, sent, px4_types)
    check_read("flight.mcap", found)
    assert check_decoded("flight.mcap", px4_types) == len(found)


@pytest.mark.slow  # two commands that wait for each other
def test_a_recording_is_played_and_recorded_again(
    address: str, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, address, [SHORT]):
        assert record(address, "-o", "flight.mcap", "--for", "1.5", "-q") == 0
    first = read_mcap("flight.mcap")
    codes: list[int] = []
    other = f"udp://127.0.0.1:{free_port()}"
    player = threading.Thread(
        target=lambda: codes.append(main(["play", "flight.mcap", "--to", other, "--rate", "0.5", "-q"]))
    )
    player.start()
    try:
        assert record(other, "-o", "again.mcap", "--for", "1.0", "--wait", "20") == 0
    finally:
        player.join(60)
    assert codes == [0]
    again = [each for each in read_mcap("again.mcap") if "message_format" not in each.topic]
    assert len(again) > 100
    for name in {each.topic for each in again}:
        ours, theirs = ([each.payload for each in found if each.topic == name] for found in (again, first))
        assert any(theirs[start : start + len(ours)] == ours for start in range(len(theirs))), name
    assert re.search(r"\d+ topics, \d+ samples, \d+\.\d kB, 0 lost, in 1\.\d s", capsys.readouterr().out)


def test_chosen_topics_are_recorded_in_several_files(address: str, px4_types: Any, here: Path) -> None:
    words = ["vehicle_*", "SensorCombined", "--exclude", "VehicleOdometry", "--split-every", "0.5", "--for", "1.4"]
    (here / "flights").mkdir()
    with Simulator(px4_types, address, [SHORT]):
        assert record(address, *words, "-o", "flights", "--compression", "lz4", "-q") == 0
    names = sorted(each.name for each in (here / "flights").iterdir())
    assert len(names) >= 2
    assert all(re.fullmatch(r"px4_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d_\d\.mcap", name) for name in names)
    topics = {each.topic.rpartition("/")[2] for name in names for each in read_mcap(f"flights/{name}")}
    assert {"sensor_combined", "vehicle_attitude"} <= topics
    assert all(name.startswith("vehicle_") or name == "sensor_combined" for name in topics)
    assert "vehicle_odometry" not in topics


def test_a_definition_that_differs_is_told(address: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    options = SHORT._replace(misbehaviour=Misbehaviour(wrong_hashes=("SensorCombined",)))
    with Simulator(px4_types, address, [options]):
        assert record(address, "sensor_combined", "vehicle_attitude", "-o", "a.mcap", "--for", "5") == 0
    assert "warning: /fmu/out/sensor_combined: recorded without a definition" in capsys.readouterr().err
    assert {each.topic for each in read_mcap("a.mcap")} == {"/fmu/out/sensor_combined", "/fmu/out/vehicle_attitude"}


@contextmanager
def process(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run msggen as a process."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "msggen", *words]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, env=environment, text=True) as started:
        try:
            yield started
        finally:
            started.kill()


@by_day("ended_by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], 2)
def test_a_process_that_is_ended_leaves_a_whole_file(address: str, px4_types: Any, ended_by: signal.Signals) -> None:
    words = ["record", "sensor_*", "vehicle_attitude", "-o", "a.mcap", "--link", address, "--types", PACKAGE]
    with Simulator(px4_types, address, [SHORT]), process(*words) as recording:
        limit = threading.Timer(60, recording.kill)
        limit.start()
        while recording.poll() is None:
            if os.path.exists("a.mcap") and os.path.getsize("a.mcap") > 10_000:
                recording.send_signal(ended_by)
                break
            threading.Event().wait(0.05)
        output, errors = recording.communicate()
        limit.cancel()
    found = read_mcap("a.mcap")
    assert len(found) > 50
    check_read("a.mcap", found)
    if ended_by is signal.SIGKILL:
        assert recording.returncode == -signal.SIGKILL
    else:
        assert (recording.returncode, errors) == (0, "")
        assert f"2 topics, {len(found)} samples, " in output


def test_a_recording_goes_on_when_nobody_reads_what_is_printed(address: str, px4_types: Any) -> None:
    words = ["record", "sensor_combined", "-o", "a.mcap", "--link", address, "--types", PACKAGE, "--for", "1"]
    with Simulator(px4_types, address, [SHORT]), process(*words) as recording:
        assert recording.stdout is not None
        recording.stdout.close()
        assert recording.wait(60) == 0
        assert recording.stderr is not None
        assert recording.stderr.read() == ""
    assert len(read_mcap("a.mcap")) > 10


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["record", "-o", "taken.mcap"], "taken.mcap: R101 there is such a file already"),
        (["record", "-o", "taken"], "taken.mcap: R101 there is such a file already"),
        (["record", "-o", "part", "--split-every", "9"], "part_1.mcap: R101 there is such a file already"),
        (["record", "-o", "no/flight.mcap"], "no/flight.mcap: R101 there is no folder 'no'"),
        (["record", "--link", "udp"], "--link: L101 'udp' is not the address of a link"),
        (["play", "no.mcap"], "no.mcap: R102 cannot be read: No such file or directory"),
        (["play", "taken.mcap"], "taken.mcap: R102 is not a recording"),
        (["play", "."], ".: R102 has several recordings and no metadata.yaml"),
    ],
)
def test_errors_have_codes(words: list[str], text: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "taken.mcap").write_text("mine")
    (here / "part_1.mcap").write_text("mine")
    assert main(words) == 2
    assert text in capsys.readouterr().err
    assert (here / "taken.mcap").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ["record", "--max-size", "5x"],
            "argument --max-size: expected a number of bytes such as 500M or 2G, found '5x'",
        ),
        (["record", "--split-size", "nan"], "argument --split-size: expected a number of bytes such as"),
        (["record", "--split-size", "0"], "argument --split-size: expected a number of bytes such as"),
        (["record", "--split-every", "0"], "argument --split-every: expected a number above 0"),
        (["record", "--for", "x"], "argument --for: expected a number"),
        (["record", "--compression", "gzip"], "invalid choice: 'gzip'"),
        (["play", "a.mcap", "--rate", "0"], "argument --rate: expected a number above 0"),
        (["play", "a.mcap", "--key", "0"], "argument --key: expected a number from 1"),
    ],
)
def test_errors_of_usage(words: list[str], text: str) -> None:
    outcome = run(words)
    assert outcome.code == 2
    assert text in outcome.stderr


def test_errors_about_the_recording_and_the_vehicle(
    address: str, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, address, [SHORT]):
        with pytest.raises(SystemExit):
            record(address, "vehicle_statu")
        text = "no topic is called 'vehicle_statu', did you mean 'vehicle_status'?: `msggen topic list` prints"
        assert text in capsys.readouterr().err
        assert not list(Path().glob("*.mcap"))
        assert record(address, "vehicle_odometry", "sensor_combined", "-o", "a.mcap", "--for", "1", "-q") == 0
    for words, text in (
        (
            ["vehicle_odometri"],
            "argument TOPIC: not in this recording: 'vehicle_odometri', did you mean 'vehicle_odometry'?; it has ",
        ),
        (["--exclude", "*"], "argument TOPIC: all topics are left out"),
        (["--start", "60"], "argument --start: the recording has "),
    ):
        assert text in run(["play", "a.mcap", *words]).stderr
    for to, code in (("127.0.0.1", "--to: L101"), ("serial:///dev/no", "serial:///dev/no: L102")):
        assert main(["play", "a.mcap", "--to", to]) == 2
        assert code in capsys.readouterr().err


def test_a_recording_is_played_without_an_agent_until_the_time_is_over(
    address: str, px4_types: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Simulator(px4_types, address, [SHORT]):
        record(address, "sensor_combined", "-o", "a.mcap", "--for", "1", "-q")
    capsys.readouterr()
    monkeypatch.setattr("msggen.cli.commands.play._NOTICE", 0.1)
    to = f"udp://127.0.0.1:{free_port()}"
    assert main(["play", "a.mcap", "--to", to, "--for", "0.8"]) == 1
    told = capsys.readouterr()
    assert told.err == (
        f"no program answers at {to}: waiting for one, such as `msggen topic list`\n"
        f"no program answered at {to}: nothing was played\n"
    )
    first, last = told.out.splitlines()
    assert re.fullmatch(r"a\.mcap: 1 topic of v1\.18, \d\.\d s; to udp://127\.0\.0\.1:\d+", first)
    assert last == "0 samples sent, 0 received"
    Path("bag").mkdir()
    os.rename("a.mcap", "bag/a.mcap")  # that metadata.yaml is missing is no damage
    assert main(["play", "bag", "--to", to, "--for", "0.1", "--start", "0"]) == 1
    assert re.match(r"bag: 1 topic of v1\.18, \d\.\d s; to ", capsys.readouterr().out)
    Path("pyproject.toml").write_text(f'[tool.msggen]\nlink = "{to}"\n')
    assert main(["play", "bag", "--for", "0.1"]) == 1
    assert capsys.readouterr().out.splitlines()[0].endswith(f"; to {to}")


def test_topics_for_which_a_vehicle_has_no_room_are_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = Writer(str(here / "a.mcap"))
    for number in range(320):
        name = writer.add_channel(Channel(f"/fmu/out/mine_{number:03}", "my_msgs/msg/Mine", "", ""))
        writer.write(name, START + number, START, bytes(8))
    writer.close()
    assert main(["play", "a.mcap", "--to", f"udp://127.0.0.1:{free_port()}", "--for", "0.1", "-q"]) == 1
    warning, _ = capsys.readouterr().err.splitlines()
    assert warning.startswith("warning: /fmu/out/mine_")
    assert re.search(r"more: not played, because a vehicle has room for \d{3} topics: name those to play$", warning)


@pytest.mark.slow  # as processes would be, one after the other
def test_a_recording_is_named_after_the_time_and_played_without_an_agent(
    address: str, here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with Simulator(px4_types, address, [SHORT]):
        assert main(["record", "--for", "1.5", "--link", address]) == 0
    (file,) = here.glob("px4_*.mcap")
    assert file.name in capsys.readouterr().out
    assert main(["play", file.name, "--to", address, "--for", "0.2"]) == 1
    assert "no program answered" in capsys.readouterr().err


def test_a_recording_over_zenoh_tells_that_its_times_are_since_boot(
    px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("zenoh")
    url = f"zenoh://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [SHORT]):
        assert record(url, "-o", "flight", "--for", "0.5", "--direct", "vehicle_status", "vehicle_attitude") == 0
    (note,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    text = note.removeprefix("note: ")
    assert "times since its boot" in text
    assert text in (ROOT / "docs" / "recordings.md").read_text()
    assert recordings.open("flight.mcap").notes == [text]
    assert main(["log", "info", "flight.mcap"]) == 0
    assert text in capsys.readouterr().out


@pytest.mark.parametrize("setting", ["", 'link = "zenoh://127.0.0.1:7447"'])
def test_a_recording_is_not_played_onto_zenoh(setting: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("pyproject.toml").write_text(f"[tool.msggen]\n{setting}\n")
    Writer("flight.mcap").close()
    assert main(["play", "flight.mcap", *([] if setting else ["--to", "zenoh://127.0.0.1:7447"])]) == 2
    assert capsys.readouterr().err == (
        "--to: L101 'zenoh://127.0.0.1:7447': a recording is played as by a client of DDS-XRCE, which is not on Zenoh: "
        "let a program listen on a link such as udp://127.0.0.1:8888, and name that\n1 error\n"
    )
