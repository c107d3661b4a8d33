"""Tests that the benchmarks compare like with like, give a reason where they cannot, and run from a fresh clone."""

from __future__ import annotations

import functools
import gc
import re
import shutil
import subprocess
import sys
import timeit
from collections.abc import Callable, Iterable
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import pytest

import environment
import generation
import memory
import tables
from codec import Speeds, enter_all, measure
from contest import enter, evaluate, execute, plain_message
from effort import QUICK
from goals import LEAST, MOST, Goal, summary
from messages import MESSAGES, Sample, read_samples
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from page import Section, page, printed
from peers import FLOOR, OURS, PEERS, CannotError, Peer
from rounds import Contestant, race, race_processes
from support.repository import ROOT


@pytest.fixture(scope="module")
def samples() -> dict[str, Sample]:
    return {sample.name: sample for sample in read_samples()}


# --- Timing


def test_contestants_take_turns() -> None:
    seen: list[str] = []
    names = {"append": seen.append}
    race({"a": Contestant("append('a')", names), "b": Contestant("append('b')", names)}, rounds=5, turn=1e-9)
    assert re.fullmatch("a+b+(ab){5}", "".join(seen))


def test_the_garbage_collector_is_on_while_statements_run() -> None:
    states: list[bool] = []
    names = {"append": states.append, "is_enabled": gc.isenabled}
    race({"only": Contestant("append(is_enabled())", names)}, rounds=3, turn=1e-9)
    assert set(states) == {True}


def test_the_least_time_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, work = clockwork([0.05, 0.05, 0.05, 0.02, 0.01, 0.03], monkeypatch)
    assert race({"only": Contestant("work()", {"work": work})}, rounds=3, turn=0.001) == {"only": pytest.approx(0.01)}
    assert len(calls) == 6


