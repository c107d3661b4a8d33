"""Tests of `msggen breaking`: comparison with a revision or another tree, choice of rules, and new versions.

A complete new version of a message handles its changes; an incomplete one does not. test_rules.py tests each rule.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.check.compare.rules import BREAKING
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.show.report import FORMATS
from support import comparison as slow
from support.catalogs import write_definitions
from support.examples import by_day
from support.packages import committed, definition, git, packed
from support.repository import ROOT, shared

STAMP = "uint64 timestamp\n"
FIRMWARE = Path("firmware")
RPM = "msg/Rpm.msg"
HOME = "msg/versioned/HomePosition.msg"
ACK = "msg/versioned/VehicleCommandAck.msg"
REPLY = "msg/versioned/ArmingCheckReply.msg"
EVENT = "msg/versioned/Event.msg"
ARCHIVE = "msg/px4_msgs_old/msg"
TRANSLATIONS = "msg/translation_node/translations"
YAML = "src/modules/uxrce_dds_client/dds_topics.yaml"
BRIDGE = """
publications:
  - topic: /fmu/out/home_position
    type: px4_msgs::msg::HomePosition
  - topic: /fmu/out/rpm
    type: px4_msgs::msg::Rpm
subscriptions:
  - topic: /fmu/in/arming_check_reply
    type: px4_msgs::msg::ArmingCheckReply
"""
NONE: set[tuple[str, str]] = set()

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def committed_firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A committed tree of real definitions, with the branch main and the tag v1."""
    names = {f"msg/{name}.msg": name for name in ("Rpm", "EscReport", "EscStatus")}
    names |= {f"msg/versioned/{name}.msg": name for name in ("HomePosition", "ArmingCheckReply", "Event")}
    names |= {f"msg/versioned/{name}.msg": name for name in ("VehicleCommand", "VehicleCommandAck")}
    files = {file: definition(name) for file, name in names.items()}
    files["srv/VehicleCommand.srv"] = (ROOT / "srv" / "VehicleCommand.srv").read_text()
    files[f"{ARCHIVE}/HomePositionV0.msg"] = f"uint32 MESSAGE_VERSION = 0\n{STAMP}"
    tree = committed(write_definitions(tmp_path_factory.mktemp("committed"), {**files, YAML: BRIDGE}))
    git(tree, "branch", "-M", "main")
    git(tree, "tag", "v1")
    return packed(tree)


@pytest.fixture(autouse=True)
def firmware(committed_firmware: Path, working_folder: Path) -> None:
    """Copy that tree into the current folder, where a test can change its work tree."""
    shutil.copytree(committed_firmware, working_folder / FIRMWARE)


def breaking(*arguments: str) -> int:
    return main(["breaking", *arguments])


def findings(capsys: Capture, *arguments: str) -> list[dict[str, object]]:
    """Return the findings between `v1` and the work tree, or those for `arguments`; check the exit code."""
    code = breaking(*(arguments or AGAINST_V1), "--output-format", "json")
    found: list[dict[str, object]] = json.loads(capsys.readouterr().out)["findings"]
    assert code == (FINDINGS if any(each["fails"] for each in found) else DONE)
    return found


def broken(capsys: Capture, *arguments: str) -> set[tuple[object, object]]:
    """Return rule and subject of the findings that fail."""
    return {(each["rule"], each["subject"]) for each in findings(capsys, *arguments) if each["fails"]}


def handled(capsys: Capture, *arguments: str) -> set[tuple[object, object]]:
    """Return rule and subject of the findings that a complete new version handles."""
    return {(each["rule"], each["subject"]) for each in findings(capsys, *arguments) if each["handled"]}


AGAINST_V1 = ("--px4", "firmware", "--against", "v1")


def told(capsys: Capture, *arguments: str) -> str:
    """Return the errors that `breaking` reports."""
    assert breaking(*arguments) == FAILED
    shown = capsys.readouterr()
    assert shown.out == ""
    *errors, last = shown.err.splitlines()
    assert last == f"{len(errors)} error{'s' * (len(errors) > 1)}"
    return "\n".join(errors)


def edit(file: str, old: str, new: str) -> None:
    """Replace the only occurrence of `old` in a file of the firmware."""
    path = FIRMWARE / file
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")


def add_field(file: str = RPM, field: str = "uint8 added") -> None:
    path = FIRMWARE / file
    path.write_text(f"{path.read_text()}\n{field}\n")


ADDED = {("FIELD_ADDED", "Rpm")}


# --- Revisions and trees


@pytest.mark.slow
@pytest.mark.parametrize("against", ["main", "v1", "HEAD", "@", "heads/main", "HEAD@{0}", "HEAD^{/all}"])
def test_the_tree_is_compared_with_a_revision_of_its_repository(against: str, capsys: Capture) -> None:
    assert broken(capsys, "--px4", "firmware", "--against", against) == NONE
    add_field()
    assert broken(capsys, "--px4", "firmware", "--against", against) == ADDED


