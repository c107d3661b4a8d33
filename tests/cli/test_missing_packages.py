"""Tests that a package which is not installed is named, with the command that installs it, and leaves no trace."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.base.missing import installing
from support.examples import by_day
from support.flights import write_flight
from support.repository import ROOT

CLI = "import sys; sys.argv[0] = 'msggen'\nfrom msggen.cli import main\nraise SystemExit(main(sys.argv[1:]))"
RECORDINGS = "recordings"
COMMANDS = {
    "info": ("log", "info", "flight.mcap"),
    "findings": ("log", "findings", "flight.mcap"),
    "show": ("log", "show", "flight.mcap", "vehicle_status", "-n", "1"),
    "csv": ("log", "show", "flight.mcap", "vehicle_status", "-n", "1", "--csv"),
    "plot": ("log", "plot", "flight.mcap", "sensor_combined.gyro_rad", "-o", "x.png"),
    "report": ("log", "report", "flight.mcap", "-o", "x.html"),
    "compare": ("log", "compare", "flight.mcap", "copy.mcap"),
    "parquet": ("log", "convert", "flight.mcap", "--format", "parquet", "-o", "made"),
    "arrow": ("log", "convert", "flight.mcap", "--format", "arrow", "-o", "made"),
    "comma": ("log", "convert", "flight.mcap", "--format", "csv", "-o", "made"),
    "mcap": ("log", "convert", "flight.mcap", "-o", "made.mcap"),
    "rosbag2": ("log", "convert", "flight.mcap", "--format", "rosbag2", "-o", "made"),
    "sqlite3": ("log", "convert", "flight.mcap", "--format", "rosbag2", "--storage", "sqlite3", "-o", "made"),
    "cut": ("log", "cut", "flight.mcap", "vehicle_status", "-o", "made.mcap"),
    "merge": ("log", "merge", "flight.mcap", "copy.mcap", "-o", "made.mcap"),
    "repair": ("log", "repair", "flight.mcap", "-o", "made.mcap"),
    "fleet": ("log", "convert", ".", "-o", "made"),
    "dask": ("log", "convert", ".", "-o", "made", "--dask", "tcp://127.0.0.1:9"),
    "compact": ("log", "compact", "."),
    "record": ("record", "--for", "1", "-o", "made.mcap", "-q"),
    "play": ("play", "flight.mcap", "--for", "0.1"),
    "topic plot": ("topic", "plot", "a.b", "--for", "1"),
    "store": ("log", "info", "http://127.0.0.1:9/flight.mcap"),
    "view": ("view", "flight.mcap"),
    "mcp": ("mcp", "."),
}
TABLES = ("parquet", "arrow", "comma", "fleet", "compact")
MCAP = ("mcap", "rosbag2", "sqlite3", "cut", "merge", "repair", "record")
MISSING = [
    ("topic plot", "plotille", "plot"),
    ("view", "numpy", "view"),
    ("view", "zstandard", "view"),
    ("view", "foxglove", "view"),
    *(("mcp", name, "mcp") for name in ("mcp", "matplotlib", "numpy", "zstandard")),
    ("store", "botocore", "stores"),
    ("dask", "distributed", "dask"),
    ("plot", "matplotlib", "plot"),
    *((name, "numpy", RECORDINGS) for name in ("info", "findings", "show", "csv", "report", "compare", *TABLES)),
    *((name, "numpy", RECORDINGS) for name in (*MCAP[:-1], "play")),
    *(
        (name, "zstandard", RECORDINGS)
        for name in ("info", "findings", "show", "report", "compare", *TABLES[:3], "cut", "play")
    ),
    *((name, "pyarrow", RECORDINGS) for name in TABLES),
    *((name, "mcap", RECORDINGS) for name in (*MCAP, "play")),
    ("store", "obstore", "stores"),
]


@pytest.fixture(scope="module")
def flight(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("flight") / "flight.mcap", px4_types, 20)


@pytest.fixture
def here(flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("flight.mcap", "copy.mcap"):
        (tmp_path / name).write_bytes(flight.read_bytes())
    return tmp_path


def without(package: str, code: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a folder as if a package were not installed."""
    program = f"import sys; sys.modules[{package!r}] = None; sys.path.insert(0, {str(ROOT)!r})\n{code}"
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.slow  # a process each
@by_day(("name", "package", "extra"), MISSING, 10)
def test_a_command_names_what_is_not_installed(name: str, package: str, extra: str, here: Path) -> None:
    before = set(here.iterdir())
    done = without(package, CLI, here, *COMMANDS[name])
    assert done.returncode == 2, done.stdout + done.stderr
    first, *_ = done.stderr.splitlines()
    assert first.startswith(f"{package}: "), first
    assert first.endswith(f" this package is not installed: {installing(extra)}")
    assert set(here.iterdir()) == before


OPENED = "from msggen import recordings\nlog = recordings.open('flight.mcap')\n"
CONVERTED = "from msggen.exports.convert import convert\nconvert(log, 'made.x', format="
FLEET = "from msggen.exports.fleet import {0}\n{0}('.', 'made')"
PANDAS, POLARS = f"{RECORDINGS} pandas", f"{RECORDINGS} polars"
CALLS = [
    ("log.frame('vehicle_status')", "pandas", PANDAS),
    ("log.frame('vehicle_status', 'polars')", "polars", POLARS),
    ("log.frame('vehicle_status', 'polars')", "pyarrow", RECORDINGS),
    ("next(iter(log.frames()))", "pandas", PANDAS),
    ("log.align('vehicle_status', 'sensor_combined', tolerance=9).frame()", "pandas", PANDAS),
    ("log.samples('vehicle_status').frame('polars')", "polars", POLARS),
    ("log.align('vehicle_status', 'sensor_combined', tolerance=9).frame('polars')", "polars", POLARS),
    ("log.align('vehicle_status', 'sensor_combined', tolerance=9).table()", "pyarrow", RECORDINGS),
    ("log.table('vehicle_status')", "pyarrow", RECORDINGS),
    ("next(iter(log.tables()))", "pyarrow", RECORDINGS),
    (f"{CONVERTED}'parquet')", "pyarrow", RECORDINGS),
    (f"{CONVERTED}'csv')", "pyarrow", RECORDINGS),
    (f"{CONVERTED}'mcap')", "mcap", RECORDINGS),
    (f"{CONVERTED}'rosbag2')", "mcap", RECORDINGS),
    ("recordings.plot.draw(log, ['sensor_combined.gyro_rad'])", "matplotlib", "plot"),
    ("recordings.open('http://127.0.0.1:9/flight.mcap')", "obstore", "stores"),
    (FLEET.format("update"), "pyarrow", RECORDINGS),
    ("from msggen.exports.fleet import pools\nnext(pools.on_client([], None))", "distributed", "dask"),
]


@pytest.mark.slow  # a process each
@by_day(("call", "package", "arguments"), CALLS, 5)
def test_a_function_names_what_is_not_installed(call: str, package: str, arguments: str, here: Path) -> None:
    done = without(package, OPENED + call, here)
    expected = f"ModuleNotFoundError: the package {package} is not installed: {installing(*arguments.split())}"
    assert done.stderr.splitlines()[-1:] == [expected]
