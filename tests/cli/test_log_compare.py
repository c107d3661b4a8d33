"""Tests of `msggen log compare`: its texts, its document and its errors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from support.commands import exit_code
from support.report_flights import write_mcap, write_other, write_ulog


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> Path:
    made = tmp_path_factory.mktemp("flights")
    write_other(made / "b.ulg", write_ulog(made / "a.ulg", px4_types))
    write_mcap(made / "c.mcap", px4_types)
    (made / "cut.ulg").write_bytes((made / "a.ulg").read_bytes()[:-7])
    return made


@pytest.fixture(autouse=True)
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


def run(*words: str) -> int:
    return exit_code(["log", "compare", *words])


def test_what_differs_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.ulg", "b.ulg") == DONE
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == ["A  a.ulg", "B  b.ulg", "takeoff at 3.0 s in A, at 3.0 s in B"]
    assert "Board                  PX4_FMU_V6X  PX4_FMU_V5X" in lines
    assert "1 parameter only in A: MPC_Z_VEL_MAX_UP" in lines
    assert "1 parameter only in B: MPC_Z_VEL_MAX_DN" in lines
    assert [line for line in lines if line.startswith("both, A: warning VIBRATION_HIGH: high vibration of IMU 0")]


def test_the_same_file_does_not_differ(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.ulg", "a.ulg") == DONE
    assert capsys.readouterr().out.splitlines()[-1] == "no differences"


def test_formats_can_differ(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.ulg", "c.mcap") == DONE
    out = capsys.readouterr().out
    assert "the parameters are not compared: B has none" in out
    assert "only A: warning LOG_DROPOUTS: 1 dropout of the logger" in out


def test_the_document_has_all_differences(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.ulg", "b.ulg", "--json") == DONE
    document = json.loads(capsys.readouterr().out)
    assert document["recordings"] == ["a.ulg", "b.ulg"]
    assert document["moment"] == {"name": "takeoff", "seconds": [3.0, 3.0]}
    assert document["facts"] == [{"name": "Board", "values": ["PX4_FMU_V6X", "PX4_FMU_V5X"]}]
    assert document["parameters"][0] == {"name": "MPC_Z_VEL_MAX_DN", "values": [None, 3]}
    vibration = next(each for each in document["findings"] if each["rule"] == "VIBRATION_HIGH")
    assert [side[0]["values"]["vibration_m_s2"] for side in vibration["findings"]] == [6.0, 6.0]
    assert vibration["unsaid"] == [None, None]
    assert document["topics"] == [[], []]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["a.ulg"], "the following arguments are required: OTHER"),
        (["a.ulg", "missing.ulg"], "missing.ulg: R102 cannot be read: No such file or directory"),
        (["missing.ulg", "a.ulg"], "missing.ulg: R102 cannot be read: No such file or directory"),
        (["-", "-"], "argument OTHER: only one of the recordings can be -, stdin"),
    ],
)
def test_errors(words: Sequence[str], error: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words) == FAILED
    told = capsys.readouterr()
    assert error in told.err
    assert not told.out


def test_damage_of_either_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["cut.ulg", "a.ulg"], ["a.ulg", "cut.ulg"]):
        assert run(*words) == FINDINGS
        assert capsys.readouterr().err.startswith("cut.ulg: ")