def test_the_current_folder_is_what_has_changed(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    add_field()
    monkeypatch.chdir("firmware")
    assert broken(capsys, "--against", "HEAD") == ADDED
    assert breaking("--against", "HEAD", "--output-format", "concise") == FINDINGS
    assert capsys.readouterr().out.splitlines() == [
        f"{RPM}:9:1: FIELD_ADDED 'uint8 added' at byte 16 is not in HEAD",
        "the working tree breaks HEAD: 1 finding in 1 definition",
    ]


def test_the_setting_px4_is_what_has_changed(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\n')
    add_field()
    assert broken(capsys, "--against", "v1") == ADDED


def test_an_older_revision_is_compared_with_later_ones(capsys: Capture) -> None:
    add_field()
    git(FIRMWARE, "commit", "-q", "-a", "-m", "add")
    git(FIRMWARE, "checkout", "-q", "v1")
    assert broken(capsys, "--px4", "firmware@main", "--against", "HEAD") == ADDED
    assert broken(capsys, "--px4", "firmware", "--against", "main") == {("FIELD_REMOVED", "Rpm")}
    assert broken(capsys, "--px4", "firmware", "--against", "main~1") == NONE


def test_a_tree_may_be_a_part_of_a_repository(capsys: Capture) -> None:
    shutil.rmtree("firmware/.git")
    shutil.copytree("firmware", "ws/src/firmware")
    committed(Path("ws"))
    add_field("../ws/src/firmware/msg/Rpm.msg")
    assert broken(capsys, "--px4", "ws/src/firmware", "--against", "HEAD") == ADDED


@pytest.mark.slow
@pytest.mark.parametrize("against", ["old", "./old", "firmware/../old", "old.tar.gz", "firmware@v1", "old@v1"])
def test_the_tree_is_compared_with_another(against: str, capsys: Capture) -> None:
    shutil.copytree("firmware", "old")
    shutil.make_archive("old", "gztar", "old")
    add_field()
    assert broken(capsys, "--px4", "firmware", "--against", against) == ADDED


def test_a_firmware_without_a_repository_is_compared_with_another(capsys: Capture) -> None:
    shutil.copytree("firmware", "old")
    shutil.rmtree("firmware/.git")
    add_field()
    assert broken(capsys, "--px4", "firmware", "--against", "old") == ADDED
    assert broken(capsys, "--px4", "firmware", "--against", "old@v1") == ADDED


def test_what_is_a_revision_and_a_folder_is_refused_with_both_ways_to_say_it(capsys: Capture) -> None:
    shutil.copytree("firmware", "v1", ignore=shutil.ignore_patterns(".git"))
    assert told(capsys, *AGAINST_V1) == (
        "--against: S108 'v1' is a revision and a folder: write './v1' for the folder, "
        "or 'firmware@v1' for the revision"
    )
    add_field()
    assert broken(capsys, "--px4", "firmware", "--against", "./v1") == ADDED
    assert broken(capsys, "--px4", "firmware", "--against", "firmware@v1") == ADDED


@pytest.mark.parametrize(
    ("against", "said"),
    [
        ("mian", "--against: S108 'mian' is neither a folder nor a revision of firmware, did you mean 'main'?"),
        ("V1", "--against: S108 'V1' is neither a folder nor a revision of firmware, did you mean 'v1'?"),
        ("0123456", "--against: S108 '0123456' is neither a folder nor a revision of firmware"),
        ("HEAD:msg", "--against: S108 'HEAD:msg' is neither "),
        ("firmware@v2", "firmware@v2: S108 the repository has no revision 'v2'"),
        ("firmware/src", "firmware/src: S102 no .msg file here"),
        ("broken.zip", "broken.zip: S109 "),
    ],
)
def test_what_is_neither_is_told(against: str, said: str, capsys: Capture) -> None:
    Path("broken.zip").touch()
    assert told(capsys, "--px4", "firmware", "--against", against).startswith(said)


@pytest.mark.parametrize("against", ["HEAD@{99}", "mian@{1}"])
def test_a_bad_revision_with_an_at_in_it_is_told_as_one(against: str, capsys: Capture) -> None:
    assert told(capsys, "--px4", "firmware", "--against", against).startswith(
        f"--against: S108 '{against}' is neither "
    )


@pytest.mark.parametrize("dots", ["..", "..."])
@pytest.mark.parametrize(("older", "newer"), [("v1", "HEAD"), ("v1", ""), ("", "v1"), ("v1.17.0", "a/b")])
def test_a_range_is_no_revision(dots: str, older: str, newer: str, capsys: Capture) -> None:
    text = f"{older}{dots}{newer}"
    said = f"is a range, expected one revision: use $(git merge-base {older or 'HEAD'} {newer or 'HEAD'})"
    assert told(capsys, "--px4", "firmware", "--against", text) == f"--against: S108 '{text}' {said}"


@pytest.mark.parametrize("path", ["../x", "a/../b", "../..", "a/.."])
def test_a_path_with_dots_is_no_range(path: str, capsys: Capture) -> None:
    if not os.path.exists(path):
        assert "is neither a folder nor a revision" in told(capsys, "--px4", "firmware", "--against", path)


@pytest.mark.parametrize("folder", ["firmware", "."])
@pytest.mark.parametrize("words", [["--against", "v1", "HEAD"], ["HEAD", "--against=main"]])
def test_a_second_revision_is_told_its_option(
    words: list[str], folder: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    if folder == ".":
        monkeypatch.chdir(FIRMWARE)
    with pytest.raises(SystemExit) as stopped:
        breaking(*words, *([] if folder == "." else ["--px4", folder]))
    assert stopped.value.code == FAILED
    advice = f"--against names one side, name the other with --px4 {folder}@HEAD"
    assert f"unknown argument 'HEAD': {advice}\n" in capsys.readouterr().err
    assert breaking("--px4", f"{folder}@HEAD", "--against", "v1") == DONE


def test_a_firmware_without_a_repository_has_no_revisions(capsys: Capture) -> None:
    shutil.rmtree("firmware/.git")
    text = "--against: S108 'v1' is neither a folder nor a revision of firmware: not a git repository"
    assert told(capsys, *AGAINST_V1).startswith(text)


def test_without_git_that_is_the_reason(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    text = "--against: S108 'v1' is neither a folder nor a revision of firmware: the program 'git' is not installed"
    assert told(capsys, *AGAINST_V1) == text


def test_a_shallow_repository_is_told_as_one(capsys: Capture) -> None:
    git(FIRMWARE, "commit", "-q", "--allow-empty", "-m", "later")
    git(Path(), "clone", "-q", "--depth", "1", FIRMWARE.absolute().as_uri(), "shallow")
    reason = ": the repository is shallow, fetch the rest with `git fetch --unshallow`"
    against = "--against: S108 'HEAD~1' is neither a folder nor a revision of shallow"
    assert told(capsys, "--px4", "shallow", "--against", "HEAD~1") == f"{against}{reason}"
    source = "shallow@v1: S108 the repository has no revision 'v1'"
    assert told(capsys, "--px4", "shallow@v1", "--against", "firmware") == f"{source}{reason}"


def test_a_setting_that_leads_nowhere_is_told_where_it_stands(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmwar"\nmsg-dir = ["extra/msg"]\ntopics = "b.yml"\n')
    Path("extras/msg").mkdir(parents=True)
    Path("b.yaml").touch()
    assert told(capsys, "--against", "v1").splitlines() == [
        "pyproject.toml:2:1: S101 'firmwar': no such folder, did you mean 'firmware'?",
        "pyproject.toml:3:1: S101 'extra/msg': no such folder, did you mean 'extras'?",
        "pyproject.toml:4:1: S101 'b.yml': no such file, did you mean 'b.yaml'?",
    ]
    assert told(capsys, "--against", "v1", "--px4", "./firmwre", "--msg-dir", "firmware/mgs", "--topics", "b.yaml") == (
        "./firmwre: S101 no such folder, did you mean './firmware'?\n"
        "firmware/mgs: S101 no such folder, did you mean 'firmware/msg'?"
    )


def test_the_last_commit_is_the_default_in_a_repository(capsys: Capture) -> None:
    add_field()
    assert broken(capsys, "--px4", "firmware") == broken(capsys, "--px4", "firmware", "--against", "HEAD") == ADDED
    for outside in ("v1.18", "firmware@v1"):
        with pytest.raises(SystemExit) as stopped:
            breaking("--px4", outside)
        assert stopped.value.code == FAILED
        assert "--against" in capsys.readouterr().err


def test_a_revision_of_such_a_path_is_compared_with_others(capsys: Capture) -> None:
    os.rename("firmware", "me@home")
    assert broken(capsys, "--px4", "me@home@main", "--against", "v1") == NONE


# --- More than one source

FAN = f"{STAMP}float32 speed\n"
MODULE = ("--px4", "firmware", "--msg-dir", "firmware/module", "--against", "HEAD")


@pytest.fixture
def module() -> None:
    """Add an external module to the firmware's repository, and change its message."""
    write_definitions(FIRMWARE, {"module/msg/Fan.msg": FAN})
    git(FIRMWARE, "add", "-A")
    git(FIRMWARE, "commit", "-q", "-m", "module")
    edit("module/msg/Fan.msg", "float32", "float64")


@pytest.mark.usefixtures("module")
def test_a_module_in_the_repository_is_compared_with_what_it_was(capsys: Capture) -> None:
    assert broken(capsys, *MODULE) == {("FIELD_RETYPED", "Fan")}


@pytest.mark.usefixtures("module")
def test_a_module_of_the_settings_is_too(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\nmsg-dir = "firmware/module"\n')
    assert broken(capsys, "--against", "HEAD") == {("FIELD_RETYPED", "Fan")}


@pytest.mark.usefixtures("module")
def test_a_module_is_compared_with_what_it_was_whatever_revision_the_tree_is_of(capsys: Capture) -> None:
    assert broken(capsys, "--px4", "firmware@HEAD", *MODULE[2:]) == {("FIELD_RETYPED", "Fan")}


def test_a_module_elsewhere_is_compared_with_itself(capsys: Capture) -> None:
    committed(write_definitions(Path("module"), {"msg/Fan.msg": FAN}))
    (Path("module") / "msg" / "Fan.msg").write_text(STAMP)
    assert broken(capsys, "--msg-dir", "module", *AGAINST_V1) == NONE


def test_a_module_that_the_revision_does_not_have_is_new(capsys: Capture) -> None:
    write_definitions(FIRMWARE, {"module/msg/Fan.msg": FAN})
    assert broken(capsys, *MODULE) == NONE


@pytest.mark.parametrize("place", ["option", "setting"])
def test_a_bridge_that_is_named_is_no_change(place: str, capsys: Capture) -> None:
    write_definitions(FIRMWARE, {"mine.yaml": "publications:\n- topic: /fmu/out/rpm\n  type: px4_msgs::msg::Rpm\n"})
    git(FIRMWARE, "add", "-A")
    git(FIRMWARE, "commit", "-q", "-m", "bridge")
    if place == "setting":
        Path("pyproject.toml").write_text('[tool.msggen]\ntopics = "firmware/mine.yaml"\n')
    option = ("--topics", "firmware/mine.yaml") if place == "option" else ()
    assert broken(capsys, "--px4", "firmware", "--against", "HEAD", *option) == NONE


# --- Choice of rules


def several() -> None:
    """Change something in every category except VERSION."""
    add_field()
    edit("msg/EscReport.msg", "esc_rpm  # [rpm]", "esc_speed  # [rpm]")
    edit("msg/EscReport.msg", "esc_voltage  # [V]", "esc_voltage  # [mV]")
    edit("msg/EscStatus.msg", "uint8 CONNECTED_ESC_MAX = 12", "uint8 CONNECTED_ESC_MAX = 16")
    edit(YAML, "/fmu/out/rpm", "/fmu/out/sub/rpm")


SEVERAL = {
    *ADDED,
    ("FIELD_RENAMED", "EscReport"),
    ("NESTED_NAME_CHANGED", "EscStatus"),
    ("UNIT_CHANGED", "EscReport"),
    ("CONSTANT_VALUE_CHANGED", "EscStatus"),
    ("TOPIC_MOVED", "/fmu/out/sub/rpm"),
}


def test_findings_of_several_categories_come_in_one_run(capsys: Capture) -> None:
    several()
    assert broken(capsys) == SEVERAL


CHOICES = [
    (["--select", "WIRE"], ["WIRE"], []),
    (["--select", "HASH,UNIT_CHANGED"], ["HASH", "UNIT_CHANGED"], []),
    (["--select", " HASH , TOPIC "], ["HASH", "TOPIC"], []),
    (["--ignore", "HASH,SEMANTIC"], [], ["HASH", "SEMANTIC"]),
    (["--select", "HASH", "--ignore", "FIELD_RENAMED"], ["HASH"], ["FIELD_RENAMED"]),
    (["--select", "FIELD_ADDED", "--ignore", "WIRE"], ["FIELD_ADDED"], ["WIRE"]),
]


@pytest.mark.slow
@pytest.mark.parametrize(("options", "selected", "ignored"), CHOICES)
def test_rules_are_chosen_on_the_command_line_or_in_the_settings(
    options: list[str], selected: list[str], ignored: list[str], capsys: Capture
) -> None:
    several()
    rules = {rule.id: rule.category.name for rule in BREAKING}

    def named(found: tuple[str, str], names: list[str]) -> bool:
        return bool({found[0], rules[found[0]]} & {*names})

    expected = {found for found in SEVERAL if (named(found, selected) or not selected) and not named(found, ignored)}
    assert broken(capsys, *AGAINST_V1, *options) == expected
    lines = [f"select = {selected}" if selected else "", f"ignore = {ignored}"]
    Path("pyproject.toml").write_text("\n".join(["[tool.msggen]", *lines]))
    assert broken(capsys) == expected


def test_the_command_line_wins_over_the_settings(capsys: Capture) -> None:
    several()
    Path("pyproject.toml").write_text('[tool.msggen]\nselect = ["WIRE"]\nignore = ["FIELD_RENAMED"]\n')
    assert broken(capsys) == ADDED
    assert broken(capsys, *AGAINST_V1, "--select", "HASH") == {("NESTED_NAME_CHANGED", "EscStatus")}
    assert broken(capsys, *AGAINST_V1, "--select", "HASH", "--ignore", "UNIT_CHANGED") == {
        ("FIELD_RENAMED", "EscReport"),
        ("NESTED_NAME_CHANGED", "EscStatus"),
    }
    assert broken(capsys, *AGAINST_V1, "--ignore", "UNIT_CHANGED") == ADDED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "gone"),
    [
        ('Rpm = ["FIELD_ADDED"]', ADDED),
        ('Rpm = "WIRE"', ADDED),
        ('Rpm = ["HASH"]', set()),
        ('rpm = ["WIRE"]', set()),
        ('"Esc*" = ["HASH", "UNIT_CHANGED"]', {found for found in SEVERAL if "NAME" in found[0] or "UNIT" in found[0]}),
        ('"*Status" = ["HASH", "CONSTANT_VALUE_CHANGED"]', {found for found in SEVERAL if found[1] == "EscStatus"}),
        ('"/fmu/out/sub/rpm" = ["TOPIC"]', {found for found in SEVERAL if "TOPIC" in found[0]}),
        ('"/fmu/*" = ["TOPIC"]', {found for found in SEVERAL if "TOPIC" in found[0]}),
        ('"*" = ["WIRE", "HASH", "SOURCE", "SEMANTIC", "TOPIC", "VERSION"]', SEVERAL),
        ("", set()),
    ],
)
def test_rules_do_not_count_for_messages_of_these_names(
    table: str, gone: set[tuple[str, str]], capsys: Capture
) -> None:
    several()
    Path("pyproject.toml").write_text(f"[tool.msggen.per-message-ignores]\n{table}\n")
    assert broken(capsys) == SEVERAL - gone


SETTINGS = [
    'ignore = ["WIRE"]',
    'per-message-ignores = { Rpm = ["FIELD_ADDED"] }',
    'per-message-ignores = { "*" = "WIRE" }',
]


@pytest.mark.parametrize("settings", ["", *SETTINGS])
def test_what_is_ignored_is_only_counted(settings: str, capsys: Capture) -> None:
    add_field()
    add_field(field="uint8 second")
    Path("pyproject.toml").write_text(f"[tool.msggen]\n{settings}")
    options = () if settings else ("--ignore", "WIRE")
    assert breaking(*AGAINST_V1, *options) == DONE
    assert capsys.readouterr().out == "firmware does not break v1: 8 messages, 1 service, 2 ignored\n"
    assert breaking(*AGAINST_V1, *options, "--output-format", "json") == DONE
    document = json.loads(capsys.readouterr().out)
    assert (document["ignored"], document["findings"]) == (2, [])
    assert breaking(*AGAINST_V1, *options, "--output-format", "sarif") == DONE
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert (run["properties"]["ignored"], run["results"]) == (2, [])


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("HomePositon", ", did you mean 'HomePosition'?"),
        ("rpm", ", did you mean 'Rpm'?"),
        ("/fmu/out/rmp", ", did you mean '/fmu/out/rpm'?"),
        ("Zzz*", ""),
    ],
)
def test_a_name_to_ignore_that_matches_nothing_is_told(name: str, hint: str, capsys: Capture) -> None:
    text = f'[tool.msggen]\n\n[tool.msggen.per-message-ignores]\nRpm = ["WIRE"]\n"{name}" = ["WIRE"]\n'
    Path("pyproject.toml").write_text(text)
    add_field()
    said = f"'{name}' matches no message, service or topic{hint}\n"
    for options in ((), ("--topics-only",)):
        assert breaking(*AGAINST_V1, *options) == DONE
        assert capsys.readouterr().err == f"pyproject.toml:5:1: C105 warning: {said}"
    assert told(capsys, *AGAINST_V1, "--strict") + "\n" == f"pyproject.toml:5:1: C105 {said}"


@pytest.mark.parametrize(
    "name", ["Rpm", "Gone", "Esc*", "VehicleCommand", "VehicleCommand_Request", "HomePositionV0", "/fmu/out/*", "*"]
)
def test_a_name_to_ignore_may_be_that_of_any_subject(name: str, capsys: Capture) -> None:
    """A message that is gone is one of the previous side. The archived version is missing."""
    write_definitions(FIRMWARE, {"msg/Gone.msg": STAMP})
    git(FIRMWARE, "add", "-A")
    git(FIRMWARE, "commit", "-q", "-m", "more")
    (FIRMWARE / "msg/Gone.msg").unlink()
    (FIRMWARE / ARCHIVE / "HomePositionV0.msg").unlink()
    edit("srv/VehicleCommand.srv", "---", "uint8 more\n---")
    Path("pyproject.toml").write_text(f'[tool.msggen.per-message-ignores]\n"{name}" = ["WIRE"]\n')
    breaking("--px4", "firmware", "--against", "HEAD")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("option", ["select", "ignore"])
@pytest.mark.parametrize(
    ("name", "hint"), [("WIER", ", did you mean 'WIRE'?"), ("field_adde", ", did you mean 'FIELD_ADDED'?"), ("X", "")]
)
def test_an_unknown_rule_is_told_where_it_stands(option: str, name: str, hint: str, capsys: Capture) -> None:
    assert told(capsys, *AGAINST_V1, f"--{option}", f"HASH,{name}") == f"--{option}: C104 unknown rule '{name}'{hint}"
    Path("pyproject.toml").write_text(f'[tool.msggen]\npx4 = "firmware"\n{option} = [\n  "HASH",\n  "{name}",\n]\n')
    assert told(capsys, "--against", "v1") == f"pyproject.toml:5:3: C104 unknown rule '{name}'{hint}"


PER_MESSAGE = "[tool.msggen.per-message-ignores]"


@pytest.mark.parametrize(
    "text",
    [
        '[tool.msggen]\nper-message-ignores = { Rpm = ["X"] }\n',
        '[tool.msggen]\nper-message-ignores.Rpm = ["X"]\n',
        f'[tool.msggen]\npx4 = "firmware"\n\n{PER_MESSAGE}\nRpm = ["X"]\n',
        f'[project]\nname = "x"\n\n{PER_MESSAGE}\nEscStatus = "WIRE"\n"Rpm" = [\n  "WIRE", "X"]\n',
    ],
)
def test_an_unknown_rule_of_a_message_is_told_where_it_stands(text: str, capsys: Capture) -> None:
    Path("pyproject.toml").write_text(text)
    before = text[: text.index('"X"')]
    line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
    assert told(capsys, *AGAINST_V1) == f"pyproject.toml:{line}:{column}: C104 unknown rule 'X'"


@pytest.mark.parametrize(
    "line",
    [
        "select = 1",
        "select = [1]",
        'select = [""]',
        'ignore = ""',
        'ignore = { Rpm = "WIRE" }',
        "per-message-ignores = 1",
        'per-message-ignores = ["WIRE"]',
        "per-message-ignores = { Rpm = 1 }",
        'per-message-ignores = { Rpm = [["WIRE"]] }',
    ],
)
def test_a_choice_of_the_wrong_kind_is_told(line: str, capsys: Capture) -> None:
    Path("pyproject.toml").write_text(f"[tool.msggen]\n{line}\n")
    assert told(capsys, *AGAINST_V1).startswith(f"pyproject.toml:2:1: C103 '{line.partition(' ')[0]}")


@pytest.mark.parametrize("name", ["DRIFT", "DEFINITION_ADDED"])
def test_rules_that_breaking_never_asks_cannot_be_all_that_is_asked(name: str, capsys: Capture) -> None:
    add_field()
    assert "C104" in told(capsys, *AGAINST_V1, "--select", name)


def test_choices_do_not_touch_check(capsys: Capture) -> None:
    """`check` ignores the choice of rules, because it must prove that both sides are the same."""
    Path("pyproject.toml").write_text('[tool.msggen]\nselect = ["TOPIC"]\nignore = ["WIRE"]\n')
    add_field()
    assert main(["check", "firmware@v1", "firmware"]) == FINDINGS
    assert "FIELD_ADDED" in capsys.readouterr().out


# --- Versions

NEW_FIELD = "float32 accuracy  # [m]"
HANDLED = {("FIELD_ADDED", "HomePosition"), ("TOPIC_RENAMED", "/fmu/out/home_position")}
HEADER = f"{TRANSLATIONS}/translation_home_position_v2.h"
ALL = f"{TRANSLATIONS}/all_translations.h"


def header(*messages: tuple[str, int]) -> str:
    """Return a header that translates messages from these versions to the current ones."""
    return "\n".join(["#pragma once", *(_translation(name, version) for name, version in messages), ""])


def _translation(name: str, version: int) -> str:
    """Return a class that copies the fields that both versions have, and sets the others to zero."""
    file = f"msg/versioned/{name}.msg"
    texts = git(FIRMWARE, "show", f"v1:{file}") + "\n", (FIRMWARE / file).read_text(encoding="utf-8")
    older, newer = ([field for _, _, field in slow.definition(text).fields] for text in texts)
    sides = ("Older", older, "older", newer, "newer"), ("Newer", newer, "newer", older, "older")
    lines = [f"struct {name}Translation {{", f"\tusing MessageOlder = px4_msgs_old::msg::{name}V{version};"]
    lines.append(f"\tusing MessageNewer = px4_msgs::msg::{name};")
    for source, known, at, fields, to in sides:
        function, target = ("fromOlder", "Newer") if source == "Older" else ("toOlder", "Older")
        lines.append(f"\tstatic void {function}(const Message{source} &{at}, Message{target} &{to}) {{")
        values = {field: f"{at}.{field}" if field in known else "{}" for field in fields}
        lines += [*(f"\t\t{to}.{field} = {value};" for field, value in values.items()), "\t}"]
    return "\n".join([*lines, "};"])


def archive(file: str, number: int, old: str = "", new: str = "") -> None:
    """Archive the definition of `v1`, with `old` replaced by `new`."""
    text = git(FIRMWARE, "show", f"v1:{file}") + "\n"
    assert old in text
    name = f"{Path(file).stem}V{number}"
    write_definitions(FIRMWARE, {f"{ARCHIVE}/{name}.msg": text.replace(old, new) if old else text})


def raise_version(file: str, old: int, new: int) -> None:
    edit(file, f"MESSAGE_VERSION = {old}", f"MESSAGE_VERSION = {new}")


def bump() -> None:
    """Add a field to HomePosition, with a complete new version."""
    add_field(HOME, NEW_FIELD)
    raise_version(HOME, 1, 2)
    archive(HOME, 1)
    include = '#pragma once\n\n#include "translation_home_position_v2.h"\n'
    write_definitions(FIRMWARE, {HEADER: header(("HomePosition", 1)), ALL: include})


def test_a_complete_new_version_takes_care_of_its_change(capsys: Capture) -> None:
    bump()
    assert broken(capsys) == NONE
    assert handled(capsys) == HANDLED
    assert breaking(*AGAINST_V1, "--output-format", "concise") == DONE
    *lines, last = capsys.readouterr().out.splitlines()
    assert all(" handled: " in line for line in lines)
    assert last == "firmware does not break v1: 8 messages, 1 service, 2 handled"


def test_notes_about_ids_are_left_out(capsys: Capture) -> None:
    """No finding depends on ids."""
    bump()
    lists = "set(msg_files versioned/HomePosition.msg)\nif(CONFIG_A)\n\tlist(APPEND msg_files Rpm.msg)\nendif()\n"
    (FIRMWARE / "msg" / "CMakeLists.txt").write_text(lists)
    assert main(["build", "--px4", "firmware", "-o", "out"]) == DONE
    assert "M407 note: " in capsys.readouterr().err
    assert breaking(*AGAINST_V1) == DONE
    assert "note: " not in capsys.readouterr().err


def test_it_takes_care_of_names_and_moves_as_well(capsys: Capture) -> None:
    bump()
    edit(HOME, "float64 lat ", "float64 latitude ")
    edit(HOME, "bool valid_alt ", "uint8 valid_alt ")
    text = header(("HomePosition", 1))
    (FIRMWARE / HEADER).write_text(text)
    assert broken(capsys) == {("FIELD_RENAMED", "HomePosition")}, "the latitude is lost"
    for target, source in (("newer.latitude", "older.lat"), ("older.lat", "newer.latitude")):
        assert f"{target} = {{}}" in text
        text = text.replace(f"{target} = {{}}", f"{target} = {source}")
    (FIRMWARE / HEADER).write_text(text)
    assert broken(capsys) == NONE
    renamed = {("FIELD_RENAMED", "HomePosition"), ("FIELD_RETYPED", "HomePosition")}
    assert handled(capsys) == HANDLED | renamed


def test_it_does_not_take_care_of_constants_and_units(capsys: Capture) -> None:
    bump()
    add_field(HOME, "uint8 KIND = 1")
    git(FIRMWARE, "add", "-A")
    git(FIRMWARE, "commit", "-q", "-m", "bumped")
    git(FIRMWARE, "tag", "v2")
    edit(HOME, "uint8 KIND = 1", "uint8 KIND = 2")
    edit(HOME, "alt  # [m]", "alt  # [mm]")
    expected = {("CONSTANT_VALUE_CHANGED", "HomePosition"), ("UNIT_CHANGED", "HomePosition")}
    assert broken(capsys, "--px4", "firmware", "--against", "v2") == expected


class Lack(NamedTuple):
    """A step that is missing from a new version, and the rule that reports it."""

    what: str
    make: Callable[[], object]
    rule: str


LACKS = [
    Lack("number", lambda: raise_version(HOME, 2, 1), "VERSION_NOT_RAISED"),
    Lack("number by one", lambda: raise_version(HOME, 2, 3), "VERSION_NOT_RAISED"),
    Lack("number upwards", lambda: raise_version(HOME, 2, 0), "VERSION_NOT_RAISED"),
    Lack("archive", lambda: os.unlink(FIRMWARE / ARCHIVE / "HomePositionV1.msg"), "VERSION_NOT_ARCHIVED"),
    Lack("definition", lambda: archive(HOME, 1, "float64 lat ", "float32 lat "), "VERSION_NOT_ARCHIVED"),
    Lack("name", lambda: archive(HOME, 1, "float64 lat ", "float64 latitude "), "VERSION_NOT_ARCHIVED"),
    Lack("order", lambda: archive(HOME, 1, STAMP[:-1], "bool valid"), "VERSION_NOT_ARCHIVED"),
    Lack("number in the archive", lambda: archive(HOME, 1, "_VERSION = 1", "_VERSION = 0"), "VERSION_NOT_ARCHIVED"),
    Lack("header", lambda: os.unlink(FIRMWARE / HEADER), "TRANSLATION_MISSING"),
    Lack("include", lambda: edit(ALL, "#include", "// #include"), "TRANSLATION_MISSING"),
    Lack("list of headers", lambda: os.unlink(FIRMWARE / ALL), "TRANSLATION_MISSING"),
    Lack("older type", lambda: edit(HEADER, "HomePositionV1", "HomePositionV11"), "TRANSLATION_MISSING"),
    Lack("newer type", lambda: edit(HEADER, "::HomePosition;", "::Home;"), "TRANSLATION_MISSING"),
]


@pytest.mark.slow
@by_day("lack", LACKS, 2, ids=[lack.what for lack in LACKS])
def test_nothing_less_does(lack: Lack, capsys: Capture) -> None:
    bump()
    lack.make()
    failing = broken(capsys)
    assert {rule for rule, _ in failing if str(rule).startswith(("VERSION", "TRANSLATION"))} == {lack.rule}
    assert failing >= {("FIELD_ADDED", "HomePosition")}
    assert handled(capsys) == NONE


def test_an_edit_without_a_new_version_asks_for_one_at_its_constant(capsys: Capture) -> None:
    add_field(HOME, NEW_FIELD)
    assert breaking(*AGAINST_V1, "--select", "VERSION", "--output-format", "concise") == FINDINGS
    line = next(number for number, text in enumerate(definition("HomePosition").splitlines(), 1) if "VERSION" in text)
    assert capsys.readouterr().out.splitlines()[0] == (
        f"firmware/{HOME}:{line}:1: VERSION_NOT_RAISED 'HomePosition' changed: expected MESSAGE_VERSION = 2, found 1"
    )


@pytest.mark.parametrize("number", [0, 2, 7])
def test_another_number_alone_is_needless(number: int, capsys: Capture) -> None:
    raise_version(HOME, 1, number)
    found = broken(capsys, *AGAINST_V1, "--select", "VERSION_NEEDLESS,VERSION_NOT_RAISED")
    assert found == {("VERSION_NEEDLESS", "HomePosition")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (ACK, "RESULT_DENIED = 2", "RESULT_DENIED = 9"),
        (ACK, "uint8 ORB_QUEUE_LENGTH = 8\n", ""),
        (HOME, "alt  # [m]", "alt  # [mm]"),
        (HOME, "yaw  # [rad] [@frame NED]", "yaw  # [rad] [@frame ENU]"),
        (ACK, "[@enum VEHICLE_CMD_RESULT]", "[@enum ARM_AUTH_DENIED_REASON]"),
    ],
)
def test_a_new_version_is_not_needless_where_the_meaning_is_another(
    file: str, old: str, new: str, capsys: Capture
) -> None:
    """A change of meaning does not require a new version, and a new version for it is not reported as needless."""
    edit(file, old, new)
    assert broken(capsys, *AGAINST_V1, "--select", "VERSION") == NONE
    raise_version(file, 1, 2)
    assert broken(capsys, *AGAINST_V1, "--select", "VERSION_NEEDLESS") == NONE


def test_comments_ask_for_no_version(capsys: Capture) -> None:
    edit(HOME, "WGS84 latitude, north positive", "Other words")
    assert broken(capsys) == NONE


# --- Versions of nested messages


def bump_event(*, with_reply: bool = True) -> None:
    """Add a field to Event, which ArmingCheckReply nests; both are versioned, so both need a new version."""
    add_field(EVENT, "uint8 severity")
    raise_version(EVENT, 1, 2)
    archive(EVENT, 1)
    messages = [("Event", 1)]
    if with_reply:
        raise_version(REPLY, 1, 2)
        archive(REPLY, 1, "Event[5] events", "EventV1[5] events")
        messages.append(("ArmingCheckReply", 1))
    write_definitions(FIRMWARE, {f"{TRANSLATIONS}/both.h": header(*messages), ALL: '#include "both.h"\n'})


def test_both_versions_go_up_where_one_message_nests_the_other(capsys: Capture) -> None:
    """The archived message nests the archived type, which has another name."""
    bump_event()
    assert broken(capsys) == NONE
    assert handled(capsys) == {
        ("FIELD_ADDED", "Event"),
        ("NESTED_LAYOUT_CHANGED", "ArmingCheckReply"),
        ("TOPIC_RENAMED", "/fmu/in/arming_check_reply"),
    }


def test_a_new_version_of_the_nested_one_alone_is_not_enough(capsys: Capture) -> None:
    bump_event(with_reply=False)
    reply = {("NESTED_LAYOUT_CHANGED", "ArmingCheckReply"), ("VERSION_NOT_RAISED", "ArmingCheckReply")}
    assert broken(capsys) == reply
    assert handled(capsys) == {("FIELD_ADDED", "Event")}


def test_without_any_new_version_both_are_asked_for(capsys: Capture) -> None:
    edit(EVENT, "uint32 id ", "uint64 id ")
    not_raised = {found for found in broken(capsys) if found[0] == "VERSION_NOT_RAISED"}
    assert not_raised == {("VERSION_NOT_RAISED", "ArmingCheckReply"), ("VERSION_NOT_RAISED", "Event")}


def test_a_name_in_what_is_nested_asks_for_a_version_too(capsys: Capture) -> None:
    """The hash of the outer message changes."""
    edit(EVENT, "uint8 log_levels", "uint8 levels")
    assert ("VERSION_NOT_RAISED", "ArmingCheckReply") in broken(capsys)


@pytest.mark.slow
@pytest.mark.parametrize("nested", ["Event", "RpmV0", "HomePositionV0"])
def test_the_archived_message_nests_the_archived_type(nested: str, capsys: Capture) -> None:
    bump_event()
    archive(REPLY, 1, "Event[5] events", f"{nested}[5] events")
    assert ("VERSION_NOT_ARCHIVED", "ArmingCheckReply") in broken(capsys)


def test_a_type_without_versions_inside_of_a_versioned_message(capsys: Capture) -> None:
    add_field(HOME, "Rpm rpm")
    git(FIRMWARE, "commit", "-q", "-a", "-m", "nest")
    add_field(RPM)
    expected = {*ADDED, ("NESTED_LAYOUT_CHANGED", "HomePosition"), ("VERSION_NOT_RAISED", "HomePosition")}
    assert broken(capsys, "--px4", "firmware", "--against", "HEAD") == expected


# --- Versions that are added or removed


def test_a_message_that_becomes_versioned_keeps_the_rules(capsys: Capture) -> None:
    os.unlink(FIRMWARE / RPM)
    text = f"uint32 MESSAGE_VERSION = 0\n{definition('Rpm')}"
    write_definitions(FIRMWARE, {"msg/versioned/Rpm.msg": text})
    assert broken(capsys) == NONE


def test_a_message_that_becomes_versioned_with_another_number_is_found_by_its_topic(capsys: Capture) -> None:
    edit(RPM, STAMP[:-1], f"uint32 MESSAGE_VERSION = 1\n{STAMP[:-1]}")
    assert broken(capsys) == {("TOPIC_RENAMED", "/fmu/out/rpm")}


def test_a_message_that_loses_its_version_is_told(capsys: Capture) -> None:
    edit(ACK, "uint32 MESSAGE_VERSION = 1\n", "")
    assert broken(capsys) == {("VERSION_REMOVED", "VehicleCommandAck")}


def test_an_archived_version_that_goes_is_told(capsys: Capture) -> None:
    os.unlink(FIRMWARE / ARCHIVE / "HomePositionV0.msg")
    assert broken(capsys) == {("VERSION_REMOVED", "HomePositionV0")}


def test_a_message_that_goes_is_no_matter_of_its_version(capsys: Capture) -> None:
    os.unlink(FIRMWARE / HOME)
    edit(YAML, "  - topic: /fmu/out/home_position\n    type: px4_msgs::msg::HomePosition\n", "")
    assert broken(capsys) == {("MESSAGE_REMOVED", "HomePosition"), ("TOPIC_REMOVED", "/fmu/out/home_position")}


def test_a_tree_without_versioned_messages_asks_for_no_archive(capsys: Capture) -> None:
    """A px4_msgs package has no archived versions; only the firmware keeps them."""
    for folder, number in (("old", 1), ("new", 2)):
        text = definition("HomePosition").replace("MESSAGE_VERSION = 1", f"MESSAGE_VERSION = {number}")
        field = NEW_FIELD if number == 2 else ""
        write_definitions(Path(folder), {"msg/HomePosition.msg": f"{text}{field}\n"})
    assert broken(capsys, "--px4", "new", "--against", "old") == {("FIELD_ADDED", "HomePosition")}


@pytest.mark.parametrize("text", [f"uint32 MESSAGE_VERSION = 0\n{STAMP}nonsense\n", "uint8[0] x\n"])
def test_an_archived_version_that_cannot_be_read_is_told(text: str, capsys: Capture) -> None:
    write_definitions(FIRMWARE, {f"{ARCHIVE}/RpmV0.msg": text})
    assert told(capsys, *AGAINST_V1).startswith(f"firmware/{ARCHIVE}/RpmV0.msg:")


@pytest.mark.slow
@pytest.mark.parametrize("text", [f"\ufeff{STAMP}", f"{STAMP}uint8 class\n", f"# TOPICS  a\n{STAMP}"])
def test_errors_that_do_not_matter_elsewhere_do_not_matter_in_the_archive(text: str, capsys: Capture) -> None:
    write_definitions(FIRMWARE, {"msg/Lamp.msg": text})
    assert broken(capsys) == NONE
    write_definitions(FIRMWARE, {f"{ARCHIVE}/LampV0.msg": text})
    assert broken(capsys) == NONE


@pytest.mark.slow
def test_from_v1_16_to_v1_17_two_archived_versions_are_not_what_was_shipped(capsys: Capture) -> None:
    """BatteryStatusV0 in the firmware has its fields in another order, and VehicleLocalPositionV0 lacks one."""
    old, new = shared("firmware/v1.16"), shared("firmware/v1.17")
    found = broken(capsys, "--px4", str(new), "--against", str(old), "--ignore", "TRANSLATION_MISSING")
    assert {subject for rule, subject in found if rule == "VERSION_NOT_ARCHIVED"} == {
        "BatteryStatus",
        "VehicleLocalPosition",
    }
    assert ("VERSION_NEEDLESS", "VehicleLocalPosition") in found
    assert not {subject for rule, subject in found if rule == "VERSION_NOT_RAISED"}


# --- The bridge


def bridge(text: str) -> None:
    """Commit `text` as the YAML."""
    write_definitions(FIRMWARE, {YAML: text})
    git(FIRMWARE, "commit", "-q", "-a", "--allow-empty", "-m", "bridge")


ENTRY = "publications:\n- topic: /fmu/out/rpm\n  type: px4_msgs::msg::Rpm\n"
ESC = "- topic: /fmu/out/esc_status\n  type: px4_msgs::msg::EscStatus\n"
WARNED = {("RATE_LIMIT_CHANGED", "/fmu/out/rpm")}


def on_the_bridge(capsys: Capture, before: str, after: str) -> set[tuple[object, object]]:
    """Return all findings, warnings included, for a change of the YAML alone."""
    bridge(before)
    write_definitions(FIRMWARE, {YAML: after})
    return {(each["rule"], each["subject"]) for each in findings(capsys, "--px4", "firmware", "--against", "HEAD")}


@pytest.mark.slow
@by_day(
    ("before", "after", "found"),
    [
        ("", "  rate_limit: 250\n", NONE),
        ("", "  rate_limit: 250.0\n", NONE),
        ("  rate_limit: 334\n", "  rate_limit: 333\n", NONE),
        ("  rate_limit: off\n", "  rate_limit: None\n", NONE),
        ("", "  rate_limit: 100\n", WARNED),
        ("  rate_limit: 0\n", "  rate_limit: unlimited\n", NONE),
        ("  rate_limit: 5\n", "  rate_limit: 5.\n", NONE),
        ("  options: {}\n", "", NONE),
        ("", "  rate_limit: 50\n", WARNED),
        ("  rate_limit: 5\n", "", WARNED),
        ("", "  rate_limit: unlimited\n", WARNED),
        ("  rate_limit: 0\n", "  rate_limit: 1000\n", WARNED),
    ],
    2,
)
def test_a_rate_counts_by_what_the_firmware_makes_of_it(
    before: str, after: str, found: set[tuple[str, str]], capsys: Capture
) -> None:
    assert on_the_bridge(capsys, ENTRY + before, ENTRY + after) == found


MULTI = ENTRY.replace("publications", "subscriptions_multi").replace("/out/", "/in/")
ROUTED = f"{MULTI}  route_field: id\n  max_instances: 4\n"
ROUTE = {("ROUTE_CHANGED", "/fmu/in/rpm")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        (MULTI, ROUTED, ROUTE),
        (ROUTED, MULTI, ROUTE),
        (MULTI.replace("_multi", ""), MULTI, ROUTE),
        (ROUTED, ROUTED.replace(": 4", ": 3"), ROUTE),
        (ROUTED, ROUTED.replace(": 4", ": 5"), NONE),
        (ROUTED, ROUTED.replace(": id", ": source"), ROUTE),
        (ROUTED, ROUTED, NONE),
    ],
)
def test_a_route_decides_which_instance_a_sample_reaches(
    before: str, after: str, found: set[tuple[str, str]], capsys: Capture
) -> None:
    write_definitions(FIRMWARE, {"msg/Rpm.msg": "uint64 timestamp\nuint8 id\nuint8 source\n"})
    assert on_the_bridge(capsys, before, after) == found


