"""Tests of `msggen sim --log`: the ULog of a vehicle that flies by itself, or under a program."""

from __future__ import annotations

import gc
import os
import random
import re
import shlex
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from msggen import recordings
from msggen.cli import main
from msggen.link.udp import UdpLink
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.sim.airframes import AIRFRAMES
from msggen.sim.alone import BOOT, LoneFlight
from msggen.sim.parameters import PARAMETERS
from msggen.sim.parts import PARTS
from msggen.sim.runner import Runner
from msggen.sim.transport import Udp, read_address
from msggen.sim.ulog import UlogError, UlogWriter, Vehicle
from support.examples import by_day
from support.link_records import Records
from support.repository import ROOT


class _Kept:
    """A log that keeps what it takes, with the time of the flight."""

    def __init__(self, flight: LoneFlight) -> None:
        self._flight = flight
        self.messages: list[tuple[int, str, Any]] = []
        self.lines: list[str] = []

    def add(self, topic: str, message: Any) -> None:
        self.messages.append((self._flight.time, topic, message))

    def text(self, time: int, text: str) -> None:
        self.lines.append(f"{(time - BOOT) / 1e6:.1f} {text}")


def _flown(package: Any, options: Options = Options(), seconds: int = 600) -> _Kept:  # noqa: B008 - it is immutable
    flight = LoneFlight(package, options, 1_790_000_000_000_000)
    kept = _Kept(flight)
    flight.run(kept, BOOT + seconds * 1_000_000)
    return kept


def _random_message(cls: Any, chance: random.Random) -> Any:
    """Return a message whose bytes are 0 and 1, which flags can have too."""
    return cls.decode(b"\0\1\0\0" + bytes(chance.choices((0, 1), k=cls.__msg__.cdr_size)))


def test_the_samples_of_every_message_have_the_size_of_its_struct(px4_types: Any, tmp_path: Path) -> None:
    topics = {name: topic.message for name, topic in px4_types.topics.UORB.items()}
    with UlogWriter(str(tmp_path / "a.ulg"), 0, topics, {}, Vehicle()) as writer:
        for name, cls in topics.items():
            writer.add(name, cls())
    data = (tmp_path / "a.ulg").read_bytes()
    sizes, names, place = {}, {}, 16
    while place < len(data):
        size, kind = struct.unpack_from("<HB", data, place)
        content = data[place + 3 : place + 3 + size]
        if kind == ord("A"):
            names[struct.unpack_from("<H", content, 1)[0]] = content[3:].decode()
        elif kind == ord("D"):
            sizes[names[struct.unpack_from("<H", content)[0]]] = size - 2
        place += 3 + size
    assert sizes == {name: cls.__msg__.struct_size for name, cls in topics.items()}


def test_readers_find_the_values_that_were_written(px4_types: Any, tmp_path: Path) -> None:
    chance = random.Random(7)  # noqa: S311 - not for secrets
    names = [
        "vehicle_status",
        "esc_status",
        "sensor_gps",
        "event",
        "message_format_request",
        "position_setpoint_triplet",
    ]
    topics = {name: px4_types.topics.UORB[name].message for name in names}
    messages = {name: [_random_message(cls, chance) for _ in range(20)] for name, cls in topics.items()}
    path = str(tmp_path / "a.ulg")
    with UlogWriter(path, 0, topics, {"MPC_XY_P": 0.5}, Vehicle(3, "the embedded PX4 v1.18")) as writer:
        for name, own in messages.items():
            for number, message in enumerate(own, 1):  # 0 is no time
                message.timestamp = number
                writer.add(name, message)
    with recordings.open(path) as log:
        assert (dict(log.parameters), log.firmware.release) == ({"MPC_XY_P": 0.5}, "v1.18.0")
        assert log.vehicle == f"{3:036}"
        for name, own in messages.items():
            assert list(log.messages(topics[name], topic=name)) == own
        assert log.problems == []
    theirs = {each.name: each.data for each in ULog(path).data_list}
    for name in names:
        assert theirs[name]["timestamp"].tolist() == list(range(1, 21))
    expected = [message.esc[2].esc_rpm for message in messages["esc_status"]]
    assert theirs["esc_status"]["esc[2].esc_rpm"].tolist() == expected


