"""Tests of ULogs as MCAP: the same columns, in definitions that other readers decode."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pyarrow.parquet import read_table
from rosbags.highlevel import AnyReader

from msggen import recordings
from msggen.exports.convert import convert, join
from msggen.exports.convert.names import EVENTS, FACT_TABLES
from msggen.recordings import RecordingError
from support.flights import write_flight
from support.ulog import COUNT, TOPICS, UTC, UlogWriter, write_ulog

MISREAD = "programs with px4_msgs misread {} in uORB's order of fields, because no embedded release has these fields"


@pytest.fixture
def ulog(tmp_path: Path) -> Path:
    return write_ulog(tmp_path / "flight.ulg")


def test_the_columns_stay_the_same(ulog: Path, tmp_path: Path) -> None:
    with recordings.open(ulog) as log:
        converted = convert(log, str(tmp_path / "flight.mcap"), format="mcap")
        assert converted.rows == COUNT * (len(TOPICS) - 1) + 1
        assert [each.text for each in converted.problems] == ["odd is left out: ROS 2 does not allow its names"]
        with recordings.open(tmp_path / "flight.mcap") as copy:
            for name, instance in TOPICS[:-1]:
                samples = log.samples((name, instance))
                found = copy.samples(f"/fmu/out/{name}" + (f"_{instance}" if instance else ""))
                columns, expected = found.columns(), samples.columns()
                assert columns.keys() == expected.keys()
                assert all(columns[each].tobytes() == values.tobytes() for each, values in expected.items())
                assert (found.log_times == samples.log_times + UTC * 1000).all()


def test_names_in_upper_case_are_written_in_lower_case(tmp_path: Path) -> None:
    writer = UlogWriter(start=1)
    writer.format("system_power", "uint64_t timestamp;float voltage5V_v;uint8_t periph_5V_OC;uint8_t[3] _padding0")
    writer.format("both", "uint64_t timestamp;float X;float x")
    for number, name in enumerate(("system_power", "both")):
        writer.subscribe(number, name)
    writer.sample(0, struct.pack("<QfB", 2, 4.75, 1))
    writer.sample(1, struct.pack("<Qff", 3, 1, 2))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        converted = convert(log, str(tmp_path / "a.mcap"), format="mcap")
        values = list(log.columns("system_power").values())
    assert converted.notes == [
        "system_power: voltage5V_v, periph_5V_OC written in lower case, as ROS 2 needs it",
        f"{MISREAD.format('1 topic')}: system_power",
    ]
    assert [each.text for each in converted.problems] == ["both is left out: ROS 2 does not allow its names"]
    with recordings.open(tmp_path / "a.mcap") as copy:
        columns = copy.columns("system_power")
    assert list(columns) == ["timestamp", "voltage5v_v", "periph_5v_oc"]
    assert list(columns.values()) == values


def test_other_readers_decode_all_samples(ulog: Path, tmp_path: Path) -> None:
    target = tmp_path / "flight.mcap"
    with recordings.open(ulog) as log:
        convert(log, str(target), format="mcap")
        rpm = log.columns("esc_status")["esc[2].esc_rpm"].tolist()
    with target.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        decoded = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()]
    assert len(decoded) == COUNT * (len(TOPICS) - 1) + 1
    assert [message.esc[2].esc_rpm for topic, message in decoded if topic == "/fmu/out/esc_status"] == rpm
    (text,) = [message for topic, message in decoded if topic == "/rosout"]
    assert (text.msg, text.level, text.name, text.stamp.sec) == ("café", 30, "px4", UTC // 10**6 + 2)
    with AnyReader([target]) as bag:
        found = [bag.deserialize(data, connection.msgtype) for connection, _, data in bag.messages()]
    assert len(found) == len(decoded)


def test_everything_else_is_metadata(ulog: Path, tmp_path: Path) -> None:
    target = tmp_path / "flight.mcap"
    with recordings.open(ulog) as log:
        convert(log, str(target), format="mcap")
    with target.open("rb") as file:
        metadata = {each.name: each.metadata for each in make_reader(file).iter_metadata()}
    time = (UTC + 1_000_000 + COUNT // 2 * 10_000 + len(TOPICS) - 1) * 1000
    since = (UTC + 1_000_000 + COUNT // 2 * 10_000) * 1000
    assert metadata == {
        "rosbag2": {"serialized_metadata": ""},
        "ulog.information": {"sys_name": "PX4"},
        "ulog.parameters": {"MC_P": "6.5"},
        "ulog.changed_parameters": {"0": f'{{"time": {time}, "name": "MC_P", "value": 7.5}}'},
        "ulog.texts": {"0": f'{{"time": {since}, "level": "warning", "text": "café", "tag": null}}'},
        "ulog.dropouts": {"0": f'{{"time": {time}, "duration": 12000000}}'},
        "ulog.time": {"start": f"{(UTC + 1_000_000) * 1000}", "boot": f"{UTC * 1000}"},
    }


def test_texts_with_damaged_times_are_kept(ulog: Path, tmp_path: Path) -> None:
    data = ulog.read_bytes()
    place = data.index("café".encode()) - 8
    (tmp_path / "damaged.ulg").write_bytes(data[:place] + b"\xff" * 8 + data[place + 8 :])
    with recordings.open(tmp_path / "damaged.ulg") as log:
        convert(log, str(tmp_path / "flight.mcap"), format="mcap")
    with recordings.open(tmp_path / "flight.mcap") as log:
        assert log["/rosout"]["msg"].tolist() == ["café"]
        assert log["/rosout"]["stamp"]["sec"].tolist() == [2**31 - 1]


@pytest.mark.parametrize("is_timed", [True, False])
def test_tables_have_the_time_in_utc_if_the_ulog_tells_it(tmp_path: Path, *, is_timed: bool) -> None:
    """And the same columns if not, also where they are made of its MCAP file."""
    ulog = write_ulog(tmp_path / "flight.ulg", is_timed=is_timed)
    with recordings.open(ulog) as log:
        converted = convert(log, str(tmp_path / "flight"), format="parquet")
        names = ["actuator_outputs", "esc_status", "odd", "sensor_gps", "sensor_gps_1", "vehicle_gps_position"]
        assert [Path(path).stem for path in converted.files] == sorted({*names, *FACT_TABLES} - {EVENTS})
        table = read_table(tmp_path / "flight" / "sensor_gps_1.parquet")
        timestamp, *others = log.columns(("sensor_gps", 1))
        assert table.column_names == [timestamp, "log_time", "publish_time", *others]
        times = log["sensor_gps", 1]["timestamp"]
        assert table["timestamp"].to_numpy().tolist() == times.tolist()
        assert table["publish_time"].null_count == COUNT
        kind = pa.timestamp("ns", "UTC")
        assert table.schema.field("log_time").type == table.schema.field("publish_time").type == kind
        utc = ((times + UTC) * 1000).tolist() if is_timed else [None] * COUNT
        assert table["log_time"].cast(pa.int64()).to_pylist() == utc
        convert(log, str(tmp_path / "flight.mcap"), format="mcap")
    with recordings.open(tmp_path / "flight.mcap") as copy:
        convert(copy, str(tmp_path / "copy"), format="parquet")
    again = read_table(tmp_path / "copy" / "sensor_gps_1.parquet")
    assert again.schema.equals(table.schema)
    assert again.drop_columns("publish_time") == table.drop_columns("publish_time")


def test_any_times_are_written(tmp_path: Path) -> None:
    """Their differences overflow."""
    writer = UlogWriter(start=1)
    writer.format("wind", "uint64_t timestamp;float x")
    writer.format("odd", "uint64_t timestamp_sample;float timestamp")
    writer.subscribe(0, "wind")
    writer.subscribe(1, "odd")
    times = [0, (1 << 64) - 1, 1, 1 << 63, (1 << 63) - 1]
    for time in times:
        writer.sample(0, struct.pack("<Qf", time, 0.5))
        writer.sample(1, struct.pack("<Qf", time, 0.5))
    with recordings.open(writer.write(tmp_path / "a.ulg")) as log:
        convert(log, str(tmp_path / "tables"), format="parquet")
    found = read_table(tmp_path / "tables" / "wind.parquet")["timestamp"].to_pylist()
    assert sorted(found) == sorted(times)
    assert read_table(tmp_path / "tables" / "odd.parquet")["timestamp"].to_pylist() == [0.5] * len(times)


def test_a_ulog_is_merged_by_its_time_of_day(px4_types: Any, ulog: Path, tmp_path: Path) -> None:
    bag = write_flight(tmp_path / "bag.mcap", px4_types, 100, start=(UTC + 1_500_000) * 1000)
    with recordings.open(ulog) as log, recordings.open(bag) as other:
        join([log, other], str(tmp_path / "joined.mcap"))
        with recordings.open(tmp_path / "joined.mcap") as joined:
            assert joined.duration == pytest.approx(log.duration)
            assert (np.diff([each.first for each in joined.topics]) < 10**9).all()
    untimed = write_ulog(tmp_path / "untimed.ulg", is_timed=False)
    with (
        recordings.open(untimed) as log,
        recordings.open(bag) as other,
        pytest.raises(RecordingError, match="no time of day"),
    ):
        join([log, other], str(tmp_path / "never.mcap"))
    assert not (tmp_path / "never.mcap").exists()
