"""Tests that an option means the same in every command that has it."""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.show.report import FORMATS, OF_CHANGES
from msggen.sources.embedded import EMBEDDED
from support.catalogs import write_definitions
from support.commands import COMMANDS, run
from support.examples import by_day
from support.repository import ROOT


def actions(command: str) -> list[argparse.Action]:
    """Return the arguments that the help of a command shows."""
    return [action for action in COMMANDS[command]._actions if action.help is not argparse.SUPPRESS]


def meaning(action: argparse.Action) -> tuple[object, ...]:
    """Return the meaning of an option. The formats are not the same everywhere, nor is their default."""
    formats = "--output-format" in action.option_strings
    choices = None if action.choices is None or formats else tuple(action.choices)
    text = None if formats else action.help
    default = None if formats else action.default
    return (type(action), text, action.type, default, action.metavar, action.nargs, choices)


OF_OTHERS = {
    "log findings": {"--jobs", "-v", "--verbose"},
    "log": {"-o", "--output", "-n", "--count", "--field", "--format", "--types"},
    "doctor": {"--json", "--for", "-v", "--verbose"},
    "topic": {"-t", "-v", "--verbose"},
    "topic plot": {"-o", "--output", "--window"},
    "top": {"--once"},
    "px4-generate": {"--json", "-f"},
}
"""Options that mean what they mean in `ros2 topic`, in the firmware's scripts, or for one command with its actions."""


def meanings() -> dict[str, dict[str, tuple[object, ...]]]:
    """Return the meaning of each spelling, by command. `sim` and `play` are vehicles, and `record` writes a file."""
    found: dict[str, dict[str, tuple[object, ...]]] = defaultdict(dict)
    for command in COMMANDS.keys() - {"sim", "play", "record"}:
        for action in actions(command):
            of_others = OF_OTHERS.get(command.partition(" ")[0], set()) | OF_OTHERS.get(command, set())
            for spelling in {*action.option_strings} - of_others:
                found[spelling][command] = meaning(action)
    return found


SHARED = sorted(spelling for spelling, by_command in meanings().items() if len(by_command) > 1)
"""Spellings that several commands have."""

CHECKED = sorted(meanings()["--check"])
"""Commands that can show what they would change."""


# --- Declarations


@pytest.mark.parametrize("spelling", SHARED)
def test_a_spelling_has_the_same_help_type_and_default_in_every_command(spelling: str) -> None:
    first, *others = meanings()[spelling].items()
    for other in others:
        assert other[1] == first[1], f"{spelling} of {other[0]} and of {first[0]}"


def test_the_shared_options_are_found() -> None:
    assert {"--px4", "--check", "--diff", "--output", "--against", "--topics-only", "--output-format"} <= {*SHARED}


def test_commands_that_write_all_have_check_and_diff_but_the_stand_in_for_scripts() -> None:
    writing = {command for command, parser in COMMANDS.items() if parser.get_default("writes")}
    assert writing - {"px4-generate"} == {*CHECKED} == {*meanings()["--diff"]}


def test_every_format_of_a_command_is_known() -> None:
    formats = {command: action.choices for command in COMMANDS for action in actions(command) if action.choices}
    assert formats["check"] == FORMATS
    assert formats["breaking"] == OF_CHANGES
    assert {*(formats["rules"] or ())} <= {*FORMATS}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_argument_has_help_in_the_same_style(command: str) -> None:
    for action in actions(command):
        assert action.help, action
        assert not action.help.endswith("."), action.help
        assert re.match(r"[a-z.]|C\+\+|B\b", action.help), action.help