def test_options_of_zenoh_are_compared(capsys: Capture) -> None:
    before, after = (f"{ENTRY}  options: {{{options}}}\n" for options in ("cc: drop, rel: reliable", "cc: block"))
    assert on_the_bridge(capsys, before, after) == {("OPTIONS_CHANGED", "/fmu/out/rpm")}


def test_a_warning_is_shown_and_fails_nothing(capsys: Capture) -> None:
    bridge(ENTRY)
    write_definitions(FIRMWARE, {YAML: f"{ENTRY}  rate_limit: 5\n"})
    assert breaking("--px4", "firmware", "--against", "HEAD", "--output-format", "concise") == DONE
    *_, finding, last = capsys.readouterr().out.splitlines()
    assert (
        "RATE_LIMIT_CHANGED warning: '/fmu/out/rpm' is sent with at most 5 Hz, but with at most 250 Hz in HEAD"
        in finding
    )
    assert last.endswith("does not break HEAD with 1 warning: 8 messages, 1 service")


@pytest.mark.slow
@pytest.mark.parametrize("empty", ["", "publications:\n", "publications: []\nsubscriptions: null\n", "{}\n"])
def test_a_bridge_may_be_empty(empty: str, capsys: Capture) -> None:
    assert on_the_bridge(capsys, empty, empty) == NONE
    assert on_the_bridge(capsys, empty, ENTRY) == NONE
    assert on_the_bridge(capsys, ENTRY, empty) == {("TOPIC_REMOVED", "/fmu/out/rpm")}


