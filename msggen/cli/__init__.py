"""The command line: arguments, settings and exit codes; everything it does is done elsewhere.

argparse on purpose: larger libraries take longer to import than a build with nothing to do (docs/libraries.md).
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
from importlib import import_module
from typing import Any

from msggen import __version__
from msggen.cli.common import DONE, FAILED, FINDINGS, print_annotations, print_faults, print_notices, terminal_width
from msggen.diagnostics import InputError, suggestion

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
"""Which module has a command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, by default that of this process; return the exit code."""
    if arguments is None:
        gc.disable()  # hardly anything here refers to itself: looking for it would take longer than it is worth
        atexit.register(gc.freeze)  # nor need it be looked for when Python ends
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a name that the terminal cannot show must not end the run
    options = argparse.Namespace(writes=True)
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        options, unknown = _parser(words).parse_known_args(words)
        if unknown:
            options.parser.error(f"unknown argument '{unknown[0]}'{suggestion(unknown[0], options.known)}")
        return _run(options)
    except InputError as error:
        with suppress(BrokenPipeError):
            print_notices(error.notices)
            print_faults(error.diagnostics, "nothing written" if options.writes else "cannot tell")
            print_annotations(error.diagnostics, options)
            return FAILED
        _say_no_more()
        return FAILED
    except BrokenPipeError:
        _say_no_more()
        return DONE if _has_written(options) else FINDINGS
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"msggen: {place}{error.strerror or error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("msggen: interrupted, nothing is half-written", file=sys.stderr)
        return FAILED


def _run(options: argparse.Namespace) -> int:
    code = int(options.run(options))
    print(end="", flush=True)  # now, not when Python ends, who has no good word for a reader that has left
    return code


def _say_no_more() -> None:
    """Whoever read us has left: what was not printed yet goes nowhere."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - it is open until the process ends


def _has_written(options: argparse.Namespace) -> bool:
    """Whether the command was to write, as it then has before it prints."""
    return options.writes and not any(getattr(options, name, False) for name in ("check", "diff", "dry_run"))


class _Formatter(argparse.HelpFormatter):
    """Fits the terminal. One is made for each option that is added, long before anyone asks for help."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=terminal_width(80) - 2)


class _Parser(argparse.ArgumentParser):
    """Suggests the nearest choice, of commands too."""

    def __init__(self, **about: Any) -> None:
        super().__init__(formatter_class=_Formatter, allow_abbrev=False, **about)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            choices = list(map(str, action.choices))
            hint = suggestion(str(value), choices)
            raise argparse.ArgumentError(action, f"invalid choice: {value!r} (choose from {', '.join(choices)}){hint}")


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser of the command that `words` begin with, or of all: each of them takes time to make."""
    parser = _Parser(
        prog="msggen",
        description="PX4's message definitions in; Python types, CDR codecs and a topic registry out.",
    )
    parser.add_argument("--version", action="version", version=f"msggen {__version__}")
    commands = parser.add_subparsers(prog=parser.prog, metavar="COMMAND", required=True)
    known = _MODULES.get(words[0]) if words else None
    for module in dict.fromkeys([known] if known else _MODULES.values()):
        import_module(f"msggen.cli.{module}").add_to(commands)
    return parser
