"""Tests of the cases that `msggen sync` refuses: exit code 2, location and reason, and no change on disk."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import stat
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.base.diagnostics import CODES
from msggen.cli import DONE, main
from support.catalogs import write_definitions
from support.examples import by_day
from support.packages import (
    BRIDGE_PLACE,
    MANIFEST,
    PACKAGE,
    RECORD,
    committed,
    content,
    definition,
    definitions,
    firmware,
    git,
    package,
    plain_package,
    sync,
)

RPM = PACKAGE / "msg" / "Rpm.msg"
SYNC = ("--px4", "firmware", "px4_msgs")

pytestmark = pytest.mark.usefixtures("working_folder")


def edit(path: Path, field: str = "mine") -> None:
    """Add a field to a definition."""
    path.write_text(f"{path.read_text()}uint8 {field}\n")


def edit_firmware(field: str = "newer") -> None:
    """Change a message of the firmware, so that there is something to sync."""
    edit(Path("firmware/msg/Rpm.msg"), field)


def state(folder: Path) -> dict[str, tuple[object, int]]:
    """Return content and mode of everything in `folder`."""
    return {name: (data, (folder / name).lstat().st_mode) for name, data in content(folder).items()}


class Refusal(NamedTuple):
    """A refused case: its preparation, the arguments of `sync`, and the expected error."""

    code: str
    place: str
    fragment: str
    prepare: Callable[[], object]
    arguments: tuple[str, ...] = SYNC


# Preparations. Each starts with a package that is in step, and then a firmware that has changed.


def chmod(mode: int, name: str) -> Callable[[], None]:
    return lambda: (PACKAGE / name).chmod(mode)


def replace_by_link(name: str, target: str) -> Callable[[], None]:
    def prepare() -> None:
        (PACKAGE / name).rename("moved")
        (PACKAGE / name).symlink_to(target)

    return prepare


def rename(name: str, other: str) -> Callable[[], object]:
    return lambda: (PACKAGE / name).rename(PACKAGE / other)


def rename_package() -> None:
    (PACKAGE / "package.xml").write_text(MANIFEST.replace("px4_msgs", "my_msgs"))


def spoil_manifest() -> None:
    (PACKAGE / "package.xml").write_text("<package>")


def make_file() -> None:
    Path("file").write_text("mine")


def make_links() -> None:
    Path("outside").mkdir()
    Path("linked").symlink_to("outside")
    Path("dangling").symlink_to("nowhere")


def make_folder() -> None:
    write_definitions(Path("folder"), {"notes.txt": "mine"})


def read_only_folder() -> None:
    Path("folder").mkdir(mode=0o555)


def defined_twice() -> None:
    write_definitions(Path("firmware"), {"msg/versioned/Rpm.msg": f"{definition('Rpm')}\n# TOPICS rpm_two\n"})


def make_bare_source() -> None:
    write_definitions(Path("bare"), {"package.xml": MANIFEST, "msg/Rpm.msg": definition("Rpm")})


def replace_by_folder() -> None:
    RPM.unlink()
    write_definitions(RPM, {"notes.txt": "mine"})


def replace_folder_by_file() -> None:
    shutil.rmtree(PACKAGE / "msg")
    (PACKAGE / "msg").write_text("mine")


def hand_made() -> None:
    write_definitions(PACKAGE, {"msg/Wheel.msg": "uint8 mine\n"})
    write_definitions(Path("firmware"), {"msg/Wheel.msg": definition("Rpm")})


def uncommitted_edit() -> None:
    committed(PACKAGE)
    edit(RPM)


def staged_edit() -> None:
    uncommitted_edit()
    git(PACKAGE, "add", "-A")


def untracked_in_the_way() -> None:
    committed(PACKAGE)
    hand_made()


def uncommitted_and_obsolete() -> None:
    uncommitted_edit()
    Path("firmware/msg/Rpm.msg").unlink()


def uncommitted_in_a_workspace() -> None:
    committed(Path())
    edit(RPM)


def broken_repository() -> None:
    committed(PACKAGE)
    (PACKAGE / ".git" / "HEAD").write_text("nonsense")


def without_bridge() -> None:
    Path("firmware", BRIDGE_PLACE).unlink()


def spelled_with_the_package() -> None:
    path = Path("firmware/msg/EscStatus.msg")
    path.write_text(path.read_text().replace("EscReport[12]", "px4_msgs/EscReport[12]"))


def bad_firmware() -> None:
    write_definitions(Path("firmware"), {"msg/Wheel.msg": "uint64 timestamp\nfloat3 x\n"})


def ignored_edit() -> None:
    (PACKAGE / ".gitignore").write_text("msg/\n")
    committed(PACKAGE)
    edit(RPM)


def ignored_in_the_way() -> None:
    (PACKAGE / ".gitignore").write_text("Wheel.msg\n")
    committed(PACKAGE)
    hand_made()


def own_that_nests(*, text: str = "EscReport[2] reports\n", name: str = "msg/Mine.msg") -> Callable[[], None]:
    def prepare() -> None:
        write_definitions(PACKAGE, {name: f"uint8 a\n{text}"})
        Path("firmware/msg/EscReport.msg").unlink()
        Path("firmware/msg/EscStatus.msg").write_text(definition("Rpm"))

    return prepare


def own_that_nests_what_does_not_cross() -> None:
    write_definitions(PACKAGE, {"msg/Mine.msg": "Rpm rpm\n"})


def all_read_only() -> None:
    for name in ("Rpm", "EscReport", "EscStatus"):
        edit(Path(f"firmware/msg/{name}.msg"), "newest")
        (PACKAGE / "msg" / f"{name}.msg").chmod(0o444)
    (PACKAGE / "msg").chmod(0o555)


def from_another_source() -> None:
    write_definitions(Path("arm"), {"msg/Elbow.msg": "uint64 timestamp\n", "msg/Wrist.msg": "uint64 timestamp\n"})
    assert sync("-q", "--px4", "arm", "--create", "arm_msgs") == DONE


def nothing() -> None:
    pass


REFUSALS = [
    # the source is not a firmware
    Refusal("S101", "nowhere", "no such folder", nothing, ("--px4", "nowhere", "px4_msgs")),
    Refusal("S102", "folder", "no .msg file", make_folder, ("--px4", "folder", "px4_msgs")),
    Refusal("S102", "firmware/msg", "did you mean 'firmware'?", nothing, ("--px4", "firmware/msg", "px4_msgs")),
    Refusal(
        "S102",
        "firmware/msg@HEAD",
        "did you mean 'firmware@HEAD'?",
        lambda: committed(Path("firmware")),
        ("--px4", "firmware/msg@HEAD", "px4_msgs"),
    ),
    Refusal("M301", "firmware/msg/Wheel.msg:2:1", "did you mean 'float32'?", bad_firmware),
    # invalid git revision
    Refusal("S108", "firmware@v9", "not a git repository", nothing, ("--px4", "firmware@v9", "px4_msgs")),
    Refusal(
        "S108",
        "firmware@v9",
        "no revision 'v9'",
        lambda: committed(Path("firmware")),
        ("--px4", "firmware@v9", "px4_msgs"),
    ),
    # the target is not a package
    Refusal("S111", "nowhere", "or --create to create one", nothing, ("--px4", "firmware", "nowhere")),
    Refusal("S111", "folder", "no package.xml here", make_folder, ("--px4", "firmware", "folder")),
    Refusal("S111", "folder", "this one has files", make_folder, ("--px4", "firmware", "--create", "folder")),
    Refusal("S111", "file", "not a folder", make_file, ("--px4", "firmware", "file")),
    Refusal("S111", "file", "not a folder", make_file, ("--px4", "firmware", "--create", "file")),
    *(
        Refusal("S115", place.split("/")[0], "symbolic link to", make_links, ("--px4", "firmware", "--create", place))
        for place in ("dangling", "linked", "linked/new")
    ),
    Refusal("S111", "firmware", "a PX4-Autopilot tree", nothing, ("--px4", "firmware", "firmware")),
    Refusal("S111", "firmware", "a PX4-Autopilot tree", nothing, ("--px4", "firmware", "--create", "firmware")),
    Refusal("S111", "bare", "is also a source", make_bare_source, ("--px4", "bare", "bare")),
    Refusal("S111", "bare", "is also a source", make_bare_source, ("--msg-dir", "bare/msg", "bare")),
    *(
        Refusal("S111", place, "inside firmware/msg,", nothing, ("--px4", "firmware", "--create", place))
        for place in ("firmware/msg/new", "firmware/msg/versioned/new")
    ),
    Refusal(
        "S111",
        "firmware/srv/new",
        "inside firmware/srv,",
        nothing,
        ("--px4", "firmware", "--create", "firmware/srv/new"),
    ),
    Refusal("S107", "px4_msgs/package.xml:1:10", "not XML", spoil_manifest),
    # package of another name
    Refusal(
        "S112",
        "px4_msgs/package.xml",
        "'my_msgs', not 'px4_msgs'",
        rename_package,
        (*SYNC, "--ros-package", "px4_msgs"),
    ),
    Refusal(
        "S112",
        "px4_msgs/package.xml",
        "not 'my_msgs': give its name with --ros-package px4_msgs",
        nothing,
        (*SYNC, "--ros-package", "my_msgs"),
    ),
    Refusal(
        "S112",
        "px4_msgs/package.xml",
        "--ros-package px4_msgs, or create 'my_msgs' in another folder",
        nothing,
        (*SYNC, "--create", "--ros-package", "my_msgs"),
    ),
    Refusal(
        "S128",
        "arm_msgs",
        "none of the definitions that msggen wrote here (msg/Elbow.msg, msg/Wrist.msg)",
        from_another_source,
        ("--px4", "firmware", "arm_msgs"),
    ),
    Refusal("S112", "--ros-package", "'my-msgs' is not a valid name", nothing, (*SYNC, "--ros-package", "my-msgs")),
    Refusal(
        "M301",
        "firmware/msg/EscStatus.msg:",
        "write 'EscReport'",
        spelled_with_the_package,
        ("--px4", "firmware", "--create", "--ros-package", "my_msgs", "new"),
    ),
    # dirty target
    Refusal("S113", str(RPM), "discard them with `git -C px4_msgs restore msg/Rpm.msg`", uncommitted_edit),
    Refusal("S113", str(RPM), "with `git -C px4_msgs restore --staged --worktree msg/Rpm.msg`", staged_edit),
    Refusal("S113", str(RPM), "commit or stash", uncommitted_and_obsolete),
    Refusal("S113", str(RPM), "commit or stash", uncommitted_in_a_workspace),
    Refusal("S113", "px4_msgs/msg/Wheel.msg", "commit or stash it (`git stash -u`)", untracked_in_the_way),
    Refusal("S113", str(RPM), "git ignores this file", ignored_edit),
    Refusal("S113", "px4_msgs/msg/Wheel.msg", "git ignores this file", ignored_in_the_way),
    Refusal("S113", "px4_msgs", "cannot read the git status", broken_repository),
    Refusal("S104", "px4_msgs/msg/Wheel.msg", "msggen did not write this one", hand_made),
    Refusal("S104", str(RPM), "found a folder", replace_by_folder),
    Refusal("S104", "px4_msgs/msg", "expected a folder", replace_folder_by_file),
    # read-only target
    Refusal("S114", str(RPM), "the file is read-only", chmod(0o444, "msg/Rpm.msg")),
    Refusal("S114", "px4_msgs/msg", "the folder is read-only", chmod(0o555, "msg")),
    Refusal("S114", "px4_msgs", "the folder is read-only", chmod(0o555, ".")),
    Refusal("S114", "px4_msgs/.msggen.json", "the file is read-only", chmod(0o444, RECORD)),
    Refusal("S114", "px4_msgs", "4 files and folders are read-only", all_read_only),
    Refusal("S114", "px4_msgs", "chmod -R u+w px4_msgs", all_read_only),
    Refusal("S114", "folder", "create the package", read_only_folder, ("--px4", "firmware", "--create", "folder")),
    Refusal("S114", "folder", "create the package", read_only_folder, ("--px4", "firmware", "--create", "folder/new")),
    Refusal(
        "S114", "folder/a", "create the package", read_only_folder, ("--px4", "firmware", "--create", "folder/a/new")
    ),
    # symbolic links that lead out of the package
    Refusal("S115", "px4_msgs/msg", "out of the package", replace_by_link("msg", "../moved")),
    Refusal("S115", "px4_msgs/srv", "out of the package", replace_by_link("srv", "../moved")),
    Refusal("S115", str(RPM), "out of the package", replace_by_link("msg/Rpm.msg", "../../moved")),
    Refusal("S115", str(RPM), "out of the package", replace_by_link("msg/Rpm.msg", "/nowhere")),
    # file names that differ only in case
    Refusal("S116", "px4_msgs/msg/rpm.msg", "'msg/Rpm.msg'", rename("msg/Rpm.msg", "msg/rpm.msg")),
    Refusal("S116", "px4_msgs/msg/RPM.MSG", "'msg/Rpm.msg'", rename("msg/Rpm.msg", "msg/RPM.MSG")),
    Refusal("M204", "firmware/msg/versioned/Rpm.msg:1:1", "already defined in", defined_twice),
    # a user's own definitions that nest a removed message
    Refusal("M301", "px4_msgs/msg/Mine.msg:2:1", "'EscReport' would be removed", own_that_nests()),
    Refusal("M301", "px4_msgs/msg/Mine.msg:2:1", "'EscReport'", own_that_nests(text="px4_msgs/EscReport one\n")),
    Refusal(
        "M301", "px4_msgs/srv/Ask.srv:3:1", "'EscReport'", own_that_nests(text="---\nEscReport a\n", name="srv/Ask.srv")
    ),
    Refusal("M301", "px4_msgs/msg/Mine.msg:1:1", "'Rpm'", own_that_nests_what_does_not_cross, (*SYNC, "--topics-only")),
    # no bridge
    Refusal("S110", "firmware", "no dds_topics.yaml here", without_bridge, (*SYNC, "--topics-only")),
]


FIRST = {refusal.code: place for place, refusal in reversed([*enumerate(REFUSALS)])}
BY_DAY = [
    pytest.param(
        refusal,
        id=f"{refusal.code} {refusal.fragment}",
        marks=[pytest.mark.night] * (place % 2 == 1 and place != FIRST[refusal.code]),
    )
    for place, refusal in enumerate(REFUSALS)
]
"""Each run takes the first refusal of each code, and every other one."""


@by_day("looking", [(), ("--check",)], 2, ids=["", "check"])
@pytest.mark.parametrize("refusal", BY_DAY)
def test_it_is_refused_with_its_place_and_everything_stays(
    refusal: Refusal, looking: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    package()
    edit_firmware()
    refusal.prepare()
    before = state(Path())
    if looking and refusal.code == "S113" and "git status" not in refusal.fragment:
        assert sync(*refusal.arguments, *looking) == 1
        assert state(Path()) == before
        return
    assert sync(*refusal.arguments, *looking) == 2
    output = capsys.readouterr()
    first, last = output.err.splitlines()
    assert first.startswith(f"{refusal.place}:" if ":" not in refusal.place else refusal.place)
    assert f" {refusal.code} " in first
    assert refusal.fragment in first
    assert last == "1 error, nothing written"
    assert output.out == ""
    assert state(Path()) == before


def test_every_code_of_a_target_is_among_them() -> None:
    codes = {code for code in CODES if "S111" <= code <= "S116"}
    assert codes <= {refusal.code for refusal in REFUSALS}


def test_everything_that_stands_against_it_is_told_in_one_run(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    committed(PACKAGE)
    edit_firmware()
    edit(Path("firmware/msg/EscReport.msg"), "newer")
    edit(Path("firmware/msg/EscStatus.msg"), "newer")
    edit(RPM)
    (PACKAGE / "msg" / "EscReport.msg").chmod(0o444)
    replace_by_link("srv/VehicleCommand.srv", "/nowhere")()
    write_definitions(PACKAGE, {"msg/escstatus.msg": "mine"})
    assert sync(*SYNC) == 2
    told = [line.split(": ")[0] + line.split(": ")[1][:5] for line in capsys.readouterr().err.splitlines()[:-1]]
    assert told == [
        "px4_msgs/msg/EscReport.msgS114 ",
        "px4_msgs/msg/Rpm.msgS113 ",
        "px4_msgs/msg/escstatus.msgS116 ",
        "px4_msgs/srv/VehicleCommand.srvS115 ",
    ]


@pytest.mark.parametrize("arguments", [(), ("--create",), ("--check",), ("--topics", f"firmware/{BRIDGE_PLACE}")])
def test_an_existing_package_is_not_brought_in_step_with_the_embedded_set_for_want_of_a_source(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """The comments of the embedded set are not PX4's, so sync would rewrite all definitions."""
    firmware()
    package()
    before = state(Path())
    with pytest.raises(SystemExit) as exit_:
        sync(PACKAGE, *arguments)
    assert exit_.value.code == 2
    assert "name the firmware with --px4 or the setting px4" in capsys.readouterr().err
    assert state(Path()) == before


