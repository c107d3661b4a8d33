"""Tests of large files of a fleet that are made of small ones, and of what readers see meanwhile."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.exports.fleet import Batch, Keys, Task, compact, convert_batch, parts, storage, update
from msggen.exports.fleet import fleet as fleets
from msggen.exports.fleet.parts import Files, Run, write_files
from msggen.exports.fleet.records import FleetError
from support.examples import examples
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import parquet_in, rows_of, write_flight
from support.log_files import Written, write_log
from support.recordings import START

TOPICS = {"battery_status", "findings", "sensor_gps", "ulog_parameters", "vehicle_local_position", "vehicle_status"}


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Return a fleet of five runs, each with a recording."""
    for number in range(5):
        add(tmp_path, number)
    return tmp_path / "fleet"


def add(folder: Path, number: int) -> None:
    (folder / "logs").mkdir(exist_ok=True)
    flight(number, VEHICLES[number % 3], 0, is_new=number > 2).write(folder / "logs" / f"{number}.ulg")
    update(str(folder / "logs"), str(folder / "fleet"))


def test_the_rows_stay_the_same(fleet: Path) -> None:
    before, told = rows_of(fleet), list[str]()
    assert len(parquet_in(fleet)) == 30
    done = compact(str(fleet), progress=lambda _, topic: told.append(topic))
    assert (done.topics, done.files_before, done.files) == (6, 30, 6)
    assert done.bytes < done.bytes_before
    assert set(told) == TOPICS
    assert rows_of(fleet) == before
    assert {row["temperature"] is None for row in before["battery_status"]} == {True, False}  # older firmware lacks it
    assert {path.partition("/")[0] for path in parquet_in(fleet)} == TOPICS
    again = parquet_in(fleet)
    assert compact(str(fleet)).topics == 0
    assert parquet_in(fleet) == again
    assert update(str(fleet.parent / "logs"), str(fleet)).unchanged == 5


