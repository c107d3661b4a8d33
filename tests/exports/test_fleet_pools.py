"""Tests of the pools that convert a fleet, and of runs that are interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from msggen.exports.fleet import Batch, Summary, pools, run, update
from support.fleet_recordings import rows_of, state_names, write_flight, write_folder
from support.fleet_tasks import convert_or_die
from support.repository import ROOT


@pytest.fixture
def logs(tmp_path: Path, px4_types: Any) -> Path:
    return write_folder(tmp_path / "logs", px4_types)


@pytest.fixture(params=["processes", "dask"])
def pool(request: pytest.FixtureRequest) -> Iterator[Callable[..., Iterator[Batch]]]:
    if request.param == "processes":
        yield run.pool_of(2)
        return
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp"
    )
    with cluster:
        yield run.pool_of(1, cluster.scheduler_address)


def contents(summary: Summary) -> list[dict[str, Any]]:
    return [each._asdict() for each in summary.converted]


@pytest.mark.night  # the tests below have processes, and those of `log convert` a scheduler
def test_pools_do_the_same(logs: Path, tmp_path: Path, pool: Callable[..., Iterator[Batch]]) -> None:
    (logs / "bad.mcap").write_bytes(b"bad")
    expected = update(str(logs), str(tmp_path / "one"))
    found = update(str(logs), str(tmp_path / "two"), pool=pool)
    assert contents(found) == contents(expected)
    assert found.document() == expected.document()
    assert rows_of(tmp_path / "two") == rows_of(tmp_path / "one")


@pytest.mark.night  # imports much for an error of another package
def test_no_scheduler_of_dask(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(pools, "_PATIENCE", 0.2)
    with pytest.raises(OSError, match="tcp:"):
        update(str(logs), str(tmp_path / "fleet"), pool=run.pool_of(1, "tcp://127.0.0.1:9"))


@pytest.mark.slow  # processes that start, and start again
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_process_that_is_killed_costs_one_recording(
    logs: Path, tmp_path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_flight(logs / "b" / "deadly.mcap", px4_types, 4)
    monkeypatch.setattr(pools, "convert_batch", convert_or_die)
    summary = update(str(logs), str(tmp_path / "fleet"), pool=run.pool_of(2))
    assert [(os.path.basename(each.path), each.error) for each in summary.failed] == [
        ("deadly.mcap", "the process that converted it was killed")
    ]
    assert len(summary.converted) == 3


PROGRAM = """
import sys
from msggen.exports.fleet import planning, run, update
planning._MOST = 2
if __name__ == "__main__":
    print("begins", flush=True)
    update(sys.argv[1], sys.argv[2], pool=run.pool_of(2))
"""


@pytest.mark.night  # by day, runs are interrupted in one process
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_interrupted_runs_leave_whole_files_and_the_next_one_goes_on(
    number: signal.Signals, tmp_path: Path, px4_types: Any
) -> None:
    logs, fleet = tmp_path / "logs", tmp_path / "fleet"
    logs.mkdir()
    for index in range(8):
        write_flight(logs / f"{index}.mcap", px4_types, index, count=200)
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, str(program), str(logs), str(fleet)],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()
    end = time.monotonic() + 60
    listed = fleet / "_logs.parquet"
    while not (listed.exists() and pq.read_metadata(listed).num_rows) and time.monotonic() < end:
        time.sleep(0.01)
    process.send_signal(number)
    process.stdout.read()  # until all processes have ended
    assert process.wait(60) != 0
    for path in fleet.glob("v*/*.parquet"):
        assert pq.read_metadata(path).num_rows % 200 == 0
    summary = update(str(logs), str(fleet))
    assert summary.unchanged >= 1
    assert summary.unchanged + len(summary.converted) == 8
    update(str(logs), str(tmp_path / "whole"))
    assert rows_of(fleet) == rows_of(tmp_path / "whole")
    assert state_names(fleet) == ["report.json"]
