"""Tests of the findings in many recordings: lines of JSON that a run goes on with, and the table of a fleet."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import duckdb
import pytest

from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from msggen.cli import main
from msggen.exports.fleet import batch, examining, update
from support.fleet_stores import Bucket
from support.written import write_recording

pytest_plugins = ["support.fleet_fixtures"]


@pytest.fixture
def flights(tmp_path: Path, px4_types: Any) -> Path:
    """Return a folder with three flights, a copy, a cut one, and a file that is none."""
    folder = tmp_path / "flights"
    (folder / "deep").mkdir(parents=True)
    for name, load in (("a", 0.4), ("b", 0.97), ("deep/c", 0.99)):
        samples = [("/fmu/out/cpuload", step / 10, px4_types.Cpuload(load=load)) for step in range(50)]
        write_recording(folder / f"{name}.mcap", samples)
    content = (folder / "b.mcap").read_bytes()
    (folder / "copy.mcap").write_bytes(content)
    (folder / "cut.mcap").write_bytes(content[: len(content) // 2])
    (folder / "text.ulg").write_text("none")
    return folder


def lines_of(path: Path) -> dict[str, Any]:
    found = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {os.path.relpath(each["recording"], path.parent / "flights").replace(os.sep, "/"): each for each in found}


def rules_in(line: Any) -> list[str]:
    return [each["rule"] for each in line["findings"]]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_each_recording_is_a_line(jobs: str, flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", str(flights), "-o", str(output), "--jobs", jobs]
    assert main(words) == FINDINGS
    assert "6 recordings, 1 of them known already, " in capsys.readouterr().out
    found = lines_of(output)
    copied = {"b.mcap", "copy.mcap"} & found.keys()
    assert len(copied) == 1
    assert found.keys() - copied == {"a.mcap", "deep/c.mcap", "cut.mcap", "text.ulg"}
    assert rules_in(found["a.mcap"]) == []
    assert rules_in(found["deep/c.mcap"]) == rules_in(found[copied.pop()]) == ["CPU_LOAD_HIGH"]
    assert rules_in(found["cut.mcap"])[0] == "LOG_DAMAGED"
    assert found["cut.mcap"]["problems"]
    assert "is not a recording" in found["text.ulg"]["error"]
    before = output.read_bytes()
    assert main(words) == FINDINGS
    assert output.read_bytes() == before


def test_a_run_goes_on_where_another_one_was_killed(
    flights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", str(flights), "-o", str(output), "--jobs", "1"]
    main(words)
    whole, expected = output.read_bytes(), lines_of(output)
    examined: list[str] = []
    real = examining.examine

    def counting(path: str) -> dict[str, Any]:
        examined.append(path)
        return real(path)

    monkeypatch.setattr(examining, "examine", counting)
    for place in range(0, len(whole), 997):
        output.write_bytes(whole[:place])
        examined.clear()
        assert main(words) == FINDINGS
        assert lines_of(output) == expected
        assert len(examined) == len(expected) - whole[:place].count(b"\n")


def test_a_changed_recording_is_examined_again_and_a_moved_one_is_not(
    flights: Path, tmp_path: Path, px4_types: Any
) -> None:
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", str(flights), "-o", str(output), "--jobs", "1"]
    main(words)
    count = output.read_bytes().count(b"\n")
    (flights / "deep" / "c.mcap").rename(flights / "moved.mcap")
    main(words)
    assert output.read_bytes().count(b"\n") == count
    (flights / "a.mcap").unlink()
    load = [("/fmu/out/cpuload", step / 10, px4_types.Cpuload(load=0.98)) for step in range(60)]
    write_recording(flights / "a.mcap", load)
    main(words)
    assert output.read_bytes().count(b"\n") == count + 1
    assert rules_in(lines_of(output)["a.mcap"]) == ["CPU_LOAD_HIGH"]


@pytest.mark.skipif(os.name == "nt", reason="needs links")
def test_what_cannot_be_opened_is_told_once(flights: Path, tmp_path: Path) -> None:
    (flights / "gone.ulg").symlink_to(flights / "missing.ulg")
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", str(flights), "-o", str(output), "--jobs", "1"]
    assert main(words) == FINDINGS
    before = output.read_bytes()
    assert b"a link to a missing file" in before
    assert main(words) == FINDINGS
    assert output.read_bytes() == before


@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_a_killed_run_leaves_lines(flights: Path, tmp_path: Path, px4_types: Any) -> None:
    for number in range(100):
        load = [("/fmu/out/cpuload", 0.0, px4_types.Cpuload(load=number / 100))]
        write_recording(flights / f"more-{number}.mcap", load)
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", str(flights), "-o", str(output), "--jobs", "1"]
    with subprocess.Popen([sys.executable, "-m", "msggen", *words]) as process:
        while not output.exists() or output.stat().st_size < 2000:
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    before = output.read_bytes()
    main(words)
    kept = before[: before.rfind(b"\n") + 1]
    assert output.read_bytes().startswith(kept)
    assert len(lines_of(output)) == 105


def test_text_and_lines_on_stdout(flights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "findings", str(flights), "--jobs", "1"]) == FINDINGS
    shown = capsys.readouterr().out
    assert "c.mcap: 1 warning: CPU_LOAD_HIGH" in shown
    assert "text.ulg: cannot be examined: is not a recording" in shown
    assert main(["log", "findings", str(flights / "deep"), "--jobs", "1", "--json"]) == FINDINGS
    assert rules_in(json.loads(capsys.readouterr().out)) == ["CPU_LOAD_HIGH"]


@pytest.mark.parametrize(
    ("content", "code"),
    [
        ("", DONE),
        ("a text\n", FAILED),
        ("[]\n", FAILED),
        ("{}\n", FAILED),
        ('{"recording": 1}\n', FAILED),
        ('{"recording": "a", "findings": [{"level": []}], "size": 1, "changed": 1, "digest": "a"}\n', FAILED),
        ('{"recording": "a", "error": "b", "size": {}, "changed": [], "digest": {}}\n', FAILED),
        ("[" * 100_000 + "\n", FAILED),
    ],
)
def test_a_file_of_something_else_is_not_added_to(content: str, code: int, flights: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.ndjson"
    output.write_text(content)
    (flights / "b.mcap").unlink()
    for path in flights.iterdir():
        if path.is_file() and path.name != "a.mcap":
            path.unlink()
    (flights / "deep" / "c.mcap").unlink()
    assert main(["log", "findings", str(flights), "-o", str(output), "--jobs", "1"]) == code
    assert code == DONE or output.read_text() == content


def test_errors_of_usage(flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, text in (
        ([str(flights), "-v"], "argument --verbose: only for a single recording"),
        ([str(flights / "a.mcap"), "-o", "x"], "argument --output: only for a folder of recordings"),
        ([str(flights / "a.mcap"), "--jobs", "2"], "argument --jobs: only for a folder of recordings"),
    ):
        with pytest.raises(SystemExit):
            main(["log", "findings", *words])
        assert text in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["log", "findings", str(tmp_path / "empty")]) == FAILED
    assert "there is no recording in this folder" in capsys.readouterr().err
    assert main(["log", "findings", str(flights), "-o", str(tmp_path / "no" / "x.ndjson")]) == FAILED


def test_recordings_in_a_store_are_examined(
    bucket: Bucket, flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bucket.put(flights, "logs")
    output = tmp_path / "out.ndjson"
    words = ["log", "findings", "s3://bucket/logs", "-o", str(output), "--jobs", "1"]
    assert main(words) == FINDINGS
    found = [json.loads(line) for line in output.read_text().splitlines()]
    assert len(found) == 5
    assert all(each["recording"].startswith("s3://bucket/logs/") for each in found)
    assert "msggen-" not in output.read_text()
    before = output.read_bytes()
    assert main(words) == FINDINGS
    assert output.read_bytes() == before
    assert main(["log", "findings", "s3://bucket/logs/deep/c.mcap"]) == FINDINGS
    assert "CPU_LOAD_HIGH" in capsys.readouterr().out


def test_a_huge_recording_has_no_findings_in_a_fleet(
    flights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "LARGEST", 1)
    update(str(flights), str(tmp_path / "fleet"))
    assert not (tmp_path / "fleet" / "findings").exists()


def test_a_fleet_has_the_findings_as_a_table(flights: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    update(str(flights), str(fleet))
    query = f"""
        select f.rule, f.level, f.text, f."values"->>'load', count(*), any_value(path)
        from '{fleet}/findings/*.parquet' f
        join '{fleet}/cpuload/*.parquet' c on c.log = f.log and c.timestamp >= 0
        join '{fleet}/_logs.parquet' l on l.log = f.log
        where f.rule = 'CPU_LOAD_HIGH'
        group by all order by all
    """  # noqa: S608 - paths of our own
    rows = duckdb.execute(query).fetchall()
    assert [row[:3] for row in rows] == [
        ("CPU_LOAD_HIGH", "warning", "the load of the CPU reached 97 %"),
        ("CPU_LOAD_HIGH", "warning", "the load of the CPU reached 99 %"),
    ]
    assert [round(float(row[3]), 2) for row in rows] == [0.97, 0.99]
    output = tmp_path / "out.ndjson"
    assert main(["log", "findings", str(fleet), "-o", str(output), "--jobs", "1"]) == FINDINGS
    assert len(lines_of(output)) == 4
    copies = {"b.mcap", "copy.mcap"}
    (first,) = copies & lines_of(output).keys()
    (flights / first).unlink()
    output.unlink()
    assert main(["log", "findings", str(fleet), "-o", str(output), "--jobs", "1"]) == FINDINGS
    (other,) = copies - {first}
    assert rules_in(lines_of(output)[other]) == ["CPU_LOAD_HIGH"]
