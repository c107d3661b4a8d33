"""Tests of `msggen sync`: the package gets the firmware's definitions, and the user's own files stay unchanged.

The definitions are real; most tests need only a few.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from msggen.base.disk import staging, swap
from msggen.base.disk.record import NO_RECORD
from msggen.cli import main
from msggen.generate.sync import plan
from msggen.generate.sync.change import describe_change
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED, PREFIX
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.examples import by_day
from support.packages import (
    BRIDGE,
    BRIDGE_PLACE,
    PACKAGE,
    RECORD,
    age,
    committed,
    content,
    definition,
    definitions,
    firmware,
    git,
    identity,
    package,
    plain_package,
    sync,
)
from support.repository import ROOT, shared

RELEASES = ("v1.14", "v1.16", "v1.17", "v1.18", "main-2026-03")

pytestmark = pytest.mark.usefixtures("working_folder")


# --- Contents of a package


def test_definitions_are_the_firmwares_byte_for_byte_and_lie_flat() -> None:
    source = firmware()
    (source / "msg" / "Rpm.msg").write_bytes(definition("Rpm").encode() + "# naïve °C\n\n  \n".encode())
    package()
    files = {path.name: path.read_bytes() for path in source.rglob("*.[ms][sr][gv]")}
    assert {name.split("/")[1]: data for name, data in definitions(PACKAGE).items()} == files
    assert sorted(os.listdir(PACKAGE / "srv")) == ["VehicleCommand.srv"]
    assert sorted(os.listdir(PACKAGE)) == sorted([RECORD, "CMakeLists.txt", "README.md", "msg", "package.xml", "srv"])


def test_archived_versions_stay_out() -> None:
    write_definitions(firmware(), {"msg/px4_msgs_old/msg/VehicleStatusV0.msg": definition("VehicleStatus")})
    package()
    assert "VehicleStatusV0.msg" not in os.listdir(PACKAGE / "msg")


def test_external_modules_go_in_too_and_leave_again() -> None:
    firmware()
    write_definitions(
        Path("modules"), {"wheel/msg/Wheel.msg": definition("Rpm"), "arm/Arm.msg": definition("DebugVect")}
    )
    folders = ("--msg-dir", "modules/wheel", "--msg-dir", "modules/arm")
    assert sync("-q", "--px4", "firmware", *folders, "--create", PACKAGE) == 0
    assert {"Wheel.msg", "Arm.msg", "Rpm.msg"} <= set(os.listdir(PACKAGE / "msg"))
    assert "`wheel`, `arm`" in (PACKAGE / "README.md").read_text()
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))


def test_without_a_source_it_is_the_embedded_set() -> None:
    assert sync("-q", "--create", PACKAGE) == 0
    assert len(os.listdir(PACKAGE / "msg")) == 259
    readme = (PACKAGE / "README.md").read_text()
    assert "PX4 v1.18, embedded in msggen" in readme
    assert "$ msggen sync --px4 v1.18 .\n" in readme


def test_settings_name_the_firmware_but_not_the_ros_package() -> None:
    firmware()
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\npackage = "px4_types"\n')
    assert sync("-q", "--create", PACKAGE) == 0
    assert len(os.listdir(PACKAGE / "msg")) == 6
    assert "<name>px4_msgs</name>" in (PACKAGE / "package.xml").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("source", ["firmware@HEAD", "firmware.tar.gz"])
def test_the_firmware_may_be_a_revision_or_an_archive(source: str) -> None:
    committed(firmware())
    with tarfile.open("firmware.tar.gz", "w:gz") as archive:
        archive.add("firmware", "PX4-Autopilot")
    before = definitions(package("expected"))
    (Path("firmware") / "msg" / "Rpm.msg").write_text(definition("DebugVect"))
    assert definitions(package(source=source)) == before


@pytest.mark.slow
@by_day("release", RELEASES, 3)
def test_a_created_package_means_what_the_firmware_means(release: str) -> None:
    source = shared(f"firmware/{release}")
    assert sync("-q", "--px4", source, "--create", PACKAGE) == 0
    expected, found = (read_catalog(find_sources(str(path))) for path in (source, PACKAGE))
    assert sorted(found.messages) == sorted(expected.messages)
    assert [service.name for service in found.services] == [service.name for service in expected.services]


@pytest.mark.slow
@pytest.mark.parametrize("others", ["last", pytest.param("all", marks=pytest.mark.night)])
@by_day("new", RELEASES[::-1], 2)
def test_from_any_release_to_any_other_it_becomes_what_a_fresh_one_is(new: str, others: str) -> None:
    """The last before the first release is the newest: each run also takes one way back."""
    assert sync("-q", "--px4", shared(f"firmware/{new}"), "--create", PACKAGE) == 0
    for old in RELEASES if others == "all" else [RELEASES[RELEASES.index(new) - 1]]:
        assert sync("-q", "--px4", shared(f"firmware/{old}"), "--create", old) == 0
        assert sync("-q", "--px4", shared(f"firmware/{new}"), old) == 0
        assert content(Path(old)) == content(PACKAGE)
    assert main(["check", "--px4", str(shared(f"firmware/{new}")), str(PACKAGE)]) == 0


@pytest.mark.slow
def test_where_folders_cannot_be_swapped_files_are_replaced_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    sync("-q", "--px4", shared(f"firmware/{RELEASES[0]}"), "--create", PACKAGE)
    monkeypatch.setattr(swap, "_renameat2", lambda: None)
    for release in (RELEASES[-1], RELEASES[0]):
        assert sync("-q", "--px4", shared(f"firmware/{release}"), PACKAGE) == 0
        assert sync("-q", "--px4", shared(f"firmware/{release}"), "--create", release) == 0
        assert content(PACKAGE) == content(Path(release))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["msg", "srv"])
def test_what_lies_in_versioned_of_a_package_is_none_of_its_definitions(kind: str) -> None:
    """`cp -r` of the firmware's folders leaves such files, but ROS builds only those directly in `msg/` and `srv/`."""
    firmware()
    package()
    leftover = {"msg": "VehicleStatus.msg", "srv": "VehicleCommand.srv"}[kind]
    write_definitions(PACKAGE, {f"{kind}/versioned/{leftover}": (PACKAGE / kind / leftover).read_text()})
    assert main(["check", "--px4", "firmware", str(PACKAGE)]) == 0
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert definitions(package("copy", str(PACKAGE))) == definitions(package("fresh"))