def test_a_slow_first_call_makes_no_turn_shorter(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, work = clockwork(chain([1.0], repeat(0.001)), monkeypatch)
    race({"only": Contestant("work()", {"work": work})}, rounds=3, turn=0.1)
    assert len(calls) > 3 * 99


def clockwork(took: Iterable[float], monkeypatch: pytest.MonkeyPatch) -> tuple[list[float], Callable[[], None]]:
    """Replace the clock by one that advances only in `work`, by the times in `took`; return its calls and `work`."""
    times = iter(took)
    calls: list[float] = []

    def work() -> None:
        calls.append(next(times))

    monkeypatch.setattr("rounds.Timer", functools.partial(timeit.Timer, timer=lambda: sum(calls)))
    return calls, work


def test_processes_run_once_to_warm_up_and_may_begin_anew_in_each_round(tmp_path: Path) -> None:
    program = f"open({str(tmp_path / 'round_ROUND')!r}, 'x')"
    assert race_processes({"writes": [sys.executable, "-c", program]}, rounds=2).keys() == {"writes"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["round_0", "round_1", "round_2"]


# --- Measured programs


@pytest.mark.parametrize("name", MESSAGES)
def test_a_sample_is_what_the_firmware_writes_with_finite_values(name: str, samples: dict[str, Sample]) -> None:
    names = program_run(OURS, samples[name])
    decoded = evaluate(OURS.decode, names)
    assert decoded.encode() == samples[name].payload
    values = str(plain_message(samples[name], samples[name].message, decoded, signed_char=False))
    assert not re.search(r"\b(nan|inf)\b", values)


def test_varied_samples_differ_in_nothing_but_the_timestamp(samples: dict[str, Sample]) -> None:
    one, other = samples["EscStatus"].varied(2)
    first = evaluate(OURS.decode, {**program_run(OURS, samples["EscStatus"]), "data": one})
    second = evaluate(OURS.decode, {**program_run(OURS, samples["EscStatus"]), "data": other})
    assert second.timestamp == first.timestamp + 1
    second.timestamp = first.timestamp
    assert second == first


def test_definitions_carry_what_they_nest(samples: dict[str, Sample]) -> None:
    assert "EscReport[12] esc\n" in samples["EscStatus"].definition()
    assert "\nMSG: px4_msgs/EscReport\nuint64 timestamp\n" in samples["EscStatus"].definition()


def program_run(peer: Peer, sample: Sample) -> dict[str, Any]:
    """Return the names that a peer's program defines."""
    names: dict[str, Any] = {"__name__": "contest", "data": sample.payload}
    execute(peer.program(sample), names)
    return names


# --- Peers


class Shifted(Peer):
    """A peer that decodes a wrong value or encodes wrong bytes."""

    name = "shifted"

    def __init__(self, *, decodes: int, encodes: bytes) -> None:
        self.lines = f"def decode(data):\n  m = Type.decode(data)\n  m.gyro_integral_dt += {decodes}\n  return m\n"
        self.lines += f"def encode(message): return message.encode() + {encodes!r}\n"

    def program(self, sample: Sample) -> str:
        return OURS.program(sample) + self.lines


class Missing(Peer):
    """A peer that is not installed."""

    name = "missing"

    def program(self, sample: Sample) -> str:
        return f"from a_module_that_nobody_has import {sample.name}\n"


class Unable(Peer):
    """A peer that cannot declare any message."""

    name = "unable"

    def program(self, sample: Sample) -> str:
        raise CannotError(f"has no {sample.name}")


def test_a_peer_whose_results_are_right_takes_part(samples: dict[str, Sample]) -> None:
    padded = Shifted(decodes=0, encodes=bytes(3))
    assert all(isinstance(part, Contestant) for part in enter(padded, samples["SensorCombined"]))


@pytest.mark.parametrize(
    ("peer", "decode", "encode"),
    [
        (Shifted(decodes=1, encodes=b""), "decodes gyro_integral_dt", "decodes gyro_integral_dt"),
        (Shifted(decodes=0, encodes=bytes(4)), "", "encodes other bytes"),
        (Missing(), "is not installed", "is not installed"),
        (Unable(), "has no SensorCombined", "has no SensorCombined"),
    ],
)
def test_a_peer_that_cannot_takes_no_part_and_the_reason_is_kept(
    peer: Peer, decode: str, encode: str, samples: dict[str, Sample]
) -> None:
    entry = enter(peer, samples["SensorCombined"])
    for found, expected in zip(entry, (decode, encode), strict=True):
        assert (expected in found) if isinstance(found, str) else not expected


def test_ours_and_the_floor_take_part_in_everything(samples: dict[str, Sample]) -> None:
    entries = enter_all(list(samples.values()), (OURS, FLOOR))
    for direction in ("decode", "encode"):
        speeds = measure(entries, direction, QUICK._replace(rounds=1, turn=1e-9))
        assert speeds.missing == {}
        assert all(times.keys() == {OURS.name, FLOOR.name} for times in speeds.times.values())


@pytest.mark.parametrize("name", MESSAGES)
@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_every_peers_program_is_python_and_names_every_field(peer: Peer, name: str, samples: dict[str, Sample]) -> None:
    try:
        program = peer.program(samples[name])
    except CannotError:
        assert (peer.name, name) == ("cydr", "EscStatus")
        return
    compile(program, peer.name, "exec")
    assert all(field.name in program for field in samples[name].message.fields)


# --- Columns, memory, generation


@pytest.mark.parametrize("name", MESSAGES)
def test_the_loop_fills_the_columns_of_the_batch(name: str, samples: dict[str, Sample]) -> None:
    columns = pytest.importorskip("columns", reason="needs numpy")
    entries = enter_all([samples[name]], (OURS, FLOOR, *PEERS))
    speeds = columns.measure_columns([samples[name]], entries, QUICK._replace(payloads=20, rounds=1, turn=1e-9))
    assert {columns.LOOP, columns.FIELDS, OURS.name} <= speeds.times[name].keys()


def test_columns_that_differ_are_found() -> None:
    columns = pytest.importorskip("columns", reason="needs numpy")
    numpy = pytest.importorskip("numpy")
    expected = {"timestamp": numpy.arange(3, dtype="u8"), "x": numpy.arange(3, dtype="f4")}
    columns.check_columns({name: column[:2] for name, column in expected.items()}, expected)
    with pytest.raises(ValueError, match="another column x"):
        columns.check_columns({**expected, "x": expected["x"] + 1}, expected)
    with pytest.raises(ValueError, match="other columns"):
        columns.check_columns({"x": expected["x"]}, expected)


@pytest.mark.slow
def test_memory_is_that_of_one_kept_object() -> None:
    size = memory.size_of(Contestant("bytes(1000)", {}), [b""] * 50)
    assert sys.getsizeof(bytes(1000)) <= size < 1.1 * sys.getsizeof(bytes(1000))


@pytest.mark.slow
def test_copies_of_the_set_are_as_many_messages_that_fit_together(tmp_path: Path, samples: dict[str, Sample]) -> None:
    catalog = samples["EscStatus"].catalog
    assert generation.write_copies(tmp_path / "copies", catalog, 2) == 2 * 259
    copies = read_catalog(find_sources(None, (str(tmp_path / "copies"),)))
    assert len(copies.messages) == 2 * 259
    esc = copies.messages["px4_msgs/EscStatusCopy1"].fields[-1]
    assert esc.type.name == "EscReportCopy1"


# --- Output


SPEEDS = Speeds(
    {
        "GpsDump": {OURS.name: 1e-6, FLOOR.name: 5e-7, "rosbags": 4e-6, "cydr": 2e-6},
        "EscStatus": {OURS.name: 1e-6, FLOOR.name: 5e-7, "rosbags": 9e-6},
    },
    {("EscStatus", "cydr"): "has no arrays of messages"},
)


def codec_table(samples: dict[str, Sample]) -> tables.Table:
    return tables.codec_table("decode", [samples["GpsDump"], samples["EscStatus"]], SPEEDS)


def test_means_are_geometric_and_over_what_there_is() -> None:
    assert SPEEDS.mean("rosbags") == pytest.approx(6)
    assert SPEEDS.mean("cydr") == pytest.approx(2)
    assert SPEEDS.mean("nobody") == 0


def test_a_missing_number_is_a_dash_with_its_reason_below(samples: dict[str, Sample]) -> None:
    shown = codec_table(samples).markdown()
    row = next(line for line in shown.splitlines() if line.startswith("| EscStatus"))
    assert row.endswith(f"{tables.NONE} |")
    assert "cydr has no arrays of messages: EscStatus." in shown
    assert "cydr has no arrays of messages: EscStatus." in printed(codec_table(samples))


def test_rows_of_a_table_are_as_wide_as_its_head(samples: dict[str, Sample]) -> None:
    lines = [line for line in codec_table(samples).markdown().splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1
    assert "**6.0x**" in lines[-1]


@pytest.mark.parametrize(
    ("bound", "measured", "word"), [(LEAST, 7.0, ""), (LEAST, 5.9, "missed"), (MOST, 5.9, ""), (MOST, 7.0, "missed")]
)
def test_a_goal_that_is_missed_is_called_so(bound: str, measured: float, word: str) -> None:
    (row,) = summary([Goal("decode, against rosbags", bound, 6, "x", measured)]).rows
    assert row == ["decode, against rosbags", f"{bound} 6x", f"{measured:.3g}x", word]


def test_a_goal_about_a_peer_that_is_missing_is_not_shown() -> None:
    assert summary([Goal("decode, against rosbags", LEAST, 6, "x", 0)]).rows == []


def test_the_page_has_command_date_versions_tables_and_charts(samples: dict[str, Sample]) -> None:
    short = summary([Goal("decode, against rosbags", LEAST, 6, "x", 6.5)])
    text = page(short, [Section("Decode", [codec_table(samples)], "codec", "what it shows")])
    assert "```console\n$ python benchmarks/run.py\n" in text
    assert re.search(r"Last run: \d{4}-\d\d-\d\d, on .+ cores, CPython 3\.\d+", text)
    assert all(f"{peer.name} {peer.version() or tables.NONE}" in text for peer in PEERS)
    assert "![what it shows](benchmarks/codec.svg)" in text
    rows = codec_table(samples).markdown().splitlines()
    assert [row.split()[1] for row in rows if row not in text.splitlines()] == ["GpsDump"], "it has a few messages only"


def test_charts_are_the_same_for_the_same_numbers() -> None:
    pytest.importorskip("matplotlib")
    charts = pytest.importorskip("charts")
    drawn = charts.codec_chart(SPEEDS, SPEEDS)
    assert drawn == charts.codec_chart(SPEEDS, SPEEDS)
    assert ">rosbags</text>" in drawn
    assert "dc:date" not in drawn


@pytest.mark.parametrize(("is_terminal", "line"), [(True, "│ rosbags │  4 │"), (False, "| rosbags | 4 |")])
def test_a_table_is_drawn_in_a_terminal_and_markdown_elsewhere(
    is_terminal: bool,  # noqa: FBT001 - a parameter of the test
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: is_terminal)
    tables.Table("decode", ["reader", "ms"], [["rosbags", "4"]]).print()
    assert line in capsys.readouterr().out


def test_readers_of_recordings_that_are_not_installed_are_named(tmp_path: Path) -> None:
    recordings = pytest.importorskip("recordings", reason="needs mcap and numpy")

    def absent(_path: str) -> None:
        raise ModuleNotFoundError("a_module_that_nobody_has")

    present = (recordings.FLOOR, "msggen, structured arrays")
    readers = {name: recordings.ON_MCAP[name] for name in present}
    table = recordings.mcap_table(
        str(tmp_path), recordings.flight(1), 1, {**readers, "absent, messages": (absent, False)}
    )
    assert [row[0] for row in table.rows] == list(present)
    assert table.notes[-1] == "absent is not installed"


# --- Environment


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """Put the environment into a temporary folder and replace pip; return the calls of pip."""
    calls: list[tuple[str, ...]] = []
    requirements = tmp_path / "requirements.txt"
    requirements.write_text("# peers\nrosbags==1\n\ncydr==2\n")
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "FOLDER", tmp_path / ".venv")
    monkeypatch.setattr(environment, "STAMP", tmp_path / ".venv" / "requirements.txt")
    monkeypatch.setattr(environment, "REQUIREMENTS", requirements)
    monkeypatch.setattr("venv.create", lambda folder, **_options: Path(folder).mkdir(exist_ok=True))

    def install(*arguments: str) -> bool:
        calls.append(arguments)
        return "--requirement" not in arguments and "cydr==2" not in arguments

    monkeypatch.setattr(environment, "install", install)
    return calls


def test_a_peer_that_cannot_be_installed_stops_no_other(
    elsewhere: list[tuple[str, ...]], capsys: pytest.CaptureFixture[str]
) -> None:
    environment.environment()
    assert elsewhere[2:] == [("rosbags==1",), ("cydr==2",)]
    assert "not installed: cydr==2" in capsys.readouterr().out
    environment.environment()
    assert len(elsewhere) == 8, "the next run tries again"


def test_the_environment_is_kept_until_requirements_change(
    elsewhere: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def install(*arguments: str) -> bool:
        elsewhere.append(arguments)
        return True

    monkeypatch.setattr(environment, "install", install)
    environment.environment()
    environment.environment()
    assert len(elsewhere) == 1
    environment.REQUIREMENTS.write_text("rosbags==2\n")
    environment.environment()
    assert len(elsewhere) == 2


# --- Complete run


TREE = ("benchmarks", "generated", "msg", "msggen", "releases", "srv", "templates", "tests/vectors")
FILES = ("LICENSE", "README.md", "dds_topics.yaml", "zenoh_topics.yaml", "pyproject.toml")


@pytest.mark.night
@pytest.mark.timeout(900)
def test_the_command_runs_from_nothing_and_a_quick_run_writes_nothing(tmp_path: Path) -> None:
    """As on a fresh clone, with the peers from the package index."""
    for name in TREE:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns(".venv*", "__pycache__"))
    for name in FILES:
        shutil.copy(ROOT / name, tmp_path / name)
    command = [sys.executable, "benchmarks/run.py", "--quick"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [peer.name for peer in PEERS if f"{peer.name} is not installed" in done.stdout] == []
    assert "cydr has no arrays of messages: EscStatus" in done.stdout
    rows = [line for line in done.stdout.splitlines() if re.match(r"│ (SensorCombined|EscStatus) ", line)]
    assert len(rows) == 2 * 6, "two messages in six tables"
    assert sum(line.count(tables.NONE) for line in rows) == 4, "cydr's, for decode, encode, columns and memory"
    assert not (tmp_path / "docs").exists()
