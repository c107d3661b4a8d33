"""Tests of the tables of what a ULog has beside its topics."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from pyarrow.csv import read_csv
from pyarrow.ipc import open_file
from pyarrow.parquet import read_table

from msggen import recordings
from msggen.exports.convert import convert
from msggen.exports.convert.names import FACT_TABLES, file_names, place_of
from msggen.exports.fleet import update
from support.ulog import UTC, UlogWriter

START = 2_000_000
"""The start of the log, and the time of its first sample, in us."""
PARAMETERS = [
    (START, "MC_A", 1.5, 1.0, 0.5),
    (START, "MC_B", 7.0, 7.0, 7.0),  # its defaults are not in the log
    (START + 1_000_000, "MC_A", 1.25, 1.0, 0.5),
]
TEXTS = [(START + 500_000, "warning", "first", None), (START + 1_500_000, "info", "second é", 7)]
DROPOUTS = [(START + 1_000_000, 0.012)]


@pytest.fixture
def ulog(tmp_path: Path) -> Path:
    writer = UlogWriter(start=START)
    writer.parameter("MC_A", 1.5)
    writer.parameter("MC_B", 7)
    writer.parameter("MC_A", 0.5, default=1)
    writer.parameter("MC_A", 1.0, default=2)
    writer.format(
        "vehicle_gps_position", "uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;uint8_t[7] _padding0"
    )
    writer.subscribe(0, "vehicle_gps_position")
    for index in range(3):
        time = START + index * 1_000_000
        writer.sample(0, struct.pack("<QQB", time, UTC + time, 3))
        if index == 0:
            writer.text(4, *TEXTS[0][::2])
        if index == 1:
            writer.parameter("MC_A", 1.25)
            writer.dropout(12)
            writer.text(6, TEXTS[1][0], TEXTS[1][2], tag=7)
    return Path(writer.write(tmp_path / "flight.ulg"))


def tables(path: Path, target: Path, **options: Any) -> dict[str, list[tuple[Any, ...]]]:
    """Return the rows of the tables that a conversion to Parquet writes, without `log_time`, which is compared."""
    with recordings.open(path) as log:
        converted = convert(log, str(target), format="parquet", **options)
    found = {}
    for name in FACT_TABLES:
        file = target / f"{name}.parquet"
        assert (str(file) in converted.files) == file.exists()
        if file.exists():
            table = read_table(file)
            times = table["log_time"].cast(pa.int64()).to_pylist()
            assert times == [(time + UTC) * 1000 for time in table["timestamp"].to_pylist()]
            found[name] = [tuple(row.values()) for row in table.drop_columns(["log_time"]).to_pylist()]
    return found


def test_tables_have_what_a_ulog_has_beside_its_topics(ulog: Path, tmp_path: Path) -> None:
    found = tables(ulog, tmp_path / "tables")
    assert found == {"ulog_parameters": PARAMETERS, "ulog_texts": TEXTS, "ulog_dropouts": DROPOUTS}


def test_an_mcap_file_made_of_a_ulog_has_the_same_tables(ulog: Path, tmp_path: Path) -> None:
    with recordings.open(ulog) as log:
        convert(log, str(tmp_path / "flight.mcap"), format="mcap")
    assert tables(tmp_path / "flight.mcap", tmp_path / "copy") == tables(ulog, tmp_path / "tables")


def test_a_part_has_the_parameters_at_its_start(ulog: Path, tmp_path: Path) -> None:
    found = tables(ulog, tmp_path / "part", start=1.2)
    begin = START + 1_200_000
    assert found["ulog_parameters"] == [
        (begin, "MC_A", 1.25, 1.0, 0.5),
        (begin, "MC_B", 7.0, 7.0, 7.0),
    ]
    assert found["ulog_texts"] == TEXTS[1:]
    assert "ulog_dropouts" not in found


@pytest.mark.parametrize("options", [{"topics": ["vehicle_gps_position"]}, {"fields": ["fix_type"]}])
def test_chosen_topics_and_fields_are_written_alone(ulog: Path, tmp_path: Path, options: dict[str, Any]) -> None:
    assert tables(ulog, tmp_path / "some", **options) == {}


def test_a_parameter_that_changes_before_the_start_has_its_new_value_then(tmp_path: Path) -> None:
    writer = UlogWriter(start=START)
    writer.parameter("MC_A", 1.5)
    writer.format("a", "uint64_t timestamp;float x;")
    writer.subscribe(0, "a")
    writer.sample(0, struct.pack("<Qf", START - 500_000, 1.0))
    writer.parameter("MC_A", 2.5)
    writer.sample(0, struct.pack("<Qf", START + 500_000, 1.0))
    with recordings.open(writer.write(tmp_path / "early.ulg")) as log:
        convert(log, str(tmp_path / "tables"), format="parquet")
    table = read_table(tmp_path / "tables" / "ulog_parameters.parquet")
    assert (table["timestamp"].to_pylist(), table["value"].to_pylist()) == ([START], [2.5])


def test_other_formats_have_the_same_rows(ulog: Path, tmp_path: Path) -> None:
    with recordings.open(ulog) as log:
        for format_ in ("csv", "arrow"):
            convert(log, str(tmp_path / format_), format=format_)
    rows = read_csv(tmp_path / "csv" / "ulog_texts.csv").drop_columns(["log_time"]).to_pylist()
    assert [tuple(row.values()) for row in rows] == TEXTS
    with pa.memory_map(str(tmp_path / "arrow" / "ulog_dropouts.arrow")) as file:
        table = open_file(file).read_all()
    assert table.schema.field("duration").metadata == {b"unit": b"s"}
    assert table["duration"].to_pylist() == [0.012]


def test_a_log_without_defaults_tells_none(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.parameter("MC_A", 1.5)
    writer.format("a", "uint64_t timestamp;float x;")
    writer.subscribe(0, "a")
    writer.sample(0, struct.pack("<Qf", START, 1.0))
    with recordings.open(writer.write(tmp_path / "old.ulg")) as log:
        convert(log, str(tmp_path / "tables"), format="parquet")
    table = read_table(tmp_path / "tables" / "ulog_parameters.parquet")
    assert (table["default"].to_pylist(), table["log_time"].to_pylist()) == ([None], [None])


def test_no_topic_has_the_name_of_such_a_table(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.parameter("MC_A", 1.5)
    writer.format("ulog_parameters", "uint64_t timestamp;float x;")
    writer.subscribe(0, "ulog_parameters")
    writer.sample(0, struct.pack("<Qf", START, 1.0))
    path = writer.write(tmp_path / "strange.ulg")
    with recordings.open(path) as log:
        (topic,) = log.topics
        assert file_names(log.topics) == {("ulog_parameters", 0): "ulog_parameters-2"}
        assert place_of(topic).name.startswith("ulog_parameters-")
        assert len(convert(log, str(tmp_path / "tables"), format="parquet").files) == 2


def test_fleets_have_them_too(ulog: Path, tmp_path: Path) -> None:
    summary = update(str(ulog.parent), str(tmp_path / "fleet"))
    assert summary.is_whole
    for name, rows in (("ulog_parameters", PARAMETERS), ("ulog_texts", TEXTS), ("ulog_dropouts", DROPOUTS)):
        (path,) = (tmp_path / "fleet" / name).rglob("*.parquet")
        table = read_table(path)
        assert table.column_names[:5] == ["vehicle", "date", "log", "namespace", "instance"]
        assert len(table) == len(rows)
