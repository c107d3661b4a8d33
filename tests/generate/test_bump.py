"""Tests that `msggen bump` does PX4's manual steps for a new version, and that its output compiles and translates.

The trees hold real definitions, embedded or from releases, and each is a git repository. The headers are compiled
against structs that resemble those of ROS 2.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from msggen.base.diagnostics import CODES
from msggen.base.exit_codes import INTERRUPTED
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.definitions.model import ArrayKind, FieldType, Message
from msggen.generate.bump.edits import plan_bump
from msggen.generate.bump.header import ros_file, with_include
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import embedded_tree
from msggen.sources.finding import find_sources
from msggen.sources.history import read_history
from msggen.sources.tree import Folder, Tree
from support.catalogs import write_definitions
from support.examples import by_day, some
from support.packages import packed
from support.repository import ROOT, shared

VERSIONED = Path("msg/versioned")
ARCHIVE = Path("msg/px4_msgs_old/msg")
TRANSLATIONS = Path("msg/translation_node/translations")
ALL = TRANSLATIONS / "all_translations.h"
STATUS = VERSIONED / "VehicleStatus.msg"
STATUS_V1 = ARCHIVE / "VehicleStatusV1.msg"
STATUS_V1_HEADER = TRANSLATIONS / "translation_vehicle_status_v1.h"
STATUS_V2_HEADER = TRANSLATIONS / "translation_vehicle_status_v2.h"
BRIDGE = Path("src/modules/uxrce_dds_client/dds_topics.yaml")

SOME_MESSAGES = {
    *("Rpm", "EscReport", "SensorCombined"),
    *("ArmingCheckReply", "ArmingCheckRequest", "Event", "VehicleCommand", "VehicleCommandAck"),
    *("VehicleAttitude", "VehicleOdometry", "VehicleStatus", "Wind"),
}
"""Of messages without versions, and with versions."""

GIT = shutil.which("git") or "git"

V1_HEADER = """#pragma once
#include <px4_msgs_old/msg/vehicle_status_v0.hpp>
#include <px4_msgs/msg/vehicle_status.hpp>

class VehicleStatusV1Translation {
public:
	using MessageOlder = px4_msgs_old::msg::VehicleStatusV0;
	using MessageNewer = px4_msgs::msg::VehicleStatus;
	static constexpr const char *kTopic = "fmu/out/vehicle_status";
	static void fromOlder(const MessageOlder &older, MessageNewer &newer) { newer.timestamp = older.timestamp; }
	static void toOlder(const MessageNewer &newer, MessageOlder &older) { older.timestamp = newer.timestamp; }
};

REGISTER_TOPIC_TRANSLATION_DIRECT(VehicleStatusV1Translation);
"""
V1_ALL = """#pragma once

#include <translation_util.h>

#include "translation_vehicle_status_v1.h"
"""


@pytest.fixture(scope="module")
def committed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A committed PX4 tree with some messages of the embedded v1.17, and an archived version of VehicleStatus.

    With all of them, each copy and each run would take many times as long.
    """
    tree = tmp_path_factory.mktemp("committed")
    release = embedded_tree("v1.17")
    folders = ("msg/", "msg/versioned/", "srv/")
    texts = {name: text for folder in folders for name, text in texts_in(release, folder)}
    files = {name: text for name, text in texts.items() if Path(name).stem in SOME_MESSAGES}
    files |= {
        str(STATUS_V1_HEADER): V1_HEADER,
        str(ALL): V1_ALL,
        "msg/translation_node/CMakeLists.txt": "# The node.\n",
    }
    known = {Path(name).stem for name in files}
    bridge = release.read("dds_topics.yaml").decode().splitlines(keepends=True)
    types = ((line, re.search(r"px4_msgs::msg::(\w+)", line)) for line in bridge)
    files[str(BRIDGE)] = "".join(line for line, found in types if found is None or found[1] in known)
    files[str(ARCHIVE / "VehicleStatusV0.msg")] = "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 nav_state\n"
    write_definitions(tree, files)
    commit(tree)
    return packed(tree)