def test_in_a_bare_folder_versioned_counts() -> None:
    shutil.copytree(firmware() / "msg", "bare/msg")
    package(source="bare")
    assert "VehicleStatus.msg" in os.listdir(PACKAGE / "msg")


# --- Nothing to do


def test_a_second_sync_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    age(PACKAGE)
    before = identity(PACKAGE)
    for create in ((), ("--create",)):
        assert sync("--px4", "firmware", *create, PACKAGE) == 0
        assert identity(PACKAGE) == before
        assert capsys.readouterr().out == "px4_msgs is up to date with firmware: 7 definitions\n"


def test_a_plain_package_in_step_is_not_touched() -> None:
    firmware()
    plain_package()
    age(PACKAGE)
    before = identity(PACKAGE)
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert identity(PACKAGE) == before


def test_a_package_in_step_may_be_read_only_and_outside_of_what_git_allows() -> None:
    firmware()
    package()
    for path in (*PACKAGE.rglob("*"), PACKAGE):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0


@pytest.mark.slow
def test_with_nothing_to_do_no_template_engine_is_loaded() -> None:
    firmware()
    package()
    program = (
        "import sys; from msggen.cli import main; assert main(sys.argv[1:]) == 0; assert 'jinja2' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program, "sync", "-q", "--px4", "firmware", "px4_msgs"], check=True)


def test_only_what_changes_is_written() -> None:
    source = firmware()
    package()
    age(PACKAGE)
    before = identity(PACKAGE)
    (source / "msg" / "Rpm.msg").write_text(definition("DebugVect"))
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    after = identity(PACKAGE)
    assert {name for name in before if after[name] != before[name]} == {".", RECORD, "msg", "msg/Rpm.msg"}
    assert after.keys() == before.keys()


# --- Ownership of files


def test_a_plain_package_is_adopted() -> None:
    """Files with a current or former name of PX4 are PX4's; all others are the user's own."""
    firmware()
    plain_package()
    own = {"msg/Wheel.msg": definition("Rpm"), "srv/Ask.srv": "uint8 a\n---\n", "msg/notes.txt": "", "src/node.cpp": ""}
    stale = {
        "msg/TrajectoryBezier.msg": definition("Rpm"),
        "msg/Safety.msg": definition("Rpm"),
        "msg/Rpm.msg": "# old\n",
    }
    write_definitions(PACKAGE, {**own, **stale})
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    expected = {
        **definitions(package("fresh")),
        **{name: text.encode() for name, text in own.items() if "src" not in name},
    }
    assert definitions(PACKAGE) == expected
    assert (PACKAGE / "CMakeLists.txt").read_text() == "# mine\n"
    assert (PACKAGE / "README.md").read_text() == "mine\n"


@pytest.mark.parametrize("release", EMBEDDED)
def test_without_a_record_what_any_release_has_is_px4s(release: str) -> None:
    sources = find_sources(PREFIX + release)
    names = {f"{file.name[:3]}/{Path(file.name).name}" for file in (*sources.messages, *sources.services)}
    owned = plan.owned_names(NO_RECORD)
    assert names <= set(owned)
    assert not any(f"msg/{name}.msg" in names for name in plan._FORMER.split())


def test_what_is_not_the_firmwares_keeps_its_place_and_its_inode() -> None:
    source = firmware()
    package()
    own = {
        "msg/Wheel.msg": definition("Rpm"),
        "msg/VehicleOdometry.msg": definition("VehicleOdometry"),  # PX4's name, but not in the record
        "msg/notes.txt": "mine",
        "msg/.hidden": "mine",
        "msg/more/deep/Other.msg": "uint8 a\n",
        "src/node.cpp": "// mine",
        "config/a.yaml": "a: 1",
    }
    write_definitions(PACKAGE, own)
    (PACKAGE / "msg" / "link").symlink_to("notes.txt")
    (PACKAGE / "msg" / "dangling").symlink_to("/nowhere")
    (PACKAGE / "msg" / "more").chmod(0o555)
    age(PACKAGE)
    before = identity(PACKAGE)
    shutil.rmtree(source / "srv")
    (source / "msg" / "Rpm.msg").unlink()
    write_definitions(source, {"msg/DebugVect.msg": definition("DebugVect")})
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    after = identity(PACKAGE)
    assert {name: after[name] for name in own} == {name: before[name] for name in own}
    assert os.readlink(PACKAGE / "msg" / "link") == "notes.txt"
    assert os.readlink(PACKAGE / "msg" / "dangling") == "/nowhere"
    assert (PACKAGE / "msg" / "more").stat().st_mode & 0o777 == 0o555
    assert sorted(os.listdir(PACKAGE)) == sorted(set(os.listdir(PACKAGE)) - {"srv", staging.STAGE})


def test_without_hard_links_files_are_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_links(*_: object) -> None:
        raise PermissionError

    source = firmware()
    package()
    write_definitions(PACKAGE, {"msg/Wheel.msg": definition("Rpm")})
    write_definitions(source, {"msg/DebugVect.msg": definition("DebugVect")})
    monkeypatch.setattr(os, "link", no_links)
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert definitions(PACKAGE) == {**definitions(package("fresh")), "msg/Wheel.msg": definition("Rpm").encode()}


def test_a_package_reached_through_a_link_is_synced_where_it_lies() -> None:
    source = firmware()
    package("elsewhere")
    PACKAGE.symlink_to("elsewhere")
    (source / "msg" / "Rpm.msg").unlink()
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert PACKAGE.is_symlink()
    assert not Path("elsewhere/msg/Rpm.msg").exists()


def test_a_link_within_the_package_is_followed() -> None:
    source = firmware()
    package()
    (PACKAGE / "msg").rename(PACKAGE / "definitions")
    (PACKAGE / "msg").symlink_to("definitions")
    (source / "msg" / "Rpm.msg").unlink()
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert (PACKAGE / "msg").is_symlink()
    assert definitions(PACKAGE) == definitions(package("fresh"))


def test_edits_outside_of_git_are_drift_and_repaired(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    (PACKAGE / "msg" / "Rpm.msg").write_text("uint8 mine\n")
    (PACKAGE / "msg" / "EscReport.msg").unlink()
    assert sync("--px4", "firmware", PACKAGE) == 0
    assert ": 1 added, 1 changed, 5 unchanged\n" in capsys.readouterr().out
    assert content(PACKAGE) == content(package("fresh"))


def test_a_damaged_record_is_as_none() -> None:
    source = firmware()
    package()
    (PACKAGE / RECORD).write_text("{")
    (source / "msg" / "Rpm.msg").unlink()
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))


