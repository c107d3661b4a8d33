"""Tests of how a recording is used from Python: names, times, and wrong arguments."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen import InputError, recordings
from msggen.exports.convert import convert
from msggen.exports.writer import Channel, Writer
from msggen.recordings import Log, RecordingError
from support.imports import READING
from support.ulog import write_ulog


@pytest.fixture
def log(tmp_path: Path) -> Log:
    write_ulog(tmp_path / "flight.ulg")
    return recordings.open(tmp_path / "flight.ulg")


@pytest.mark.parametrize("times", [{"start": -1}, {"start": 2, "stop": 1}, {"stop": -1}, {"start": float("nan")}])
def test_times_that_cannot_be(log: Log, times: dict[str, Any], tmp_path: Path) -> None:
    for read in (log.load, log.samples, lambda *_, **options: list(log.batches(**options))):
        with pytest.raises(RecordingError, match="expected a time in s of "):
            read(*(["sensor_gps"] if read == log.samples else []), **times)
    with pytest.raises(RecordingError, match="expected a time in s of "):
        convert(log, str(tmp_path / "made"), format="csv", **times)
    with pytest.raises(RecordingError, match="expected a time in s of "):
        log.align("sensor_gps", "sensor_gps", tolerance=1, **times)


@pytest.mark.parametrize("wrong", ["1", True, [1]])
def test_times_that_are_no_numbers(log: Log, wrong: Any) -> None:
    for name in ("start", "stop"):
        with pytest.raises(TypeError, match=f"^{name}: expected a time in s, got "):
            log.samples("sensor_gps", **{name: wrong})
    with pytest.raises(TypeError, match=r"^tolerance: expected a time in s, got "):
        log.align("sensor_gps", "sensor_gps", tolerance=wrong)


def test_times_beyond_the_recording(log: Log) -> None:
    count = len(log["sensor_gps"])
    assert len(log.samples("sensor_gps", start=0, stop=float("inf"))) == count
    assert len(log.samples("sensor_gps", start=1e5)) == len(log.samples("sensor_gps", start=1, stop=1)) == 0
    assert len(log.align("sensor_gps", ("sensor_gps", 1), tolerance=9, direction="nearest", start=0)) == count


def test_a_text_is_one_name(log: Log, tmp_path: Path) -> None:
    assert list(log.load("sensor_gps")) == list(log.load(["sensor_gps"])) == ["sensor_gps"]
    assert list(log.load([("sensor_gps", 1)])) == [("sensor_gps", 1)]
    assert list(log.load(("sensor_gps", 1))) == [("sensor_gps", 1)]  # type: ignore[arg-type]
    assert list(log.load(("sensor_gps", "esc_status"))) == ["sensor_gps", "esc_status"]
    assert list(log.columns("sensor_gps", fields="fix_type")) == ["fix_type"]
    made = convert(log, str(tmp_path / "made"), format="csv", topics="sensor_gps", fields="fix_type")
    (path,) = made.files
    assert Path(path).read_text().splitlines()[0].split(",")[-1].strip('"') == "fix_type"
    both = log.align("esc_status", "sensor_gps", tolerance=1).choose("sensor_gps")
    assert list(both.samples) == ["sensor_gps"]
    plot = pytest.importorskip("msggen.recordings.log.plot")
    assert [each.label for each in plot.read_series(log, "sensor_gps.fix_type")] == ["sensor_gps.fix_type"]


def test_instances_have_several_spellings(log: Log) -> None:
    expected = log["sensor_gps", 1].tobytes()
    assert expected != log["sensor_gps"].tobytes()
    for key in ("sensor_gps[1]", "sensor_gps_1", "SensorGps[1]"):
        assert log[key].tobytes() == expected
    assert log["sensor_gps[0]"].tobytes() == log["sensor_gps"].tobytes()
    assert log.samples("sensor_gps", instance=1).array.tobytes() == expected
    for read in (log.columns, log.table, log.frame):
        assert len(read("sensor_gps", instance=1, fields="fix_type")) > 0
    with pytest.raises(RecordingError, match="'sensor_gps' has no instance 3, it has: 0, 1"):
        log.topic("sensor_gps[3]")
    with pytest.raises(RecordingError, match="no topic is called 'sensor_gps_3'"):
        log.topic("sensor_gps_3")


def test_a_log_is_a_mapping(log: Log) -> None:
    assert list(log) == log.keys()
    assert {"esc_status", "sensor_gps", ("sensor_gps", 1)} <= set(log)
    assert len(log) == len(log.topics) == len(set(log))
    assert all(key in log for key in log)
    text = repr(log)
    assert text.startswith("<Log ")
    assert text.endswith(f"flight.ulg': ulog, {log.duration:.3f} s, {len(log)} topics>")
    for wrong in (0, ("a",), None, (1, "sensor_gps")):
        with pytest.raises(TypeError, match=r"^expected the name of a topic, or a name and the number"):
            log[wrong]  # type: ignore[index]


def test_what_open_raises(tmp_path: Path) -> None:
    write_ulog(tmp_path / "flight.ulg")
    with pytest.raises(FileNotFoundError):
        recordings.open(tmp_path / "nope")
    with pytest.raises(InputError):
        recordings.open(tmp_path / "flight.ulg", "nope")


@pytest.mark.parametrize(("names", "is_one"), [(("a_0", "a_1", "a_10"), True), (("b_0", "b_1"), False), (("b",), True)])
def test_a_folder_without_metadata(names: tuple[str, ...], *, is_one: bool, tmp_path: Path, px4_types: Any) -> None:
    """A recorder that was killed leaves files called after the folder."""
    folder = tmp_path / "a"
    folder.mkdir()
    for number, name in enumerate(names):
        writer = Writer(str(folder / f"{name}.mcap"))
        info = px4_types.EscStatus.__msg__
        channel = writer.add_channel(Channel("/fmu/out/esc_status", info.ros_type, info.definition, ""))
        writer.write(channel, 10**18 + number, 10**18 + number, px4_types.EscStatus(timestamp=number).encode())
        writer.close()
    if is_one:
        assert recordings.open(folder)["esc_status"]["timestamp"].tolist() == list(range(len(names)))
    else:
        text = r"has several recordings and no metadata.yaml.*`msggen log convert .* are called 'a_0.mcap'"
        with pytest.raises(RecordingError, match=text):
            recordings.open(folder)


def test_reading_a_ulog_imports_only_what_that_needs(tmp_path: Path) -> None:
    program = (
        "import sys, numpy, zstandard; given = {*sys.modules}\n"
        "from msggen import recordings\n"
        'with recordings.open(sys.argv[1]) as log: log.load(), log["sensor_gps", 0], log.notes, log.problems\n'
        "print(*({*sys.modules} - given))"
    )
    command = [sys.executable, "-c", program, str(write_ulog(tmp_path / "a.ulg"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert not READING & {*done.stdout.split()}