@pytest.fixture(autouse=True)
def firmware(committed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that tree, as the current folder."""
    tree = shutil.copytree(committed, tmp_path / "PX4-Autopilot")
    monkeypatch.chdir(tree)
    return tree


@pytest.fixture
def edited(firmware: Path) -> None:
    """Add a constant to some messages, because a message without changes gets no new version."""
    for name in ("VehicleStatus", "VehicleOdometry", "Event", "Wind"):
        append(firmware / VERSIONED / f"{name}.msg", "uint8 EDITED = 1")


def texts_in(release: Tree, folder: str) -> Iterator[tuple[str, str]]:
    """Yield names and texts of the definitions in a folder of an embedded release."""
    for name in release.names(folder):
        if name.endswith((".msg", ".srv")):
            yield folder + name, release.read(folder + name).decode()


def commit(tree: Path) -> None:
    """Commit all files in `tree`, with no configuration but its own."""
    subprocess.run([GIT, "init", "-q"], cwd=tree, check=True)
    subprocess.run([GIT, "add", "-A"], cwd=tree, check=True)
    who = ["-c", "user.name=Someone", "-c", "user.email=someone@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run([GIT, *who, "commit", "-q", "-m", "State."], cwd=tree, check=True)


def git(*arguments: str) -> None:
    subprocess.run([GIT, *arguments], check=True, capture_output=True)


def edit(path: Path, old: str, new: str) -> None:
    """Replace the only occurrence of `old` in a file."""
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def append(path: Path, line: str) -> None:
    path.write_text(f"{path.read_text()}\n{line}\n")


def bump(*arguments: str) -> int:
    return main(["bump", *arguments])


def complete(folder: Path = TRANSLATIONS) -> None:
    """Remove the marks from all headers, as after a decision about each line."""
    for header in folder.glob("*.h"):
        header.write_text(re.sub(r" *// TODO.*", "", header.read_text()))


def files_of(tree: Path) -> dict[str, str]:
    """Return the texts of all files in `tree` except those of git."""
    paths = [path for path in tree.rglob("*") if path.is_file() and ".git" not in path.parts]
    return {str(path.relative_to(tree)): path.read_text() for path in paths}


def changes(before: dict[str, str], after: dict[str, str]) -> dict[str, str]:
    """Return the new text of each file that was added or changed."""
    assert before.keys() <= after.keys()
    return {name: text for name, text in after.items() if before.get(name) != text}


# --- Steps


def test_five_files_are_written(firmware: Path) -> None:
    before = files_of(firmware)
    append(STATUS, "uint8 battery_count")
    edited = STATUS.read_text()
    assert bump("VehicleStatus") == DONE
    changed = changes(before, files_of(firmware))
    assert set(changed) == set(map(str, (STATUS, STATUS_V1, STATUS_V1_HEADER, STATUS_V2_HEADER, ALL)))
    assert changed[str(STATUS_V1)] == before[str(STATUS)]
    assert changed[str(STATUS)] == edited.replace("MESSAGE_VERSION = 1", "MESSAGE_VERSION = 2")
    assert "newer.battery_count = 0;  // TODO: not in the older version\n" in changed[str(STATUS_V2_HEADER)]


@pytest.mark.parametrize("against", [(), ("--against", "HEAD"), ("--against", "HEAD~1")])
def test_a_message_without_changes_gets_no_new_version(
    firmware: Path, against: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """The change may be committed: then the last commit has the new definition, not the old one."""
    old = STATUS.read_text()
    append(STATUS, "uint8 battery_count")
    commit(firmware)
    append(VERSIONED / "Wind.msg", "uint8 more")
    commit(firmware)
    before = files_of(firmware)
    assert bump("VehicleStatus", *against) == FAILED
    base = against[1] if against else "HEAD"
    hint = "with --against HEAD~1" if base == "HEAD" else "with --against"
    told = f"'VehicleStatus' has no changes since {base}: edit it first, or name the base of a committed change {hint}"
    assert capsys.readouterr().err == f"{STATUS}: B107 {told}\n1 error, nothing written\n"
    assert files_of(firmware) == before
    assert bump("VehicleStatus", "--against", "HEAD~2") == DONE
    assert STATUS_V1.read_text() == old


@pytest.mark.parametrize("branch", ["main", "master", "origin/main"])
def test_the_hint_names_a_branch_that_exists(branch: str, capsys: pytest.CaptureFixture[str]) -> None:
    git("branch", "-M", "work")
    append(STATUS, "uint8 battery_count")
    assert bump("VehicleStatus", "--against", "HEAD") == DONE
    git("update-ref", f"refs/{'remotes' if '/' in branch else 'heads'}/{branch}", "HEAD")
    commit(Path.cwd())
    capsys.readouterr()
    assert bump("Wind") == FAILED
    assert capsys.readouterr().err.splitlines()[0].endswith(f"with --against {branch}")


def test_a_repository_of_one_commit_has_no_other_base(capsys: pytest.CaptureFixture[str]) -> None:
    assert bump("Wind") == FAILED
    assert capsys.readouterr().err.splitlines()[0].endswith("with --against")


@pytest.mark.parametrize("line", ["# A comment.", ""])
def test_comments_need_no_new_version(line: str, firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(STATUS, line)
    before = files_of(firmware)
    assert bump("VehicleStatus") == FAILED
    told = "only comments of 'VehicleStatus' changed since HEAD: no new version is needed"
    assert capsys.readouterr().err == f"{STATUS}: B107 {told}\n1 error, nothing written\n"
    assert files_of(firmware) == before


def test_comments_of_nested_messages_need_none_either(capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Event.msg", "# A comment.")
    assert bump("ArmingCheckReply") == FAILED
    assert "B107 only comments of 'ArmingCheckReply' changed" in capsys.readouterr().err


@pytest.mark.parametrize("outer", ["Event", "ArmingCheckReply"])
def test_constants_alone_are_noted(outer: str, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Event.msg", "uint8 KIND = 1")
    assert bump(outer) == DONE
    told = "B108 note: only constants were added since HEAD: KIND; the new version is optional"
    assert told in capsys.readouterr().err
    append(VERSIONED / "Wind.msg", "uint8 KIND = 1\nuint8 more")
    assert bump("Wind") == DONE
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("depth", range(4))
def test_the_remains_of_a_version_that_was_taken_back_are_found(
    depth: int, firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each step of the fix of VERSION_NEEDLESS leaves less to report; after the last one, the tree is as it was."""
    before = files_of(firmware)
    append(STATUS, "uint8 battery_count")
    assert bump("VehicleStatus") == DONE
    STATUS.write_text(before[str(STATUS)])
    places = [str(STATUS_V1), str(STATUS_V1_HEADER), str(STATUS_V2_HEADER)]
    if depth > 0:
        STATUS_V1.unlink()
        places.remove(str(STATUS_V1))
    if depth > 1:
        STATUS_V1_HEADER.write_text(before[str(STATUS_V1_HEADER)])
        places.remove(str(STATUS_V1_HEADER))
    if depth > 2:
        STATUS_V2_HEADER.unlink()
        places[-1] = str(ALL)
    capsys.readouterr()
    assert main(["breaking", "--against", "HEAD", "--output-format", "json"]) == FINDINGS
    found = json.loads(capsys.readouterr().out)["findings"]
    failed = [each for each in found if each["fails"]]
    assert {each["rule"] for each in failed} == {"TRANSLATION_INVALID"}
    assert [each["location"]["path"] for each in failed] == places
    for each in failed:
        line = Path(each["location"]["path"]).read_text().splitlines()[each["location"]["line"] - 1]
        assert "VehicleStatusV1" in line or "v2.h" in line or each["location"]["path"] == str(STATUS_V1)


def test_the_current_version_may_be_archived_for_another_message(
    firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """ArmingCheckReply archives the current version of Event, which it nests."""
    append(VERSIONED / "ArmingCheckReply.msg", "uint8 reason")
    assert bump("ArmingCheckReply") == DONE
    assert [path.name for path in (firmware / ARCHIVE).glob("Event*")] == ["EventV1.msg"]
    complete()
    capsys.readouterr()
    assert main(["breaking", "--against", "HEAD"]) == DONE


def test_a_removed_message_gets_no_new_version(capsys: pytest.CaptureFixture[str]) -> None:
    STATUS.unlink()
    assert bump("VehicleStatus") == FAILED
    told = "VehicleStatus: B102 'VehicleStatus' was removed: only HEAD has it\n1 error, nothing written\n"
    assert capsys.readouterr().err == told


def test_a_version_that_was_raised_by_hand_stays() -> None:
    edit(STATUS, "MESSAGE_VERSION = 1", "MESSAGE_VERSION  =  2 # raised")
    raised = STATUS.read_text()
    assert bump("VehicleStatus") == DONE
    assert STATUS.read_text() == raised
    assert "MESSAGE_VERSION = 1" in STATUS_V1.read_text()


@pytest.mark.slow
def test_only_the_number_changes_in_the_definition(firmware: Path) -> None:
    comment = "# uint32 MESSAGE_VERSION = 1\n"
    text = f"{comment}\tuint32   MESSAGE_VERSION=1{comment}uint64 timestamp  # \u00e4\n"
    (VERSIONED / "Wheel.msg").write_text(text)
    commit(firmware)
    text += "uint8 more\n"
    (VERSIONED / "Wheel.msg").write_text(text)
    assert bump("Wheel") == DONE
    assert (VERSIONED / "Wheel.msg").read_text() == text.replace("MESSAGE_VERSION=1#", "MESSAGE_VERSION=2#")


@pytest.mark.usefixtures("edited")
def test_earlier_headers_translate_to_the_archived_version() -> None:
    bump("VehicleStatus")
    expected = V1_HEADER.replace("px4_msgs::msg::VehicleStatus;", "px4_msgs_old::msg::VehicleStatusV1;")
    expected = expected.replace("<px4_msgs/msg/vehicle_status.hpp>", "<px4_msgs_old/msg/vehicle_status_v1.hpp>")
    assert STATUS_V1_HEADER.read_text() == expected


@pytest.mark.usefixtures("edited")
def test_messages_of_a_similar_name_are_left_alone() -> None:
    other = (
        "px4_msgs::msg::VehicleStatusFlags <px4_msgs/msg/vehicle_status_flags.hpp> px4_msgs_old::msg::VehicleStatusV0"
    )
    (TRANSLATIONS / "translation_other_v1.h").write_text(other)
    bump("VehicleStatus")
    assert (TRANSLATIONS / "translation_other_v1.h").read_text() == other


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("translation_a_v1.h", "a1 b2 c9 d1"),
        ("translation_b_v3.h", "b2 b3 c9 d1"),
        ("translation_c_v10.h", "b2 c9 c10 d1"),
        ("translation_e_v1.h", "b2 c9 d1 e1"),
    ],
)
def test_the_include_is_put_in_its_place(header: str, expected: str) -> None:
    text = "".join(f'#include "translation_{name}.h"\n' for name in ("b_v2", "c_v9", "d_v1"))
    text = with_include(f"#pragma once\n\n#include <translation_util.h>\n\n{text}// end", header)
    assert " ".join("".join(found) for found in re.findall(r'"translation_(\w)_v(\d+)\.h"\n', text)) == expected
    assert text.startswith("#pragma once\n\n#include <translation_util.h>\n\n#include")
    assert text.endswith('.h"\n// end')