@pytest.mark.parametrize("columns", ["80", "200"])
def test_the_help_lists_each_command_in_a_line(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    listed = re.findall(r"(?m)^ {4}(\S+) {2,}\S.*$", run(["--help"]).stdout)
    assert listed == [*dict.fromkeys(command.split()[0] for command in COMMANDS)]


def test_the_help_has_the_commands_in_groups() -> None:
    commands, _, _ = run(["--help"]).stdout.partition("\ncommands:\n")[2].partition("\noptions:\n")
    groups = re.split(r"(?m)^  (\S.*)$", commands)
    found = {
        title: re.findall(r"(?m)^ {4}(\S+) ", text) for title, text in zip(groups[1::2], groups[2::2], strict=True)
    }
    assert [*found] == ["Types", "Firmware in step", "Vehicle", "Recordings", "Help"]
    assert {"build", "docs"} < {*found["Types"]}
    assert {"sync", "check", "breaking"} < {*found["Firmware in step"]}
    assert {"topic", "doctor", "sim"} < {*found["Vehicle"]}
    assert found["Recordings"] == ["record", "play", "log", "mcp"]


PAGES = {command: command for command in ("build", "sync", "check", "bump", "render")}
PAGES |= {"breaking": "check", "docs": "site", "lint": "check", "record": "recordings", "play": "recordings"}


@pytest.mark.parametrize("command", PAGES)
def test_the_page_of_a_command_names_all_its_own_options(command: str) -> None:
    page = (ROOT / "docs" / f"{PAGES[command]}.md").read_text() + (ROOT / "docs" / "build.md").read_text()
    missing = [
        action.option_strings
        for action in actions(command)
        if action.option_strings and "--help" not in action.option_strings
        if not any(re.search(rf"(?<![\w-]){name}(?![\w-])", page) for name in action.option_strings)
    ]
    assert missing == []


# --- --check and --diff

MESSAGE = "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n"
ARGUMENTS = {
    "build": ["--px4", "px4", "-o", "out", "--depfile", "out.d"],
    "bump": ["Lamp", "--px4", "px4", "--against", "old"],
    "docs": ["--px4", "px4", "-o", "out", "--against", "old"],
    "render": ["--template", "names.txt.j2", "--px4", "px4", "-o", "out", "--depfile", "out.d"],
    "sync": ["--px4", "px4", "--create", "px4_msgs"],
}
CHECKS = [["--check"], ["--diff"], ["--check", "--diff"]]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    tree = {
        "msg/versioned/Lamp.msg": MESSAGE,
        "msg/translation_node/translations/all_translations.h": "#pragma once\n",
        "src/modules/README": "",
    }
    write_definitions(tmp_path / "old", tree)
    write_definitions(tmp_path / "px4", tree | {"msg/versioned/Lamp.msg": f"{MESSAGE}float32 level\n"})
    return write_definitions(tmp_path, {"names.txt.j2": "{{ message.name }}\n"})


def state(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Return all files and folders in a folder, with inode, time and content."""
    found = {}
    for path in folder.rglob("*"):
        stat = path.stat()
        found[str(path)] = (stat.st_ino, stat.st_mtime_ns, path.read_bytes() if path.is_file() else b"")
    return found


def test_every_command_with_check_is_tried() -> None:
    assert {*ARGUMENTS} == {*CHECKED}


@by_day(("command", "options"), [*product(ARGUMENTS, CHECKS)], 3)
def test_a_check_writes_nothing_and_exits_with_1_until_nothing_would_change(
    here: Path, command: str, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [command, *ARGUMENTS[command]]
    before = state(here)
    assert main([*arguments, *options]) == FINDINGS
    assert state(here) == before
    shown = capsys.readouterr().out
    assert ("\n+++ " in shown) == ("--diff" in options)
    assert shown.splitlines()[-1]
    assert main(arguments) == DONE
    assert state(here) != before
    written = state(here)
    capsys.readouterr()
    assert main([*arguments, *options]) == DONE
    assert state(here) == written
    assert "+++ " not in capsys.readouterr().out


@pytest.mark.skipif(not shutil.which("patch"), reason="needs patch on the PATH")
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", ARGUMENTS)
def test_a_diff_applied_in_the_current_folder_does_what_the_command_does(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [command, *ARGUMENTS[command]]
    assert main([*arguments, "--diff"]) == FINDINGS
    patch = capsys.readouterr().out
    done = subprocess.run(["patch", "-p0"], input=patch, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done
    if command == "build":
        Path("out/px4_types/py.typed").touch()  # a patch cannot create an empty file
    assert main([*arguments, "--check"]) == DONE


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", ARGUMENTS)
def test_a_quiet_diff_is_nothing_but_a_patch(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, *ARGUMENTS[command], "-q", "--check"]) == FINDINGS
    assert capsys.readouterr().out == ""
    assert main([command, *ARGUMENTS[command], "-q", "--diff"]) == FINDINGS
    shown = capsys.readouterr().out
    assert all(re.match(r"[-+@ \\]|$", line) for line in shown.splitlines())
    assert shown.startswith("--- ")


# --- A Python package and a ROS package


def settings(text: str) -> None:
    Path("pyproject.toml").write_text(f"[tool.msggen]\n{text}\n")


def manifest() -> str:
    return str(re.findall("<name>(.*)</name>", Path("made/package.xml").read_text())[0])


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("setting", "options", "name"),
    [
        ("", [], "made"),
        ("", ["--ros-package", "px4_msgs"], "px4_msgs"),
        ("", ["--ros-package", "my_msgs"], "my_msgs"),
        ('package = "my_types"', [], "made"),
        ('ros-package = "my_msgs"', [], "my_msgs"),
        ('ros-package = "my_msgs"', ["--ros-package", "your_msgs"], "your_msgs"),
    ],
)
def test_the_ros_package_has_the_name_that_is_given(setting: str, options: list[str], name: str) -> None:
    settings(setting)
    assert main(["sync", "-q", "--px4", "px4", "--create", "made", *options]) == DONE
    assert manifest() == name
    assert main(["sync", "-q", "--px4", "px4", "made", "--check", *options]) == DONE


@pytest.mark.usefixtures("here")
def test_the_setting_of_the_ros_package_is_not_that_of_the_python_package() -> None:
    settings('ros-package = "my_msgs"')
    assert main(["build", "-q", "--px4", "px4"]) == DONE
    assert Path("generated/px4_types/__init__.py").is_file()


@pytest.mark.usefixtures("here")
def test_build_does_not_know_the_option_of_sync() -> None:
    told = run(["build", "--ros-package", "my_msgs"]).stderr
    assert "unknown argument '--ros-package': an option of sync\n" in told


@pytest.mark.usefixtures("here")
def test_a_wrong_name_of_a_ros_package_is_reported_at_the_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", "--px4", "px4", "--create", "made", "--ros-package", "My-Msgs"]) == FAILED
    assert capsys.readouterr().err.startswith("--ros-package: S112 'My-Msgs' ")


@pytest.mark.usefixtures("here")
def test_a_wrong_name_of_a_ros_package_is_reported_at_the_setting(capsys: pytest.CaptureFixture[str]) -> None:
    settings('ros-package = "My-Msgs"')
    assert main(["sync", "--px4", "px4", "--create", "made"]) == FAILED
    assert capsys.readouterr().err.startswith("pyproject.toml:2:1: S112 'My-Msgs' ")
    assert not Path("made").exists()


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (["sync", "made", "--ros-pakage", "x"], ", did you mean '--ros-package'?"),
        (["sync", "made", "--package", "x"], "use --ros-package"),
        (["bump", "Lamp", "--dry-run"], "use --check"),
        (["sim", "--release", "v1.16"], "use --px4"),
    ],
)
def test_what_to_write_instead_of_a_wrong_option_is_told(wrong: list[str], told: str) -> None:
    outcome = run(wrong)
    assert outcome.code == FAILED
    assert told in outcome.stderr


# --- Names close to that of an embedded release


def almost() -> Iterator[tuple[str, str]]:
    for release in EMBEDDED:
        yield release.removeprefix("v"), release
        yield f"{release}.0", release
        yield f"{release.removeprefix('v')}.2", release
        yield release.upper(), release


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("name", "release"), [*almost()])
def test_an_embedded_release_that_is_almost_named_is_suggested(
    name: str, release: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["build", "--px4", name]) == FAILED
    assert f"{name}: S101 no such folder, did you mean '{release}'?\n" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "command",
    [
        "build --msg-dir 1.16",
        "sync --create made --px4 1.16",
        "render --template names.txt.j2 -o out --px4 1.16",
        "check 1.16",
        "check px4 1.16",
        "check 1.16 px4",
        "breaking --px4 1.16 --against px4",
    ],
)
def test_it_is_suggested_wherever_a_source_is_named(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(command.split()) == FAILED
    assert "1.16: S101 no such folder, did you mean 'v1.16'?\n" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("folder", [".", "inner"])
def test_an_embedded_release_that_a_setting_almost_names_is_suggested(
    folder: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    settings('px4 = "1.16"')
    Path(folder).mkdir(exist_ok=True)
    monkeypatch.chdir(folder)
    assert main(["build"]) == FAILED
    assert capsys.readouterr().err.splitlines()[0].endswith("1.16': no such folder, did you mean 'v1.16'?")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["1.99", "2.16", "116", "v1.16.0.0", "1.16/px5"])
def test_other_names_get_no_such_suggestion(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--px4", name]) == FAILED
    assert "did you mean 'v" not in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_a_folder_named_like_a_release_is_read() -> None:
    Path("px4").rename("1.16")
    assert main(["build", "-q", "--px4", "1.16"]) == DONE