@pytest.mark.parametrize("setting", ['px4 = "firmware"', 'msg-dir = ["firmware"]'])
def test_a_source_in_the_settings_is_one(setting: str) -> None:
    firmware()
    package()
    Path("pyproject.toml").write_text(f"[tool.msggen]\n{setting}\n")
    assert sync("-q", PACKAGE) == 0


@pytest.mark.parametrize("command", ["build", "check", "sync"])
def test_the_msg_folder_of_a_firmware_is_not_taken_for_the_firmware(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    package()
    monkeypatch.chdir("firmware/msg")
    assert main([command, "--px4", ".", *(["../../px4_msgs"] if command != "build" else [])]) == 2
    assert ".: S102 only a part of a firmware tree, did you mean '..'?" in capsys.readouterr().err


def test_as_further_definitions_the_msg_folder_of_a_firmware_is_welcome() -> None:
    firmware()
    assert sync("-q", "--msg-dir", "firmware/msg", "--create", PACKAGE) == 0


def test_the_current_folder_is_not_replaced(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    Path("empty").mkdir()
    monkeypatch.chdir("empty")
    assert sync("--px4", "../firmware", "--create", ".") == 2
    assert "cannot replace the current folder" in capsys.readouterr().err
    assert os.listdir() == []


# --- Cases that are not refused


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", ["EscReport[2] a\nfloat3 b\n", "std_msgs/EscReport a\n", "Unknown a\n", "VehicleStatus a\n", "", "\x00"]
)
def test_definitions_of_ones_own_that_lose_nothing_are_no_hindrance(text: str) -> None:
    firmware()
    package()
    own_that_nests(text=text)()
    assert sync("-q", *SYNC) == 0
    assert not (PACKAGE / "msg" / "EscReport.msg").exists()


def test_ignored_files_as_msggen_wrote_them_are_no_work() -> None:
    firmware()
    package()
    (PACKAGE / ".gitignore").write_text("msg/\n")
    committed(PACKAGE)
    edit_firmware()
    assert sync("-q", *SYNC) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))


