"""Tests of the table of a fleet's recordings, and of what is on the disk before a recording is done."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from msggen import recordings
from msggen.base.disk import files
from msggen.recordings.fleet import folder, update
from msggen.recordings.fleet.ledger import Change, Ledger
from support.fleet_recordings import write_folder
from support.ulog import write_ulog


@pytest.fixture
def logs(tmp_path: Path, px4_types: Any) -> Path:
    return write_folder(tmp_path / "logs", px4_types)


def test_the_table_has_every_recording(logs: Path, tmp_path: Path) -> None:
    write_ulog(logs / "10.02.11.ulg")
    whole = (logs / "b" / "flight.mcap").read_bytes()
    (logs / "cut.mcap").write_bytes(whole[: len(whole) * 3 // 4])
    fleet = tmp_path / "fleet"
    records = {record.log: record for record in update(str(logs), str(fleet)).records}
    rows = {row["log"]: row for row in pq.read_table(fleet / "_logs.parquet").to_pylist()}
    assert rows.keys() == records.keys()
    for name, row in rows.items():
        assert [row["path"]] == list(records[name].paths)
        with recordings.open(row["path"]) as log:
            assert (row["duration"], row["utc_offset"]) == (log.duration, log.utc_offset)
            assert row["firmware"] == (log.firmware.release or None)
            start = log.start + (log.utc_offset or 0)
            assert row["start"].value == start
        assert row["samples"] == records[name].rows
        assert (row["vehicle"], row["date"]) == (records[name].values["vehicle"], records[name].values["date"])
        assert bool(row["problems"]) == ("cut" in name)
    assert [name for name in rows if name.startswith("10.02.11-")]
    before = (fleet / "_logs.parquet").stat().st_ino
    update(str(logs), str(fleet))
    assert (fleet / "_logs.parquet").stat().st_ino == before
    (logs / "a" / "flight.mcap").rename(logs / "moved.mcap")
    update(str(logs), str(fleet))
    paths = pq.read_table(fleet / "_logs.parquet")["path"].to_pylist()
    assert str(logs / "moved.mcap") in paths
    assert len(paths) == 5


def test_files_are_on_the_disk_before_the_change(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fleet, flushed, checked = tmp_path / "fleet", set[str](), []
    wait, commit = files.flush, Ledger.commit

    def flush(paths: Iterable[str]) -> None:
        each = [*paths]
        flushed.update(each)
        wait(each)

    def committed(ledger: Ledger, change: Change) -> None:
        for each in change.added:
            path = fleet / "_msggen" / each.staged
            checked.append({str(path), str(path.parent)} <= flushed)
        commit(ledger, change)

    monkeypatch.setattr(folder, "flush", flush)
    monkeypatch.setattr(Ledger, "commit", committed)
    update(str(logs), str(fleet))
    assert checked == [True] * 2