def test_a_hostile_record_removes_nothing_else() -> None:
    firmware()
    package()
    own = {"src/a.msg": "", "msg/more/Other.msg": "", "notes.txt": ""}
    write_definitions(PACKAGE, own)
    write_definitions(Path(), {"outside.msg": ""})
    record = json.loads((PACKAGE / RECORD).read_text())
    names = (*own, "../outside.msg", "msg/../../outside.msg", "package.xml", "msg")
    (PACKAGE / RECORD).write_text(json.dumps({**record, "files": {**record["files"], **dict.fromkeys(names, "")}}))
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert all((PACKAGE / name).exists() for name in own)
    assert Path("outside.msg").exists()


# --- Other files of a created package


def test_the_readme_names_the_commit_and_never_a_path(tmp_path: Path) -> None:
    source = committed(firmware())
    git(source, "tag", "v1.99.0")
    assert sync("-q", "--px4", tmp_path / "firmware", "--create", PACKAGE) == 0
    readme = (PACKAGE / "README.md").read_text()
    assert git(source, "rev-parse", "HEAD") in readme
    assert "`v1.99.0`" in readme
    assert "uncommitted" not in readme
    assert all(row.count("|") == 3 for row in readme.splitlines() if row.startswith("|"))
    assert not any(str(tmp_path).encode() in data for data in content(PACKAGE).values() if isinstance(data, bytes))


