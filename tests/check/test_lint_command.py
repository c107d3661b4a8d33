"""Tests of `msggen lint`: sources, selection, exit codes, formats, and that msggen's own definitions are good."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from msggen.check.lint.rules import LINT
from msggen.check.run import lint
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.repository import ROOT

GOOD = "# A lamp.\n\nuint64 timestamp # [us] Time since boot.\n"
FILES = {
    "px4/msg/Lamp.msg": f"{GOOD}float32 angle # [rads] Angle of the lamp.\nfloat32 height # [m] [@frmae NED] Height.\n",
    "px4/msg/Gripper.msg": f"{GOOD}float32 width # [m] [@range 1, 0] Distance.\n",
    "px4/srv/Turn.srv": "float32 speed # [rads] Speed.\n---\nbool done # [@range 1] Whether it is done.\n",
}
PX4 = ("--px4", "px4")
OWN_EXCEPTIONS = {
    ("RANGE_INVALID", "BatteryStatus"): "the range is that of the firmware",
    ("ENUM_INEXACT", "VteAidSource1d"): "the tag is that of the firmware",
    ("ENUM_INEXACT", "VteAidSource3d"): "the tag is that of the firmware",
    ("FRAME_MISSING", "TrajectorySetpoint6dof"): "the firmware does not say the frame of angular_velocity",
}
"""Findings in msggen's own definitions of v1.18, with the reason why they stay."""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_definitions(tmp_path, FILES)
    monkeypatch.chdir(tmp_path)


def found(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = DONE) -> list[str]:
    """Run `lint`, and return the rule and the message of each finding."""
    assert main(["lint", *arguments, "--output-format", "json"]) == code
    report = json.loads(capsys.readouterr().out)
    return [f"{each['subject']} {each['rule']}" for each in report["findings"]]


ALL = ["Gripper RANGE_INVALID", "Lamp UNIT_UNKNOWN", "Lamp TAG_UNKNOWN", "Turn_Request UNIT_UNKNOWN"]

"""The findings, but for the last."""


def test_findings_are_advice_unless_asked(capsys: pytest.CaptureFixture[str]) -> None:
    assert found(capsys, *PX4) == [*ALL, "Turn_Response RANGE_INVALID"]
    assert found(capsys, *PX4, "--strict", code=FINDINGS) == [*ALL, "Turn_Response RANGE_INVALID"]
    assert found(capsys, *PX4, "--strict", "--select", "ENUM") == []


