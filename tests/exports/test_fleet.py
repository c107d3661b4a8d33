"""Tests of fleets: what is converted, what is not converted again, and what happens if a run does not end well."""

from __future__ import annotations

import json
import os
import shutil
import struct
import sys
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from msggen import recordings
from msggen.exports.fleet import Batch, Keys, Progress, Task, convert_batch, update
from msggen.exports.fleet.layout import date_of
from support.fleet_logs import write_logs
from support.fleet_recordings import parquet_in, rows_in, rows_of, state_names, write_flight, write_folder
from support.log_files import Written, write_log
from support.recordings import START
from support.ulog import UlogWriter

DAY = datetime.fromtimestamp(START / 1e9, timezone.utc).date().isoformat()
GPS = int(datetime(2025, 3, 9, 23, 0, tzinfo=timezone.utc).timestamp() * 1e6)


@pytest.fixture
def logs(tmp_path: Path, px4_types: Any) -> Path:
    return write_folder(tmp_path / "logs", px4_types)


def test_the_files_have_the_columns_of_the_recordings(logs: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    seen: list[Progress] = []
    summary = update(str(logs), str(fleet), progress=seen.append)
    assert [(each.done, each.total) for each in seen] == [(1, 3), (2, 3), (3, 3)]
    assert (summary.found, summary.unchanged, len(summary.converted), summary.failed) == (3, 0, 3, [])
    for topic in ("vehicle_local_position", "vehicle_gps_position"):
        (name,) = [name for name in parquet_in(fleet) if name.startswith(f"{topic}/")]
        table = pq.ParquetFile(fleet / name).read()
        assert table.column_names[:6] == [*Keys._fields, "timestamp"]
        assert table["log"].to_pylist() == sorted(table["log"].to_pylist())
        for record in summary.converted:
            rows = table.filter(pc.equal(table["log"], record.log))
            (path,) = record.paths
            with recordings.open(path) as log:
                columns, expected = log.columns(topic), log.table(topic)
            assert set(columns) <= set(table.column_names)
            for column, values in columns.items():
                assert rows[column].to_numpy().tobytes() == values.tobytes()
                assert (rows.schema.field(column).metadata or {}) == (expected.schema.field(column).metadata or {})
            assert set(zip(*(rows[key].to_pylist() for key in Keys._fields), strict=True)) == {
                (record.vehicle, record.date, record.log, "none", 0)
            }


def test_names_dates_and_vehicles(logs: Path, tmp_path: Path, px4_types: Any) -> None:
    write_flight(logs / "b" / "with_fix_2020-01-01.mcap", px4_types, 7, gps=GPS)
    summary = update(str(logs), str(tmp_path / "fleet"))
    found = {next(iter(each.paths)): (each.vehicle, each.date, each.date_from) for each in summary.converted}
    assert {os.path.relpath(path, logs).replace(os.sep, "/"): values for path, values in found.items()} == {
        "a/flight.mcap": ("unknown", DAY, "clock"),
        "b/flight.mcap": ("unknown", DAY, "clock"),
        "b/2024-05-06_x.mcap": ("unknown", "2024-05-06", "name"),
        "b/with_fix_2020-01-01.mcap": ("unknown", "2025-03-09", "gps"),
    }
    document = summary.document()
    assert document["date_from"] == {"clock": 2, "gps": 1, "name": 1}
    assert document["vehicles"] == {"unknown": 4}
    assert sorted(each.log[:-9] for each in summary.converted) == [
        "2024-05-06_x",
        "flight",
        "flight",
        "with_fix_2020-01-01",
    ]


def test_what_is_done_is_not_done_again(logs: Path, tmp_path: Path, px4_types: Any) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet))
    before = parquet_in(fleet)
    again = update(str(logs), str(fleet))
    assert (again.found, again.unchanged, again.outcomes) == (3, 3, [])
    assert parquet_in(fleet) == before
    write_flight(logs / "new.mcap", px4_types, 9)
    more = update(str(logs), str(fleet))
    assert (more.found, more.unchanged, len(more.converted)) == (4, 3, 1)
    assert before.items() <= parquet_in(fleet).items()


@pytest.mark.parametrize("gone", ["file", "topic", "all"])
def test_results_that_are_missing_are_made_again(gone: str, logs: Path, tmp_path: Path, px4_types: Any) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet))
    write_flight(logs / "new.mcap", px4_types, 9)
    update(str(logs), str(fleet))
    before = rows_of(fleet)
    if gone == "file":
        max(fleet.glob("vehicle_local_position/*.parquet")).unlink()  # of the new one
    else:
        for topic in fleet.glob("v*" if gone == "all" else "vehicle_local_position"):
            shutil.rmtree(topic)
    summary = update(str(logs), str(fleet))
    assert len(summary.converted) == (1 if gone == "file" else 4)
    assert summary.unchanged == 4 - len(summary.converted)
    assert (summary.removed, summary.copies) == (0, 0)
    assert rows_of(fleet) == before
    assert update(str(logs), str(fleet)).unchanged == 4


