"""Tests of `msggen log convert` with a folder of recordings."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import zstandard

from msggen.base.exit_codes import DONE, FAILED, FINDINGS, INTERRUPTED
from msggen.cli import main
from msggen.cli.source_options import is_recording
from msggen.exports.fleet.fleet import with_files
from support.commands import exit_code
from support.fleet_logs import VEHICLES, write_logs
from support.fleet_recordings import logs_in, rows_of, write_flight

SUMMARY = """\
fleet: 6 recordings converted in S s, 1,631 samples in 6 files, N kB
       1 with parts that cannot be read
       1 that cannot be read
vehicles: px4-00060000000033343531303437, px4-00060000000037363231353530, px4-0006000000003832393034313a
dates: 2026-11-20, 2026-11-21, unknown
dates are from: GPS (4), the name (1), nowhere (1)
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path / "logs")
    return tmp_path


def run(*words: str) -> int:
    return exit_code(["log", "convert", *words])


def without_figures(text: str) -> str:
    """Return a summary without the time and the size, which are not the same everywhere."""
    first, _, rest = text.partition("\n")
    words = first.split(" ")
    words[words.index("in") + 1], words[-2] = "S", "N"
    return " ".join(words) + "\n" + rest


def test_a_folder_becomes_a_fleet(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("logs", "--jobs", "1") == FINDINGS
    told = capsys.readouterr()
    assert without_figures(told.out) == SUMMARY
    assert told.err == (
        "logs/2026-11-21/notes.ulg: not a recording: expected an MCAP file, a ULog or a database of rosbag2\n"
        "logs/2026-11-21/16_20_55.ulg: the file is cut off or damaged (at byte 3977)\n"
    ).replace("/", str(Path("/"))[-1])
    assert {path.name for path in (here / "fleet").iterdir()} == {
        "_logs.parquet", "_msggen", "battery_status", "findings", "sensor_gps", "ulog_parameters",
        "vehicle_local_position", "vehicle_status",
    }  # fmt: skip
    rows = rows_of(here / "fleet")["battery_status"]
    assert {row["vehicle"] for row in rows} == {f"px4-{vehicle}" for vehicle in VEHICLES}
    assert {row["instance"] for row in rows} == {0, 1}


def test_the_second_run_has_nothing_to_do(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "logs" / "2026-11-21" / "notes.ulg").unlink()
    assert run("logs", "-o", "made", "--jobs", "1", "-q") == FINDINGS  # a file is cut
    assert capsys.readouterr().out == ""
    assert run("logs", "-o", "made", "--jobs", "1") == FINDINGS
    told = capsys.readouterr()
    assert told.err.endswith("16_20_55.ulg: the file is cut off or damaged (at byte 3977)\n")
    assert told.out.startswith(
        "made: nothing new\n       6 converted before\n       1 with parts that cannot be read\nvehicles: px4-"
    )


def test_names_are_printed_up_to_a_number(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(25):
        (here / "logs" / f"bad_{number:02}.ulg").write_bytes(b"bad")
    whole = here / "logs" / "2026-11-20" / "10_31_40.ulg"
    (here / "logs" / "copy.ulg").write_bytes(whole.read_bytes())
    assert run("logs", "--jobs", "1") == FINDINGS
    told = capsys.readouterr().err.splitlines()
    assert sum("bad_" in line for line in told) <= 20
    assert told[20] == f"and 6 more: see {Path('fleet', '_msggen', 'report.json')}"
    assert told[-1] == f"{Path('logs', 'copy.ulg')}: has the contents of {whole.relative_to(here)}"


def test_ctrl_c_tells_how_to_go_on(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("msggen.exports.convert.tables.write_tables", interrupt)
        assert run("logs", "--jobs", "1") == INTERRUPTED
    assert "the same command goes on where this run was interrupted\n" in capsys.readouterr().err
    assert run("logs", "--jobs", "1") == FINDINGS
    assert capsys.readouterr().out.startswith("fleet: 6 recordings converted")


def test_of_two_runs_one_ends_with_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("logs/hangar", "--jobs", "1", "-q") == DONE

    def other(*arguments: Any) -> Any:
        patch.undo()
        assert run("logs", "--jobs", "1", "-q") == FINDINGS
        return with_files(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("msggen.exports.fleet.run.with_files", other)
        assert run("logs", "--jobs", "1", "-q") == FAILED
    last = capsys.readouterr().err.splitlines()[-2:]
    assert re.fullmatch(
        r"fleet: R150 another run \([0-9a-f]{8}, process \d+ on .*\) has changed this fleet: .*", last[0]
    )
    assert last[1] == "1 error"
    assert run("logs", "--jobs", "1", "--json") == FINDINGS
    assert json.loads(capsys.readouterr().out)["unchanged"] == 6


def test_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("logs", "--json", "--by", "date", "--jobs", "1") == FINDINGS
    told = capsys.readouterr()
    assert told.err == ""
    document = json.loads(told.out)
    assert document == json.loads((here / "fleet" / "_msggen" / "report.json").read_text())
    assert (document["found"], document["converted"], document["rows"], document["files"]) == (7, 6, 1631, 6)
    assert [each["path"] for each in document["failed"]] == [str(here / "logs" / "2026-11-21" / "notes.ulg")]
    assert [Path(each["path"]).name for each in document["incomplete"]] == ["16_20_55.ulg"]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["logs", "--by", "pilot"], "argument --by: expected vehicle and date or one of them, found 'pilot'"),
        (["logs", "--by", "date,date"], "argument --by: expected"),
        (["logs", "--jobs", "0"], "argument --jobs: expected a number from 1 to 1024, found '0'"),
        (["logs", "--jobs", "2", "--dask", "tcp://127.0.0.1:9"], "argument --jobs: the cluster of --dask has its own"),
        (["logs", "battery_status"], "argument TOPIC: a folder of recordings becomes Parquet as a whole: leave it out"),
        (
            ["logs", "--format", "csv"],
            "argument --format: a folder of recordings becomes Parquet as a whole: leave it out",
        ),
        (["logs", "-o", "all.parquet"], "argument -o/--output: a folder is written: -o all\n"),
        (["empty"], "empty: R150 there is no recording in this folder"),
        (["logs", "-o", "fleet_of_dates"], "fleet_of_dates: R150 this fleet is by 'date', not by 'vehicle,date'"),
    ],
)
def test_errors(words: Sequence[str], error: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "empty").mkdir()
    if "fleet_of_dates" in words:
        assert run("logs/hangar", "-o", "fleet_of_dates", "--by", "date", "--jobs", "1", "-q") == DONE
    assert run(*words) == FAILED
    assert error in capsys.readouterr().err
    assert not (here / "fleet").exists()


def test_the_workers_of_a_scheduler_convert(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp"
    )
    with cluster:
        assert run("logs", "--dask", cluster.scheduler_address) == FINDINGS
        told = capsys.readouterr()
        assert without_figures(told.out) == SUMMARY
        assert len(told.err.splitlines()) == 2
        assert run("logs", "--dask", cluster.scheduler_address) == FINDINGS
        assert capsys.readouterr().out.startswith("fleet: nothing new\n       6 converted before\n")
    assert run("logs", "-o", "alone", "--jobs", "1", "-q") == FINDINGS
    assert rows_of(here / "fleet") == rows_of(here / "alone")


def test_a_bag_without_metadata_is_one_recording_for_every_action(
    here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = here / "flight"
    bag.mkdir()
    for number in range(2):
        write_flight(bag / f"flight_{number}.mcap", px4_types, number)
    assert is_recording("flight")
    assert not is_recording("logs")
    problem = "metadata.yaml is missing: the files are read in the order of their names\n"
    assert run("flight", "-o", "tables") == FINDINGS
    assert capsys.readouterr().err == f"flight: {problem}"
    assert sorted(os.listdir("tables")) == ["vehicle_gps_position.parquet", "vehicle_local_position.parquet"]
    for words in ("cut flight --stop 9 -o cut.mcap", "repair flight -o repaired.mcap", "info flight"):
        assert main(["log", *words.split()]) in (DONE, FINDINGS)
        told = capsys.readouterr()
        assert problem in told.out + told.err
    assert run(".", "--jobs", "1", "-q") == FINDINGS
    rows = {row["path"]: row["samples"] for row in pq.read_table("fleet/_logs.parquet").to_pylist()}
    assert rows[str(bag)] == 200


def test_names_of_outputs(here: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    write_flight(here / "first.mcap", px4_types, 1)
    (here / "small.mcap.zstd").write_bytes(zstandard.compress((here / "first.mcap").read_bytes()))
    assert run("first.mcap", "--format", "rosbag2", "-o", "b", "-q") == DONE
    (here / "2026.11.22").mkdir()
    for path in (here / "b").iterdir():
        (here / "2026.11.22" / path.name.replace("b_0", "2026.11.22_0")).write_bytes(path.read_bytes())
    (here / "2026.11.22" / "metadata.yaml").unlink()
    (here / "first.mcap").unlink()
    for recording, name in (
        ("small.mcap.zstd", "small"),
        ("small.mcap.zstd", "small.mcap"),
        ("b", "b_parquet"),
        ("b/", "b_csv"),
        ("b", "b_rosbag2"),
        ("b", "b.mcap"),
        ("2026.11.22", "2026.11.22_parquet"),
        ("2026.11.22", "2026.11.22.mcap"),
    ):
        format_ = name.partition("_")[2] or ("mcap" if name.endswith(".mcap") else "parquet")
        capsys.readouterr()
        run(recording, "--format", format_, "--json")
        assert json.loads(capsys.readouterr().out).get("output") == name
        assert (here / name).exists()
    assert (here / "b_rosbag2" / "b_rosbag2_0.mcap").exists()
    (here / "dots").mkdir()
    write_flight(here / "dots" / "10.02.11.mcap", px4_types, 1)
    assert run("dots", "--jobs", "1", "-q") == DONE
    assert [name.rpartition("-")[0] for name in logs_in(here / "fleet")] == ["10.02.11"]


def compact(*words: str) -> int:
    return exit_code(["log", "compact", *words])


def test_small_files_become_large_ones(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("logs/2026-11-20", "logs/hangar"):
        assert run(folder, "--jobs", "1", "-q") == DONE
    expected = rows_of(here / "fleet")
    capsys.readouterr()
    assert compact("fleet", "--json") == DONE
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert (document["topics"], document["files_before"], document["files"], told.err) == (6, 12, 6, "")
    assert rows_of(here / "fleet") == expected
    assert compact("fleet") == DONE
    assert capsys.readouterr().out.startswith("fleet: nothing to do: 6 files, ")
    assert compact("fleet", "-q") == DONE
    assert capsys.readouterr().out == ""
    assert run("logs", "--jobs", "1", "-q") == FINDINGS
    capsys.readouterr()
    assert compact("fleet") == DONE
    assert re.fullmatch(r"fleet: 12 files, [\d.]+ kB, became 6 files, [\d.]+ kB\n", capsys.readouterr().out)


def test_what_cannot_be_compacted_is_named(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compact("logs") == FAILED
    assert capsys.readouterr().err.startswith("logs: R150 this is not a fleet: name a folder that `msggen log convert ")
    for folder in ("logs/2026-11-20", "logs/hangar"):
        assert run(folder, "--jobs", "1", "-q") == DONE
    path = next((here / "fleet" / "sensor_gps").iterdir())
    path.write_bytes(b"PAR1")
    assert compact("fleet") == FAILED
    told = capsys.readouterr().err
    assert told.startswith(f"fleet: R150 sensor_gps/{path.name}: the file is damaged (")
    assert told.endswith("): remove it, and `msggen log convert` converts its recordings again\n1 error\n")
