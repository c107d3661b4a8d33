"""Tests of conversions: whole files or none, equal to the recording when other readers read them."""

from __future__ import annotations

import json
import math
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from msggen import recordings
from msggen.exports.convert import EVERYTHING, FORMATS, TABLE_SUFFIXES, TABLES, Converted, convert, join
from msggen.exports.convert.tables import WRITERS
from msggen.exports.writer import Channel, Writer
from msggen.recordings import Log
from support.flights import TEXTS, TOPICS, same_columns, write_flight
from support.recordings import START, read_mcap
from support.repository import ROOT
from support.tables import read_table
from support.ulog import UTC, write_ulog

COUNT = 300
LATEST = (1 << 62) - 1
"""The latest time of an MCAP file in ns that is not read as an earlier one."""


@pytest.fixture(scope="module")
def flight(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("flight") / "flight.mcap", px4_types, COUNT)


@pytest.fixture
def log(flight: Path) -> Iterator[Log]:
    with recordings.open(flight) as found:
        yield found


def test_a_table_for_each_topic_is_named_as_px4_names_it(log: Log, tmp_path: Path) -> None:
    converted = convert(log, str(tmp_path / "flight"), format="parquet")
    names = sorted([*TOPICS, "texts"])
    assert converted.files == [str(tmp_path / "flight" / f"{name}.parquet") for name in names]
    assert converted.rows == COUNT * len(names)
    assert sorted(os.listdir(tmp_path)) == ["flight"]


def test_each_format_has_a_writer_and_is_on_the_page() -> None:
    assert tuple(WRITERS) == TABLES
    assert {*TABLE_SUFFIXES.values()} == {*TABLES}
    page = (ROOT / "docs/recordings.md").read_text(encoding="utf-8")
    assert not [name for name in (*FORMATS, *(f"wind{each}" for each in TABLE_SUFFIXES)) if f"`{name}`" not in page]


@pytest.mark.parametrize("format_", TABLES)
def test_tables_have_the_columns_of_the_recording(log: Log, tmp_path: Path, format_: str) -> None:
    convert(log, str(tmp_path / "flight"), format=format_)
    for topic in TOPICS:
        samples = log.samples(topic)
        columns = samples.columns()
        table = read_table(str(tmp_path / "flight" / f"{topic}.{format_}"), samples.table().schema)
        assert table.column_names == ["timestamp", "log_time", "publish_time", *list(columns)[1:]]
        assert (table["log_time"].cast(pa.int64()).to_numpy() == samples.log_times).all()
        for name, values in columns.items():
            read = table[name].to_numpy(zero_copy_only=False)
            if format_ == "csv":  # the shortest text of a number, and NaN without its bits
                np.testing.assert_array_equal(read.astype(values.dtype), values)
            else:
                assert read.dtype == values.dtype
                assert read.tobytes() == values.tobytes()


@pytest.mark.parametrize("format_", ["parquet", "arrow"])
def test_text_and_sequences_have_types_of_arrow(log: Log, tmp_path: Path, format_: str) -> None:
    convert(log, str(tmp_path / "flight"), format=format_, topics=["texts"])
    table = read_table(str(tmp_path / "flight" / f"texts.{format_}"))
    point = pa.struct([("x", pa.float32()), ("label", pa.string())])
    assert table.schema.field("name").type == pa.string()
    assert table.schema.field("values").type == pa.list_(pa.float64())
    assert table.schema.field("points").type == pa.list_(point)
    assert table["name"].to_pylist() == [f"name {index} ü" for index in range(COUNT)]
    assert table["values"].to_pylist() == [[index / 2] * (index % 3) for index in range(COUNT)]
    assert table["points"].to_pylist() == [[{"x": 1.5, "label": "label"}] * (index % 2) for index in range(COUNT)]


