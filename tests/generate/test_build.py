"""Tests of `msggen build` on a disk: it writes only changed files, touches only its own, and survives being killed.

The tests use a few real definitions at a time, so that each build takes milliseconds.
"""

from __future__ import annotations

import hashlib
import importlib
import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from msggen.base.disk import swap
from msggen.base.exit_codes import INTERRUPTED
from msggen.cli import main
from msggen.generate.python import package as packages
from support.catalogs import write_definitions
from support.disk_calls import dies_at
from support.examples import by_day
from support.packages import BRIDGE_PLACE, RECORD, age, content, definition
from support.repository import ROOT, shared

PACKAGE = Path("generated", "px4_types")
FINGERPRINT = ".msggen_cache/fingerprint.json"
BRIDGE = """
publications:
  - topic: /fmu/out/vehicle_status
    type: px4_msgs::msg::VehicleStatus
subscriptions:
  - topic: /fmu/in/vehicle_command
    type: px4_msgs::msg::VehicleCommand
"""
MESSAGES = ("Rpm", "EscReport", "EscStatus")
VERSIONED = ("VehicleStatus", "VehicleCommand", "VehicleCommandAck")
_numbers = itertools.count()

pytestmark = pytest.mark.usefixtures("working_folder")


def build(*arguments: object) -> int:
    """Run `msggen build`; return the exit code."""
    return main(["build", *map(str, arguments)])


def folder_of(name: str, *messages: str) -> Path:
    """Return a folder of these embedded messages, outside any firmware tree."""
    return write_definitions(Path(name), {f"{message}.msg": definition(message) for message in messages})


def firmware(name: str = "firmware", versioned: str = "versioned/") -> Path:
    """Return a small PX4 tree with real messages, a service and a bridge of two topics."""
    files = {f"msg/{message}.msg": definition(message) for message in MESSAGES}
    files |= {f"msg/{versioned}{message}.msg": definition(message) for message in VERSIONED}
    service = (ROOT / "srv" / "VehicleCommand.srv").read_text(encoding="utf-8")
    return write_definitions(Path(name), {**files, "srv/VehicleCommand.srv": service, BRIDGE_PLACE: BRIDGE})


def identity(folder: Path) -> dict[str, tuple[int, int]]:
    """Return inode and time of every file; both change even if a file is rewritten with the same content."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


def imported(folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import the package `name` from `folder`."""
    monkeypatch.syspath_prepend(str(folder.resolve()))
    return importlib.import_module(name)


