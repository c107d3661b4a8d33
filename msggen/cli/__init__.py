"""The command line: arguments, settings and exit codes.

It uses argparse, because larger libraries take longer to import than a build with nothing to do (docs/libraries.md).
"""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from msggen import __version__
from msggen.cli.options import DONE, FAILED, FINDINGS, writes
from msggen.cli.printing import print_annotations, print_errors, print_notices, terminal_width
from msggen.diagnostics import InputError, printable, suggestion

__all__ = ["DONE", "FAILED", "FINDINGS", "main"]

_MODULES = {
    "build": "build",
    "sync": "sync",
    "check": "check",
    "breaking": "breaking",
    "bump": "bump",
    "render": "render",
    "px4-generate": "px4_generate",
    "releases": "releases",
    "rules": "rules",
    "explain": "rules",
}
"""The module of each command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run msggen with `arguments`, by default those of this process, and return the exit code."""
    if arguments is None:
        gc.disable()  # there are few cycles, and collecting them costs more than it frees
        atexit.register(gc.freeze)  # so that Python does not collect at exit either
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # the terminal may not be able to show every name
    options = argparse.Namespace(writes=True)
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        options, unknown = _parser(words).parse_known_args(words)
        if unknown:
            shown = [name for name, action in options.known.items() if action.help is not argparse.SUPPRESS]
            options.parser.error(f"unknown argument '{unknown[0]}'{suggestion(unknown[0], shown)}")
        return _run(options)
    except InputError as error:
        with suppress(BrokenPipeError):
            print_notices(error.notices)
            print_errors(error.diagnostics, ", nothing written" if options.writes else "")
            print_annotations(error.diagnostics, options)
            return FAILED
        _discard_output()
        return FAILED
    except BrokenPipeError:
        _discard_output()
        return DONE if writes(options) else FINDINGS  # commands that write do so before they print
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"msggen: {printable(f'{place}{error.strerror or error}')}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("msggen: interrupted, nothing is half-written", file=sys.stderr)
        return FAILED


def _run(options: argparse.Namespace) -> int:
    code = int(options.run(options))
    print(end="", flush=True)  # here, so that a BrokenPipeError is caught
    return code


def _discard_output() -> None:
    """Discard the remaining output, because the reader has closed the pipe."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - it is open until the process ends


class _Formatter(argparse.HelpFormatter):
    """A formatter that keeps the longest command on one line with its help."""

    def add_argument(self, action: argparse.Action) -> None:
        super().add_argument(action)
        if action.nargs == argparse.PARSER:
            self._action_max_length += 2  # argparse ignores the indentation of commands


class _Parser(argparse.ArgumentParser):
    """A parser that suggests the nearest choice of an option or a command."""

    def __init__(self, **about: Any) -> None:
        width = terminal_width(80) - 2  # once, because argparse makes a formatter for each option

        def formatter(prog: str) -> argparse.HelpFormatter:
            return _Formatter(prog, width=width)

        super().__init__(formatter_class=formatter, allow_abbrev=False, **about)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            choices = list(map(str, action.choices))
            hint = suggestion(str(value), choices)
            raise argparse.ArgumentError(action, f"invalid choice: {value!r} (choose from {', '.join(choices)}){hint}")


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Return a parser of the command that `words` start with, or of all commands if they start with none.

    Adding a command takes time, so the others are not added.
    """
    parser = _Parser(
        prog="msggen",
        description="Generate Python types, CDR codecs and a topic registry from PX4's message definitions, and keep "
        "ROS 2 packages up to date with them.",
    )
    parser.add_argument("--version", action="version", version=f"msggen {__version__}")
    commands = parser.add_subparsers(prog=parser.prog, metavar="COMMAND", required=True)
    known = _MODULES.get(words[0]) if words else None
    for module in dict.fromkeys([known] if known else _MODULES.values()):
        __import__(f"msggen.cli.{module}", fromlist=["add_to"]).add_to(commands)  # importlib would take longer
    return parser