def test_large_files_stay_as_they_are(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compact(str(fleet))
    before = parquet_in(fleet)
    size = min((fleet / name).stat().st_size for name in before)
    monkeypatch.setattr(fleets, "LARGE", size)
    add(fleet.parent, 5)
    add(fleet.parent, 6)
    compact(str(fleet))
    assert before.items() <= parquet_in(fleet).items()


def test_files_end_when_they_are_full(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = Counter(row["log"] for row in rows_of(fleet)["vehicle_local_position"])
    monkeypatch.setattr(parts, "FULL", 1)
    monkeypatch.setattr(parts, "_GROUP", 0)
    compact(str(fleet))
    files = [pq.ParquetFile(fleet / name) for name in parquet_in(fleet) if name.startswith("vehicle_local_position/")]
    assert len(files) == 5
    assert Counter(row["log"] for row in rows_of(fleet)["vehicle_local_position"]) == before
    for file in files:
        group = file.metadata.row_group(0)
        told = [group.column(index).statistics for index in range(len(Keys._fields))]
        assert all(each.min == each.max for each in told)


def test_row_groups_of_large_recordings_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "_MOST", 1000)
    table = pa.table({"timestamp": pa.array(range(1000), pa.uint64())})
    run = Run(Keys("v", "d", "l", "none", 0), table.schema, lambda: iter([table]))
    (file,) = write_files([("a", [run])], str(tmp_path), "000001-00000000", ["vehicle", "date"])
    metadata = pq.read_metadata(tmp_path / file.place)
    assert metadata.num_row_groups == 8
    assert pq.read_table(tmp_path / file.place)["timestamp"].to_pylist() == list(range(1000))


_VALUES: Mapping[pa.DataType, Callable[[int], object]] = {pa.int32(): int, pa.float64(): float, pa.string(): str}


def _once(table: Any) -> Iterator[Any]:
    yield table


COLUMNS = st.dictionaries(st.sampled_from("abc"), st.sampled_from(list(_VALUES)))


@settings(max_examples=examples(100, by_day=12))
@given(st.lists(st.tuples(st.integers(0, 3), COLUMNS), min_size=1, max_size=6))
def test_columns_that_agree_are_in_one_file(given_runs: list[tuple[int, dict[str, pa.DataType]]]) -> None:
    """Compare with a slow way to say it: each row has its own values, and NULL or nothing elsewhere."""
    from tempfile import TemporaryDirectory

    runs, expected = [], Counter[str]()
    for index, (number, columns) in enumerate(given_runs):
        values = {name: _VALUES[kind](index) for name, kind in columns.items()}
        table = pa.table(
            {"timestamp": pa.array([index], pa.uint64())}
            | {name: pa.array([values[name]], kind) for name, kind in columns.items()}
        )
        keys = Keys("v", "d", f"log{number}", "none", index)
        runs.append(Run(keys, table.schema, partial(_once, table)))
        expected[repr(sorted({**keys._asdict(), "timestamp": index, **values}.items()))] += 1
    with TemporaryDirectory() as folder:
        written = write_files([("a", runs)], folder, "000001-00000000", ["vehicle", "date"])
        found = Counter[str]()
        for file in written:
            table = pq.ParquetFile(f"{folder}/{file.place}").read()
            rows = table.to_pylist()
            found.update(repr(sorted((k, v) for k, v in row.items() if v is not None)) for row in rows)
            assert file.logs == list(dict.fromkeys(row["log"] for row in rows))
            order = [tuple(row[key] for key in Keys._fields) for row in rows]
            assert order == sorted(order)
        assert found == expected
        kinds = [columns for _, columns in given_runs]
        is_one = all(one.get(name, kind) == kind for one in kinds for other in kinds for name, kind in other.items())
        assert (len(written) == 1) is is_one


@pytest.fixture
def heights(tmp_path: Path) -> Path:
    """A folder of three recordings of a topic, of which one has another unit."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for index, unit in enumerate(("[m]", "", "[cm]")):
        text = f"uint64 timestamp\nfloat32 height # {unit}\n"
        payload = b"\0\1\0\0" + struct.pack("<Qf", index, 1.0)
        written = Written("/fmu/out/height", "px4_msgs/msg/Height", text, [(START, START, payload)])
        write_log(folder / f"{index}.mcap", [written])
    return folder


def test_columns_of_another_unit_are_in_another_file(heights: Path, tmp_path: Path) -> None:
    update(str(heights), str(tmp_path / "fleet"))
    for _ in range(2):
        names = list(parquet_in(tmp_path / "fleet"))
        fields = [pq.read_schema(tmp_path / "fleet" / name).field("height").metadata for name in names]
        assert sorted(each[b"unit"] for each in fields) == [b"cm", b"m"]
        assert len(rows_of(tmp_path / "fleet")["height"]) == 3
        compact(str(tmp_path / "fleet"))


def test_recordings_whose_batch_fails_late_are_converted_alone(
    heights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files of the batch are there already, and have other names."""

    def fail(*_: object) -> None:
        monkeypatch.undo()
        raise MemoryError

    monkeypatch.setattr(storage.Disk, "keep", fail)
    assert update(str(heights), str(tmp_path / "fleet")).failed == []
    assert len(parquet_in(tmp_path / "fleet")) == len(rows_of(tmp_path / "fleet")["height"]) == 3


def test_recordings_of_a_batch_that_fails_are_converted_by_themselves_and_at_last_alone(
    heights: Path, tmp_path: Path
) -> None:
    asked: list[int] = []

    def pool(tasks: Sequence[Task]) -> Iterator[Batch]:
        asked.append(len(tasks))
        for task in tasks:
            fails = len(task.paths) > 1 or len(tasks) > 1
            yield Batch(task, failed="out of memory") if fails else convert_batch(task)

    assert update(str(heights), str(tmp_path / "fleet"), pool=pool).failed == []
    assert asked == [1, 3, 1, 1, 1]


def test_fields_with_the_names_of_keys_stay(tmp_path: Path) -> None:
    text = "uint64 timestamp\nuint8 instance\nuint8 log\n"
    payload = b"\0\1\0\0" + struct.pack("<QBB", 1, 2, 3)
    write_log(tmp_path / "a.mcap", [Written("/fmu/out/odd_1", "px4_msgs/msg/Odd", text, [(START, START, payload)])])
    (tmp_path / "logs").mkdir()
    (tmp_path / "a.mcap").rename(tmp_path / "logs" / "a.mcap")
    update(str(tmp_path / "logs"), str(tmp_path / "fleet"))
    (row,) = rows_of(tmp_path / "fleet")["odd"]
    assert (row["instance"], row["instance_"], row["log_"]) == (1, 2, 3)
    assert row["log"].startswith("a-")


@pytest.fixture
def damaged(fleet: Path) -> Path:
    name = next(name for name in parquet_in(fleet) if name.startswith("sensor_gps/"))
    path = fleet / name
    path.write_bytes(path.read_bytes()[:-40])
    return path


def test_a_damaged_file_is_named(damaged: Path, fleet: Path) -> None:
    before = parquet_in(fleet)
    with pytest.raises(
        FleetError, match=r"sensor_gps/\S+: the file is damaged .*: remove it, and `msggen log convert`"
    ):
        compact(str(fleet))
    assert {name for name in before if name.startswith(("sensor", "ulog", "vehicle"))} <= parquet_in(fleet).keys()
    damaged.unlink()
    assert len(update(str(fleet.parent / "logs"), str(fleet)).converted) == 1
    assert compact(str(fleet)).files == 6


def test_a_damaged_file_is_closed(damaged: Path) -> None:
    handles: list[IO[bytes]] = []

    def opening(_: str) -> IO[bytes]:
        handles.append(damaged.open("rb"))
        return handles[-1]

    with pytest.raises(FleetError, match="the file is damaged"):
        Files(opening).schema("a.parquet")
    assert [each.closed for each in handles] == [True]


@pytest.mark.parametrize("kind", ["nothing", "empty", "others", "file"])
def test_a_folder_that_is_no_fleet_is_left_alone(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "here"
    if kind == "file":
        path.write_text("x")
    elif kind != "nothing":
        path.mkdir()
        if kind == "others":
            (path / "a.txt").write_text("x")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FleetError, match="this is not a fleet"):
        compact(str(path))
    assert sorted(tmp_path.rglob("*")) == before


def test_a_recording_with_many_rows_has_row_groups_of_its_own(tmp_path: Path, px4_types: Any) -> None:
    (tmp_path / "logs").mkdir()
    for number, count in enumerate((20, 9000, 20)):
        write_flight(tmp_path / "logs" / f"{number}.mcap", px4_types, number, count=count)
    update(str(tmp_path / "logs"), str(tmp_path / "fleet"))
    compact(str(tmp_path / "fleet"))
    name = next(name for name in parquet_in(tmp_path / "fleet") if name.startswith("vehicle_local_position/"))
    metadata = pq.read_metadata(tmp_path / "fleet" / name)
    assert metadata.num_row_groups == 2
    told = [metadata.row_group(index).column(Keys._fields.index("log")).statistics for index in range(2)]
    assert told[1].min == told[1].max
