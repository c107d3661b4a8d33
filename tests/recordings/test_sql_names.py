"""Tests of names of columns that SQL takes without quotes, and of samples as CSV."""

from __future__ import annotations

import csv
import io
import math
import re
import sqlite3
import struct
from functools import cache
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen import recordings
from msggen.cli import main
from msggen.exports.convert import TABLES, convert
from msggen.recordings.columns.sql_names import names_for_sql
from support.examples import examples
from support.flights import TOPICS, write_flight
from support.log_files import Written, write_log
from support.recordings import START
from support.tables import read_table
from support.ulog import write_ulog

KEYWORDS = sorted({word for (word,) in duckdb.execute("SELECT keyword_name FROM duckdb_keywords()").fetchall()})
FIELDS = st.from_regex(r"[a-zA-Z_]\w{0,3}(\[[0-2]\])?(\.[a-z]\w{0,2}(\[1\])?)?", fullmatch=True)
ANY = st.one_of(FIELDS, st.sampled_from(KEYWORDS), st.text(max_size=5))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["q[0]", "esc[0].esc_rpm", "timestamp"], ["q_0", "esc_0_esc_rpm", "timestamp"]),
        (["q[0]", "q_0", "q[1]"], ["q_0_", "q_0", "q_1"]),
        (["q[0]", "q_0_", "q_0"], ["q_0__", "q_0_", "q_0"]),
        (["a.b", "a[0].b", "a_b"], ["a_b_", "a_0_b", "a_b"]),
        (["order", "group", "order_"], ["order__", "group_", "order_"]),
        (["voltage5V_v", "voltage5v_v"], ["voltage5V_v", "voltage5v_v_"]),
        (["3d", "", "ü"], ["_3d", "_", "__"]),
    ],
)
def test_names(names: list[str], expected: list[str]) -> None:
    assert names_for_sql(names) == expected


@cache
def database() -> duckdb.DuckDBPyConnection:
    return duckdb.connect()


@settings(max_examples=examples(100, by_day=12))
@given(st.lists(ANY, unique=True, min_size=1, max_size=8))
def test_databases_take_the_names_without_quotes(names: list[str]) -> None:
    made = names_for_sql(names)
    assert len({name.lower() for name in made}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) for name in made)
    assert names_for_sql(made) == made
    plain = [name for name in names if re.fullmatch(r"[a-z_]\w*", name, re.ASCII) and f"{name}_" not in made]
    assert set(plain) <= set(made)
    columns, values = ", ".join(made), list(range(len(names)))
    query = f"SELECT {columns} FROM t WHERE {made[0]} = 0 ORDER BY {made[-1]}"  # noqa: S608
    table = pa.table({name: [value] for name, value in zip(made, values, strict=True)})
    base = database()
    base.register("t", table)
    assert base.execute(query).fetchall() == [tuple(values)]
    lite = sqlite3.connect(":memory:")
    lite.execute(f"CREATE TABLE t ({', '.join(f'{name} INTEGER' for name in made)})")
    lite.execute(f"INSERT INTO t VALUES ({', '.join('?' * len(values))})", values)  # noqa: S608
    assert lite.execute(query).fetchall() == [tuple(values)]
    lite.close()


def test_no_word_of_sql_is_a_name() -> None:
    names = names_for_sql(KEYWORDS)
    with duckdb.connect() as base:
        base.register("t", pa.table({name: [index] for index, name in enumerate(names)}))
        (row,) = base.execute(f"SELECT {', '.join(names)} FROM t").fetchall()  # noqa: S608
        assert row == tuple(range(len(names)))


def test_all_kinds_of_columns_have_them(px4_types: Any, tmp_path: Path) -> None:
    with recordings.open(write_flight(tmp_path / "flight.mcap", px4_types, 10)) as log:
        for topic in TOPICS:
            plain, named = log.columns(topic, times=True), log.columns(topic, times=True, sql_names=True)
            assert list(named) == names_for_sql(list(plain))
            for one, other in zip(plain.values(), named.values(), strict=True):
                np.testing.assert_array_equal(one, other)
            table, renamed = log.table(topic), log.table(topic, sql_names=True)
            assert renamed.column_names == names_for_sql(table.column_names)
            assert renamed.schema.metadata == table.schema.metadata
            assert [field.metadata for field in renamed.schema] == [field.metadata for field in table.schema]
            assert renamed.columns == table.columns or topic  # NaN
            assert list(log.frame(topic, sql_names=True).columns) == renamed.column_names
            assert log.frame(topic, "polars", sql_names=True).columns == ["log_time", *renamed.column_names]
        assert dict(log.tables(["esc_status"], sql_names=True))["/fmu/out/esc_status"].column_names == (
            log.table("esc_status", sql_names=True).column_names
        )
        both = log.align("esc_status", "vehicle_status", tolerance=1.0)
        names = names_for_sql(list(both.columns()))
        assert "esc_status_esc_0_esc_rpm" in names
        assert list(both.columns(sql_names=True)) == both.table(sql_names=True).column_names == names
        assert list(both.frame(sql_names=True)) == both.frame("polars", sql_names=True).columns == names
        ((_, frame),) = log.frames(["esc_status"], sql_names=True)
        assert "esc_0_esc_rpm" in frame.columns


