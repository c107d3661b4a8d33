"""Runs of msggen's commands in this process, with their output."""

from __future__ import annotations

import argparse
import io
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple

from msggen.cli import main, parser_for


def _commands(parser: argparse.ArgumentParser, front: str = "") -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in parser._actions:
        if action.nargs == argparse.PARSER:
            for name, command in dict(action.choices or {}).items():
                further = dict(_commands(command, f"{front}{name} "))
                yield from further.items() or [(f"{front}{name}", command)]


COMMANDS = dict(_commands(parser_for([])))
"""The parser of every command that does something, by its words: `build`, `topic list`."""


class Outcome(NamedTuple):
    """The exit code of a command, and its output."""

    code: object
    stdout: str
    stderr: str


class _Output(io.TextIOWrapper):
    """A stream as that of a process, to which bytes can be written, too."""

    buffer: io.BytesIO


def run(arguments: Sequence[str]) -> Outcome:
    """Run msggen. An exception other than SystemExit is raised."""
    stdout, stderr = (_Output(io.BytesIO(), "utf-8", newline="\n", write_through=True) for _ in range(2))
    with redirect_stdout(stdout), redirect_stderr(stderr):
        try:
            code: object = main(list(arguments))
        except SystemExit as done:
            code = done.code
    return Outcome(code, *(stream.buffer.getvalue().decode() for stream in (stdout, stderr)))


def exit_code(arguments: Sequence[str]) -> int:
    """Return the exit code of msggen, whose output goes to the streams of this process."""
    try:
        return main(list(arguments))
    except SystemExit as done:
        return int(done.code or 0)


def check_outcome(outcome: Outcome) -> None:
    """Check that the exit code is 0, 1 or 2, that 2 is explained, and that there is no trace."""
    assert outcome.code in (0, 1, 2), outcome
    assert "Traceback" not in outcome.stderr, outcome.stderr
    assert outcome.code != 2 or outcome.stderr.strip(), "failed without a message"