def test_three_read_only_files_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    all_read_only()
    (PACKAGE / "msg").chmod(0o755)
    assert sync(*SYNC) == 2
    assert capsys.readouterr().err.count("S114 the file is read-only") == 3


def test_what_is_committed_may_be_replaced_and_removed() -> None:
    firmware()
    package()
    edit(RPM)
    edit(PACKAGE / "msg" / "EscStatus.msg")
    committed(PACKAGE)
    Path("firmware/msg/Rpm.msg").unlink()
    assert sync("-q", *SYNC) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))
    assert git(PACKAGE, "show", "HEAD:msg/Rpm.msg").endswith("uint8 mine")


def test_what_msggen_wrote_need_not_be_committed() -> None:
    """As after two syncs in a row."""
    firmware()
    package()
    committed(PACKAGE)
    for field in ("newer", "newest"):
        edit_firmware(field)
        assert sync("-q", *SYNC) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))


def test_uncommitted_work_that_sync_does_not_touch_is_no_hindrance() -> None:
    firmware()
    package()
    committed(PACKAGE)
    write_definitions(PACKAGE, {"msg/Wheel.msg": "uint8 mine\n", "notes.txt": "mine"})
    (PACKAGE / "CMakeLists.txt").write_text("# mine\n")
    edit(PACKAGE / "msg" / "EscReport.msg")
    edit(Path("firmware/msg/EscReport.msg"))  # the same edit: nothing is lost
    edit_firmware()
    assert sync("-q", *SYNC) == 0
    assert (PACKAGE / "msg" / "Wheel.msg").read_text() == "uint8 mine\n"