def test_a_vehicle_flies_a_square_by_itself(px4_types: Any) -> None:
    kept = _flown(px4_types)
    assert [line.partition(" ")[2] for line in kept.lines] == [
        "disarmed, takeoff",
        "armed, takeoff",
        "armed, hold",
        "armed, offboard",
        "armed, land",
        "disarmed, offboard: landed",
    ]
    times = [time for time, _, _ in kept.messages]
    assert times == sorted(times)
    assert all(message.timestamp == time for time, _, message in kept.messages)
    places = np.array([(m.x, m.y, m.z) for _, topic, m in kept.messages if topic == "vehicle_local_position"])
    for corner in ((20, 0, -10), (20, 20, -10), (0, 20, -10), (0, 0, -10)):
        assert np.linalg.norm(places - corner, axis=1).min() < 0.5
    assert abs(places[-1][2]) < 0.01


def test_the_same_seed_gives_the_same_flight(px4_types: Any) -> None:
    first, again, other = (_flown(px4_types, Options(seed=seed), 5) for seed in (1, 1, 2))
    assert first.messages == again.messages != other.messages


def test_a_vehicle_without_a_position_stays_on_the_ground(px4_types: Any) -> None:
    kept = _flown(px4_types, Options(misbehaviour=Misbehaviour(no_position=True)))
    assert [line.partition(" ")[2] for line in kept.lines] == [
        "disarmed, takeoff",
        "command 400 refused: there is no local position",
    ]
    assert kept.messages[-1][0] < BOOT + 10_000_000


@pytest.mark.usefixtures("working_folder")
@pytest.mark.parametrize("vehicle", AIRFRAMES)
def test_the_log_of_a_vehicle_has_its_topics_and_parameters(vehicle: str, px4_types: Any) -> None:
    words = ["sim", "--vehicle", vehicle, "--log", "a.ulg", "--for", "3", "--px4", "v1.18"]
    assert main([*words, "--param", "COM_DISARM_LAND=7"]) == 0
    airframe = AIRFRAMES[vehicle]
    topics = {"airspeed_validated", "vtol_vehicle_status"}
    with recordings.open("a.ulg") as log:
        expected = {**PARAMETERS, **airframe.parameters, "COM_DISARM_LAND": 7.0}
        assert dict(log.parameters) == pytest.approx(expected)
        assert topics & {each.name for each in log.topics} == {
            topic for part in airframe.parts for topic in PARTS[part] & topics
        }
        (first, *_) = log.messages(px4_types.VehicleStatus)
    assert (first.vehicle_type, first.system_type) == (airframe.vehicle_type, airframe.system_type)
    assert (first.is_vtol, first.is_vtol_tailsitter) == (airframe.is_vtol, airframe.is_tailsitter)


@pytest.mark.night  # whole flights
@pytest.mark.parametrize(
    ("vehicle", "modes"),
    [
        ("plane", ["takeoff", "hold", "land"]),
        ("vtol", ["takeoff", "hold", "return"]),
        ("tailsitter", ["takeoff", "hold", "return"]),
        ("rover", ["hold", "offboard", "land"]),
        ("differential", ["hold", "offboard", "land"]),
    ],
)
def test_every_vehicle_flies_by_itself_until_it_is_disarmed(vehicle: str, modes: list[str], px4_types: Any) -> None:
    lines = [line.partition(" ")[2] for line in _flown(px4_types, Options(vehicle=vehicle)).lines]
    assert [line for line in lines if line.startswith("armed")] == [f"armed, {mode}" for mode in modes]
    assert lines[-1] in {"disarmed, hold: landed", "disarmed, offboard: landed"}