@pytest.mark.parametrize(
    ("options", "settings", "expected"),
    [
        (["--select", "UNIT"], "", ["Lamp UNIT_UNKNOWN", "Turn_Request UNIT_UNKNOWN"]),
        (["--select", "tag", "--ignore", "RANGE_INVALID,VALUE_INVALID"], "", ["Lamp TAG_UNKNOWN"]),
        ([], 'select = ["tag_unknown"]', ["Lamp TAG_UNKNOWN"]),
        ([], 'ignore = ["TAG", "WIRE"]', ["Lamp UNIT_UNKNOWN", "Turn_Request UNIT_UNKNOWN"]),
        ([], 'per-message-ignores = {"Turn" = ["UNIT", "TAG"], "L*" = ["TAG", "FIELD_ADDED"]}', ALL[:2]),
        ([], 'select = ["WIRE"]', [*ALL, "Turn_Response RANGE_INVALID"]),
        (["--select", "DOCUMENTATION"], "", []),
    ],
)  # fmt: skip
def test_rules_are_selected(
    options: list[str], settings: str, expected: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("pyproject.toml").write_text(f"[tool.msggen]\npx4 = 'px4'\n{settings}\n")
    assert found(capsys, *options) == expected


def test_ignored_findings_are_counted_and_names_that_match_nothing_reported(capsys: pytest.CaptureFixture[str]) -> None:
    names = '"Lmap" = ["UNIT"]\n"Lamp" = ["UNIT"]\n"/fmu/out/lamp" = ["TOPIC"]\n'
    Path("pyproject.toml").write_text(f"[tool.msggen.per-message-ignores]\n{names}")
    assert main(["lint", *PX4, "--ignore", "TAG", "--output-format", "concise"]) == DONE
    told = capsys.readouterr()
    assert told.out.splitlines()[-1] == "px4: 1 warning in 1 definition, 4 ignored"
    assert told.err == (
        "pyproject.toml:2:1: C105 warning: 'Lmap' matches no message, service or topic, did you mean 'Lamp'?\n"
    )


def test_settings_for_lint_do_not_disturb_breaking(capsys: pytest.CaptureFixture[str]) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\nignore = ["UNIT_UNKNOWN"]\nselect = ["TAG", "FIELD_ADDED"]\n')
    assert main(["breaking", *PX4, "--against", "px4"]) == DONE
    assert "C104" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "option", "message"),
    [
        ("lint", "UNIT_UNKNOWM", "--select: C104 unknown rule 'UNIT_UNKNOWM', did you mean 'UNIT_UNKNOWN'?"),
        ("lint", "FIELD_ADDED", "--select: C104 'FIELD_ADDED' is a rule of check and breaking only"),
        ("breaking", "UNIT_UNKNOWN", "--select: C104 'UNIT_UNKNOWN' is a rule of lint only"),
        ("breaking", "DRIFT", "--select: C104 'DRIFT' is a rule of check only"),
    ],
)
def test_a_rule_of_another_command_is_refused(
    command: str, option: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    against = ["--against", "px4"] if command == "breaking" else []
    assert main([command, *PX4, *against, "--select", option]) == FAILED
    assert message in capsys.readouterr().err


# Sources


def test_the_definitions_of_the_current_folder_are_the_default(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_definitions(Path(), {"px4/package.xml": "<package><name>lamp_msgs</name></package>"})
    monkeypatch.chdir("px4")
    assert found(capsys, "--select", "UNIT") == ["Lamp UNIT_UNKNOWN", "Turn_Request UNIT_UNKNOWN"]


def test_embedded_definitions_are_only_looked_at_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint"]) == FAILED
    assert "lint: S102 no definitions here: name them with --px4 or --msg-dir\n" in capsys.readouterr().err
    assert found(capsys, "--msg-dir", "px4/msg") == ALL[:3]
    assert "VteAidSource1d ENUM_INEXACT" in found(capsys, "--px4", "v1.18", "--select", "ENUM")


@pytest.mark.parametrize("folder", ["px4/msg", "px4"])
def test_a_folder_of_definitions_suggests_its_option(
    folder: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert main(["lint"]) == FAILED
    assert "lint: S102 no definitions here, did you mean --msg-dir .?\n" in capsys.readouterr().err
    assert found(capsys, "--msg-dir", ".", "--select", "TAG")[:2] == [ALL[0], ALL[2]]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["Lamp"], ["Lamp UNIT_UNKNOWN", "Lamp TAG_UNKNOWN"]),
        (["px4/msg/Gripper.msg", "Gripper"], ["Gripper RANGE_INVALID"]),
        (
            ["Turn", "Gripper.msg"],
            ["Gripper RANGE_INVALID", "Turn_Request UNIT_UNKNOWN", "Turn_Response RANGE_INVALID"],
        ),
    ],
)
def test_messages_are_selected(names: list[str], expected: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert found(capsys, *names, *PX4) == expected
    assert found(capsys, *PX4, *names) == expected
    Path("pyproject.toml").write_text('[tool.msggen.per-message-ignores]\n"Gripper" = ["TAG"]\n')
    assert found(capsys, "--px4", "px4", *names) == [each for each in expected if not each.startswith("Gripper")]
    assert "C105" not in capsys.readouterr().err


def test_an_unknown_message_suggests_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", "Griper", "Lamp", "px4/msg/lamp.msg", "Zzz.srv", *PX4]) == FAILED
    assert capsys.readouterr().err.splitlines()[:3] == [
        "Griper: S130 no such message in px4, did you mean 'Gripper'?",
        "Zzz.srv: S130 no such message in px4",
        "px4/msg/lamp.msg: S130 no such message in px4, did you mean 'Lamp'?",
    ]


def test_definitions_of_other_packages_are_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), {"other/msg/Lamp.msg": "float32 angle # [rads] Angle.\n"})
    assert found(capsys, *PX4, "--msg-dir", "other_msgs=other/msg", "--select", "UNIT") == [ALL[1], ALL[3]]