def test_the_readme_tells_uncommitted_changes() -> None:
    source = committed(firmware())
    (source / "docs.md").write_text("no definition")
    package("clean")
    (source / "msg" / "Wheel.msg").write_text(definition("Rpm"))
    package("modified")
    assert "uncommitted" not in Path("clean/README.md").read_text()
    assert "with uncommitted changes" in Path("modified/README.md").read_text()


def test_the_readme_names_the_commit_of_a_revision() -> None:
    source = committed(firmware())
    first = git(source, "rev-parse", "HEAD")
    git(source, "commit", "-q", "--allow-empty", "-m", "next")
    package(source="firmware@HEAD~1")
    readme = (PACKAGE / "README.md").read_text()
    assert first in readme
    assert "`firmware@HEAD~1`" in readme


def test_the_readme_says_where_there_is_no_commit() -> None:
    git(Path(), "init", "-q")  # an enclosing repository that does not contain the firmware
    firmware()
    package()
    assert "unknown: the files are not in a git repository" in (PACKAGE / "README.md").read_text()


def test_the_readme_follows_the_firmware_until_it_is_edited() -> None:
    source = committed(firmware())
    package()
    git(source, "commit", "-q", "--allow-empty", "-m", "next")
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert git(source, "rev-parse", "HEAD") in (PACKAGE / "README.md").read_text()
    (PACKAGE / "README.md").write_text("mine\n")
    git(source, "commit", "-q", "--allow-empty", "-m", "another")
    age(PACKAGE)
    before = identity(PACKAGE)
    assert sync("-q", "--px4", "firmware", PACKAGE) == 0
    assert identity(PACKAGE) == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["package.xml", "CMakeLists.txt", "README.md"])
def test_an_edited_file_is_the_users_from_then_on(name: str) -> None:
    source = committed(firmware())
    package()
    with (PACKAGE / name).open("a") as stream:
        stream.write("\n")
    edited = (PACKAGE / name).read_bytes()
    git(source, "commit", "-q", "--allow-empty", "-m", "next")
    (source / "msg" / "Rpm.msg").unlink()
    for _ in range(2):
        assert sync("-q", "--px4", "firmware", PACKAGE) == 0
        assert (PACKAGE / name).read_bytes() == edited
    assert not (PACKAGE / "msg" / "Rpm.msg").exists()