def test_the_order_of_the_entries_does_not_count(capsys: Capture) -> None:
    other = ENTRY.removeprefix("publications:\n")
    assert on_the_bridge(capsys, ENTRY + ESC, f"subscriptions: []\npublications:\n{ESC}{other}") == NONE


def instances(*numbers: int) -> str:
    entry = "- topic: /fmu/out/rpm\n  type: px4_msgs::msg::Rpm\n  instance: "
    return "publications:\n" + "".join(f"{entry}{number}\n" for number in numbers)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        (instances(0, 1), instances(1, 0), NONE),
        (instances(0), instances(0, 1), NONE),
        (instances(0, 1), instances(0), {("TOPIC_REMOVED", "/fmu/out/rpm")}),
        (instances(1), instances(2), {("TOPIC_MOVED", "/fmu/out/rpm")}),
        (ENTRY, instances(1), {("TOPIC_MOVED", "/fmu/out/rpm")}),
        (f"{instances(0, 1)}  rate_limit: 5\n", f"{instances(0, 1)}  rate_limit: 6\n", WARNED),
    ],
)
def test_each_instance_of_a_topic_is_a_topic_of_its_own(
    before: str, after: str, found: set[tuple[str, str]], capsys: Capture
) -> None:
    assert on_the_bridge(capsys, before, after) == found


