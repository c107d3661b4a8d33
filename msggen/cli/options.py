"""Helpers that declare commands and arguments, and the options that several commands share."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn, TypeAlias

from msggen.base.diagnostics import input_error
from msggen.cli.values import local_path, non_empty, positive
from msggen.show.report import FORMATS
from msggen.sources.embedded import EMBEDDED

Run: TypeAlias = "Callable[[argparse.Namespace], int | None]"
"""What runs a command, and returns the exit code: None for 0, done."""
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # noqa: SLF001 - argparse has no public name
Adder: TypeAlias = "Callable[[Commands], None]"
"""What adds a command to others."""
Group: TypeAlias = "argparse._ActionsContainer"  # noqa: SLF001 - likewise, for parsers and groups of options

FAILED_CODES = "2 usage, input or I/O error, 130 interrupted by Ctrl-C."
_DONE_CODES = f"Exit codes: 0 done, {FAILED_CODES}"
ENDED_CODES = f"Exit codes: 0 done, or ended by Ctrl-C, {FAILED_CODES}"
WRITING_CODES = f"Exit codes: 0 done, 1 changes found by --check or --diff, {FAILED_CODES}"
FINDING_CODES = f"Exit codes: 0 no findings that fail the run, 1 findings that fail the run, {FAILED_CODES}"
COMPARING_CODES = f"{FINDING_CODES} Handled findings and warnings do not fail the run."
"""The exit codes for the help: of failed runs, of commands that go on, that write, and that report findings."""

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
    "--for": {"dest": "seconds", "metavar": "SECONDS", "type": positive, "help": "end after this time"},
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


def new_command(
    name: str,
    summary: str,
    description: str,
    *,
    epilog: str = _DONE_CODES,
    writes: bool = False,
) -> Callable[[Callable[[argparse.ArgumentParser], Run]], Adder]:
    """Return a decorator of a function that adds the arguments of a command to its parser, and returns what runs it.

    `summary` is the help in the list of commands. `writes` is True if the command may write files.
    """

    def decorated(add: Callable[[argparse.ArgumentParser], Run]) -> Adder:
        def add_to(commands: Commands) -> None:
            parser = commands.add_parser(name, help=summary, description=description, epilog=epilog)
            parser.set_defaults(run=add(parser), parser=parser, writes=writes)

        return add_to

    return decorated


def new_group(
    name: str,
    summary: str,
    description: str,
    actions: Iterable[Adder],
    *,
    epilog: str = _DONE_CODES,
    **defaults: Any,
) -> Adder:
    """Return what adds a command that only has further ones, such as `msggen topic list`, with defaults of theirs."""

    def add_to(commands: Commands) -> None:
        parser = commands.add_parser(name, help=summary, description=description, epilog=epilog)
        text = f"one of these; `msggen {name} ACTION --help` lists its options"
        added = parser.add_subparsers(prog=parser.prog, metavar="ACTION", required=True, help=text)
        for add in actions:
            add(added)
        for each in added.choices.values():
            each.set_defaults(**defaults)

    return add_to


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
        group.add_argument(*name.split(", "), **{**SHARED[name], **more})


def add_value(group: Group, names: str, metavar: str, kind: Callable[[str], Any], text: str, **more: Any) -> None:
    """Add an argument with a value. `names` are written as the keys of `SHARED`, `kind` converts the value."""
    group.add_argument(*names.split(", "), metavar=metavar, type=kind, help=text, **more)


def add_flag(group: Group, names: str, text: str) -> None:
    """Add an option without a value."""
    group.add_argument(*names.split(", "), action="store_true", help=text)


def add_repeatable(group: Group, name: str, metavar: str, kind: Callable[[str], Any], text: str) -> None:
    """Add an option that can be given several times: its value is a list, empty without it."""
    add_value(group, name, metavar, kind, f"{text}; repeatable", action="append", default=[])


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
