"""Tests of the list of a fleet: what it tells, who may replace it, and what becomes of files that are not in it."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from msggen import InputError, recordings
from msggen.base.disk import files as disk
from msggen.exports.fleet import Batch, Task, batch, compact, convert_batch, files, parts, storage, update
from msggen.exports.fleet.records import FleetError, Record, decoded
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import parquet_in, rows_of, state_names, write_flight, write_folder
from support.ulog import write_ulog

LIST = "_logs.parquet"
needs_links = pytest.mark.skipif(sys.platform == "win32", reason="links need rights")


@pytest.fixture
def logs(tmp_path: Path, px4_types: Any) -> Path:
    return write_folder(tmp_path / "logs", px4_types)


@pytest.fixture
def fleet(logs: Path, tmp_path: Path) -> Path:
    update(str(logs), str(tmp_path / "fleet"))
    return tmp_path / "fleet"


def content(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def records_in(fleet: Path) -> Sequence[Record]:
    return decoded((fleet / LIST).read_bytes()).records


def test_the_list_has_every_recording_and_its_files(logs: Path, tmp_path: Path) -> None:
    write_ulog(logs / "10.02.11.ulg")
    whole = (logs / "b" / "flight.mcap").read_bytes()
    (logs / "cut.mcap").write_bytes(whole[: len(whole) * 3 // 4])
    fleet = tmp_path / "fleet"
    records = {record.log: record for record in update(str(logs), str(fleet)).records}
    rows = {row["log"]: row for row in pq.read_table(fleet / LIST).to_pylist()}
    assert rows.keys() == records.keys()
    for name, row in rows.items():
        assert [row["path"]] == list(records[name].paths)
        with recordings.open(row["path"]) as log:
            assert (row["duration"], row["utc_offset"]) == (log.duration, log.utc_offset)
            assert row["firmware"] == (log.firmware.release or None)
            assert row["start"].value == log.start + (log.utc_offset or 0)
        assert row["samples"] == records[name].samples
        assert (row["vehicle"], row["date"]) == (records[name].vehicle, records[name].date)
        assert bool(row["problems"]) == ("cut" in name)
        has = {place for place in parquet_in(fleet) if name in pq.read_table(fleet / place)["log"].to_pylist()}
        assert {*row["files"]} == has
    assert sorted(records_in(fleet)) == sorted(records.values())
    assert files(str(fleet)) == [str(fleet / place) for place in parquet_in(fleet)]
    before = (fleet / LIST).stat().st_ino
    update(str(logs), str(fleet))
    assert (fleet / LIST).stat().st_ino == before
    (logs / "a" / "flight.mcap").rename(logs / "moved.mcap")
    update(str(logs), str(fleet))
    assert str(logs / "moved.mcap") in pq.read_table(fleet / LIST)["path"].to_pylist()
    assert len(records_in(fleet)) == 5


def test_files_are_on_the_disk_before_the_list_names_them(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet, flushed, checked = tmp_path / "fleet", set[str](), []
    wait, replace = disk.flush, storage.Disk.replace_list

    def flush(paths: Any) -> None:
        each = [*paths]
        flushed.update(map(os.path.basename, each))
        wait(each)

    def replaced(own: storage.Disk, data: bytes, known: Any) -> Any:
        topics = {place.partition("/")[0] for record in decoded(data).records for place in record.files}
        names = {os.path.basename(place) for record in decoded(data).records for place in record.files}
        checked.append(topics | names <= flushed)
        return replace(own, data, known)

    monkeypatch.setattr(storage, "flush", flush)
    monkeypatch.setattr(storage.Disk, "replace_list", replaced)
    update(str(logs), str(fleet))
    assert checked == [True] * 2


def changed(data: bytes, **values: object) -> bytes:
    """Return a list whose first row has other values."""
    table = pq.read_table(io.BytesIO(data))
    columns = []
    for field in table.schema:
        values_ = table.column(field.name).to_pylist()
        if field.name in values:
            values_[0] = values[field.name]
        columns.append(pa.array(values_, field.type))
    stream = io.BytesIO()
    pq.write_table(pa.Table.from_arrays(columns, schema=table.schema), stream)
    return stream.getvalue()


def told(data: bytes, **values: object) -> bytes:
    """Return a list with other metadata."""
    table = pq.read_table(io.BytesIO(data))
    document = {**json.loads(table.schema.metadata[b"msggen"]), **values}
    stream = io.BytesIO()
    pq.write_table(table.replace_schema_metadata({b"msggen": json.dumps(document)}), stream)
    return stream.getvalue()


def without_a_column(data: bytes) -> bytes:
    stream = io.BytesIO()
    pq.write_table(pq.read_table(io.BytesIO(data)).drop_columns(["notes"]), stream)
    return stream.getvalue()


def foreign(_: bytes) -> bytes:
    stream = io.BytesIO()
    pq.write_table(pa.table({"log": ["a"]}), stream)
    return stream.getvalue()


DAMAGED: Mapping[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "half": lambda data: data[: len(data) // 2],
    "text": lambda _: b"[" * 100_000,
    "foreign": foreign,
    "column": without_a_column,
    "run": lambda data: told(data, run="../x"),
    "process": lambda data: told(data, process="\x1b[31m"),
    "number": lambda data: told(data, process=1),
    "by": lambda data: told(data, by=["pilot"]),
    "newer": lambda data: told(data, version=6),
    "digest": lambda data: changed(data, digest="a"),
    "origin": lambda data: changed(data, date_from="elsewhere"),
    **{
        name: lambda data, name=name: changed(data, files=[name])  # type: ignore[misc]
        for name in (
            *("../logs/a/flight.mcap", "/etc/hosts", "_logs.parquet", "..\\x.parquet", "C:x.parquet", "t/mine.parquet"),
            *("../000001-00000000.parquet", "_msggen/000001-00000000.parquet", "", "a/b/000001-00000000.parquet"),
        )
    },
}


def test_a_list_that_is_not_sound_is_an_error_and_nothing_changes(fleet: Path, logs: Path) -> None:
    whole = (fleet / LIST).read_bytes()
    (fleet / "_msggen" / "00000000.stage").mkdir()
    for kind, damage in DAMAGED.items():
        (fleet / LIST).write_bytes(damage(whole))
        before = content(fleet.parent)
        text = "a newer version" if kind == "newer" else f"{LIST} is not the list of a fleet, or is damaged"
        for run in (lambda: update(str(logs), str(fleet)), lambda: compact(str(fleet)), lambda: files(str(fleet))):
            with pytest.raises(FleetError, match=text):
                run()
        assert content(fleet.parent) == before, kind


def test_a_list_that_is_missing_is_an_error_and_nothing_changes(fleet: Path, logs: Path) -> None:
    (fleet / LIST).unlink()
    before = content(fleet)
    with pytest.raises(FleetError, match=f"{LIST}, the list of this fleet, is missing: restore it"):
        update(str(logs), str(fleet))
    with pytest.raises(FleetError, match="this is not a fleet"):
        files(str(fleet))
    assert content(fleet) == before


@pytest.mark.parametrize(("has_table", "text"), [(True, "is not the list of a fleet"), (False, "has other files")])
def test_a_fleet_of_another_layout_is_an_error_and_nothing_changes(
    logs: Path, tmp_path: Path, text: str, *, has_table: bool
) -> None:
    fleet = tmp_path / "fleet"
    (fleet / "_msggen").mkdir(parents=True)
    (fleet / "_msggen" / "layout.json").write_text('{"by": ["vehicle", "date"], "version": 4}')
    (fleet / "battery_status").mkdir()
    (fleet / "battery_status" / "000001-00000000.parquet").write_bytes(b"PAR1")
    if has_table:
        (fleet / LIST).write_bytes(foreign(b""))
    before = content(fleet)
    with pytest.raises(FleetError, match=f"{text}.*new folder"):
        update(str(logs), str(fleet))
    with pytest.raises(FleetError, match=r"is not (the list of )?a fleet"):
        compact(str(fleet))
    assert content(fleet) == before


@needs_links
@pytest.mark.parametrize("name", ["_msggen", LIST])
def test_nothing_is_read_or_written_through_a_link(name: str, fleet: Path, logs: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    shutil.move(fleet / name, outside)
    if outside.is_dir():
        (outside / "00000000.stage").mkdir()  # as if a run had left it
    (fleet / name).symlink_to(outside)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises((InputError, OSError), match=r"S115 symbolic link to|symbolic links"):
        update(str(logs), str(fleet))
    assert sorted(tmp_path.rglob("*")) == before


@needs_links
def test_nothing_below_a_link_is_removed(fleet: Path, logs: Path, tmp_path: Path, px4_types: Any) -> None:
    mine = tmp_path / "outside" / "000001-00000000.parquet"
    mine.parent.mkdir()
    mine.write_bytes(b"mine")
    (fleet / "link").symlink_to(mine.parent)
    data = (fleet / LIST).read_bytes()
    first = min(records_in(fleet))
    (fleet / LIST).write_bytes(changed(data, files=[*first.files, f"link/{mine.name}"]))
    (path,) = first.paths
    Path(path).unlink()
    write_flight(Path(path), px4_types, 9)
    assert len(update(str(logs), str(fleet)).converted) == 1
    assert mine.read_bytes() == b"mine"
    assert first.log not in {record.log for record in records_in(fleet)}


Pool = Callable[[Sequence[Task]], Iterator[Batch]]


def while_converted(between: Callable[[], object]) -> Pool:
    """Return a pool that converts, and does something else before the results are taken."""

    def pool(tasks: Sequence[Task]) -> Iterator[Batch]:
        done = [convert_batch(task) for task in tasks]
        between()
        return iter(done)

    return pool


OVERTAKEN = r"another run \([0-9a-f]{8}, process \d+ on .*\) has changed this fleet: run the same command again"


def test_of_two_runs_at_once_the_later_one_wins(fleet: Path, logs: Path, tmp_path: Path, px4_types: Any) -> None:
    """The first one ends with an error that names the other. Nothing is lost, or twice."""
    write_flight(logs / "new.mcap", px4_types, 9)
    with pytest.raises(FleetError, match=OVERTAKEN):
        update(str(logs), str(fleet), pool=while_converted(lambda: update(str(logs), str(fleet))))
    assert update(str(logs), str(fleet)).unchanged == 4
    update(str(logs), str(tmp_path / "other"))
    assert rows_of(fleet) == rows_of(tmp_path / "other")
    assert state_names(fleet) == ["report.json"]


@pytest.mark.parametrize("moment", ["before", "during"])
def test_a_run_whose_files_were_removed_does_not_replace_the_list(
    moment: str, fleet: Path, logs: Path, tmp_path: Path, px4_types: Any
) -> None:
    write_flight(logs / "new.mcap", px4_types, 9)

    def overtaken(tasks: Sequence[Task]) -> Iterator[Batch]:
        done = [convert_batch(task) for task in tasks] if moment == "before" else []
        assert compact(str(fleet)).topics == 0  # it has nothing to do, and removes what it finds
        assert not list(fleet.glob("_msggen/*.stage"))
        yield from done or map(convert_batch, tasks)

    with pytest.raises(FleetError, match=OVERTAKEN):
        update(str(logs), str(fleet), pool=overtaken)
    assert len(update(str(logs), str(fleet)).converted) == 1
    update(str(logs), str(tmp_path / "other"))
    assert rows_of(fleet) == rows_of(tmp_path / "other")
    assert state_names(fleet) == ["report.json"]


def test_a_run_that_is_overtaken_while_it_writes_leaves_nothing(
    logs: Path, tmp_path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = parts.write_files

    def written(*given: Any) -> Any:
        monkeypatch.undo()
        write_flight(tmp_path / "one" / "new.mcap", px4_types, 9)
        update(str(tmp_path / "one"), str(tmp_path / "fleet"))
        return write(*given)

    (tmp_path / "one").mkdir()
    monkeypatch.setattr(batch, "write_files", written)
    with pytest.raises(FleetError, match=OVERTAKEN):
        update(str(logs), str(tmp_path / "fleet"))
    assert len(update(str(logs), str(tmp_path / "fleet")).converted) == 3
    assert state_names(tmp_path / "fleet") == ["report.json"]


def test_a_compaction_that_is_overtaken_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs, fleet = tmp_path / "logs", tmp_path / "fleet"
    logs.mkdir()
    for number in range(3):
        flight(number, VEHICLES[number], 0, is_new=True).write(logs / f"{number}.ulg")
        update(str(logs), str(fleet))
    whole = rows_of(fleet)
    told: list[str] = []

    def between(_: float, topic: str) -> None:
        told.append(topic)
        if len(told) == 3:
            names = storage.Disk.names  # an overtaking run that saw nothing
            monkeypatch.setattr(storage.Disk, "names", lambda own: {k: v for k, v in names(own).items() if k[0] != "_"})
            assert compact(str(fleet)).topics == 4
            monkeypatch.undo()

    with pytest.raises(FleetError, match=OVERTAKEN):
        compact(str(fleet), progress=between)
    assert rows_of(fleet) == whole
    assert len(parquet_in(fleet)) == 6
    assert compact(str(fleet)).topics == 0


def test_two_new_fleets_at_once(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fleet, prepare = tmp_path / "fleet", storage.Disk.prepare

    def prepared(own: storage.Disk) -> None:
        monkeypatch.undo()
        update(str(logs), str(fleet))
        prepare(own)

    monkeypatch.setattr(storage.Disk, "prepare", prepared)
    with pytest.raises(FleetError, match=OVERTAKEN):
        update(str(logs), str(fleet), by=["date"])
    assert update(str(logs), str(fleet)).unchanged == 3


def test_what_a_killed_run_has_left_is_removed(fleet: Path, logs: Path) -> None:
    whole = rows_of(fleet)
    for name in ("vehicle_local_position/000009-0a1b2c3d.parquet", "gone/000009-0a1b2c3d-2.parquet"):
        (fleet / name).parent.mkdir(exist_ok=True)
        shutil.copy(next(fleet.glob("vehicle_local_position/000001-*")), fleet / name)
    mine = [fleet / "vehicle_local_position" / name for name in ("mine.parquet", "000009-0a1b2c3d.txt")]
    for path in mine:
        path.write_text("mine")
    stage = fleet / "_msggen" / "0a1b2c3d.stage"
    (stage / "new" / "000009-0a1b2c3d").mkdir(parents=True)
    (stage / ".gitignore").write_bytes(b"# msggen")
    assert update(str(logs), str(fleet)).unchanged == 3
    assert [path.read_text() for path in mine] == ["mine"] * 2
    mine[0].unlink()
    assert rows_of(fleet) == whole
    assert state_names(fleet) == ["report.json"]
