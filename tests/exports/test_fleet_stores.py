"""Tests of fleets in an object store, as in a folder, whatever fails or is killed."""

from __future__ import annotations

import io
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from msggen.exports.fleet import Batch, Task, compact, convert_batch, files, pools, run, update
from msggen.exports.fleet.records import FleetError, decoded
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.errors import StoreError
from support.databases import Stored, write_database
from support.examples import by_day
from support.fleet_recordings import rows_of
from support.fleet_stores import FLEET, Bucket, change
from support.recordings import START

pytest_plugins = ["support.fleet_fixtures"]
pytestmark = pytest.mark.timeout(600)

LOGS = "s3://bucket/logs"
LIST = "/bucket/fleets/own/_logs.parquet"


def without_paths(document: dict[str, Any]) -> dict[str, Any]:
    kept = ("found", "converted", "unchanged", "copies", "replaced", "recordings", "files", "rows", "bytes", "dates")
    return {name: document[name] for name in (*kept, "date_from", "vehicles")}


@by_day("source", ["store", "folder"], 2)
def test_a_fleet_in_a_store_is_the_same(bucket: Bucket, logs: Path, tmp_path: Path, source: str) -> None:
    local = str(tmp_path / "fleet")
    address = str(logs) if source == "folder" else LOGS
    for step in range(3):
        if step == 1:
            change(logs)
        bucket.put(logs, "logs")
        expected, found = update(str(logs), local), update(address, FLEET)
        assert without_paths(found.document()) == without_paths(expected.document())
        assert len(found.failed) == len(expected.failed) == 1
        assert [list(each.record.problems) for each in found.incomplete if each.record] == [
            list(each.record.problems) for each in expected.incomplete if each.record
        ]
        assert bucket.rows(tmp_path / f"copy-{step}") == rows_of(Path(local))
        bucket.check_whole()
    before, after = compact(local), compact(FLEET)
    assert after == before
    assert bucket.rows(tmp_path / "compacted") == rows_of(Path(local))
    bucket.check_whole()
    assert compact(FLEET).topics == 0


def test_recordings_in_a_store_become_a_fleet_in_a_folder(bucket: Bucket, logs: Path, tmp_path: Path) -> None:
    bucket.put(logs, "logs")
    expected, found = update(str(logs), str(tmp_path / "one")), update(LOGS, str(tmp_path / "two"))
    assert rows_of(tmp_path / "two") == rows_of(tmp_path / "one")
    assert [each.path for each in found.outcomes] == [
        each.path.replace(str(logs), LOGS).replace(os.sep, "/") for each in expected.outcomes
    ]
    assert "msggen-" not in str(found.document())
    bucket.server.begin()
    assert update(LOGS + "/", str(tmp_path / "two")).unchanged == 6
    assert not [each for each in bucket.server.requests if "ulg" in each.path and "notes" not in each.path]


def test_a_recording_that_was_moved_in_a_store_is_where_it_is_now(bucket: Bucket, logs: Path) -> None:
    bucket.put(logs, "logs")
    update(LOGS, FLEET)
    for step in ("moved", "moved again"):
        (path,) = (path for path in bucket.server.files if "sess" in path)
        bucket.server.files[f"/bucket/logs/{step}/sess.ulg"] = bucket.server.files.pop(path)
        done = update(LOGS, FLEET)
        assert (done.copies, len(done.converted), done.document()["copied"]) == (1, 0, [])
        (record,) = (record for record in decoded(bucket.server.files[LIST]).records if "sess001" in record.log)
        assert list(record.paths) == [f"{LOGS}/{step}/sess.ulg"]


def test_a_recording_that_changes_while_it_is_read_leaves_no_object(bucket: Bucket, logs: Path) -> None:
    update(str(logs), FLEET)
    copy, first = logs / "copy.ulg", logs / "hangar" / "sess001.ulg"
    copy.write_bytes(first.read_bytes() + b"more")

    def later(tasks: Sequence[Task]) -> Iterator[Batch]:
        copy.write_bytes(first.read_bytes())
        return map(convert_batch, tasks)

    failed = {os.path.basename(each.path): each.error for each in update(str(logs), FLEET, pool=later).failed}
    assert failed["copy.ulg"] == "changed while it was read: run the same command again"
    bucket.check_whole()


