"""Tests of fleets of an earlier version, which get the present layout."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from msggen.recordings.fleet import KEYS, compact, update
from support.fleet_logs import write_logs
from support.fleet_recordings import parquet_in, rows_of, state_names
from support.fleet_version3 import write_version3


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    return write_logs(tmp_path / "logs")


@pytest.mark.parametrize("by", [list(KEYS), ["date"], ["date", "vehicle"]])
def test_it_has_the_rows_that_a_new_one_has(by: list[str], logs: Path, tmp_path: Path) -> None:
    old = write_version3(logs, tmp_path / "old", by)
    whole = update(str(logs), str(tmp_path / "new"), by=by)
    summary = update(str(logs), str(old), by=by)
    assert (summary.unchanged, len(summary.converted), len(summary.failed)) == (6, 0, 1)
    assert rows_of(old) == rows_of(tmp_path / "new")
    document, expected = summary.document(), whole.document()
    for name in ("recordings", "rows", "vehicles", "dates", "date_from"):
        assert document[name] == expected[name]
    assert not list(old.rglob("*=*"))
    assert state_names(old) == ["changes", "layout.json", "ledger.jsonl", "report.json"]
    assert json.loads((old / "_msggen" / "layout.json").read_text())["version"] == 4
    assert update(str(logs), str(old), by=by).unchanged == 6
    table = [pq.read_table(fleet / "_logs.parquet") for fleet in (old, tmp_path / "new")]
    assert table[0] == table[1]


def test_compacting_it_is_enough(logs: Path, tmp_path: Path) -> None:
    old = write_version3(logs, tmp_path / "old")
    update(str(logs), str(tmp_path / "new"))
    shutil.rmtree(logs)
    compact(str(old))
    assert rows_of(old) == rows_of(tmp_path / "new")


def test_recordings_of_which_a_file_is_missing_are_converted_again(logs: Path, tmp_path: Path) -> None:
    old = write_version3(logs, tmp_path / "old")
    update(str(logs), str(tmp_path / "new"))
    min((old / "vehicle_status").rglob("*.parquet")).unlink()
    summary = update(str(logs), str(old))
    assert (summary.unchanged, len(summary.converted), len(summary.records)) == (5, 1, 6)
    assert rows_of(old) == rows_of(tmp_path / "new")


def test_rows_of_which_a_file_is_missing_stay_if_the_recording_is_gone(logs: Path, tmp_path: Path) -> None:
    old = write_version3(logs, tmp_path / "old")
    update(str(logs), str(tmp_path / "new"))
    gone = min((old / "vehicle_status").rglob("*.parquet"))
    gone.unlink()
    shutil.rmtree(logs / "2026-11-20")
    update(str(logs), str(old))
    found, expected = rows_of(old), rows_of(tmp_path / "new")
    log = next(part[4:] for part in gone.parts if part.startswith("log="))
    expected["vehicle_status"] = [row for row in expected["vehicle_status"] if row["log"] != log]
    assert found == expected


def test_records_of_strangers_are_not_used(logs: Path, tmp_path: Path) -> None:
    old = write_version3(logs, tmp_path / "old")
    first, second = sorted((old / "_msggen" / "logs").iterdir())[:2]
    record = json.loads(first.read_text())
    first.write_text(json.dumps({**record, "files": [*record["files"], "../../outside.parquet"]}))
    second.write_text("[" * 100_000)
    (old / "_msggen" / "logs" / "mine.json").write_text("{}")
    (tmp_path / "outside.parquet").write_text("mine")
    (old / "vehicle_status" / "mine.parquet").write_text("mine")
    summary = update(str(logs), str(old))
    assert (summary.unchanged, len(summary.converted)) == (4, 2)
    assert (tmp_path / "outside.parquet").read_text() == "mine"
    assert (old / "vehicle_status" / "mine.parquet").read_text() == "mine"
    assert (old / "_msggen" / "logs" / "mine.json").read_text() == "{}"
    assert len(parquet_in(old)) > 5
