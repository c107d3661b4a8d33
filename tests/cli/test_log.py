"""Tests of `msggen log`: what it prints and writes, its errors, and docs/recordings.md."""

from __future__ import annotations

import json
import re
import shlex
import struct
from pathlib import Path
from time import sleep
from typing import Any

import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from pyarrow import parquet

from msggen import recordings
from msggen.cli import main, parser_for
from msggen.exports.convert import TABLE_SUFFIXES, TABLES
from msggen.exports.writer import Writer
from msggen.recordings.log import reader
from msggen.recordings.log.reader import Reader
from support.commands import exit_code
from support.flights import TOPICS, write_flight
from support.log_files import Written, write_log
from support.recordings import START, read_mcap
from support.repository import ROOT
from support.ulog import UlogWriter, write_ulog

COUNT = 300
WHOLE = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
PAGE = "".join(each for each in re.split(r"(?m)^(?=## )", WHOLE) if not each.startswith(("## Plot", "## Record ")))
"""The page without its sections on plots and on recording a vehicle, which have tests of their own."""


@pytest.fixture(scope="module")
def source(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log")
    write_ulog(folder / "flight.ulg")
    return write_flight(folder / "flight.mcap", px4_types, COUNT)


@pytest.fixture(autouse=True)
def here(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("flight.mcap", "flight.ulg"):
        (tmp_path / name).write_bytes((source.parent / name).read_bytes())
    return tmp_path


@pytest.fixture
def broken(here: Path) -> str:
    (here / "broken.mcap").write_bytes((here / "flight.mcap").read_bytes()[:150_000])
    return "broken.mcap"


def run(*words: str) -> int:
    return main(["log", *words])


def test_info_tells_topics_counts_and_times(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "flight.mcap") == 0
    printed = capsys.readouterr().out
    assert re.search(rf"^topics +{len(TOPICS) + 2}, {COUNT * (len(TOPICS) + 2):,} samples$", printed, re.MULTILINE)
    assert re.search(
        rf"^/fmu/out/esc_status +EscStatus +{COUNT} +[\d.]+ kB +100\.0 +0\.000 +2\.990$", printed, re.MULTILINE
    )
    assert re.search(r"^start +2026-09-21 ", printed, re.MULTILINE)
    assert re.search(r"^firmware +v1\.18 ", printed, re.MULTILINE)
    assert run("info", "flight.mcap", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {each["name"]: each["samples"] for each in found["topics"]}["/fmu/out/esc_status"] == COUNT
    assert found["duration"] == pytest.approx(2.99, abs=0.001)
    assert found["problems"] == []


def test_info_tells_what_only_a_ulog_has(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "flight.ulg") == 0
    printed = capsys.readouterr().out
    for line in (
        r"parameters +1, 1 changed later",
        r"texts +1",
        r"dropouts +1, 0\.012 s",
        r"sensor_gps 1 +SensorGps +200 ",
    ):
        assert re.search(rf"^{line}", printed, re.MULTILINE)
    assert run("info", "flight.ulg", "--json") == 0
    assert json.loads(capsys.readouterr().out)["parameters"] == {"count": 1, "not_default": None, "changed": 1}


def test_info_tells_what_ulog_info_tells(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = UlogWriter()
    for key, value in {
        "char[3] sys_name": b"PX4",
        "char[5] sys_os_name": b"NuttX",
        "char[11] ver_hw": b"PX4_FMU_V6X",
        "char[40] ver_sw": b"0123456789" * 4,
        "char[6] ver_sw_branch": b"mybran",
    }.items():
        writer.information(key, value)
    writer.part("char[2] boot_console_output", b"ab", continues=False)
    writer.part("char[2] boot_console_output", b"cd", continues=True)
    writer.part("char[4] hardfault_plain", b"Type", continues=False)
    writer.format("a", "uint64_t timestamp;float x;")
    writer.subscribe(0, "a")
    for time in range(3):
        writer.sample(0, struct.pack("<Qf", time * 500_000, 1.0))
    for milliseconds in (10, 40):
        writer.dropout(milliseconds)
    for level in (4, 3, 6, 4):
        writer.text(level, 1_000_000, "text")
    writer.write(here / "told.ulg")
    assert run("info", "told.ulg", "--verify") == 0
    printed = capsys.readouterr().out
    for line in (
        "vehicle +PX4_FMU_V6X",
        "system +PX4, NuttX",
        "firmware +unknown firmware, commit 012345678901 of mybran",
        r"dropouts +2, 0\.050 s: mean 0\.025 s, longest 0\.040 s",
        "texts +4, 1 error, 2 warning",
        "hard fault  the firmware crashed before this log: --json prints hardfault_plain",
        "checksums +none in a ULog, which was read to its end",
        "information +7 values, 2 of several parts: --json prints all",
        "a +A +3 +36 B +2.0 ",
    ):
        assert re.search(rf"^{line}", printed, re.MULTILINE), line
    assert run("info", "told.ulg", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["information"]["boot_console_output"] == [["ab", "cd"]]
    assert found["commit"] == "0123456789" * 4
    assert (found["topics"][0]["sample_size"], found["topics"][0]["size"]) == (12, 36)


def test_gaps_in_many_chunks_are_shown_on_request(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (here / "many.mcap").open("wb") as file:
        writer = McapWriter(file, chunk_size=1)
        writer.start("ros2", "tests")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\n"))
        for number in [*range(60), *range(100, 150)]:
            writer.add_message(channel, START + number * 10**9, b"\0\1\0\0" + bytes(8), START)
        writer.finish()

    def printed(*words: str) -> str:
        assert run("info", "many.mcap", *words) == 0
        return capsys.readouterr().out

    hint = "gaps        not searched for in this many chunks: --gaps does\n"
    row = r"^/a +A +110 +1\.3 kB +0\.7 +0\.000 +149\.000"
    assert hint in printed()
    assert re.search(rf"{row}$", printed(), re.MULTILINE)
    for words in (["--gaps"], ["--verify"]):
        assert hint not in printed(*words)
        assert re.search(rf"{row} +1 \(41\.000\)$", printed(*words), re.MULTILINE)
    assert "gaps 1 (41.000)" in printed("/a")
    assert json.loads(printed("--json"))["topics"][0]["gaps"] is None
    assert json.loads(printed("--json", "--gaps"))["topics"][0]["gaps"] == [[59.0, 100.0]]


def test_info_tells_the_contents_of_mcap_and_verifies_them(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (here / "more.mcap").open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start("ros2", "tests")
        writer.add_metadata("flight", {"pilot": "Ann"})
        writer.add_attachment(START, START, "calibration.yaml", "text/yaml", b"k: 1")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\n"))
        for number in range(10):
            writer.add_message(channel, START + number * 10**9, b"\0\1\0\0" + struct.pack("<Q", 0xABCD), START)
        writer.finish()
    assert run("info", "more.mcap", "--verify") == 0
    printed = capsys.readouterr().out
    assert re.search(r"^contents +1 chunk \(none\), 1 attachment, 1 metadata record$", printed, re.MULTILINE)
    assert re.search(r"^checksums +1 chunk compared$", printed, re.MULTILINE)
    assert re.search(r"^end +2026-\d\d-\d\d \d\d:\d\d:\d\d UTC$", printed, re.MULTILINE)
    data = (here / "more.mcap").read_bytes()
    (here / "more.mcap").write_bytes(data.replace(struct.pack("<Q", 0xABCD), struct.pack("<Q", 0xABCE), 1))
    assert run("info", "more.mcap") == 0
    capsys.readouterr()
    assert run("info", "more.mcap", "--verify") == 1
    assert "more.mcap: a chunk does not match its CRC" in capsys.readouterr().err
    assert run("info", "more.mcap", "--verify", "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["checksums"] == {"compared": 1, "missing": 0}
    assert found["contents"] == {"chunks": 1, "compression": "none", "attachments": 1, "metadata": 1}
    assert found["problems"][0]["text"].startswith("a chunk does not match its CRC")
    assert found["problems"][0]["samples"] == 10  # they are left out
    assert run("repair", "more.mcap") == 1
    output = capsys.readouterr()
    text = (
        "more.mcap: a chunk does not match its CRC and is left out, with samples of /a, from 0.000 to 9.000 s (at byte "
    )
    assert output.err.startswith(text)
    assert run("repair", "more.mcap", "--keep-damaged") == 0
    output = capsys.readouterr()
    assert output.err.startswith(
        "more.mcap: a chunk does not match its CRC and is read all the same, with samples of /a"
    )
    assert "nothing is missing" not in output.out
    with (here / "bare.mcap").open("wb") as file:
        writer = McapWriter(file, enable_crcs=False)
        writer.start("ros2", "tests")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\n"))
        writer.add_message(channel, START, b"\0\1\0\0" + bytes(8), START)
        writer.finish()
    assert run("info", "bare.mcap") == 0
    assert re.search(
        r"^checksums +none in 1 chunk: changed values are not noticed$", capsys.readouterr().out, re.MULTILINE
    )
    assert run("info", "bare.mcap", "--verify") == 0
    assert re.search(r"^checksums +0 chunks compared, 1 without a checksum$", capsys.readouterr().out, re.MULTILINE)
    (here / "bag").mkdir()
    (here / "more.mcap").rename(here / "bag" / "more.mcap")
    assert run("info", "bag", "--json") == 1
    assert json.loads(capsys.readouterr().out)["contents"]["attachments"] == 1


def test_info_tells_what_is_missing(broken: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", broken) == 1
    printed = capsys.readouterr()
    assert re.search(r"^problems +\d problems?, on stderr$", printed.out, re.MULTILINE)
    assert re.search(r"^broken\.mcap: .*cut off.* \(at byte \d+, \d+ bytes left out\)$", printed.err, re.MULTILINE)
    assert run("info", broken, "--json") == 1
    assert json.loads(capsys.readouterr().out)["problems"][0]["offset"] > 0


def test_show_prints_samples_as_topic_echo_does(px4_types: Any, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from msggen.messages.formats import json_writer, text_writer

    message = px4_types.EscStatus(timestamp=7, esc_count=2, esc_armed_flags=1)
    other = px4_types.VehicleStatus(timestamp=8, nav_state=px4_types.VehicleStatus.NavigationState.AUTO_LOITER)
    writer = Writer(str(here / "small.mcap"))
    for each in (message, other):
        info = each.__msg__
        from msggen.exports.writer import Channel

        number = writer.add_channel(Channel(f"/fmu/out/{info.name}", info.ros_type, info.definition, ""))
        writer.write(number, 10**18, 10**18, each.encode())
    writer.close()
    for each in (message, other):
        name = each.__msg__.name
        assert run("show", "small.mcap", name) == 0
        assert capsys.readouterr().out == f"# 0.000000 s\n{text_writer(type(each))(each)}\n---\n"
        assert run("show", "small.mcap", name, "--json") == 0
        time, *values = json.loads(capsys.readouterr().out).items()
        assert time[0] == "time"
        assert dict(values) == json.loads(json_writer(type(each))(each))


def test_show_chooses_samples_and_fields(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["show", "flight.mcap", "sensor_combined", "--start", "1", "--count", "3", "--field", "timestamp"]
    assert run(*words) == 0
    times = [
        f"# {1 + index / 100 + 1e-6:.6f} s\ntimestamp: {2_000_000 + index * 10_000}  # us\n---\n" for index in range(3)
    ]
    assert capsys.readouterr().out == "".join(times)
    assert run(*words, "--json") == 0
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    start = found[0]["time"]
    assert found == [
        {"time": pytest.approx(start + index / 100), "timestamp": 2_000_000 + index * 10_000} for index in range(3)
    ]
    assert run("show", "flight.mcap", "texts", "--count", "2", "--json") == 0
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert found[1] == {
        "time": pytest.approx(0.01, abs=1e-3),
        "name": "name 1 ü",
        "values": [0.5],
        "points": [{"x": 1.5, "label": "label"}],
    }


@pytest.fixture
def unordered(here: Path) -> str:
    samples = [(START + at * 10**8, START, b"\0\1\0\0" + struct.pack("<Q", at)) for at in (5, 3, 1, 0, 2, 4, 2)]
    with (here / "order.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros2", "tests")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\n"))
        for time, published, payload in samples:
            writer.add_message(channel, time, payload, published)
        writer.finish()
    return "order.mcap"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", [0, 1, 2, 2, 3, 4, 5]),
        ("-n 1", [0]),
        ("-n 3", [0, 1, 2]),
        ("--start 0.2 -n 3", [2, 2, 3]),
        ("--start 0.1 --stop 0.4", [1, 2, 2, 3]),
        ("--stop 0.3 -n 9", [0, 1, 2, 2]),
    ],
)
@pytest.mark.parametrize("piece", [1, 2, 100])
def test_show_prints_samples_by_time(
    unordered: str, words: str, expected: list[int], piece: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("msggen.cli.commands.log.show._PIECE", piece)
        assert run("show", unordered, "a", "--json", *words.split()) == 0
    assert [json.loads(line)["number"] for line in capsys.readouterr().out.splitlines()] == expected


def test_show_prints_all_samples_of_a_ulog_in_pieces(monkeypatch: Any, capsys: Any) -> None:
    assert run("show", "flight.ulg", "sensor_gps") == 0
    expected = capsys.readouterr().out
    monkeypatch.setattr("msggen.cli.commands.log.show._PIECE", 7)
    assert run("show", "flight.ulg", "sensor_gps") == 0
    assert capsys.readouterr().out == expected


def test_chosen_texts_are_shown_as_texts(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    definition = "char[6] name\nPart[2] parts\n" + "=" * 80 + "\nMSG: a/Part\nchar[3] tag\nuint8 number\n"
    payload = b"\0\1\0\0" + b"hello\0" + b"ab\0\1" + b"cde\2"
    write_log(here / "text.mcap", [Written("/a", "a/msg/A", definition, [(START, START, payload)])])
    words = ["--field", "name", "--field", "parts", "--field", "name[1]"]
    assert run("show", "text.mcap", "a", *words) == 0
    lines = [
        'name: "hello"', 'parts[0].tag: "ab"', "parts[0].number: 1", 'parts[1].tag: "cde"', "parts[1].number: 2"
    ]  # fmt: skip
    assert capsys.readouterr().out == "\n".join(["# 0.000000 s", *lines, "---", ""])
    assert run("show", "text.mcap", "a", "--json", "--field", "name", "--field", "parts[1].tag") == 0
    assert json.loads(capsys.readouterr().out) == {"time": 0.0, "name": "hello", "parts[1].tag": "cde"}
    assert run("show", "text.mcap", "a", "--field", "name[1]") == 0
    assert "name[1]: 101\n" in capsys.readouterr().out


def test_tables_of_chosen_fields_have_the_time(here: Path) -> None:
    assert run("convert", "flight.mcap", "esc_status", "--field", "esc_count", "-o", "some", "-q") == 0
    columns = parquet.read_table(here / "some" / "esc_status.parquet").column_names
    assert columns == ["timestamp", "log_time", "publish_time", "esc_count"]


def test_show_prints_parameters_and_texts(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("show", "flight.ulg", "--params") == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == "MC_P: 6.5"
    assert re.fullmatch(r"MC_P: 7\.5  # from 1\.00\d+ s on", second)
    assert run("show", "flight.ulg", "--texts") == 0
    assert capsys.readouterr().out == "    1.000000 s  warning   café\n"
    assert run("show", "flight.ulg", "--texts", "--json") == 0
    assert json.loads(capsys.readouterr().out)["text"] == "café"
    assert run("show", "flight.ulg", "sensor_gps", "--instance", "1", "--count", "1", "--field", "fix_type") == 0
    assert "fix_type: 3" in capsys.readouterr().out


def test_show_chooses_parameters_and_texts(capsys: pytest.CaptureFixture[str]) -> None:
    for words, lines in (
        ("--params mc_p", 2),
        ("--params 'MC_*' --count 1", 1),
        ("--texts --start 0.5", 1),
        ("--texts --stop 0.5", 0),
        ("--texts --start 5", 0),
    ):
        assert run("show", "flight.ulg", *shlex.split(words)) == (0 if lines else 1)
        printed = capsys.readouterr()
        assert len(printed.out.splitlines()) == lines
        assert printed.err.startswith("" if lines else "flight.ulg: there are no texts ")


def test_parameters_are_compared_with_their_defaults(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = UlogWriter()
    for name, value in {"MC_A": 1.5, "MC_B": 2.5, "MC_C": 3.5}.items():
        writer.parameter(name, value)
    writer.parameter("MC_A", 1.0, default=3)
    writer.parameter("MC_B", 2.0, default=1)  # the airframe has another default than the firmware
    writer.format("a", "uint64_t timestamp;float x;")
    writer.subscribe(0, "a")
    for time in range(3):
        writer.sample(0, struct.pack("<Qf", time * 500_000, 1.0))
    writer.parameter("MC_C", 4.5)
    writer.write(here / "tuned.ulg")
    assert run("info", "tuned.ulg") == 0
    assert re.search("^parameters  3, 1 not default, 1 changed later$", capsys.readouterr().out, re.MULTILINE)
    assert run("info", "tuned.ulg", "--json") == 0
    assert json.loads(capsys.readouterr().out)["parameters"] == {"count": 3, "not_default": 1, "changed": 1}
    assert run("show", "tuned.ulg", "--params", "--changed") == 0
    changed = ["MC_A: 1.5  # default 1", "MC_C: 3.5", "MC_C: 4.5  # from 0.000000 s on"]
    assert capsys.readouterr().out.splitlines() == changed
    assert run("show", "tuned.ulg", "--params") == 0
    airframe = "MC_B: 2.5  # default of the airframe; of the firmware 2"
    assert capsys.readouterr().out.splitlines() == [changed[0], airframe, *changed[1:]]
    assert run("show", "tuned.ulg", "--params", "mc_b", "--json") == 0
    found = {"name": "MC_B", "value": 2.5, "default": 2.5, "firmware_default": 2.0}
    assert json.loads(capsys.readouterr().out) == found
    assert run("show", "tuned.ulg", "--params", "mc_b", "--changed") == 1
    assert capsys.readouterr().err == (
        "tuned.ulg: of the parameters that were asked for, none changed, and all have their defaults\n"
    )


@pytest.mark.parametrize("name", ["sensor_gps[1]", "sensor_gps_1", "SensorGps[1]", "sensor_gps 1"])
def test_instances_have_the_same_spellings_everywhere(
    name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("show", "flight.ulg", "sensor_gps", "--instance", "1", "--count", "3") == 0
    expected = capsys.readouterr().out
    assert run("show", "flight.ulg", name, "--count", "3") == 0
    assert capsys.readouterr().out == expected
    assert run("convert", "flight.ulg", name, "-o", "made", "-q") == 0
    assert [path.name for path in (here / "made").iterdir()] == ["sensor_gps_1.parquet"]
    assert run("cut", "flight.ulg", name, "-o", "part.mcap", "-q") == 0
    assert run("convert", "part.mcap", "sensor_gps[1]", "-o", "again", "-q") == 0
    assert [path.name for path in (here / "again").iterdir()] == ["sensor_gps_1.parquet"]
    assert run("plot", "flight.ulg", f"{name}.fix_type", "-o", "made.svg", "-q") == 0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("show flight.mcap esc_status --start 5", "flight.mcap: there are no samples of esc_status from 5 s on\n"),
        (
            "cut flight.mcap --start 5 --stop 6 -o a.mcap",
            "a.mcap is not written: there are no samples from 5 s to 6 s\n",
        ),
        ("cut flight.ulg --start 50 -o a.mcap", "a.mcap is not written: there are no samples from 50 s on\n"),
        ("convert flight.mcap --start 5 -o a", "a is not written: there are no samples from 5 s on\n"),
    ],
)
def test_nothing_is_told(words: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words.split()) == 1
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.endswith(expected)
    assert words.startswith("show") or not Path(words.rpartition(" ")[2]).exists()


def test_convert_chooses_the_format_by_the_name(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("convert", "flight.ulg", "-o", "copy.mcap", "sensor_gps", "esc_*") == 0
    assert capsys.readouterr().out.startswith("copy.mcap: 600 samples, ")
    assert {each.topic for each in read_mcap(here / "copy.mcap")} == {
        "/fmu/out/sensor_gps",
        "/fmu/out/sensor_gps_1",
        "/fmu/out/esc_status",
    }
    assert run("convert", "flight.mcap", *TOPICS, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["output"] == "flight"
    assert sorted(path.name for path in (here / "flight").iterdir()) == sorted(f"{name}.parquet" for name in TOPICS)
    assert run("convert", "flight.mcap", "--format", "rosbag2", "-o", "bag", *TOPICS, "-q") == 0
    assert capsys.readouterr().out == ""
    assert run("info", "bag") == 0


def test_cut_and_merge_give_the_whole(here: Path) -> None:
    names = [*TOPICS, "texts"]
    assert run("cut", "flight.mcap", *names, "--stop", "1.5", "-o", "one.mcap") == 0
    assert run("cut", "flight.mcap", *names, "--start", "1.5", "-o", "two.mcap") == 0
    assert run("merge", "two.mcap", "one.mcap") == 0
    expected = [each for each in read_mcap(here / "flight.mcap") if each.topic != "/json"]
    assert read_mcap(here / "merged.mcap") == expected


def test_repair_keeps_every_whole_sample(here: Path, broken: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("repair", broken) == 0
    printed = capsys.readouterr()
    assert "broken.mcap: " in printed.err
    found, whole = read_mcap(here / "broken.repaired.mcap"), read_mcap(here / "flight.mcap")
    assert 0 < len(found) < len(whole)
    assert set(found) <= set(whole)
    with recordings.open(here / broken) as log, recordings.open(here / "broken.repaired.mcap") as repaired:
        assert sum(topic.count for topic in log.topics) == len(found)
        assert repaired.problems == []
    assert run("info", "broken.repaired.mcap") == 0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("info nothing.mcap", "nothing.mcap: R102 cannot be read: No such file or directory"),
        ("info empty", "empty: R102 is empty"),
        ("info flihgt.mcap", "No such file or directory, did you mean 'flight.mcap'?"),
        ("info .", "has several recordings and no metadata.yaml: name one of 'flight.mcap', 'flight.ulg'"),
        ("info none", "none: R102 is not a recording: a folder without metadata.yaml, *.mcap and *.db3\n"),
        ("plot flight.mcap esc_status.esc_count -o no/a.svg", "no/a.svg: R101 there is no folder 'no': create it firs"),
        (
            "info flight.mcap flight.ulg",
            "flight.ulg is another file: msggen log info reads one recording: run it for each file",
        ),
        (
            "plot flight.mcap flight.ulg",
            "flight.ulg is another file: msggen log plot reads one recording: run it for each file",
        ),
        (
            "convert flight.mcap flight.ulg",
            "flight.ulg is another file: msggen log convert reads one recording: `msggen log convert FOLDER -o FLEET`",
        ),
        ("show flight.mcap esc_status --changed", "argument --changed: only with --params"),
        ("show flight.mcap esc_statsu", "no topic is called 'esc_statsu', did you mean 'esc_status'?"),
        (
            "show flight.mcap esc_status --field esc_cuont",
            "did you mean 'esc_count'? `msggen log info flight.mcap TOPIC` lis",
        ),
        ("show flight.mcap", "expected one of TOPIC, --params and --texts"),
        (
            "show flight.mcap --params",
            "only a ULog, and an MCAP file made of one, have parameters and texts, this is mcap",
        ),
        ("show flight.ulg --params MC_Q", "no parameter is called 'MC_Q', did you mean 'MC_P'?"),
        ("show flight.ulg --params --start 1", "argument --start: not with --params"),
        ("show flight.ulg --texts --field q", "argument --field: not with --texts"),
        ("show flight.mcap esc_status --start -1", "argument --start: expected"),
        ("show flight.mcap esc_status --count 0", "argument --count: expected a number from 1"),
        (
            "convert flight.mcap esc_statsu",
            "argument TOPIC: no topic is called 'esc_statsu', did you mean 'esc_status'?",
        ),
        ("convert flight.mcap copy.mcap", "no topic is called 'copy.mcap': name what to write with -o copy.mcap"),
        ("convert flight.mcap --field tmestamp", "did you mean 'timestamp'?"),
        ("convert flight.mcap --format parkett", "did you mean 'parquet'?"),
        ("convert flight.mcap --format mcap", "flight.mcap: R101 there is such a file or folder already"),
        ("convert flight.mcap -o no/where", "no/where: R101 there is no folder 'no': create it first"),
        ("convert flight.mcap -o a.mcap --field timestamp", f"fields can be chosen for {', '.join(TABLES)}"),
        ("convert flight.mcap --jobs 2", "argument --jobs: only for a folder of recordings"),
        ("cut flight.mcap", "nothing to cut: give --start, --stop or topics"),
        ("cut flight.mcap --start 2 --stop 1", "argument --stop: 1 is not after --start 2"),
        ("cut flight.mcap --start soon", "argument --start: expected a time in s of 0 or more"),
        ("merge flight.mcap", "expected several recordings, found one"),
        (
            "merge flight.mcap flight.ulg ./flight.mcap",
            "flight.mcap is named twice: its samples would be written twice",
        ),
        (
            "show flight.ulg error --texts",
            "argument TOPIC: not with --texts, which prints all lines of the log, found 'e",
        ),
        ("show flight.ulg --texts --params", "argument --texts: not with --params"),
        (
            "show flight.ulg esc_status --start 1795406390",
            "expected a time in s of 0 or more and up to 1000000000, found",
        ),
        ("info flight.ulg sensor_gps flight.mcap", "msggen log info reads one recording: run it for each file"),
        ("convert flight.mcap -o a.csv", "a.csv is a file for one topic, and there are 5: name one of "),
        ("convert flight.mcap -o a.CSV", "a.CSV is a file for one topic, and there are 5: name one of "),
        ("convert flight.mcap -o a.parquet", "a.parquet is a file for one topic, and there are 5: name one of "),
        ("convert flight.mcap -o a.arrow", "a.arrow is a file for one topic, and there are 5: name one of "),
        ("convert flight.mcap -o a.db3", "-o/--output: a folder is written: --format rosbag2 --storage sqlite3 -o a\n"),
        ("convert flight.mcap -o a.ulg", "-o/--output: no ULog is written: --format mcap -o a.mcap\n"),
        ("convert flight.mcap --format csv -o a.csv", "or write a folder 'a' in the format csv"),
        ("convert flight.mcap --format csv -o a.parquet", "-o/--output: a folder is written: --format csv -o a\n"),
        ("convert flight.mcap -o a.mcap.gz", "-o/--output: no compressed file is written: -o a.mcap\n"),
        ("convert flight.mcap -o a.xlsx", f"no .xlsx is written, expected {', '.join(TABLE_SUFFIXES)} or .mcap"),
        ("convert flight.mcap -o b/a.txt", "no .txt is written"),
        ("convert flight.mcap --format csv -o a.mcap", "-o/--output: a folder is written: --format csv -o a\n"),
        ("convert flight.mcap --format mcap -o a.csv", "an MCAP file is written, not .csv: -o a.mcap\n"),
        ("cut flight.mcap esc_status -o a.ulg", "an MCAP file is written, not .ulg: -o a.mcap\n"),
        ("merge flight.mcap flight.ulg -o a.csv", "an MCAP file is written, not .csv: -o a.mcap\n"),
        ("repair flight.mcap -o a.db3", "an MCAP file is written, not .db3: -o a.mcap\n"),
    ],
)
def test_errors_tell_what_to_do(words: str, expected: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "empty").write_bytes(b"")
    (here / "none").mkdir()
    before = sorted(here.iterdir())
    assert exit_code(["log", *shlex.split(words)]) == 2
    assert expected in capsys.readouterr().err
    assert sorted(here.iterdir()) == before


def test_check_suggests_recordings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "flihgt.mcap", "v1.18"]) == 2
    assert "flihgt.mcap: S101 no such file, did you mean 'flight.mcap'?" in capsys.readouterr().err


def test_the_help_lists_the_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run("--help")
    assert "1 something cannot be read" in " ".join(capsys.readouterr().out.split())


def test_a_bar_shows_the_progress(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("msggen.cli.commands.log.progress._PATIENCE", 0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    assert run("convert", "flight.ulg", "-o", "copy.mcap", "sensor_gps") == 0
    assert "100%" in capsys.readouterr().err


@pytest.mark.parametrize("words", ["info flight.ulg --verify", "plot flight.ulg sensor_gps.fix_type -o gps.svg"])
def test_a_bar_shows_that_a_recording_is_read(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:

    opens: Any = recordings.open

    def opened(*arguments: Any, **options: Any) -> Any:
        sleep(0.3)
        return opens(*arguments, **options)

    def times(*arguments: Any, reads: Any = reader._Files.times) -> Any:
        sleep(0.3)
        return reads(*arguments)

    def parts(*arguments: Any, reads: Any = Reader._parts) -> Any:
        sleep(0.3)
        return reads(*arguments)

    monkeypatch.setattr(reader._Files, "times", times)
    monkeypatch.setattr(Reader, "_parts", parts)
    monkeypatch.setattr(recordings, "open", opened)
    monkeypatch.setattr("msggen.cli.commands.log.progress._PATIENCE", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    assert run(*shlex.split(words)) == 0
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert run(*shlex.split(words)) == 0
    printed = capsys.readouterr().err
    assert "opening flight.ulg" in printed
    assert "reading flight.ulg" in printed


# --- the page


def test_the_commands_of_the_page_are_accepted() -> None:
    commands = re.findall(r"`(msggen log [^`]+)`", PAGE)
    assert len(commands) > 6
    for command in commands:
        words = shlex.split(command.replace("...", ""))[1:]
        if "FORMAT" not in words:
            parser_for(words).parse_args(words)