def test_another_direction_is_another_topic(capsys: Capture) -> None:
    after = ENTRY.replace("publications", "subscriptions").replace("/out/", "/in/")
    assert on_the_bridge(capsys, ENTRY, after) == {("TOPIC_MOVED", "/fmu/in/rpm")}


def test_another_direction_under_the_same_name_is_found(capsys: Capture) -> None:
    assert on_the_bridge(capsys, ENTRY, ENTRY.replace("publications", "subscriptions")) != NONE


def test_a_topic_that_carries_another_message_is_retyped(capsys: Capture) -> None:
    edit(RPM, STAMP[:-1], f"# TOPICS rpm shared\n{STAMP[:-1]}")
    bridge(ENTRY.replace("/rpm", "/shared"))
    edit(RPM, "# TOPICS rpm shared\n", "")
    edit("msg/EscStatus.msg", STAMP[:-1], f"# TOPICS esc_status shared\n{STAMP[:-1]}")
    edit(YAML, "::Rpm", "::EscStatus")
    assert broken(capsys, "--px4", "firmware", "--against", "HEAD") == {("TOPIC_RETYPED", "/fmu/out/shared")}


def test_a_topic_of_another_package_is_retyped(capsys: Capture) -> None:
    bridge(ENTRY)
    edit(YAML, "px4_msgs::msg::Rpm", "acme_msgs::msg::Rpm")
    assert broken(capsys, "--px4", "firmware", "--against", "HEAD") == {("TOPIC_RETYPED", "/fmu/out/rpm")}


