"""Tests of the commands that mend findings: each format names them, and after they ran the findings are gone."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.show.report import OF_CHANGES
from support.examples import by_day
from support.packages import committed, firmware, package, plain_package

TOO = ("--output-format", "json")


@pytest.fixture(autouse=True)
def _here(working_folder: Path) -> None:
    """Create a firmware in the current folder, which is a temporary one."""
    assert working_folder.samefile(Path.cwd())
    firmware()


def edit_firmware() -> None:
    """Change a message of the firmware."""
    path = Path("firmware/msg/Rpm.msg")
    path.write_text(path.read_text(encoding="utf-8") + "float32 newer\n", encoding="utf-8")


def report(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    main([*arguments, *TOO])
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["findings"]
    return found


def run(command: str) -> int:
    program, *arguments = shlex.split(command)
    assert program == "msggen"
    return main(arguments)


PACKAGES: list[tuple[str, list[str]]] = [
    ("px4_msgs", []),
    ("a package", ["--ros-package", "px4_msgs"]),
    ("acme_msgs", []),
]
MORE: list[list[str]] = [[], ["--topics-only"], ["--release", "v1.16"]]


@by_day(("name", "options", "more"), [(*each, more) for each in PACKAGES for more in MORE], 4)
def test_sync_mends_all_findings_of_check(
    name: str, options: list[str], more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sync", "-q", "--px4", "firmware", "--create", *options, name]) == DONE
    edit_firmware()
    Path(name, "msg", "VehicleCommand.msg").write_text("uint64 timestamp\n")
    found = report(capsys, "check", "--px4", "firmware", *more, name)
    commands = {each["remedy"] for each in found}
    assert len(found) > 1
    [command] = commands
    assert run(command) == DONE
    assert report(capsys, "check", "--px4", "firmware", *more, name) == []


@pytest.mark.parametrize("name", ["px4_msgs", "acme_msgs"])
def test_a_package_of_topics_only_stays_one(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", "-q", "--px4", "firmware", "--create", "--topics-only", name]) == DONE
    assert main(["check", "--px4", "firmware", name]) == DONE
    Path(name, "msg/EscStatus.msg").write_text("uint64 timestamp\n")
    [command] = {each["remedy"] for each in report(capsys, "check", "--px4", "firmware", name)}
    assert command == f"msggen sync --px4 firmware --topics-only {name}"
    before = sorted(Path(name, "msg").iterdir())
    assert run(command) == DONE
    assert sorted(Path(name, "msg").iterdir()) == before
    found = report(capsys, "check", "--px4", "firmware", "--no-topics-only", name)
    [command] = {each["remedy"] for each in found}
    assert command == f"msggen sync --px4 firmware --no-topics-only {name}"
    assert run(command) == DONE
    assert report(capsys, "check", "--px4", "firmware", name) == []


@pytest.mark.parametrize("make", [package, plain_package])
def test_sync_removes_what_the_firmware_no_longer_has(
    make: Callable[[], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    make()
    Path("firmware/msg/Rpm.msg").unlink()
    [found] = report(capsys, "check", "--px4", "firmware", "px4_msgs")
    assert found["rule"] == "DEFINITION_ADDED"
    assert run(found["remedy"]) == DONE
    assert main(["check", "--px4", "firmware", "px4_msgs"]) == DONE


def test_a_package_from_another_source_is_not_compared_with_the_embedded_release(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for path in Path("firmware").rglob("*.[ms][sr][gv]"):
        path.write_text(path.read_text() + "# of the firmware\n")
    package()
    assert main(["check", "px4_msgs"]) == FAILED
    text = "msggen wrote this package from another source than the embedded PX4 v1.18: name it with --px4"
    assert capsys.readouterr() == ("", f"px4_msgs: S128 {text}\n1 error\n")
    assert main(["check", "--px4", "firmware", "px4_msgs"]) == DONE


@pytest.mark.parametrize("output_format", ["full", "concise", "github"])
def test_the_note_about_a_firmware_that_nobody_named_is_repeated_at_the_end(
    output_format: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plain_package()
    assert main(["check", "px4_msgs", "--output-format", output_format]) == FINDINGS
    text = "no firmware was named, so these are differences from the embedded PX4 v1.18: name the firmware with --px4"
    text += "; `msggen lint --msg-dir DIR` checks definitions of your own"  # as most of the firmware's are missing
    assert capsys.readouterr().out.splitlines()[-2] == text


def test_a_plain_package_is_mended_but_for_definitions_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    plain_package()
    edit_firmware()
    Path("px4_msgs/msg/Own.msg").write_text("uint64 timestamp\n")
    found = report(capsys, "check", "--px4", "firmware", "px4_msgs")
    own = [each for each in found if each["subject"] == "Own"]
    assert [each["remedy"] for each in own] == [None]
    [command] = {each["remedy"] for each in found if each not in own}
    assert run(command) == DONE
    assert [each for each in report(capsys, "check", "--px4", "firmware", "px4_msgs") if each["remedy"]] == []


@pytest.mark.parametrize("how", ["option", "setting", "here"])
def test_the_command_names_the_firmware_only_if_it_has_to(
    how: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    package()
    side = "px4_msgs"
    if how == "setting":
        Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\n')
    elif how == "here":
        Path("firmware/src/modules").mkdir(parents=True, exist_ok=True)
        monkeypatch.chdir("firmware")
        side = "../px4_msgs"
    Path(side, "msg", "Rpm.msg").write_text("uint64 timestamp\n")
    named = ("--px4", "firmware") if how == "option" else ()
    [command] = {each["remedy"] for each in report(capsys, "check", *named, side) if each["remedy"]}
    assert command == " ".join(["msggen sync", *named, side])
    assert run(command) == DONE
    assert main(["check", *named, side]) == DONE


@by_day("more", [[], ["--topics-only"]], 2)
def test_the_embedded_release_that_nobody_named_gets_a_note_and_no_remedy(
    more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    note = "{}: S126 note: compared with the embedded PX4 v1.18, because no firmware was named: name it with --px4\n"
    package()
    assert {each["remedy"] for each in report(capsys, "check", *more, "px4_msgs")} == {None}
    assert main(["check", *more, "px4_msgs"]) == FINDINGS
    told = capsys.readouterr()
    assert told.err == note.format("px4_msgs")
    assert "to fix:" not in told.out
    assert main(["sync", "-q", "--create", "fresh", "--ros-package", "px4_msgs"]) == DONE
    assert main(["check", *more, "fresh"]) == DONE
    assert capsys.readouterr().err == note.format("fresh")
    assert main(["check", *more, "--px4", "v1.18", "fresh"]) == DONE
    assert main(["check", *more, "v1.18", "fresh"]) == DONE
    assert "S126" not in capsys.readouterr().err


def test_a_folder_or_two_sides_have_no_command(capsys: pytest.CaptureFixture[str]) -> None:
    package()
    edit_firmware()
    assert {each["remedy"] for each in report(capsys, "check", "firmware", "px4_msgs")} == {None}
    Path("px4_msgs/package.xml").unlink()
    assert {each["remedy"] for each in report(capsys, "check", "--px4", "firmware", "px4_msgs")} == {None}


VERSIONED = "uint32 MESSAGE_VERSION = {}\nuint64 timestamp\n"


@pytest.fixture
def tree() -> Path:
    """A committed tree with one versioned message, and with its change."""
    made = Path("my px4")
    (made / "msg/versioned").mkdir(parents=True)
    (made / "src/modules").mkdir(parents=True)
    headers = made / "msg/translation_node/translations"
    headers.mkdir(parents=True)
    (headers / "all_translations.h").write_text("#pragma once\n")
    (made / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(0))
    committed(made)
    (made / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(0) + "uint8 x\n")
    return made


@pytest.mark.tools("git")
@pytest.mark.parametrize("raised", [False, True])
@pytest.mark.parametrize("inside", [False, True])
def test_bump_mends_the_findings_about_versions(
    *, raised: bool, inside: bool, tree: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if raised:
        (tree / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(1) + "uint8 x\n")
    options = ["--px4", str(tree)]
    if inside:
        monkeypatch.chdir(tree)
        options = []
    arguments = ["breaking", *options, "--against", "HEAD"]
    found = report(capsys, *arguments)
    assert {each["rule"] for each in found} == (
        {"VERSION_NOT_ARCHIVED", "TRANSLATION_MISSING", "FIELD_ADDED"}
        if raised
        else {"VERSION_NOT_RAISED", "FIELD_ADDED"}
    )
    [command] = {each["remedy"] for each in found}
    assert command == shlex.join(["msggen", "bump", "Lamp", *options, "--against", "HEAD"])
    assert run(command) == DONE
    found = report(capsys, *arguments)
    assert {each["rule"] for each in found if each["category"] == "VERSION"} == {"TRANSLATION_UNFINISHED"}
    assert {each["remedy"] for each in found} == {None}
    assert {each["rule"] for each in found if each["fails"]} == {"FIELD_ADDED"}
    header = Path("" if inside else tree, "msg/translation_node/translations/translation_lamp_v1.h")
    header.write_text(re.sub("// TODO.*", "", header.read_text()))
    assert [each["rule"] for each in report(capsys, *arguments) if each["fails"]] == []


@pytest.mark.tools("git")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("float32 voltage  # [V] Voltage of the lamp", "float32 voltage_v  # [V] Voltage of the lamp"),
        ("float32 power", "uint16 power"),
    ],
)
def test_a_field_that_is_only_set_to_a_constant_is_not_translated(
    old: str, new: str, tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The comments with TODO are gone, but the value of the other version is lost."""
    lamp = tree / "msg/versioned/Lamp.msg"
    lamp.write_text(f"{VERSIONED.format(0)}{old}\n")
    committed(tree)
    lamp.write_text(f"{VERSIONED.format(0)}{new}\n")
    assert main(["bump", "Lamp", "--px4", str(tree)]) == DONE
    header = tree / "msg/translation_node/translations/translation_lamp_v1.h"
    text = re.sub("// .*", "", header.read_text())
    names = f"older.{old.split()[1]}", f"newer.{new.split()[1]}"
    for lost in (2, 1, 0):
        header.write_text(text)
        found = report(capsys, "breaking", "--px4", str(tree))
        unfinished = [each["message"] for each in found if each["rule"] == "TRANSLATION_UNFINISHED"]
        assert [message.count("to a constant") for message in unfinished] == [lost][:lost]
        assert any(each["fails"] for each in found) == bool(lost)
        if lost:
            target, source = names[lost - 1], names[lost - 2]
            text, count = re.subn(rf"{target} = 0[^;]*;", f"{target} = {source};", text)
            assert count == 1


