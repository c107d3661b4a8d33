"""Tests of the hints of errors: all wrong names in one run, and the same hint in all commands."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.cli.unknown_argument import COMMANDS
from support.catalogs import write_definitions
from support.commands import COMMANDS as OWN
from support.commands import run
from support.examples import by_day
from support.repository import ROOT

VERSIONED = "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n"
TREE = {"msg/versioned/Lamp.msg": VERSIONED, "msg/Rpm.msg": "uint64 timestamp\n", "src/modules/README": ""}
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def tree(working_folder: Path) -> Path:
    """A PX4-Autopilot tree and its previous definitions, in the current folder."""
    write_definitions(working_folder, {f"px4/{name}": text for name, text in TREE.items()})
    write_definitions(working_folder, {f"old/{name}": text for name, text in TREE.items()})
    return working_folder / "px4"


def breaking(*arguments: str) -> int:
    return main(["breaking", "--px4", "px4", "--against", "old", *arguments])


def test_all_unknown_rules_are_reported(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\nper-message-ignores = { Rpm = ["SURCE", "WIRE"] }\n')
    assert breaking("--select", "VERSION_NOT_RAISD,WIRE,WIRES,DRIFT", "--ignore", "Y") == FAILED
    assert capsys.readouterr().err.splitlines() == [
        "--ignore: C104 unknown rule 'Y'",
        "--select: C104 'DRIFT' is a rule of check only",
        "--select: C104 unknown rule 'VERSION_NOT_RAISD', did you mean 'VERSION_NOT_RAISED'?",
        "--select: C104 unknown rule 'WIRES', did you mean 'WIRE'?",
        "pyproject.toml:2:32: C104 unknown rule 'SURCE', did you mean 'SOURCE'?",
        "5 errors",
    ]


@pytest.mark.parametrize("name", ["wire", "Field_Added", "VERSION,wire"])
def test_rules_are_selected_in_any_case(name: str, tree: Path, capsys: Capture) -> None:
    (tree / "msg/Rpm.msg").write_text("uint64 timestamp\nuint8 x\n")
    assert breaking("--select", name) == FINDINGS
    assert "FIELD_ADDED" in capsys.readouterr().out
    assert breaking("--ignore", name) == DONE
    Path("pyproject.toml").write_text(f'[tool.msggen.per-message-ignores]\nRpm = ["{name.rpartition(",")[2]}"]\n')
    assert breaking() == DONE


@pytest.mark.parametrize(
    ("folder", "whole"), [("px4/msg", "px4"), ("px4/msg/versioned", "px4"), ("", ".."), ("versioned", "..")]
)
@pytest.mark.parametrize("command", [["breaking", "--against", "v1.17"], ["bump", "Lamp"]], ids=lambda each: each[0])
def test_a_part_of_a_tree_has_the_same_hint_in_each_command(
    command: list[str], folder: str, whole: str, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    if whole == "..":
        monkeypatch.chdir("px4/msg")
    options = ["--px4", folder] if folder else []
    assert main([*command, *options]) == FAILED
    hint = f"only a part of a firmware tree, did you mean '{whole}'?"
    assert capsys.readouterr().err.splitlines()[0] == f"{folder or '.'}: S102 {hint}"


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("command NAV_TAKEOFF --altitude 10", "'--altitude': write a parameter without dashes, altitude=VALUE"),
        ("command arm --jsno", "'--jsno', did you mean '--json'?"),
        ("topic pub trajectory_setpoint px4_msgs/msg/TrajectorySetpoint {}", "'{}': leave out the type, px4_msgs/msg/"),
        ("record -a", "'-a': all topics are recorded without it"),
        ("record --all -o x", "'--all': all topics are recorded without it"),
        ("play x.mcap --speed 2", "'--speed': use --rate"),
        ("play x.mcap --link udp://127.0.0.1:8889", "'--link': use --to"),
        ("doctor --port 8889", "'--port': name it with --link udp://127.0.0.1:PORT"),
        ("sim --port 8889", "'--port': name it in the address: msggen sim udp://127.0.0.1:PORT"),
        ("sim --vehicles 2", "'--vehicles': use --count"),
        ("topic info -v vehicle_status", "'-v': the publishers and the QoS are shown without it"),
        (
            "topic echo vehicle_status --qos-reliability best_effort",
            "'--qos-reliability': leave it out: there is no QoS",
        ),
        ("topic hz vehicle_status --qos-depth 1", "'--qos-depth': leave it out: there is no QoS"),
        ("topic echo vehicle_status --timeout 3", "'--timeout': use --for"),
    ],
)
def test_the_words_of_other_programs_have_hints(line: str, hint: str) -> None:
    assert f"unknown argument {hint}" in run(line.split()).stderr


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("link udp4 -p 8888", "argument ACTION: no action 'udp4': no agent is needed: "),
        ("topic publish x", "argument ACTION: no action 'publish': `msggen topic pub TOPIC VALUES` publishes"),
        ("mode list", "argument COMMAND: no command 'mode': `msggen command mode NAME`"),
        ("interface show x", "argument COMMAND: no command 'interface': `msggen topic info TOPIC` shows the fields"),
        ("replay x", "argument COMMAND: no command 'replay': `msggen play FILE` plays a recording"),
        (
            "check a --output-format jsn",
            "argument --output-format: invalid choice: 'jsn', did you mean 'json'?",
        ),
        ("recrod", "argument COMMAND: invalid choice: 'recrod', did you mean 'record'? (choose from build, "),
        ("echo", "argument COMMAND: invalid choice: 'echo', did you mean 'topic echo'? (choose from build, "),
        ("nonsense", "argument COMMAND: invalid choice: 'nonsense' (choose from build, "),
    ],
)
def test_the_hint_comes_first(line: str, hint: str) -> None:
    assert f"error: {hint}" in run(line.split()).stderr


@by_day("word", [*COMMANDS, "MicroXRCEAgent"], 3)
def test_a_word_of_another_program_points_to_a_command_or_a_page(word: str) -> None:
    outcome = run([word, "--port", "x"])
    assert outcome.code == FAILED
    first = outcome.stderr.splitlines()[0]
    assert first.startswith(f"msggen: error: argument COMMAND: no command '{word}': ")
    assert "choose from" not in first
    for line in re.findall("`msggen ([^`]+)`", first):
        names = line.split()
        if not names[0].startswith("-") and names[0] != "COMMAND":
            assert any(" ".join(names[:count]) in OWN for count in (1, 2)), line
            assert {name for name in names if name.startswith("--")} <= options_of(names), line
    for page in re.findall(r"docs/\S+\.md", first):
        assert (ROOT / page).is_file()


def options_of(words: list[str]) -> set[str]:
    """Return the options of the command that words begin with."""
    found = OWN.get(" ".join(words[:2])) or OWN[words[0]]
    return {*found._option_string_actions}


def test_the_words_of_the_programs_that_people_know_are_there() -> None:
    assert {"param", "node", "service", "bag", "interface", "shell", "help"} <= {*COMMANDS}
    assert {"takeoff", "telemetry", "ulog_info", "ulog2csv", "microxrceagent", "udp4"} <= {*COMMANDS}
    assert not {name.split()[0] for name in OWN} & {*COMMANDS}


@pytest.mark.parametrize(("line", "meant"), [("info flight.ulg", "log info"), ("echo vehicle_status", "topic echo")])
def test_an_action_without_its_command_has_a_hint(line: str, meant: str) -> None:
    assert f", did you mean '{meant}'?" in run(line.split()).stderr


@pytest.mark.tools("git")
def test_the_embedded_release_is_suggested_for_a_patch_release(tree: Path, capsys: Capture) -> None:
    def said(against: str) -> str:
        assert main(["breaking", "--px4", "px4", "--against", against]) == FAILED
        return capsys.readouterr().err.splitlines()[0].partition(" nor a revision of px4")[2]

    def git(*arguments: str) -> None:
        identity = ["-c", "user.name=somebody", "-c", "user.email=somebody@example.com"]
        subprocess.run(["git", *identity, *arguments], cwd=tree, check=True, capture_output=True)

    assert said("v1.17.0").endswith(", did you mean 'v1.17'?")  # not a git repository
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "x")
    assert said("v1.17.0") == ", did you mean 'v1.17'?"
    git("tag", "v1.16.2")
    assert said("v1.17.0") == ", did you mean 'v1.17'?"
    assert said("1.16.2") == ", did you mean 'v1.16.2'?"
    assert said("v1.16.3") == ", did you mean 'v1.16'?"
    assert main(["breaking", "--px4", "v1.18", "--against", "v1.17.0"]) == FAILED
    assert capsys.readouterr().err.splitlines()[0].endswith(" nor a revision of v1.18, did you mean 'v1.17'?")


def test_an_undeclared_topic_names_the_line_that_declares_it(working_folder: Path, capsys: Capture) -> None:
    topics = "publications:\n  - topic: /fmu/out/rear_rpm\n    type: px4_msgs::msg::Rpm\n"
    write_definitions(working_folder, {"fw/dds_topics.yaml": topics, "fw/msg/Rpm.msg": "uint64 timestamp\n"})
    assert main(["build", "--px4", "fw"]) == FAILED
    assert ": Y202 no message declares the topic 'rear_rpm', which takes '# TOPICS rpm rear_rpm' in Rpm.msg" in (
        capsys.readouterr().err
    )