def test_copies_and_moved_recordings_are_not_converted_again(logs: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet))
    before = parquet_in(fleet)
    shutil.copy(logs / "a" / "flight.mcap", logs / "b" / "copy.mcap")
    logs.rename(tmp_path / "moved")
    summary = update(str(tmp_path / "moved"), str(fleet))
    assert (summary.unchanged, summary.copies, len(summary.converted)) == (0, 4, 0)
    assert parquet_in(fleet) == before
    assert update(str(tmp_path / "moved"), str(fleet)).unchanged == 4


def test_copies_of_a_bad_recording_are_reported_with_their_own_paths(logs: Path, tmp_path: Path) -> None:
    for name in ("a/bad.ulg", "b/bad.ulg"):
        (logs / name).write_bytes(b"nothing of the sort")
    failed = update(str(logs), str(tmp_path / "fleet")).failed
    assert [each.error.split(" is not")[0] for each in failed] == [each.path for each in failed]
    assert len(failed) == 2


def test_recordings_that_change_while_they_are_read_are_tried_again(logs: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet))
    before = rows_of(fleet)
    (logs / "c").mkdir()
    path = logs / "c" / "longer.mcap"
    path.write_bytes((logs / "a" / "flight.mcap").read_bytes() + b"more")

    def later(tasks: Sequence[Task]) -> Iterator[Batch]:
        shutil.copy(logs / "a" / "flight.mcap", path)
        return map(convert_batch, tasks)

    (failed,) = update(str(logs), str(fleet), pool=later).failed
    assert (failed.path, failed.error) == (str(path), "changed while it was read: run the same command again")
    assert rows_of(fleet) == before
    assert update(str(logs), str(fleet)).copies == 1
    assert rows_of(fleet) == before


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Return a folder with a file at each place where a fleet could find one of its own."""
    folder = tmp_path / "outside"
    folder.mkdir()
    return folder


needs_links = pytest.mark.skipif(sys.platform == "win32", reason="links need rights")


@needs_links
@pytest.mark.parametrize("level", range(2))
def test_nothing_is_written_through_a_link(level: int, logs: Path, tmp_path: Path, outside: Path) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet))
    name = min(parquet_in(fleet))
    place = fleet.joinpath(*name.split("/")[: level + 1])
    shutil.rmtree(place) if level == 0 else place.unlink()
    place.symlink_to(outside if level == 0 else outside / "mine.parquet")
    summary = update(str(logs), str(fleet))
    assert not list(outside.iterdir())
    if level:
        assert len(summary.converted) == 3
        assert rows_in(fleet) == 300
        return
    (failed,) = {each.error for each in summary.failed}
    text = "replace it with a folder, or name its target as the output"
    assert failed == f"{place}: S115 symbolic link to {outside}: {text}"


@needs_links
def test_the_fleet_itself_may_be_a_link(logs: Path, tmp_path: Path, outside: Path) -> None:
    (tmp_path / "fleet").symlink_to(outside)
    assert len(update(str(logs), str(tmp_path / "fleet")).converted) == 3
    assert update(str(logs), str(outside)).unchanged == 3


def test_bad_recordings_are_reported_and_do_not_stop_the_others(logs: Path, tmp_path: Path) -> None:
    (logs / "a" / "bad.ulg").write_bytes(b"nothing of the sort")
    whole = (logs / "b" / "flight.mcap").read_bytes()
    (logs / "cut.mcap").write_bytes(whole[: len(whole) * 3 // 4])
    fleet = tmp_path / "fleet"
    summary = update(str(logs), str(fleet))
    (failed,) = summary.failed
    assert failed.path == str(logs / "a" / "bad.ulg")
    assert "is not a recording" in failed.error
    report = json.loads((fleet / "_msggen" / "report.json").read_text())
    assert report == summary.document()
    assert report["failed"] == [{"path": failed.path, "error": failed.error}]
    assert [each["path"] for each in report["incomplete"]] == [str(logs / "cut.mcap")]
    assert report["converted"] == 4
    # it is tried again
    again = update(str(logs), str(fleet))
    assert [each.path for each in again.failed] == [failed.path]
    # and what is missing is told by every run
    later = json.loads((fleet / "_msggen" / "report.json").read_text())
    of_the_run = {"converted": 0, "unchanged": 4}
    assert later == again.document() == {**report, **of_the_run}
    (logs / "cut.mcap").unlink()
    assert [each.path for each in update(str(logs), str(fleet)).incomplete] == [str(logs / "cut.mcap")]


def test_every_report_names_recordings_with_definitions_from_elsewhere(
    logs: Path, tmp_path: Path, px4_types: Any
) -> None:
    payload = px4_types.VehicleStatus().encode()
    topic = Written("/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "", [(START, START, payload)])
    write_log(logs / "bare.mcap", [topic])
    shutil.copy(logs / "bare.mcap", logs / "copy.mcap")
    fleet = tmp_path / "fleet"
    (lent,) = update(str(logs), str(fleet)).document()["lent"]
    assert lent["path"] == str(logs / "bare.mcap")
    assert "v1.18" in lent["notes"][0]
    assert update(str(logs), str(fleet)).document()["lent"] == [lent]
    assert json.loads((fleet / "_msggen" / "report.json").read_text())["lent"] == [lent]


def test_the_report_names_copies(logs: Path, tmp_path: Path) -> None:
    first, fleet = logs / "a" / "flight.mcap", tmp_path / "fleet"
    (logs / "z.mcap").write_bytes(first.read_bytes())
    copied = [{"path": str(logs / "z.mcap"), "of": str(first)}]
    assert update(str(logs), str(fleet)).document()["copied"] == copied
    assert update(str(logs), str(fleet)).document()["copied"] == copied
    first.rename(logs / "moved.mcap")
    update(str(logs), str(fleet))
    assert len(update(str(logs), str(fleet)).document()["copied"]) == 1
    (logs / "moved.mcap").unlink()
    document = update(str(logs), str(fleet)).document()
    assert (document["copied"], document["recordings"]) == ([], 3)


def test_errors_of_msggen_itself_are_reported_too(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise TypeError("a bug")

    monkeypatch.setattr("msggen.exports.fleet.batch.vehicle_of", fail)
    summary = update(str(logs), str(tmp_path / "fleet"))
    assert [each.error for each in summary.failed] == ["unexpected error: TypeError: a bug"] * 3
    assert parquet_in(tmp_path / "fleet") == {}
    assert not [name for name in state_names(tmp_path / "fleet") if name.endswith(".stage")]


def test_the_vehicle_tells_the_date_of_its_log(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("wind", "uint64_t timestamp;float x")
    writer.subscribe(0, "wind")
    writer.sample(0, struct.pack("<Qf", 2_000_000, 1.0))
    writer.text(6, 2_000_000, "[commander] no 2025-05-05")
    writer.text(6, 2_000_000, "[logger] /fs/microsd/log/2026-01-12/10_23_26.ulg\t")
    with recordings.open(writer.write(tmp_path / "log_1.ulg")) as log:
        assert date_of(log, log.path) == ("2026-01-12", "name")
        assert date_of(log, "logs/2024-02-29/log_1.ulg") == ("2024-02-29", "name")


def test_a_folder_with_other_files_is_refused(logs: Path, tmp_path: Path) -> None:
    before = sorted(logs.rglob("*"))
    with pytest.raises(recordings.RecordingError, match="has other files: choose a new folder"):
        update(str(logs), str(logs))
    assert sorted(logs.rglob("*")) == before
    (tmp_path / "empty").mkdir()
    assert update(str(logs), str(tmp_path / "empty")).is_whole


def test_a_recording_whose_problem_names_a_topic_with_nul_is_not_forgotten(tmp_path: Path) -> None:
    logs, fleet = tmp_path / "logs", tmp_path / "fleet"
    logs.mkdir()
    known = Written("/fmu/out/rpm", "px4_msgs/msg/Rpm", "float32 rpm\n", [(START, START, b"\0\1\0\0" + bytes(4))])
    strange = Written("/fmu/\0", "px4_msgs/msg/Rpm", "float32 rpm\n", [(START, START, b"{}")], encoding="json")
    write_log(logs / "a.mcap", [known, strange])
    (record,) = update(str(logs), str(fleet)).records
    assert "\0" in "".join(record.problems)
    assert (record.samples, rows_in(fleet)) == (1, 2), "a sample, and the finding that a part cannot be read"
    assert update(str(logs), str(fleet)).unchanged == 1


def test_the_order_is_that_of_the_first_run(logs: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    update(str(logs), str(fleet), by=["date"])
    with pytest.raises(recordings.RecordingError, match="this fleet is by 'date', not by 'vehicle,date'"):
        update(str(logs), str(fleet))


@pytest.mark.parametrize("by", [["vehicle", "date"], ["date", "vehicle"], ["date"], ["vehicle"]])
def test_rows_are_sorted(by: list[str], tmp_path: Path) -> None:
    update(str(write_logs(tmp_path / "logs")), str(tmp_path / "fleet"), by=by)
    order = [*by, *(key for key in Keys._fields if key not in by), "timestamp"]
    for name in parquet_in(tmp_path / "fleet"):
        rows = pq.ParquetFile(tmp_path / "fleet" / name).read(columns=order).to_pylist()
        found = [tuple(row[key] for key in order) for row in rows]
        assert found == sorted(found)
        told = pq.ParquetFile(tmp_path / "fleet" / name).metadata.row_group(0).sorting_columns
        assert [Keys._fields[each.column_index] for each in told] == order[:-1]


def test_a_folder_without_recordings(tmp_path: Path) -> None:
    with pytest.raises(recordings.RecordingError, match="there is no recording in this folder"):
        update(str(tmp_path), str(tmp_path / "fleet"))
    assert not (tmp_path / "fleet").exists()
