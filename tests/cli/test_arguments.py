"""Tests of wrong arguments: whatever they are, a command exits with 0, 1 for findings, or 2, and never with a trace."""

from __future__ import annotations

import argparse
import random
import re
import sys
from pathlib import Path

import pytest

from msggen.cli import FAILED, parser_for
from msggen.cli.values import local_path, new_recording, recording
from msggen.live import LinkError
from support.catalogs import write_definitions
from support.commands import COMMANDS, run
from support.examples import by_day, examples
from support.scratch import inside

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
    *("COM_MODE_ARM_CHK=1", "RTL_MIN_DIST=-1e9", "0.1:no-link", "0.2:restart", "1:mode=land"),
    *("M301", "WIRE,", "dds_topics.yaml", "file/x", "\n", "a\nb", "{{", "{{ 1/0 }}", "%s", "$(x)", "json"),
    *("sarif", "junit", "github", "message", "catalog", "main", "\u202e", "out", "1e9", "dir/msg/Lamp.msg", "class"),
)
ROUNDS = examples(25, by_day=1)


def command_line(name: str, choose: random.Random) -> list[str]:
    """Return a command with arguments that it has, and values that it may not expect."""
    words = name.split()
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
    name: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    def fail(*_: object, **_options: object) -> None:
        raise LinkError("no link")

    monkeypatch.setattr("msggen.sim.runner.Runner.serve", interrupt)  # `msggen sim` would not end by itself
    monkeypatch.setattr("msggen.vehicle.vehicle.Vehicle.__init__", fail)  # there is none
    monkeypatch.setattr("msggen.doctor.watching._wait", interrupt)  # nor wait for vehicles
    monkeypatch.setattr("msggen.vehicle.owner.process.serve", fail)  # nor own a link
    monkeypatch.setattr("msggen.vehicle.owned.joining.start_owner", fail)
    choose = random.Random(name)  # noqa: S311 - the same arguments in every run
    write_definitions(working_folder, FILES)
    for _ in range(ROUNDS):
        words = command_line(name, choose)
        outcome = run(words)
        assert outcome.code in (0, 1, 2), words
        finds = {"check", "breaking", "lint", "doctor", "--check", "--diff"}
        assert outcome.code != 1 or finds & {*words}, words
        assert (outcome.code == 2) <= bool(outcome.stderr), words


@pytest.mark.parametrize("argument", ["", "\0", "a\0b"])
@pytest.mark.parametrize("option", ["--px4", "--msg-dir", "--topics", "--output", "--package", "--depfile", "--board"])
def test_no_path_is_empty_or_has_a_nul(option: str, argument: str) -> None:
    outcome = run(["build", option, argument])
    assert outcome.code == 2
    assert option in outcome.stderr.splitlines()[0]


def options_of(name: str) -> list[str]:
    """Return the long options of a command that its help lists."""
    listed = [action for action in COMMANDS[name]._actions if action.help != argparse.SUPPRESS]
    return [option for action in listed for option in action.option_strings if option.startswith("--")]


WAYS = (("{} value", ""), ("{}=value", "github"), ("{}=value", ""), ("{} value", "github"))
"""Ways to give an option: its spelling, and the format of the output.

Each run takes one for a fourth of the options.
"""


