"""Tests of the source that a command takes from the current folder, and of folders that are not a whole source."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from msggen.base.diagnostics import printable
from msggen.cli import DONE, FAILED, main
from support.catalogs import write_definitions
from support.commands import run
from support.examples import by_day
from support.repository import ROOT

STAMP = "uint64 timestamp\n"
PACKAGE = "<package><name>{}</name></package>"
TREE = {"msg/Lamp.msg": STAMP, "msg/versioned/Bulb.msg": STAMP, "src/modules/uxrce_dds_client/dds_topics.yaml": ""}
ROS_PACKAGE = {"msg/Lamp.msg": STAMP, "package.xml": PACKAGE.format("px4_msgs")}
OLD_TREE = {
    "msg/CMakeLists.txt": "set(msg_files vehicle_status.msg)\n",
    **{f"msg/old_{number}.msg": "uint8 x\n# TOPICS  a  b\n" for number in range(100)},
}
OLD_TREES = {
    "v1.13": {"src/modules/micrortps_bridge/README": "", "msg/tools/urtps_bridge_topics.yaml": "", **OLD_TREE},
    "v1.7": {"src/modules/uORB/README": "", "msg/templates/uorb/msg.h.template": "", **OLD_TREE},
}


@by_day(
    ("files", "label"),
    [
        (TREE, "the PX4-Autopilot tree in the current folder"),
        ({**TREE, "package.xml": PACKAGE.format("px4")}, "the PX4-Autopilot tree in the current folder"),
        (ROS_PACKAGE, "the package px4_msgs in the current folder"),
        ({"package.xml": PACKAGE.format("other")}, "the embedded PX4 v1.18"),
        ({**ROS_PACKAGE, "package.xml": PACKAGE.format("acme_msgs")}, "the package acme_msgs in the current folder"),
        ({"Lamp.msg": STAMP}, "the embedded PX4 v1.18"),
        ({"msg/Lamp.msg": STAMP, "dds_topics.yaml": ""}, "the embedded PX4 v1.18"),  # as a clone of msggen
    ],
    2,
)
def test_build_and_render_take_a_tree_or_a_package_and_name_it(
    files: dict[str, str], label: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder, {**files, "name.txt.j2": "{{ message.name }}\n"})
    assert main(["build"]) == DONE
    first, second, third = capsys.readouterr().out.splitlines()
    assert first.startswith(f"px4_types from {label}: ")
    assert second.startswith("generated/px4_types: ")
    assert third.startswith("to import it: ")
    assert main(["render", "--template", "name.txt.j2", "-o", "made"]) == DONE
    assert capsys.readouterr().out.startswith(f"name.txt.j2 from {label}: ")
    made = (working_folder / "generated" / "px4_types" / "msg" / "_lamp.py").exists()
    assert made == (not label.startswith("the embedded"))


def test_a_clone_of_msggen_builds_the_embedded_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["build", "-o", str(tmp_path)]) == DONE
    assert " from the embedded PX4 v1.18: " in capsys.readouterr().out


@pytest.mark.parametrize("how", ["option", "setting", "folder"])
def test_options_and_settings_take_precedence(
    how: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder, {**TREE, "other/Motor.msg": STAMP})
    if how == "setting":
        (working_folder / "pyproject.toml").write_text('[tool.msggen]\npx4 = "other"\n')
    options = {"option": ["--px4", "other"], "setting": [], "folder": ["--msg-dir", "other"]}[how]
    assert main(["build", *options]) == DONE
    assert capsys.readouterr().out.startswith("px4_types from other: 1 message,")


def test_check_and_sync_compare_with_the_tree_but_not_with_a_package(
    working_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder / "PX4-Autopilot", TREE)
    monkeypatch.chdir("PX4-Autopilot")
    assert main(["sync", "--create", "../px4_msgs"]) == DONE
    told = "created from the PX4-Autopilot tree in the current folder: 2 definitions\n"
    assert capsys.readouterr().out.endswith(told)
    assert main(["check", "../px4_msgs"]) == DONE
    told = "../px4_msgs matches the PX4-Autopilot tree in the current folder: 2 messages, 0 services\n"
    assert capsys.readouterr().out == told
    assert main(["sync", "../px4_msgs"]) == DONE
    monkeypatch.chdir("../px4_msgs")
    assert main(["check", "."]) == 2
    assert "another source than the embedded PX4 v1.18" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", [["build", "-q"], ["render", "-q", "--template", "t.j2", "-o", "o"], ["sync", "-q", "--create", "p"]]
)
@by_day("below", ["src", "src/modules/uxrce_dds_client"], 2)
def test_below_a_tree_the_embedded_release_is_read_with_a_warning(
    command: list[str],
    below: str,
    working_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_definitions(working_folder / "px4", TREE)
    write_definitions(working_folder / "px4" / below, {"t.j2": "{{ message.name }}"})
    monkeypatch.chdir(f"px4/{below}")
    tree = os.path.relpath(working_folder / "px4")
    told = f"in a PX4-Autopilot tree, but the embedded release is read: did you mean --px4 {tree}?"
    for _ in range(2):  # an up-to-date build prints it too
        assert main(command) == DONE
        assert capsys.readouterr().err == f".: S127 warning: {told}\n"
        if command[0] == "sync":
            break
    for named, folder in (("v1.18", "a"), (tree, "b")):
        target = [*command, "-o", folder] if command[0] == "build" else [*command[:-1], folder]
        assert main([*target, "--px4", named]) == DONE
        assert "S127" not in capsys.readouterr().err


@pytest.mark.parametrize("part", ["msg", "srv", "msg/versioned"])
def test_a_part_of_a_tree_is_refused_with_the_tree(
    part: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder / "px4", {**TREE, "srv/Ask.srv": "---\n"})
    refused = "S102 only a part of a firmware tree, did you mean '{}'?\n1 error, nothing written\n"
    assert main(["build", "--px4", f"px4/{part}"]) == FAILED
    assert capsys.readouterr().err == f"px4/{part}: {refused.format('px4')}"
    monkeypatch.chdir(f"px4/{part}")
    assert main(["build"]) == FAILED
    assert capsys.readouterr().err == f".: {refused.format('../..' if '/' in part else '..')}"
    assert not Path("generated").exists()


@pytest.mark.tools("git")
@pytest.mark.parametrize("tree", ["v1.13", "v1.7"])
@pytest.mark.parametrize("kind", ["folder", "current", "revision", "archive"])
def test_a_tree_before_v1_14_is_refused_in_a_line(
    kind: str, tree: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder / "px4", OLD_TREES[tree])
    named = {
        "folder": ["--px4", "px4"],
        "current": [],
        "revision": ["--px4", "px4@HEAD"],
        "archive": ["--px4", "px4.tar"],
    }
    if kind == "current":
        monkeypatch.chdir("px4")
    elif kind == "revision":
        author = ["-c", "user.name=tester", "-c", "user.email=tester@localhost"]
        for command in (["init", "-q"], ["add", "-A"], [*author, "commit", "-q", "-m", "old"]):
            subprocess.run(["git", *command], cwd="px4", check=True)
    elif kind == "archive":
        shutil.make_archive("px4", "tar", ".", "px4")
    assert main(["build", *named[kind]]) == FAILED
    first, last = capsys.readouterr().err.splitlines()
    assert first.endswith(": S105 a PX4-Autopilot tree before v1.14, the first release that msggen reads")
    assert last == "1 error, nothing written"


@pytest.mark.parametrize(
    "command", [["build"], ["render", "--template", "t.j2", "-o", "o"], ["breaking", "--against", "a"]]
)
def test_a_tree_without_its_option_is_told_the_option(command: list[str]) -> None:
    outcome = run([*command, "PX4-Autopilot"])
    assert outcome.code == FAILED
    assert outcome.stderr.splitlines()[0].endswith(
        "unknown argument 'PX4-Autopilot': name the firmware with --px4 PX4-Autopilot"
    )


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["PX4-Autopilot", "ws/px4_msgs"], ": name the firmware with --px4 PX4-Autopilot"),
        (["ws/px4_msgs", "PX4-Autopilot"], ": name the firmware with --px4 PX4-Autopilot"),
        (["ws/px4_msgs", "v1.17"], ": name the firmware with --px4 v1.17"),
        (["ws/px4_msgs", "other"], ": expected one PKG per run"),
        (["ws/px4_msgs", "\0"], ": expected one PKG per run"),
    ],
)
def test_sync_with_two_folders_is_told_which_one_is_the_firmware(
    words: list[str], hint: str, working_folder: Path
) -> None:
    write_definitions(working_folder, {f"PX4-Autopilot/{name}": text for name, text in TREE.items()})
    outcome = run(["sync", *words])
    assert outcome.code == FAILED
    assert outcome.stderr.splitlines()[0].endswith(f"unknown argument '{printable(words[1])}'{hint}")