@pytest.mark.usefixtures("working_folder")
@by_day("release", ["v1.18", "v1.16", "v1.14"], 3)
def test_the_command_writes_a_flight(release: str, capsys: Any) -> None:
    assert main(["sim", "--log", "flight.ulg", "--px4", release]) == 0
    shown = capsys.readouterr().out
    assert re.match(f"the embedded PX4 {release}: a flight of [5]", shown)
    with recordings.open("flight.ulg") as log:
        assert log.problems == []
        assert log.utc_offset is not None
        assert abs((log.start + log.utc_offset) / 1e9 - time.time()) < 300
        assert f"{sum(len(each.array) for each in log.load().values()):,} samples" in shown
        assert log.parameters.keys() == PARAMETERS.keys()
        assert [text.text for text in log.texts][-1] == "disarmed, offboard: landed"
    assert main(["check", "flight.ulg", release]) == 0


def test_faults_happen_at_their_times(px4_types: Any) -> None:
    kept = _flown(px4_types, Options(faults=((22.0, "mode=land"), (20.0, "battery=0.06"), (12.5, "sticks"))))
    assert [line for line in kept.lines if "armed" not in line] == [
        "12.5 the pilot's sticks are there",
        "20.0 the battery has 6% left",
        "22.0 the pilot selects land",
    ]
    sent = [time for time, topic, _ in kept.messages if topic == "trajectory_setpoint"]
    assert BOOT + 22_000_000 - 100_000 < sent[-1] <= BOOT + 22_020_000  # the program stops when the pilot takes over
    battery = [message for _, topic, message in kept.messages if topic == "battery_status"]
    assert min(message.remaining for message in battery) < 0.06


@pytest.mark.usefixtures("working_folder")
def test_parameters_are_in_the_ulog_and_followed(capsys: Any) -> None:
    words = [
        "sim",
        "--log",
        "flight.ulg",
        "--px4",
        "v1.18",
        "--param",
        "COM_DISARM_LAND=7",
        "--param",
        "RTL_MIN_DIST=2",
    ]
    assert main(words) == 0
    assert capsys.readouterr().err == ""
    with recordings.open("flight.ulg") as log:
        assert log.parameters == pytest.approx({**PARAMETERS, "COM_DISARM_LAND": 7.0, "RTL_MIN_DIST": 2.0})
        status, landed = log["vehicle_status"], log["vehicle_land_detected"]
        disarmed = status["timestamp"][status["arming_state"] == 1].max()
        last = landed["timestamp"][~landed["landed"].astype(bool)].max()
        assert disarmed - last > 6_000_000


@pytest.mark.usefixtures("working_folder")
def test_a_flight_can_end_early(capsys: Any) -> None:
    assert main(["sim", "--log", "flight.ulg", "--for", "3", "--px4", "v1.18"]) == 0
    assert "a flight of 3.0 s" in capsys.readouterr().out


@pytest.mark.usefixtures("working_folder")
@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["--log", "flight.mcap"], "flight.mcap: R101 a ULog is written: choose a name that ends in .ulg"),
        (["--log", "there.ulg"], "there.ulg: R101 there is such a file already: choose another name, or remove it"),
        (["--log", "no/flight.ulg"], "no/flight.ulg: R101 there is no folder 'no': create it first"),
        (["--log", "a.ulg", "--count", "2"], "argument --log: the ULog of one vehicle is written, not with --count"),
        (["--log", "a.ulg", "--speed", "2"], "argument --speed: without ADDRESS, a flight is as fast as it can be"),
        (["--log", "a.ulg", "--fault", "1:no-link"], "argument --fault: 'no-link' needs ADDRESS: without it, there is"),
    ],
)
def test_a_file_that_cannot_be_written_is_told_at_once(arguments: list[str], error: str, capsys: Any) -> None:
    Path("there.ulg").write_text("mine")
    try:
        code: Any = main(["sim", *arguments])
    except SystemExit as exit_:
        code = exit_.code
    assert code == 2
    assert error in capsys.readouterr().err
    assert Path("there.ulg").read_text() == "mine"
    assert [path.name for path in Path().iterdir()] == ["there.ulg"]