def test_without_a_bridge_on_both_sides_topics_are_not_asked_for(capsys: Capture) -> None:
    shutil.copytree("firmware", "old")
    shutil.rmtree("old/src")
    edit(YAML, "/fmu/out/rpm", "/fmu/out/sub/rpm")
    assert broken(capsys, "--px4", "firmware", "--against", "old") == NONE


# --- Several changes in one message


def test_a_renamed_field_and_a_new_one_are_told_apart(capsys: Capture) -> None:
    edit(RPM, "float32 rpm_raw", "float32 rpm_measured")
    add_field()
    assert broken(capsys) == {("FIELD_RENAMED", "Rpm"), *ADDED}


def test_a_new_field_in_front_moves_nothing_but_bytes(capsys: Capture) -> None:
    edit(RPM, "float32 rpm_estimate", "float32 first\nfloat32 rpm_estimate")
    assert broken(capsys) == ADDED


def test_two_fields_that_trade_names_are_moved_and_silent(capsys: Capture) -> None:
    edit(RPM, "float32 rpm_estimate", "float32 rpm_")
    edit(RPM, "float32 rpm_raw", "float32 rpm_estimate")
    edit(RPM, "float32 rpm_  #", "float32 rpm_raw  #")
    found = findings(capsys)
    assert {(each["rule"], each["silent"]) for each in found} == {("FIELD_MOVED", True)}