def test_a_package_may_have_a_name_of_its_own() -> None:
    firmware()
    assert sync("-q", "--px4", "firmware", "--create", "--ros-package", "my_msgs", "my_msgs") == 0
    for name in ("package.xml", "CMakeLists.txt", "README.md"):
        assert "my_msgs" in Path("my_msgs", name).read_text()
        assert name == "README.md" or "px4_msgs" not in Path("my_msgs", name).read_text()
    assert sync("-q", "--px4", "firmware", "--ros-package", "my_msgs", "my_msgs") == 0


def test_the_command_of_the_readme_updates_the_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command needs only the paths of the machine: no name, no option, and no source is forgotten."""
    firmware("path/to/firmware")
    write_definitions(Path("path/to/my extra"), {"Arm.msg": "uint64 timestamp\ngeometry_msgs/Point at\n"})
    write_definitions(Path("path/to/geometry_msgs"), {"msg/Point.msg": "float64 x\n"})
    further = ("--msg-dir", "path/to/my extra", "--msg-dir", "geometry_msgs=path/to/geometry_msgs")
    first = ("--px4", "path/to/firmware", *further, "--create", "--ros-package", "my_msgs", "--topics-only")
    assert sync("-q", *first, "ws/src/rest") == 0
    Path("ws/src/rest/path").symlink_to(Path("path").resolve())
    monkeypatch.chdir("ws/src/rest")
    [command] = [line for line in Path("README.md").read_text().splitlines() if line.startswith("$ msggen sync ")]
    for name in ("msg/EscStatus.msg", "msg/Arm.msg"):
        Path(name).unlink(missing_ok=True)
    capsys.readouterr()
    assert sync(*shlex.split(command)[3:]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith(": 1 added, 5 unchanged")
    assert main(["check", *shlex.split(command)[3:]]) == 0


def test_a_package_keeps_the_choice_of_topics_only() -> None:
    firmware()
    assert sync("-q", "--px4", "firmware", "--create", "--topics-only", PACKAGE) == 0
    for more in ((), ("--topics-only",)):
        assert sync("-q", "--px4", "firmware", *more, "--check", PACKAGE) == 0
    assert sync("-q", "--px4", "firmware", "--no-topics-only", PACKAGE) == 0
    assert content(PACKAGE) == content(package("fresh"))
    assert sync("-q", "--px4", "firmware", "--check", PACKAGE) == 0


@pytest.mark.parametrize("place", ["new", "a/b/new", "empty"])
def test_a_package_is_made_in_a_new_or_empty_folder(place: str) -> None:
    firmware()
    Path("empty").mkdir()
    assert content(package(place)) == content(package("other"))
    assert not list(Path().rglob(f"*{staging.STAGE}"))


# --- Messages that cross the bridge


def test_topics_only_takes_what_crosses_the_bridge_with_what_it_nests() -> None:
    firmware()
    assert sync("-q", "--px4", "firmware", "--topics-only", "--create", PACKAGE) == 0
    names = ["EscReport.msg", "EscStatus.msg", "VehicleCommand.msg", "VehicleCommandAck.msg", "VehicleStatus.msg"]
    assert sorted(os.listdir(PACKAGE / "msg")) == names
    assert os.listdir(PACKAGE / "srv") == ["VehicleCommand.srv"]


def test_messages_that_no_longer_cross_leave_and_hand_made_ones_stay() -> None:
    source = firmware()
    package()
    write_definitions(PACKAGE, {"msg/Wheel.msg": definition("Rpm")})
    (source / BRIDGE_PLACE).write_text(BRIDGE[: BRIDGE.index("  - topic: /fmu/out/vehicle_status")])
    shutil.rmtree(source / "srv")
    assert sync("-q", "--px4", "firmware", "--topics-only", PACKAGE) == 0
    assert sorted(os.listdir(PACKAGE / "msg")) == ["EscReport.msg", "EscStatus.msg", "Wheel.msg"]
    assert not (PACKAGE / "srv").exists()


# --- Output

SUMMARY = """\
added   msg/Wheel.msg
changed msg/EscReport.msg: fields; /fmu/out/esc_status
changed msg/VehicleStatus.msg: only comments; /fmu/out/vehicle_status_v4
changed srv/VehicleCommand.srv: constants
removed msg/Rpm.msg
kept, not in the firmware: msg/Mine.msg
px4_msgs updated from firmware: 1 added, 3 changed, 1 removed, 3 unchanged, 1 kept
"""


def out_of_step() -> None:
    """Make a package, then change firmware and package."""
    source = firmware()
    package()
    (source / "msg" / "Rpm.msg").unlink()
    status = source / "msg" / "versioned" / "VehicleStatus.msg"
    status.write_text(f"# Another comment.\n{status.read_text()}")
    write_definitions(
        source, {"msg/Wheel.msg": definition("Rpm"), "msg/EscReport.msg": definition("EscReport") + "uint8 x\n"}
    )
    service = source / "srv" / "VehicleCommand.srv"
    service.write_text(service.read_text().replace("---\n", "---\nuint8 MORE = 1\n"))
    write_definitions(PACKAGE, {"msg/Mine.msg": definition("DebugVect")})


def test_the_summary_tells_each_change_and_the_topics_that_it_touches(capsys: pytest.CaptureFixture[str]) -> None:
    out_of_step()
    assert sync("--px4", "firmware", PACKAGE) == 0
    assert capsys.readouterr().out == SUMMARY


@pytest.mark.parametrize("option", ["--check", "--diff"])
def test_looking_writes_nothing_and_exits_with_1_when_something_would_change(
    option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out_of_step()
    before = identity(Path())
    assert sync("--px4", "firmware", option, PACKAGE) == 1
    assert identity(Path()) == before
    last = capsys.readouterr().out.splitlines()[-1]
    counts = "1 to add, 3 to change, 1 to remove, 3 unchanged, 1 kept"
    assert last == f"px4_msgs differs from firmware: {counts}"
    sync("-q", "--px4", "firmware", PACKAGE)
    assert sync("--px4", "firmware", option, PACKAGE) == 0


def test_looking_at_a_package_to_come_creates_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    before = identity(Path())
    assert sync("--px4", "firmware", "--check", "--create", "a/px4_msgs") == 1
    assert identity(Path()) == before
    assert capsys.readouterr().out == "a/px4_msgs would be created from firmware: 7 definitions\n"


@pytest.mark.parametrize(
    ("folder", "options", "name", "follows"),
    [
        ("ws/src/acme_msgs", [], "acme_msgs", True),
        ("ws/src/acme_msgs", ["--ros-package", "px4_msgs"], "px4_msgs", False),
        ("ws/src/acme_msgs", ["--ros-package", "acme_msgs"], "acme_msgs", False),
        ("ws/acme-v1.16", [], "px4_msgs", False),  # no name of a ROS package
        ("ws/src/px4_msgs", [], "px4_msgs", False),
    ],
)
def test_a_new_package_is_named_after_its_folder_and_keeps_its_name(
    folder: str, options: list[str], name: str, *, follows: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    assert sync("--px4", "firmware", "--create", *options, folder) == 0
    *more, last = capsys.readouterr().out.splitlines()
    named = "" if os.path.basename(folder) == name else f"package {name}, "
    assert last == f"{folder} created from firmware: {named}7 definitions"
    assert [line.startswith(f"the package is named '{name}' after its folder, so its types are") for line in more] == (
        [True] if follows else []
    )
    assert f"<name>{name}</name>" in Path(folder, "package.xml").read_text()
    assert sync("-q", "--px4", "firmware", "--check", folder) == 0


def test_a_package_that_msggen_did_not_write_needs_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    plain_package("other")
    Path("other/package.xml").write_text("<package><name>other</name></package>")
    for options in ([], ["--create"]):
        assert sync("--px4", "firmware", *options, "other") == 2
        assert "this is the package 'other', not 'px4_msgs': give its name with --ros-package other" in (
            capsys.readouterr().err
        )


def test_the_current_folder_is_called_by_its_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    monkeypatch.chdir(package())
    assert sync("--px4", "../firmware", ".") == 0
    assert capsys.readouterr().out == "px4_msgs is up to date with ../firmware: 7 definitions\n"


TWO_TAGS = "unit of 'a' from 'A' to 'V', frame of 'a' from 'X' to 'Y'"
SIX_TAGS = ", ".join(f"unit of '{name}' from 'A' to 'V'" for name in "abcd") + " and 2 more"


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("uint64 timestamp # When\n", "uint64 timestamp   # When \n\n", "only white space"),
        ("uint64 timestamp # When\n", "uint64 timestamp # Then\n", "only comments"),
        ("string A=x y\n", "string A=xy\n", "constants"),
        ("uint64 timestamp # When\r\n", "uint64 timestamp # When\n", "only white space"),
        ("uint64 timestamp\r\n", "uint64 timestamp # When\n", "only comments"),
        ("uint64 timestamp\r\n", "uint64 timestamp\nuint8 a\n", "fields"),
        ("float32 a # [A]\n", "float32 a # [mA]\n", "unit of 'a' from 'A' to 'mA'"),
        ("float32 a # [@range 0, 1]\n", "float32 a # [@range -1, 1]\n", "range of 'a' from '0, 1' to '-1, 1'"),
        ("float32 a # [@frame NED]\n", "float32 a # [@frame ENU]\n", "frame of 'a' from 'NED' to 'ENU'"),
        ("uint8 a # [@enum ON]\n", "uint8 a # [@enum OFF]\n", "enum of 'a' from 'ON' to 'OFF'"),
        ("float32 a # [@invalid 0]\n", "float32 a # [@invalid NaN]\n", "invalid value of 'a' from '0' to 'NaN'"),
        ("float32 a # [A]\n", "uint8 b\nfloat32 a # [V]\n", "fields, unit of 'a' from 'A' to 'V'"),
        ("float32 a # [A] [@frame X]\n", "float32 a # [V] [@frame Y]\n", TWO_TAGS),
        (
            "".join(f"float32 {a} # [A]\n" for a in "abcdef"),
            "".join(f"float32 {a} # [V]\n" for a in "abcdef"),
            SIX_TAGS,
        ),
        ("float32 a # [m/s^2] One\n", "float32 a # [m s^-2] Other\n", "only comments"),
        ("float32 a # One\n", "float32 a # [m] One\n", "only comments"),
        ("uint8[0] a\n", "float32 a\n", ""),
    ],
)
def test_the_kind_of_a_change_is_told(before: str, after: str, said: str) -> None:
    assert describe_change("msg/Rpm.msg", before.encode(), after.encode()) == said


def test_a_changed_tag_of_a_service_is_told() -> None:
    before, after = (f"uint8 a\n---\nfloat32 b # [{unit}]\n".encode() for unit in ("A", "V"))
    assert describe_change("srv/Set.srv", before, after) == "unit of 'b' from 'A' to 'V'"


@pytest.mark.slow
@pytest.mark.parametrize("number", [20, 21])
def test_many_changes_of_comments_are_told_by_their_number(number: int, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ROOT / "msg", "firmware/msg")
    package()
    for path in sorted(Path("firmware/msg").glob("*.msg"))[:number]:
        path.write_text(f"# More.\n{path.read_text()}")
    assert sync("--px4", "firmware", PACKAGE) == 0
    *changes, last = capsys.readouterr().out.splitlines()
    assert last == f"px4_msgs updated from firmware: {number} changed, {259 - number} unchanged"
    assert len(changes) == (20 if number == 20 else 1)
    assert changes[0] == "changed 21 definitions: only comments" or changes[0].startswith("changed msg/")


def test_the_diff_does_not_tell_each_change_again(capsys: pytest.CaptureFixture[str]) -> None:
    out_of_step()
    assert sync("-q", "--px4", "firmware", "--diff", PACKAGE) == 1
    patch = capsys.readouterr().out
    assert sync("--px4", "firmware", "--diff", PACKAGE) == 1
    assert capsys.readouterr().out.removeprefix(patch).splitlines() == [
        "px4_msgs differs from firmware: 1 to add, 3 to change, 1 to remove, 3 unchanged, 1 kept"
    ]


APPLY = {"patch": ("patch", "-p0"), "git": ("git", "apply", "-p0", "-")}


@pytest.mark.slow
@pytest.mark.parametrize("tool", [pytest.param(tool, marks=pytest.mark.tools(tool)) for tool in APPLY])
@pytest.mark.parametrize("where", [".", "px4_msgs"])
def test_the_diff_is_a_patch_that_brings_the_package_in_step(
    tool: str, where: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out_of_step()
    (PACKAGE / "msg" / "EscStatus.msg").write_bytes("uint8 a # a\fb\x85c\u2028d\r\nuint8 b".encode())
    prefix, px4 = ("", "../firmware") if where == "." else ("px4_msgs/", "firmware")
    monkeypatch.chdir(PACKAGE if where == "." else ".")
    assert sync("-q", "--px4", px4, "--diff", where) == 1
    patch = capsys.readouterr().out
    assert f"--- /dev/null\n+++ {prefix}msg/Wheel.msg\n" in patch
    assert f"--- {prefix}msg/Rpm.msg\n+++ /dev/null\n" in patch
    patched = subprocess.run(APPLY[tool], input=patch.encode(), capture_output=True, check=False)
    assert patched.returncode == 0, patched
    assert sync("-q", "--px4", px4, "--check", where) == 0


@pytest.mark.slow
def test_the_page_shows_what_is_really_said(capsys: pytest.CaptureFixture[str]) -> None:
    source = Path("PX4-Autopilot")
    for kind in ("msg", "srv"):
        shutil.copytree(ROOT / kind, source / kind)
    shutil.copy(ROOT / "dds_topics.yaml", source)
    create, pkg = ("--px4", "PX4-Autopilot", "--create"), "ws/src/px4_msgs"
    assert sync(*create, pkg) == 0
    write_definitions(Path(pkg), {"msg/Wheel.msg": definition("Rpm")})
    (source / "msg" / "OrbTest.msg").unlink()
    (source / "msg" / "WheelSpeed.msg").write_text("uint64 timestamp\nfloat32[4] speed\n")
    for name, line in (("BatteryStatus", "# Said more clearly.\n"), ("VehicleStatus", "uint8 added\n")):
        path = source / "msg" / "versioned" / f"{name}.msg"
        path.write_text(path.read_text().replace("MESSAGE_VERSION = 4", "MESSAGE_VERSION = 5") + line)
    report = source / "msg" / "EscReport.msg"
    report.write_text(report.read_text().replace("[V]", "[mV]", 1))
    bridge = (source / "dds_topics.yaml").read_text()
    entry = "publications:\n  - topic: /fmu/out/wheel_speed\n    type: px4_msgs::msg::WheelSpeed\n"
    (source / "dds_topics.yaml").write_text(bridge.replace("publications:\n", entry, 1))
    sync(*create[:2], pkg)
    sync(*create[:2], pkg)
    made, *changes = capsys.readouterr().out.splitlines()
    page = (ROOT / "docs" / "sync.md").read_text()
    first, second = (block.splitlines() for block in re.findall(r"```console\n(.*?)```", page, re.DOTALL))
    assert [line for line in first if not line.startswith("$ ")] == changes
    assert made in second


def test_one_definition_is_counted_in_the_singular(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("one"), {"msg/Elbow.msg": "uint64 timestamp\n"})
    for told in ("created from one: 1 definition", "is up to date with one: 1 definition"):
        assert sync("--px4", "one", "--create", "--ros-package", "arm_msgs", "arm_msgs") == 0
        assert capsys.readouterr().out == f"arm_msgs {told}\n"


def test_a_package_whose_every_message_changed_is_still_from_its_source() -> None:
    write_definitions(Path("one"), {"msg/Elbow.msg": "uint64 timestamp\n"})
    assert sync("-q", "--px4", "one", "--create", "arm_msgs") == 0
    write_definitions(
        Path("one"), {"msg/Elbow.msg": "uint64 timestamp\nfloat32 angle\n", "msg/Wrist.msg": "uint64 timestamp\n"}
    )
    assert sync("-q", "--px4", "one", "arm_msgs") == 0
    for path in Path("arm_msgs/msg").iterdir():
        path.unlink()
    assert sync("-q", "--px4", "v1.18", "arm_msgs") == 0  # the way to another source