def test_sequences_are_json_in_csv(log: Log, tmp_path: Path) -> None:
    convert(log, str(tmp_path / "flight"), format="csv", topics=["texts"])
    table = read_table(str(tmp_path / "flight" / "texts.csv"))
    found = [json.loads(text) for text in table["points"].to_pylist()]
    assert found == [[{"x": 1.5, "label": "label"}] * (index % 2) for index in range(COUNT)]


@pytest.mark.parametrize("suffix", [*TABLE_SUFFIXES, ".CSV"])
def test_a_topic_is_a_file_as_it_is_in_a_folder(log: Log, tmp_path: Path, suffix: str) -> None:
    format_ = TABLE_SUFFIXES[suffix.lower()]
    (expected,) = convert(log, str(tmp_path / "flight"), format=format_, topics=["texts"]).files
    target = tmp_path / f"one{suffix}"
    converted = convert(log, str(target), format=format_, topics=["texts"])
    assert (converted.files, converted.rows) == ([str(target)], COUNT)
    assert target.read_bytes() == Path(expected).read_bytes()
    with pytest.raises(recordings.RecordingError, match=r"is a file for one topic, and there are 5: name one of "):
        convert(log, str(tmp_path / f"two{suffix}"), format=format_)
    assert convert(log, str(tmp_path / f"none{suffix}"), format=format_, topics=["texts"], start=1e5).files == []
    other = "csv" if format_ != "csv" else "parquet"
    assert convert(log, str(tmp_path / f"folder{suffix}"), format=other).rows == COUNT * 5
    assert sorted(os.listdir(tmp_path)) == sorted(["flight", f"folder{suffix}", f"one{suffix}"])


@pytest.mark.parametrize("waiting", [1, 5_000, 100_000])
def test_row_groups_do_not_change_what_is_written(
    log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waiting: int
) -> None:
    monkeypatch.setattr("msggen.exports.convert.tables._WAITING", waiting)
    convert(log, str(tmp_path / "flight"), format="parquet")
    for topic in TOPICS:
        table = read_table(str(tmp_path / "flight" / f"{topic}.parquet"))
        assert table["timestamp"].to_numpy().tolist() == log[topic]["timestamp"].tolist()


def test_fields_topics_and_times_are_chosen(log: Log, tmp_path: Path) -> None:
    chosen = {"topics": [*TOPICS], "fields": ["timestamp", "esc[1]", "gyro_rad"], "start": 0.5, "stop": 1.0}
    converted = convert(log, str(tmp_path / "flight"), format="parquet", **chosen)  # type: ignore[arg-type]
    times = slice(50, 100)
    table = read_table(str(tmp_path / "flight" / "esc_status.parquet"))
    assert all(name.startswith("esc[1]") for name in table.column_names[3:])
    assert table["timestamp"].to_numpy().tolist() == log["esc_status"]["timestamp"][times].tolist()
    table = read_table(str(tmp_path / "flight" / "sensor_combined.parquet"))
    assert table.column_names[3:] == ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"]
    assert converted.rows == 50 * len(TOPICS)


def test_names_of_columns_and_topics_that_there_are_not(log: Log, tmp_path: Path) -> None:
    with pytest.raises(recordings.RecordingError, match="did you mean 'gyro_rad"):
        convert(log, str(tmp_path / "flight"), format="parquet", fields=["gyro_rat"])
    with pytest.raises(recordings.RecordingError, match="did you mean"):
        convert(log, str(tmp_path / "flight"), format="parquet", topics=["esc_statsu"])
    with pytest.raises(recordings.RecordingError, match="did you mean"):
        convert(log, str(tmp_path / "flight.mcap"), format="mcap", topics=["esc_statsu"])
    with pytest.raises(recordings.RecordingError, match="fields can be chosen for"):
        convert(log, str(tmp_path / "flight.mcap"), format="mcap", fields=["timestamp"])
    assert os.listdir(tmp_path) == []