def test_what_a_new_version_takes_care_of_may_be_silent(capsys: Capture) -> None:
    bump()
    edit(HOME, f"\n{NEW_FIELD}\n", "")
    edit(HOME, "float32 roll ", "float32 pitch_ ")
    edit(HOME, "float32 pitch ", "float32 roll ")
    edit(HOME, "float32 pitch_ ", "float32 pitch ")
    (FIRMWARE / HEADER).write_text(header(("HomePosition", 1)))
    found = [each for each in findings(capsys) if each["rule"] == "FIELD_MOVED"]
    assert [(each["silent"], each["handled"], each["fails"]) for each in found] == [(True, True, False)]


# --- Output


@pytest.mark.slow
@pytest.mark.parametrize("output_format", FORMATS)
def test_every_format_gives_the_same_exit_code(output_format: str, capsys: Capture) -> None:
    assert breaking(*AGAINST_V1, "--output-format", output_format) == DONE
    several()
    assert breaking(*AGAINST_V1, "--output-format", output_format) == FINDINGS
    shown = capsys.readouterr().out
    assert all(str(rule) in shown for rule, _ in SEVERAL)


def test_findings_come_sorted_by_what_they_are_about_and_their_place(capsys: Capture) -> None:
    several()
    bump()
    found = findings(capsys)
    places = [(each["subject"], *each["location"].values()) for each in found]  # type: ignore[attr-defined]
    assert len(found) > len(SEVERAL)
    assert places == sorted(places)