@pytest.mark.parametrize("format_", TABLES)
def test_tables_of_files_have_them_and_the_same_values(tmp_path: Path, format_: str) -> None:
    with recordings.open(write_ulog(tmp_path / "flight.ulg")) as log:
        plain = convert(log, str(tmp_path / "plain"), format=format_).files
        named = convert(log, str(tmp_path / "named"), format=format_, sql_names=True).files
    assert [Path(each).name for each in plain] == [Path(each).name for each in named]
    for one, other in zip(map(read_table, plain), map(read_table, named), strict=True):
        assert other.column_names == names_for_sql(one.column_names)
        assert [repr(each.to_pylist()) for each in other.columns] == [repr(each.to_pylist()) for each in one.columns]


# --- log show --csv


def shown(words: str, capsys: pytest.CaptureFixture[str]) -> list[dict[str, str]]:
    """Return the rows that `log show --csv` prints."""
    assert main(["log", "show", *words.split(), "--csv"]) in (0, 1)
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out), strict=True))


def test_csv_has_the_values_of_the_recording(
    px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("msggen.cli.commands.log.show._PIECE", 7)  # the names come once
    with recordings.open(write_flight(tmp_path / "flight.mcap", px4_types, 30)) as log:
        for topic in TOPICS:
            rows = shown(f"flight.mcap {topic}", capsys)
            expected = log.columns(topic)
            assert list(rows[0]) == ["time", *expected]
            assert [float(row["time"]) for row in rows] == ((log.samples(topic).log_times - log.start) / 1e9).tolist()
            for name, values in expected.items():
                texts = [row[name] for row in rows]
                read = [{"true": True, "false": False}[each] for each in texts] if values.dtype == bool else texts
                np.testing.assert_array_equal(np.array(read).astype(values.dtype), values)
            named = shown(f"flight.mcap {topic} --sql-names -n 1", capsys)
            assert list(named[0]) == names_for_sql(["time", *expected])


def test_csv_quotes_text_and_has_lists_as_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = b'=1, "two"\n\x1b'
    payload = b"\0\1\0\0" + struct.pack("<I", len(text) + 1) + text + b"\0" + bytes(-(len(text) + 5) % 4)
    payload += struct.pack("<I2f", 2, math.nan, 1.5) + b"ab\0c\1"
    definition = "string time\nfloat32[] values\nchar[4] name\nbool[1] flags\n"
    write_log(tmp_path / "x.mcap", [Written("/a", "demo/msg/A", definition, [(START, START, payload)])])
    (row,) = shown("x.mcap /a", capsys)
    assert row == {
        "time_": "0.0",
        "time": '=1, "two"\\n\\x1b',
        "values": "[null, 1.5]",
        "name": "ab",
        "flags[0]": "true",
    }
    (row,) = shown("x.mcap /a --quote-formulas", capsys)
    assert row["time"] == '\'=1, "two"\\n\\x1b'
    (row,) = shown("x.mcap /a --field flags --field name --sql-names", capsys)
    assert row == {"time": "0.0", "flags_0": "true", "name": "ab"}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("show flight.ulg sensor_gps --csv --json", "argument --csv: not with --json"),
        ("show flight.ulg --texts --csv", "argument --csv: only for a topic"),
        ("show flight.ulg sensor_gps --sql-names", "argument --sql-names: only with --csv"),
        ("show flight.ulg sensor_gps --quote-formulas", "argument --quote-formulas: only with --csv"),
        ("convert flight.ulg -o a.mcap --sql-names", f"--sql-names: only for {', '.join(TABLES)}, not mcap"),
        ("convert . --sql-names", "argument --sql-names: a folder of recordings becomes Parquet as a whole"),
    ],
)
def test_options_that_have_no_effect_are_refused(
    words: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_ulog(tmp_path / "flight.ulg")
    with pytest.raises(SystemExit):
        main(["log", *words.split()])
    assert expected in capsys.readouterr().err