@pytest.mark.slow
@pytest.mark.parametrize("text", ["", "#pragma once", "#pragma once\n\n#include <translation_util.h>"])
def test_the_first_include_finds_a_place(text: str) -> None:
    assert with_include(text, "translation_a_v1.h").endswith('#include "translation_a_v1.h"\n')


@pytest.mark.slow
def test_a_tree_without_translations_gets_them(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree("msg/translation_node")
    commit(firmware)
    append(VERSIONED / "Wind.msg", "uint8 more")
    assert bump("Wind") == DONE
    assert ALL.read_text().splitlines()[-3:] == [
        "#include <translation_util.h>",
        "",
        '#include "translation_wind_v1.h"',
    ]
    assert "has no translation node" in capsys.readouterr().out


def test_the_old_definition_can_come_from_another_tree(firmware: Path, tmp_path: Path) -> None:
    old = STATUS.read_text()
    write_definitions(tmp_path / "px4_msgs", {"msg/VehicleStatus.msg": old})
    append(STATUS, "uint8 battery_count")
    commit(firmware)
    assert bump("VehicleStatus", "--against", "../px4_msgs") == DONE
    assert STATUS_V1.read_text() == old


@pytest.mark.slow
def test_without_a_repository_the_file_as_it_stands_is_the_old_one(
    firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(firmware / ".git")
    old = STATUS.read_text()
    assert bump("VehicleStatus") == DONE
    assert STATUS_V1.read_text() == old
    assert "version 1 to 2, old definition from the current file" in capsys.readouterr().out


def test_a_message_versioned_just_now_is_archived_with_version_0() -> None:
    os.replace("msg/Rpm.msg", VERSIONED / "Rpm.msg")
    old = (VERSIONED / "Rpm.msg").read_text()
    (VERSIONED / "Rpm.msg").write_text(f"uint32 MESSAGE_VERSION = 1\n{old}")
    assert bump("Rpm") == DONE
    assert (ARCHIVE / "RpmV0.msg").read_text() == f"uint32 MESSAGE_VERSION = 0\n{old}"


@pytest.mark.usefixtures("edited")
def test_the_setting_px4_names_the_firmware(firmware: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pyproject.toml").write_text('[tool.msggen]\npx4 = "PX4-Autopilot"\n')
    monkeypatch.chdir(tmp_path)
    assert bump("VehicleStatus") == DONE
    assert (firmware / STATUS_V1).exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["VehicleStatus", str(STATUS)])
@pytest.mark.usefixtures("edited")
def test_a_message_may_be_named_by_its_file(firmware: Path, name: str) -> None:
    assert bump(name) == DONE
    assert (firmware / STATUS_V1).exists()


def test_ros_names_files_of_capitals_in_a_row_its_own_way() -> None:
    names = ["VehicleStatus", "TrajectorySetpoint6dof", "VehicleStatusV1", "GPSDump", "Px4ioStatus"]
    expected = ["vehicle_status", "trajectory_setpoint6dof", "vehicle_status_v1", "gps_dump", "px4io_status"]
    assert [ros_file(name) for name in names] == expected


# --- Repeated and interrupted runs, and files that stay


@pytest.mark.slow
@pytest.mark.parametrize("line", ["uint8 EDITED = 1", "uint8 battery_count"])
@pytest.mark.parametrize("name", ["VehicleStatus", "ArmingCheckReply"])
def test_a_second_run_changes_nothing(firmware: Path, name: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / f"{name}.msg", line)
    bump(name)
    before = {path: path.stat().st_mtime_ns for path in firmware.rglob("*") if ".git" not in path.parts}
    capsys.readouterr()
    assert bump(name) == DONE
    assert {path: path.stat().st_mtime_ns for path in firmware.rglob("*") if ".git" not in path.parts} == before
    assert "up to date" in capsys.readouterr().out


@pytest.mark.slow
def test_a_run_killed_anywhere_is_finished_by_another(
    firmware: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    append(VERSIONED / "ArmingCheckReply.msg", "uint8 reason")
    start = tmp_path / "start"
    shutil.copytree(firmware, start)
    bump("ArmingCheckReply")
    whole = files_of(firmware)
    steps = plan_bump(str(start), "ArmingCheckReply", None).changes
    assert len(steps) == 5
    replace = os.replace
    for last in some(range(len(steps)), 2):
        moves = iter(range(last))

        def stopping(source: str, target: str, moves: Iterator[int] = moves) -> None:
            if next(moves, None) is None:
                raise KeyboardInterrupt
            replace(source, target)

        tree = tmp_path / f"tree{last}"
        shutil.copytree(start, tree)
        with monkeypatch.context() as context:
            context.setattr(os, "replace", stopping)
            assert bump("ArmingCheckReply", "--px4", str(tree)) == INTERRUPTED
        assert len(changes(files_of(start), files_of(tree))) == last
        assert bump("ArmingCheckReply", "--px4", str(tree)) == DONE
        assert files_of(tree) == whole


def test_a_header_written_by_hand_stays(capsys: pytest.CaptureFixture[str]) -> None:
    append(STATUS, "uint8 battery_count")
    mine = V1_HEADER.replace("VehicleStatusV0", "VehicleStatusV1").replace("vehicle_status_v0", "vehicle_status_v1")
    STATUS_V2_HEADER.write_text(mine)
    assert bump("VehicleStatus") == DONE
    assert STATUS_V2_HEADER.read_text() == mine
    assert f'#include "{STATUS_V2_HEADER.name}"' in ALL.read_text()
    assert "this header existed before, add the fields" in capsys.readouterr().out


@pytest.mark.usefixtures("edited")
def test_a_translation_in_a_header_of_another_name_counts() -> None:
    mine = V1_HEADER.replace("VehicleStatusV0", "VehicleStatusV1").replace("vehicle_status_v0", "vehicle_status_v1")
    (TRANSLATIONS / "translation_split_v2.h").write_text(mine)
    append(ALL, '#include "translation_split_v2.h"')
    every = ALL.read_text()
    assert bump("VehicleStatus") == DONE
    assert (TRANSLATIONS / "translation_split_v2.h").read_text() == mine
    assert not STATUS_V2_HEADER.exists()
    assert ALL.read_text() == every


@pytest.mark.usefixtures("edited")
def test_an_archive_written_by_hand_stays_if_it_means_the_same() -> None:
    mine = "# By hand.\n" + STATUS.read_text()
    STATUS_V1.write_text(mine)
    assert bump("VehicleStatus") == DONE
    assert STATUS_V1.read_text() == mine


@pytest.mark.usefixtures("edited")
def test_permissions_are_kept() -> None:
    STATUS.chmod(0o640)
    assert bump("VehicleStatus") == DONE
    assert STATUS.stat().st_mode & 0o777 == 0o640


@pytest.mark.slow
@pytest.mark.parametrize("option", ["--check", "--diff"])
@pytest.mark.usefixtures("edited")
def test_what_would_change_is_told_and_not_done(
    firmware: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files_of(firmware)
    assert bump("VehicleStatus", option) == FINDINGS
    assert files_of(firmware) == before
    out = capsys.readouterr().out
    assert f"to create: {STATUS_V1}" in out
    assert ("+uint32 MESSAGE_VERSION = 2" in out) == (option == "--diff")
    bump("VehicleStatus")
    assert bump("VehicleStatus", option) == DONE


# --- Header


def test_fields_that_changed_are_marked(firmware: Path) -> None:
    append(VERSIONED / "Wind.msg", "float32[3] drift\nuint16 count\nint8 lost")
    commit(firmware)
    text = (VERSIONED / "Wind.msg").read_text()
    text = text.replace("float32[3] drift", "float64[3] drift").replace("uint16 count", "uint16 total")
    (VERSIONED / "Wind.msg").write_text(text.replace("int8 lost", "bool valid\nfloat32 gust\nchar[4] name"))
    assert bump("Wind") == DONE
    lines = [line.strip() for line in (TRANSLATIONS / "translation_wind_v1.h").read_text().splitlines()]
    start, middle = (index for index, line in enumerate(lines) if line.startswith("static void"))
    assert [line for line in lines[start:middle] if "TODO" in line or "dropped" in line] == [
        "newer.drift = {};  // TODO: float32[3] in the older version, float64[3] in the newer",
        "newer.total = 0;  // TODO: not in the older version; is it older.count by another name?",
        "newer.valid = false;  // TODO: not in the older version",
        "newer.gust = 0.0f;  // TODO: not in the older version",
        "newer.name = {};  // TODO: not in the older version",
        "// older.count is dropped: not in the newer version",
        "// older.lost is dropped: not in the newer version",
    ]
    assert [line for line in lines[middle:] if "TODO" in line or "dropped" in line] == [
        "older.drift = {};  // TODO: float64[3] in the newer version, float32[3] in the older",
        "older.count = 0;  // TODO: not in the newer version; is it newer.total by another name?",
        "older.lost = 0;  // TODO: not in the newer version",
        "// newer.total is dropped: not in the older version",
        "// newer.valid is dropped: not in the older version",
        "// newer.gust is dropped: not in the older version",
        "// newer.name is dropped: not in the older version",
    ]


CONSTANTS = "uint8 kind  # [@enum {}]\nuint8 KIND_A = 1\nuint8 KIND_B = 2\nuint8 other\nuint8 KEPT = 7"


@pytest.mark.slow
@by_day("tag", ["KIND", "WIND_KIND", "KIND MODE"], 2)
def test_fields_whose_constants_changed_are_marked(
    tag: str, firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    append(VERSIONED / "Wind.msg", CONSTANTS.format(tag))
    commit(firmware)
    edit(VERSIONED / "Wind.msg", "KIND_A = 1", "KIND_A = 2")
    edit(VERSIONED / "Wind.msg", "uint8 KIND_B = 2\n", "")
    edit(VERSIONED / "Wind.msg", "MESSAGE_VERSION = 0", "MESSAGE_VERSION = 1")
    assert bump("Wind") == DONE
    text = (TRANSLATIONS / "translation_wind_v1.h").read_text()
    assert [line.strip() for line in text.splitlines() if "TODO" in line and "constants" in line] == [
        "newer.kind = older.kind;  // TODO: other constants: KIND_A is 2, was 1, KIND_B is gone",
        "older.kind = newer.kind;  // TODO: other constants: KIND_A is 2, was 1, KIND_B is gone",
    ]
    said = "constants changed: KIND_A is 2, was 1, KIND_B is gone: translate the fields that use them"
    assert said in left(capsys)
    kinds = {"CONSTANT_VALUE_CHANGED", "CONSTANT_REMOVED"}
    assert failing(capsys) == kinds
    complete()
    assert failing(capsys) == {"CONSTANT_VALUE_CHANGED"}
    header = TRANSLATIONS / "translation_wind_v1.h"
    edit(header, "newer.kind = older.kind;", "newer.kind = older.kind == 1 ? 2 : older.kind;")
    edit(header, "older.kind = newer.kind;", "older.kind = newer.kind == 2 ? 1 : newer.kind;")
    assert failing(capsys) == set()


def test_constants_of_no_field_are_marked(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Wind.msg", "uint8 KIND_A = 1\nuint8 KIND_B = 2\nuint8 other")
    commit(firmware)
    edit(VERSIONED / "Wind.msg", "KIND_A = 1", "KIND_A = 2")
    assert bump("Wind") == DONE
    text = (TRANSLATIONS / "translation_wind_v1.h").read_text()
    assert text.count("// TODO: KIND_A is 2, was 1: translate the fields that use it\n") == 1
    assert failing(capsys) == {"CONSTANT_VALUE_CHANGED"}
    complete()
    assert failing(capsys) == set()


UNITS = [
    ("# [m]", "# [cm]", "m", "cm"),
    ("# Height in metres", "# Height in centimetres", "m", "cm"),
    ("# [m] [@frame NED]", "# [m] [@frame ENU]", "NED", "ENU"),
    ("# [m] [@invalid NaN]", "# [m] [@invalid -1]", "NaN", "-1"),
]


@pytest.mark.parametrize(("old", "new", "before", "after"), UNITS)
def test_fields_of_another_unit_are_marked(
    old: str, new: str, before: str, after: str, capsys: pytest.CaptureFixture[str]
) -> None:
    append(VERSIONED / "Wind.msg", f"float32 alt  {old}")
    commit(Path.cwd())
    edit(VERSIONED / "Wind.msg", f"float32 alt  {old}", f"float32 alt  {new}")
    rule = {"NED": "FRAME_CHANGED", "NaN": "INVALID_CHANGED"}.get(before, "UNIT_CHANGED")
    assert failing(capsys) == {rule}
    assert bump("Wind") == DONE
    header = TRANSLATIONS / "translation_wind_v1.h"
    marks = (
        f"{before} in the older version, {after} in the newer",
        f"{after} in the newer version, {before} in the older",
    )
    assert f"newer.alt = older.alt;  // TODO: {marks[0]}\n" in header.read_text()
    assert f"older.alt = newer.alt;  // TODO: {marks[1]}\n" in header.read_text()
    assert left(capsys)[0].startswith(f"{header}: complete the lines marked TODO: ")
    complete()
    assert failing(capsys) == {rule}
    edit(header, "newer.alt = older.alt;", "newer.alt = older.alt * 100;")
    assert failing(capsys) == {rule}
    edit(header, "older.alt = newer.alt;", "older.alt = newer.alt / 100;")
    assert failing(capsys) == set()


def test_a_header_of_another_definition_is_invalid(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The header is written for a definition that was archived in error, and stays when the definition is corrected."""
    append(STATUS, "uint8 acc")
    old = STATUS.read_text()
    commit(firmware)
    append(STATUS, "uint8 EDITED = 1")
    assert bump("VehicleStatus") == DONE
    edit(STATUS_V1, "uint8 acc\n", "")
    capsys.readouterr()
    assert bump("VehicleStatus", "--against", "HEAD~1") == DONE
    lines = STATUS_V2_HEADER.read_text().splitlines()
    line = 1 + next(number for number, text in enumerate(lines) if "newer.acc = older.acc;" in text)
    told = "'older.acc' does not exist: version 1 of 'VehicleStatus' has no 'acc'"
    assert any(each.startswith(f"{STATUS_V2_HEADER}:{line}: {told}") for each in left(capsys))
    assert "uint8 acc" in old
    assert main(["breaking", "--against", "HEAD~1", "--output-format", "concise"]) == FINDINGS
    shown = capsys.readouterr().out.splitlines()
    assert any(each.startswith(f"{STATUS_V2_HEADER}:{line}:1: TRANSLATION_INVALID {told}") for each in shown)
    assert not any("FIELD_ADDED handled" in each for each in shown)


def failing(capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Return the rules that fail for the change since the last commit."""
    capsys.readouterr()
    main(["breaking", "--against", "HEAD", "--output-format", "json"])
    return {each["rule"] for each in json.loads(capsys.readouterr().out)["findings"] if each["fails"]}


def test_new_constants_ask_for_nothing(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Wind.msg", CONSTANTS.format("KIND"))
    commit(firmware)
    append(VERSIONED / "Wind.msg", "uint8 KIND_C = 3")
    assert bump("Wind") == DONE
    assert "constants" not in (TRANSLATIONS / "translation_wind_v1.h").read_text() + capsys.readouterr().out


@pytest.mark.usefixtures("edited")
def test_each_topic_is_registered() -> None:
    bump("VehicleOdometry")
    text = (TRANSLATIONS / "translation_vehicle_odometry_v1.h").read_text()
    names = ("fmu/out/vehicle_odometry", "fmu/in/vehicle_mocap_odometry", "fmu/in/vehicle_visual_odometry")
    assert tuple(re.findall(r'kTopic = "(.+)";', text)) == names
    registered = re.findall(r"REGISTER_TOPIC_TRANSLATION_DIRECT\((\w+)\);", text)
    others = ("FmuInVehicleMocapOdometry", "FmuInVehicleVisualOdometry")
    assert registered == [f"VehicleOdometryV1Translation{other}" for other in ("", *others)]


@pytest.mark.usefixtures("edited")
def test_an_instance_is_part_of_the_topic() -> None:
    append(BRIDGE, "")
    text = BRIDGE.read_text().replace(
        "publications:\n", "publications:\n  - {topic: /fmu/out/wind, instance: 1, type: px4_msgs::msg::Wind}\n", 1
    )
    BRIDGE.write_text(re.sub(r"  - topic: /fmu/out/wind\n.*\n(    rate_limit.*\n)?", "", text))
    bump("Wind")
    assert 'kTopic = "fmu/out/wind1";' in (TRANSLATIONS / "translation_wind_v1.h").read_text()


@pytest.mark.usefixtures("edited")
def test_a_message_that_is_not_bridged_has_its_topic_marked() -> None:
    bump("Event")
    text = (TRANSLATIONS / "translation_event_v2.h").read_text()
    assert 'kTopic = "fmu/out/event";  // TODO: no topic of Event crosses the bridge\n' in text


# --- Nested messages


def test_a_nested_message_is_archived_along_and_set_field_by_field() -> None:
    event = (VERSIONED / "Event.msg").read_text()
    reply = (VERSIONED / "ArmingCheckReply.msg").read_text()
    append(VERSIONED / "ArmingCheckReply.msg", "uint8 more")
    assert bump("ArmingCheckReply") == DONE
    assert (ARCHIVE / "EventV1.msg").read_text() == event
    assert (ARCHIVE / "ArmingCheckReplyV1.msg").read_text() == reply.replace("\nEvent[5] events", "\nEventV1[5] events")
    text = (TRANSLATIONS / "translation_arming_check_reply_v2.h").read_text()
    assert "newer.events[i].id = older.events[i].id;" in text
    assert "older.events[i].arguments = newer.events[i].arguments;" in text


@pytest.mark.slow
def test_a_nested_message_with_a_new_version_is_translated_by_its_own_header(
    capsys: pytest.CaptureFixture[str],
) -> None:
    append(VERSIONED / "Event.msg", "uint8 severity")
    assert bump("Event") == DONE
    assert "run `msggen bump ArmingCheckReply`: ArmingCheckReply nests Event" in capsys.readouterr().out
    assert bump("ArmingCheckReply") == DONE
    text = (TRANSLATIONS / "translation_arming_check_reply_v2.h").read_text()
    assert '#include "translation_event_v2.h"\n' in text
    assert "EventV2Translation::fromOlder(older.events[i], newer.events[i]);" in text
    assert "EventV2Translation::toOlder(newer.events[i], older.events[i]);" in text
    complete()
    assert main(["breaking", "--against", "HEAD"]) == DONE


@pytest.mark.slow
def test_a_message_that_nests_a_changed_one_says_so(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Event.msg", "uint8 severity")
    assert bump("ArmingCheckReply", "--px4", str(firmware)) == DONE
    assert f"`msggen bump Event --px4 {firmware}`: ArmingCheckReply nests Event" in capsys.readouterr().out
    text = (TRANSLATIONS / "translation_arming_check_reply_v2.h").read_text()
    assert "newer.events[i].severity = 0;  // TODO: not in the older version\n" in text
    assert bump("Event") == DONE
    expected = "translation_arming_check_reply_v2.h: translate Event with EventV2Translation"
    assert expected in capsys.readouterr().out


@pytest.mark.slow
def test_a_header_that_no_longer_fits_is_named(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(VERSIONED / "Event.msg", "uint8 severity")
    bump("Event")
    bump("ArmingCheckReply")
    commit(firmware)
    capsys.readouterr()
    append(VERSIONED / "ArmingCheckReply.msg", "uint8 more")
    bump("ArmingCheckReply")
    told = "`msggen bump Event`: translation_arming_check_reply_v2.h still uses the current version of Event"
    assert told in capsys.readouterr().out
    bump("Event")
    capsys.readouterr()
    bump("ArmingCheckReply")
    assert "bump Event" not in capsys.readouterr().out


def left(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the remaining steps that the last bump printed."""
    lines = capsys.readouterr().out.splitlines()
    return [line.strip() for line in lines[lines.index("left to do:") + 1 :]]


@pytest.mark.slow
@pytest.mark.parametrize("is_nested_deeper", [False, True])
@pytest.mark.usefixtures("edited")
def test_services_that_nest_the_message_are_named(
    firmware: Path, capsys: pytest.CaptureFixture[str], *, is_nested_deeper: bool
) -> None:
    if is_nested_deeper:
        (firmware / "msg" / "Order.msg").write_text("uint64 timestamp\nVehicleCommand[2] commands\n")
        (firmware / "srv" / "VehicleCommand.srv").write_text("uint8 a\n---\nOrder order\n")
    append(VERSIONED / "VehicleCommand.msg", "uint8 more")
    assert bump("VehicleCommand", "--px4", str(firmware)) == DONE
    told = (
        "srv/VehicleCommand.srv nests VehicleCommand, and services have no versions: rebuild the clients of the service"
    )
    assert told in left(capsys)
    assert bump("VehicleStatus") == DONE
    assert ".srv" not in "".join(left(capsys))


def test_a_nested_message_without_versions_that_changed_is_named(
    firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (VERSIONED / "Wheel.msg").write_text("uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nRpm left\nEscReport esc\n")
    commit(firmware)
    append(Path("msg/Rpm.msg"), "float32 slip")
    assert bump("Wheel") == DONE
    said = left(capsys)
    assert "msg/Rpm.msg changed too but has no versions: it is translated only as a part of Wheel" in said
    assert "EscReport" not in "".join(said)


def test_without_git_a_bump_of_what_has_not_changed_says_so_first(
    firmware: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(firmware / ".git")
    assert bump("VehicleStatus") == DONE
    assert left(capsys)[0].startswith(f"VehicleStatus has no changes yet: edit {STATUS}, then trans")


@pytest.mark.slow
def test_a_bump_of_what_has_changed_does_not_say_so(capsys: pytest.CaptureFixture[str]) -> None:
    append(STATUS, "uint8 battery_count")
    assert bump("VehicleStatus") == DONE
    assert "no changes" not in "".join(left(capsys))


# --- Completeness


@pytest.mark.slow
@by_day("name", ["VehicleStatus", "VehicleOdometry", "ArmingCheckReply", "Wind"], 2)
def test_history_finds_archive_and_translation_and_breaking_is_content(name: str) -> None:
    append(VERSIONED / f"{name}.msg", "uint8 brand_new")
    version = read_catalog(find_sources(".")).messages[f"px4_msgs/{name}"].message_version
    assert main(["breaking", "--against", "HEAD"]) == FINDINGS
    bump(name)
    history = read_history(Folder("."))
    assert history.archived[f"{name}V{version}"].message_version == version
    assert history.translates(name, version)
    assert main(["breaking", "--against", "HEAD"]) == FINDINGS
    complete()
    assert main(["breaking", "--against", "HEAD"]) == DONE


RAISED = {
    (
        "v1.16",
        "v1.17",
    ): "AirspeedValidated ArmingCheckReply ArmingCheckRequest Event HomePosition VehicleAttitudeSetpoint",
    ("v1.17", "main-2026-03"): (
        "ConfigOverrides RegisterExtComponentReply RegisterExtComponentRequest VehicleCommandAck VehicleStatus"
    ),
}
"""Messages that PX4 itself gave a new version, by hand."""

MISARCHIVED = {
    "BatteryStatus": "fields in a different order: expected 'uint16 faults' before 'uint8 warning'",
    "VehicleLocalPosition": "expected 'float32 hagl_max_z', 'float32 hagl_max_xy', found 'float32 hagl_max'",
}
"""Messages whose archived version 0 in v1.17 differs from v1.16: applications of v1.16 read wrong values."""


@pytest.mark.slow
@pytest.mark.tools("g++")
@by_day(("releases", "backwards"), [(each, way) for way in (False, True) for each in RAISED], 4)
def test_what_px4_archived_by_hand_is_taken_and_the_headers_compile(
    tmp_path: Path, releases: tuple[str, str], *, backwards: bool
) -> None:
    older, newer, tree = releases_of(tmp_path, releases)
    archived = files_of(tree / ARCHIVE)
    names = sorted(RAISED[releases].split(), reverse=backwards)
    for name in names:
        assert bump(name, "--px4", str(tree), "--against", str(older)) == DONE
    assert files_of(tree / ARCHIVE) == archived
    assert files_of(tree / VERSIONED) == files_of(newer / VERSIONED)
    assert run(tree, tmp_path / "cpp", names).keys() == set(names)


@pytest.mark.night  # each run takes what PX4 archived, and archives other definitions
@pytest.mark.parametrize("releases", RAISED, ids=map("-".join, RAISED))
def test_without_px4s_archive_the_same_definitions_are_archived(tmp_path: Path, releases: tuple[str, str]) -> None:
    older, newer, tree = releases_of(tmp_path, releases)
    shutil.rmtree(tree / ARCHIVE)
    for name in RAISED[releases].split():
        assert bump(name, "--px4", str(tree), "--against", str(older)) == DONE
    made, px4s = (read_history(Folder(str(place))).archived for place in (tree, newer))
    assert made
    assert {name: lines_of(made[name]) for name in made} == {name: lines_of(px4s[name]) for name in made}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "told"), MISARCHIVED.items())
def test_what_px4_archived_wrongly_is_found(
    tmp_path: Path, name: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    older, _, tree = releases_of(tmp_path, ("v1.16", "v1.17"))
    assert bump(name, "--px4", str(tree), "--against", str(older)) == FAILED
    assert f"{name}V0.msg: B105 a different definition is archived: {told}\n" in capsys.readouterr().err


def releases_of(folder: Path, names: tuple[str, str]) -> tuple[Path, Path, Path]:
    """Return the trees of an older and a newer release, and a writable copy of the newer one."""
    older, newer = (shared(f"firmware/{name}") for name in names)
    return older, newer, writable_copy(newer, folder / "tree")


def writable_copy(tree: Path, target: Path) -> Path:
    """Copy a release, whose files may be read-only, and make the copy writable."""
    shutil.copytree(tree, target)
    for path in (target, *target.rglob("*")):
        path.chmod(path.stat().st_mode | 0o200)
    return target


# --- Compilation and translation

FLAGS = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wno-unused-parameter", "-Werror", "-O0")
"""Compiler options of the translation node, which uses -Werror."""

CPP_TYPES = {"byte": "uint8_t", "char": "uint8_t", "bool": "bool", "float32": "float", "float64": "double"}

TRANSLATION_UTIL = """#pragma once
#include <cmath>
#include <cstdio>
template <class T> struct Registration {
	explicit Registration(const char *) { std::printf("topic %s\\n", T::kTopic); }
};
#define REGISTER_TOPIC_TRANSLATION_DIRECT(class_name) Registration<class_name> class_name##_registered("");
"""


def lines_of(message: Message) -> list[str]:
    return [f"{field.type} {field.name}" for field in message.fields]


def cpp_type(type_: FieldType) -> str:
    name = CPP_TYPES.get(type_.name, f"{type_.name}_t") if type_.is_primitive else type_.name
    return f"std::array<{name}, {type_.length}>" if type_.array is ArrayKind.FIXED else name


def struct_of(message: Message, package: str) -> str:
    """Return a struct that a translation can use like the one of ROS 2; its constructor is explicit."""
    nested = sorted({field.type.name for field in message.fields if not field.type.is_primitive})
    return "\n".join([
        "#pragma once",
        "#include <array>",
        "#include <cstdint>",
        *(f"#include <{package}/msg/{ros_file(name)}.hpp>" for name in nested),
        f"namespace {package}::msg {{",
        f"struct {message.name} {{",
        f"\texplicit {message.name}(int = 0) {{}}",
        f"\tstatic constexpr uint32_t MESSAGE_VERSION = {message.message_version};",
        *(
            f"\tstatic constexpr {cpp_type(constant.type)} {constant.name} = {str(constant.value).lower()};"
            for constant in message.constants
            if constant.name != "MESSAGE_VERSION"
        ),
        *(f"\t{cpp_type(field.type)} {field.name}{'{}' * field.type.is_primitive};" for field in message.fields),
        "};",
        "}",
        "",
    ])  # fmt: skip


def round_trip(older: Message, newer: Message, version: int) -> str:
    """Return C++ that sets every primitive field, translates there and back, and counts the preserved fields."""
    carried = set(lines_of(newer))
    fields = [field for field in older.fields if field.type.is_primitive and f"{field.type} {field.name}" in carried]
    sets = []
    for number, field in enumerate(fields, 1):
        value = "true" if field.type.name == "bool" else str(number % 100 + 1)
        place = f"before.{field.name}"
        sets.append(f"\t{place}.fill({value});" if field.type.array is ArrayKind.FIXED else f"\t{place} = {value};")
    checks = [f"\tright += before.{field.name} == after.{field.name};" for field in fields]
    return "\n".join([
        f"static void check_{newer.name}() {{",
        f"\tusing T = {newer.name}V{version}Translation;",
        "\tT::MessageOlder before, after;",
        "\tT::MessageNewer between;",
        "\tint right = 0;",
        *sets,
        "\tT::fromOlder(before, between);",
        "\tT::toOlder(between, after);",
        *checks,
        f'\tstd::printf("{newer.name} %d of {len(fields)}\\n", right);',
        "}",
        "",
    ])  # fmt: skip


def run(tree: Path, folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Compile the headers of `tree` and translate the messages `names` there and back; return each message's result.

    Fail unless all fields that both versions have are preserved.
    """
    current = {message.name: message for message in read_catalog(find_sources(str(tree))).messages.values()}
    archived = read_history(Folder(str(tree))).archived
    files = {f"px4_msgs/msg/{ros_file(name)}.hpp": struct_of(message, "px4_msgs") for name, message in current.items()}
    for name, message in archived.items():
        files[f"px4_msgs_old/msg/{ros_file(name)}.hpp"] = struct_of(message, "px4_msgs_old")
    newer = [current[name] for name in names]
    versions = [message.message_version for message in newer]
    pairs = [
        (archived[f"{new.name}V{version - 1}"], new, version) for new, version in zip(newer, versions, strict=True)
    ]
    calls = "".join(f"\tcheck_{name}();\n" for name in names)
    body = "".join(round_trip(*pair) for pair in pairs)
    files["translation_util.h"] = TRANSLATION_UTIL
    files["main.cpp"] = f'#include "all_translations.h"\n{body}int main() {{\n{calls}}}\n'
    write_definitions(folder, files)
    includes = ["-isystem", str(folder), "-I", str(tree / TRANSLATIONS)]
    command = ["g++", *FLAGS, *includes, str(folder / "main.cpp"), "-o", str(folder / "main")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = subprocess.run([str(folder / "main")], capture_output=True, text=True, check=True).stdout.splitlines()
    found = dict(line.split(" ", 1) for line in said if not line.startswith("topic"))
    for name, text in found.items():
        right, _, total = text.split()
        assert (right, int(total) > 0) == (total, True), f"{name}: {text}"
    return found


@pytest.mark.slow
@pytest.mark.tools("g++")
def test_headers_of_all_kinds_compile_and_translate(firmware: Path, tmp_path: Path) -> None:
    append(STATUS, "float64[4] brand_new")
    append(VERSIONED / "Event.msg", "uint8 severity")
    edit(VERSIONED / "ArmingCheckReply.msg", "uint8 num_events", "uint16 num_events\nEvent first\nEvent[2] more")
    edit(VERSIONED / "Wind.msg", "float32 windspeed_north", "float64 wind_north")
    names = ["VehicleStatus", "Event", "ArmingCheckReply", "VehicleOdometry", "Wind"]
    for name in names:
        append(VERSIONED / f"{name}.msg", "uint8 EDITED = 1")
    for name in names:
        assert bump(name) == DONE
    assert run(firmware, tmp_path / "first", names).keys() == set(names)

    commit(firmware)  # The next release: the earlier headers now translate between archived versions.
    append(VERSIONED / "Event.msg", "uint8 again")
    edit(STATUS, "float64[4] brand_new", "float32[4] brand_new")
    for name in names:
        append(VERSIONED / f"{name}.msg", "uint8 EDITED_AGAIN = 1")
    for name in names:
        assert bump(name) == DONE
    assert run(firmware, tmp_path / "second", names).keys() == set(names)


@pytest.mark.slow
@pytest.mark.tools("g++")
def test_a_nested_message_without_a_new_version_compiles(firmware: Path, tmp_path: Path) -> None:
    append(VERSIONED / "ArmingCheckReply.msg", "uint8 reason")
    bump("ArmingCheckReply")
    assert run(firmware, tmp_path / "cpp", ["ArmingCheckReply"])


@pytest.mark.slow
@pytest.mark.tools("g++")
@pytest.mark.usefixtures("edited")
def test_every_topic_is_registered_when_it_runs(firmware: Path, tmp_path: Path) -> None:
    bump("VehicleOdometry")
    run(firmware, tmp_path / "cpp", ["VehicleOdometry"])
    said = subprocess.run([str(tmp_path / "cpp" / "main")], capture_output=True, text=True, check=True).stdout
    topics = [line for line in said.splitlines() if "odometry" in line]
    names = ("fmu/out/vehicle_odometry", "fmu/in/vehicle_mocap_odometry", "fmu/in/vehicle_visual_odometry")
    assert topics == [f"topic {name}" for name in names]


@pytest.mark.night  # each run does it with headers of all kinds
@pytest.mark.tools("g++")
def test_every_versioned_message_of_a_release_can_be_bumped(tmp_path: Path) -> None:
    tree = writable_copy(shared("firmware/main-2026-03"), tmp_path / "tree")
    names = [path.stem for path in sorted((tree / VERSIONED).glob("*.msg"))]
    commit(tree)
    for name in names:
        append(tree / VERSIONED / f"{name}.msg", "uint8 EDITED = 1")
        assert bump(name, "--px4", str(tree)) == DONE
    assert run(tree, tmp_path / "cpp", names).keys() == set(names)


# --- Invalid input


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("VehicleStats", "VehicleStats: B102 no message 'VehicleStats' in ., did you mean 'VehicleStatus'?"),
        ("vehicle_status", "vehicle_status: B102 no message 'vehicle_status' in ., did you mean 'VehicleStatus'?"),
        ("VehicleStatusV0", "VehicleStatusV0: B102 no message 'VehicleStatusV0' in ., did you mean 'VehicleStatus'?"),
        ("SensorCombined", "msg/SensorCombined.msg: B102 'SensorCombined' has no versions: add 'uint32 MESSAGE_"),
        ("../other/VehicleStatus.msg", "../other/VehicleStatus.msg: B102 not a file of this firmware: expected msg/"),
        (
            "srv/VehicleCommand.srv",
            "srv/VehicleCommand.srv: B104 'VehicleCommand' is a service: services have no versions",
        ),
        ("Wind --px4 nowhere", "nowhere: B101 no such folder: expected the folder of a PX4-Autopilot tree"),
        ("Wind --px4 mgs", "mgs: B101 no such folder: expected the folder of a PX4-Autopilot tree, did"),
        ("Wind --px4 .@HEAD", ".@HEAD: B101 not a folder: expected the folder of a PX4-Autopilot tree"),
        ("Wind --px4 ../px4.zip", "../px4.zip: B101 not a folder: expected the folder of a PX4-Autopilot tree"),
        ("Wind --px4 ../other", "../other: B101 no msg/versioned here"),
        ("Wind --px4 ../package", "../package: B101 no msg/versioned here"),
        ("Wind --against nothing", "--against: S108 'nothing' is neither"),
        ("Wind --against ../other", "msg/versioned/Wind.msg: B103 'Wind' is not in ../other"),
    ],
)
def test_bad_input_is_told_and_nothing_is_written(
    firmware: Path, arguments: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(firmware.parent / "other", {"VehicleStatus.msg": "uint64 timestamp\n"})
    write_definitions(firmware.parent / "package", {"msg/versioned/Wind.msg": "", "package.xml": "<package/>"})
    (firmware.parent / "px4.zip").write_bytes(b"")
    before = files_of(firmware)
    assert bump(*arguments.split()) == FAILED
    error = capsys.readouterr().err
    assert error.startswith(told)
    assert error.endswith("1 error, nothing written\n")
    assert files_of(firmware) == before


@pytest.mark.slow
@pytest.mark.parametrize("version", [0, 3])
def test_a_version_that_skips_is_told_with_its_place(version: int, capsys: pytest.CaptureFixture[str]) -> None:
    edit(STATUS, "MESSAGE_VERSION = 1", f"MESSAGE_VERSION = {version}")
    assert bump("VehicleStatus") == FAILED
    line = STATUS.read_text().split("\n").index(f"uint32 MESSAGE_VERSION = {version}") + 1
    text = f"MESSAGE_VERSION is 1 in HEAD: expected 1 or 2 here, found {version}"
    assert capsys.readouterr().err.startswith(f"{STATUS}:{line}:1: B103 {text}\n")


def test_a_versioned_file_without_its_constant_is_told(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (VERSIONED / "Wheel.msg").write_text("uint64 timestamp\n")
    commit(firmware)
    assert bump("Wheel") == FAILED
    assert "msg/versioned/Wheel.msg: B102 'Wheel' has no versions" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("uint8 nav_state ", "uint16 nav_state ", "expected 'uint8 nav_state', found 'uint16 nav_state'"),
        ("MESSAGE_VERSION = 1", "MESSAGE_VERSION = 7", "expected MESSAGE_VERSION = 1, found 7"),
    ],
)
@pytest.mark.usefixtures("edited")
def test_another_definition_in_the_archive_is_told(
    firmware: Path, old: str, new: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(STATUS, STATUS_V1)
    edit(STATUS_V1, old, new)
    before = files_of(firmware)
    assert bump("VehicleStatus") == FAILED
    assert f"{STATUS_V1}: B105 a different definition is archived: {told}\n" in capsys.readouterr().err
    assert files_of(firmware) == before


@pytest.mark.slow
@pytest.mark.usefixtures("edited")
def test_nothing_is_written_through_a_link_that_leads_out(
    firmware: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.move(VERSIONED, tmp_path / "elsewhere")
    VERSIONED.symlink_to(tmp_path / "elsewhere")
    before = files_of(firmware), files_of(tmp_path / "elsewhere")
    assert bump("VehicleStatus", "--against", "HEAD") == FAILED
    assert f"{STATUS}: B106 leads to {tmp_path}/elsewhere/VehicleStatus.msg" in capsys.readouterr().err
    assert (files_of(firmware), files_of(tmp_path / "elsewhere")) == before


@pytest.mark.slow
@pytest.mark.usefixtures("edited")
def test_a_tree_that_cannot_be_written_is_told_before_anything_is(
    firmware: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "access", lambda path, _: not path.endswith("versioned"))
    before = files_of(firmware)
    assert bump("VehicleStatus") == FAILED
    told = "msg/versioned: S114 the folder is read-only: make it writable\n"
    assert capsys.readouterr().err == f"{told}1 error, nothing written\n"
    assert files_of(firmware) == before


@pytest.mark.usefixtures("edited")
def test_a_file_without_a_write_bit_is_not_replaced(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    STATUS.chmod(0o444)
    ALL.chmod(0o444)
    before = files_of(firmware)
    assert bump("VehicleStatus") == FAILED
    told = "S114 the file is read-only: make it writable"
    assert capsys.readouterr().err == f"{ALL}: {told}\n{STATUS}: {told}\n2 errors, nothing written\n"
    assert files_of(firmware) == before


@pytest.mark.usefixtures("edited")
def test_a_folder_without_a_write_bit_gets_no_files(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(ARCHIVE)
    ARCHIVE.parent.chmod(0o555)
    assert bump("VehicleStatus", "--px4", str(firmware)) == FAILED
    ARCHIVE.parent.chmod(0o755)
    assert capsys.readouterr().err.startswith(f"{firmware / ARCHIVE.parent}: S114 the folder is read-only")


def test_errors_of_definitions_are_told_as_ever(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    append(STATUS, "uint_8 battery_count")
    before = files_of(firmware)
    assert bump("VehicleStatus") == FAILED
    assert "M301 unknown type 'uint_8'" in capsys.readouterr().err
    assert files_of(firmware) == before


def test_a_repository_that_git_refuses_is_no_missing_one(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Otherwise bump would take the edited file for the committed one."""
    shutil.rmtree(firmware / ".git")
    (firmware / ".git").write_text("gitdir: nowhere\n")
    assert bump("VehicleStatus") == FAILED
    assert "S108" in capsys.readouterr().err


def test_every_code_of_bump_has_a_test() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert [code for code in CODES if code[0] == "B" and f"{code} " not in text] == []


# --- docs/bump.md


def test_the_page_begins_with_what_really_happens(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "bump.md").read_text(encoding="utf-8")
    console = re.search(r"```console\n(.*?)```", page, re.DOTALL)
    assert console
    for command, shown in re.findall(r"^\$ (.+)\n((?:(?!\$ ).*\n)*)", console[1], re.MULTILINE):
        if command.startswith("msggen"):
            assert main(shlex.split(command)[1:]) == DONE
            assert capsys.readouterr().out == shown
        else:
            done = subprocess.run(command, shell=True, cwd=firmware, capture_output=True, text=True, check=True)  # noqa: S602
            assert done.stdout == shown