@pytest.mark.slow
def test_the_output_is_the_same_in_every_process() -> None:
    """The order of a set differs between processes."""
    several()
    bump()
    command = [sys.executable, "-m", "msggen", "breaking", *AGAINST_V1, "--output-format", "full"]
    shown = set()
    for seed in ("0", "1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(command, capture_output=True, env=environment, check=False, text=True)
        assert (done.returncode, done.stderr) == (FINDINGS, "")
        shown.add(done.stdout)
    assert len(shown) == 1


@pytest.mark.slow
def test_a_commit_that_breaks_something_is_stopped_by_a_hook(capsys: Capture) -> None:
    """Git runs hooks with variables that name the hook's own repository, but the firmware is in another one."""
    committed(write_definitions(Path("other"), {"msg/Other.msg": STAMP}))
    hook = Path("other/.git/hooks/pre-commit")
    hook.parent.mkdir(exist_ok=True)
    hook.write_text(f"#!/bin/sh\nexec '{sys.executable}' -m msggen breaking --px4 ../firmware --against v1\n")
    hook.chmod(0o755)
    git(Path("other"), "commit", "-q", "--allow-empty", "-m", "passes")
    add_field()
    with pytest.raises(subprocess.CalledProcessError) as stopped:
        git(Path("other"), "commit", "-q", "--allow-empty", "-m", "is stopped")
    assert "FIELD_ADDED" in stopped.value.stdout + stopped.value.stderr
    assert git(Path("other"), "log", "-1", "--format=%s") == "passes"
    assert capsys.readouterr().out == ""


def test_topics_only_compares_what_crosses_the_bridge_on_either_side(working_folder: Path, capsys: Capture) -> None:
    entry = "- topic: /fmu/out/{}\n  type: px4_msgs::msg::{}\n"
    old, new = entry.format("old", "Old"), entry.format("new", "New")
    bridges = {"was": f"publications:\n{old}{new}", "now": f"publications:\n{new}"}
    changed = {"was": "", "now": "uint8 x\n"}
    for side in ("was", "now"):
        files = {f"msg/{name}.msg": STAMP + changed[side] for name in ("Old", "Inner", "Inside")}
        files["msg/New.msg"] = STAMP + ("Inner inner\nFree free\n" if side == "was" else "Inner inner\n")
        files["msg/Free.msg"] = STAMP  # no longer nested, but not removed
        write_definitions(working_folder, {f"{side}/{name}": text for name, text in files.items()})
        (working_folder / side / "dds_topics.yaml").write_text(bridges[side])
    sides = ("--px4", "now", "--against", "was")
    everything = broken(capsys, *sides)
    assert broken(capsys, *sides, "--topics-only") == everything - {("FIELD_ADDED", "Inside")}
    assert {("FIELD_ADDED", "Old"), ("FIELD_ADDED", "Inner"), ("FIELD_ADDED", "Inside")} < everything
    (working_folder / "now" / "dds_topics.yaml").unlink()
    (working_folder / "was" / "dds_topics.yaml").unlink()
    assert told(capsys, *sides, "--topics-only") == "was: S110 no dds_topics.yaml here: name one with --topics"