@pytest.mark.parametrize("ways", [1, pytest.param(len(WAYS), marks=pytest.mark.night)], ids=["one way", "all ways"])
@by_day("name", COMMANDS, 3)
def test_an_unknown_option_is_reported_before_what_follows_from_it(name: str, ways: int) -> None:
    for place, option in enumerate(options_of(name)[:: 4 // ways]):
        wrong = f"{option[:-2]}x{option[-2:]}"
        for spelling, output_format in (WAYS * 2)[place % len(WAYS) :][:ways]:
            more = ["--output-format", output_format] if output_format else []
            told = run([*name.split(), *spelling.format(wrong).split(), *more])
            assert told.code == 2
            expected = f"unknown argument '{wrong}', did you mean '--"
            assert expected in told.stderr
            assert (f"::error title=usage::msggen {name}: {expected}" in told.stdout) == bool(output_format)


def test_the_examples_of_wrong_arguments() -> None:
    examples = {
        "breaking --agianst HEAD": "msggen breaking: error: unknown argument '--agianst', did you mean '--against'?",
        "breaking -agianst HEAD": "msggen breaking: error: unknown argument '-agianst', did you mean '--against'?",
        "--verison": "msggen: error: unknown argument '--verison', did you mean '--version'?",
        "--px4 v1.16 build": "msggen: error: unknown argument '--px4': name a command first",
        "bump HomePosition VehicleStatus": "unknown argument 'VehicleStatus': expected one MSG per run",
        "check a b c": "unknown argument 'c': expected PKG and B",
        "breaking --px4 v1.18": "required: --against, unless the firmware is in a repository of git",
        "render --message A B": "unknown argument 'B': repeat the option, --message B",
        "render --message=A B C -o -": "unknown argument 'B': repeat the option, --message B",
        "build --msg-dir a b": "unknown argument 'b': repeat the option, --msg-dir b",
        "render bom.txt.j2": "unknown argument 'bom.txt.j2': name the template with --template bom.txt.j2",
        "render --px4 a.em a.em -o -": "unknown argument 'a.em': name the template with --template a.em",
        "render --template a.j2": "the following arguments are required: -o/--output: with -o -, the text is printed",
        "render -o -": "the following arguments are required: --template",
        "build -q a": "unknown argument 'a': name the firmware with --px4 a",
        "breaking --against a --ignore B C": "unknown argument 'C': separate rules by commas: --ignore B,C",
        "breaking --select B, C, D --against a": "unknown argument 'C,': separate rules by commas: --select B,C,D",
        "breaking --against a --ignore=B C": "unknown argument 'C': separate rules by commas: --ignore B,C",
        "breaking --against a v1.17": "unknown argument 'v1.17': name the firmware with --px4 v1.17",
        "bump A B --against C": "unknown argument 'B': expected one MSG per run",
    }
    for words, expected in examples.items():
        outcome = run(words.split())
        assert outcome.code == 2
        error, hint = outcome.stderr.splitlines()
        assert error.endswith(expected)
        program = error.partition(": error: ")[0]
        assert hint == f"for all arguments: {program} --help"


@by_day("name", COMMANDS, 3)
def test_an_option_with_a_single_value_is_given_once(name: str) -> None:
    """Also in another spelling, and with the same value. Whatever else is wrong comes later."""
    for action in COMMANDS[name]._actions:
        if not action.option_strings or action.nargs == 0 or isinstance(action, argparse._AppendAction):
            continue
        value = str(next(iter(action.choices))) if action.choices else "x"
        for spelling in action.option_strings:
            outcome = run([*name.split(), action.option_strings[0], value, spelling, value])
            assert outcome.code == 2
            spellings = "/".join(action.option_strings)
            assert f"error: argument {spellings}: given more than once" in outcome.stderr


def test_values_are_not_taken_for_unknown_arguments() -> None:
    for text in ("-qo out", "-qoout", "-o out -q", "--output=out --quiet", "--output out --px4 -"):
        words = ["build", *text.split(), "--msg-dir", "a", "--msg-dir", "b"]
        options = parser_for(words).parse_args(words)
        assert (options.output, options.msg_dir) == ("out", ["a", "b"])
    words = ["px4-generate", "--headers", "-f", "a", "b", "c", "-o", "d", "-i", "e", "f"]
    options = parser_for(words).parse_args(words)
    assert (options.file, options.outputdir, options.include_paths) == (["a", "b", "c"], "d", ["e", "f"])


def test_a_word_with_a_space_is_a_value() -> None:
    told = run(["breaking", "--select", "--no rule", "--px4=--x"]).stderr
    assert "the following arguments are required: --against" in told


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_the_help_lists_the_exit_codes(name: str) -> None:
    outcome = run([*name.split(), "--help"])
    shown = " ".join(outcome.stdout.split())
    assert outcome.code == 0
    assert "Exit codes: 0 " in shown
    assert "2 usage, input or I/O error, 130 interrupted by Ctrl-C." in shown
    fails = "1 findings that fail the run" in shown and "Handled findings and warnings do not fail the run." in shown
    assert fails == (name in {"check", "breaking"})


ADDRESSES = {
    **{
        (f"log {name}", "file"): recording
        for name in ("info", "show", "findings", "plot", "report", "compare", "convert", "cut", "repair")
    },
    **{(f"log {name}", "output"): new_recording for name in ("convert", "cut", "merge", "repair")},
    ("log merge", "files"): recording,
}
"""The types of arguments that can be addresses in stores."""
PATH = re.compile("DIR|FILE|PATH|PKG|^B$")
"""The metavars of paths."""


@pytest.mark.parametrize("name", COMMANDS)
def test_every_argument_that_is_a_path_refuses_urls(name: str) -> None:
    for action in COMMANDS[name]._actions:
        is_ignored = "ignored" in str(action.help) or action.dest == "field"
        if PATH.search(str(action.metavar or "")) and not is_ignored:
            assert action.type is ADDRESSES.get((name, action.dest), local_path), f"{name} {action.dest}"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("s3://bucket/fleet", "copy files of s3:// with another program, or mount it"),
        ("GS://bucket", "copy files of gs:// with another program, or mount it"),
        ("px4_msgs=git+ssh://host/x", "copy files of git+ssh:// with another program, or mount it"),
        pytest.param("file:///a%20b/c", "name /a b/c", marks=pytest.mark.skipif(sys.platform == "win32", reason="/")),
    ],
)
def test_a_url_is_an_error_and_nothing_is_written(text: str, hint: str, tmp_path: Path) -> None:
    words = (["build", "-o", text], ["build", "--msg-dir", text, "-o", "x"])
    with inside(tmp_path):
        for each in (*words, ["view", text], ["docs", "-o", text], ["sync", text], ["record", "-o", text]):
            outcome = run(each)
            assert outcome.code == FAILED
            assert outcome.stderr.startswith(f"{text}: S131 a URL, expected a path: {hint}\n")
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["C://x", "c:\\x", "./s3://x", "a/b://c", "://x", "s3:/x", "main@https", "1.2://x"])
def test_other_paths_are_no_urls(text: str) -> None:
    assert local_path(text) == text