@pytest.mark.tools("git")
def test_nested_messages_come_first(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nested = {"Array": "Lamp lamp\n", "Zone": "Array array\n"}
    for name, field in nested.items():
        (tree / f"msg/versioned/{name}.msg").write_text(VERSIONED.format(0) + field)
    (tree / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(0))
    committed(tree)
    (tree / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(0) + "uint8 x\n")
    assert main(["breaking", "--px4", str(tree), "--against", "HEAD", "--output-format", "concise"]) == FINDINGS
    commands = [line.split()[4] for line in capsys.readouterr().out.splitlines() if line.startswith("to fix:")]
    assert commands == ["Lamp", "Array", "Zone"]


@pytest.mark.tools("git")
def test_strict_fails_because_of_warnings(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["breaking", "--px4", str(tree), "--against", "HEAD", "--select", "TRANSLATION_UNFINISHED"]
    assert main(["bump", "Lamp", "--px4", str(tree)]) == DONE
    assert main(arguments) == DONE
    assert main([*arguments, "--strict"]) == FINDINGS
    [found] = report(capsys, *arguments, "--strict")
    assert (found["severity"], found["fails"]) == ("error", True)
    header = tree / "msg/translation_node/translations/translation_lamp_v1.h"
    assert found["location"]["path"] == str(header)
    assert "TODO" in header.read_text().splitlines()[found["location"]["line"] - 1]
    Path("pyproject.toml").write_text(
        "[tool.msggen]\nstrict = true\n[tool.msggen.per-message-ignores]\nLamp = ['TRANSLATION_UNFINISHED']\n"
    )
    assert main(arguments) == DONE


@pytest.mark.tools("git")
def test_bump_is_not_named_where_it_cannot_help(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tree / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(3) + "uint8 x\n")
    found = report(capsys, "breaking", "--px4", str(tree), "--against", "HEAD")
    assert {each["remedy"] for each in found} == {None}
    for release in ("v1.16", "v1.17"):
        found = report(capsys, "breaking", "--px4", "v1.18", "--against", release)
        assert {each["remedy"] for each in found} == {None}
    subprocess.run(["git", "checkout", "-q", "."], cwd=tree, check=True)
    (tree / "msg/versioned/Lamp.msg").write_text(VERSIONED.format(0) + "uint8 x\n")
    committed(tree)
    found = report(capsys, "breaking", "--px4", f"{tree}@HEAD", "--against", "HEAD~1")
    assert found
    assert {each["remedy"] for each in found} == {None}


@pytest.mark.tools("git")
@pytest.mark.parametrize("output_format", ["full", "concise", "github"])
def test_an_intended_change_of_a_package_can_be_accepted(
    output_format: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy("firmware/src/modules/uxrce_dds_client/dds_topics.yaml", package())
    committed(Path("px4_msgs"))
    edit_firmware()
    assert main(["sync", "-q", "--px4", "firmware", "px4_msgs"]) == DONE
    yaml = Path("px4_msgs/dds_topics.yaml")
    yaml.write_text(yaml.read_text().replace("/fmu/out/vehicle", "/other/vehicle"))
    arguments = ["breaking", "--px4", "px4_msgs", "--against", "HEAD"]
    assert main([*arguments, "--output-format", output_format]) == FINDINGS
    advice = capsys.readouterr().out.splitlines()[-2]
    rows = re.findall(r'(?:\w+|"[\w/]+") = \[[^\]]*\]', advice)
    assert rows == ['"/other/vehicle_status" = ["TOPIC_MOVED"]', 'Rpm = ["FIELD_ADDED"]']
    Path("pyproject.toml").write_text("\n".join(["[tool.msggen.per-message-ignores]", *rows]))
    assert main(arguments) == DONE
    assert "accept" not in capsys.readouterr().out


@pytest.mark.tools("git")
@pytest.mark.usefixtures("tree")
@pytest.mark.parametrize("output_format", OF_CHANGES)
def test_every_format_names_the_command(output_format: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["breaking", "--px4", "my px4", "--against", "HEAD", "--output-format", output_format]
    assert main(arguments) == FINDINGS
    shown = capsys.readouterr().out
    command = "msggen bump Lamp --px4 'my px4' --against HEAD"
    if output_format == "markdown":
        assert f"- to fix: {command}" in shown
    elif output_format in ("summary", "full", "concise"):
        assert shown.splitlines()[-2] == f"to fix: {command}"
        assert shown.count(command) == 1
    elif output_format == "github":
        assert f"found 0%0Ato fix: {command}\n" in shown
    else:
        assert command in shown