def test_the_log_of_a_database_that_was_not_closed_is_read_in_a_fleet_from_a_store(
    bucket: Bucket, tmp_path: Path
) -> None:
    (tmp_path / "logs").mkdir()
    rows = [(1, START + number, b"\0\1\0\0" + bytes([number]) * 8) for number in range(10)]
    topics = [Stored(1, "/a", "our_msgs/msg/Foo", "uint64 timestamp\n")]
    path = write_database(tmp_path / "logs" / "flight.db3", topics, rows, journal="WAL")
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("DELETE FROM messages WHERE id > 7")
        bucket.put(tmp_path / "logs", "logs")
    assert update(LOGS, FLEET).document()["rows"] == 7


def test_a_folder_of_rosbag2_in_a_store_is_one_recording(bucket: Bucket, px4_types: Any, tmp_path: Path) -> None:
    from support.fleet_recordings import write_flight

    (tmp_path / "logs" / "bag").mkdir(parents=True)
    write_flight(tmp_path / "logs" / "bag" / "bag_0.mcap", px4_types, 1)
    write_flight(tmp_path / "logs" / "bag" / "bag_1.mcap", px4_types, 2)
    write_flight(tmp_path / "logs" / "flight.mcap", px4_types, 3)
    bucket.put(tmp_path / "logs", "logs")
    expected, found = update(str(tmp_path / "logs"), str(tmp_path / "fleet")), update(LOGS, FLEET)
    assert [each.path for each in found.outcomes] == [f"{LOGS}/bag", f"{LOGS}/flight.mcap"]
    assert [each.digest for each in found.converted] == [each.digest for each in expected.converted]
    assert bucket.rows(tmp_path / "copy") == rows_of(tmp_path / "fleet")
    assert [each.path for each in update("s3://bucket/logs/bag", "s3://bucket/two").outcomes] == [f"{LOGS}/bag"]


def test_a_fleet_among_the_recordings_is_left_out(bucket: Bucket, logs: Path) -> None:
    bucket.put(logs, "logs")
    update(LOGS, f"{LOGS}/fleet")
    bucket.server.files["/bucket/logs/fleet/x.ulg"] = bucket.server.files["/bucket/logs/hangar/sess001.ulg"]
    assert update(LOGS, f"{LOGS}/fleet").unchanged == 6


def test_a_folder_that_is_no_fleet_is_an_error(bucket: Bucket, logs: Path) -> None:
    with pytest.raises(FleetError, match="this is not a fleet"):
        compact(FLEET)
    bucket.put(logs, "fleets/own")
    with pytest.raises(FleetError, match="has other files"):
        update(str(logs), FLEET)
    with pytest.raises(RecordingError, match="no recording in this folder"):
        update("s3://bucket/nothing", "s3://bucket/new")
    with pytest.raises(StoreError, match=r"^s3://nobucket[^:]*: there is no such bucket$"):
        update(str(logs), "s3://nobucket/fleet")
    assert not [key for key in bucket.names() if "_msggen" in key]


