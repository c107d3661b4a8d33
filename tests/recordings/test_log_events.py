"""Tests of the events of PX4 in recordings: against pyulog, in all formats, and with metadata of attackers."""

from __future__ import annotations

import json
import lzma
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2.reader import read_ros2_messages
from pyarrow.parquet import read_table
from pyulog import ULog
from pyulog.px4_events import PX4Events
from rosbags.highlevel import AnyReader

from msggen import recordings
from msggen.exports.convert import convert, join
from msggen.recordings.decode import event_metadata
from msggen.recordings.decode.event_metadata import LONGEST, fill, parse_template
from msggen.recordings.log import events as log_events
from msggen.recordings.log.decoded_events import decoded_events
from msggen.recordings.log.plot import draw
from support.events import METADATA, START, EventLog, packed, write_events
from support.repository import shared

TEXTS = [
    (0, "info", "Armed by stick gesture"),
    (5, "warning", "[commander] low battery"),
    (10, "error", "Armed by (unknown: -1)"),
    (20, "warning", "Climb to 2.2 m at 80%, not {3}"),
    (30, "info", "Set one/four {1}"),
    (40, "info", "Set one/(unknown: 9) {1}"),
    (50, "info", "-1 2 -3 4 -5 6"),
    (60, "info", "Landed < 3 {x} https://c.d"),
    (90, "info", "event 0x01000abc"),
]
UNKNOWN = "1 event not decoded: metadata_events does not have them: 0x01000abc"