def built(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> Any:
    """Build a package under a unique name and import it."""
    name = f"built_{next(_numbers)}"
    assert build("-q", "--package", name, "-o", "src", *arguments) == 0
    return imported(Path("src"), name, monkeypatch)


# --- Written files


def test_a_second_run_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    assert build("--px4", "firmware") == 0
    age(PACKAGE)
    before = identity(PACKAGE)
    capsys.readouterr()
    assert build("--px4", "firmware") == 0
    assert build("--check", "--px4", "firmware") == 0
    assert identity(PACKAGE) == before
    assert capsys.readouterr().out.count("generated/px4_types is up to date") == 2


@pytest.mark.parametrize(
    ("text", "changed"),
    [("uint8 STILL = 0  # Nothing turns.\n", {RECORD, FINGERPRINT, "msg/_rpm.py"}), ("\n\n", {FINGERPRINT})],
    ids=["a constant", "white space"],
)
def test_a_change_rewrites_the_files_that_it_alters_alone(text: str, changed: set[str]) -> None:
    firmware()
    build("-q", "--px4", "firmware")
    age(PACKAGE)
    before = identity(PACKAGE)
    with Path("firmware/msg/Rpm.msg").open("a") as stream:
        stream.write(text)
    assert build("-q", "--px4", "firmware") == 0
    after = identity(PACKAGE)
    assert {name for name in before if after[name] != before[name]} == changed
    assert after.keys() == before.keys()


@pytest.mark.parametrize("harm", ["damaged", "deleted"])
def test_a_generated_file_that_was_harmed_is_restored_and_no_other_written(harm: str) -> None:
    firmware()
    build("-q", "--px4", "firmware")
    age(PACKAGE)
    sound, before = content(PACKAGE), identity(PACKAGE)
    victim = PACKAGE / "msg" / "_rpm.py"
    victim.write_text("# harmed\n") if harm == "damaged" else victim.unlink()
    assert build("-q", "--px4", "firmware") == 0
    assert content(PACKAGE) == sound
    after = identity(PACKAGE)
    assert {name for name in before if after[name] != before[name]} == {"msg/_rpm.py"}


def test_what_remains_after_removals_is_what_a_fresh_build_makes() -> None:
    firmware()
    build("-q", "--px4", "firmware", "-o", "grown")
    shutil.rmtree("firmware/srv")
    Path("firmware/msg/Rpm.msg").unlink()
    Path("firmware/msg/EscStatus.msg").unlink()
    build("-q", "--px4", "firmware", "-o", "grown")
    build("-q", "--px4", "firmware", "-o", "fresh")
    assert content(Path("grown")) == content(Path("fresh"))


def test_two_packages_share_a_folder() -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare", "--package", "first", "-o", "src")
    first = content(Path("src/first"))
    build("-q", "--msg-dir", "bare", "--package", "second", "-o", "src")
    assert content(Path("src/first")) == first
    assert sorted(os.listdir("src")) == ["first", "second"]


# --- Files that msggen does not own


def test_foreign_files_and_folders_stay_through_builds_and_removals() -> None:
    firmware()
    foreign = {
        "notes.txt": "mine",
        "helpers.py": "mine = 1\n",
        "msg/_mine.py": "mine = 2\n",
        "srv/extra/data.json": "{}",
        ".hidden": "mine",
        "__pycache__/helpers.cpython-311.pyc": "mine",
    }
    write_definitions(PACKAGE, foreign)
    age(PACKAGE)
    before = identity(PACKAGE)
    build("-q", "--px4", "firmware")
    shutil.rmtree("firmware/srv")
    Path("firmware/msg/Rpm.msg").unlink()
    assert build("-q", "--px4", "firmware") == 0
    after = identity(PACKAGE)
    assert {name: after[name] for name in before} == before
    assert sorted(os.listdir(PACKAGE / "srv")) == ["extra"]


def test_files_beside_the_package_stay() -> None:
    folder_of("bare", "Rpm")
    write_definitions(Path("generated"), {"other/__init__.py": "", "px4_types.py": "", "README.md": "mine"})
    before = content(Path("generated"))
    build("-q", "--msg-dir", "bare")
    after = content(Path("generated"))
    assert {name: after[name] for name in before} == before


@pytest.mark.parametrize(
    "make", ["file", "folder", "link", "dangling link"], ids=lambda make: f"a {make}".replace(" ", "_")
)
@pytest.mark.parametrize("name", ["__init__.py", "msg/_rpm.py"])
def test_a_foreign_file_where_one_is_to_be_written_is_refused_and_nothing_changes(
    make: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of("bare", "Rpm")
    target = PACKAGE / name
    target.parent.mkdir(parents=True)
    if make == "folder":
        target.mkdir()
    elif make == "file":
        target.write_text("mine\n")
    else:
        Path("elsewhere.py").write_text("mine\n") if make == "link" else None
        target.symlink_to(Path("elsewhere.py").resolve())
    before = content(Path())
    assert build("--msg-dir", "bare") == 2
    assert content(Path()) == before
    assert capsys.readouterr().err.startswith(f"{target}:1:1: S104 ")


def test_a_foreign_file_stops_a_rebuild_as_well_and_nothing_changes() -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    folder_of("bare", "DebugVect")
    (PACKAGE / "msg" / "_debug_vect.py").write_text("mine\n")
    before = identity(PACKAGE)
    assert build("-q", "--msg-dir", "bare") == 2
    assert identity(PACKAGE) == before


@pytest.mark.parametrize("option", ["--check", "--diff"])
def test_a_foreign_file_is_reported_without_writing_too(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    write_definitions(PACKAGE, {"cdr.py": "mine\n"})
    assert build(option, "--msg-dir", "bare") == 2
    assert "S104" in capsys.readouterr().err


def test_a_file_that_happens_to_be_right_is_adopted() -> None:
    """A version control that omits hidden files loses the record, and the next build restores it."""
    firmware()
    build("-q", "--px4", "firmware")
    whole = content(PACKAGE)
    (PACKAGE / RECORD).unlink()
    assert build("-q", "--px4", "firmware") == 0
    assert content(PACKAGE) == whole


def test_a_generated_file_edited_by_hand_stays_when_it_is_no_longer_needed(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm", "DebugVect")
    build("-q", "--msg-dir", "bare")
    edited = PACKAGE / "msg" / "_rpm.py"
    edited.write_text("mine = 1\n")
    Path("bare/Rpm.msg").unlink()
    assert build("-q", "--msg-dir", "bare") == 0
    assert edited.read_text() == "mine = 1\n"
    assert str(edited) in capsys.readouterr().err


# --- A damaged or malicious record


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        '{"files": []}',
        '{"fingerprint": 1, "files": {"cdr.py": 1}}',
        '{"fingerprint": "", "files": {"cdr.py": null}}',
        '{"fingerprint": "", "files": null}',
        "\0\xff",
        "[" * 100_000,
    ],
    ids=lambda text: text[:40] or "empty",
)
def test_a_damaged_record_is_an_empty_one(text: str) -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    whole = content(PACKAGE)
    (PACKAGE / RECORD).write_bytes(text.encode("latin-1"))
    assert build("-q", "--msg-dir", "bare") == 0
    assert content(PACKAGE) == whole


def test_a_record_that_lost_lines_hides_no_missing_file() -> None:
    """A merge that took only a part of the record has this effect."""
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    whole = content(PACKAGE)
    record = json.loads((PACKAGE / RECORD).read_text())
    del record["files"]["cdr.py"]
    (PACKAGE / RECORD).write_text(json.dumps(record))
    (PACKAGE / "cdr.py").unlink()
    assert build("-q", "--check", "--msg-dir", "bare") == 1
    assert build("-q", "--msg-dir", "bare") == 0
    assert content(PACKAGE) == whole


def hostile_names(folder: Path) -> list[str]:
    return [
        "../outside.txt",
        "../../outside.txt",
        "../../../outside.txt",
        "msg/../../../outside.txt",
        "./../../outside.txt",
        "..",
        ".",
        "",
        "/",
        "~/outside.txt",
        str((folder / "outside.txt").resolve()),
        "..\\..\\outside.txt",
        "msg//../../../outside.txt",
        "linked/outside.txt",
    ]


def test_a_hostile_record_removes_nothing_outside(tmp_path: Path) -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    outside = {"outside.txt": "mine", "generated/outside.txt": "mine", "elsewhere/outside.txt": "mine"}
    write_definitions(Path(), outside)
    (PACKAGE / "linked").symlink_to(Path("elsewhere").resolve())
    hostile = dict.fromkeys(hostile_names(tmp_path), hashlib.sha256(b"mine").hexdigest())
    record = json.loads((PACKAGE / RECORD).read_text())
    record = {"fingerprint": "stale", "files": {**record["files"], **hostile}}
    (PACKAGE / RECORD).write_text(json.dumps(record))
    assert build("-q", "--msg-dir", "bare") == 0
    assert {name: Path(name).read_text() for name in outside if Path(name).exists()} == outside


# --- Read-only runs


@pytest.mark.parametrize("option", ["--check", "--diff"])
def test_looking_for_a_package_that_is_not_there_exits_with_1_and_creates_nothing(option: str) -> None:
    folder_of("bare", "Rpm")
    before = content(Path())
    assert build(option, "--msg-dir", "bare", "--depfile", "x.d") == 1
    assert content(Path()) == before


def stale_by(cause: str) -> None:
    if cause == "input changed":
        Path("firmware/msg/Rpm.msg").write_text(definition("Rpm") + "uint8 STILL = 0\n")
    elif cause == "input added":
        Path("firmware/msg/DebugVect.msg").write_text(definition("DebugVect"))
    elif cause == "input removed":
        Path("firmware/msg/Rpm.msg").unlink()
    elif cause == "output edited":
        (PACKAGE / "cdr.py").write_text("# edited\n")
    elif cause == "output deleted":
        (PACKAGE / "py.typed").unlink()
    elif cause == "bridge changed":
        Path("firmware", BRIDGE_PLACE).write_text(BRIDGE.split("subscriptions", maxsplit=1)[0])


CAUSES = ["input changed", "input added", "input removed", "output edited", "output deleted", "bridge changed"]


@pytest.mark.slow
@by_day(("cause", "option"), itertools.product(CAUSES, ["--check", "--diff"]), 3)
def test_a_stale_package_exits_with_1_and_is_left_as_it_is(cause: str, option: str) -> None:
    firmware()
    build("-q", "--px4", "firmware")
    stale_by(cause)
    before = identity(Path())
    assert build(option, "--px4", "firmware") == 1
    assert identity(Path()) == before


def test_check_says_how_much_is_stale(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    build("-q", "--px4", "firmware")
    stale_by("input removed")
    build("--check", "--px4", "firmware")
    assert "is stale: 4 files to write, 1 to remove" in capsys.readouterr().out


def test_diff_shows_every_change_as_a_patch(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    build("-q", "--px4", "firmware")
    Path("firmware/msg/Rpm.msg").unlink()
    Path("firmware/msg/DebugVect.msg").write_text(definition("DebugVect"))
    capsys.readouterr()
    assert build("-q", "--diff", "--px4", "firmware") == 1
    shown = capsys.readouterr().out
    changed = set(re.findall(r"^--- (\S+)\n\+\+\+ (\S+)", shown, re.MULTILINE))
    paths = {
        name: str(PACKAGE / name) for name in ("msg/__init__.py", "msg/_debug_vect.py", "msg/_rpm.py", "topics.py")
    }
    both = {(paths[name], paths[name]) for name in ("msg/__init__.py", "topics.py")}
    assert both | {("/dev/null", paths["msg/_debug_vect.py"]), (paths["msg/_rpm.py"], "/dev/null")} <= changed
    assert "+class DebugVect(" in shown
    assert "-class Rpm(" in shown


def test_the_listed_outputs_are_those_that_a_build_makes(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    assert build("--list-outputs", "--px4", "firmware", "-o", "src") == 0
    listed = capsys.readouterr().out.splitlines()
    assert not Path("src").exists()
    build("-q", "--px4", "firmware", "-o", "src")
    made = [path for path in Path("src").rglob("*") if path.suffix in (".py", ".typed") or path.name == "names.json"]
    assert listed == sorted(map(str, made))
    assert build("--list-outputs", "--px4", "firmware", "-o", "src") == 0
    assert capsys.readouterr().out.splitlines() == listed


def test_the_listed_outputs_are_those_to_come_not_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    folder_of("bare", "DebugVect")
    assert build("--list-outputs", "--msg-dir", "bare") == 0
    assert str(PACKAGE / "msg" / "_debug_vect.py") in capsys.readouterr().out.splitlines()
    assert not (PACKAGE / "msg" / "_debug_vect.py").exists()


# --- The depfile


def rule(path: Path) -> tuple[list[str], list[str]]:
    """Return targets and prerequisites of a Makefile rule, without escapes."""
    joined = path.read_text().replace("\\\n", " ")
    targets, prerequisites = re.split(r":\s", joined, maxsplit=1)

    def names(text: str) -> list[str]:
        return [re.sub(r"\\([ #])", r"\1", name).replace("$$", "$") for name in re.findall(r"(?:\\.|[^\s\\])+", text)]

    return names(targets), names(prerequisites)


def test_the_depfile_names_all_inputs() -> None:
    firmware()
    folder_of("bare", "DebugVect")
    assert build("-q", "--px4", "firmware", "--msg-dir", "bare", "--depfile", "made/types.d") == 0
    targets, prerequisites = rule(Path("made/types.d"))
    inputs = [str(path) for path in Path("firmware").rglob("*") if path.is_file()]
    assert sorted(prerequisites) == sorted([*inputs, "bare/DebugVect.msg"])
    assert str(PACKAGE / "__init__.py") in targets


def test_the_depfile_escapes_what_make_would_misread() -> None:
    folder = "a b/#1/$x"
    folder_of(folder, "Rpm")
    assert build("-q", "--msg-dir", folder, "--depfile", "types.d", "-o", "out put") == 0
    targets, prerequisites = rule(Path("types.d"))
    assert prerequisites == [f"{folder}/Rpm.msg"]
    assert "out put/px4_types/__init__.py" in targets


@pytest.mark.tools("make")
def test_make_understands_the_depfile() -> None:
    folder = "a b/#1/$x"
    folder_of(folder, "Rpm")
    build("-q", "--msg-dir", folder, "--depfile", "types.d")
    marker = PACKAGE / "__init__.py"
    makefile = "include types.d\n$(firstword $(MAKECMDGOALS)):\n\t@echo again\n"
    Path("Makefile").write_text(makefile)
    asked = ["make", "--question", str(marker)]
    os.utime(Path(folder, "Rpm.msg"), (10**9, 10**9))
    assert subprocess.run(asked, check=False).returncode == 0
    age(PACKAGE)
    Path(folder, "Rpm.msg").touch()
    assert subprocess.run(asked, check=False).returncode == 1


def test_the_depfile_is_written_when_the_package_is_current_and_only_if_it_changes() -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    assert build("-q", "--msg-dir", "bare", "--depfile", "types.d") == 0
    os.utime("types.d", (10**9, 10**9))
    assert build("-q", "--msg-dir", "bare", "--depfile", "types.d") == 0
    assert Path("types.d").stat().st_mtime == 10**9
    folder_of("bare", "DebugVect")
    assert build("-q", "--msg-dir", "bare", "--depfile", "types.d") == 0
    assert "bare/DebugVect.msg" in Path("types.d").read_text()


# --- Messages to the user


def test_a_build_says_what_it_made(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    assert build("--px4", "firmware") == 0
    said = capsys.readouterr()
    assert "px4_types from firmware: 6 messages, 1 service, " in said.out
    assert "2 endpoints" in said.out
    assert re.search(r"^generated/px4_types: \d+ files written, 0 removed, 0 unchanged", said.out, re.MULTILINE)
    assert said.err == ""


def test_a_build_says_how_to_import_a_new_package(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program with the line that it prints imports the package, and one without it does not."""
    folder_of("bare", "Rpm")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert build("--msg-dir", "bare", "-o", "my types") == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "to import it: export PYTHONPATH=$PWD/'my types'"
    command = f"cd bare; {shlex.quote(sys.executable)} -c 'import px4_types; px4_types.Rpm'"
    for line, code in (("true", 1), (last.partition(": ")[2], 0)):
        script = ["sh", "-c", f"{line}; {command}"]
        done = subprocess.run(script, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
    build("--msg-dir", "bare", "-o", "my types")
    assert "PYTHONPATH" not in capsys.readouterr().out
    monkeypatch.setenv("PYTHONPATH", "/opt/ros")
    build("--msg-dir", "bare", "-o", str(Path("absolute").absolute()))
    assert f"export PYTHONPATH={Path.cwd()}/absolute:$PYTHONPATH\n" in capsys.readouterr().out
    build("--msg-dir", "bare", "-o", ".")
    assert "PYTHONPATH" not in capsys.readouterr().out
    monkeypatch.syspath_prepend(str(Path("src").absolute()))
    build("--msg-dir", "bare", "-o", "src")
    assert "PYTHONPATH" not in capsys.readouterr().out


def test_quiet_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    for arguments in ([], ["--check"], ["--diff"]):
        assert build("-q", "--msg-dir", "bare", *arguments) == 0
        assert capsys.readouterr() == ("", "")


def test_quiet_still_says_what_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("bare"), {"Lamp.msg": "float3 brightness\n"})
    assert build("-q", "--msg-dir", "bare") == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "bare/Lamp.msg:1:1: M301 " in said.err


def test_verbose_names_each_file_written_and_removed(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm", "DebugVect")
    build("-q", "--msg-dir", "bare")
    Path("bare/Rpm.msg").unlink()
    build("-v", "--msg-dir", "bare")
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("wrote ", "removed "))]
    assert f"removed {PACKAGE / 'msg' / '_rpm.py'}" in lines
    assert f"wrote {PACKAGE / 'topics.py'}" in lines
    assert not any("_debug_vect" in line for line in lines)


def test_quiet_and_verbose_exclude_each_other() -> None:
    with pytest.raises(SystemExit) as caught:
        build("-q", "-v")
    assert caught.value.code == 2


# --- Exit code 2, and nothing written


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["--px4", "nowhere"], "S101"),
        (["--msg-dir", "nowhere"], "S101"),
        (["--px4", "bare/Rpm.msg"], "S101"),
        (["--px4", "empty"], "S102"),
        (["--msg-dir", "bare", "--msg-dir", "empty"], "S102"),
        (["--msg-dir", "bare", "--topics", "nowhere.yaml"], "S101"),
        (["--msg-dir", "bare", "--topics", "empty"], "S101"),
        (["--msg-dir", "bare", "--package", "not-a-name"], "S103"),
        (["--msg-dir", "bare", "--package", "class"], "S103"),
        (["--msg-dir", "bare", "--package", "../outside"], "S103"),
        (["--msg-dir", "bare", "--package", "a.b"], "S103"),
        (["--msg-dir", "bare", "--release", "v1.61"], "S105"),
        (["--msg-dir", "bare", "--msg-dir", "bare"], "M204"),
    ],
    ids=" ".join,
)
def test_what_cannot_be_used_is_named_and_nothing_is_written(
    arguments: list[str], code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of("bare", "Rpm")
    Path("empty").mkdir()
    before = content(Path())
    assert build(*arguments) == 2
    said = capsys.readouterr().err
    assert re.search(rf"^\S+:1:1: {code} ", said, re.MULTILINE) or f": {code} " in said
    assert content(Path()) == before


def test_a_release_near_a_known_one_is_suggested(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    assert build("--msg-dir", "bare", "--release", "1.16") == 2
    assert "did you mean 'v1.16'?" in capsys.readouterr().err


def test_a_folder_inside_a_tree_is_answered_with_the_tree(capsys: pytest.CaptureFixture[str]) -> None:
    firmware()
    assert build("--px4", "firmware/src") == 2
    assert re.search(r"S102 .*did you mean '\S*firmware'\?", capsys.readouterr().err)


def test_an_invalid_definition_leaves_the_package_of_before() -> None:
    firmware()
    build("-q", "--px4", "firmware")
    before = identity(PACKAGE)
    Path("firmware/msg/Rpm.msg").write_text("uint64 timestamp\nfloat3 rate\n")
    assert build("-q", "--px4", "firmware", "--depfile", "types.d") == 2
    assert identity(PACKAGE) == before
    assert not Path("types.d").exists()


@pytest.mark.parametrize("place", ["generated", "generated/px4_types", "generated/px4_types/msg"])
def test_a_file_where_a_folder_is_needed_is_an_error(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    write_definitions(Path(), {place: "mine\n"})
    before = content(Path())
    assert build("--msg-dir", "bare") == 2
    assert place in capsys.readouterr().err
    assert content(Path()) == before


def test_a_depfile_that_cannot_be_written_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    folder_of("bare", "Rpm")
    write_definitions(Path(), {"file": "mine\n"})
    assert build("-q", "--msg-dir", "bare", "--depfile", "file/types.d") == 2
    assert "file" in capsys.readouterr().err


def as_an_ordinary_user() -> list[str]:
    """Return the prefix of a command that makes permissions apply to it, even if the tests run as root."""
    if os.geteuid() != 0:
        return []
    tool = shutil.which("setpriv")
    prefix = [str(tool), "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-dac_override,-dac_read_search"]
    if tool is None or subprocess.run([*prefix, "true"], check=False, capture_output=True).returncode != 0:
        pytest.skip("root ignores permissions, and setpriv cannot change that here")
    return prefix


def run(
    *arguments: str, prefix: list[str] | None = None, cwd: Path | None = None, seed: str = "random"
) -> subprocess.CompletedProcess[str]:
    """Run `msggen build` in a separate process."""
    command = [*(prefix or []), sys.executable, "-m", "msggen", "build", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": seed}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("place", [".", "px4_types", "px4_types/msg"])
def test_a_read_only_folder_is_an_error_and_nothing_changes(place: str) -> None:
    prefix = as_an_ordinary_user()
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare", "-o", "out")
    if place == ".":
        shutil.rmtree("out/px4_types")
    else:
        folder_of("bare", "Rpm", "DebugVect")
    before = content(Path("out"))
    locked = Path("out", place)
    locked.chmod(0o555)
    try:
        done = run("--msg-dir", "bare", "-o", "out", prefix=prefix)
    finally:
        locked.chmod(0o755)
    assert done.returncode == 2
    assert re.fullmatch(r"msggen: \S*out\S*: Permission denied\n", done.stderr)
    assert content(Path("out")) == before


# --- The same input gives the same bytes


@pytest.mark.slow
def test_the_bytes_depend_on_no_hash_seed_working_directory_or_place_of_the_sources(tmp_path: Path) -> None:
    copy, far = tmp_path / "copy of the sources", tmp_path / "far" / "away"
    for name in ("msg", "srv"):
        shutil.copytree(ROOT / name, copy / name)
    shutil.copy(ROOT / "dds_topics.yaml", copy)
    far.mkdir(parents=True)
    one = run("-q", "--px4", copy.name, "-o", str(tmp_path / "one"), cwd=tmp_path, seed="1")
    two = run("-q", "--px4", f"../../{copy.name}", "-o", "two", cwd=far, seed="2")
    assert (one.returncode, two.returncode) == (0, 0), one.stderr + two.stderr
    first, second = content(tmp_path / "one"), content(far / "two")
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_a_copy_of_sources_and_package_is_current_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The record does not depend on the location, so a clone is up to date."""
    firmware()
    build("-q", "--px4", "firmware")
    shutil.copytree(tmp_path, tmp_path / "clone", ignore=shutil.ignore_patterns("clone"))
    monkeypatch.chdir("clone")
    age(PACKAGE)
    before = identity(PACKAGE)
    assert build("-q", "--px4", str(tmp_path / "clone" / "firmware")) == 0
    assert identity(PACKAGE) == before


def test_the_order_in_which_the_disk_lists_files_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware()
    build("-q", "--px4", "firmware", "-o", "one")
    listed = os.listdir
    monkeypatch.setattr(os, "listdir", lambda *path: sorted(listed(*path), reverse=True))
    build("-q", "--px4", "firmware", "-o", "two")
    assert content(Path("one")) == content(Path("two"))


# --- Killed builds


class Kill(NamedTuple):
    """The files that a killed run left, and the result of the next run."""

    step: int
    left: dict[str, bytes | str | None]
    exit_code: int
    repaired: dict[str, bytes | str | None]


class Killed(NamedTuple):
    """All kills of one build, with the package before the build and after an uninterrupted one."""

    before: dict[str, bytes | str | None]
    after: dict[str, bytes | str | None]
    kills: list[Kill]
    can_swap: bool


def kill_everywhere(prepare: Path, *arguments: str) -> Iterator[Kill]:
    """Kill the build of `arguments` at each of its steps, each time on a fresh copy of `prepare`."""
    for step in itertools.count():
        shutil.rmtree("out", ignore_errors=True)
        shutil.copytree(prepare, "out")
        if not dies_at(step, lambda: build(*arguments)):
            return
        left = content(Path("out"))
        exit_code = build(*arguments)
        yield Kill(step, left, exit_code, content(Path("out")))


FEW_FILES = ("__init__.py", "cdr.py", "orb_id.py", "py.typed", "topics.py")
"""Some files of each kind that do not belong to one definition: all are written alike, and each adds several kills."""


KILLED_AT_NIGHT = [pytest.param(name, marks=pytest.mark.night) for name in ("first build", "more", "less", "no swap")]


@pytest.fixture(scope="module", params=["changed", *KILLED_AT_NIGHT])
def killed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Killed:
    """The kills at every step of a first build, and of builds after definitions were added, removed and changed."""
    if not hasattr(os, "fork"):
        pytest.skip("needs fork")
    folder = tmp_path_factory.mktemp("killed")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(packages, "FILES", [file for file in packages.FILES if file.path in FEW_FILES])
        lamp, switch = "uint64 timestamp\nfloat32 brightness\n", {"srv/Switch.srv": "bool on\n---\nbool done\n"}
        few, many = {"msg/Lamp.msg": lamp}, {"msg/Lamp.msg": lamp, "msg/Fan.msg": "uint64 timestamp\n", **switch}
        old, new = {
            "first build": (few, many),
            "more": (few, many),
            "no swap": (few, many),
            "less": (many, few),
            "changed": (few, {"msg/Lamp.msg": lamp + "uint8 COLD = 1\n"}),
        }[request.param]
        write_definitions(Path("old"), old)
        write_definitions(Path("new"), new)
        Path("before").mkdir()
        if request.param != "first build":
            build("-q", "--px4", "old", "-o", "before")
        build("-q", "--px4", "new", "-o", "after")
        can_swap = request.param != "no swap" and sys.platform == "linux"
        if not can_swap:
            patch.setattr(swap, "_renameat2", lambda: None)
        kills = list(kill_everywhere(Path("before"), "-q", "--px4", "new", "-o", "out"))
        assert len(kills) > 10
        return Killed(content(Path("before")), content(Path("after")), kills, can_swap)


def code(state: dict[str, bytes | str | None]) -> dict[str, bytes | str | None]:
    """Return what Python can import of a package."""
    return {name: data for name, data in state.items() if name.startswith("px4_types/") and "/." not in name}


@pytest.mark.slow
def test_a_killed_build_leaves_the_old_package_or_the_new_one(killed: Killed) -> None:
    states = [code(killed.before), code(killed.after)]
    found = {code(kill.left) not in states for kill in killed.kills}
    assert found == {False} if killed.can_swap else True in found
    assert {states.index(code(kill.left)) for kill in killed.kills if code(kill.left) in states} == {0, 1}


@pytest.mark.slow
def test_a_killed_build_leaves_only_whole_files(killed: Killed) -> None:
    for kill in killed.kills:
        for name in killed.before.keys() | killed.after.keys():
            if name in kill.left:
                whole = [state[name] for state in (killed.before, killed.after) if name in state]
                # The record differs in between: it names the existing files and those to be written.
                assert kill.left[name] in whole or name.endswith(RECORD), (kill.step, name)


@pytest.mark.slow
def test_a_killed_build_loses_no_file_that_stays(killed: Killed) -> None:
    staying = killed.before.keys() & killed.after.keys()
    assert [(kill.step, staying - kill.left.keys()) for kill in killed.kills if staying - kill.left.keys()] == []


@pytest.mark.slow
def test_a_killed_build_never_leaves_a_record_that_cannot_be_read(killed: Killed) -> None:
    for kill in killed.kills:
        for name, data in kill.left.items():
            if name == f"px4_types/{RECORD}":
                assert data is not None
                assert json.loads(data)["files"]


@pytest.mark.slow
def test_the_next_run_completes_what_a_killed_one_began(killed: Killed) -> None:
    assert [kill.step for kill in killed.kills if kill.exit_code != 0] == []
    unfinished = {
        kill.step: [name for name in killed.after if kill.repaired.get(name) != killed.after[name]]
        for kill in killed.kills
        if not killed.after.items() <= kill.repaired.items()
    }
    assert unfinished == {}


@pytest.mark.slow
def test_the_next_run_removes_what_a_killed_one_wrote_aside_or_had_yet_to_remove(killed: Killed) -> None:
    leftovers = {kill.step: sorted(kill.repaired.keys() - killed.after.keys()) for kill in killed.kills}
    assert {step: names for step, names in leftovers.items() if names} == {}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_killed_build_leaves_no_half_written_depfile_and_the_next_run_no_leftover() -> None:
    folder_of("bare", "Rpm")
    arguments = ["-q", "--msg-dir", "bare", "--depfile", "made/types.d"]
    build(*arguments)
    expected, listing = Path("made/types.d").read_bytes(), os.listdir("made")
    for step in itertools.count():
        Path("made/types.d").unlink()
        if not dies_at(step, lambda: build(*arguments)):
            break
        assert not Path("made/types.d").exists() or Path("made/types.d").read_bytes() == expected
        assert build(*arguments) == 0
        assert os.listdir("made") == listing


def test_an_interrupted_build_says_so_and_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of("bare", "Rpm")
    build("-q", "--msg-dir", "bare")
    folder_of("bare", "DebugVect")
    before = content(Path("generated"))
    opened = itertools.count()

    def interrupted(*_: object) -> None:
        if next(opened) == 0:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", interrupted)
        assert build("-q", "--msg-dir", "bare") == INTERRUPTED
    assert "interrupted" in capsys.readouterr().err
    assert content(Path("generated")) == before


# --- Sources


@pytest.mark.slow
def test_no_source_and_no_output_give_the_embedded_set_in_generated(capsys: pytest.CaptureFixture[str]) -> None:
    assert build() == 0
    assert "px4_types from the embedded PX4 v1.18: 259 messages, " in capsys.readouterr().out
    assert (PACKAGE / "msg" / "_sensor_combined.py").is_file()


def test_a_firmware_tree_gives_types_ids_and_endpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware()
    package = built(monkeypatch, "--px4", "firmware")
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert package.VehicleStatus.__msg__.ros_type == "px4_msgs/msg/VehicleStatus"
    assert sorted(topics.UORB) == [topic.name for topic in topics.ORB_ID]
    assert [endpoint.ros_name for endpoint in topics.ENDPOINTS] == [
        "/fmu/out/vehicle_status_v4",
        "/fmu/in/vehicle_command",
    ]


@pytest.mark.slow
@by_day("name", ["firmware/", "firmware", "../{here}/firmware", "./firmware"], 2)
def test_a_tree_may_be_named_in_any_way(name: str, tmp_path: Path) -> None:
    firmware()
    build("-q", "--px4", "firmware", "-o", "plain")
    assert build("-q", "--px4", name.format(here=tmp_path.name), "-o", "other") == 0
    assert content(Path("plain")) == content(Path("other"))


def test_hidden_files_and_files_of_other_kinds_are_left_out() -> None:
    folder_of("bare", "Rpm")
    write_definitions(Path("bare"), {".#Rpm.msg": "?", "Rpm.msg~": "?", "Rpm.msg.orig": "?", "CMakeLists.txt": "?"})
    assert build("-q", "--msg-dir", "bare") == 0


def conventions(package: Any) -> tuple[str, int]:
    """Return values that identify a release: the DDS name of a versioned topic, and the first id of a subscription."""
    out, into = importlib.import_module(f"{package.__name__}.topics").ENDPOINTS
    return out.dds_name, into.object_id


V1_14 = ("rt/fmu/out/vehicle_status", 1000)
V1_15 = ("rt/fmu/out/vehicle_status", 2048)
V1_16 = ("rt/fmu/out/vehicle_status_v4", 2048)


def test_another_release_makes_a_package_stale() -> None:
    firmware()
    build("-q", "--px4", "firmware")
    assert build("-q", "--px4", "firmware", "--check", "--release", "v1.14") == 1


FIRMWARE_MANIFEST = "<package><name>px4</name><version>1.0.0</version></package>\n"


def test_a_firmware_tree_stays_one_with_a_package_xml_in_its_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """PX4-Autopilot has a package.xml from its ROS 1 days; its name, `px4`, is not that of a message package."""
    tree = firmware(versioned="")
    write_definitions(tree, {"package.xml": FIRMWARE_MANIFEST})
    package = built(monkeypatch, "--px4", tree)
    assert package.VehicleStatus.__msg__.ros_type == "px4_msgs/msg/VehicleStatus"
    assert conventions(package) == V1_14


def px4_msgs(name: str = "px4_msgs") -> Path:
    """Return a ROS 2 package of message definitions."""
    files = {f"msg/{message}.msg": definition(message) for message in (*MESSAGES, *VERSIONED)}
    files["srv/VehicleCommand.srv"] = (ROOT / "srv" / "VehicleCommand.srv").read_text(encoding="utf-8")
    manifest = f'<?xml version="1.0"?>\n<package format="3">\n  <name>{name}</name>\n</package>\n'
    return write_definitions(Path(name), {**files, "package.xml": manifest})


def test_a_ros_package_gives_types_without_endpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    package = built(monkeypatch, "--px4", px4_msgs())
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert package.EscStatus.__msg__.dds_type == "px4_msgs::msg::dds_::EscStatus_"
    assert topics.ENDPOINTS == ()
    assert "vehicle_status" in topics.UORB


def test_a_ros_package_gives_its_types_its_own_name(monkeypatch: pytest.MonkeyPatch) -> None:
    package = built(monkeypatch, "--px4", px4_msgs("our_msgs"))
    assert package.EscStatus.__msg__.ros_type == "our_msgs/msg/EscStatus"


def test_a_ros_package_with_the_firmwares_bridge_has_its_endpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    write_definitions(Path(), {"dds_topics.yaml": BRIDGE})
    assert conventions(built(monkeypatch, "--px4", px4_msgs(), "--topics", "dds_topics.yaml")) == V1_16


def test_a_bare_folder_gives_types_and_ids_without_endpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = folder_of("bare", *MESSAGES)
    package = built(monkeypatch, "--msg-dir", folder)
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert package.EscStatus.__msg__.ros_type == "px4_msgs/msg/EscStatus"
    assert topics.ENDPOINTS == ()
    assert "esc_status" in [topic.name for topic in topics.ORB_ID]


def test_a_bare_folder_may_be_named_with_either_option() -> None:
    folder_of("bare", *MESSAGES)
    build("-q", "--px4", "bare", "-o", "one")
    build("-q", "--msg-dir", "bare", "-o", "two")
    same = {name: data for name, data in content(Path("one")).items() if not name.endswith(FINGERPRINT)}
    assert same.items() <= content(Path("two")).items()


def test_folders_add_up_with_the_tree_and_with_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = firmware()
    alone = built(monkeypatch, "--px4", tree)
    write_definitions(Path("first"), {"msg/MotorGroup.msg": "# Motors.\n\nuint64 timestamp\nEscReport[2] motors\n"})
    write_definitions(Path("second"), {"Aardvark.msg": "# First of all.\n\nuint64 timestamp\nMotorGroup group\n"})
    package = built(monkeypatch, "--px4", tree, "--msg-dir", "first", "--msg-dir", "second")
    group = package.MotorGroup(motors=(package.EscReport(esc_rpm=1), package.EscReport()))
    assert package.Aardvark.decode(package.Aardvark(group=group).encode()).group.motors[0].esc_rpm == 1
    ids = {topic.name: int(topic) for topic in importlib.import_module(f"{package.__name__}.topics").ORB_ID}
    before = {topic.name: int(topic) for topic in importlib.import_module(f"{alone.__name__}.topics").ORB_ID}
    assert ids["aardvark"] == 0
    assert ids["vehicle_status"] == before["vehicle_status"] + 2


def test_the_order_of_folders_changes_no_type_and_no_id() -> None:
    folder_of("one", "Rpm")
    folder_of("two", "DebugVect")
    build("-q", "--msg-dir", "one", "--msg-dir", "two", "-o", "there")
    build("-q", "--msg-dir", "two", "--msg-dir", "one", "-o", "back")
    there, back = content(Path("there")), content(Path("back"))
    assert [name for name in there if there[name] != back[name] and not name.endswith(FINGERPRINT)] == []


def test_a_firmware_tree_stays_one_beside_the_messages_of_a_ros_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tree keeps its conventions and names; the package has its own. Its `msg` folder alone is read as uORB's."""
    tree = firmware(versioned="")
    write_definitions(
        Path("our_msgs"),
        {
            "msg/MotorGroup.msg": "# Motors.\n\nuint64 timestamp\n",
            "package.xml": "<package format='3'><name>our_msgs</name></package>\n",
        },
    )
    for folder, group in (("our_msgs", "our_msgs/msg/MotorGroup"), ("our_msgs/msg", "px4_msgs/msg/MotorGroup")):
        package = built(monkeypatch, "--px4", tree, "--msg-dir", folder)
        assert package.VehicleStatus.__msg__.ros_type == "px4_msgs/msg/VehicleStatus"
        assert conventions(package) == V1_14
        found = package if group.startswith("px4_msgs") else package.our_msgs.msg
        assert found.MotorGroup.__msg__.ros_type == group


def test_topics_given_replace_those_of_the_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    given = (
        BRIDGE.split("subscriptions", maxsplit=1)[0]
        .replace("vehicle_status", "esc_status")
        .replace("VehicleStatus", "EscStatus")
    )
    write_definitions(Path(), {"given.yaml": given})
    package = built(monkeypatch, "--px4", firmware(), "--topics", "given.yaml")
    endpoints = importlib.import_module(f"{package.__name__}.topics").ENDPOINTS
    assert [endpoint.ros_name for endpoint in endpoints] == ["/fmu/out/esc_status"]


def test_topics_given_make_endpoints_of_a_bare_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    folder_of("bare", "Rpm")
    write_definitions(Path(), {"given.yaml": "publications:\n  - topic: /fmu/out/rpm\n    type: px4_msgs::msg::Rpm\n"})
    package = built(monkeypatch, "--msg-dir", "bare", "--topics", "given.yaml")
    (endpoint,) = importlib.import_module(f"{package.__name__}.topics").ENDPOINTS
    assert (endpoint.dds_name, endpoint.message_name) == ("rt/fmu/out/rpm", "Rpm")


@pytest.mark.slow
def test_topics_given_alone_go_with_the_embedded_set(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), {"given.yaml": BRIDGE})
    assert build("--topics", "given.yaml") == 0
    assert re.search(r"px4_types from .*: 259 messages, .* 2 endpoints\b", capsys.readouterr().out, re.MULTILINE)


def test_a_tree_without_a_bridge_gives_types_and_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = firmware()
    (tree / BRIDGE_PLACE).unlink()
    package = built(monkeypatch, "--px4", tree)
    assert importlib.import_module(f"{package.__name__}.topics").ENDPOINTS == ()


def test_a_tree_may_be_named_by_a_link_to_it(tmp_path: Path) -> None:
    tree = firmware()
    Path("linked").symlink_to(tmp_path / tree)
    build("-q", "--px4", tree, "-o", "one")
    assert build("-q", "--px4", "linked", "-o", "two") == 0
    assert content(Path("one")) == content(Path("two"))


@pytest.mark.slow
@by_day(
    ("release", "messages"), [("v1.14", 184), ("v1.16", 226), ("v1.17", 235), ("v1.18", 259), ("main-2026-03", 242)], 4
)
def test_a_real_tree_gives_all_messages_but_the_archived(release: str, messages: int) -> None:
    tree = shared(f"firmware/{release}")
    assert build("-q", "--px4", tree) == 0
    assert len(os.listdir(PACKAGE / "msg")) == messages + 1, "and __init__.py"


# --- Concurrent builds and invalid values


@pytest.mark.parametrize(
    "option", ["--px4", "--msg-dir", "--topics", "--release", "--output", "--package", "--depfile"]
)
def test_an_empty_value_is_refused(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    """An unset variable in a script must not select the default."""
    with pytest.raises(SystemExit) as stopped:
        build(option, "")
    assert stopped.value.code == 2
    assert "empty" in capsys.readouterr().err


def test_a_misspelt_option_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        build("--pxx4", "tree")
    assert stopped.value.code == 2
    assert "did you mean '--px4'?" in capsys.readouterr().err


def test_what_a_source_is_counts_as_input() -> None:
    """The same files follow other conventions in a firmware tree than in a plain folder."""
    message = "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\n"
    write_definitions(Path("in"), {"msg/VehicleStatus.msg": message, "dds_topics.yaml": "publications: []\n"})
    assert build("-q", "--px4", "in") == 0
    assert build("-q", "--px4", "in", "--check") == 0
    Path("in/src/modules").mkdir(parents=True)
    before = json.loads((PACKAGE / FINGERPRINT).read_text())["summary"]
    assert build("-q", "--px4", "in") == 0
    assert json.loads((PACKAGE / FINGERPRINT).read_text())["summary"] != before