def test_a_list_of_files_needs_no_temporary_folder(
    bucket: Bucket, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    update(str(logs), FLEET)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    assert files(FLEET, "battery_status") == [f"s3://bucket/{key}" for key in bucket.names("fleets/own/battery_status")]


def test_a_fleet_can_be_copied_to_a_store_and_back(bucket: Bucket, logs: Path, tmp_path: Path) -> None:
    update(str(logs), str(tmp_path / "fleet"))
    bucket.put(tmp_path / "fleet", "fleets/own")
    assert files(FLEET, "battery_status") == [f"s3://bucket/{key}" for key in bucket.names("fleets/own/battery_status")]
    change(logs)
    assert len(update(str(logs), FLEET).converted) == 2
    back = bucket.get("fleets/own", tmp_path / "back")
    assert compact(str(back)).topics == 6
    assert rows_of(back) == bucket.rows(tmp_path / "copy")
    (path,) = files(str(back), "battery_status")
    assert pq.read_metadata(path).num_rows


def test_readers_of_the_list_see_one_state_or_the_other(bucket: Bucket, logs: Path) -> None:
    """Those that list the files can see rows twice during a compaction, and never fewer."""
    update(str(logs / "2026-11-20"), FLEET)
    update(str(logs), FLEET)
    sizes: dict[str, int] = {}

    def rows(key: str) -> int:
        if key not in sizes:
            sizes[key] = pq.read_metadata(io.BytesIO(bucket.server.files[f"/bucket/{key}"])).num_rows
        return sizes[key]

    def counts() -> tuple[int, int]:
        records = decoded(bucket.server.files[LIST])
        places = {place for record in records.records for place in record.files}
        there = [key for key in bucket.names("fleets/own/") if key.endswith(".parquet") and "/_" not in key]
        return sum(rows(f"fleets/own/{place}") for place in places), sum(map(rows, there))

    expected, seen = counts()[0], list[tuple[int, int]]()

    def look(_: int, request: str) -> str:
        if not request.startswith("GET"):
            seen.append(counts())
        return ""

    bucket.server.begin(look)
    compact(FLEET)
    bucket.server.begin()
    assert all(listed == expected for listed, _ in seen)
    assert all(there >= expected for _, there in seen)
    assert any(there > expected for _, there in seen)
    bucket.check_whole()


@by_day(("header", "status"), [*product(("If-None-Match", "If-Match"), ("501", ""))], 3)
def test_a_store_without_conditional_puts_is_refused(bucket: Bucket, logs: Path, header: str, status: str) -> None:
    text = rf"^{FLEET}: the store refuses conditional puts, .*: " + ("the server answers .*501" if status else "it ign")
    for kept in ([], ["fleets/own/_logs.parquet"]):
        bucket.server.begin()
        bucket.server.unfit = {header: status}
        before = {key: data for key, data in bucket.save().items() if "stage" not in key}
        with pytest.raises(StoreError, match=text):
            update(str(logs), FLEET)
        assert {key: data for key, data in bucket.save().items() if "stage" not in key} == before
        assert [key for key in before if key in kept] == kept
        bucket.server.begin()
        update(str(logs / "2026-11-20"), FLEET)
        change(logs)
    bucket.check_whole()


def test_of_two_runs_at_once_one_ends_with_an_error(bucket: Bucket, logs: Path, tmp_path: Path) -> None:
    update(str(logs / "2026-11-20"), FLEET)

    def pool(tasks: Sequence[Task]) -> Iterator[Batch]:
        done = [convert_batch(task) for task in tasks]
        update(str(logs / "hangar"), FLEET)
        return iter(done)

    with pytest.raises(FleetError, match=r"another run \([0-9a-f]{8}, process \d+ on .*\) has changed this fleet"):
        update(str(logs / "2026-11-21"), FLEET, pool=pool)
    update(str(logs), FLEET)
    bucket.check_whole()
    update(str(logs), str(tmp_path / "fleet"))
    assert bucket.rows(tmp_path / "copy") == rows_of(tmp_path / "fleet")


def test_an_empty_file_beside_a_database_does_not_make_it_another_one(bucket: Bucket, tmp_path: Path) -> None:
    """It has no tag when it is read."""
    (tmp_path / "logs" / "bag").mkdir(parents=True)
    rows = [(1, START + number, b"\0\1\0\0" + bytes([number]) * 8) for number in range(10)]
    write_database(tmp_path / "logs" / "bag" / "bag_0.db3", [Stored(1, "/a", "our_msgs/msg/Foo", "uint8[8] x\n")], rows)
    (tmp_path / "logs" / "bag" / "bag_0.db3-wal").touch()
    bucket.put(tmp_path / "logs", "logs")
    assert len(update(LOGS, FLEET).converted) == 1
    assert update(LOGS, FLEET).unchanged == 1


@pytest.mark.night
@pytest.mark.parametrize("kind", ["processes", "dask"])
def test_pools_write_to_the_store(bucket: Bucket, logs: Path, tmp_path: Path, kind: str) -> None:
    bucket.put(logs, "logs")
    update(str(logs), str(tmp_path / "fleet"))
    expected = rows_of(tmp_path / "fleet")
    if kind == "processes":
        update(LOGS, FLEET, pool=run.pool_of(2))
    else:
        distributed = pytest.importorskip("distributed")
        options = {"n_workers": 2, "processes": False, "protocol": "tcp", "host": "127.0.0.1"}
        with distributed.LocalCluster(**options, dashboard_address=None) as cluster, distributed.Client(cluster) as own:
            update(LOGS, FLEET, pool=lambda tasks: pools.on_client(tasks, own))
    assert bucket.rows(tmp_path / "copy") == expected
    bucket.check_whole()