def texts_of(path: str | Path) -> list[tuple[int, str, str]]:
    """Return the texts of a log, with times in us after its start."""
    with recordings.open(path) as log:
        return [(text.time // 1000 - START, text.level, text.text) for text in log.texts]


def run_log(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "msggen", "log", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def notes_of(path: str | Path) -> list[str]:
    with recordings.open(path) as log:
        assert all(text.text for text in log.texts)
        assert log.problems == []
        return list(log.event_notes)


def test_events_are_texts_as_pyulog_has_them(tmp_path: Path) -> None:
    path = write_events(tmp_path / "a.ulg")
    assert texts_of(path) == TEXTS
    expected = [
        (int(time) - START, level.lower(), text) for time, level, text in PX4Events().get_logged_events(ULog(path))
    ]
    unknown = (90, "info", f"[Unknown event with ID {0x01000ABC}]")
    assert expected == [each for each in TEXTS[:-1] if "[commander]" not in each[2]] + [unknown]
    assert notes_of(path) == [UNKNOWN]


def test_an_event_has_all_that_metadata_tells(tmp_path: Path) -> None:
    with recordings.open(write_events(tmp_path / "a.ulg")) as log:
        _, armed, climb, *_, protocol, calibration, unknown = log.events
    assert (armed.level, armed.external_level, armed.arguments) == ("error", "notice", {"reason": -1})
    assert (climb.name, climb.group, climb.sequence) == ("climb", "default", 2)
    assert climb.description == "See MIS_ALT in the \\<list\\>. 80.00 m/s"
    assert climb.arguments == {"altitude": 2.25, "throttle": 80}
    assert (protocol.level, protocol.is_text) == ("protocol", False)
    assert (calibration.group, calibration.text, calibration.is_text) == ("calibration", "Done", False)
    assert (unknown.name, unknown.group, unknown.arguments, unknown.number) == ("", "", {}, 0x01000ABC)


def test_a_line_without_an_event_near_it_is_kept(tmp_path: Path) -> None:
    log = EventLog(packed())
    log.event(5, 0)
    log.text(6, START + 1_000_000, "near\t")
    log.text(6, START + 1_000_001, "lost\t")
    assert [text for _, _, text in texts_of(log.write(tmp_path / "a.ulg"))] == [TEXTS[7][2], "lost"]


def test_events_of_one_time_stay_in_the_order_of_the_file(tmp_path: Path) -> None:
    log = EventLog(packed())
    for number, arguments in ((5, b""), (1, b"\x02"), (1, b"\x03"), (1, b"\x04")):
        log.event(number, 0, arguments)
    texts = [text for _, _, text in texts_of(log.write(tmp_path / "a.ulg"))]
    assert texts == [TEXTS[7][2], "Armed by stick gesture", "Armed by", "Armed by remote"]


def test_tables_have_events_of_all_groups(tmp_path: Path) -> None:
    with recordings.open(write_events(tmp_path / "a.ulg")) as log:
        assert convert(log, str(tmp_path / "tables"), format="parquet").notes == [UNKNOWN]
    texts = read_table(tmp_path / "tables" / "ulog_texts.parquet").to_pylist()
    assert [(row["timestamp"] - START, row["level"], row["text"]) for row in texts] == TEXTS
    rows = read_table(tmp_path / "tables" / "ulog_events.parquet").to_pylist()
    assert [row["sequence"] for row in rows] == list(range(10))
    assert rows[2] == {
        "timestamp": START + 20,
        "log_time": None,
        "id": 0x01000002,
        "sequence": 2,
        "level": "warning",
        "external_level": "notice",
        "text": TEXTS[3][2],
        "name": "climb",
        "group": "default",
        "description": "See MIS_ALT in the \\<list\\>. 80.00 m/s",
        "arguments": '{"altitude": 2.25, "throttle": 80}',
    }
    assert [rows[-1][name] for name in ("text", "name", "group", "arguments")] == ["event 0x01000abc", *[None] * 3]


def test_an_mcap_file_made_of_a_ulog_has_the_same_events(tmp_path: Path) -> None:
    with recordings.open(write_events(tmp_path / "a.ulg")) as log:
        assert UNKNOWN in convert(log, str(tmp_path / "a.mcap"), format="mcap").notes
        with recordings.open(tmp_path / "a.mcap") as copy:
            assert (copy.events, copy.texts) == (log.events, log.texts)
            assert sorted(copy["/rosout"]["msg"].tolist()) == sorted(text for _, _, text in TEXTS)
            assert len(copy["/fmu/out/event"]) == len(log.events)
            convert(copy, str(tmp_path / "part.mcap"), format="mcap", topics=["/rosout"])
    lines = [(3, "info", "Armed by stick gesture"), TEXTS[1]]
    assert texts_of(tmp_path / "part.mcap") == lines


def test_other_readers_find_decoded_events(tmp_path: Path) -> None:
    with recordings.open(write_events(tmp_path / "a.ulg")) as log:
        events = log.events
        convert(log, str(tmp_path / "a.mcap"), format="mcap")
    found = [each.ros_msg for each in read_ros2_messages(tmp_path / "a.mcap", topics=["/events"])]
    names = ("sequence", "level", "external_level", "text", "name", "group", "description")
    assert [tuple(getattr(each, name) for name in ("id", *names)) for each in found] == [
        tuple(getattr(each, name) for name in ("number", *names)) for each in events
    ]
    assert [json.loads(each.arguments or "{}") for each in found] == [each.arguments for each in events]
    assert [(each.stamp.sec, each.stamp.nanosec) for each in found] == [divmod(each.time, 10**9) for each in events]
    with AnyReader([tmp_path / "a.mcap"]) as bag:
        (connection,) = (each for each in bag.connections if each.topic == "/events")
        payloads = [data for _, _, data in bag.messages([connection])]
        read: list[Any] = [bag.deserialize(data, connection.msgtype) for data in payloads]
    assert [each.text for each in read] == [each.text for each in events]


def test_a_recording_with_decoded_events_alone_has_them(tmp_path: Path) -> None:
    """And a table of them, unless the samples of PX4 are there too."""
    with recordings.open(write_events(tmp_path / "a.ulg")) as log:
        convert(log, str(tmp_path / "a.mcap"), format="mcap")
        events = log.events
    with recordings.open(tmp_path / "a.mcap") as log:
        convert(log, str(tmp_path / "part.mcap"), format="mcap", topics=["/events"])
        tables = convert(log, str(tmp_path / "tables"), format="parquet").files
        chosen = convert(log, str(tmp_path / "chosen"), format="parquet", topics=["/events"]).files
    assert [Path(path).name for path in tables if "events" in path] == ["ulog_events.parquet"]
    assert [Path(path).name for path in chosen] == ["events.parquet"]
    with recordings.open(tmp_path / "part.mcap") as log:
        assert (log.events, log.event_notes) == (events, [])
        assert [text.text for text in log.texts] == [text for _, _, text in TEXTS]
        tables = convert(log, str(tmp_path / "part"), format="parquet").files
    assert {"events.parquet", "ulog_events.parquet"} <= {Path(path).name for path in tables}


def test_events_of_several_vehicles_are_those_that_were_decoded(tmp_path: Path) -> None:
    """A file of several vehicles has no metadata of events."""
    paths = [write_events(tmp_path / name) for name in ("a.ulg", "b.ulg")]
    with recordings.open(paths[0]) as first, recordings.open(paths[1]) as second:
        for log in (first, second):
            vars(log)["utc_offset"] = 10**18
        join([first, second], str(tmp_path / "both.mcap"))
        expected = [each._replace(time=each.time + 10**18) for each in first.events for _ in range(2)]
    with recordings.open(tmp_path / "both.mcap") as log:
        assert not log.has_facts
        assert log.events == expected
        tables = convert(log, str(tmp_path / "tables"), format="parquet").files
    assert {"event.parquet", "events.parquet"} <= {Path(path).name for path in tables}


def test_the_texts_of_a_flight_are_those_of_pyulog(tmp_path: Path) -> None:
    """As its program `ulog_messages` prints them, except for the order of those of one time."""
    path = tmp_path / "flight.ulg"
    path.write_bytes(lzma.decompress(shared("oracles/flight/flight.ulg.xz").read_bytes()))
    log = ULog(str(path), ["event"])
    events = PX4Events().get_logged_events(log)
    lines = [(each.timestamp, each.log_level_str(), each.message) for each in log.logged_messages]
    expected = sorted([*events, *(each for each in lines if not each[2].endswith("\t"))])
    with recordings.open(path) as opened:
        texts = [(text.time // 1000, text.level.upper(), text.text) for text in opened.texts]
        assert sorted(texts) == expected
        assert [time for time, _, _ in texts] == [time for time, _, _ in expected]
        convert(opened, str(tmp_path / "a.mcap"), format="mcap")
        shift = opened.utc_offset or 0
        with recordings.open(tmp_path / "a.mcap") as copy:
            assert copy.events == [each._replace(time=each.time + shift) for each in opened.events]
            assert list(decoded_events(copy.samples("/events"))) == copy.events


def test_the_commands_show_events(tmp_path: Path) -> None:
    path = write_events(tmp_path / "a.ulg")
    shown = run_log("show", path, "--texts", "--json")
    lines = [json.loads(line) for line in shown.stdout.splitlines()]
    assert [(round(each["time"] * 1e6), each["level"], each["text"]) for each in lines] == TEXTS
    assert (shown.returncode, shown.stderr) == (0, f"{path}: {UNKNOWN}\n")
    made = json.loads(run_log("info", path, "--json").stdout)
    assert (made["texts"], made["events"], made["event_notes"]) == (9, 10, [UNKNOWN])


def test_a_plot_marks_events(tmp_path: Path) -> None:
    log = EventLog(packed())
    for time in (0, 1_000_000, 2_000_000):
        log.event(5, time, levels=0x66)
    log.event(1, 1_500_000, b"\x02", levels=0x46)
    log.event(0xABC, 1_600_000)
    with recordings.open(log.write(tmp_path / "a.ulg")) as opened:
        figure = draw(opened, ["event.event_sequence"], stop=1.9)
    (axes,) = figure.axes
    marks = [float(np.asarray(line.get_xdata())[0]) for line in axes.lines if line.get_label() == "_event"]
    assert marks == [0.0, 1.0, 1.5]
    assert [text.get_text() for text in axes.texts] == [TEXTS[7][2], TEXTS[7][2], TEXTS[0][2]]
    assert axes.texts[0].get_color() != axes.texts[2].get_color()


def test_a_plot_with_many_events_marks_warnings(tmp_path: Path) -> None:
    log = EventLog(packed())
    for index in range(20):
        log.event(5, 1000 * index, levels=0x46 if index == 3 else 0x66)
    with recordings.open(log.write(tmp_path / "a.ulg")) as opened:
        figure = draw(opened, ["event.event_sequence"])
    marks = [float(np.asarray(line.get_xdata())[0]) for line in figure.axes[0].lines if line.get_label() == "_event"]
    assert marks == [0.003]


def test_without_metadata_events_have_their_ids(tmp_path: Path) -> None:
    log = EventLog(None)
    log.event(1, 0, levels=0x45)
    log.text(4, START, "kept\t")
    path = log.write(tmp_path / "a.ulg")
    assert texts_of(path) == [(0, "warning", "kept"), (0, "warning", "event 0x01000001")]
    (note,) = notes_of(path)
    assert note.startswith("1 event not decoded: metadata_events is not in the recording; events/all_events.json.xz")


def metadata(**changes: Any) -> bytes:
    """Return metadata with another event 5."""
    event = {"name": "e", "message": "m", **changes}
    group = {"default": {"events": {"5": event}}}
    return packed({"components": {"1": {"namespace": "px4", "event_groups": group}}})


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (lambda: b"", "cannot be decompressed: it is cut off"),
        (lambda: b"no xz at all", "cannot be decompressed: Input format not supported by decoder"),
        (lambda: packed()[:-30], "cannot be decompressed: it is cut off"),
        (lambda: packed()[:60] + b"\xff" * 40 + packed()[100:], "cannot be decompressed: Corrupt input data"),
        (lambda: lzma.compress(bytes(6 << 20)), "has more than 4 MiB without its compression"),
        (lambda: lzma.compress(b"[" * 100_000), "is not JSON"),
        (lambda: lzma.compress(b"\xff\xfe"), "is not JSON"),
        (lambda: lzma.compress(b'{"components": ' + b"9" * 10_000 + b"}"), "is not JSON"),
        (lambda: packed([]), "has no components"),
        (lambda: packed({"components": {"x": 1}, "version": None}), "does not have them: 0x01000005"),
        (
            lambda: packed({"components": {"1": {"event_groups": {"default": [1]}, "enums": {"a": 2}}}}),
            "does not have them",
        ),
        (lambda: packed({"components": {"9" * 400: {"event_groups": 3}, "-1": {}, "": {}}}), "does not have them"),
        (lambda: metadata(message=1), "does not have them"),
        (lambda: metadata(arguments=1), "does not have them"),
        (lambda: metadata(arguments=[1]), "does not have them"),
        (lambda: metadata(arguments=[{"type": "px4::none"}]), "does not have them"),
        (lambda: metadata(arguments=[{"type": "uint8_t"}] * 26), "has arguments that they do not have: 0x01000005"),
        (lambda: metadata(arguments=[{"type": "uint64_t"}] * 100_000), "has arguments that they do not have"),
    ],
)
def test_metadata_that_cannot_be_read_is_a_note(tmp_path: Path, content: Callable[[], bytes], reason: str) -> None:
    """The content is made when the test runs, not where tests are collected."""
    log = EventLog(content())
    log.event(5, 0)
    path = log.write(tmp_path / "a.ulg")
    assert texts_of(path) == [(0, "info", "event 0x01000005")]
    (note,) = notes_of(path)
    assert note.startswith("1 event not decoded: metadata_events ")
    assert reason in note


def test_metadata_of_text_is_a_note(tmp_path: Path) -> None:
    log = EventLog(None)
    log.part("char[3] metadata_events", b"abc", continues=False)
    log.event(5, 0)
    assert notes_of(log.write(tmp_path / "a.ulg")) == ["1 event not decoded: metadata_events is not bytes"]


def test_a_python_without_lzma_shows_ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_events(tmp_path / "a.ulg")
    monkeypatch.setitem(sys.modules, "lzma", None)
    (note,) = notes_of(path)
    assert note == "10 events not decoded: metadata_events cannot be decompressed: this Python was built without lzma"


def test_too_many_events_are_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_events, "_MOST", 3)
    path = write_events(tmp_path / "a.ulg")
    assert notes_of(path) == ["7 events left out: a recording has up to 3"]
    with recordings.open(path) as log:
        assert [event.sequence for event in log.events] == [0, 1, 2]


def test_a_topic_with_other_fields_has_no_events(tmp_path: Path) -> None:
    log = EventLog(packed())
    log.data = log.data.replace(b"uint32_t id;", b"float[1] id;")
    log.event(5, 0)
    path = log.write(tmp_path / "a.ulg")
    assert (texts_of(path), notes_of(path)) == ([], [])


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("{1} {2} {3}", "7 0.5 on"),
        ("{1:.2} {2:.0} {3:.2}", "7.00 0 on"),
        ("{1m^2} {2m_v} {1:C}", "7 m^2 0.5 m 7 C"),
        ("{0} {4} {99999} {} {1:x} {-1}", "{0} {4} {99999} {} {1:x} {-1}"),
        ("\\{1} \\\\ \\<param>", "{1} \\ <param>"),
        ("<param>A_{1}</param> {1}", "A_{1} 7"),
        ('<a>u</a> <a href="v">w</a> <b>x</b>y', "u w y"),
        ('<profile name="!dev">a</profile><profile name="!normal">{1}</profile><profile>b</profile>', "7"),
        ("<param>open <x <1>", "<param>open <x <1>"),
        ("end\\", "end"),
        ("", ""),
    ],
)
def test_templates(template: str, text: str) -> None:
    assert fill(parse_template(template), (7, 0.5, "on")) == text


@pytest.mark.parametrize("unit", ["<a>", '<profile name="dev">', "{1}", "\\", "{1:.99}", "<", "{"])
def test_long_templates_are_cut(unit: str) -> None:
    template = unit * 100_000
    assert len(fill(parse_template(template), ["x" * LONGEST])) <= LONGEST
    content = metadata(message=template, arguments=[{"type": "float"}], name="\ud800")
    (definition,) = event_metadata.read_definitions(content, {0x01000005}).values()
    text, _ = definition.texts(definition.values(struct.pack("<f", 3e38)) or ())
    assert len(text) <= LONGEST
    assert definition.name == "?"


def test_numbers_of_other_events_are_not_read() -> None:
    assert event_metadata.read_definitions(packed(METADATA), {0x01000001, 0x02000001}).keys() == {0x01000001}