def test_without_a_record_ignored_files_are_no_work() -> None:
    firmware()
    write_definitions(plain_package(), {".gitignore": "Safety.msg\n"})
    committed(PACKAGE)
    write_definitions(PACKAGE, {"msg/Safety.msg": "uint8 old\n"})
    assert sync("-q", *SYNC) == 0
    assert not (PACKAGE / "msg" / "Safety.msg").exists()


def test_a_package_that_no_repository_has_is_not_guarded_by_the_one_around_it() -> None:
    firmware()
    package()
    git(Path(), "init", "-q")
    edit(RPM)
    edit_firmware()
    assert sync("-q", *SYNC) == 0


@pytest.mark.parametrize("cause", [uncommitted_edit, staged_edit, uncommitted_in_a_workspace])
def test_the_command_for_uncommitted_changes_makes_sync_possible(
    cause: Callable[[], None], capsys: pytest.CaptureFixture[str]
) -> None:
    firmware()
    package()
    edit_firmware()
    cause()
    assert sync(*SYNC) == 2
    [command] = re.findall(r"`(git .*)`", capsys.readouterr().err)
    subprocess.run(shlex.split(command), check=True)
    assert sync("-q", *SYNC) == 0


def test_the_patch_shows_uncommitted_changes(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    uncommitted_edit()
    before = state(Path())
    assert sync("-q", *SYNC, "--diff") == 1
    assert "+++ px4_msgs/msg/Rpm.msg" in capsys.readouterr().out
    assert state(Path()) == before


def test_a_misspelt_package_is_suggested(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package("ws/src/acme_msgs")
    for name in ("ws/src/acme_mgs", "ws/scr/acme_msgs"):
        near = "ws/src" if "scr" in name else "ws/src/acme_msgs"
        assert sync("--px4", "firmware", name) == 2
        text = f"{name}: S111 no such folder, did you mean '{near}'? --create creates a new package\n"
        assert capsys.readouterr().err.startswith(text)
        assert main(["check", "--px4", "firmware", name]) == 2
        assert capsys.readouterr().err.startswith(f"{name}: S101 no such folder, did you mean '{near}'?\n")


def test_an_empty_folder_may_be_a_submodule(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    package()
    Path("PX4-Autopilot").mkdir()
    for command in ("sync", "check"):
        assert main([command, "--px4", "PX4-Autopilot", "px4_msgs"]) == 2
        text = "PX4-Autopilot: S102 empty folder: a submodule that is not checked out?\n"
        assert capsys.readouterr().err.startswith(text)


def test_a_file_keeps_its_mode() -> None:
    firmware()
    package()
    edit_firmware()
    RPM.chmod(0o755)
    assert sync("-q", *SYNC) == 0
    assert stat.S_IMODE(RPM.stat().st_mode) == 0o755


def test_a_link_to_nowhere_in_the_package_is_replaced() -> None:
    firmware()
    package()
    RPM.unlink()
    RPM.symlink_to("gone.msg")
    assert sync("-q", *SYNC) == 0
    assert definitions(PACKAGE) == definitions(package("fresh"))
    assert not RPM.is_symlink()


def test_a_name_of_px4_in_andefined_twice_is_somebodys_own() -> None:
    firmware()
    plain_package()
    write_definitions(PACKAGE, {"msg/SAFETY.msg": "uint8 mine\n", "msg/Safety.msg": "uint8 old\n"})
    assert sync("-q", *SYNC) == 0
    assert sorted(name for name in os.listdir(PACKAGE / "msg") if name.lower() == "safety.msg") == ["SAFETY.msg"]


def test_a_package_may_follow_an_earlier_state_of_itself() -> None:
    firmware()
    package()
    committed(PACKAGE)
    git(PACKAGE, "tag", "before")
    before = definitions(PACKAGE)
    edit_firmware()
    assert sync("-q", *SYNC) == 0
    git(PACKAGE, "commit", "-q", "-a", "-m", "after")
    assert sync("-q", "--px4", "px4_msgs@before", "px4_msgs") == 0
    assert definitions(PACKAGE) == before


# --- Temporary names


@pytest.mark.parametrize("arguments", [(PACKAGE,), ("--create", "new")], ids=["update", "create"])
@pytest.mark.parametrize("kind", ["folder", "link", "file"])
def test_a_staging_folder_that_msggen_did_not_create_stays(
    kind: str, arguments: tuple[object, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    source = firmware()
    package()
    write_definitions(source, {"msg/DebugVect.msg": definition("DebugVect")})
    victim = write_definitions(Path("victim"), {"file": "mine"})
    stage = Path(".new.msggen-stage") if "new" in arguments else PACKAGE / ".msggen-stage"
    if kind == "folder":
        victim.rename(stage)
    elif kind == "link":
        stage.symlink_to(victim.resolve())
    else:
        stage.write_text("mine")
    before = content(Path())
    assert sync("--px4", "firmware", *arguments) == 2
    assert f"{stage.name}: S104 msggen did not create this" in capsys.readouterr().err
    assert content(Path()) == before


@pytest.mark.parametrize("kind", ["link", "hard link"])
def test_the_record_is_not_written_through_a_link(kind: str) -> None:
    source = firmware()
    package()
    write_definitions(source, {"msg/DebugVect.msg": definition("DebugVect")})
    Path("victim").write_text("mine")
    aside = PACKAGE / f"{RECORD}.msggen-new"
    os.link("victim", aside) if kind == "hard link" else aside.symlink_to(Path("victim").resolve())
    before = definitions(PACKAGE)
    code = sync("-q", "--px4", "firmware", PACKAGE)
    assert code == (0 if kind == "hard link" else 2)
    assert (definitions(PACKAGE) == before) == (code == 2)
    assert Path("victim").read_text() == "mine"