def test_mcap_keeps_every_sample_and_its_times(flight: Path, log: Log, tmp_path: Path) -> None:
    target = tmp_path / "copy.mcap"
    converted = convert(log, str(target), format="mcap")
    assert read_mcap(target) == read_mcap(flight)
    assert converted.rows == COUNT * (len(TOPICS) + 2)
    assert [each for each in converted.problems if "no definition" in each.text] == []
    with recordings.open(target) as copy:
        same_columns(log, copy)
    with target.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert [each[2].publish_time for each in reader.iter_messages()] == [
            each.log_time - 500 for *_, each in reader.iter_messages()
        ]
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == converted.rows
        assert {len(index.message_index_offsets) for index in summary.chunk_indexes} == {len(TOPICS) + 2}


@pytest.mark.parametrize("waiting", [1, 10_000, 10_000_000])
def test_samples_are_in_the_order_of_their_times(
    flight: Path, log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waiting: int
) -> None:
    monkeypatch.setattr("msggen.exports.convert.payloads.WAITING", waiting)
    monkeypatch.setattr("msggen.exports.convert.mcap.CHUNK", 3000)
    convert(log, str(tmp_path / "copy.mcap"), format="mcap")
    assert read_mcap(tmp_path / "copy.mcap") == read_mcap(flight)


def test_times_that_only_fit_in_64_bits_without_a_sign(px4_types: Any, tmp_path: Path) -> None:
    info = px4_types.VehicleStatus.__msg__
    writer = Writer(str(tmp_path / "flight.mcap"))
    number = writer.add_channel(Channel("/vehicle_status", info.ros_type, info.definition, ""))
    for time in (START, 2**64 - 1):
        writer.write(number, time, time, px4_types.VehicleStatus().encode())
    writer.close()
    with recordings.open(tmp_path / "flight.mcap") as log:
        converted = convert(log, str(tmp_path / "copy.mcap"), format="mcap")
        assert converted.rows == 2
        assert [problem.text for problem in converted.problems] == [
            f"log times from the year 2116 on are read as {LATEST} ns"
        ]
        convert(log, str(tmp_path / "copy"), format="rosbag2")
    found = {each.time for each in read_mcap(tmp_path / "copy.mcap")}
    assert found == {START, LATEST}


def test_names_of_files_stay_in_the_folder(px4_types: Any, tmp_path: Path) -> None:
    names = ["/../../evil", "/a/../x", "..", "/", "/\nname", "/" + "y" * 400, "/_msggen", "/msggen", "/.."]
    info = px4_types.VehicleStatus.__msg__
    writer = Writer(str(tmp_path / "flight.mcap"))
    for name in names:
        number = writer.add_channel(Channel(name, info.ros_type, info.definition, ""))
        writer.write(number, START, START, px4_types.VehicleStatus().encode())
    writer.close()
    with recordings.open(tmp_path / "flight.mcap") as log:
        files = convert(log, str(tmp_path / "tables"), format="parquet").files
    assert sorted(files) == sorted(str(path) for path in (tmp_path / "tables").iterdir())
    assert len(files) == len(names)
    assert not [name for name in os.listdir(tmp_path / "tables") if name.startswith((".", "_"))]


def test_rosbag2_is_read_by_rosbags(flight: Path, log: Log, tmp_path: Path) -> None:
    converted = convert(log, str(tmp_path / "flight"), format="rosbag2", topics=[*TOPICS, "texts"])
    assert sorted(os.listdir(tmp_path / "flight")) == ["flight_0.mcap", "metadata.yaml"]
    expected = [each for each in read_mcap(flight) if each.topic != "/json"]
    with AnyReader([tmp_path / "flight"]) as bag:
        found = list(bag.messages())
        assert [(connection.topic, time, bytes(data)) for connection, time, data in found] == expected
        for connection, _, data in found:
            bag.deserialize(data, connection.msgtype)
        assert bag.message_count == converted.rows == len(expected)