@pytest.mark.usefixtures("working_folder")
def test_a_full_disk_is_told(capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def full(path: Any, flags: int, *rest: Any) -> int:
        return opened("/dev/full", os.O_WRONLY) if path == "flight.ulg" else opened(path, flags, *rest)

    monkeypatch.setattr("os.open", full)
    assert main(["sim", "--log", "flight.ulg", "--px4", "v1.18"]) == 2
    assert "flight.ulg: R101 cannot be written: No space left on device" in capsys.readouterr().err


def test_a_log_whose_front_cannot_be_written_is_not_there(
    px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is closed, too: a warning about a resource is an error in tests."""
    path = tmp_path / "a.ulg"

    def fail(*_: Any) -> None:
        raise UlogError("No space left on device")

    for method in ("_put", "_information"):
        with monkeypatch.context() as patch:
            patch.setattr(UlogWriter, method, fail)
            with pytest.raises(UlogError):
                UlogWriter(str(path), BOOT, {"sensor_combined": px4_types.SensorCombined}, {}, Vehicle())
        gc.collect()
        assert not path.exists()


def test_the_log_of_a_vehicle_has_what_it_sends(px4_types: Any, tmp_path: Path) -> None:
    path = str(tmp_path / "a.ulg")
    topics = {each.uorb_topic: each.message for each in px4_types.topics.ENDPOINTS}
    link = UdpLink(port=0)
    link.start(Records())
    try:
        with UlogWriter(path, BOOT, topics, {}, Vehicle()) as writer:
            simulator = Simulator(px4_types, f"udp://127.0.0.1:{link.port}", [Options(sync="short")], writer)
            simulator.serve(3.0)
            sent = sum(simulator.vehicles[0].sent.values())
            simulator.close()
    finally:
        link.close()
    with recordings.open(path) as log:
        assert sum(len(each.array) for each in log.load().values()) == writer.samples >= sent > 0
        assert "connected" in [text.text for text in log.texts]
        assert log["vehicle_status"]["timestamp"].max() < 10_000_000  # since boot, not since 1970


class _Full:
    """A client whose log cannot be written."""

    is_closed = False
    next_time = 0

    def advance(self, now: int) -> None:
        raise UlogError(f"no room at {now}")

    def receive(self, data: bytes, now: int) -> None:
        """Take nothing."""

    def refuse(self) -> None:
        """Take nothing."""

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        return []

    def close(self, now: int) -> None:
        """Wait for an answer."""


def test_a_log_that_cannot_be_written_leaves_no_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[Udp] = []
    monkeypatch.setattr(Udp, "close", lambda each: closed.append(each))  # noqa: PLW0108 - only functions are methods
    runner = Runner([_Full()], read_address("udp://127.0.0.1:9"))
    with pytest.raises(UlogError):
        runner.close()
    assert len(closed) == 1
    monkeypatch.undo()
    closed[0].close()


@pytest.mark.usefixtures("working_folder")
@by_day("section", ["Faults", "A flight without PX4"], 2)
def test_the_page_shows_what_a_flight_prints(section: str, capsys: Any) -> None:
    page = (ROOT / "docs" / "sim.md").read_text(encoding="utf-8").partition(f"## {section}\n")[2]
    (block,) = re.findall(r"```console\n(.*?)```", page, re.DOTALL)[:1]
    for command, shown in re.findall(r"\$ msggen (.*)\n((?:[^$].*\n)*)", block):
        assert main([*shlex.split(command), *(["--px4", "v1.18"] if command.startswith("sim") else [])]) == 0
        assert capsys.readouterr().out == shown