# Formats


def shown(capsys: pytest.CaptureFixture[str], output_format: str, *options: str) -> str:
    main(["lint", *PX4, "--select", "RANGE_INVALID,UNIT_INCONSISTENT", "--output-format", output_format, *options])
    return capsys.readouterr().out


def test_text_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    place = "px4/msg/Gripper.msg:4:21: RANGE_INVALID"
    text = "'width': '[@range 1, 0]' has the larger bound first: expected '[@range 0, 1]'"
    lines = shown(capsys, "concise").splitlines()
    assert lines[0] == f"{place} warning: {text}"
    assert lines[-1] == "px4: 2 warnings in 2 definitions"
    lines = shown(capsys, "full").splitlines()
    assert lines[:2] == ["Gripper", f"{place} warning: {text}"]
    assert [line.strip() for line in lines[3:6:2]] == ["px4", "4  float32 width # [m] [@range 1, 0] Distance."]
    assert "|" not in lines[5]
    assert shown(capsys, "concise", "--strict").splitlines()[-1] == "px4: 2 findings in 2 definitions"
    main(["lint", *PX4, "--select", "ENUM"])
    assert capsys.readouterr().out == "px4: no findings\n"


def test_documents_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads(shown(capsys, "json"))
    assert (report["previous"], report["current"], report["compared"]) == (None, "px4", 3)
    assert report["findings"][0]["severity"] == "warning"
    assert report["findings"][0]["before"] is None
    log = json.loads(shown(capsys, "sarif"))["runs"][0]
    assert [rule["id"] for rule in log["tool"]["driver"]["rules"]] == ["RANGE_INVALID", "UNIT_INCONSISTENT"]
    assert [result["level"] for result in log["results"]] == ["warning", "warning"]
    assert shown(capsys, "github").startswith("::warning file=px4/msg/Gripper.msg,line=4,col=21,title=RANGE_INVALID ")
    suites = ET.fromstring(shown(capsys, "junit"))  # noqa: S314 - msggen wrote it
    assert [(suite.get("name"), suite.get("failures")) for suite in suites] == [("TAG", "0"), ("UNIT", "0")]
    suites = ET.fromstring(shown(capsys, "junit", "--strict"))  # noqa: S314
    assert [(suite.get("name"), suite.get("failures")) for suite in suites] == [("TAG", "1"), ("UNIT", "0")]
    assert {each.get("name") for each in suites.iter("property")} == {"current", "summary"}


# Our own definitions


def test_the_own_definitions_are_good() -> None:
    """The rules that are applied by default find nothing but the listed exceptions."""
    found = {(each.rule.id, each.change.subject) for each in lint(find_sources("v1.18")).findings}
    assert found == {*OWN_EXCEPTIONS}


def test_the_texts_say_how_to_select_all_rules() -> None:
    every = ",".join(dict.fromkeys(rule.category.name for rule in LINT))
    for path in ("docs/check.md", "msggen/show/report/errors.yaml"):
        assert f"--select {every}`" in (ROOT / path).read_text(encoding="utf-8")


def test_the_default_leaves_out_what_is_a_matter_of_taste() -> None:
    assert [rule.id for rule in LINT if not rule.is_default] == [
        "CONSTANTS_UNUSED",
        "DESCRIPTION_MISSING",
        "PADDING_AVOIDABLE",
    ]