def test_join_orders_several_recordings(px4_types: Any, tmp_path: Path) -> None:
    paths = [
        write_flight(tmp_path / f"{number}.mcap", px4_types, 100, number, START + number * 300_000_123)
        for number in range(3)
    ]
    logs = [recordings.open(path) for path in paths]
    join(logs, str(tmp_path / "joined.mcap"))
    expected = sorted((each for path in paths for each in read_mcap(path)), key=lambda each: each.time)
    assert read_mcap(tmp_path / "joined.mcap") == expected
    join(logs, str(tmp_path / "cut.mcap"), EVERYTHING._replace(start=0.5, stop=1.2))
    low, high = START + 500_000_000, START + 1_200_000_000
    assert read_mcap(tmp_path / "cut.mcap") == [each for each in expected if low <= each.time < high]


def test_mcap_ros2_decodes_what_is_written(log: Log, tmp_path: Path) -> None:
    convert(log, str(tmp_path / "copy.mcap"), format="mcap", topics=[*TOPICS, "texts"], stop=0.5)
    with (tmp_path / "copy.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()]
    assert len(decoded) == 50 * (len(TOPICS) + 1)
    texts = [message for topic, message in decoded if topic == TEXTS[0]]
    assert texts[3].name == "name 3 ü"


@pytest.mark.parametrize("format_", FORMATS)
def test_there_is_never_a_part_of_a_target(log: Log, tmp_path: Path, format_: str) -> None:
    target = tmp_path / "target"

    def stop(share: float) -> None:
        assert 0 < share <= 1
        assert not target.exists()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert(log, str(target), format=format_, progress=stop)
    assert os.listdir(tmp_path) == []
    shares: list[float] = []
    converted: Converted = convert(log, str(target), format=format_, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert all(Path(path).exists() for path in converted.files)
    with pytest.raises(FileExistsError):
        convert(log, str(target), format=format_)


def write_definitions(path: Path, start: int, definitions: dict[str, tuple[str, bytes]]) -> Path:
    """Write a recording with a sample of each topic. `definitions` has types with definitions and payloads."""
    with open(path, "wb") as file:
        writer = McapWriter(file)
        writer.start()
        for name, (definition, payload) in definitions.items():
            schema = writer.register_schema(f"px4_msgs/msg/{name}", "ros2msg", definition.encode())
            channel = writer.register_channel(f"/fmu/out/{name.lower()}", "cdr", schema)
            writer.add_message(channel, start, b"\0\1\0\0" + payload, start)
        writer.finish()
    return path


def test_definitions_of_two_firmwares_keep_apart(tmp_path: Path) -> None:
    """rosbags knows a definition by the name of its type alone."""
    nests = "uint64 timestamp\nB b\n" + "=" * 80 + "\nMSG: px4_msgs/B\n{} y\n"
    old = {
        "A": ("uint64 timestamp\nfloat32 x\n", struct.pack("<Qf", 1, 1.5)),
        "Same": ("uint64 timestamp # us\n", struct.pack("<Q", 2)),
        "Outer": (nests.format("float32"), struct.pack("<Qf", 3, 2.5)),
    }
    new = {
        "A": ("uint64 timestamp\nuint32 y\n", struct.pack("<QI", 4, 7)),
        "Same": ("uint64 timestamp\n", struct.pack("<Q", 5)),
        "Outer": (nests.format("uint32"), struct.pack("<QI", 6, 8)),
    }
    logs = [
        recordings.open(write_definitions(tmp_path / "old.mcap", START, old)),
        recordings.open(write_definitions(tmp_path / "new.mcap", START + 1, new)),
    ]
    converted = join(logs, str(tmp_path / "both.mcap"))
    assert [note.partition(":")[0] for note in converted.notes] == [
        "/fmu/out/a has the type px4_msgs/msg/A2",
        "/fmu/out/outer has the type px4_msgs/msg/Outer2",
        "/fmu/out/outer nests px4_msgs/B, which has another definition in this file",
    ]
    with AnyReader([tmp_path / "both.mcap"]) as bag:
        found = [
            (each.msgtype, bag.deserialize(data, each.msgtype))
            for each, _, data in bag.messages()
            if "/a" in each.topic
        ]
    assert [(type_, getattr(each, "x", None), getattr(each, "y", None)) for type_, each in found] == [
        ("px4_msgs/msg/A", 1.5, None),
        ("px4_msgs/msg/A2", None, 7),
    ]
    with recordings.open(tmp_path / "both.mcap") as log:
        assert sorted({topic.ros_type for topic in log.topics}) == [
            f"px4_msgs/msg/{name}" for name in ("A", "A2", "Outer", "Outer2", "Same")
        ]


@pytest.mark.parametrize("format_", TABLES)
def test_a_timestamp_can_be_any_field(tmp_path: Path, format_: str) -> None:
    payload = struct.pack("<I4s", 4, b"now\0")
    path = write_definitions(tmp_path / "flight.mcap", START, {"A": ("string timestamp\n", payload)})
    with recordings.open(path) as log:
        (written,) = convert(log, str(tmp_path / "tables"), format=format_).files
        assert log.table("/fmu/out/a")["timestamp"].to_pylist() == ["now"]
    assert read_table(written)["timestamp"].to_pylist() == ["now"]


def test_lists_in_csv_are_json(tmp_path: Path) -> None:
    payload = struct.pack("<I4x4d", 4, math.nan, math.inf, 1.5, -0.0)
    path = write_definitions(tmp_path / "flight.mcap", START, {"A": ("float64[] values\n", payload)})
    with recordings.open(path) as log:
        (written,) = convert(log, str(tmp_path / "tables"), format="csv").files

    def refuse(text: str) -> None:
        pytest.fail(text)

    text = read_table(written, {"values": pa.string()})["values"].to_pylist()[0]
    assert json.loads(text, parse_constant=refuse) == [None, None, 1.5, 0.0]


@pytest.mark.parametrize("format_", FORMATS)
def test_names_of_outputs_can_have_any_bytes(log: Log, tmp_path: Path, format_: str) -> None:
    target = os.path.join(tmp_path, os.fsdecode(b"b\xff\xfe"))
    converted = convert(log, target, format=format_, topics=list(TOPICS))
    assert converted.rows == COUNT * len(TOPICS)
    assert all(os.path.getsize(each) for each in converted.files)


@pytest.mark.parametrize("format_", FORMATS)
def test_any_time_is_a_limit_and_nothing_is_written_without_samples(log: Log, tmp_path: Path, format_: str) -> None:
    assert convert(log, str(tmp_path / "all"), format=format_, topics=list(TOPICS), stop=math.inf).rows > 0
    nothing = convert(log, str(tmp_path / "nothing"), format=format_, topics=list(TOPICS), start=1e6)
    assert (nothing.rows, nothing.files) == (0, [])
    assert os.listdir(tmp_path) == ["all"]


def test_only_one_conversion_at_a_time_writes_a_path(log: Log, tmp_path: Path) -> None:
    target = str(tmp_path / "tables")
    refused = []

    def again(_: float) -> None:
        code = f"""
from msggen import recordings
from msggen.exports.convert import convert
convert(recordings.open({log.path!r}), {target!r}, format="csv")
"""
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        refused.append(done.stderr.splitlines()[-1])

    topics = next(iter(TOPICS))
    converted = convert(log, target, format="csv", topics=[topics], progress=again)
    assert all("another conversion writes to this path" in each for each in refused)
    assert refused
    assert [os.path.basename(each) for each in converted.files] == os.listdir(target) == [f"{topics}.csv"]


def test_recordings_that_begin_after_the_end_are_left_out(px4_types: Any, tmp_path: Path) -> None:
    late = write_ulog(tmp_path / "late.ulg")
    early = write_flight(tmp_path / "early.mcap", px4_types, 100, start=(UTC - 60_000_000) * 1000)
    with recordings.open(early) as one, recordings.open(late) as other:
        converted = join([one, other], str(tmp_path / "both.mcap"), EVERYTHING._replace(stop=2.0))
    assert converted.rows == len(read_mcap(tmp_path / "both.mcap")) == len(read_mcap(early))
