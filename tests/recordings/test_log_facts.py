"""Tests of what a ULog has beside its topics, read back from MCAP files that were made of it."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from msggen import recordings
from msggen.cli import main
from msggen.exports.convert import convert, join
from msggen.exports.convert.facts import between, joined, shifted
from msggen.exports.convert.selection import Selection
from msggen.exports.fleet.layout import date_of, vehicle_of
from msggen.recordings.files.mcap.metadata import LENT, facts_of, notes_of, records_of
from msggen.recordings.source.facts import LEVELS, NO_FACTS, Dropout, Facts, Text
from support.databases import Stored, write_database
from support.examples import examples
from support.flights import same_columns, write_flight
from support.ulog import UTC, UlogWriter

ATTITUDE = "uint64_t timestamp;float[4] q"
GPS = "uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;uint8_t[7] _padding0"
START = 1_000_000
"""The time in us in the header."""

# facts as metadata

numbers = st.integers(-(1 << 63), (1 << 64) - 1) | st.floats() | st.booleans()
times = st.integers(0, (1 << 63) - 1)
values = st.text() | numbers | st.binary() | st.lists(numbers).map(tuple)
parts = st.lists(st.lists(values, min_size=1), min_size=1)
parameters = st.dictionaries(st.text(), numbers)
texts = st.builds(
    Text, times, st.sampled_from([*LEVELS, "unknown"]), st.text(), st.none() | st.integers(0, 65535), st.booleans()
)
facts = st.builds(
    Facts,
    parameters=parameters,
    changed_parameters=st.lists(st.tuples(times, st.text(), numbers), max_size=20),
    default_parameters=parameters,
    airframe_defaults=parameters,
    information=st.dictionaries(st.text(), values | parts),
    texts=st.lists(texts, max_size=20),
    dropouts=st.lists(st.builds(Dropout, times, times), max_size=20),
    start=st.none() | times,
    boot=st.none() | times,
)


@settings(max_examples=examples(100, by_day=12))
@given(facts)
def test_facts_are_the_same_as_metadata(given: Facts) -> None:
    records = {name: [values] for name, values in records_of(given)}
    assert all(isinstance(each, str) for (record,) in records.values() for pair in record.items() for each in pair)
    found = facts_of(records, pytest.fail)
    assert repr(found) == repr(given)  # NaN is not equal to itself


def test_values_are_easy_to_read() -> None:
    information = {"sys_name": "PX4", "ver_hw": "0", "ver": 16, "raw": b"\1\xff", "perf": [["one", "two"], ["three"]]}
    given = Facts({"MC_P": 6.5}, [(5, "MC_P", 7.5)], {}, information, [Text(7, "info", "café")], [], 3)
    assert dict(records_of(given)) == {
        "ulog.information": {
            "sys_name": "PX4",
            "ver_hw": '"0"',
            "ver": "16",
            "raw": '{"hex": "01ff"}',
            "perf": '[["one", "two"], ["three"]]',
        },
        "ulog.parameters": {"MC_P": "6.5"},
        "ulog.changed_parameters": {"0": '{"time": 5, "name": "MC_P", "value": 7.5}'},
        "ulog.texts": {"0": '{"time": 7, "level": "info", "text": "café", "tag": null}'},
        "ulog.time": {"start": "3", "boot": "null"},
    }


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("ulog.parameters", "six"),
        ("ulog.parameters", "[1]"),
        ("ulog.parameters", "1" * 5000),
        ("ulog.parameters", str(1 << 64)),
        ("ulog.default_parameters", "null"),
        ("ulog.information", "null"),
        ("ulog.information", '"\\ud800"'),
        ("ulog.information", '{"hex": "0"}'),
        ("ulog.information", '{"base64": ""}'),
        ("ulog.information", '[["one"], "two"]'),
        ("ulog.information", '[[{"hex": 5}]]'),
        ("ulog.changed_parameters", '{"time": 5, "name": "MC_P"}'),
        ("ulog.changed_parameters", "2026-11-22"),
        ("ulog.texts", '{"time": -1, "level": "info", "text": "x", "tag": null}'),
        ("ulog.texts", '{"time": 1, "level": "loud", "text": "x", "tag": null}'),
        ("ulog.texts", '{"time": 1, "level": "info", "text": "x", "tap": 5}'),
        ("ulog.dropouts", "[5, 6]"),
        ("ulog.dropouts", '{"time": 1, "duration": 1e300}'),
        ("ulog.time", "12.5"),
        ("ulog.time", str(1 << 63)),
    ],
)
def test_values_that_cannot_be_read_are_told(name: str, text: str) -> None:
    problems: list[str] = []
    facts_of({name: [{"start": text}]}, problems.append)
    assert problems == [f"the metadata record '{name}' has values that cannot be read: 'start'"]


def test_records_of_several_recordings_are_told() -> None:
    problems: list[str] = []
    records = [{"MC_P": "6.5"}, {"MC_P": "6.5"}]
    assert facts_of({"ulog.parameters": records}, pytest.fail).parameters == {"MC_P": 6.5}
    found = facts_of({"ulog.parameters": [*records, {}], "ulog.information": [{"sys_name": "PX4"}]}, problems.append)
    assert (found.parameters, found.information) == ({}, {"sys_name": "PX4"})
    assert problems == ["there are 3 different metadata records 'ulog.parameters', and none of them is used"]


def test_any_keys_are_read() -> None:
    values = {
        key: f'{{"time": {number}, "duration": 1}}' for number, key in enumerate(["9" * 5000, "", "x", "10", "2"])
    }
    assert len(facts_of({"ulog.dropouts": [values]}, pytest.fail).dropouts) == 5


def test_notes_are_no_facts() -> None:
    records = {LENT: [{"notes": "one\ntwo"}, {"notes": "two\nthree"}, {}]}
    assert facts_of(records, pytest.fail) is NO_FACTS
    assert notes_of(records) == ["one", "two", "three"]


# recordings


def write_ulog(
    path: Path, *, is_timed: bool = True, vehicle: str = "0042", begin: int = START, gain: float = 6.5
) -> Path:
    """Write 4 s of two topics, of which some samples are older than the start."""
    chance = Random(begin)  # noqa: S311 - no secret
    writer = UlogWriter(start=begin)
    writer.format("vehicle_attitude", ATTITUDE)
    writer.format("sensor_gps", GPS)
    for key, value in {"sys_name": b"PX4", "ver_hw": b"5", "ver_sw": b"abc123", "sys_uuid": vehicle.encode()}.items():
        writer.information(f"char[{len(value)}] {key}", value)
    writer.information("uint32_t ver_sw_release", struct.pack("<I", 0x011100FF))
    writer.information("float[2] pair", struct.pack("<2f", 0.1, float("inf")))
    writer.information("uint8_t[2] raw", b"\1\xff")
    writer.part("char[3] perf", b"one", continues=False)
    writer.part("char[3] perf", b"two", continues=True)
    writer.parameter("MC_P", gain)
    writer.parameter("SYS_AUTOSTART", 4001)
    writer.parameter("MC_P", 5.5, default=3)
    writer.subscribe(0, "vehicle_attitude")
    writer.subscribe(1, "sensor_gps")
    for index, time in enumerate([0, begin - 500_000, *range(begin - 20_000, begin + 4_000_000, 20_000)]):
        writer.sample(0, struct.pack("<Q4f", time, *(chance.random() for _ in range(4))))
        if index % 10 == 9:
            writer.sample(1, struct.pack("<QQB", time, UTC + time if is_timed else 0, 3))
        if index % 50 == 20:
            writer.text(index // 50 + 2, time, f"text {index}", tag=index if index > 100 else None)
            writer.text(6, time + 1, "5")
            writer.parameter("MC_P", gain + index)
            writer.parameter("MC_P", gain + index + 1)
            writer.dropout(index)
            writer.dropout(index)
    return Path(writer.write(path))


def mcap_of(path: Path, **options: Any) -> Path:
    """Convert a recording to MCAP, and return the path."""
    target = path.with_name(f"{path.stem}.of.mcap")
    with recordings.open(path) as log:
        convert(log, str(target), format="mcap", **options)
    return target


def told(log: recordings.Log) -> tuple[object, ...]:
    """Return what a recording tells, with times since its start."""
    since = shifted(log.facts, -log.start)._replace(boot=None)
    origin = log.vehicle, log.firmware, None if log.utc_offset is None else log.start + log.utc_offset
    return log.duration, origin, repr(since), log.problems


@pytest.mark.parametrize("is_timed", [True, False])
def test_an_mcap_file_tells_what_its_ulog_told(tmp_path: Path, *, is_timed: bool) -> None:
    path = write_ulog(tmp_path / "flight.ulg", is_timed=is_timed)
    with recordings.open(path) as log, recordings.open(mcap_of(path)) as copy:
        assert (log.vehicle, log.firmware.release, len(log.texts), len(log.dropouts)) == ("0042", "v1.17.0", 8, 8)
        assert log.start == START * 1000
        assert copy.has_facts
        assert told(copy) == told(log)
        assert copy.release() == log.release()
        dated = date_of(log, "x"), vehicle_of(log)
        assert (date_of(copy, "x"), vehicle_of(copy)) == dated
        assert dated == ((("2026-09-21", "gps") if is_timed else ("unknown", "unknown")), "px4-0042")
        assert copy.facts.boot == log.utc_offset == (UTC * 1000 if is_timed else None)
        with recordings.open(mcap_of(Path(copy.path))) as again:
            assert (again.facts, told(again)) == (copy.facts, told(copy))


@pytest.mark.parametrize("format_", ["mcap", "rosbag2"])
def test_start_and_stop_mean_the_same_times(tmp_path: Path, format_: str) -> None:
    path = write_ulog(tmp_path / "flight.ulg")
    chance = Random(2)  # noqa: S311 - no secret
    with recordings.open(path) as log:
        convert(log, str(tmp_path / "copy"), format=format_)
        with recordings.open(tmp_path / "copy") as copy:
            for start, stop in [(None, 2.0), (0.0, None), (0.0, 0.5), *(sorted(chance.choices(range(5), k=2)),) * 5]:
                if start is not None and start == stop:
                    continue
                for topic in ("vehicle_attitude", "sensor_gps"):
                    ours = log.samples(topic, start=start, stop=stop).columns()
                    theirs = copy.samples(topic, start=start, stop=stop).columns()
                    assert list(ours) == list(theirs)
                    assert all(values.tobytes() == theirs[name].tobytes() for name, values in ours.items())
            assert copy.topic("vehicle_attitude").first < copy.start


def test_a_cut_of_either_is_the_same(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "flight.ulg")
    selection = Selection(None, 1.0, 3.0, None)
    with recordings.open(path) as log, recordings.open(mcap_of(path)) as copy:
        join([log], str(tmp_path / "a.mcap"), selection)
        join([copy], str(tmp_path / "b.mcap"), selection)
        first, changes = log.start, log.facts.changed_parameters
    with recordings.open(tmp_path / "a.mcap") as one, recordings.open(tmp_path / "b.mcap") as other:
        assert one.facts == other.facts
        assert told(one) == told(other)
        same_columns(one, other)
        # as the parameters were then, and with what happened in this time
        before = [value for time, _, value in changes if time < first + 1e9]
        assert one.parameters == {"MC_P": before[-1], "SYS_AUTOSTART": 4001}
        assert 0 < len(one.texts) < 8
        assert [each.text for each in one.texts] == one["/rosout"]["msg"].tolist()
        times = [each.time for each in one.texts] + [each.time for each in one.dropouts]
        assert all(0 <= time - one.start < 2e9 for time in times)
        assert one.start == first + UTC * 1000 + 10**9


def test_parts_of_a_flight_are_the_flight_again(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "flight.ulg")
    with recordings.open(path) as log:
        for number, (start, stop) in enumerate([(None, 1.0), (1.0, 2.5), (2.5, None)]):
            join([log], str(tmp_path / f"{number}.mcap"), Selection(None, start, stop, None))
        whole, expected = log.facts, told(log)
    logs = [recordings.open(tmp_path / f"{number}.mcap") for number in (2, 0, 1)]
    assert join(logs, str(tmp_path / "joined.mcap")).notes == []
    with recordings.open(tmp_path / "joined.mcap") as log:
        assert told(log) == expected
        assert log.facts == shifted(whole, UTC * 1000)._replace(boot=UTC * 1000)


def test_two_flights_of_a_vehicle_are_joined(tmp_path: Path) -> None:
    paths = [
        write_ulog(tmp_path / "a.ulg", begin=60_000_000, gain=2.5),
        write_ulog(tmp_path / "b.ulg", begin=5_000_000),
    ]
    logs = [recordings.open(path) for path in paths]
    (note,) = join(logs, str(tmp_path / "joined.mcap")).notes
    assert note.startswith("programs with px4_msgs misread 2 topics in uORB's order")  # each is named once
    assert note.endswith(": vehicle_attitude, sensor_gps")
    with recordings.open(tmp_path / "joined.mcap") as log:
        assert (log.vehicle, log.firmware.release) == ("0042", "v1.17.0")
        assert (len(log.texts), len(log.dropouts)) == (16, 16)
        assert log.parameters["MC_P"] == 6.5
        at_start = [value for time, _, value in log.facts.changed_parameters if time == (UTC + 60_000_000) * 1000]
        assert at_start == [2.5]
        assert log.start == (UTC + 5_000_000) * 1000


@pytest.mark.parametrize("vehicles", [("0042", "0043"), ("", "")])
def test_flights_of_several_vehicles_tell_nothing_and_a_note_does(
    tmp_path: Path, vehicles: tuple[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, vehicle in zip("ab", vehicles, strict=True):
        write_ulog(tmp_path / f"{name}.ulg", vehicle=vehicle)
    assert main(["log", "merge", "a.ulg", "b.ulg"]) == 0
    assert "are not written: the recordings are of several vehicles" in capsys.readouterr().err
    with recordings.open("merged.mcap") as log:
        assert not log.has_facts
        assert (log.vehicle, dict(log.parameters), log.problems) == ("", {}, [])


def test_a_ulog_gives_its_facts_to_a_recording_of_ros(px4_types: Any, tmp_path: Path) -> None:
    bag = write_flight(tmp_path / "bag.mcap", px4_types, 100, start=(UTC + START + 500_000) * 1000)
    with recordings.open(write_ulog(tmp_path / "a.ulg")) as log, recordings.open(bag) as other:
        assert not other.has_facts
        notes = join([other, log], str(tmp_path / "joined.mcap")).notes
        assert not any("are not written" in note for note in notes)
        with recordings.open(tmp_path / "joined.mcap") as both:
            assert both.facts == shifted(log.facts, UTC * 1000)._replace(boot=UTC * 1000)


def test_the_order_of_joined_recordings_does_not_count() -> None:
    """Parameters by a slow reference: what a vehicle has at a time."""
    chance = Random(3)  # noqa: S311 - no secret
    names = "abc"
    history: list[tuple[int, str, int | float]] = [
        (time, chance.choice(names), chance.randrange(3)) for time in range(1, 300)
    ]
    whole = NO_FACTS._replace(
        parameters=dict.fromkeys(names, 0),
        changed_parameters=history,
        information={"sys_uuid": "0042"},
        texts=[],
        dropouts=[],
    )
    pieces = [(low, between(whole, low, low + 60)) for low in range(0, 300, 60)]
    chance.shuffle(pieces)
    assert joined(pieces) == whole


# damage


def test_a_file_that_is_cut_off_keeps_its_facts(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "flight.ulg")
    data = mcap_of(path).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:-1000])  # without its index
    with recordings.open(tmp_path / "cut.mcap") as cut:
        join([cut], str(tmp_path / "repaired.mcap"))
    with recordings.open(path) as log, recordings.open(tmp_path / "repaired.mcap") as repaired:
        assert told(repaired) == told(log)


@pytest.mark.parametrize("seed", range(3))
def test_damaged_metadata_is_told_or_is_another_value(tmp_path: Path, seed: int) -> None:
    """Whatever the facts are, the samples are read as before."""
    chance = Random(seed)  # noqa: S311 - no secret
    data = mcap_of(write_ulog(tmp_path / "flight.ulg")).read_bytes()
    low, high = data.index(b"ulog.information") - 13, data.index(b"ulog.time") + 60
    with recordings.open(tmp_path / "flight.of.mcap") as log:
        count = len(log["vehicle_attitude"])
    for _ in range(70):
        changed = bytearray(data)
        for _ in range(chance.choice([1, 5])):
            changed[chance.randrange(low, high)] = chance.choice([0, 1, 0xFF, *b'"{[0', chance.randrange(256)])
        (tmp_path / "damaged.mcap").write_bytes(changed)
        with recordings.open(tmp_path / "damaged.mcap") as log:
            assert len(log["vehicle_attitude"]) == count or log.problems
            assert not any("\n" in each.text for each in log.problems)
            for each in (log.facts, log.vehicle, log.firmware, log.start, log.utc_offset, log.notes, log.release()):
                str(each)


@pytest.mark.parametrize("is_indexed", [True, False])
def test_large_and_broken_records_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_indexed: bool
) -> None:
    monkeypatch.setattr("msggen.recordings.files.mcap.channels._LARGEST_METADATA", 1000)
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_metadata("ulog.parameters", {"A": "1"})
        writer.add_metadata("ulog.information", {"A": "1" * 1000})
        writer.add_metadata("ulog.texts", {"broken": "1"})
        writer.add_metadata("ulog.texts.of.others", {"A": "1"})
        writer.add_metadata("others", {"A": "1" * 1000})
        channel = writer.register_channel("/x", "cdr", writer.register_schema("x/msg/X", "ros2msg", b"int8 x"))
        writer.add_message(channel, 5, b"\0\1\0\0\0", 5)
        writer.finish()
    data = path.read_bytes()
    place = data.index(b"\x06\0\0\0broken")
    data = data[:place] + b"\x60" + data[place + 1 :]
    path.write_bytes(data if is_indexed else data[:-30])
    with recordings.open(path) as log:
        assert log.facts == NO_FACTS._replace(parameters={"A": 1}, changed_parameters=[], texts=[], dropouts=[])
        assert [(each.text, each.offset) for each in log.problems][:2] == [
            ("a metadata record has more than 1000 bytes, and is not read", data.index(b"ulog.information") - 13),
            ("a metadata record cannot be read", data.index(b"ulog.texts") - 13),
        ]


# definitions


def test_definitions_from_elsewhere_stay_such(px4_types: Any, tmp_path: Path) -> None:
    """Also in a copy of a copy, and beside definitions that were recorded."""
    infos = [px4_types.VehicleStatus.__msg__, px4_types.SensorGps.__msg__]
    topics = [
        Stored(1, "/fmu/out/vehicle_status_v4", infos[0].ros_type),
        Stored(2, "/fmu/out/sensor_gps", infos[1].ros_type, definition=infos[1].definition),
    ]
    rows = [
        (1 + number % 2, UTC * 1000 + number, b"\0\1\0\0" + bytes(infos[number % 2].cdr_size)) for number in range(9)
    ]
    path: Path = write_database(tmp_path / "flight.db3", topics, rows)
    with recordings.open(path) as log:
        notes = log.notes
        assert len(notes) == 1
    for _ in range(2):
        path = mcap_of(path)
        with recordings.open(path) as log:
            assert (log.notes, log.problems) == (notes, [])
            assert {topic.uorb: topic.is_lent for topic in log.topics} == {"vehicle_status": True, "sensor_gps": False}
            assert log.topic("vehicle_status").recorded_definition == ""
            assert len(log["vehicle_status"]) == 5
            assert "1 definition" in str(log.release())
            cut = convert(log, str(tmp_path / f"{path.stem}.gps.mcap"), format="mcap", topics=["sensor_gps"])
            assert cut.notes == []
            assert recordings.open(cut.files[0]).notes == []


# commands


def test_commands_show_the_same_of_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    mcap_of(write_ulog(tmp_path / "flight.ulg"))

    def printed(*words: str) -> list[str]:
        assert main(["log", *words]) == 0
        return capsys.readouterr().out.splitlines()

    def front(path: str) -> list[str]:
        kept = ("start ", "duration", "vehicle ", "firmware", "parameters", "texts", "dropouts")
        return [line for line in printed("info", path) if line.startswith(kept)]

    assert len(front("flight.ulg")) == 7
    assert front("flight.of.mcap") == front("flight.ulg")
    for option in ("--params", "--texts"):
        lines = printed("show", "flight.ulg", option)
        assert printed("show", "flight.of.mcap", option) == lines
        assert len(lines) > 5
