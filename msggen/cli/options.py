"""Helpers that declare commands and options, and the options that several commands share."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn, TypeAlias

from msggen.base.diagnostics import input_error
from msggen.cli.values import local_path, non_empty, positive
from msggen.show.report import FORMATS
from msggen.sources.embedded import EMBEDDED

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # noqa: SLF001 - argparse has no public name
Group: TypeAlias = "argparse._ActionsContainer"  # noqa: SLF001 - likewise, for parsers and groups of options

FAILED_CODES = "2 usage, input or I/O error, 130 interrupted by Ctrl-C."
WRITING_CODES = f"Exit codes: 0 done, 1 changes found by --check or --diff, {FAILED_CODES}"
FINDING_CODES = f"Exit codes: 0 no findings that fail the run, 1 findings that fail the run, {FAILED_CODES}"
COMPARING_CODES = f"{FINDING_CODES} Handled findings and warnings do not fail the run."
"""The exit codes for the help: of failed runs, of commands that write, and of those that report findings."""

SOURCE_KINDS = (
    "a PX4-Autopilot tree, a px4_msgs package, a folder of .msg files, PATH@REVISION of one of these in git, "
    "an archive of one, an embedded release such as v1.16, or installed, which is the px4_msgs of ROS"
)


def check_parent(path: str) -> None:
    """Raise an InputError if the folder of a file that is to be written does not exist."""
    folder = os.path.dirname(path) or os.curdir
    if not os.path.isdir(folder):
        raise input_error(path, "R101", f"there is no folder '{folder}': create it first", 0)


def check_free(path: str) -> None:
    """Raise an InputError if a file cannot be created because of its name."""
    if os.path.lexists(path):
        raise input_error(path, "R101", "there is such a file already: choose another name, or remove it", 0)
    check_parent(path)


def write_whole(path: str, content: bytes) -> None:
    """Write a file whole, or leave what was there. Raises InputError."""
    from msggen.base.disk.staging import written_aside

    try:
        with written_aside({os.path.abspath(path): content}, flushed=False) as move_into_place:
            move_into_place()
    except OSError as error:
        raise input_error(path, "R101", f"cannot be written: {error.strerror}", 0) from None


SHARED: Mapping[str, Mapping[str, Any]] = {
    "--px4": {"metavar": "PATH", "type": local_path, "help": "firmware, such as a PX4-Autopilot tree"},
    "--msg-dir": {
        "metavar": "[PKG=]DIR",
        "type": local_path,
        "action": "append",
        "help": "folder of more messages: of external modules, or of another ROS package; repeatable",
    },
    "--topics": {
        "metavar": "FILE",
        "type": local_path,
        "help": "dds_topics.yaml (default: the one of the firmware)",
    },
    "--release": {
        "metavar": "RELEASE",
        "type": non_empty,
        "help": f"release whose conventions apply: {EMBEDDED[-1]} to {EMBEDDED[0]}, main (default: the firmware's own)",
    },
    "--strict": {"action": argparse.BooleanOptionalAction, "help": "treat warnings as errors"},
    "--board": {
        "metavar": "NAME|FILE",
        "type": local_path,
        "help": "board, such as px4_sitl_default, or .px4board file: leave out messages that it does not build",
    },
    "--against": {
        "metavar": "REF|DIR",
        "type": local_path,
        "help": "previous definitions: a revision of the firmware's repository, or another source",
    },
    "--topics-only": {
        "action": argparse.BooleanOptionalAction,
        "help": "take only the messages that cross the bridge, the messages that they nest, and the services",
    },
    "-o, --output": {"metavar": "DIR", "type": local_path, "help": "folder to write to"},
    "--check": {
        "old": "--dry-run",
        "action": "store_true",
        "help": "write nothing; list the changes, exit with 1 if there are any",
    },
    "--diff": {
        "action": "store_true",
        "help": "write nothing; show the changes as a patch, exit with 1 if there are any",
    },
    "--depfile": {
        "metavar": "FILE",
        "type": local_path,
        "help": "write a Makefile rule that lists all inputs, for CMake and Ninja",
    },
    "--list-outputs": {"action": "store_true", "help": "write nothing; list the output files"},
    "--for": {"metavar": "SECONDS", "type": positive, "help": "end after this time"},
    "--field": {
        "metavar": "PATH",
        "type": non_empty,
        "action": "append",
        "default": [],
        "help": "only this value of the topics: nav_state, position[2], esc[0].esc_rpm; repeatable",
    },
    "-q, --quiet": {"action": "store_true", "help": "print only errors and warnings"},
    "--sql-names": {
        "action": "store_true",
        "help": "name columns so that SQL takes them without quotes: q_0 for q[0]",
    },
    "--quote-formulas": {
        "action": "store_true",
        "help": "put ' before text in CSV that a spreadsheet would evaluate: text that begins with =, +, - or @",
    },
    "--json": {"action": "store_true", "help": "print JSON instead of text"},
    "--csv": {"action": "store_true", "help": "print rows under a line with the names: timestamp,q[0],q[1]"},
}
"""Options with the same meaning in every command that has them."""


def add_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], *, writes: bool = False, **about: Any
) -> argparse.ArgumentParser:
    """Return the parser of a new command `name`, which calls `run`. `writes` is True if it may write files."""
    parser = commands.add_parser(name, **{"epilog": f"Exit codes: 0 done, {FAILED_CODES}", **about})
    parser.set_defaults(run=run, parser=parser, writes=writes)
    return parser


def add_group(commands: Commands, name: str, **about: Any) -> Commands:
    """Return the commands of a new command `name` that only has further ones, such as `msggen topic list`."""
    parser = commands.add_parser(name, **{"epilog": f"Exit codes: 0 done, {FAILED_CODES}", **about})
    text = f"one of these; `msggen {name} ACTION --help` lists its options"
    return parser.add_subparsers(prog=parser.prog, metavar="ACTION", required=True, help=text)


class WrongArgumentError(Exception):
    """A wrong argument of the command that `parser` parses. It ends the process with the exit code 2."""

    def __init__(self, parser: argparse.ArgumentParser, text: str) -> None:
        super().__init__(text)
        self.parser = parser


def refuse(options: argparse.Namespace, text: str) -> NoReturn:
    """Raise WrongArgumentError for the command that the options belong to."""
    raise WrongArgumentError(options.parser, text)


def add_shared(group: Group, *names: str, **more: Any) -> None:
    """Add options of `SHARED` by their keys, with arguments of this command in `more`."""
    for name in names:
        add_option(group, *name.split(", "), **{**SHARED[name], **more})


def add_option(group: Group, *names: str, old: str = "", **about: Any) -> None:
    """Add an option, and its `old` spelling, which the help does not list."""
    action = group.add_argument(*names, **about)
    if old:
        hidden = {"dest": action.dest, "default": argparse.SUPPRESS, "help": argparse.SUPPRESS}
        group.add_argument(old, **{**about, **hidden})


def add_repeatable(group: Group, name: str, metavar: str, kind: Callable[[str], Any], text: str) -> None:
    """Add an option that can be given several times: its value is a list, empty without it."""
    group.add_argument(name, metavar=metavar, type=kind, action="append", default=[], help=f"{text}; repeatable")


def add_sources(parser: argparse.ArgumentParser, *further: str) -> argparse._ArgumentGroup:
    """Add the options that name sources, and `further` options of `SHARED`. Return their group."""
    group = parser.add_argument_group("sources", f"A source is {SOURCE_KINDS}.")
    add_shared(group, "--px4", "--msg-dir", "--topics", "--release", "--strict", *further)
    return group


def add_output_format(parser: argparse.ArgumentParser, formats: Sequence[str] = FORMATS) -> None:
    """Add the option that selects one of `formats`, the default first."""
    text = f"{', '.join(formats)} (default: {formats[0]})"
    parser.add_argument("--output-format", choices=formats, default=formats[0], metavar="FORMAT", help=text)


def writes(options: argparse.Namespace) -> bool:
    """Whether the command writes files: not if --check or --diff is given."""
    return options.writes and not any(getattr(options, name, False) for name in ("check", "diff"))
