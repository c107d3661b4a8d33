"""Tests of wrong arguments: whatever they are, a command exits with 0, 1 for findings, or 2, and never with a trace."""

from __future__ import annotations

import argparse
import random
from pathlib import Path

import pytest

from msggen.cli import main, parser_for
from support.catalogs import write_definitions

COMMANDS: dict[str, argparse.ArgumentParser] = next(
    action.choices  # type: ignore[misc]
    for action in parser_for([])._actions
    if action.nargs == argparse.PARSER
)
FILES = {
    "dir/msg/Lamp.msg": "uint64 timestamp\n",
    "fw/msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n",
    "fw/src/modules/README": "",
    "dds_topics.yaml": "publications:\n",
    "file": "x\n",
    "name.j2": "{{ message.name }}",
    "name.em": "@message.name",
    "broken.zip": "PK",
    "folder.j2/file": "",
    "odd.px4board": "\0",
}
PATHS = (
    "dir",
    "file",
    "fw",
    "folder.j2",
    "name.j2",
    "name.em",
    "broken.zip",
    "odd.px4board",
    "nowhere",
    "fw/msg/versioned",
)
VALUES = (
    *(*PATHS, "", "\0", "a\0b", "x" * 5000, "x/" * 2000, "\udc80", "\udcff/\udc80", "é", "-", "--", "-1", "~nobody/x"),
    *(
        "@",
        "@HEAD",
        "fw@",
        "fw@HEAD",
        "a=b",
        "=",
        "px4=",
        "=dir",
        "acme=dir",
        "v1.99",
        "embedded:",
        "embedded:v9",
        "Lamp",
    ),
    *("M301", "WIRE,", "dds_topics.yaml", "/dev/null", "file/x", "\n", "a\nb", "{{", "{{ 1/0 }}", "%s", "$(x)", "json"),
    *("sarif", "junit", "github", "message", "catalog", "main", "\u202e", "out", "1e9", "dir/msg/Lamp.msg", "class"),
)
ROUNDS = 25


def command_line(name: str, choose: random.Random) -> list[str]:
    """Return a command with arguments that it has, and values that it may not expect."""
    words = [name]
    known = [action for action in COMMANDS[name]._actions if "--help" not in action.option_strings]
    needed = [action for action in known if action.required or not action.option_strings]
    for action in [*choose.sample(known, min(len(known), choose.randint(0, 5))), *needed]:
        value = choose.choice(VALUES)
        if not action.option_strings:
            words.append(value)
        elif action.nargs == 0:
            words.append(choose.choice(action.option_strings))
        else:
            option = choose.choice(action.option_strings)
            words += choose.choice([[option, value], [option, value], [option, value], [f"{option}={value}"], [option]])
    if choose.random() < 0.1:
        choose.shuffle(words)
    return words


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_no_arguments_lead_to_a_trace_or_to_the_exit_code_of_findings(
    name: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    choose = random.Random(name)  # noqa: S311 - the same arguments in every run
    write_definitions(working_folder, FILES)
    for _ in range(ROUNDS):
        words = command_line(name, choose)
        try:
            code = main(words)
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        assert code in (0, 1, 2), words
        finds = {"check", "breaking", "--check", "--diff", "--dry-run"}
        assert code != 1 or finds & {*words}, words
        told = capsys.readouterr()
        assert (code == 2) <= bool(told.err), words


@pytest.mark.parametrize("argument", ["", "\0", "a\0b"])
@pytest.mark.parametrize("option", ["--px4", "--msg-dir", "--topics", "--output", "--package", "--depfile", "--board"])
def test_no_path_is_empty_or_has_a_nul(option: str, argument: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["build", option, argument])
    assert stopped.value.code == 2
    assert option in capsys.readouterr().err.splitlines()[-1]
